//! Error against time of derivatives of pupil integrals, for every estimator.
//!
//! The stop, with the semi-diameter that the aperture defines, and the semi-diameters of the
//! surfaces limit the light. Each derivative includes all its work on one thread: the edge of the
//! pupil is found, rays are launched, traced and traced back. The reference is the boundary
//! integral at its highest order, reported with its deviation from central differences; for a pupil
//! without such a boundary it is the warp field with very many samples.
//!
//! Single precision is measured where it exists. The edge is always found in `f64`, since it
//! decides which rays belong to the pupil; a difference of two integrals has no significant digit
//! in `f32`.

use super::spot::Precision;
use super::timing::{TimedCase, time_interleaved, time_median};
use crate::lens::{FieldPoint, Lens, Shape, Surface, System, SystemError};
use crate::math::{Real, Vec3};
use crate::pupil::{
    Accuracy, DerivativeError, DerivativeEstimator, Integrand, Launch, LaunchError,
    PupilDerivative, PupilPattern, QuadraticIntegrand, RayModel, RayModelError, Region,
    WarpSampling, choose_estimator, differentiate,
};
use crate::trace::{
    AdjointSeed, ImagePoints, Rays, SurfaceParameter, SystemGradient, TraceSink, Tracer,
};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

/// A class of parameters of a lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterClass {
    /// Curvatures.
    Curvature,
    /// Conic constants.
    Conic,
    /// Asphere coefficients; the worst of all powers.
    Asphere,
    /// Thicknesses.
    Thickness,
    /// Indices.
    Index,
    /// Semi-diameters.
    SemiDiameter,
}

impl ParameterClass {
    /// All classes, in the order of [`GradientRow::errors`].
    pub const ALL: [Self; 6] = [
        Self::Curvature,
        Self::Conic,
        Self::Asphere,
        Self::Thickness,
        Self::Index,
        Self::SemiDiameter,
    ];

    fn contains(self, slot: SurfaceParameter) -> bool {
        match self {
            Self::Curvature => slot == SurfaceParameter::Curvature,
            Self::Conic => slot == SurfaceParameter::Conic,
            Self::Asphere => matches!(slot, SurfaceParameter::AsphereTerm(_)),
            Self::Thickness => slot == SurfaceParameter::Thickness,
            Self::Index => slot == SurfaceParameter::Index,
            Self::SemiDiameter => slot == SurfaceParameter::SemiDiameter,
        }
    }

    /// The relative RMS error of the derivatives by the parameters of this class; `None` if the
    /// integral depends on none of them.
    fn error(self, found: &SystemGradient<f64>, exact: &SystemGradient<f64>) -> Option<f64> {
        let slots = SurfaceParameter::all().filter(|slot| self.contains(*slot));
        let error = |slot| {
            // Scaled by the largest, so that no square overflows.
            let largest = exact.largest(slot);
            let sum = |numbers: &mut dyn Iterator<Item = f64>| -> f64 {
                numbers.map(|v| (v / largest).powi(2)).sum()
            };
            let off = found.zip_with(exact, |a, b| a - b);
            let ratio = sum(&mut off.of_kind(slot)) / sum(&mut exact.of_kind(slot));
            (largest > 0.0).then_some(ratio.sqrt())
        };
        slots.filter_map(error).reduce(f64::max)
    }
}

/// The integral that is differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Integral {
    /// The squared distance from the centroid, integrated over the pupil.
    Spot,
    /// The area of the pupil.
    Throughput,
}

/// A point of a curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientRow {
    /// The integral that is differentiated.
    pub integral: Integral,
    /// The estimator of the derivative.
    pub estimator: DerivativeEstimator,
    /// The number type of the rays.
    pub precision: Precision,
    /// The number of rays traced, including those that find the edge.
    pub rays: usize,
    /// The time on one thread, in milliseconds.
    pub ms: f64,
    /// The relative error for each class of parameters, in the order of [`ParameterClass::ALL`];
    /// `None` if the integral depends on none of them.
    pub errors: [Option<f64>; 6],
}

