//! The first intersection of a ray with an even asphere.
//!
//! Newton's iteration from the conic alone is not safe: it can jump to another crossing of a wavy
//! surface, or leave the domain. Its result is trusted if the surface is nowhere steep enough to be
//! crossed twice. Otherwise the crossings are isolated: an interval of the ray whose end heights are
//! too large for the steepest slope inside it contains none, one on which the height is monotone
//! contains at most one, and any other interval is halved.

use super::interface::Interface;
use crate::lens::Shape;
use crate::math::Real;
use crate::math::Vec3;

/// A bound of the slope `|dz/dr|` of an asphere within `radius` of the axis, at most a few percent
/// above the largest slope; infinite if there is none. It is the slope at the middle of each of
/// several intervals plus a bound of its change inside.
pub(super) fn slope_bound<R: Real>(shape: &Shape<R>, radius: f64) -> f64 {
    let Shape::Asphere { curvature, conic, terms } = shape else { return 0.0 };
    slope_bound_between(
        curvature.value(),
        conic.value(),
        &terms.map(Real::value),
        (0.0, radius),
        64,
    )
}

/// A lower and an upper bound of the sag of an asphere within `radius` of the axis, in mm; infinite if
/// there is none.
pub(super) fn sag_range<R: Real>(shape: &Shape<R>, radius: f64) -> (f64, f64) {
    let Shape::Asphere { curvature, conic, terms } = shape else { return (0.0, 0.0) };
    let (c, conic, terms) = (curvature.value(), conic.value(), terms.map(Real::value));
    let plain = Shape::Asphere { curvature: c, conic, terms };
    let (mut low, mut high, width) = (0.0_f64, 0.0_f64, radius / 64.0);
    for i in 0..64 {
        let (from, to) = (f64::from(i) * width, f64::from(i + 1) * width);
        let middle = 0.5 * (from + to);
        let change = 0.5 * width * slope_bound_between(c, conic, &terms, (from, to), 1);
        let Some((z, _)) = plain.sag(middle * middle).filter(|_| change.is_finite()) else {
            return (f64::NEG_INFINITY, f64::INFINITY);
        };
        (low, high) = (low.min(z - change), high.max(z + change));
    }
    (low, high)
}

/// A bound of the slope between two distances from the axis, from a number of intervals.
fn slope_bound_between(
    c: f64,
    conic: f64,
    terms: &[f64],
    (from, to): (f64, f64),
    intervals: u32,
) -> f64 {
    let (mut bound, width): (f64, f64) = (0.0, (to - from) / f64::from(intervals));
    for i in 0..intervals {
        let start = from + f64::from(i) * width;
        let change = 0.5 * width * second_derivative_bound(c, conic, terms, start + width);
        // `max` would ignore NaN.
        if !change.is_finite() {
            return f64::INFINITY;
        }
        bound = bound.max(slope_at(c, conic, terms, start + 0.5 * width).abs() + change);
    }
    bound
}

/// `dz/dr` at a distance from the axis.
fn slope_at(c: f64, conic: f64, terms: &[f64], r: f64) -> f64 {
    let r2 = r * r;
    let polynomial = terms.iter().enumerate().rev();
    let sum = polynomial.fold(0.0, |sum, (j, a)| sum * r2 + (2 * j + 4) as f64 * a);
    c * r / (1.0 - (1.0 + conic) * c * c * r2).sqrt() + sum * r2 * r
}

/// A bound of `|d²z/dr²|` within `radius` of the axis.
fn second_derivative_bound(c: f64, conic: f64, terms: &[f64], radius: f64) -> f64 {
    let r2 = radius * radius;
    let radicand = 1.0 - (1.0 + conic) * c * c * r2;
    if !(radicand > 0.0 && radius.is_finite()) {
        return f64::INFINITY;
    }
    // A conic that flattens outwards has its largest second derivative at the vertex.
    let least = radicand.min(1.0);
    let mut bound = c.abs() / (least * least.sqrt());
    let mut power = r2;
    for (j, a) in terms.iter().enumerate() {
        bound += ((2 * j + 4) * (2 * j + 3)) as f64 * a.abs() * power;
        power *= r2;
    }
    bound
}

