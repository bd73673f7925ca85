//! Encircled energy: the share of the light within a circle.

use super::pupil_samples::PupilSamples;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::quadrature::gauss_legendre;
use crate::pupil::{Accuracy, RayModel};
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
    let found =
        PupilSamples::converge(&region, &sphere, accuracy, |light| light.encircled(center, radii))?;
    let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], found.rays);
    Ok((0..radii.len()).map(estimate).collect())
}

/// The nodes of a radius and of a turn for each fringe of the pattern that they cross, and at least.
const FRINGE_NODES: f64 = 3.0;
const LEAST_NODES: usize = 8;

impl PupilSamples {
    /// The share of the energy within circles about a point.
    pub fn encircled(&self, center: [f64; 2], radii: &[f64]) -> Vec<f64> {
        // ∫ |U|² dx dy over the whole plane is λ² ∫ A² dα dβ (Parseval).
        let total = self.wavelength.powi(2) * self.energy();
        let widest = self.cosines.iter().map(|[a, b]| a.hypot(*b)).fold(0.0, f64::max);
        let middle = self.cosines.iter().fold([0.0; 2], |s, c| [s[0] + c[0], s[1] + c[1]]);
        let middle = middle.map(|sum| sum / self.cosines.len() as f64);
        let reach = |c: &[f64; 2]| (c[0] - middle[0]).hypot(c[1] - middle[1]);
        let spread = if self.mirrored { widest } else { 0.0 }
            .max(self.cosines.iter().map(reach).fold(0.0, f64::max));
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
