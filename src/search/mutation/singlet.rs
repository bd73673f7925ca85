//! The random numbers of a new singlet and their density.

use super::distributions::{
    ShiftedExponential, curvature_deviation, normal_log_density, sample_normal, size_ratio,
};
use crate::lens::Lens;
use crate::search::{Random, SearchRules};

/// The surface next to a new singlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// Its row in the lens without the singlet.
    pub(super) row: usize,
    /// True if the singlet is behind it.
    pub(super) behind: bool,
}

/// The random numbers of a new singlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct SingletParameters {
    pub(super) curvatures: [f64; 2],
    pub(super) thickness: f64,
    /// The air space between it and its neighbour.
    pub(super) air: f64,
}

impl SingletParameters {
    /// Random numbers for a singlet next to a surface of a lens of a scale; `spread` multiplies the
    /// deviation of its curvatures from that of the surface.
    pub(super) fn draw(
        lens: &Lens,
        neighbour: Neighbour,
        rules: &SearchRules,
        scale: f64,
        spread: f64,
        random: &mut Random,
    ) -> Self {
        let mean = lens.surfaces[neighbour.row].curvature;
        let deviation = spread * curvature_deviation(scale);
        let mut curvature = || mean + sample_normal(deviation, random);
        let curvatures = [curvature(), curvature()];
        let (thickness, air) = length_distributions(lens, neighbour, curvatures, rules, scale);
        Self { curvatures, thickness: thickness.draw(random), air: air.draw(random) }
    }

    /// A singlet of these curvatures that is as thin, and as near to a surface, as the rules permit.
    pub(super) fn thinnest(
        lens: &Lens,
        neighbour: Neighbour,
        rules: &SearchRules,
        scale: f64,
        curvatures: [f64; 2],
    ) -> Self {
        let (thickness, air) = length_distributions(lens, neighbour, curvatures, rules, scale);
        Self { curvatures, thickness: thickness.least(), air: air.least() }
    }

    /// The logarithm of the density of these numbers for a lens without the singlet and of a scale;
    /// `None` if they cannot be drawn.
    pub(super) fn log_density(
        &self,
        lens: &Lens,
        neighbour: Neighbour,
        rules: &SearchRules,
        scale: f64,
    ) -> Option<f64> {
        let mean = lens.surfaces.get(neighbour.row)?.curvature;
        let (thickness, air) = length_distributions(lens, neighbour, self.curvatures, rules, scale);
        let bends =
            self.curvatures.map(|c| normal_log_density(c - mean, curvature_deviation(scale)));
        let lengths = thickness.log_density(self.thickness)? + air.log_density(self.air)?;
        Some(bends[0] + bends[1] + lengths)
    }

    /// The length of the singlet with its air space, in mm.
    pub(super) fn length(&self) -> f64 {
        self.thickness + self.air
    }
}

/// A singlet that could be drawn for a lens of a scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct SingletProposal {
    pub(super) singlet: SingletParameters,
    pub(super) neighbour: Neighbour,
    pub(super) scale: f64,
}

/// The distributions of the thickness of a singlet and of the air space beside it: at least the
/// minima of the rules on the axis and, up to the semi-diameter of the neighbour, at the edge.
fn length_distributions(
    lens: &Lens,
    neighbour: Neighbour,
    [front, rear]: [f64; 2],
    rules: &SearchRules,
    scale: f64,
) -> (ShiftedExponential, ShiftedExponential) {
    let size = size_ratio(scale);
    let Neighbour { row, behind } = neighbour;
    let beside = lens.surfaces[row].curvature;
    let rim = lens.surfaces[row].semi_diameter.unwrap_or(0.0);
    let sense = lens.light_direction(if behind { row } else { row.saturating_sub(1) });
    // The reduction of a gap at the edge compared with the axis.
    let narrower = |first: f64, second: f64| {
        let (first, second) = (sag(first, rim), sag(second, rim));
        sense * (first - second)
    };
    let (from, to) = if behind { (beside, front) } else { (rear, beside) };
    let least = |[center, most]: [f64; 2], edge: f64, narrower: f64| {
        [center.max(edge + narrower).min(most), most]
    };
    let thickness = least(rules.glass_center, rules.glass_edge, narrower(front, rear));
    let air = least(rules.air_center, rules.air_edge, narrower(from, to));
    (ShiftedExponential::new(thickness, 0.75 * size), ShiftedExponential::new(air, 0.1 * size))
}

/// The sag of a sphere at a height, or at its equator if that comes first.
pub(super) fn sag(curvature: f64, height: f64) -> f64 {
    let t = (curvature * height).clamp(-1.0, 1.0);
    if t == 0.0 { 0.0 } else { t * t / (curvature * (1.0 + (1.0 - t * t).sqrt())) }
}