impl<R: Real> Interface<R> {
    /// The square of the distance from the axis up to which the conic exists and nothing is clipped.
    #[inline(always)]
    fn usable_radius2(&self) -> R {
        let square = (R::ONE + self.conic) * self.curvature * self.curvature;
        let exists = R::select(square > R::ZERO, R::ONE / square, self.rim2);
        R::select(exists < self.rim2, exists, self.rim2)
    }
}

/// A ray and an asphere, in plain numbers.
struct RayAtAsphere {
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    /// The length of `k` across the axis.
    across: f64,
    /// `p·k` across the axis.
    slant: f64,
    /// The parameter along `k` of the start of the ray.
    start: f64,
}

/// The crossings of rays with an asphere by Newton's iteration, and whether they can be trusted.
pub(super) struct NewtonResult<R, const W: usize> {
    /// The parameters along `k`.
    pub(super) s: [R; W],
    /// 1 if this is the only crossing inside the semi-diameter, else 0; a number of the same width as
    /// the others, so that the vector instructions need no conversion.
    pub(super) trusted: [R; W],
}

/// Points of rays and optical directions, as columns.
pub(super) struct RayStarts<R, const W: usize> {
    columns: [[R; W]; 6],
}

impl<R: Real, const W: usize> RayStarts<R, W> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { columns: [[R::ZERO; W]; 6] }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, p: Vec3<R>, k: Vec3<R>) {
        let numbers = [p.x, p.y, p.z, k.x, k.y, k.z];
        self.columns.iter_mut().zip(numbers).for_each(|(column, number)| column[j] = number);
    }

    #[inline(always)]
    pub(super) fn get(&self, j: usize) -> (Vec3<R>, Vec3<R>) {
        let [x, y, z, kx, ky, kz] = &self.columns;
        (Vec3::new(x[j], y[j], z[j]), Vec3::new(kx[j], ky[j], kz[j]))
    }
}

/// Newton's iteration from the conic, or from the vertex plane for a ray that misses the conic. Each
/// ray stops on its own, so that its result does not depend on the other rays.
#[inline(always)]
pub(super) fn newton_crossings<R: Real, const W: usize>(
    surface: &Interface<R>,
    rays: &RayStarts<R, W>,
) -> NewtonResult<R, W> {
    let near = Interface { starts_far: false, ..*surface };
    let mut s = [R::ZERO; W];
    let mut moving = [R::ONE; W];
    let tolerance = R::from_f64(R::EPSILON.powf(2.0 / 3.0));
    for (j, s) in s.iter_mut().enumerate() {
        let (p, k) = rays.get(j);
        let conic = near.intersect_conic(p, k);
        *s = R::select(conic.missed, -(p.z / k.z), conic.s);
    }
    for _ in 0..NEWTON_STEPS {
        for j in 0..W {
            let (p, k) = rays.get(j);
            let (f, slope) = surface.height_above(p + k * s[j], k);
            let step = f / slope;
            // The next step would be smaller than the square of this one.
            let size = p.x.abs() + p.y.abs() + p.z.abs();
            let settled = step * step * surface.n2 <= tolerance * tolerance * size * size;
            s[j] = R::select(moving[j] > R::ZERO, s[j] - step, s[j]);
            moving[j] = R::select(settled, R::ZERO, moving[j]);
        }
        if moving.iter().all(|moving| *moving == R::ZERO) {
            break;
        }
    }
    let bound = R::from_f64(surface.slope_bound);
    let bound2 = bound * bound;
    let trusted = std::array::from_fn(|j| {
        let (p, k) = rays.get(j);
        let point = p + k * s[j];
        let across2 = k.x * k.x + k.y * k.y;
        // A ray along the axis crosses a graph once, however steep that may be elsewhere.
        let unique = (across2 == R::ZERO) | (bound2 * across2 < k.z * k.z);
        let inside = point.x * point.x + point.y * point.y <= surface.usable_radius2();
        R::select(unique & inside & !(moving[j] > R::ZERO), R::ONE, R::ZERO)
    });
    NewtonResult { s, trusted }
}

/// The number of steps of Newton's iteration before a crossing is isolated instead.
const NEWTON_STEPS: usize = 10;

