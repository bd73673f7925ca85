//! The shortfall of the widths of ghosts by first-order optics.
//!
//! A ghost of two reflections spreads the light of the entrance pupil over a disc that is `|A|` times as wide, where
//! `A` is the height at the image of the unfolded ray of height 1 that arrives along the axis. Its irradiance is
//! `T/A²` of that at the entrance, where T is what both surfaces reflect and all others let pass at normal
//! incidence. It is kept below a share e by `|A| ≥ √(T/e)`, and the residual is what `|A|` lacks of that, relative to
//! it: 1 for a ghost in focus, however bright. Only ghosts that fall short are differentiated.

use super::first_order::slopes;
use super::sum::SumOfSquares;
use super::{EvaluationContext, MeritError};
use crate::lens::System;
use crate::math::Real;

/// Adds the mean squared shortfalls of the widths of all ghosts from those at which their irradiance is a share of
/// that at the entrance.
pub(super) fn add_ghosts(
    context: &EvaluationContext<'_>,
    irradiance: f64,
    reflectance: Option<f64>,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let system = &context.systems.manufactured;
    let surfaces = reflecting(system)?;
    let pairs = surfaces.iter().enumerate();
    let pairs =
        pairs.flat_map(|(k, first)| surfaces[..k].iter().map(move |second| [*first, *second]));
    let pairs: Vec<[usize; 2]> = pairs.collect();
    let weight = 1.0 / pairs.len() as f64;
    for pair in pairs {
        let ghost = Ghost { pair, irradiance, reflectance };
        let shortfall = ghost.shortfall(system);
        if shortfall > 0.0 {
            let slope = slopes(context, sum.level, |along| ghost.shortfall(along));
            sum.add_residual(weight, shortfall, &slope);
        }
    }
    Ok(())
}

/// The surfaces where the index changes, the image plane left out.
fn reflecting(system: &System<f64>) -> Result<Vec<usize>, MeritError> {
    let refuse = |why| Err(MeritError::DoesNotApply { term: "ghosts", why });
    let is_other = |i: usize| {
        let surface = &system.surfaces[i];
        surface.mirror || surface.is_mounted() || surface.grin.is_some() || surface.ideal.is_some()
    };
    if (0..system.surfaces.len()).any(is_other) {
        return refuse(
            "a surface is a mirror, ideal, not centred or in front of a gradient; ghosts are those of \
             centred lenses without",
        );
    }
    let last = system.surfaces.len().saturating_sub(1);
    let changes = |i: &usize| system.index_before(*i) != system.surfaces[*i].index;
    let found: Vec<usize> = (0..last).filter(changes).collect();
    if found.len() < 2 {
        return refuse("fewer than two surfaces reflect light");
    }
    Ok(found)
}

/// The largest index of a medium that counts as air: cemented surfaces have no coating.
const AIR: f64 = 1.1;

/// Light that is reflected at a surface and again at one in front of it.
struct Ghost {
    /// The surface of the first and of the second reflection.
    pair: [usize; 2],
    irradiance: f64,
    reflectance: Option<f64>,
}

impl Ghost {
    /// The part of the width asked for that it lacks; negative if it is wider.
    fn shortfall<R: Real>(&self, system: &System<R>) -> R {
        let spread = self.spread(system);
        let width = if spread < R::ZERO { -spread } else { spread };
        let least = (self.transmitted(system) * R::from_f64(1.0 / self.irradiance)).sqrt();
        R::ONE - width / least
    }

    /// The height at the image of the unfolded ray of height 1 along the axis.
    fn spread<R: Real>(&self, system: &System<R>) -> R {
        let [first, second] = self.pair;
        let surfaces = &system.surfaces;
        let (mut y, mut slope) = (R::ONE, R::ZERO);
        let two = R::from_f64(2.0);
        let refract =
            |i: usize| (surfaces[i].index - system.index_before(i)) * surfaces[i].curvature();
        let gap = |i: usize| surfaces[i].thickness / surfaces[i].index;
        for i in 0..first {
            slope -= y * refract(i);
            y += slope * gap(i);
        }
        // From its front, and backwards.
        slope += y * two * system.index_before(first) * surfaces[first].curvature();
        for i in (second + 1..first).rev() {
            y += slope * gap(i);
            slope -= y * refract(i);
        }
        y += slope * gap(second);
        // From behind, and forwards.
        slope -= y * two * surfaces[second].index * surfaces[second].curvature();
        y += slope * gap(second);
        for i in second + 1..surfaces.len() - 1 {
            slope -= y * refract(i);
            y += slope * gap(i);
        }
        y
    }

    /// The share of the light that arrives, at normal incidence.
    fn transmitted<R: Real>(&self, system: &System<R>) -> R {
        let [first, second] = self.pair;
        let reflected = |i: usize| {
            let (before, behind) = (system.index_before(i), system.surfaces[i].index);
            let amplitude = (before - behind) / (before + behind);
            let has_air = before.value().min(behind.value()) < AIR;
            if before == behind {
                return R::ZERO;
            }
            self.reflectance.filter(|_| has_air).map_or(amplitude * amplitude, R::from_f64)
        };
        let passed = |from: usize, to: usize| {
            (from..to).fold(R::ONE, |product, i| product * (R::ONE - reflected(i)))
        };
        let last = system.surfaces.len() - 1;
        reflected(first)
            * reflected(second)
            * passed(0, first)
            * passed(second + 1, first)
            * passed(second + 1, last)
    }
}
