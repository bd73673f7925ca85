//! Error against time of the RMS spot radius, for every sampling of the pupil.
//!
//! Each result includes all its work: finding the points, launching and tracing the rays, and
//! summation. A random sampling, or one that depends on the position of a grid, is represented by
//! the RMS error of several tries. The reference is the split boundary at its highest order.

use super::timing::time_median;
use crate::lens::{Aperture, FieldPoint, Lens, Surface};
use crate::math::Real;
use crate::pupil::{
    Accuracy, Aiming, Launch, LaunchError, Nodes, PupilPattern, RayModel, RayModelError, Region,
    RegionKind, converge,
};
use crate::trace::{ImagePoints, Rays, TraceSink, Tracer};
use serde::Serialize;
use std::ops::ControlFlow;

/// The sampling of a pupil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PupilSampling {
    /// The centres of the cells of a square grid.
    SquareGrid,
    /// A hexapolar pattern with its last ring on the rim, the usual one.
    Hexapolar,
    /// Independent uniform points.
    Random,
    /// Owen-scrambled Sobol points.
    LowDiscrepancy,
    /// Gauss nodes over the whole disc, clipped.
    Gauss,
    /// Gauss nodes along the arcs of the edge and along the radius.
    SplitBoundary,
}

impl PupilSampling {
    /// All samplings.
    pub const ALL: [Self; 6] = [
        Self::SquareGrid,
        Self::Hexapolar,
        Self::Random,
        Self::LowDiscrepancy,
        Self::Gauss,
        Self::SplitBoundary,
    ];

    /// The name of the sampling in legends.
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

/// The apertures that clip the beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PupilClipping {
    /// The disc of the entrance pupil alone.
    Clear,
    /// The disc of the entrance pupil and the semi-diameters of the lens.
    Clipped,
}

/// The number type of the rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// A point of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpotRow {
    /// The apertures that clip the beam.
    pub pupil: PupilClipping,
    /// The sampling of the pupil.
    pub method: PupilSampling,
    /// The number type of the rays.
    pub precision: Precision,
    /// The number of rays traced, including those that find the edge.
    pub rays: usize,
    /// The relative error of the RMS radius.
    pub error: f64,
    /// The time, in milliseconds.
    pub ms: f64,
}

/// The curves of a field of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpotCurves {
    /// The reference RMS radius of the clear pupil, in mm.
    pub rms_clear: f64,
    /// The reference RMS radius of the clipped pupil, in mm; `None` if no light gets through.
    pub rms_clipped: Option<f64>,
    /// The fraction of the disc that transmits light.
    #[serde(rename = "lit")]
    pub transmitted: f64,
    /// The points of the curves.
    pub rows: Vec<SpotRow>,
    /// True if the measurement was stopped: what is missing was not reached.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stopped: bool,
}

/// The error of a spot benchmark.
#[derive(Debug, thiserror::Error)]
pub enum SpotCurvesError {
    /// The ray model of the lens cannot be set up.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// No rays can be launched from the field.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The lens has no entrance pupil of finite size.
    #[error("the entrance pupil is at infinity; expected one of finite size")]
    NoPupil,
    /// No light gets through even the clear pupil.
    #[error("no light gets through at this field")]
    Dark,
}

/// The approximate numbers of rays of the patterns.
const BUDGETS: [usize; 8] = [16, 64, 256, 1024, 4096, 16_384, 65_536, 262_144];
/// The number of tries of a random pattern.
const TRIES: u32 = 8;
/// The radius of the disc relative to that of the beam, so that the stop and not the disc limits
/// it.
const MARGIN: f64 = 1.3;
/// The maximum number of times that a result is timed.
const OFTEN_ENOUGH: usize = 25;

