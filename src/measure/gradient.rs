//! Error of aperture-aware derivatives against the time that they take, for every estimator.
//!
//! The stop limits the light, with the radius that the aperture gives it, and the semi-diameters
//! clip. Each derivative starts from nothing: the edge is looked for, rays are started, traced and
//! traced back, on one thread. The reference is the integral along the edge at its highest order,
//! and how far central differences are from it is told; a pupil without such an edge is measured
//! against the warp field with very many samples.
//!
//! Single precision is measured where it exists. An edge is found to the rounding of `f64`, since
//! what ends a pupil is decided there; a difference of two integrals has no digit left in `f32`.

use super::clock::time_ms;
use super::rates::{TimedCase, time_interleaved};
use super::spot::Precision;
use crate::lens::{FieldPoint, Lens, Shape, Surface, System, SystemError};
use crate::math::{Real, Vec3};
use crate::pupil::{
    Accuracy, DerivativeError, DerivativeEstimator, Integrand, Launch, LaunchError,
    PupilDerivative, PupilPattern, QuadraticIntegrand, RayModel, RayModelError, Region,
    WarpSampling, choose_estimator, differentiate,
};
use crate::trace::{
    AdjointSeed, ImagePoints, Ray, Rays, SurfaceParameter, SystemGradient, TraceSink, Tracer,
};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use std::hint::black_box;

/// The numbers of a lens of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterClass {
    /// Curvatures.
    Curvature,
    /// Conic constants.
    Conic,
    /// Asphere coefficients; the worst of the powers.
    Asphere,
    /// Thicknesses.
    Thickness,
    /// Indices.
    Index,
    /// Semi-diameters.
    SemiDiameter,
}

impl ParameterClass {
    /// All kinds.
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

    /// The relative error of the numbers of this kind, in the root mean square; `None` where the
    /// integral depends on none of them.
    fn error(self, found: &SystemGradient<f64>, exact: &SystemGradient<f64>) -> Option<f64> {
        let slots = SurfaceParameter::all().filter(|slot| self.contains(*slot));
        let error = |slot| {
            // Against the largest, so that no square leaves the numbers.
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

/// What is differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Integral {
    /// The square of the distance from the centroid, over the light.
    Spot,
    /// The light.
    Throughput,
}

/// One point of the curves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientRow {
    /// What is differentiated.
    pub integral: Integral,
    /// How.
    pub estimator: DerivativeEstimator,
    /// The number type of the rays.
    pub precision: Precision,
    /// Rays traced, those included that only looked for the edge.
    pub rays: usize,
    /// What it took, on one thread.
    pub ms: f64,
    /// The relative error of each kind of numbers, in the order of [`ParameterClass::ALL`]; `None` where
    /// the integral depends on none of them.
    pub errors: [Option<f64>; 6],
}

impl GradientRow {
    /// The largest error of all kinds.
    pub fn worst(&self) -> f64 {
        self.errors.iter().flatten().copied().fold(0.0, f64::max)
    }
}

/// The curves of one field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientCurves {
    /// The field, in the unit of the lens's fields.
    pub y: f64,
    /// Its light against that of the axis, in area of the first vertex plane.
    pub light: f64,
    /// The estimator that the plan chooses, and why.
    pub planned: DerivativeEstimator,
    /// Why.
    pub reason: String,
    /// By what the reference was made: `Boundary`, or `WarpSampling` where the pupil has no edge to follow.
    pub reference: DerivativeEstimator,
    /// How far the reference may be wrong, for the two integrals: its difference from central
    /// differences, the worst of all kinds of numbers, or its standard error.
    pub checked: [f64; 2],
    /// The curves.
    pub rows: Vec<GradientRow>,
}

/// The price of one derivative against that of the integral.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GradientCost {
    /// Surfaces, the image plane included: planes without an effect were put into the gaps.
    pub surfaces: usize,
    /// Numbers by which is differentiated.
    pub numbers: usize,
    /// The integral, ms.
    pub integral_ms: f64,
    /// The derivative along the edge at the same order, in times of the integral; `None` where the
    /// pupil has no edge to follow.
    pub boundary: Option<f64>,
    /// Central differences, likewise.
    pub difference: f64,
    /// The warp field, in times of the forward trace of the same number of rays.
    pub warp: f64,
    /// The same in `f32`.
    pub warp_single: f64,
}

