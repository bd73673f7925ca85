//! The brightest point of a diffraction image in space.
//!
//! Where a pupil has aberrations the intensity has many local maxima, among which Newton's method finds the
//! one that it begins at. So the whole blur, as far as rays tell where it is, is looked at first, in planes
//! across the chief ray: the field at a grid of points is a product of matrices, since its phase is a sum of
//! terms in x and in y. The grid has four points to λ/NA, between which the intensity of a peak falls to 0.64 at
//! most; the method begins at every local maximum of the grid that may be the peak then.

use super::Interruption;
use super::pupil_samples::{NODES_PER_TURN, PupilSamples};
use super::pupil_traces::TracedLight;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::math::Vec3;
use crate::pupil::Region;
use nalgebra::{DMatrix, Matrix3, Matrix4, Vector3, Vector4};
use std::f64::consts::TAU;

/// The distance of the points of a plane by λ/NA, and that of the planes by λ over the spread of the cosines along
/// the chief ray.
const ACROSS: f64 = 0.25;
const ALONG: f64 = 0.4;
/// The intensity at the nearest point of the grid over that of a peak, at least.
const SEEN: f64 = 0.6;
/// The local maxima of the grid that are climbed, and those that are kept.
const CLIMBED: usize = 32;
const KEPT: usize = 4;
/// The part of the largest slope from which on a ray tells where the light is focused.
const LEVER: f64 = 0.3;
/// The products of real numbers that a search may take: a second of one core.
const MOST_PRODUCTS: f64 = 4e9;
/// The order of quadrature of few rays.
const FEW: usize = 2;

/// The brightest local maxima of a blur.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct BlurPeaks {
    /// Their points, in mm from the centre of the sphere.
    pub(super) points: Vec<[f64; 3]>,
    /// True if all of the blur was looked at.
    pub(super) is_whole: bool,
}

/// The rays of a blur as lines, about the chief ray.
#[derive(Debug)]
struct Blur {
    /// The slopes of the chief ray.
    chief: [f64; 2],
    /// The place of each ray in the plane of the centre, and its slopes against the chief ray.
    rays: Vec<([f64; 2], [f64; 2])>,
    mirrored: bool,
}

/// A plane across the chief ray, with a grid of points.
#[derive(Debug)]
struct BlurPlane {
    z: f64,
    /// The places of the columns and rows, from the chief ray.
    places: [Vec<f64>; 2],
}

/// The light of a pupil for planes across the chief ray.
struct PlaneLight<'a> {
    light: &'a PupilSamples,
    chief: [f64; 2],
    /// The cosine along the chief ray of each node, over its component along the axis.
    along: Vec<f64>,
}

impl BlurPeaks {
    /// The brightest maxima of the light of a pupil; none of a blur that is too large to be looked at.
    ///
    /// # Errors
    /// The pupil is dark or folds, or the computation was interrupted.
    pub(super) fn find(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        interrupted: &Interruption<'_>,
    ) -> Result<Self, AnalysisError> {
        if region.is_sampled() {
            return Ok(Self::default());
        }
        let traced = TracedLight::new(region, &region.nodes(FEW));
        let few = traced.on(sphere)?;
        let blur = Blur::new(&traced, sphere, few.mirrored);
        let Some(planes) = blur.planes(&few) else { return Ok(Self::default()) };
        let Some(order) = resolving_order(region, &few, &blur, &planes) else {
            return Ok(Self::default());
        };
        let light = PupilSamples::of_nodes(region, sphere, &region.nodes(order))?;
        let points: f64 = planes.iter().map(BlurPlane::points).sum();
        let parts = if light.mirrored { 2.0 } else { 4.0 };
        if parts * points * light.amplitudes.len() as f64 > MOST_PRODUCTS {
            return Ok(Self::default());
        }
        let seen = PlaneLight::new(&light, blur.chief);
        let mut maxima = Vec::new();
        for plane in &planes {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            maxima.extend(seen.maxima(plane));
        }
        Ok(Self { points: climbed(&light, maxima), is_whole: true })
    }
}

/// The first order whose nodes resolve the phase of the light at all points of some planes.
fn resolving_order(
    region: &Region<'_>,
    few: &PupilSamples,
    blur: &Blur,
    planes: &[BlurPlane],
) -> Option<usize> {
    let along = PlaneLight::new(few, blur.chief).depth_of_cosines();
    let turns =
        |plane: &BlurPlane| few.turns(plane.reach()) + along * plane.z.abs() / few.wavelength;
    let least = NODES_PER_TURN * planes.iter().map(turns).fold(0.0, f64::max);
    (0..region.orders()).find(|order| region.radial_nodes(*order) as f64 >= least)
}

