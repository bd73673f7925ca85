//! The search of a blur for the brightest point of a diffraction image.
//!
//! Where a pupil has aberrations the intensity has many local maxima, among which Newton's method finds the
//! one that it begins at. So the blur is looked at first, in planes across the chief ray. The field at a point is
//! that of the part of the pupil whose rays come near it, since the phase of the rest turns: only where that part
//! may make a larger intensity than the best one found before is the field computed. At a grid of points it is a
//! product of matrices, since its phase is a sum of terms in x and in y. The grid has four points to λ/NA, between
//! which the intensity of a peak falls to 0.64 at most, or to 0.48 for a ring as the pupil; the method begins at every
//! local maximum of the grid that may be the peak then.

use super::Interruption;
use super::brightest::{ImageIntensity as _, brightest, climb, third_cosine};
use super::pupil_samples::{NODES_PER_TURN, PupilSamples};
use super::pupil_traces::TracedLight;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::math::Vec3;
use crate::pupil::{Accuracy, Region};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// The distance of the points of a plane by λ/NA, and that of the planes by λ over the spread of the cosines along
/// the chief ray.
const ACROSS: f64 = 0.25;
const ALONG: f64 = 0.4;
/// The intensity at the nearest point of the grid over that of a peak, at least.
const SEEN: f64 = 0.45;
/// The local maxima of the grid that are climbed, and those that are kept.
const CLIMBED: usize = 32;
const KEPT: usize = 4;
/// The part of the largest slope from which on a ray tells where the light is focused.
const LEVER: f64 = 0.3;
/// The side of a cell by λ/NA. Rays are near a point if they meet the plane in its cell or in one beside it: those of
/// a third of the pupil that land farther away turn the phase by more than a whole turn over it.
const CELL: f64 = 2.0;
/// The share of the amplitude near a point, over the amplitude of the best point found before, from which on the
/// point may be brighter: the rest adds something.
const MARGIN: f64 = 0.9;
/// The share of the light that may land so far away that nodes do not resolve its phase: what it seems to add to a
/// point is far less than that, and is seen by a change of the nodes.
const STRAY: f64 = 0.1;
/// The largest number of cells of a plane, and of planes.
const MOST_CELLS: f64 = 1e5;
const MOST_PLANES: f64 = 1e3;
/// The products of real numbers that a search may take: a second of one core.
const MOST_PRODUCTS: f64 = 4e9;
/// The order of quadrature of few rays.
const FEW: usize = 2;

/// The brightest local maxima of a blur.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct BlurPeaks {
    /// Their points, in mm from the centre of the sphere.
    pub(super) points: Vec<[f64; 3]>,
    /// True if all of the blur was searched.
    pub(super) is_whole: bool,
    /// The number of rays traced.
    pub(super) rays: usize,
    /// The nodes along a radius of the pupil that resolve the phase of the light towards these points.
    pub(super) nodes: usize,
}

/// The cause for which a blur is not searched.
enum SearchEnd {
    TooLarge,
    Interrupted,
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

/// A local maximum of the grids: the intensity and the point.
type GridMaximum = (f64, [f64; 3]);

impl BlurPeaks {
    /// The brightest maxima of the light of a pupil; none of a blur that is too large to be searched with so many
    /// rays.
    ///
    /// # Errors
    /// [`AnalysisError::Interrupted`], which is asked for at every plane and climb.
    pub(super) fn find(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        accuracy: Accuracy,
        interrupted: &Interruption<'_>,
    ) -> Result<Self, AnalysisError> {
        let search = BlurSearch { region, sphere, accuracy, interrupted };
        match search.run() {
            Ok(found) => Ok(found),
            Err(SearchEnd::TooLarge) => Ok(Self::default()),
            Err(SearchEnd::Interrupted) => Err(AnalysisError::Interrupted),
        }
    }
}

/// The search of the blur of a pupil.
struct BlurSearch<'a> {
    region: &'a Region<'a>,
    sphere: &'a ReferenceSphere,
    accuracy: Accuracy,
    interrupted: &'a Interruption<'a>,
}

