//! The derivative of an integral over a pupil from rays inside it, without a search for the edge.
//!
//! A field V that moves every ray as its nearest edge moves turns the integral along the edge into
//! one over the pupil (Teh, *Computational Lens Design*, section 3.4; Bangaru, Li and Durand, ACM
//! Trans. Graph. 39(6), 2020). With the limits `g` of all surfaces, negative inside,
//!
//! ```text
//! dL/dt = ∫ dC/dt − div(C V) dw   V = Σ a ∂g/∂t   a = ŵ ∇g / (|∇g|² + λ²g²)        (3.21, 3.23)
//! ŵ = w / Σ w   w = |g|^−p
//! ```
//!
//! where ∂/∂t is the total derivative at a fixed ray. Near an edge its own limit has all of the
//! weight. V depends on the numbers t of the lens through ∂g/∂t alone, so that with `A = ∇C·a + C
//! div a` and `B = C a` held fixed the integrand is the derivative of one number for each ray,
//!
//! ```text
//! F = C − Σ (A g + B·∇g)
//! ```
//!
//! by all of them at once: second derivatives along each ray forwards, one adjoint backwards, and a
//! cost that does not depend on the number of numbers of the lens.
//!
//! If the beam ends at the disc of the pupil coordinates, the disc takes its share of the weights
//! but does not move: the rays are held fixed, and the entrance pupil with them. Rays that are
//! aimed at the stop end at the rim of the stop instead, which moves.

use super::{Integrand, PupilDerivative};
use crate::math::{Jet, Real};
use crate::pupil::Aiming;
use crate::pupil::launch::Launch;
use crate::pupil::patterns::{SplitMix, additive_sequence};
use crate::pupil::region::{PolarFrame, Region, RegionKind};
use crate::trace::{
    ImagePoints, JetBlock, LANES, Ray, Rays, SystemGradient, TraceSink, WarpTracer,
};
use rayon::prelude::*;

/// The sampling of a pupil by the warp field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WarpSampling {
    /// The number of points of the square around the pupil from which rays start; a few more if it
    /// does not divide into equal replicates.
    pub count: usize,
    /// The seed of the random shifts of the points.
    pub seed: u32,
}

impl Default for WarpSampling {
    fn default() -> Self {
        Self { count: 4096, seed: 0 }
    }
}

/// The number of independent random shifts of the same points: their differences give the error.
const REPLICATES: usize = 8;
/// The number of points of one task.
const CHUNK: usize = 4096;
/// λ relative to half the extent of the pupil: it keeps the field finite where a limit is flat.
const FLATNESS: f64 = 2.0;
/// The smallest distance of a limit.
const CLOSEST: f64 = 1e-30;
/// The size of the square relative to the pupil.
const MARGIN: f64 = 1.04;
/// Light beyond this part of the square shows that the pupil may reach outside.
const OUTERMOST: f64 = 0.98;
/// The factor between the sizes of squares, and the largest number that is tried.
const GROWTH: f64 = 1.25;
const SQUARES: usize = 24;

impl Region<'_> {
    /// The derivative of an integral over this pupil, estimated by the warp field with its standard
    /// error; `None` if nothing gets through or nothing limits the beam.
    pub fn warp_derivative(
        &self,
        cost: &impl Integrand,
        sampling: WarpSampling,
    ) -> Option<PupilDerivative> {
        self.warp_derivative_in::<f64>(cost, sampling)
    }

    /// The same with rays in another precision.
    pub fn warp_derivative_in<R: Real>(
        &self,
        cost: &impl Integrand,
        sampling: WarpSampling,
    ) -> Option<PupilDerivative> {
        let model = self.launch.model;
        if model.aiming == Aiming::Stop {
            let model = model.limited_by_stop().ok()?;
            let launch = model.launch(self.launch.field, self.launch.wavelength).ok()?;
            return Region::new(launch).warp_derivative_in::<R>(cost, sampling);
        }
        let mut square = self.enclosing_frame()?;
        let mut rays = self.rays;
        let estimator = WarpEstimator::<R, _>::new(&self.launch, cost)?;
        for _ in 0..SQUARES {
            let found = estimator.replicates(square, sampling);
            rays += sampling.points_per_replicate() * REPLICATES;
            if let Some(replicates) = found {
                return Some(derivative(&replicates, rays));
            }
            square.axes = square.axes.map(|axis| axis.map(|v| GROWTH * v));
        }
        None
    }

    /// A frame whose square from −1 to 1 holds all of the pupil with a margin.
    fn enclosing_frame(&self) -> Option<PolarFrame> {
        let frame = match &self.kind {
            RegionKind::Clear => PolarFrame::UNIT,
            RegionKind::StarShaped(boundary) => {
                boundary.enclosing_square(self.launch.is_symmetric())
            }
            RegionKind::Irregular { square: (center, half), .. } => {
                PolarFrame { center: *center, axes: [[*half, 0.0], [0.0, *half]] }
            }
            RegionKind::Dark | RegionKind::Unbounded => return None,
        };
        Some(PolarFrame { axes: frame.axes.map(|axis| axis.map(|v| MARGIN * v)), ..frame })
    }
}