/// The ends of the climbs from those local maxima that may be the peak, brightest first.
fn climbed(light: &PupilSamples, mut maxima: Vec<(f64, [f64; 3])>) -> Vec<[f64; 3]> {
    maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = SEEN * maxima.first().map_or(0.0, |(value, _)| *value);
    let likely = maxima.iter().take(CLIMBED).take_while(|(value, _)| *value >= least);
    let mut ends: Vec<(f64, [f64; 3])> = likely
        .map(|(_, start)| climb(light, *start))
        .map(|end| (light.intensity_at(end), end))
        .collect();
    ends.sort_by(|a, b| b.0.total_cmp(&a.0));
    ends.dedup_by(|a, b| (a.0 - b.0).abs() <= 1e-9 * b.0);
    ends.into_iter().take(KEPT).map(|(_, end)| end).collect()
}

impl Blur {
    fn new(traced: &TracedLight, sphere: &ReferenceSphere, mirrored: bool) -> Self {
        // Light may run against the axis; depth is along the light, as cosines are.
        let slopes = |d: Vec3<f64>| [d.x / d.z.abs(), d.y / d.z.abs()];
        let chief = slopes(sphere.direction);
        let rays = traced.lines().map(|ray| {
            let off = ray.point - sphere.center;
            let depth = off.z * ray.direction.z.signum();
            let [u, v] = slopes(ray.direction);
            ([off.x - depth * u, off.y - depth * v], [u - chief[0], v - chief[1]])
        });
        Self { chief, rays: rays.collect(), mirrored }
    }

    /// The range along the axis in which rays come nearest to the chief ray; `None` if none crosses it.
    fn depth(&self) -> Option<[f64; 2]> {
        let square = |[u, v]: [f64; 2]| u * u + v * v;
        let most = self.rays.iter().map(|(_, slopes)| square(*slopes)).fold(0.0, f64::max);
        let outer = self.rays.iter().filter(|(_, slopes)| square(*slopes) > LEVER * LEVER * most);
        let nearest =
            outer.map(|(at, slopes)| -(at[0] * slopes[0] + at[1] * slopes[1]) / square(*slopes));
        let range = nearest.fold([0.0f64; 2], |[low, high], z| [low.min(z), high.max(z)]);
        range.iter().all(|z| z.is_finite()).then_some(range)
    }

    /// The planes that cover the blur; `None` if it has no extent or they are too many.
    fn planes(&self, light: &PupilSamples) -> Option<Vec<BlurPlane>> {
        let [low, high] = self.depth()?;
        let step = ALONG * light.wavelength / PlaneLight::new(light, self.chief).depth_of_cosines();
        let across = ACROSS * light.wavelength / light.spread();
        let count = (high - low) / step + 2.0;
        if !(step.is_finite() && across.is_finite() && count * step > 0.0 && count < 1e5) {
            return None;
        }
        let plane = |i: usize| self.plane(low + (i as f64 - 0.5) * step, across);
        (0..=count as usize).map(plane).collect()
    }

    /// The plane at a place along the axis, with a grid around the rays there.
    fn plane(&self, z: f64, step: f64) -> Option<BlurPlane> {
        let mut places = [const { Vec::new() }; 2];
        for (axis, places) in places.iter_mut().enumerate() {
            let at = self.rays.iter().map(|(at, slopes)| at[axis] + z * slopes[axis]);
            let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
            // Half of the blur is the mirror image of the other half.
            let low = if self.mirrored && axis == 0 { 0.0 } else { low - 2.0 * step };
            let count = (high - low) / step + 3.0;
            if !(count < 1e5) {
                return None;
            }
            places.extend((0..count as usize).map(|i| low + i as f64 * step));
        }
        Some(BlurPlane { z, places })
    }
}

impl BlurPlane {
    fn points(&self) -> f64 {
        self.places[0].len() as f64 * self.places[1].len() as f64
    }

    /// The largest distance of its points from the chief ray.
    fn reach(&self) -> f64 {
        let most = |places: &[f64]| places.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        most(&self.places[0]).hypot(most(&self.places[1]))
    }
}

impl<'a> PlaneLight<'a> {
    fn new(light: &'a PupilSamples, chief: [f64; 2]) -> Self {
        let along =
            light.cosines.iter().map(|[a, b]| a * chief[0] + b * chief[1] + third_cosine([*a, *b]));
        Self { light, chief, along: along.collect() }
    }

