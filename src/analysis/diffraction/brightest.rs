//! Newton's method to the brightest point of a diffraction image in space.

use super::pupil_samples::PupilSamples;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use std::f64::consts::TAU;

/// The steps of Newton's method to the brightest point, and the halvings of a step.
const STEPS: usize = 30;
const HALVINGS: usize = 12;

/// The intensity of an image in space, over the peak of a perfect one; points in mm.
pub(super) trait ImageIntensity {
    /// The intensity at a point off the image plane.
    fn intensity_at(&self, point: [f64; 3]) -> f64;

    /// The gradient and the second derivatives of the intensity at a point.
    fn slopes_at(&self, point: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>);
}

/// The brightest point found from some points, from the one where the path differences vary least, and from
/// the image point of the chief ray.
pub(super) fn brightest(light: &PupilSamples, starts: &[[f64; 3]]) -> [f64; 3] {
    let others = [least_variance(light).unwrap_or([0.0; 3]), [0.0; 3]];
    highest(light, starts.iter().chain(&others))
}

/// The brightest of the points that are reached uphill from some points.
pub(super) fn highest<'a>(
    light: &impl ImageIntensity,
    starts: impl Iterator<Item = &'a [f64; 3]>,
) -> [f64; 3] {
    let ends = starts.map(|start| climb(light, *start));
    let with_value = ends.map(|end| (end, light.intensity_at(end)));
    with_value.max_by(|a, b| a.1.total_cmp(&b.1)).map_or([0.0; 3], |(end, _)| end)
}

/// The point about which path differences vary least: the least squares of
/// `W − (α x + β y + γ z)/λ − piston`.
fn least_variance(light: &PupilSamples) -> Option<[f64; 3]> {
    let (mut matrix, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for (i, weight) in light.amplitudes.iter().enumerate() {
        for turned in light.rows(i) {
            let row = Vector4::new(turned[0], turned[1], turned[2], 1.0);
            matrix += *weight * row * row.transpose();
            right += *weight * light.waves[i] * row;
        }
    }
    let solution = matrix.full_piv_lu().solve(&right)?;
    Some([solution[0], solution[1], solution[2]]).filter(|p| p.iter().all(|v| v.is_finite()))
}

/// Newton's method on the intensity, uphill.
pub(super) fn climb(light: &impl ImageIntensity, start: [f64; 3]) -> [f64; 3] {
    let mut here = Vector3::from(start);
    let mut value = light.intensity_at(start);
    for _ in 0..STEPS {
        let (gradient, curvature) = light.slopes_at(here.into());
        let Some(step) = uphill(gradient, curvature) else { break };
        let Some((there, found)) = brighter_point(light, here, value, step) else { break };
        let has_risen = found > value * (1.0 + 1e-14);
        (here, value) = (there, found);
        if !has_risen {
            break;
        }
    }
    here.into()
}

/// The first point along a step, halved again and again, at which the intensity is above `value`.
fn brighter_point(
    light: &impl ImageIntensity,
    here: Vector3<f64>,
    value: f64,
    step: Vector3<f64>,
) -> Option<(Vector3<f64>, f64)> {
    let halved = std::iter::successors(Some(1.0), |factor| Some(0.5 * factor)).take(HALVINGS);
    let points = halved.map(|factor: f64| here + factor * step);
    points.map(|there| (there, light.intensity_at(there.into()))).find(|(_, found)| *found > value)
}

/// The Newton step, with every curvature taken as a negative one.
fn uphill(gradient: Vector3<f64>, curvature: Matrix3<f64>) -> Option<Vector3<f64>> {
    let eigen = curvature.symmetric_eigen();
    let along = eigen.eigenvectors.transpose() * gradient;
    let largest = eigen.eigenvalues.amax();
    let scaled = along.zip_map(&eigen.eigenvalues, |g, c| g / c.abs().max(1e-12 * largest));
    let step = eigen.eigenvectors * scaled;
    step.iter().all(|v| v.is_finite()).then_some(step)
}

impl ImageIntensity for PupilSamples {
    fn intensity_at(&self, point: [f64; 3]) -> f64 {
        let [re, im] = self.field_and_slopes(point).0;
        (re * re + im * im) / self.peak().powi(2)
    }

    fn slopes_at(&self, point: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let (u, first, second) = self.field_and_slopes(point);
        let scale = 2.0 / self.peak().powi(2);
        let gradient = (first[0] * u[0] + first[1] * u[1]) * scale;
        let products = first.each_ref().map(|part| part * part.transpose());
        let curvature = (products[0] + products[1] + second[0] * u[0] + second[1] * u[1]) * scale;
        (gradient, curvature)
    }
}

impl PupilSamples {
    /// The cosines over the wavelength of a sample, and of its mirror image if it stands for that too.
    fn rows(&self, i: usize) -> impl Iterator<Item = [f64; 3]> + use<> {
        let [a, b] = self.cosines[i];
        let row = [a, b, third_cosine([a, b])].map(|cosine| cosine / self.wavelength);
        let mirror = [-row[0], row[1], row[2]];
        std::iter::once(row).chain(self.mirrored.then_some(mirror))
    }

    /// The field at a point with its first and second derivatives: real and imaginary parts.
    fn field_and_slopes(
        &self,
        point: [f64; 3],
    ) -> ([f64; 2], [Vector3<f64>; 2], [Matrix3<f64>; 2]) {
        let mut sum = ([0.0; 2], [Vector3::zeros(); 2], [Matrix3::zeros(); 2]);
        let share = if self.mirrored { 0.5 } else { 1.0 };
        for (i, amplitude) in self.amplitudes.iter().enumerate() {
            for row in self.rows(i) {
                let k = Vector3::from(row) * TAU;
                let phase = k.dot(&Vector3::from(point)) - TAU * self.waves[i];
                let (sin, cos) = phase.sin_cos();
                let weight = share * amplitude;
                sum.0 = [sum.0[0] + weight * cos, sum.0[1] + weight * sin];
                sum.1[0] -= k * (weight * sin);
                sum.1[1] += k * (weight * cos);
                let square = k * k.transpose();
                sum.2[0] -= square * (weight * cos);
                sum.2[1] -= square * (weight * sin);
            }
        }
        sum
    }
}

/// The third cosine of a direction.
pub(super) fn third_cosine([a, b]: [f64; 2]) -> f64 {
    (1.0 - a * a - b * b).max(0.0).sqrt()
}