impl GradientRow {
    /// The largest error of all classes.
    pub fn worst(&self) -> f64 {
        self.errors.iter().flatten().copied().fold(0.0, f64::max)
    }
}

/// The curves of one field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientCurves {
    /// The field, in the unit of the lens's fields.
    pub y: f64,
    /// The area of its pupil in the first vertex plane, relative to that on the axis.
    pub light: f64,
    /// The estimator that the effects plan selects.
    pub planned: DerivativeEstimator,
    /// The reason for that estimator.
    pub reason: String,
    /// The estimator of the reference: `Boundary`, or `Warp` if the pupil has no boundary to
    /// track.
    pub reference: DerivativeEstimator,
    /// The relative uncertainty of the reference for the two integrals: its deviation from central
    /// differences, the worst of all classes, or its standard error.
    pub checked: [f64; 2],
    /// The points of the curves.
    pub rows: Vec<GradientRow>,
}

/// The cost of all derivatives relative to that of the integral.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GradientCost {
    /// The number of surfaces, including the image plane and the inert planes added to the gaps.
    pub surfaces: usize,
    /// The number of parameters of the derivative.
    pub numbers: usize,
    /// The time of the integral, in milliseconds.
    pub integral_ms: f64,
    /// The time of the boundary integral at the same order, relative to the integral; `None` if the
    /// pupil has no boundary to track.
    pub boundary: Option<f64>,
    /// The time of central differences, relative to the integral.
    pub difference: f64,
    /// The time of the warp field, relative to the forward trace of the same number of rays.
    pub warp: f64,
    /// The same in `f32`.
    pub warp_single: f64,
}

/// The benchmark of the gradients of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientBenchmark {
    /// The curves of the axis and of another field.
    pub fields: Vec<GradientCurves>,
    /// The cost of derivatives at the last of those fields, for an increasing number of parameters.
    pub costs: Vec<GradientCost>,
}

