//! Encircled energy: the share of the light within a circle.

use super::image_light::{ColorPart, ColorParts, ImageLight, about_sphere};
use super::pupil_function::PupilFunction;
use super::pupil_samples::{Complex, PupilSamples};
use super::{Interruption, never};
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::math::quadrature::gauss_legendre;
use crate::pupil::{Accuracy, ConvergedList, RayModel};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A request for encircled energy: circles about a point, x and y in mm from the image point of the chief ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncircledRequest<'a> {
    /// The point.
    pub center: [f64; 2],
    /// The radii of the circles in mm, ascending.
    pub radii: &'a [f64],
    /// The shares of the light whose circles are looked for, between 0 and 1.
    pub shares: &'a [f64],
}

/// The shares of the light of a field within circles.
#[derive(Debug, Clone, PartialEq)]
pub struct EncircledEnergy {
    /// The share within each circle; errors are absolute.
    pub energy: Vec<Estimate>,
    /// The same of the same pupil without aberrations and lateral colour: the limit that diffraction sets.
    pub perfect: Vec<Estimate>,
    /// The radii in mm of the circles that hold the shares asked for; `None` beyond the largest circle.
    pub share_radii: Vec<Option<Estimate>>,
    /// The share of the weight of wavelengths without light, which are left out.
    pub dark_share: f64,
}

/// The share of the light of a field at a wavelength within circles of these radii in mm, ascending,
/// about a point, x and y in mm from the image point of the chief ray; errors are absolute.
///
/// # Errors
/// The field is dark or its pupil folds.
pub fn encircled_energy(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    center: [f64; 2],
    radii: &[f64],
    accuracy: Accuracy,
) -> Result<Vec<Estimate>, AnalysisError> {
    let request = EncircledRequest { center, radii, shares: &[] };
    let found = color_rings((model, field, wavelength), (None, request), accuracy, &never)?;
    Ok(found.shares)
}