impl WarpSampling {
    /// The number of points of a replicate.
    fn points_per_replicate(self) -> usize {
        self.count.div_ceil(REPLICATES).max(1)
    }
}

/// The mean of the replicates and its standard error.
fn derivative(replicates: &[SystemGradient<f64>], rays: usize) -> PupilDerivative {
    let count = replicates.len() as f64;
    let mean = |values: &[f64]| values.iter().map(|v| v / count).sum::<f64>();
    let error = |values: &[f64]| {
        let mean = mean(values);
        // Relative to the largest, so that squares do not overflow.
        let largest = values.iter().map(|v| (v - mean).abs()).fold(0.0, f64::max);
        let square = |v: &f64| if largest > 0.0 { ((v - mean) / largest).powi(2) } else { 0.0 };
        largest * (values.iter().map(square).sum::<f64>() / (count * (count - 1.0))).sqrt()
    };
    let of = |what: &dyn Fn(&[f64]) -> f64| {
        SystemGradient::combine(replicates, |values| what(&values.collect::<Vec<_>>()))
    };
    PupilDerivative { gradient: of(&mean), error: of(&error), rays, reached: false }
}

/// A pupil and an integrand, ready for sampling.
struct WarpEstimator<'a, R, C> {
    launch: &'a Launch<'a>,
    cost: &'a C,
    plain_tracer: crate::trace::Tracer<R>,
    tracer: WarpTracer<R>,
}

impl<'a, R: Real, C: Integrand> WarpEstimator<'a, R, C> {
    fn new(launch: &'a Launch<'a>, cost: &'a C) -> Option<Self> {
        let system = &launch.channel().system;
        let scout = crate::trace::Tracer::new(&system.cast()).ok()?;
        Some(Self { launch, cost, plain_tracer: scout, tracer: WarpTracer::new(system).ok()? })
    }

    /// The estimates of independent replicates; `None` if light is found so close to the edge of
    /// the square that there may be more outside.
    fn replicates(
        &self,
        square: PolarFrame,
        sampling: WarpSampling,
    ) -> Option<Vec<SystemGradient<f64>>> {
        let mirrored = self.launch.is_symmetric();
        let each = sampling.points_per_replicate();
        let mut random = SplitMix(u64::from(sampling.seed));
        let shifts: Vec<[f64; 2]> =
            (0..REPLICATES).map(|_| [random.uniform(), random.uniform()]).collect();
        let tasks: Vec<(usize, usize)> = (0..REPLICATES)
            .flat_map(|replicate| (0..each).step_by(CHUNK).map(move |from| (replicate, from)))
            .collect();
        let parts: Option<Vec<SystemGradient<f64>>> = tasks
            .par_iter()
            .map(|(replicate, from)| {
                let point = |i: usize| {
                    let [u, v] = additive_sequence(shifts[*replicate], i);
                    [if mirrored { u } else { 2.0 * u - 1.0 }, 2.0 * v - 1.0]
                };
                self.partial_sum(square, (*from..each.min(from + CHUNK)).map(point))
            })
            .collect();
        let share = 4.0 * square.area() / each as f64;
        let mut sums = vec![SystemGradient::zero(self.tracer.surfaces()); REPLICATES];
        for ((replicate, _), part) in tasks.iter().zip(parts?) {
            sums[*replicate].add(&part, share * self.launch.area());
        }
        Some(sums)
    }