impl BlurSearch<'_> {
    fn run(&self) -> Result<BlurPeaks, SearchEnd> {
        let (traced, few) = self.light((0, 0.0), FEW)?;
        let rays = traced.cost;
        let coarse = self.resolving_order(few.turns(0.0))?;
        let (traced, light) = self.light((rays, 0.0), coarse)?;
        let mut rays = rays + traced.cost;
        let found = light.intensity_at(brightest(&light, &[]));
        let blur = Blur::new(&traced, &light, self.sphere);
        let planes = self.planes(&blur, &light, MARGIN * found.sqrt())?;
        let reach = planes.iter().map(|plane| plane.reach).fold(0.0, f64::max);
        let turns = light.spread() * reach / light.wavelength;
        let points: f64 = planes.iter().map(BlurPlane::points).sum();
        let products = points * if light.mirrored { 2.0 } else { 4.0 };
        let order = self.resolving_order(turns)?;
        let light = if order > coarse {
            let (traced, light) = self.light((rays, products), order)?;
            rays += traced.cost;
            light
        } else {
            check_products(products, light.points.len())?;
            light
        };
        let seen = PlaneLight::new(&light, blur.chief);
        let mut maxima = Vec::new();
        for plane in &planes {
            self.go_on()?;
            maxima.extend(seen.maxima(plane));
        }
        let unit = light.wavelength / light.spread();
        let (likely, is_whole) = likely_peaks(maxima, [unit, seen.depth()]);
        let points = self.climbed(&light, &likely)?;
        let reach = points.iter().map(|point| blur.reach_of(*point)).fold(0.0, f64::max);
        let nodes = (NODES_PER_TURN * light.spread() * reach / light.wavelength).ceil() as usize;
        Ok(BlurPeaks { points, is_whole, rays, nodes })
    }

    fn go_on(&self) -> Result<(), SearchEnd> {
        if (self.interrupted)() { Err(SearchEnd::Interrupted) } else { Ok(()) }
    }

    /// The light of an order, if it and the rays before it are not too many, nor the products of real numbers that each
    /// node takes.
    fn light(
        &self,
        (before, products): (usize, f64),
        order: usize,
    ) -> Result<(TracedLight, PupilSamples), SearchEnd> {
        self.go_on()?;
        let nodes = self.region.nodes(order);
        check_products(products, nodes.points.len())?;
        if before + nodes.rays + 2 * nodes.points.len() > self.accuracy.max_rays {
            return Err(SearchEnd::TooLarge);
        }
        let traced = TracedLight::new(self.region, &nodes);
        match traced.on(self.sphere) {
            Ok(light) => Ok((traced, light)),
            // A pupil that folds at a higher order than the ratios need.
            Err(_) => Err(SearchEnd::TooLarge),
        }
    }

    /// The first order whose nodes resolve a phase of so many turns over a radius of the pupil.
    fn resolving_order(&self, turns: f64) -> Result<usize, SearchEnd> {
        let region = self.region;
        let orders = if region.is_sampled() { 0 } else { region.orders() };
        let least = NODES_PER_TURN * turns;
        let found = (0..orders).find(|order| region.radial_nodes(*order) as f64 >= least);
        found.ok_or(SearchEnd::TooLarge)
    }

    /// The planes in which at least a share of the amplitude comes near some point.
    fn planes(
        &self,
        blur: &Blur,
        light: &PupilSamples,
        least: f64,
    ) -> Result<Vec<BlurPlane>, SearchEnd> {
        let [low, high] = blur.depth();
        let unit = light.wavelength / light.spread();
        let along = ALONG * PlaneLight::new(light, blur.chief).depth();
        let steps = BlurSteps { across: ACROSS * unit, along, cell: CELL * unit };
        let count = (high - low) / steps.along + 2.0;
        if !(unit.is_finite() && steps.along > 0.0 && count < MOST_PLANES) {
            return Err(SearchEnd::TooLarge);
        }
        let mut planes = Vec::new();
        for i in 0..=count as usize {
            self.go_on()?;
            planes.extend(blur.plane(low + (i as f64 - 0.5) * steps.along, steps, least)?);
        }
        Ok(planes)
    }

    /// The brightest ends of climbs.
    fn climbed(
        &self,
        light: &PupilSamples,
        starts: &[GridMaximum],
    ) -> Result<Vec<[f64; 3]>, SearchEnd> {
        let mut ends = Vec::new();
        for (_, start) in starts {
            self.go_on()?;
            let end = climb(light, *start);
            ends.push((light.intensity_at(end), end));
        }
        ends.sort_by(|a, b| b.0.total_cmp(&a.0));
        ends.dedup_by(|a, b| (a.0 - b.0).abs() <= 1e-9 * b.0);
        Ok(ends.into_iter().take(KEPT).map(|(_, end)| end).collect())
    }
}

