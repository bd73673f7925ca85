//! The brightest point of a diffraction image in space.
//!
//! Where a pupil has aberrations the intensity has many local maxima, among which Newton's method finds the
//! one that it begins at. So the blur is looked at first, in planes across the chief ray. The field at a point is
//! that of the part of the pupil whose rays come near it, since the phase of the rest turns: only where that part
//! may make a larger intensity than the best one found before is the field computed. At a grid of points it is a
//! product of matrices, since its phase is a sum of terms in x and in y. The grid has four points to λ/NA, between
//! which the intensity of a peak falls to 0.64 at most; the method begins at every local maximum of the grid that
//! may be the peak then.

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
/// The side of a cell by λ/NA. Rays are near a point if they meet the plane in its cell or in one beside it: those of
/// a third of the pupil that land farther away turn the phase by more than a whole turn over it.
const CELL: f64 = 2.0;
/// The share of the light that may land so far away that nodes do not resolve its phase: what it seems to add to a
/// point of the grid is less than a tenth of its share, and the peak is climbed with nodes of other orders.
const STRAY: f64 = 0.1;
/// The largest number of cells of a plane, and of planes.
const MOST_CELLS: f64 = 1e6;
const MOST_PLANES: f64 = 1e4;
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
    rays: Vec<BlurRay>,
    mirrored: bool,
}

/// A ray of a blur.
#[derive(Debug)]
struct BlurRay {
    /// Its place in the plane of the centre, from the chief ray, in mm.
    at: [f64; 2],
    /// Its slopes against the chief ray.
    slopes: [f64; 2],
    /// Its share of the amplitude.
    share: f64,
}

/// The steps of a search through a blur, in mm: of points across, of planes, and the side of a cell.
#[derive(Debug, Clone, Copy)]
struct BlurSteps {
    across: f64,
    along: f64,
    cell: f64,
}

