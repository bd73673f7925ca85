//! Where a ray first crosses an even asphere.
//!
//! Newton's iteration from the conic alone is not safe: it can jump to another crossing of a waved
//! surface, or leave the domain. It is trusted where the surface is nowhere steep enough to be
//! crossed twice. Elsewhere the crossings are isolated: an interval of the ray whose end heights
//! are too large for the steepest slope inside it holds none, one on which the height is monotone
//! holds at most one, and everything else is halved.

use super::interface::Interface;
use crate::lens::Shape;
use crate::math::Real;
use crate::math::Vec3;

/// The largest slope `dz/dr` of an asphere within `radius` of the axis; infinite without a bound.
pub(super) fn steepest<R: Real>(shape: &Shape<R>, radius: f64) -> f64 {
    let Shape::Asphere { curvature, conic, terms } = shape else { return 0.0 };
    slope_bound(curvature.value(), conic.value(), &terms.map(Real::value), radius)
}

impl Interface<f64> {
    fn slope_bound(&self, radius: f64) -> f64 {
        slope_bound(self.curvature, self.conic, &self.terms, radius)
    }
}

/// A bound of `|dz/dr|` within `radius` of the axis.
fn slope_bound(c: f64, conic: f64, terms: &[f64], radius: f64) -> f64 {
    let radicand = 1.0 - (1.0 + conic) * c * c * radius * radius;
    if !(radicand > 0.0 && radius.is_finite()) {
        return f64::INFINITY;
    }
    // For 1 + κ < 0 the slope of the conic alone is largest at the rim as well.
    let r2 = radius * radius;
    let mut power = radius * r2;
    let mut bound = (c * radius).abs() / radicand.sqrt();
    for (j, a) in terms.iter().enumerate() {
        bound += (2 * j + 4) as f64 * a.abs() * power;
        power *= r2;
    }
    bound
}

/// A ray against one asphere, in plain numbers.
struct Problem {
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    /// The length of `k` across the axis.
    across: f64,
    /// `p·k` across the axis.
    slant: f64,
    /// Where on the ray it starts.
    start: f64,
}

/// How far along `k` the ray first crosses the surface in its sense of travel: inside the
/// semi-diameter if it does so there, else outside; `None` where it never does.
///
/// `p` is any point of the ray, and the ray starts at `p + start k`.
pub(super) fn crossing(
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    start: f64,
) -> Option<f64> {
    let across = k.x.hypot(k.y);
    let problem = Problem { surface, p, k, across, slant: p.x * k.x + p.y * k.y, start };
    let rim = problem.surface.rim2.sqrt();
    let edge = problem.edge();
    let inside = rim.min(edge);
    if let Some(s) = problem.newton() {
        // A ray along the axis crosses a graph once, however steep that may be elsewhere.
        let unique = problem.across == 0.0 || problem.surface.steepest * problem.across < k.z.abs();
        if unique && problem.r2(s) <= inside * inside {
            return Some(s);
        }
    }
    if inside.is_finite() {
        let outside = if rim < edge { edge.min(4.0 * rim) } else { edge };
        return problem.first(inside).or_else(|| problem.first(outside));
    }
    let reach = problem.reach();
    problem.first(reach).or_else(|| problem.first(64.0 * reach))
}

impl Problem {
    /// Beyond this distance from the axis the conic does not exist.
    fn edge(&self) -> f64 {
        let square = (1.0 + self.surface.conic) * self.surface.curvature.powi(2);
        if square > 0.0 { 1.0 / square.sqrt() } else { f64::INFINITY }
    }

    /// A distance from the axis within which an unlimited surface is searched.
    fn reach(&self) -> f64 {
        let start = self.p.x.hypot(self.p.y);
        let at_vertex_plane =
            if self.k.z == 0.0 { 0.0 } else { start + (self.p.z / self.k.z).abs() * self.across };
        4.0 * start.max(at_vertex_plane).max(self.p.z.abs())
    }

    fn r2(&self, s: f64) -> f64 {
        let (x, y) = (self.p.x + s * self.k.x, self.p.y + s * self.k.y);
        x * x + y * y
    }