/// Refuses more products than a search may take, given those of each node.
fn check_products(products: f64, nodes: usize) -> Result<(), SearchEnd> {
    if products * nodes as f64 > MOST_PRODUCTS { Err(SearchEnd::TooLarge) } else { Ok(()) }
}

/// Those local maxima that may be the peak, without those beside a higher one; false if they are too many to be
/// climbed. The size of a peak is given, across and along the chief ray.
fn likely_peaks(
    mut maxima: Vec<GridMaximum>,
    [across, along]: [f64; 2],
) -> (Vec<GridMaximum>, bool) {
    maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = SEEN * maxima.first().map_or(0.0, |(value, _)| *value);
    let mut likely: Vec<GridMaximum> = Vec::new();
    for maximum in maxima.into_iter().take_while(|(value, _)| *value >= least) {
        let is_beside = |[x, y, z]: [f64; 3]| {
            let [dx, dy, dz] = [x - maximum.1[0], y - maximum.1[1], z - maximum.1[2]];
            dx.hypot(dy) < 0.5 * across && dz.abs() < 0.5 * along
        };
        if likely.iter().any(|(_, higher)| is_beside(*higher)) {
            continue;
        }
        if likely.len() == CLIMBED {
            return (likely, false);
        }
        likely.push(maximum);
    }
    (likely, true)
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

    /// The range along the axis, the image plane included, in which rays come nearest to the chief ray.
    fn depth(&self) -> [f64; 2] {
        let square = |[u, v]: [f64; 2]| u * u + v * v;
        let most = self.rays.iter().map(|ray| square(ray.slopes)).fold(0.0, f64::max);
        let outer = self.rays.iter().filter(|ray| square(ray.slopes) > LEVER * LEVER * most);
        let nearest = outer.map(|BlurRay { at, slopes, .. }| {
            -(at[0] * slopes[0] + at[1] * slopes[1]) / square(*slopes)
        });
        nearest.fold([0.0f64; 2], |[low, high], z| [low.min(z), high.max(z)])
    }

    /// The places of all rays in a plane, from the chief ray, with their shares of the amplitude.
    fn landings(&self, z: f64) -> Vec<([f64; 2], f64)> {
        let mut all = Vec::new();
        for ray in &self.rays {
            let [x, y] = [0, 1].map(|axis| ray.at[axis] + z * ray.slopes[axis]);
            if self.mirrored {
                all.extend([x, -x].map(|x| ([x, y], 0.5 * ray.share)));
            } else {
                all.push(([x, y], ray.share));
            }
        }
        all
    }

    /// The points of a plane near which at least a share of the amplitude comes, if there are any.
    fn plane(&self, z: f64, steps: BlurSteps, least: f64) -> Result<Option<BlurPlane>, SearchEnd> {
        let landings = self.landings(z);
        let cells = BlurCells::new(&landings, steps.cell).ok_or(SearchEnd::TooLarge)?;
        let Some(range) = cells.range(least) else { return Ok(None) };
        let mut places = [const { Vec::new() }; 2];
        for (axis, places) in places.iter_mut().enumerate() {
            let [low, high] = range[axis];
            // Half of the blur is the mirror image of the other half.
            let low = if self.mirrored && axis == 0 { low.max(0.0) } else { low };
            let count = ((high - low) / steps.across).max(0.0) as usize + 2;
            places.extend((0..count).map(|i| low + i as f64 * steps.across));
        }
        let [[left, right], [low, high]] = range;
        let center = [0.5 * (left + right), 0.5 * (low + high)];
        let reach = reach(&landings, center) + 0.5 * (right - left).hypot(high - low);
        Ok(Some(BlurPlane { z, reach, places }))
    }

    /// The distance from a point, in mm from the centre of the sphere, within which nearly all rays land.
    fn reach_of(&self, [x, y, z]: [f64; 3]) -> f64 {
        reach(&self.landings(z), [x - z * self.chief[0], y - z * self.chief[1]])
    }
}