/// A plane across the chief ray, with a grid of points.
#[derive(Debug)]
struct BlurPlane {
    z: f64,
    /// The distance in mm from a point of the grid within which nearly all rays land.
    reach: f64,
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
        let few = PupilSamples::of_nodes(region, sphere, &region.nodes(FEW))?;
        let Some(order) = resolving_order(region, few.turns(0.0)) else {
            return Ok(Self::default());
        };
        let traced = TracedLight::new(region, &region.nodes(order));
        let light = traced.on(sphere)?;
        let found = light.intensity_at(brightest(&light, &[]));
        let blur = Blur::new(&traced, &light, sphere);
        let Some(planes) = blur.planes(&light, found.sqrt()) else { return Ok(Self::default()) };
        let reach = planes.iter().map(|plane| plane.reach).fold(0.0, f64::max);
        let turns = light.spread() * reach / light.wavelength;
        let Some(order) = resolving_order(region, turns) else { return Ok(Self::default()) };
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

/// The first order whose nodes resolve a phase of so many turns over a radius of the pupil.
fn resolving_order(region: &Region<'_>, turns: f64) -> Option<usize> {
    let least = NODES_PER_TURN * turns;
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
    fn new(traced: &TracedLight, light: &PupilSamples, sphere: &ReferenceSphere) -> Self {
        // Light may run against the axis; depth is along the light, as cosines are.
        let slopes = |d: Vec3<f64>| [d.x / d.z.abs(), d.y / d.z.abs()];
        let chief = slopes(sphere.direction);
        let total = light.peak();
        let lines = traced.ends_of(&light.points);
        let rays = lines.iter().zip(&light.amplitudes).map(|((ray, _), amplitude)| {
            let off = ray.point - sphere.center;
            let depth = off.z * ray.direction.z.signum();
            let [u, v] = slopes(ray.direction);
            BlurRay {
                at: [off.x - depth * u, off.y - depth * v],
                slopes: [u - chief[0], v - chief[1]],
                share: amplitude / total,
            }
        });
        Self { chief, rays: rays.collect(), mirrored: light.mirrored }
    }

    /// The range along the axis in which rays come nearest to the chief ray; `None` if none crosses it.
    fn depth(&self) -> Option<[f64; 2]> {
        let square = |[u, v]: [f64; 2]| u * u + v * v;
        let most = self.rays.iter().map(|ray| square(ray.slopes)).fold(0.0, f64::max);
        let outer = self.rays.iter().filter(|ray| square(ray.slopes) > LEVER * LEVER * most);
        let nearest = outer.map(|BlurRay { at, slopes, .. }| {
            -(at[0] * slopes[0] + at[1] * slopes[1]) / square(*slopes)
        });
        let range = nearest.fold([0.0f64; 2], |[low, high], z| [low.min(z), high.max(z)]);
        range.iter().all(|z| z.is_finite()).then_some(range)
    }

    /// The planes in which at least a share of the amplitude comes near some point; `None` if the blur has no extent
    /// or they are too many.
    fn planes(&self, light: &PupilSamples, least: f64) -> Option<Vec<BlurPlane>> {
        let [low, high] = self.depth()?;
        let unit = light.wavelength / light.spread();
        let depth = light.wavelength / PlaneLight::new(light, self.chief).depth_of_cosines();
        let steps = BlurSteps { across: ACROSS * unit, along: ALONG * depth, cell: CELL * unit };
        let count = (high - low) / steps.along + 2.0;
        if !(unit.is_finite() && steps.along > 0.0 && count < MOST_PLANES) {
            return None;
        }
        let mut planes = Vec::new();
        for i in 0..=count as usize {
            let z = low + (i as f64 - 0.5) * steps.along;
            planes.extend(self.plane(z, steps, least)?);
        }
        Some(planes)
    }

    /// The distance from a point of a rectangle in a plane within which nearly all rays land.
    fn reach(&self, z: f64, [[left, right], [low, high]]: [[f64; 2]; 2]) -> f64 {
        let center = [0.5 * (left + right), 0.5 * (low + high)];
        let distance = |ray: &BlurRay| {
            let [x, y] = [0, 1].map(|axis| ray.at[axis] + z * ray.slopes[axis] - center[axis]);
            (x.hypot(y), ray.share)
        };
        let mut all: Vec<(f64, f64)> = self.rays.iter().map(distance).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut beyond = 0.0;
        let within = all.iter().find(|(_, share)| {
            beyond += share;
            beyond > STRAY
        });
        within.map_or(0.0, |(distance, _)| *distance) + 0.5 * (right - left).hypot(high - low)
    }

    /// The points of a plane near which at least a share of the amplitude comes, if there are any; `None` if the plane
    /// has too many cells.
    fn plane(&self, z: f64, steps: BlurSteps, least: f64) -> Option<Option<BlurPlane>> {
        let cells = BlurCells::new(self, z, steps.cell)?;
        let Some(range) = cells.range(least) else { return Some(None) };
        let mut places = [const { Vec::new() }; 2];
        for (axis, places) in places.iter_mut().enumerate() {
            let [low, high] = range[axis];
            // Half of the blur is the mirror image of the other half.
            let low = if self.mirrored && axis == 0 { low.max(0.0) } else { low };
            let count = ((high - low) / steps.across).max(0.0) as usize + 2;
            places.extend((0..count).map(|i| low + i as f64 * steps.across));
        }
        Some(Some(BlurPlane { z, reach: self.reach(z, range), places }))
    }
}

/// The shares of the amplitude of a plane by square cells.
struct BlurCells {
    /// The corner of the first cell, and the side of each.
    corner: [f64; 2],
    side: f64,
    shares: DMatrix<f64>,
}

impl BlurCells {
    /// `None` for too many cells.
    fn new(blur: &Blur, z: f64, side: f64) -> Option<Self> {
        let place = |ray: &BlurRay| [0, 1].map(|axis| ray.at[axis] + z * ray.slopes[axis]);
        let mirrors: &[f64] = if blur.mirrored { &[1.0, -1.0] } else { &[1.0] };
        let each = |ray| mirrors.iter().map(move |sign| (place(ray), *sign));
        let all = || blur.rays.iter().flat_map(each).map(|([x, y], sign)| [sign * x, y]);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for at in all() {
            low = [0, 1].map(|axis| low[axis].min(at[axis]));
            high = [0, 1].map(|axis| high[axis].max(at[axis]));
        }
        let counts = [0, 1].map(|axis| (high[axis] - low[axis]) / side + 1.0);
        if !(counts[0] * counts[1] < MOST_CELLS) {
            return None;
        }
        let mut shares = DMatrix::zeros(counts[0] as usize + 1, counts[1] as usize + 1);
        let share = blur.rays.iter().flat_map(|ray| mirrors.iter().map(|_| ray.share));
        for (at, share) in all().zip(share) {
            let cell = [0, 1].map(|axis| ((at[axis] - low[axis]) / side) as usize);
            shares[(cell[0], cell[1])] += share / mirrors.len() as f64;
        }
        Some(Self { corner: low, side, shares })
    }

    /// The smallest rectangle around the cells that have at least a share together with those beside them.
    fn range(&self, least: f64) -> Option<[[f64; 2]; 2]> {
        let (columns, rows) = self.shares.shape();
        let near = |n: usize, end: usize| n.saturating_sub(1)..(n + 2).min(end);
        let around = |i: usize, k: usize| -> f64 {
            near(i, columns)
                .flat_map(|i| near(k, rows).map(move |k| (i, k)))
                .map(|at| self.shares[at])
                .sum()
        };
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for cell in (0..columns).flat_map(|i| (0..rows).map(move |k| [i, k])) {
            if around(cell[0], cell[1]) >= least {
                low = [0, 1].map(|axis| low[axis].min(cell[axis]));
                high = [0, 1].map(|axis| high[axis].max(cell[axis] + 1));
            }
        }
        let place = |axis: usize, n: usize| self.corner[axis] + self.side * n as f64;
        (high[0] > 0).then(|| [0, 1].map(|axis| [place(axis, low[axis]), place(axis, high[axis])]))
    }
}

impl BlurPlane {
    fn points(&self) -> f64 {
        self.places[0].len() as f64 * self.places[1].len() as f64
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