/// The error of a gradient benchmark.
#[derive(Debug, thiserror::Error)]
pub enum GradientBenchmarkError {
    /// The ray model of the lens cannot be set up.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// No rays can be launched from the field.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The estimator has no derivative for this pupil.
    #[error(transparent)]
    Pupil(#[from] DerivativeError),
    /// The system is invalid.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// The thread pool cannot be created.
    #[error("no thread to measure with: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The order of the differences that check the reference.
const CHECKED: usize = 8;
/// The number of rays of a reference by the warp field.
const REFERENCE_RAYS: usize = 1 << 21;
/// The orders of quadrature of the curves.
const ORDERS: usize = 10;
const DIFFERENCE_ORDERS: usize = 6;
/// The numbers of samples of the warp field along its curve, and the number of tries of each.
const SAMPLES: [usize; 5] = [256, 1024, 4096, 16_384, 65_536];
const TRIES: u32 = 4;
/// The maximum number of times that a result is timed.
const OFTEN_ENOUGH: usize = 15;
/// The numbers of inert planes added to the gaps, to measure the cost of more parameters.
const PLANES: [usize; 4] = [0, 6, 12, 24];
/// The order of quadrature and the number of samples of the cost measurement.
const COST_ORDER: usize = 3;
const COST_SAMPLES: usize = 8192;
const TURNS: usize = 9;
const TURN: f64 = 2e-3; // seconds

/// Measures a lens at a zoom position, on the axis and at a field, by default the most vignetted
/// one of the lens. `report` receives the numbers of finished and of all curves; the fields that are
/// complete are returned once it breaks.
///
/// # Errors
/// A lens, field or pupil without light.
pub fn measure_gradients(
    lens: &Lens,
    zoom: usize,
    field: Option<f64>,
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<GradientBenchmark, GradientBenchmarkError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let limited = RayModel::from_lens(lens, zoom)?.limited_by_stop()?;
    let model = with_primary_system(&limited, |system| system)?;
    let field = field.unwrap_or_else(|| most_vignetted(&model, lens, zoom));
    let axis = area(&model, 0.0).unwrap_or(f64::NAN);
    let heights = if field == 0.0 { vec![0.0] } else { vec![0.0, field] };
    let all = heights.len() * (2 * METHODS.len() + 1);
    let mut done = 0;
    let mut fields = Vec::new();
    let scene_at = |y| GradientScene::new(&model, &pool, y);
    // A field without light is refused before the others take their time.
    let scenes: Vec<GradientScene<'_>> =
        heights.into_iter().map(scene_at).collect::<Result<_, _>>()?;
    for scene in scenes {
        let exact = scene.reference()?;
        let mut rows = Vec::new();
        for integral in [Integral::Spot, Integral::Throughput] {
            for method in METHODS {
                rows.extend(scene.curve(integral, exact.gradient(integral), method));
                done += 1;
                if report(done, all).is_break() {
                    return Ok(GradientBenchmark { costs: Vec::new(), fields });
                }
            }
        }
        fields.push(scene.curves(&exact, axis, rows)?);
    }
    let mut costs = Vec::new();
    for planes in PLANES {
        let model = with_primary_system(&model, |system| with_planes(system, planes))?;
        let scene = GradientScene::new(&model, &pool, field)?;
        costs.push(pool.install(|| scene.cost())?);
        done += 1;
        if report(done.min(all), all).is_break() {
            break;
        }
    }
    Ok(GradientBenchmark { fields, costs })
}

/// Every estimator in every precision that it supports.
const METHODS: [(DerivativeEstimator, Precision); 6] = [
    (DerivativeEstimator::Biased, Precision::F64),
    (DerivativeEstimator::Biased, Precision::F32),
    (DerivativeEstimator::Boundary, Precision::F64),
    (DerivativeEstimator::Warp, Precision::F64),
    (DerivativeEstimator::Warp, Precision::F32),
    (DerivativeEstimator::Difference, Precision::F64),
];

/// A field at a height, in the unit of the lens's fields.
fn at(y: f64) -> FieldPoint {
    FieldPoint { x: 0.0, y, weight: 1.0 }
}

/// The model at its primary wavelength alone, with a changed system.
fn with_primary_system(
    model: &RayModel,
    change: impl FnOnce(System<f64>) -> System<f64>,
) -> Result<RayModel, RayModelError> {
    let channel = &model.channels[model.primary];
    let systems = vec![(channel.um, 1.0, change(channel.system.clone()))];
    RayModel::from_systems(systems, 0, model.beam, model.aiming)
}

/// The field of the lens with the least light above zero; the last one if all are dark.
fn most_vignetted(model: &RayModel, lens: &Lens, zoom: usize) -> f64 {
    let mut heights = lens.fields_at(zoom).values.iter().map(|field| field.y);
    let lit = heights.clone().filter_map(|y| Some((y, area(model, y)?)));
    let least = lit.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(y, _)| y);
    least.or(heights.next_back()).unwrap_or(0.0)
}

fn area(model: &RayModel, y: f64) -> Option<f64> {
    let region = Region::new(model.launch(at(y), 0).ok()?);
    let light = region.trace_pupil(2);
    light.has_light().then_some(light.moments.area)
}

/// The lens with inert planes inserted into its gaps, one gap after the other.
fn with_planes(mut system: System<f64>, planes: usize) -> System<f64> {
    let mut at = 0;
    for _ in 0..planes {
        // Light is reversed behind a mirror: those gaps stay as they are.
        let open = |i: &usize| {
            let row = &system.surfaces[*i];
            row.thickness > 0.0 && !row.mirror
        };
        let last = system.surfaces.len() - 1;
        let Some(gap) = (at..last).chain(0..at.min(last)).find(open) else { break };
        let before = &mut system.surfaces[gap];
        before.thickness *= 0.5;
        let plane = Surface { shape: Shape::Plane, semi_diameter: f64::INFINITY, ..before.clone() };
        system.surfaces.insert(gap + 1, plane);
        system.stop = system.stop.map(|stop| if stop > gap { stop + 1 } else { stop });
        at = gap + 2;
    }
    system
}

/// The number of parameters of the derivative.
fn numbers(system: &System<f64>) -> usize {
    let of = |surface: &Surface<f64>| {
        let has = |slot: &SurfaceParameter| {
            slot.exists_on(surface)
                && (*slot != SurfaceParameter::SemiDiameter || surface.semi_diameter.is_finite())
        };
        SurfaceParameter::all().filter(has).count()
    };
    1 + system.surfaces.iter().map(of).sum::<usize>()
}

/// A derivative and the number of rays traced for it.
type DerivativeWithRays = (SystemGradient<f64>, usize);

/// Reference derivatives of both integrals.
struct ReferenceGradients {
    spot: SystemGradient<f64>,
    throughput: SystemGradient<f64>,
    by: DerivativeEstimator,
    checked: [f64; 2],
}

impl ReferenceGradients {
    fn gradient(&self, integral: Integral) -> &SystemGradient<f64> {
        match integral {
            Integral::Spot => &self.spot,
            Integral::Throughput => &self.throughput,
        }
    }
}

/// A field of a lens with its ray model.
struct GradientScene<'a> {
    model: &'a RayModel,
    pool: &'a ThreadPool,
    single: Tracer<f32>,
    y: f64,
    /// The integrand of the spot about its centroid.
    spot: QuadraticIntegrand,
}