/// The distance from a point of a plane within which nearly all rays land.
fn reach(landings: &[([f64; 2], f64)], [x, y]: [f64; 2]) -> f64 {
    let distances = landings.iter().map(|([u, v], share)| ((u - x).hypot(v - y), *share));
    let mut distances: Vec<(f64, f64)> = distances.collect();
    distances.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut beyond = 0.0;
    let nearly_all = distances.iter().find(|(_, share)| {
        beyond += share;
        beyond > STRAY
    });
    nearly_all.map_or(0.0, |(distance, _)| *distance)
}

/// The shares of the amplitude of a plane by square cells.
struct BlurCells {
    /// The corner of the first cell, and the side of each.
    corner: [f64; 2],
    side: f64,
    shares: DMatrix<f64>,
}

impl BlurCells {
    /// The cells of some landings; `None` for too many cells or none.
    fn new(landings: &[([f64; 2], f64)], side: f64) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (at, _) in landings {
            low = [0, 1].map(|axis| low[axis].min(at[axis]));
            high = [0, 1].map(|axis| high[axis].max(at[axis]));
        }
        let counts = [0, 1].map(|axis| ((high[axis] - low[axis]) / side).floor() + 1.0);
        if !(counts[0] * counts[1] < MOST_CELLS) {
            return None;
        }
        let counts = counts.map(|count| count as usize);
        let mut shares = DMatrix::zeros(counts[0], counts[1]);
        for (at, share) in landings {
            let cell = |axis: usize| {
                (((at[axis] - low[axis]) / side) as usize).min(counts[axis].saturating_sub(1))
            };
            shares[(cell(0), cell(1))] += share;
        }
        Some(Self { corner: low, side, shares })
    }

    /// The smallest rectangle around the cells that have at least a share together with those beside them.
    fn range(&self, least: f64) -> Option<[[f64; 2]; 2]> {
        let (columns, rows) = self.shares.shape();
        let near = |n: usize, end: usize| n.saturating_sub(1)..(n + 2).min(end);
        let around = |i: usize, k: usize| -> f64 {
            let cells = near(i, columns).flat_map(|i| near(k, rows).map(move |k| (i, k)));
            cells.map(|at| self.shares[at]).sum()
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

    /// The length of a peak along the axis: the wavelength over the spread of the cosines along the chief ray.
    fn depth(&self) -> f64 {
        let most = self.along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = self.along.iter().copied().fold(f64::INFINITY, f64::min);
        self.light.wavelength / (most - least)
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
        let PupilSamples { waves, amplitudes, wavelength, mirrored, .. } = self.light;
        let [xs, ys] = &plane.places;
        let nodes = amplitudes.len();
        let [mut re, mut im] = [0, 1].map(|_| DMatrix::<f64>::zeros(nodes, ys.len()));
        for node in 0..nodes {
            let phase = self.along[node] * plane.z / wavelength - waves[node];
            for (row, y) in ys.iter().enumerate() {
                let (sin, cos) = (TAU * (phase + self.turns(1, *y, node))).sin_cos();
                re[(node, row)] = amplitudes[node] * cos;
                im[(node, row)] = amplitudes[node] * sin;
            }
        }
        let angle = |i: usize, node: usize| TAU * self.turns(0, xs[i], node);
        let cosines = DMatrix::from_fn(xs.len(), nodes, |i, node| angle(i, node).cos());
        let [mut real, mut imaginary] = [&cosines * &re, &cosines * &im];
        // The sines of a point and of its mirror image cancel.
        if !mirrored {
            let sines = DMatrix::from_fn(xs.len(), nodes, |i, node| angle(i, node).sin());
            real -= &sines * &im;
            imaginary += &sines * &re;
        }
        let peak = self.light.peak().powi(2);
        real.zip_map(&imaginary, |re, im| (re * re + im * im) / peak)
    }

    /// The turns of the phase of a node at a place along an axis.
    fn turns(&self, axis: usize, place: f64, node: usize) -> f64 {
        self.light.cosines[node][axis] * place / self.light.wavelength
    }
}