/// The parameter along `k` of the first crossing of the surface in the sense of travel: inside the
/// semi-diameter if there is one, else outside; `None` if there is none.
///
/// `p` is any point of the ray, which starts at `p + start k`.
pub(super) fn find_crossing(
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    start: f64,
) -> Option<f64> {
    let mut ray = RayStarts::<f64, 1>::new();
    ray.set(0, p, k);
    let quick = newton_crossings(&surface, &ray);
    if quick.trusted[0] > 0.0 { Some(quick.s[0]) } else { isolate_crossing(surface, p, k, start) }
}

/// As [`find_crossing`], by isolating the crossings.
pub(super) fn isolate_crossing(
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    start: f64,
) -> Option<f64> {
    let across = k.x.hypot(k.y);
    let problem = RayAtAsphere { surface, p, k, across, slant: p.x * k.x + p.y * k.y, start };
    let rim = problem.surface.rim2.sqrt();
    let edge = problem.domain_radius();
    let inside = rim.min(edge);
    if inside.is_finite() {
        let outside = if rim < edge { edge.min(4.0 * rim) } else { edge };
        let anywhere = (f64::NEG_INFINITY, f64::INFINITY);
        let found = problem.first_crossing(inside, problem.surface.sag_range);
        return found.or_else(|| problem.first_crossing(outside, anywhere));
    }
    let (reach, anywhere) = (problem.search_radius(), (f64::NEG_INFINITY, f64::INFINITY));
    problem
        .first_crossing(reach, anywhere)
        .or_else(|| problem.first_crossing(64.0 * reach, anywhere))
}

impl RayAtAsphere {
    /// The distance from the axis up to which the conic exists.
    fn domain_radius(&self) -> f64 {
        let square = (1.0 + self.surface.conic) * self.surface.curvature.powi(2);
        if square > 0.0 { 1.0 / square.sqrt() } else { f64::INFINITY }
    }

    /// The distance from the axis up to which an unlimited surface is searched.
    fn search_radius(&self) -> f64 {
        let start = self.p.x.hypot(self.p.y);
        let at_vertex_plane =
            if self.k.z == 0.0 { 0.0 } else { start + (self.p.z / self.k.z).abs() * self.across };
        4.0 * start.max(at_vertex_plane).max(self.p.z.abs())
    }

    fn r2(&self, s: f64) -> f64 {
        let (x, y) = (self.p.x + s * self.k.x, self.p.y + s * self.k.y);
        x * x + y * y
    }

    /// A bound of the slope of the surface along a part of the ray that lies within `radius`.
    fn bound(&self, from: f64, to: f64, radius: f64) -> f64 {
        let nearest = (-self.slant / (self.across * self.across)).max(from).min(to);
        let low = if nearest.is_finite() { self.r2(nearest).sqrt() } else { 0.0 };
        let high = self.r2(from).max(self.r2(to)).sqrt().min(radius);
        let surface = &self.surface;
        let range = (low.min(high), high);
        slope_bound_between(surface.curvature, surface.conic, &surface.terms, range, 2)
    }

    /// The height of the surface above the ray, and its derivative along the ray.
    fn height(&self, s: f64) -> (f64, f64) {
        let (z, dz_dr2) = self.surface.sag(self.r2(s));
        let along = self.slant + s * self.across * self.across;
        (z - (self.p.z + s * self.k.z), 2.0 * along * dz_dr2 - self.k.z)
    }

    fn scale(&self) -> f64 {
        let k = self.across.hypot(self.k.z);
        (self.p.x.abs() + self.p.y.abs() + self.p.z.abs()) / k
    }

    /// The first crossing behind the start of the ray, or else the last one in front of it, within
    /// `radius` of the axis and between two heights.
    fn first_crossing(&self, radius: f64, heights: (f64, f64)) -> Option<f64> {
        let (from, to) = self.part_within(radius)?;
        let (low, high) = self.part_between(heights);
        let (from, to) = (from.max(low), to.min(high));
        if !(from <= to) {
            return None;
        }
        let start = self.start.max(from).min(to);
        let behind = self.search(start, to, radius, CrossingChoice::First);
        behind.or_else(|| self.search(from, start, radius, CrossingChoice::Last))
    }