impl<'a> GradientScene<'a> {
    fn new(
        model: &'a RayModel,
        pool: &'a ThreadPool,
        y: f64,
    ) -> Result<Self, GradientBenchmarkError> {
        let region = Region::new(model.launch(at(y), 0)?);
        choose_estimator(&region, Accuracy::default())?;
        let spot = QuadraticIntegrand::spread(
            region.trace_pupil(CHECKED.min(region.orders() - 1)).moments.centroid,
        );
        let single = Tracer::new(&model.channels[0].system.cast())?;
        Ok(Self { model, pool, single, y, spot })
    }

    fn integrand(&self, integral: Integral) -> QuadraticIntegrand {
        match integral {
            Integral::Spot => self.spot,
            Integral::Throughput => QuadraticIntegrand::throughput(),
        }
    }

    fn reference(&self) -> Result<ReferenceGradients, GradientBenchmarkError> {
        let region = Region::new(self.model.launch(at(self.y), 0)?);
        let (by, _) = choose_estimator(&region, Accuracy::default())?;
        let asked = Accuracy { tolerance: f64::EPSILON, max_rays: REFERENCE_RAYS };
        let found = |cost| differentiate(&region, &cost, by, asked);
        let [spot, throughput] = [found(self.spot)?, found(QuadraticIntegrand::throughput())?];
        let check = |cost, found: &PupilDerivative| {
            let other = match by {
                DerivativeEstimator::Warp => {
                    Some(found.gradient.zip_with(&found.error, |by, error| by + error))
                }
                _ => region.difference_derivative(&cost, CHECKED).map(|found| found.gradient),
            };
            other.map_or(f64::INFINITY, |other| worst_error(&other, &found.gradient))
        };
        let checked =
            [check(self.spot, &spot), check(QuadraticIntegrand::throughput(), &throughput)];
        Ok(ReferenceGradients { spot: spot.gradient, throughput: throughput.gradient, by, checked })
    }

    fn curves(
        &self,
        exact: &ReferenceGradients,
        axis: f64,
        rows: Vec<GradientRow>,
    ) -> Result<GradientCurves, GradientBenchmarkError> {
        let region = Region::new(self.model.launch(at(self.y), 0)?);
        let (planned, reason) = choose_estimator(&region, Accuracy::default())?;
        let light = region.trace_pupil(4).moments.area / axis;
        let ReferenceGradients { by: reference, checked, .. } = *exact;
        Ok(GradientCurves { y: self.y, light, planned, reason, reference, checked, rows })
    }