/// Measures all curves of a field at the primary wavelength, at a zoom position. `report` receives
/// the numbers of finished and of all curves; the curves so far are returned once it breaks.
///
/// # Errors
/// A lens or field without rays.
pub fn measure_spot_curves(
    lens: &Lens,
    zoom: usize,
    field: FieldPoint,
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<SpotCurves, SpotCurvesError> {
    let mut curves = SpotCurves {
        rms_clear: 0.0,
        rms_clipped: None,
        transmitted: 1.0,
        rows: Vec::new(),
        stopped: false,
    };
    let (mut done, all) = (0, 4 * PupilSampling::ALL.len());
    for pupil in [PupilClipping::Clear, PupilClipping::Clipped] {
        let model = ray_model(lens, zoom, pupil)?;
        let scene = SpotScene::new(&model, field)?;
        let Some((rms, area)) = scene.reference() else {
            if pupil == PupilClipping::Clear {
                return Err(SpotCurvesError::Dark);
            }
            break;
        };
        match pupil {
            PupilClipping::Clear => curves.rms_clear = rms,
            PupilClipping::Clipped => {
                curves.rms_clipped = Some(rms);
                curves.transmitted = area / std::f64::consts::PI;
            }
        }
        for precision in [Precision::F32, Precision::F64] {
            for method in PupilSampling::ALL {
                curves.rows.extend(scene.curve(pupil, method, precision, rms));
                done += 1;
                if report(done, all).is_break() {
                    curves.stopped = true;
                    return Ok(curves);
                }
            }
        }
    }
    Ok(curves)
}

/// The ray model of the lens with the disc of its entrance pupil, and with or without its
/// semi-diameters.
fn ray_model(lens: &Lens, zoom: usize, pupil: PupilClipping) -> Result<RayModel, SpotCurvesError> {
    let given = RayModel::from_lens(lens, zoom)?;
    let diameter = given.first_order.entrance_pupil.diameter.ok_or(SpotCurvesError::NoPupil)?;
    let by_stop = matches!(given.beam.aperture, Aperture::StopSemiDiameter(_));
    let wider = if by_stop && pupil == PupilClipping::Clipped { MARGIN } else { 1.0 };
    let mut beam = given.beam;
    beam.aperture = Aperture::EntrancePupilDiameter(wider * diameter);
    let color = &given.channels[given.primary];
    let mut system = color.system.clone();
    if pupil == PupilClipping::Clear {
        system.surfaces.iter_mut().for_each(Surface::remove_apertures);
    }
    let aiming = if given.aiming == Aiming::Stop { Aiming::Chief } else { given.aiming };
    Ok(RayModel::from_systems(vec![(color.um, 1.0, system)], 0, beam, aiming)?)
}

/// A field of a lens, in both precisions.
struct SpotScene<'a> {
    model: &'a RayModel,
    field: FieldPoint,
    single: Tracer<f32>,
}

/// The result of a sampling.
struct SampledRms {
    rms: f64,
    rays: usize,
}

impl<'a> SpotScene<'a> {
    fn new(model: &'a RayModel, field: FieldPoint) -> Result<Self, SpotCurvesError> {
        model.launch(field, 0)?;
        let single = Tracer::new(&model.channels[0].system.cast());
        Ok(Self { model, field, single: single.map_err(RayModelError::from)? })
    }

    fn launch(&self) -> Option<Launch<'a>> {
        self.model.launch(self.field, 0).ok()
    }

    /// The reference RMS radius in mm and the fraction of the disc that transmits light.
    fn reference(&self) -> Option<(f64, f64)> {
        let region = Region::new(self.launch()?);
        let accuracy = Accuracy { tolerance: 1e-14, max_rays: 4_000_000 };
        let numbers = |nodes: &Nodes| {
            let landed = region.trace::<ImagePoints<f64>>(nodes);
            let area = landed.arrivals().map(|(_, w)| w).sum();
            rms(landed.arrivals(), &landed.sink, nodes.mirrored).map(|rms| [rms, area])
        };
        let found = converge(&region, accuracy, numbers, |values| *values)?;
        Some((found.values[0], found.values[1]))
    }

    fn curve(
        &self,
        pupil: PupilClipping,
        method: PupilSampling,
        precision: Precision,
        exact: f64,
    ) -> Vec<SpotRow> {
        let mut rows = Vec::new();
        for step in 0..steps(method) {
            let tries = tries(method);
            let results: Vec<_> =
                (0..tries).filter_map(|t| self.time(method, precision, step, t)).collect();
            if results.is_empty() {
                continue;
            }
            let count = results.len() as f64;
            let square = |(s, _): &(SampledRms, f64)| (s.rms / exact - 1.0).powi(2);
            let error = (results.iter().map(square).sum::<f64>() / count).sqrt();
            let ms = results.iter().map(|(_, ms)| ms).sum::<f64>() / count;
            let rays = results.iter().map(|(s, _)| s.rays).sum::<usize>() / results.len();
            rows.push(SpotRow { pupil, method, precision, rays, error, ms });
        }
        rows
    }

    /// A result and the median of its times, in milliseconds.
    fn time(
        &self,
        method: PupilSampling,
        precision: Precision,
        step: usize,
        attempt: u32,
    ) -> Option<(SampledRms, f64)> {
        let sample = || self.sample(method, precision, step, attempt);
        let (result, ms) = time_median(3..=OFTEN_ENOUGH, sample);
        Some((result?, ms))
    }

    /// Computes the RMS radius by a sampling, including the search for its points.
    fn sample(
        &self,
        method: PupilSampling,
        precision: Precision,
        step: usize,
        attempt: u32,
    ) -> Option<SampledRms> {
        let launch = self.launch()?;
        let (region, nodes) = match fixed_pattern(method, step, attempt) {
            Some(pattern) => {
                let region = Region { launch, kind: RegionKind::Clear, rays: 0 };
                let nodes = region.pattern_nodes(pattern);
                (region, nodes)
            }
            None if method == PupilSampling::Gauss => {
                let region = Region { launch, kind: RegionKind::Clear, rays: 0 };
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
                let landed = region.trace::<ImagePoints<f64>>(&nodes);
                rms(landed.arrivals(), &landed.sink, nodes.mirrored)
            }
            Precision::F32 => self.trace_single(&region, &nodes),
        };
        Some(SampledRms { rms: rms?, rays })
    }

    /// Computes the RMS radius with rays traced in single precision.
    fn trace_single(&self, region: &Region<'_>, nodes: &Nodes) -> Option<f64> {
        let mut weights = Vec::with_capacity(nodes.weights.len());
        let mut rays = Rays::with_capacity(nodes.points.len());
        for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
            if let Some(ray) = region.launch.ray(*p) {
                rays.push(ray.cast());
                weights.push(*weight);
            }
        }
        let mut points = ImagePoints::default();
        self.single.trace_batch(&rays, &mut points);
        let arrived = weights.iter().copied().enumerate();
        rms(arrived.filter(|(i, _)| points.fate(*i).is_imaged()), &points, nodes.mirrored)
    }
}