    /// The spread of the cosines along the chief ray.
    fn depth_of_cosines(&self) -> f64 {
        let most = self.along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        most - self.along.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The local maxima of the intensity at the grid of a plane, with their points.
    fn maxima(&self, plane: &BlurPlane) -> Vec<(f64, [f64; 3])> {
        let intensities = self.intensities(plane);
        let (columns, rows) = intensities.shape();
        let is_highest = |i: usize, k: usize| {
            let near = |n: usize, end: usize| n.saturating_sub(1)..(n + 2).min(end);
            let around = near(i, columns).flat_map(|i| near(k, rows).map(move |k| (i, k)));
            around.map(|at| intensities[at]).all(|other| other <= intensities[(i, k)])
        };
        let point = |i: usize, k: usize| {
            let z = plane.z;
            [plane.places[0][i] + z * self.chief[0], plane.places[1][k] + z * self.chief[1], z]
        };
        let all = (0..columns).flat_map(|i| (0..rows).map(move |k| (i, k)));
        all.filter(|(i, k)| is_highest(*i, *k))
            .map(|(i, k)| (intensities[(i, k)], point(i, k)))
            .collect()
    }

    /// The intensities at the columns and rows of a plane.
    fn intensities(&self, plane: &BlurPlane) -> DMatrix<f64> {
        let PupilSamples { cosines, waves, amplitudes, wavelength, mirrored, .. } = self.light;
        let [xs, ys] = &plane.places;
        let nodes = amplitudes.len();
        let turn = |axis: usize, place: f64, node: usize| {
            (TAU * cosines[node][axis] * place / wavelength).sin_cos()
        };
        let [mut re, mut im] = [0, 1].map(|_| DMatrix::<f64>::zeros(nodes, ys.len()));
        for node in 0..nodes {
            let phase = TAU * (self.along[node] * plane.z / wavelength - waves[node]);
            let (sin, cos) = phase.sin_cos();
            for (row, y) in ys.iter().enumerate() {
                let (up, right) = turn(1, *y, node);
                re[(node, row)] = amplitudes[node] * (cos * right - sin * up);
                im[(node, row)] = amplitudes[node] * (sin * right + cos * up);
            }
        }
        let cosines = DMatrix::from_fn(xs.len(), nodes, |i, node| turn(0, xs[i], node).1);
        let [mut real, mut imaginary] = [&cosines * &re, &cosines * &im];
        // The sines of a point and of its mirror image cancel.
        if !mirrored {
            let sines = DMatrix::from_fn(xs.len(), nodes, |i, node| turn(0, xs[i], node).0);
            real -= &sines * &im;
            imaginary += &sines * &re;
        }
        let peak = self.light.peak().powi(2);
        real.zip_map(&imaginary, |re, im| (re * re + im * im) / peak)
    }
}

/// The steps of Newton's method to the brightest point, and the halvings of a step.
const STEPS: usize = 30;
const HALVINGS: usize = 12;

/// The brightest point found from some points, from the one where the path differences vary least, and from
/// the image point of the chief ray.
pub(super) fn brightest(light: &PupilSamples, starts: &[[f64; 3]]) -> [f64; 3] {
    let others = [least_variance(light).unwrap_or([0.0; 3]), [0.0; 3]];
    let ends = starts.iter().chain(&others).map(|start| climb(light, *start));
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
fn climb(light: &PupilSamples, start: [f64; 3]) -> [f64; 3] {
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
    light: &PupilSamples,
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

impl PupilSamples {
    /// The cosines over the wavelength of a sample, and of its mirror image if it stands for that too.
    fn rows(&self, i: usize) -> impl Iterator<Item = [f64; 3]> + use<> {
        let [a, b] = self.cosines[i];
        let row = [a, b, third_cosine([a, b])].map(|cosine| cosine / self.wavelength);
        let mirror = [-row[0], row[1], row[2]];
        std::iter::once(row).chain(self.mirrored.then_some(mirror))
    }

    /// The intensity at a point off the image plane.
    pub(super) fn intensity_at(&self, point: [f64; 3]) -> f64 {
        let [re, im] = self.field_and_slopes(point).0;
        (re * re + im * im) / self.peak().powi(2)
    }

    /// The gradient and the second derivatives of the intensity at a point.
    fn slopes_at(&self, point: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let (u, first, second) = self.field_and_slopes(point);
        let scale = 2.0 / self.peak().powi(2);
        let gradient = (first[0] * u[0] + first[1] * u[1]) * scale;
        let products = first.each_ref().map(|part| part * part.transpose());
        let curvature = (products[0] + products[1] + second[0] * u[0] + second[1] * u[1]) * scale;
        (gradient, curvature)
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
fn third_cosine([a, b]: [f64; 2]) -> f64 {
    (1.0 - a * a - b * b).max(0.0).sqrt()
}