    /// The sum of the integrand over some points of the square.
    fn partial_sum(
        &self,
        square: PolarFrame,
        points: impl Iterator<Item = [f64; 2]>,
    ) -> Option<SystemGradient<f64>> {
        let lit = self.lit_points(square, points)?;
        let disc = self.launch.model.ends_at_disc().then_some(square);
        let sum = self.tracer.gradient(
            &lit,
            #[inline(always)]
            |[u, v]| self.ray(square, [Jet::variable(u, 0), Jet::variable(v, 1)]),
            #[inline(always)]
            |points, block| weigh_limits(block, self.cost, disc, points),
        );
        Some(SystemGradient::combine(&[sum], |numbers| numbers.map(Real::value).sum()))
    }

    /// The points whose rays get through, found by tracing without derivatives.
    fn lit_points(
        &self,
        square: PolarFrame,
        points: impl Iterator<Item = [f64; 2]>,
    ) -> Option<Vec<[R; 2]>> {
        let disc = self.launch.model.ends_at_disc();
        let inside = |p: &[f64; 2]| {
            let [x, y] = pupil_point(square, *p);
            !disc || x * x + y * y <= 1.0
        };
        let points: Vec<[R; 2]> = points.filter(inside).map(|p| p.map(R::from_f64)).collect();
        let rays: Rays<R> = points.iter().map(|p| self.ray(square, *p)).collect();
        let mut landed = ImagePoints::default();
        self.plain_tracer.trace_batch(&rays, &mut landed);
        let lit = (0..points.len()).filter(|i| landed.fate(*i).is_imaged());
        let points: Vec<[R; 2]> = lit.map(|i| points[i]).collect();
        let outermost = |p: &[R; 2]| p.iter().any(|v| v.value().abs() > OUTERMOST);
        (!points.iter().any(outermost)).then_some(points)
    }

    /// The ray at a point of the square.
    #[inline(always)]
    fn ray<S: Real>(&self, square: PolarFrame, p: [S; 2]) -> Ray<S> {
        self.launch.mapped_ray(pupil_point(square, p))
    }
}

/// The pupil coordinates of a point of the square.
#[inline(always)]
fn pupil_point<R: Real>(square: PolarFrame, [u, v]: [R; 2]) -> [R; 2] {
    let [a, b] = square.axes;
    [0, 1].map(|i| R::from_f64(square.center[i]) + R::from_f64(a[i]) * u + R::from_f64(b[i]) * v)
}

/// The weights of the limits of a block of rays, relative to the closest limit of each.
struct LimitWeights<R> {
    /// `|g|` of the closest limit and its derivatives.
    closest: [[R; 3]; LANES],
    /// Σ (closest/|g|)^p.
    total: [R; LANES],
    /// Σ ŵ (∇ log w − ∇ log w of the closest).
    drift: [[R; 2]; LANES],
}

/// The exponent `p` of the weights; [`fifth_power`] computes it.
const EXPONENT: f64 = 5.0;

#[inline(always)]
fn fifth_power<R: Real>(v: R) -> R {
    let square = v * v;
    square * square * v
}

/// Sets A and B of every limit and the derivative of the integrand.
#[inline(always)]
fn weigh_limits<R: Real>(
    block: &mut JetBlock<R>,
    cost: &impl Integrand,
    disc: Option<PolarFrame>,
    points: &[[R; 2]; LANES],
) {
    let balance = LimitWeights::of(block, disc, points);
    let mut value = [R::ZERO; LANES];
    let mut slope = [[R::ZERO; 2]; LANES];
    for j in 0..LANES {
        let [x, y] = [block.landing[0][j], block.landing[1][j]];
        let by = cost.slope([x.value, y.value]);
        value[j] = cost.value([x.value, y.value]);
        slope[j] = [0, 1].map(|i| by[0] * x.slope[i] + by[1] * y.slope[i]);
        (block.by_landing[0][j], block.by_landing[1][j]) = (by[0], by[1]);
    }
    for (limit, by_limit) in block.limits.iter().zip(&mut block.by_limit) {
        for j in 0..LANES {
            by_limit[j] = balance.share(j, limit[j], value[j], slope[j]);
        }
    }
}