/// The shares of the light of a field in one or all wavelengths within circles, unless it is interrupted, which is
/// asked for before every ring of the image. Over several wavelengths the circles are those about the image point
/// of the chief ray of the primary one, and errors count the wavelengths that are refused.
///
/// # Errors
/// The field is dark or its pupil folds at every wavelength, or [`AnalysisError::Interrupted`].
pub fn encircled_energy_unless(
    model: &RayModel,
    field: FieldPoint,
    (light, request): (ImageLight, EncircledRequest<'_>),
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<EncircledEnergy, AnalysisError> {
    let origin = light.origin(model, field)?;
    let colors = light.parts(model, |wavelength| {
        let subject = (model, field, wavelength);
        let rings = color_rings(subject, (origin, request), accuracy, interrupted)?;
        Ok((rings, perfect_rings(subject, request.radii, accuracy, interrupted)?))
    })?;
    let count = request.radii.len();
    let energy = mean_shares(&colors, count, |(rings, _)| &rings.shares);
    let perfect = mean_shares(&colors, count, |(_, perfect)| perfect);
    let share_radii = request.shares.iter().map(|share| {
        RingSearch { colors: &colors, energy: &energy, radii: request.radii }.radius_of(*share)
    });
    Ok(EncircledEnergy {
        share_radii: share_radii.collect(),
        dark_share: colors.dark_share,
        energy,
        perfect,
    })
}

/// The shares of one wavelength within circles, and its light, with which more of them are found.
struct ColorRings {
    shares: Vec<Estimate>,
    light: RingLight,
}

/// The rings and the circles without aberrations of a wavelength.
type ColorShares = (ColorRings, Vec<Estimate>);

/// The shares within circles in ascending order. One that is not resolved is between none and all; its error is at
/// least that of the circles next to it, as one alone may stand still by chance.
fn share_estimates(found: &ConvergedList) -> Vec<Estimate> {
    let estimate = |(k, value): (usize, &f64)| {
        let near = &found.errors[k.saturating_sub(1)..(k + 2).min(found.errors.len())];
        let error = near.iter().copied().fold(0.0, f64::max);
        Estimate::new(value.clamp(0.0, 1.0), error.min(1.0), found.rays)
    };
    found.values.iter().enumerate().map(estimate).collect()
}

fn color_rings(
    (model, field, wavelength): (&RayModel, FieldPoint, usize),
    (origin, request): (Option<Vec3<f64>>, EncircledRequest<'_>),
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<ColorRings, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::focused(&region)?;
    let [x, y] = request.center;
    let [x, y, _] = about_sphere(&sphere, origin, [x, y, 0.0]);
    let mut last = None;
    let encircled = |light: &PupilSamples| {
        let rings = light.ring_light([x, y]);
        let shares = rings.encircled_unless(request.radii, interrupted);
        last = Some(rings);
        shares
    };
    let found = PupilSamples::converge(&region, &sphere, None, accuracy, interrupted, encircled)?;
    let shares = share_estimates(&found);
    Ok(ColorRings { shares, light: last.ok_or(AnalysisError::NoLight)? })
}

/// The shares of the light of a pupil without aberrations within circles.
fn perfect_rings(
    (model, field, wavelength): (&RayModel, FieldPoint, usize),
    radii: &[f64],
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<Vec<Estimate>, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::focused(&region)?;
    let encircled = |light: &PupilSamples| {
        let waves = vec![0.0; light.waves.len()];
        let perfect = PupilSamples { waves, ..light.clone() };
        perfect.ring_light([0.0; 2]).encircled_unless(radii, interrupted)
    };
    let found = PupilSamples::converge(&region, &sphere, None, accuracy, interrupted, encircled)?;
    Ok(share_estimates(&found))
}

/// The mean of the shares of all wavelengths by their light; errors count those that are refused.
fn mean_shares(
    colors: &ColorParts<ColorShares>,
    count: usize,
    of: impl Fn(&ColorShares) -> &Vec<Estimate>,
) -> Vec<Estimate> {
    let ColorParts { parts, refused_share, .. } = colors;
    let rays = parts.iter().map(|part| of(&part.found).first().map_or(0, |share| share.rays)).sum();
    let mean = |number: &dyn Fn(&ColorShares) -> f64| -> f64 {
        parts.iter().map(|part| part.share * number(&part.found)).sum()
    };
    let share = |k: usize| {
        let error = mean(&|found| of(found)[k].error) + refused_share;
        Estimate::new(mean(&|found| of(found)[k].value), error.min(1.0), rays)
    };
    (0..count).map(share).collect()
}

/// The search for the circles that hold shares of the light.
struct RingSearch<'a> {
    colors: &'a ColorParts<ColorShares>,
    energy: &'a [Estimate],
    radii: &'a [f64],
}

/// The steps of Newton's method to a radius, and the change of it by the radius at which they end.
const RADIUS_STEPS: usize = 20;
const RADIUS_CHANGE: f64 = 1e-9;

impl RingSearch<'_> {
    /// The radius of the circle that holds a share: between two circles that are known, by the light of the rings
    /// between them. Its error is that of the shares over their slope.
    fn radius_of(&self, share: f64) -> Option<Estimate> {
        let above = self.energy.iter().position(|circle| circle.value >= share)?;
        let outer = self.radii[above];
        let (inner, inside, error) = match above.checked_sub(1) {
            Some(k) => {
                let inside = self.energy[k];
                (self.radii[k], inside.value, inside.error.max(self.energy[above].error))
            }
            None => (0.0, 0.0, self.energy[above].error),
        };
        let between = self.energy[above].value - inside;
        let mut bracket = [inner, outer];
        let mut radius = inner + (outer - inner) * ((share - inside) / between).clamp(0.0, 1.0);
        for _ in 0..RADIUS_STEPS {
            let missing = share - inside - self.between(inner, radius);
            bracket[usize::from(missing <= 0.0)] = radius;
            let newton = radius + missing / self.slope(radius);
            let [low, high] = bracket;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let change = (next - radius).abs();
            radius = next;
            if change <= RADIUS_CHANGE * radius {
                break;
            }
        }
        // What the shares leave open moves the radius by no more than to the next circles of the shares.
        let error = (error / self.slope(radius)).min(outer);
        Some(Estimate::new(radius, error, self.energy[above].rays))
    }

    /// The share of the light between two radii.
    fn between(&self, from: f64, to: f64) -> f64 {
        let of = |part: &ColorPart<ColorShares>| part.share * part.found.0.light.between(from, to);
        self.colors.parts.iter().map(of).sum()
    }

    /// The share of the light by the radius, in 1/mm.
    fn slope(&self, radius: f64) -> f64 {
        let of = |part: &ColorPart<ColorShares>| part.share * part.found.0.light.slope(radius);
        self.colors.parts.iter().map(of).sum()
    }
}

/// The absolute error of a contrast under the integral of encircled energy.
const CONTRAST_TOLERANCE: f64 = 1e-9;
/// The nodes of a smooth part of the contrast, and of a period of the Bessel function.
const PART_NODES: usize = 40;
const PERIOD_NODES: f64 = 6.0;

impl PupilFunction {
    /// The shares of the energy within circles of radii in mm about the centre, for a round pupil whose
    /// aberrations are round too: `2π r ∫ OTF(ν) J₁(2π ν r) dν` up to its cutoff in cycles/mm. The
    /// contrast has corners at `1 − ε`, `1 ± ε` halved and `ε` of it for a round shadow of the share ε.
    /// All circles share the frequencies, which the largest one asks for. With each share comes the error
    /// that those of the contrasts leave in it.
    pub(super) fn round_encircled(
        &self,
        radii: &[f64],
        cutoff: f64,
        shadow: f64,
        fine: bool,
    ) -> Vec<[f64; 2]> {
        if radii.is_empty() {
            return Vec::new();
        }
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let contrast = |(nu, weight): (f64, f64)| {
            let found = self.transfer([0.0, nu], 0.0, CONTRAST_TOLERANCE);
            (nu, [found.re, found.modulus.error].map(|value| weight * value))
        };
        let contrasts: Vec<(f64, [f64; 2])> =
            frequencies(largest, cutoff, shadow, fine).into_par_iter().map(contrast).collect();
        let share = |radius: &f64| {
            let terms = contrasts.iter().map(|(nu, [value, error])| {
                let bessel = bessel_j1(TAU * nu * radius);
                [value * bessel, error * bessel.abs()]
            });
            let sum = terms.fold([0.0; 2], |sum, term| [sum[0] + term[0], sum[1] + term[1]]);
            sum.map(|part| TAU * radius * part)
        };
        radii.iter().map(share).collect()
    }
}

/// Frequencies in cycles/mm up to a cutoff with their weights, for circles up to a radius in mm.
fn frequencies(radius: f64, cutoff: f64, shadow: f64, fine: bool) -> Vec<(f64, f64)> {
    let mut ends = [0.0, 0.5 * (1.0 - shadow), shadow, 0.5 * (1.0 + shadow), 1.0];
    ends.sort_by(f64::total_cmp);
    let mut nodes = Vec::new();
    for pair in ends.windows(2).filter(|pair| pair[1] > pair[0]) {
        let width = (pair[1] - pair[0]) * cutoff;
        let count = PART_NODES + (PERIOD_NODES * radius * width) as usize;
        let count = if fine { count + count / 2 } else { count };
        for (t, weight) in gauss_legendre(count, 0.0, 1.0) {
            // Slow at both ends, where the contrast has the power 3/2.
            let nu = cutoff * pair[0] + width * t * t * t * (10.0 - t * (15.0 - 6.0 * t));
            let slope = width * 30.0 * t * t * (1.0 - t) * (1.0 - t);
            nodes.push((nu, weight * slope));
        }
    }
    nodes
}

/// The Bessel function J₁ by its integral over a period, whose sum converges with more nodes than its
/// argument.
fn bessel_j1(x: f64) -> f64 {
    let count = 40 + (1.2 * x.abs()) as usize;
    let node = |i: usize| {
        let sin = (TAU * (i as f64 + 0.5) / count as f64).sin();
        sin * (x * sin).sin()
    };
    (0..count).map(node).sum::<f64>() / count as f64
}

/// The nodes of a radius for each fringe of the pattern that it crosses, and at least.
const FRINGE_NODES: f64 = 3.0;
const LEAST_NODES: usize = 8;
/// The part of a fringe that fewer nodes resolve to the rounding of numbers, and these.
const FEW_FRINGES: f64 = 0.3;
const FEW_NODES: usize = 6;

impl PupilSamples {
    /// The share of the energy within circles about a point.
    pub fn encircled(&self, center: [f64; 2], radii: &[f64]) -> Vec<f64> {
        // What never is interrupted never fails.
        self.ring_light(center).encircled_unless(radii, &never).unwrap_or_default()
    }

    /// The light about a point of the image.
    fn ring_light(&self, center: [f64; 2]) -> RingLight {
        RingLight {
            waves: self.polar_waves(center),
            // ∫ |U|² dx dy over the whole plane is λ² ∫ A² dα dβ (Parseval).
            total: self.wavelength.powi(2) * self.energy(),
            fringes: 2.0 * self.spread() / self.wavelength,
        }
    }

    /// The light of every point of the pupil as a plane wave about a point of the image. A common inclination
    /// is taken away, which changes no intensity.
    fn polar_waves(&self, [x, y]: [f64; 2]) -> Vec<PolarWave> {
        let wave_number = TAU / self.wavelength;
        let mean = |k: usize| {
            self.cosines.iter().map(|c| c[k]).sum::<f64>() / self.cosines.len().max(1) as f64
        };
        let middle = [if self.mirrored { 0.0 } else { mean(0) }, mean(1)];
        let wave = |((cosines, waves), amplitude): ((&[f64; 2], &f64), &f64)| {
            let [a, b] = [0, 1].map(|k| cosines[k] - middle[k]);
            let (sin, cos) = (wave_number * y * b - TAU * waves).sin_cos();
            let (across_sin, across_cos) = (wave_number * x * a).sin_cos();
            let turn = |[c, s]: [f64; 2]| {
                [amplitude * (cos * c - sin * s), amplitude * (sin * c + cos * s)]
            };
            let length = a.hypot(b);
            let direction = if length > 0.0 { [b / length, a / length] } else { [1.0, 0.0] };
            let whole = turn([across_cos, across_sin]);
            let (even, odd) = if self.mirrored {
                (turn([across_cos, 0.0]), turn([0.0, across_sin]))
            } else {
                (whole, whole)
            };
            PolarWave { wave_number: wave_number * length, direction, even, odd }
        };
        self.cosines.iter().zip(&self.waves).zip(&self.amplitudes).map(wave).collect()
    }
}

/// The light of a pupil about a point of the image.
struct RingLight {
    waves: Vec<PolarWave>,
    /// The integral of the intensity over the whole plane.
    total: f64,
    /// The fringes of the pattern along a radius, in 1/mm.
    fringes: f64,
}

impl RingLight {
    fn encircled_unless(
        &self,
        radii: &[f64],
        interrupted: &Interruption<'_>,
    ) -> Result<Vec<f64>, AnalysisError> {
        let (mut nodes, mut ends, mut from) = (Vec::new(), Vec::new(), 0.0);
        for radius in radii {
            nodes.extend(self.nodes(from, *radius));
            ends.push(nodes.len());
            from = *radius;
        }
        let part = |(r, weight): &(f64, f64)| {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            Ok(weight * self.slope(*r))
        };
        let parts: Vec<f64> = nodes.par_iter().map(part).collect::<Result<_, _>>()?;
        let share = |end: &usize| parts[..*end].iter().sum::<f64>();
        Ok(ends.iter().map(share).collect())
    }

    /// The radii that resolve the fringes between two, with their weights.
    fn nodes(&self, from: f64, to: f64) -> Vec<(f64, f64)> {
        let fringes = self.fringes * (to - from);
        let least = if fringes < FEW_FRINGES { FEW_NODES } else { LEAST_NODES };
        gauss_legendre(least + (FRINGE_NODES * fringes) as usize, from, to)
    }

    /// The share of the light by the radius of a circle, in 1/mm.
    fn slope(&self, radius: f64) -> f64 {
        TAU * radius * ring_intensity(&self.waves, radius) / self.total
    }

    /// The share of the light between two circles.
    fn between(&self, from: f64, to: f64) -> f64 {
        let part = |(radius, weight): (f64, f64)| weight * self.slope(radius);
        self.nodes(from, to).into_par_iter().map(part).sum()
    }
}

/// A plane wave from a point of the pupil, or from it and its mirror image.
#[derive(Debug, Clone, Copy)]
struct PolarWave {
    /// The wave number across the axis, in 1/mm.
    wave_number: f64,
    /// Cosine and sine of its azimuth from the plane of symmetry.
    direction: [f64; 2],
    /// The complex amplitude of its part that is even in the azimuth.
    even: Complex,
    /// The same of the odd part.
    odd: Complex,
}

/// The mean intensity of plane waves on a circle of radius r in mm. A wave is there a series of harmonics,
/// `exp(i k r cos(θ − φ)) = Σ iᵐ Jₘ(kr) exp(im(θ − φ))` (Jacobi and Anger), and the mean of the square is the
/// sum of the squares of all harmonics.
fn ring_intensity(waves: &[PolarWave], r: f64) -> f64 {
    let largest = waves.iter().map(|wave| wave.wave_number * r).fold(0.0, f64::max);
    let mut harmonics = vec![[0.0; 4]; last_order(largest) + 1];
    let mut bessel = Vec::with_capacity(harmonics.len());
    for wave in waves {
        bessel_orders(wave.wave_number * r, &mut bessel);
        let [cos, sin] = wave.direction;
        let [mut c, mut s] = [1.0, 0.0];
        for (sums, order) in harmonics.iter_mut().zip(&bessel) {
            let (even, odd) = (order * c, order * s);
            sums[0] += wave.even[0] * even;
            sums[1] += wave.even[1] * even;
            sums[2] += wave.odd[0] * odd;
            sums[3] += wave.odd[1] * odd;
            [c, s] = [c * cos - s * sin, s * cos + c * sin];
        }
    }
    let square = |sums: &[f64; 4]| sums.iter().map(|sum| sum * sum).sum::<f64>();
    // Harmonics of the orders m and −m.
    2.0 * harmonics.iter().map(square).sum::<f64>() - harmonics.first().map_or(0.0, square)
}

/// The order above which Bessel functions of an argument are below the rounding of numbers.
fn last_order(x: f64) -> usize {
    (x + 12.0 * x.cbrt() + 16.0) as usize
}

/// The Bessel functions J₀, J₁, … of an argument up to the last order that matters, by Miller's downward
/// recurrence (Abramowitz and Stegun, 9.12); their sum `J₀ + 2 Σ J₂ₖ` is 1.
fn bessel_orders(x: f64, orders: &mut Vec<f64>) {
    /// Below it, the square of J₁ is rounding.
    const NO_ARGUMENT: f64 = 1e-8;
    orders.clear();
    if x < NO_ARGUMENT {
        orders.push(1.0);
        return;
    }
    let last = last_order(x);
    orders.resize(last + 1, 0.0);
    let (mut above, mut this, mut sum) = (0.0, f64::MIN_POSITIVE.sqrt(), 0.0);
    for order in (0..=last).rev() {
        orders[order] = this;
        if order.is_multiple_of(2) {
            sum += if order == 0 { this } else { 2.0 * this };
        }
        (above, this) = (this, 2.0 * order as f64 / x * this - above);
    }
    orders.iter_mut().for_each(|value| *value /= sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, tables 9.1 and 9.2; the sum of all squares is 1.
    #[test]
    fn bessel_functions_have_their_tabulated_values() {
        let mut orders = Vec::new();
        for (x, order, tabulated) in [
            (1.0, 0, 0.765_197_686_557_966_6),
            (1.0, 1, 0.440_050_585_744_933_5),
            (5.0, 2, 0.046_565_116_277_752_2),
            (10.0, 0, -0.245_935_764_451_348_3),
            (17.5, 1, -0.163_419_969_425_754_9),
        ] {
            bessel_orders(x, &mut orders);
            assert!((orders[order] - tabulated).abs() < 1e-14, "J{order}({x}) = {}", orders[order]);
        }
        for x in [0.0, 1e-9, 1e-7, 1e-3, 0.5, 40.0, 700.0, 1e4] {
            bessel_orders(x, &mut orders);
            let squares: f64 = orders.iter().map(|j| j * j).sum();
            let sum = 2.0 * squares - orders[0] * orders[0];
            assert!((sum - 1.0).abs() < 1e-12, "{x}: {sum}");
        }
    }

    /// The mean over a circle is that of the field at many of its points, with and without symmetry.
    #[test]
    fn the_mean_intensity_of_a_circle_is_that_of_its_points() {
        let number = |i: usize, k: f64| (k * i as f64).sin();
        let mut light = PupilSamples { wavelength: 5e-4, ..PupilSamples::default() };
        for i in 0..40 {
            let across = if i % 2 == 0 { 0.11 } else { 0.07 };
            light.cosines.push([across * number(i, 1.3).abs(), 0.2 + 0.1 * number(i, 2.9)]);
            light.waves.push(1.5 * number(i, 0.7));
            light.amplitudes.push(1.0 + 0.5 * number(i, 4.1));
        }
        for (mirrored, center) in
            [(true, [0.0, 0.002]), (true, [0.001, -0.003]), (false, [0.002, 0.001])]
        {
            light.mirrored = mirrored;
            let waves = light.polar_waves(center);
            for r in [0.0, 1e-7, 1e-3, 0.01] {
                let square = |angle: f64| {
                    let (sin, cos) = angle.sin_cos();
                    let [re, im] = light.field([center[0] + r * sin, center[1] + r * cos]);
                    re * re + im * im
                };
                let mean =
                    (0..400).map(|i| square(TAU * f64::from(i) / 400.0)).sum::<f64>() / 400.0;
                let found = ring_intensity(&waves, r);
                assert!((found - mean).abs() < 1e-9 * mean.max(1.0), "{r}: {found} {mean}");
            }
        }
    }
}