    /// The part of the ray within `radius` of the axis.
    fn part_within(&self, radius: f64) -> Option<(f64, f64)> {
        let r2 = self.p.x * self.p.x + self.p.y * self.p.y;
        let square = self.across * self.across;
        if square == 0.0 {
            let s = (self.surface.sag(r2).0 - self.p.z) / self.k.z;
            let width = s.abs().max(self.scale()) * 1e-6;
            return (r2 <= radius * radius && s.is_finite()).then_some((s - width, s + width));
        }
        let root = self.slant * self.slant - square * (r2 - radius * radius);
        (root >= 0.0).then(|| {
            let root = root.sqrt();
            ((-self.slant - root) / square, (-self.slant + root) / square)
        })
    }

    /// The part of the ray between two heights, with a margin for rounding.
    fn part_between(&self, (low, high): (f64, f64)) -> (f64, f64) {
        let (a, b) = ((low - self.p.z) / self.k.z, (high - self.p.z) / self.k.z);
        let slack = 1e-9 * (a.abs() + b.abs() + self.scale());
        if slack.is_finite() {
            (a.min(b) - slack, a.max(b) + slack)
        } else {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }

    fn search(&self, from: f64, to: f64, radius: f64, order: CrossingChoice) -> Option<f64> {
        let mut search = CrossingSearch { problem: self, radius, order, budget: MAX_INTERVALS };
        search.isolate(self.endpoint(from), self.endpoint(to))
    }

    fn endpoint(&self, s: f64) -> IntervalEnd {
        IntervalEnd { s, height: self.surface.sense * self.height(s).0 }
    }

    /// The crossing between two points with heights of opposite sign, by a bracketed Newton's iteration.
    fn solve_bracketed(&self, mut above: f64, mut below: f64) -> f64 {
        let mut s = 0.5 * (above + below);
        for _ in 0..200 {
            let (f, slope) = self.height(s);
            if self.surface.sense * f > 0.0 {
                above = s;
            } else {
                below = s;
            }
            let newton = s - f / slope;
            let (low, high) = if above < below { (above, below) } else { (below, above) };
            let next = if newton > low && newton < high { newton } else { 0.5 * (above + below) };
            if (next - s).abs() <= 2.0 * f64::EPSILON * s.abs() {
                return next;
            }
            s = next;
        }
        s
    }
}

/// The choice among the crossings in an interval.
#[derive(Clone, Copy, PartialEq)]
enum CrossingChoice {
    First,
    Last,
}

/// A search for one crossing within `radius` of the axis.
struct CrossingSearch<'a> {
    problem: &'a RayAtAsphere,
    radius: f64,
    order: CrossingChoice,
    budget: u32,
}

impl CrossingSearch<'_> {
    /// A crossing from above between two points; halves intervals that cannot be decided.
    fn isolate(&mut self, from: IntervalEnd, to: IntervalEnd) -> Option<f64> {
        self.budget = self.budget.checked_sub(1)?;
        let problem = self.problem;
        let width = to.s - from.s;
        let steep = problem.bound(from.s, to.s, self.radius) * problem.across;
        let monotone = steep < problem.k.z.abs();
        let same_side = (from.height > 0.0) == (to.height > 0.0);
        let reach = (problem.k.z.abs() + steep) * width;
        if same_side && (monotone || from.height.abs() + to.height.abs() > reach) {
            return None;
        }
        let narrow = width <= 1e-13 * (from.s.abs() + to.s.abs() + problem.scale());
        if monotone || narrow {
            return (!same_side && from.height > 0.0)
                .then(|| problem.solve_bracketed(from.s, to.s));
        }
        let middle = problem.endpoint(0.5 * (from.s + to.s));
        match self.order {
            CrossingChoice::First => {
                self.isolate(from, middle).or_else(|| self.isolate(middle, to))
            }
            CrossingChoice::Last => self.isolate(middle, to).or_else(|| self.isolate(from, middle)),
        }
    }
}

/// An end of an interval of the ray, with the signed height of the surface above the ray.
#[derive(Clone, Copy)]
struct IntervalEnd {
    s: f64,
    height: f64,
}

/// The number of intervals after which the search fails.
const MAX_INTERVALS: u32 = 20_000;