/// What is measured of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GradientBenchmark {
    /// The curves of the axis and of another field.
    pub fields: Vec<GradientCurves>,
    /// What derivatives cost at the last of those fields, for more and more numbers.
    pub costs: Vec<GradientCost>,
}

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum GradientBenchmarkError {
    /// The lens.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// The field.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The pupil.
    #[error(transparent)]
    Pupil(#[from] DerivativeError),
    /// The numbers of the lens.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// No thread.
    #[error("no thread to measure with: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The order of the differences that check the reference.
const CHECKED: usize = 8;
/// Rays of the reference.
const REFERENCE_RAYS: usize = 1 << 21;
/// Orders of the curves.
const ORDERS: usize = 10;
const DIFFERENCE_ORDERS: usize = 6;
/// Samples of the warp field along its curves, and how often each is tried.
const SAMPLES: [usize; 5] = [256, 1024, 4096, 16_384, 65_536];
const TRIES: u32 = 4;
/// A result is timed until it has taken so long, in ms, or so often.
const LONG_ENOUGH: f64 = 5.0;
const OFTEN_ENOUGH: usize = 15;
/// Planes that are put into the gaps to see what more numbers cost.
const PLANES: [usize; 4] = [0, 6, 12, 24];
/// Order and samples of the costs.
const COST_ORDER: usize = 3;
const COST_SAMPLES: usize = 8192;
const TURNS: usize = 9;
const TURN: f64 = 2e-3; // seconds

/// Measures a lens at a zoom position, on the axis and at a field, or at the most vignetted one of
/// its fields where none is given; `report` is told how many of how many curves are done.
///
/// # Errors
/// A lens, field or pupil without light.
pub fn measure_gradients(
    lens: &Lens,
    zoom: usize,
    field: Option<f64>,
    mut report: impl FnMut(usize, usize),
) -> Result<GradientBenchmark, GradientBenchmarkError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let limited = RayModel::from_lens(lens, zoom)?.limited_by_stop()?;
    let bench = with_primary_system(&limited, |system| system)?;
    let field = field.unwrap_or_else(|| most_vignetted(&bench, lens, zoom));
    let axis = area(&bench, 0.0).unwrap_or(f64::NAN);
    let heights = if field == 0.0 { vec![0.0] } else { vec![0.0, field] };
    let all = heights.len() * (2 * METHODS.len() + 1);
    let mut done = 0;
    let mut fields = Vec::new();
    for y in heights {
        let scene = GradientScene::new(&bench, &pool, y)?;
        let exact = scene.reference()?;
        let mut rows = Vec::new();
        for integral in [Integral::Spot, Integral::Throughput] {
            for method in METHODS {
                rows.extend(scene.curve(integral, exact.gradient(integral), method));
                done += 1;
                report(done, all);
            }
        }
        fields.push(scene.curves(&exact, axis, rows)?);
    }
    let costs = PLANES.into_iter().map(|planes| {
        let bench = with_primary_system(&bench, |system| with_planes(system, planes))?;
        let scene = GradientScene::new(&bench, &pool, field)?;
        let cost = pool.install(|| scene.cost());
        done += 1;
        report(done.min(all), all);
        cost
    });
    Ok(GradientBenchmark { costs: costs.collect::<Result<_, GradientBenchmarkError>>()?, fields })
}

/// Every estimator in every precision that it has.
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

/// The field of the lens with the least light that has some.
fn most_vignetted(bench: &RayModel, lens: &Lens, zoom: usize) -> f64 {
    let heights = lens.fields_at(zoom).values.iter().map(|field| field.y);
    let lit = heights.filter_map(|y| Some((y, area(bench, y)?)));
    lit.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(y, _)| y)
}

fn area(bench: &RayModel, y: f64) -> Option<f64> {
    let region = Region::new(bench.launch(at(y), 0).ok()?);
    let light = region.trace_pupil(2);
    light.has_light().then_some(light.moments.area)
}

/// The same lens with planes that change nothing in its gaps, one gap after the other.
fn with_planes(mut system: System<f64>, planes: usize) -> System<f64> {
    let mut at = 0;
    for _ in 0..planes {
        // Behind a mirror light runs the other way: those gaps stay.
        let open = |i: &usize| {
            let row = &system.surfaces[*i];
            row.thickness > 0.0 && !row.mirror
        };
        let last = system.surfaces.len() - 1;
        let Some(gap) = (at..last).chain(0..at.min(last)).find(open) else { break };
        let before = &mut system.surfaces[gap];
        before.thickness *= 0.5;
        let plane = Surface { shape: Shape::Plane, semi_diameter: f64::INFINITY, ..*before };
        system.surfaces.insert(gap + 1, plane);
        system.stop = system.stop.map(|stop| if stop > gap { stop + 1 } else { stop });
        at = gap + 2;
    }
    system
}

/// The numbers by which is differentiated.
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

/// A derivative and the rays that it took.
type DerivativeWithRays = (SystemGradient<f64>, usize);