/// The RMS distance from the centroid; `None` if no ray reaches the image.
fn rms<R: Real>(
    arrived: impl Iterator<Item = (usize, f64)>,
    points: &ImagePoints<R>,
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

/// The number of points of a curve.
fn steps(method: PupilSampling) -> usize {
    match method {
        PupilSampling::SquareGrid | PupilSampling::Hexapolar | PupilSampling::Random => {
            BUDGETS.len()
        }
        // The sequence repeats after 65 536 points.
        PupilSampling::LowDiscrepancy => BUDGETS.len() - 1,
        PupilSampling::Gauss => 14,
        PupilSampling::SplitBoundary => 11,
    }
}

fn tries(method: PupilSampling) -> u32 {
    match method {
        PupilSampling::Random | PupilSampling::LowDiscrepancy => TRIES,
        PupilSampling::SquareGrid => 4,
        PupilSampling::Hexapolar | PupilSampling::Gauss | PupilSampling::SplitBoundary => 1,
    }
}

/// The points of a pattern with about as many rays as a budget; `None` for samplings that depend on
/// the pupil.
fn fixed_pattern(method: PupilSampling, step: usize, attempt: u32) -> Option<PupilPattern> {
    let count = *BUDGETS.get(step)?;
    let root = (count as f64).sqrt();
    match method {
        PupilSampling::SquareGrid => {
            let cells = root * (4.0 / std::f64::consts::PI).sqrt();
            Some(PupilPattern::Square(cells.round() as usize + attempt as usize))
        }
        PupilSampling::Hexapolar => {
            Some(PupilPattern::Hexapolar((root / 3f64.sqrt()).round() as usize))
        }
        PupilSampling::Random => Some(PupilPattern::Random { count, seed: attempt + 1 }),
        PupilSampling::LowDiscrepancy => Some(PupilPattern::Sobol { count, seed: attempt + 1 }),
        PupilSampling::Gauss | PupilSampling::SplitBoundary => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::double_gauss;

    #[test]
    fn gauss_beats_every_fixed_pattern_on_a_clear_pupil() {
        let lens = double_gauss();
        let model = ray_model(&lens, 0, PupilClipping::Clear).unwrap();
        let scene = SpotScene::new(&model, FieldPoint { x: 0.0, y: 10.0, weight: 1.0 }).unwrap();
        let (exact, _) = scene.reference().unwrap();
        let error = |method, step| {
            let sampled = scene.sample(method, Precision::F64, step, 0).unwrap();
            (sampled.rms / exact - 1.0).abs()
        };
        assert!(error(PupilSampling::Gauss, 5) < 1e-9, "{}", error(PupilSampling::Gauss, 5));
        for fixed in [PupilSampling::SquareGrid, PupilSampling::Hexapolar, PupilSampling::Random] {
            assert!(error(fixed, 3) > 1e-6, "{fixed:?}");
        }
    }

    #[test]
    fn the_spot_of_weighted_points_is_their_standard_deviation() {
        let mut points = ImagePoints::<f64>::default();
        points.resize(3);
        points.x.copy_from_slice(&[1.0, 3.0, 3.0]);
        points.y.copy_from_slice(&[-1.0, 5.0, 5.0]);
        // Weights 2, 1, 1: half the light at either place, whose distance is the root of 40.
        let weighted = [(0, 2.0), (1, 1.0), (2, 1.0)];
        let found = rms(weighted.into_iter(), &points, false).unwrap();
        assert!((found - 10f64.sqrt()).abs() < 1e-12, "{found}");
        // Each point and its mirror image at -x: variance of y, and the mean of x² about 0.
        let found = rms(weighted.into_iter(), &points, true).unwrap();
        assert!((found - (9.0 + 0.5 * (1.0 + 9.0f64)).sqrt()).abs() < 1e-12, "{found}");
        assert_eq!(rms(std::iter::empty(), &points, true), None);
    }
}