impl<R: Real> LimitWeights<R> {
    #[inline(always)]
    fn of(block: &JetBlock<R>, disc: Option<PolarFrame>, points: &[[R; 2]; LANES]) -> Self {
        let far = [R::from_f64(1e30), R::ZERO, R::ZERO];
        let zero = [R::ZERO; LANES];
        let mut rim = [far; LANES];
        if let Some(frame) = disc {
            rim = std::array::from_fn(|j| disc_limit(frame, points[j]));
        }
        let mut balance = Self { closest: rim, total: zero, drift: [[R::ZERO; 2]; LANES] };
        for limit in &block.limits {
            for (j, limit) in limit.iter().enumerate() {
                let Jet { value, slope: [x, y], .. } = *limit;
                balance.update_closest(j, [distance(value), x, y]);
            }
        }
        for limit in &block.limits {
            for (j, limit) in limit.iter().enumerate() {
                let Jet { value, slope: [x, y], .. } = *limit;
                balance.add(j, [distance(value), x, y]);
            }
        }
        if disc.is_some() {
            (0..LANES).for_each(|j| balance.add(j, rim[j]));
        }
        for (drift, total) in balance.drift.iter_mut().zip(balance.total) {
            *drift = drift.map(|d| d / total);
        }
        balance
    }

    #[inline(always)]
    fn update_closest(&mut self, j: usize, limit: [R; 3]) {
        let closer = limit[0] < self.closest[j][0];
        self.closest[j] = [0, 1, 2].map(|i| R::select(closer, limit[i], self.closest[j][i]));
    }

    /// The weight of a limit relative to the closest one, and the difference of the gradients of
    /// their logarithms: with `w = |g|^−p`, `∇ log w = p ∇g/|g|`.
    #[inline(always)]
    fn weight(&self, j: usize, [distance, x, y]: [R; 3]) -> (R, [R; 2]) {
        let [closest, cx, cy] = self.closest[j];
        let power = R::from_f64(EXPONENT);
        let (here, there) = (power / distance, power / closest);
        (fifth_power(closest / distance), [x * here - cx * there, y * here - cy * there])
    }

    #[inline(always)]
    fn add(&mut self, j: usize, limit: [R; 3]) {
        let (weight, [x, y]) = self.weight(j, limit);
        self.total[j] += weight;
        self.drift[j][0] += weight * x;
        self.drift[j][1] += weight * y;
    }

    /// `A` and the two components of `B` of a limit.
    #[inline(always)]
    fn share(&self, j: usize, limit: Jet<R>, cost: R, slope: [R; 2]) -> [R; 3] {
        let Jet { value: g, slope: [x, y], hessian: [xx, xy, yy] } = limit;
        let (weight, [lx, ly]) = self.weight(j, [distance(g), x, y]);
        let weight = weight / self.total[j];
        // ∇ŵ = ŵ (∇ log w − Σ ŵ ∇ log w)
        let [wx, wy] = [(lx - self.drift[j][0]) * weight, (ly - self.drift[j][1]) * weight];
        // div a of a = ŵ ∇g / D.
        let flat = R::from_f64(FLATNESS * FLATNESS) * g;
        let inverse = R::ONE / (x * x + y * y + flat * g + R::from_f64(CLOSEST));
        let (hx, hy) = (xx * x + xy * y, xy * x + yy * y);
        let along = x * hx + y * hy + flat * (x * x + y * y);
        let spread = xx + yy - (along + along) * inverse;
        let divergence = (wx * x + wy * y + weight * spread) * inverse;
        let [ax, ay] = [x * weight * inverse, y * weight * inverse];
        let a = slope[0] * ax + slope[1] * ay + cost * divergence;
        [-a, -(cost * ax), -(cost * ay)]
    }
}

/// `|g|` of a ray inside, never zero.
#[inline(always)]
fn distance<R: Real>(g: R) -> R {
    let closest = R::from_f64(CLOSEST);
    R::select(-g > closest, -g, closest)
}

