//! Error of a spot's RMS radius against the time that it takes, for every way to sample a pupil.
//!
//! Every way starts from nothing: it finds its points, starts the rays, traces them and sums up. A
//! way that depends on chance, or on where a grid happens to lie, is represented by the root mean
//! square of several tries. The reference is the split boundary at its highest order.

use super::clock::timed;
use crate::lens::{Aperture, Field, Lens, Surface};
use crate::math::Real;
use crate::pupil::{
    Accuracy, Aiming, Bench, BenchError, Kind, Launch, LaunchError, Nodes, Pattern, Region,
    converged,
};
use crate::trace::{Points, Ray, Rays, Sink, Tracer};
use serde::Serialize;

/// How a pupil is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The middles of the cells of a square grid.
    SquareGrid,
    /// Rings with the last one on the rim, the usual pattern.
    Hexapolar,
    /// Independent points.
    Random,
    /// Owen-scrambled Sobol points.
    LowDiscrepancy,
    /// Gauss nodes over the whole disc, clipped.
    Gauss,
    /// Gauss nodes along the arcs of the edge and along the radius.
    SplitBoundary,
}

impl Sampling {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::SquareGrid,
        Self::Hexapolar,
        Self::Random,
        Self::LowDiscrepancy,
        Self::Gauss,
        Self::SplitBoundary,
    ];

    /// What a legend calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::SquareGrid => "square grid",
            Self::Hexapolar => "hexapolar",
            Self::Random => "random",
            Self::LowDiscrepancy => "low-discrepancy",
            Self::Gauss => "Gauss",
            Self::SplitBoundary => "split boundary",
        }
    }
}

/// What clips the beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Pupil {
    /// Nothing but the disc of the entrance pupil.
    Clear,
    /// The semi-diameters of the lens as well.
    Clipped,
}

/// The number type of the rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Single.
    F32,
    /// Double.
    F64,
}

/// One point of the curves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpotRow {
    /// What clips.
    pub pupil: Pupil,
    /// How the pupil is sampled.
    pub method: Sampling,
    /// The number type.
    pub precision: Precision,
    /// Rays traced, those included that only looked for the edge.
    pub rays: usize,
    /// The error of the RMS radius, relative.
    pub error: f64,
    /// What it took.
    pub ms: f64,
}

/// The curves of a field of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpotCurves {
    /// The reference of the clear pupil: the RMS radius in mm.
    pub rms_clear: f64,
    /// The same of the clipped pupil; `None` where no light gets through.
    pub rms_clipped: Option<f64>,
    /// The share of the disc that is lit.
    pub lit: f64,
    /// The curves.
    pub rows: Vec<SpotRow>,
}

/// Why there are no curves.
#[derive(Debug, thiserror::Error)]
pub enum NoCurves {
    /// The lens.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// The field.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The lens has no entrance pupil with a size.
    #[error("the entrance pupil is at infinity; expected one with a size")]
    NoPupil,
    /// Not even the clear pupil lets light through.
    #[error("no light gets through at this field")]
    Dark,
}

/// Rays of the patterns, about.
const BUDGETS: [usize; 8] = [16, 64, 256, 1024, 4096, 16_384, 65_536, 262_144];
/// How often a pattern with chance in it is tried.
const TRIES: u32 = 8;
/// Wider than the beam, so that the stop and not the disc limits it.
const MARGIN: f64 = 1.3;
/// A result is timed until it has taken so long, in ms, or so often.
const LONG_ENOUGH: f64 = 5.0;
const OFTEN_ENOUGH: usize = 25;

/// Measures all curves of a field at the primary wavelength, at a zoom position; `report` is told
/// how many of how many curves are done.
///
/// # Errors
/// A lens or field without rays.
pub fn spot_curves(
    lens: &Lens,
    zoom: usize,
    field: Field,
    mut report: impl FnMut(usize, usize),
) -> Result<SpotCurves, NoCurves> {
    let mut curves = SpotCurves { rms_clear: 0.0, rms_clipped: None, lit: 1.0, rows: Vec::new() };
    let (mut done, all) = (0, 4 * Sampling::ALL.len());
    for pupil in [Pupil::Clear, Pupil::Clipped] {
        let bench = bench(lens, zoom, pupil)?;
        let scene = Scene::new(&bench, field)?;
        let Some((rms, area)) = scene.reference() else {
            if pupil == Pupil::Clear {
                return Err(NoCurves::Dark);
            }
            break;
        };
        match pupil {
            Pupil::Clear => curves.rms_clear = rms,
            Pupil::Clipped => {
                curves.rms_clipped = Some(rms);
                curves.lit = area / std::f64::consts::PI;
            }
        }
        for precision in [Precision::F32, Precision::F64] {
            for method in Sampling::ALL {
                curves.rows.extend(scene.curve(pupil, method, precision, rms));
                done += 1;
                report(done, all);
            }
        }
    }
    Ok(curves)
}