    /// Height of the surface above the ray, and its slope along the ray.
    fn height(&self, s: f64) -> (f64, f64) {
        let (z, dz_dr2) = self.surface.sag(self.r2(s));
        let along = self.slant + s * self.across * self.across;
        (z - (self.p.z + s * self.k.z), 2.0 * along * dz_dr2 - self.k.z)
    }

    /// Newton's iteration from the conic, or from the vertex plane where that is missed; `None`
    /// where it does not settle within a dozen steps.
    fn newton(&self) -> Option<f64> {
        let near = Interface { far: false, ..self.surface };
        let conic = near.meet_conic(self.p, self.k);
        let mut s = if conic.missed { -self.p.z / self.k.z } else { conic.s };
        let mut size = f64::INFINITY;
        for _ in 0..12 {
            let (f, slope) = self.height(s);
            let step = f / slope;
            if !step.is_finite() {
                return None;
            }
            s -= step;
            let settled = step.abs() <= 2.0 * f64::EPSILON * s.abs();
            // Rounding of the height itself ends the descent of the steps.
            let stalled = size < 1e-9 * self.scale() && step.abs() >= 0.5 * size;
            if settled || stalled {
                return Some(s);
            }
            size = step.abs();
        }
        None
    }

    fn scale(&self) -> f64 {
        let k = self.across.hypot(self.k.z);
        (self.p.x.abs() + self.p.y.abs() + self.p.z.abs()) / k
    }

    /// The first crossing within `radius` of the axis behind the start of the ray, or else the
    /// last one in front of it.
    fn first(&self, radius: f64) -> Option<f64> {
        let (from, to) = self.within(radius)?;
        let start = self.start.clamp(from, to);
        let behind = self.search(start, to, radius, Order::First);
        behind.or_else(|| self.search(from, start, radius, Order::Last))
    }

    /// The part of the ray within `radius` of the axis.
    fn within(&self, radius: f64) -> Option<(f64, f64)> {
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

    fn search(&self, from: f64, to: f64, radius: f64, order: Order) -> Option<f64> {
        let mut search = Search { problem: self, radius, order, budget: BUDGET };
        search.isolate(self.end(from), self.end(to))
    }

    fn end(&self, s: f64) -> End {
        End { s, height: self.surface.sense * self.height(s).0 }
    }

    /// The crossing between two points of opposite height, by Newton's iteration kept inside.
    fn bracketed(&self, mut above: f64, mut below: f64) -> f64 {
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

/// Which crossing of an interval is wanted.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    First,
    Last,
}

/// A search for one crossing within some distance of the axis.
struct Search<'a> {
    problem: &'a Problem,
    radius: f64,
    order: Order,
    budget: u32,
}

impl Search<'_> {
    /// A crossing from above between two points, by halving what cannot be decided.
    fn isolate(&mut self, from: End, to: End) -> Option<f64> {
        self.budget = self.budget.checked_sub(1)?;
        let problem = self.problem;
        let width = to.s - from.s;
        let r = problem.r2(from.s).max(problem.r2(to.s)).sqrt().min(self.radius);
        let steep = problem.surface.slope_bound(r) * problem.across;
        let monotone = steep < problem.k.z.abs();
        let same_side = (from.height > 0.0) == (to.height > 0.0);
        let reach = (problem.k.z.abs() + steep) * width;
        if same_side && (monotone || from.height.abs() + to.height.abs() > reach) {
            return None;
        }
        let narrow = width <= 1e-13 * (from.s.abs() + to.s.abs() + problem.scale());
        if monotone || narrow {
            return (!same_side && from.height > 0.0).then(|| problem.bracketed(from.s, to.s));
        }
        let middle = problem.end(0.5 * (from.s + to.s));
        match self.order {
            Order::First => self.isolate(from, middle).or_else(|| self.isolate(middle, to)),
            Order::Last => self.isolate(middle, to).or_else(|| self.isolate(from, middle)),
        }
    }
}

/// An end of an interval of the ray, with the signed height above the ray there.
#[derive(Clone, Copy)]
struct End {
    s: f64,
    height: f64,
}

/// How many intervals are looked at before the search gives up.
const BUDGET: u32 = 20_000;
