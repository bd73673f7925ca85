//! Encircled energy: the share of the light within a circle.

use super::pupil_function::PupilFunction;
use super::pupil_samples::PupilSamples;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::quadrature::gauss_legendre;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use std::f64::consts::TAU;

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
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::for_region(&region)?;
    let encircled = |light: &PupilSamples| light.encircled(center, radii);
    let found = PupilSamples::converge(&region, &sphere, None, accuracy, encircled)?;
    let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], found.rays);
    Ok((0..radii.len()).map(estimate).collect())
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
    ///
    /// # Errors
    /// The pupil is irregular.
    pub fn round_encircled(
        &self,
        radii: &[f64],
        cutoff: f64,
        shadow: f64,
        fine: bool,
    ) -> Result<Vec<[f64; 2]>, AnalysisError> {
        if radii.is_empty() {
            return Ok(Vec::new());
        }
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let contrast = |(nu, weight): (f64, f64)| {
            let found = self.transfer([0.0, nu], 0.0, CONTRAST_TOLERANCE)?;
            Ok((nu, [found.re, found.modulus.error].map(|value| weight * value)))
        };
        let contrasts: Result<Vec<(f64, [f64; 2])>, AnalysisError> =
            frequencies(largest, cutoff, shadow, fine).into_par_iter().map(contrast).collect();
        let contrasts = contrasts?;
        let share = |radius: &f64| {
            let terms = contrasts.iter().map(|(nu, [value, error])| {
                let bessel = bessel_j1(TAU * nu * radius);
                [value * bessel, error * bessel.abs()]
            });
            let sum = terms.fold([0.0; 2], |sum, term| [sum[0] + term[0], sum[1] + term[1]]);
            sum.map(|part| TAU * radius * part)
        };
        Ok(radii.iter().map(share).collect())
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

/// The nodes of a radius and of a turn for each fringe of the pattern that they cross, and at least.
const FRINGE_NODES: f64 = 3.0;
const LEAST_NODES: usize = 8;

impl PupilSamples {
    /// The share of the energy within circles about a point.
    pub fn encircled(&self, center: [f64; 2], radii: &[f64]) -> Vec<f64> {
        // ∫ |U|² dx dy over the whole plane is λ² ∫ A² dα dβ (Parseval).
        let total = self.wavelength.powi(2) * self.energy();
        let spread = self.spread();
        let (mut sum, mut from) = (0.0, 0.0);
        let share = |radius: &f64| {
            let fringes = 2.0 * spread * (radius - from) / self.wavelength;
            let count = LEAST_NODES + (FRINGE_NODES * fringes) as usize;
            for (r, weight) in gauss_legendre(count, from, *radius) {
                let fringes = 2.0 * spread * r / self.wavelength;
                let turn = LEAST_NODES + (TAU * FRINGE_NODES * fringes) as usize;
                let mean: f64 = (0..turn)
                    .map(|j| {
                        let (sin, cos) = (TAU * j as f64 / turn as f64).sin_cos();
                        let [re, im] = self.field([center[0] + r * sin, center[1] + r * cos]);
                        re * re + im * im
                    })
                    .sum::<f64>()
                    / turn as f64;
                sum += weight * TAU * r * mean;
            }
            from = *radius;
            sum / total
        };
        radii.iter().map(share).collect()
    }
}