/// The lens with the disc of its entrance pupil around the beam, and with or without its rims.
fn bench(lens: &Lens, zoom: usize, pupil: Pupil) -> Result<Bench, NoCurves> {
    let given = Bench::of(lens, zoom)?;
    let diameter = given.first.entrance_pupil.diameter.ok_or(NoCurves::NoPupil)?;
    let by_stop = matches!(given.beam.aperture, Aperture::StopSemiDiameter(_));
    let wider = if by_stop && pupil == Pupil::Clipped { MARGIN } else { 1.0 };
    let mut beam = given.beam;
    beam.aperture = Aperture::EntrancePupilDiameter(wider * diameter);
    let color = &given.colors[given.primary];
    let mut system = color.system.clone();
    if pupil == Pupil::Clear {
        system.surfaces.iter_mut().for_each(Surface::clear);
    }
    let aiming = if given.aiming == Aiming::Stop { Aiming::Chief } else { given.aiming };
    Ok(Bench::new(vec![(color.um, 1.0, system)], 0, beam, aiming)?)
}

/// A field of a lens, in both precisions.
struct Scene<'a> {
    bench: &'a Bench,
    field: Field,
    single: Tracer<f32>,
}

/// What a way of sampling gave.
struct Sampled {
    rms: f64,
    rays: usize,
}

impl<'a> Scene<'a> {
    fn new(bench: &'a Bench, field: Field) -> Result<Self, NoCurves> {
        bench.launch(field, 0)?;
        let single = Tracer::new(&bench.colors[0].system.lift());
        Ok(Self { bench, field, single: single.map_err(BenchError::from)? })
    }

    fn launch(&self) -> Option<Launch<'a>> {
        self.bench.launch(self.field, 0).ok()
    }

    /// The RMS radius as well as it can be known, and the lit area.
    fn reference(&self) -> Option<(f64, f64)> {
        let region = Region::new(self.launch()?);
        let accuracy = Accuracy { tolerance: 1e-14, most_rays: 4_000_000 };
        let numbers = |nodes: &Nodes| {
            let landed = region.trace::<Points<f64>>(nodes);
            let area = landed.arrived().map(|(_, w)| w).sum();
            rms(landed.arrived(), &landed.sink, nodes.mirrored).map(|rms| [rms, area])
        };
        let found = converged(&region, accuracy, numbers, |values| *values)?;
        Some((found.values[0], found.values[1]))
    }

    fn curve(
        &self,
        pupil: Pupil,
        method: Sampling,
        precision: Precision,
        exact: f64,
    ) -> Vec<SpotRow> {
        let mut rows = Vec::new();
        for step in 0..steps(method) {
            let tries = tries(method);
            let results: Vec<_> =
                (0..tries).filter_map(|t| self.timed(method, precision, step, t)).collect();
            if results.is_empty() {
                continue;
            }
            let count = results.len() as f64;
            let square = |(s, _): &(Sampled, f64)| (s.rms / exact - 1.0).powi(2);
            let error = (results.iter().map(square).sum::<f64>() / count).sqrt();
            let ms = results.iter().map(|(_, ms)| ms).sum::<f64>() / count;
            let rays = results.iter().map(|(s, _)| s.rays).sum::<usize>() / results.len();
            rows.push(SpotRow { pupil, method, precision, rays, error, ms });
        }
        rows
    }

    /// One result, and the median of the times that it took.
    fn timed(
        &self,
        method: Sampling,
        precision: Precision,
        step: usize,
        attempt: u32,
    ) -> Option<(Sampled, f64)> {
        let (mut result, first) = timed(|| self.sample(method, precision, step, attempt));
        let mut times = vec![first];
        let enough =
            |times: &[f64]| times.len() >= OFTEN_ENOUGH || times.iter().sum::<f64>() >= LONG_ENOUGH;
        while times.len() < 3 || !enough(&times) {
            let (again, ms) = timed(|| self.sample(method, precision, step, attempt));
            result = again;
            times.push(ms);
        }
        times.sort_by(f64::total_cmp);
        Some((result?, times[times.len() / 2]))
    }

    /// A way of sampling, from nothing to the RMS radius.
    fn sample(
        &self,
        method: Sampling,
        precision: Precision,
        step: usize,
        attempt: u32,
    ) -> Option<Sampled> {
        let launch = self.launch()?;
        let (region, nodes) = match fixed_pattern(method, step, attempt) {
            Some(pattern) => {
                let region = Region { launch, kind: Kind::Clear, rays: 0 };
                let nodes = region.sampled(pattern);
                (region, nodes)
            }
            None if method == Sampling::Gauss => {
                let region = Region { launch, kind: Kind::Clear, rays: 0 };
                let nodes = region.nodes(step);
                (region, nodes)
            }
            None => {
                let region = Region::new(launch);
                let nodes = region.nodes(step);
                (region, nodes)
            }
        };
        let rays = region.rays + nodes.rays + nodes.points.len();
        let rms = match precision {
            Precision::F64 => {
                let landed = region.trace::<Points<f64>>(&nodes);
                rms(landed.arrived(), &landed.sink, nodes.mirrored)
            }
            Precision::F32 => self.trace_single(&region, &nodes),
        };
        Some(Sampled { rms: rms?, rays })
    }

    /// The same in single precision; only the tracing is in it.
    fn trace_single(&self, region: &Region<'_>, nodes: &Nodes) -> Option<f64> {
        let mut weights = Vec::with_capacity(nodes.weights.len());
        let mut rays = Rays::with_capacity(nodes.points.len());
        for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
            if let Some(ray) = region.launch.ray(*p) {
                rays.push(rounded(ray));
                weights.push(*weight);
            }
        }
        let mut points = Points::default();
        self.single.batch(&rays, &mut points);
        let arrived = weights.iter().copied().enumerate();
        rms(arrived.filter(|(i, _)| points.fate(*i).is_imaged()), &points, nodes.mirrored)
    }
}