/// The derivatives of both integrals, as well as they can be known.
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

/// A field of a lens.
struct GradientScene<'a> {
    bench: &'a RayModel,
    pool: &'a ThreadPool,
    single: Tracer<f32>,
    y: f64,
    /// The spot about its centroid.
    spot: QuadraticIntegrand,
}

impl<'a> GradientScene<'a> {
    fn new(
        bench: &'a RayModel,
        pool: &'a ThreadPool,
        y: f64,
    ) -> Result<Self, GradientBenchmarkError> {
        let region = Region::new(bench.launch(at(y), 0)?);
        choose_estimator(&region, Accuracy::default())?;
        let spot = QuadraticIntegrand::spread(
            region.trace_pupil(CHECKED.min(region.orders() - 1)).moments.centroid,
        );
        let single = Tracer::new(&bench.channels[0].system.cast())?;
        Ok(Self { bench, pool, single, y, spot })
    }

    fn integrand(&self, integral: Integral) -> QuadraticIntegrand {
        match integral {
            Integral::Spot => self.spot,
            Integral::Throughput => QuadraticIntegrand::throughput(),
        }
    }

    fn reference(&self) -> Result<ReferenceGradients, GradientBenchmarkError> {
        let region = Region::new(self.bench.launch(at(self.y), 0)?);
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
        let region = Region::new(self.bench.launch(at(self.y), 0)?);
        let (planned, reason) = choose_estimator(&region, Accuracy::default())?;
        let light = region.trace_pupil(4).moments.area / axis;
        let ReferenceGradients { by: reference, checked, .. } = *exact;
        Ok(GradientCurves { y: self.y, light, planned, reason, reference, checked, rows })
    }

    fn launch(&self) -> Option<Launch<'a>> {
        self.bench.launch(at(self.y), 0).ok()
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

    /// One result, and the median of the times that it took on one thread.
    fn time(
        &self,
        work: impl Fn() -> Option<DerivativeWithRays> + Sync,
    ) -> Option<(DerivativeWithRays, f64)> {
        self.pool.install(|| {
            let (result, first) = time_ms(&work);
            let mut times = vec![first];
            while times.len() < OFTEN_ENOUGH && times.iter().sum::<f64>() < LONG_ENOUGH {
                times.push(time_ms(|| black_box(work())).1);
            }
            times.sort_by(f64::total_cmp);
            Some((result?, times[times.len() / 2]))
        })
    }

    /// A derivative from nothing.
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
            let Ray { point, direction } = region.launch.ray(*p)?;
            rays.push(Ray { point: Vec3::from_f64(point), direction: Vec3::from_f64(direction) });
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

    /// What derivatives cost against integrals, each at its fastest.
    fn cost(&self) -> Result<GradientCost, GradientBenchmarkError> {
        let region = Region::new(self.bench.launch(at(self.y), 0)?);
        let spot = self.spot;
        let nodes = region.pattern_nodes(PupilPattern::Random { count: COST_SAMPLES, seed: 1 });
        let rays: Rays<f64> = nodes.points.iter().filter_map(|p| region.launch.ray(*p)).collect();
        let tracer = &self.bench.channels[0].tracer;
        let sampling = WarpSampling { count: COST_SAMPLES, seed: 1 };
        let fresh = || self.launch().map(Region::new);
        let along = |differentiated: bool| {
            let region = fresh()?;
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
                drop(black_box(fresh().map(|r| r.difference_derivative(&spot, COST_ORDER))));
            }),
            Box::new(|| tracer.trace_batch(&rays, &mut points)),
            Box::new(|| drop(black_box(region.warp_derivative(&spot, sampling)))),
            Box::new(|| drop(black_box(region.warp_derivative_in::<f32>(&spot, sampling)))),
        ];
        let mut contestants: Vec<TimedCase<'_>> = turns
            .iter_mut()
            .map(|turn| TimedCase { work: 1.0, repetition: Box::new(turn) })
            .collect();
        let rates = time_interleaved(&mut contestants, TURNS, TURN);
        drop(contestants);
        drop(turns);
        // The fastest turns: slower ones had company.
        let seconds: Vec<f64> = rates.iter().map(|rate| 1.0 / rate.max).collect();
        let has_edge = region.trace_pupil(0).boundary_derivative(&spot).is_some();
        let system = &self.bench.channels[0].system;
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

/// The worst error of all kinds of numbers.
fn worst_error(found: &SystemGradient<f64>, exact: &SystemGradient<f64>) -> f64 {
    let errors = ParameterClass::ALL.into_iter().filter_map(|numbers| numbers.error(found, exact));
    errors.fold(0.0, f64::max)
}