    fn launch(&self) -> Option<Launch<'a>> {
        self.model.launch(at(self.y), 0).ok()
    }

    fn curve(
        &self,
        integral: Integral,
        exact: &SystemGradient<f64>,
        (estimator, precision): (DerivativeEstimator, Precision),
    ) -> Vec<GradientRow> {
        let cost = self.integrand(integral);
        let (steps, tries) = match estimator {
            DerivativeEstimator::Biased | DerivativeEstimator::Boundary => (ORDERS, 1),
            DerivativeEstimator::Warp => (SAMPLES.len(), TRIES),
            DerivativeEstimator::Difference => (DIFFERENCE_ORDERS, 1),
        };
        let row = |step| {
            let method = (estimator, precision);
            let one = |seed| self.time(|| self.derivative(&cost, method, step, seed));
            let found: Vec<(DerivativeWithRays, f64)> = (0..tries).filter_map(one).collect();
            let count = found.len() as f64;
            let errors = ParameterClass::ALL.map(|numbers| {
                let each = found.iter().map(|((by, _), _)| numbers.error(by, exact));
                let squares: Option<Vec<f64>> = each.map(|e| Some(e?.powi(2))).collect();
                squares.map(|squares| (squares.iter().sum::<f64>() / count).sqrt())
            });
            let rays = found.iter().map(|((_, rays), _)| rays).sum::<usize>() / found.len().max(1);
            let ms = found.iter().map(|(_, ms)| ms).sum::<f64>() / count;
            let row = GradientRow { integral, estimator, precision, rays, ms, errors };
            (!found.is_empty()).then_some(row)
        };
        (0..steps).filter_map(row).collect()
    }

    /// The result of `work` and the median of its times on one thread, in milliseconds.
    fn time(
        &self,
        work: impl Fn() -> Option<DerivativeWithRays> + Sync,
    ) -> Option<(DerivativeWithRays, f64)> {
        let (result, ms) = self.pool.install(|| time_median(1..=OFTEN_ENOUGH, &work));
        Some((result?, ms))
    }

    /// Computes a derivative, including the search for the edge of the pupil.
    fn derivative(
        &self,
        cost: &QuadraticIntegrand,
        method: (DerivativeEstimator, Precision),
        step: usize,
        seed: u32,
    ) -> Option<DerivativeWithRays> {
        let region = Region::new(self.launch()?);
        let orders = region.orders();
        match method {
            (DerivativeEstimator::Warp, precision) => {
                let sampling = WarpSampling { count: SAMPLES[step], seed };
                let found = match precision {
                    Precision::F64 => region.warp_derivative(cost, sampling),
                    Precision::F32 => region.warp_derivative_in::<f32>(cost, sampling),
                }?;
                Some((found.gradient, found.rays))
            }
            _ if step >= orders => None,
            (DerivativeEstimator::Difference, _) => {
                let found = region.difference_derivative(cost, step)?;
                Some((found.gradient, found.rays))
            }
            (DerivativeEstimator::Biased, Precision::F32) => {
                self.biased_in_single_precision(&region, cost, step)
            }
            (estimator, _) => {
                let lit = region.trace_pupil(step);
                let by = match estimator {
                    DerivativeEstimator::Boundary => lit.boundary_derivative(cost)?,
                    _ => lit.biased_derivative(cost),
                };
                Some((by, region.rays + lit.rays_traced))
            }
        }
    }

    /// The biased derivative with rays in single precision.
    fn biased_in_single_precision(
        &self,
        region: &Region<'_>,
        cost: &QuadraticIntegrand,
        order: usize,
    ) -> Option<DerivativeWithRays> {
        let nodes = region.nodes(order);
        let scale = region.launch.area();
        let mut weights = Vec::with_capacity(nodes.points.len());
        let mut rays = Rays::<f32>::with_capacity(nodes.points.len());
        for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
            rays.push(region.launch.ray(*p)?.cast());
            weights.push(scale * weight);
        }
        let mut points = ImagePoints::default();
        self.single.trace_batch(&rays, &mut points);
        let seed = |i: usize| {
            let slope = cost.slope([points.x[i].value(), points.y[i].value()]);
            let [x, y] = slope.map(|v| f32::from_f64(weights[i] * v));
            let arrived = points.fate(i).is_imaged();
            let point = if arrived { Vec3::new(x, y, 0.0) } else { Vec3::default() };
            AdjointSeed { point, ..AdjointSeed::default() }
        };
        let by = self.single.gradient(&rays, seed);
        let by = SystemGradient::from_numbers(by.surfaces.len(), by.numbers().map(Real::value));
        Some((by, region.rays + nodes.rays + rays.len()))
    }

    /// The cost of derivatives relative to integrals, each by its fastest repetition.
    fn cost(&self) -> Result<GradientCost, GradientBenchmarkError> {
        let region = Region::new(self.model.launch(at(self.y), 0)?);
        let spot = self.spot;
        let nodes = region.pattern_nodes(PupilPattern::Random { count: COST_SAMPLES, seed: 1 });
        let rays: Rays<f64> = nodes.points.iter().filter_map(|p| region.launch.ray(*p)).collect();
        let tracer = &self.model.channels[0].tracer;
        let sampling = WarpSampling { count: COST_SAMPLES, seed: 1 };
        let new_region = || self.launch().map(Region::new);
        let along = |differentiated: bool| {
            let region = new_region()?;
            let lit = region.trace_pupil(COST_ORDER);
            if differentiated {
                lit.boundary_derivative(&spot)
            } else {
                Some(SystemGradient::zero(0))
            }
        };
        let mut points = ImagePoints::default();
        let mut turns: Vec<Box<dyn FnMut() + '_>> = vec![
            Box::new(|| drop(black_box(along(false)))),
            Box::new(|| drop(black_box(along(true)))),
            Box::new(|| {
                drop(black_box(new_region().map(|r| r.difference_derivative(&spot, COST_ORDER))));
            }),
            Box::new(|| tracer.trace_batch(&rays, &mut points)),
            Box::new(|| drop(black_box(region.warp_derivative(&spot, sampling)))),
            Box::new(|| drop(black_box(region.warp_derivative_in::<f32>(&spot, sampling)))),
        ];
        let mut cases: Vec<TimedCase<'_>> = turns
            .iter_mut()
            .map(|turn| TimedCase { work: 1.0, repetition: Box::new(turn) })
            .collect();
        let (rates, _) = time_interleaved(&mut cases, TURNS, TURN, &AtomicBool::new(false));
        drop(cases);
        drop(turns);
        // The fastest repetitions: slower ones were disturbed by other processes.
        let seconds: Vec<f64> = rates.iter().map(|rate| 1.0 / rate.max).collect();
        let has_edge = region.trace_pupil(0).boundary_derivative(&spot).is_some();
        let system = &self.model.channels[0].system;
        Ok(GradientCost {
            surfaces: system.surfaces.len(),
            numbers: numbers(system),
            integral_ms: 1e3 * seconds[0],
            boundary: has_edge.then_some(seconds[1] / seconds[0]),
            difference: seconds[2] / seconds[0],
            warp: seconds[4] / seconds[3],
            warp_single: seconds[5] / seconds[3],
        })
    }
}

/// The worst error of all classes of parameters.
fn worst_error(found: &SystemGradient<f64>, exact: &SystemGradient<f64>) -> f64 {
    let errors = ParameterClass::ALL.into_iter().filter_map(|numbers| numbers.error(found, exact));
    errors.fold(0.0, f64::max)
}