/// The ray with every number rounded.
fn rounded<R: Real>(ray: Ray<f64>) -> Ray<R> {
    Ray {
        point: crate::math::Vec3::from_f64(ray.point),
        direction: crate::math::Vec3::from_f64(ray.direction),
    }
}

/// The RMS distance from the centroid; `None` where no ray arrives.
fn rms<R: Real>(
    arrived: impl Iterator<Item = (usize, f64)>,
    points: &Points<R>,
    mirrored: bool,
) -> Option<f64> {
    let arrived: Vec<_> = arrived.collect();
    let at = |i: usize| [points.x[i].value(), points.y[i].value()];
    let (mut sum, mut center) = (0.0, [0.0; 2]);
    for (i, w) in arrived.iter().copied() {
        let [x, y] = at(i);
        sum += w;
        center[0] += if mirrored { 0.0 } else { w * x };
        center[1] += w * y;
    }
    let [cx, cy] = center.map(|c| c / sum);
    let square = |(i, w): (usize, f64)| {
        let [x, y] = at(i);
        w * ((x - cx).powi(2) + (y - cy).powi(2))
    };
    (sum > 0.0).then(|| (arrived.iter().copied().map(square).sum::<f64>() / sum).sqrt())
}

/// How many points a curve has.
fn steps(method: Sampling) -> usize {
    match method {
        Sampling::SquareGrid | Sampling::Hexapolar | Sampling::Random => BUDGETS.len(),
        // The sequence repeats after 65 536 points.
        Sampling::LowDiscrepancy => BUDGETS.len() - 1,
        Sampling::Gauss => 14,
        Sampling::SplitBoundary => 11,
    }
}

fn tries(method: Sampling) -> u32 {
    match method {
        Sampling::Random | Sampling::LowDiscrepancy => TRIES,
        Sampling::SquareGrid => 4,
        Sampling::Hexapolar | Sampling::Gauss | Sampling::SplitBoundary => 1,
    }
}

/// The points of a fixed pattern with about the rays of a budget.
fn fixed_pattern(method: Sampling, step: usize, attempt: u32) -> Option<Pattern> {
    let count = *BUDGETS.get(step)?;
    let root = (count as f64).sqrt();
    match method {
        Sampling::SquareGrid => {
            let cells = root * (4.0 / std::f64::consts::PI).sqrt();
            Some(Pattern::Square(cells.round() as usize + attempt as usize))
        }
        Sampling::Hexapolar => Some(Pattern::Hexapolar((root / 3f64.sqrt()).round() as usize)),
        Sampling::Random => Some(Pattern::Random { count, seed: attempt + 1 }),
        Sampling::LowDiscrepancy => Some(Pattern::Sobol { count, seed: attempt + 1 }),
        Sampling::Gauss | Sampling::SplitBoundary => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::double_gauss;

    #[test]
    fn gauss_beats_every_fixed_pattern_on_a_clear_pupil() {
        let lens = double_gauss();
        let bench = bench(&lens, 0, Pupil::Clear).unwrap();
        let scene = Scene::new(&bench, Field { x: 0.0, y: 10.0, weight: 1.0 }).unwrap();
        let (exact, _) = scene.reference().unwrap();
        let error = |method, step| {
            let sampled = scene.sample(method, Precision::F64, step, 0).unwrap();
            (sampled.rms / exact - 1.0).abs()
        };
        assert!(error(Sampling::Gauss, 5) < 1e-9, "{}", error(Sampling::Gauss, 5));
        for fixed in [Sampling::SquareGrid, Sampling::Hexapolar, Sampling::Random] {
            assert!(error(fixed, 3) > 1e-6, "{fixed:?}");
        }
    }
}