/// The unit disc of the pupil as a limit `(|p|² − 1)/2`: its distance and its derivatives.
#[inline(always)]
fn disc_limit<R: Real>(frame: PolarFrame, point: [R; 2]) -> [R; 3] {
    let p = pupil_point(frame, point);
    let [a, b] = frame.axes.map(|axis| axis.map(R::from_f64));
    let g = (p[0] * p[0] + p[1] * p[1] - R::ONE) * R::from_f64(0.5);
    [distance(g), p[0] * a[0] + p[1] * a[1], p[0] * b[0] + p[1] * b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface, System};
    use crate::math::{Dual, Vec3};
    use crate::pupil::QuadraticIntegrand;
    use crate::trace::{RayLimit, SurfaceParameter, Tracer};

    /// By x, by y, and by a number of the lens.
    type Dual3 = Dual<f64, 3>;

    const COST: QuadraticIntegrand =
        QuadraticIntegrand { center: [0.3, -0.2], square: 0.7, constant: 0.4 };

    /// A surface of every form, a plane into air, and a mirror; the rims of the first asphere and of
    /// the image are wider than their conic.
    fn system() -> System<f64> {
        let surface = |shape, thickness, index, semi_diameter| {
            let (obstruction, mirror, hyper) = (0.0, false, false);
            let graded = None;
            Surface {
                shape,
                thickness,
                index,
                grin: graded,
                semi_diameter,
                obstruction,
                apertures: Vec::new(),
                mirror,
                hyperhemisphere: hyper,
                pose: None,
                axis: None,
                astigmatism: None,
                freeform: None,
                ideal: None,
            }
        };
        let terms = [1e-5, -3e-8, 0.0, 1e-12, 0.0, 0.0, 0.0];
        let mut surfaces = vec![
            surface(Shape::Sphere { curvature: 0.02 }, 4.0, 1.5, 9.0),
            surface(Shape::Conic { curvature: -0.015, conic: -0.5 }, 3.0, 1.1, 8.5),
            surface(Shape::Asphere { curvature: 0.01, conic: 160.0, terms }, 5.0, 1.7, 8.0),
            surface(Shape::Plane, 6.0, 1.0, 7.0),
            surface(Shape::Asphere { curvature: -0.01, conic: 0.2, terms }, -9.0, 1.0, 7.5),
            surface(Shape::Sphere { curvature: 0.13 }, 0.0, 1.0, 9.0),
        ];
        surfaces[1].obstruction = 0.3;
        surfaces[4].mirror = true;
        System { index_before: 1.05, surfaces, stop: None }
    }

    fn ray<R: Real>([x, y]: [R; 2]) -> Ray<R> {
        let slant = Vec3::new(R::from_f64(0.02), R::from_f64(0.11), R::ONE);
        Ray { point: Vec3::new(x, y, R::ZERO), direction: slant }
    }

    /// The limits of a ray with their slopes, from the margins that end it, and its cost.
    fn limits(system: &System<Dual3>, [x, y]: [f64; 2]) -> (Vec<Dual3>, Dual3) {
        let tracer = Tracer::new(system).unwrap();
        let ray = ray([Dual3::variable(x, 0), Dual3::variable(y, 1)]);
        let mut limits = Vec::new();
        tracer.margins(ray, |i, ray_limit, margin| {
            let surface = &system.surfaces[i];
            // A mirror sets no index.
            let before = system.index_before(i.min(4));
            let rarer = surface.index < before;
            let r = surface.semi_diameter;
            let n2 = before * before;
            match (ray_limit, surface.shape) {
                (RayLimit::Rim, _) => limits.push(-margin / (r * r * Dual3::TWO)),
                (RayLimit::Obstruction, _) => {
                    let h = surface.obstruction;
                    limits.push(-margin / (h * h * Dual3::TWO));
                }
                (RayLimit::TotalReflection, _) if rarer => limits.push(-margin / n2),
                // (k·N)² + n'² − n²
                (RayLimit::TotalReflection, Shape::Sphere { .. }) => {
                    limits.push((surface.index * surface.index - n2 - margin) / n2);
                }
                (RayLimit::Miss, Shape::Asphere { .. }) if !rarer => limits.push(-margin / n2),
                (_, _) => {}
            }
        });
        let landing = tracer.visit(ray, |i, p| match system.surfaces[i].shape {
            Shape::Sphere { curvature: c } if i == 5 => limits.push(c * p.z - Dual3::ONE),
            Shape::Asphere { curvature: c, conic, .. } if i == 2 => {
                let r2 = p.x * p.x + p.y * p.y;
                limits.push((Dual3::ONE + conic) * c * c * r2 - Dual3::ONE);
            }
            _ => {}
        });
        assert!(landing.fate.is_imaged(), "{:?}", landing.fate);
        let [cx, cy] = COST.center.map(Dual3::from_f64);
        let (dx, dy) = (landing.ray.point.x - cx, landing.ray.point.y - cy);
        let square = Dual3::from_f64(COST.square) * (dx * dx + dy * dy);
        (limits, square + Dual3::from_f64(COST.constant))
    }

    /// `C V` for the number of the lens (3.23), and `dC/dt`.
    fn field(system: &System<Dual3>, p: [f64; 2]) -> ([f64; 2], f64) {
        let (limits, cost) = limits(system, p);
        let weights: Vec<f64> = limits.iter().map(|g| g.value.abs().powf(-EXPONENT)).collect();
        let total: f64 = weights.iter().sum();
        let mut v = [0.0; 2];
        for (Dual { value: g, slope: [x, y, t] }, weight) in limits.iter().zip(weights) {
            let square = x * x + y * y + (FLATNESS * g).powi(2);
            let length = cost.value * weight / total * t / square;
            v = [v[0] + length * x, v[1] + length * y];
        }
        (v, cost.slope[2])
    }

    /// `dC/dt − div(C V)` for one number of the lens, `None` for the index in front, by central
    /// differences of fourth order; and the size of its parts.
    fn literal(named: Option<(usize, SurfaceParameter)>, p: [f64; 2]) -> (f64, f64) {
        let mut system = system().cast::<Dual3>();
        let number = match named {
            Some((i, slot)) => slot.value_mut(&mut system, i),
            None => &mut system.index_before,
        };
        *number = Dual3::variable(number.value, 2);
        let step = 2e-3;
        let along = |i: usize, steps: f64| {
            let mut there = p;
            there[i] += steps * step;
            field(&system, there).0[i]
        };
        let slope = |i: usize| {
            let (near, far) = (along(i, 1.0) - along(i, -1.0), along(i, 2.0) - along(i, -2.0));
            (8.0 * near - far) / (12.0 * step)
        };
        let (fixed, [x, y]) = (field(&system, p).1, [slope(0), slope(1)]);
        (fixed - x - y, fixed.abs() + x.abs() + y.abs())
    }

    #[test]
    fn aperture_aware_one_adjoint_gives_every_warp_field() {
        let tracer = WarpTracer::<f64>::new(&system()).unwrap();
        for p in [[0.4, 0.9], [-3.1, 2.2], [5.5, -1.7]] {
            let found = tracer.gradient(
                &[p],
                |[x, y]| ray([Jet::variable(x, 0), Jet::variable(y, 1)]),
                |points, block| weigh_limits(block, &COST, None, points),
            );
            let check = |name: String, found: f64, named| {
                let (expected, size) = literal(named, p);
                let off = (found - expected).abs();
                assert!(off <= 1e-9 * size, "{name} at {p:?}: {found} {expected}, of {size}");
            };
            check("index before".to_owned(), found.index_before, None);
            for (i, by) in found.surfaces.iter().enumerate() {
                let surface = &system().surfaces[i];
                let check = |slot, found| check(format!("{slot:?} {i}"), found, Some((i, slot)));
                if surface.shape != Shape::Plane {
                    check(SurfaceParameter::Curvature, by.curvature);
                }
                if !matches!(surface.shape, Shape::Plane | Shape::Sphere { .. }) {
                    check(SurfaceParameter::Conic, by.conic);
                }
                if matches!(surface.shape, Shape::Asphere { .. }) {
                    (0..7).for_each(|t| check(SurfaceParameter::AsphereTerm(t), by.terms[t]));
                }
                check(SurfaceParameter::Thickness, by.thickness);
                if !surface.mirror {
                    check(SurfaceParameter::Index, by.index);
                }
                check(SurfaceParameter::SemiDiameter, by.semi_diameter);
            }
        }
    }
}
