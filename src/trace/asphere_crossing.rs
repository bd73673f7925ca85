//! The first intersection of a ray with an even asphere, found by isolating the crossings.
//!
//! An interval of the ray contains no crossing if the heights of its ends are too large for the
//! steepest slope or the strongest curvature of the surface inside it, or if the ray is above or below
//! the whole of that part of the surface; it contains at most one if the height is monotone on it; and
//! any other interval is halved. The work on a ray is bounded: what is not decided after
//! [`MAX_INTERVALS`] counts as a miss.

use super::asphere::{
    NewtonResult, RayStarts, newton_crossings, second_derivative_bound, slope_bound_between,
};
use super::interface::Interface;
use crate::math::Vec3;

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
    let quick = newton_crossing(&surface, p, k);
    if quick.trusted[0] > 0.0 { Some(quick.s[0]) } else { isolate_crossing(surface, p, k, start) }
}

/// The parameter along `k` at which Newton's iteration ends, on the surface or not.
pub(super) fn newton_end(surface: &Interface<f64>, p: Vec3<f64>, k: Vec3<f64>) -> f64 {
    newton_crossing(surface, p, k).s[0]
}

fn newton_crossing(surface: &Interface<f64>, p: Vec3<f64>, k: Vec3<f64>) -> NewtonResult<f64, 1> {
    let mut ray = RayStarts::<f64, 1>::new();
    ray.set(0, p, k);
    newton_crossings(surface, &ray)
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

/// As [`find_crossing`], by isolating the crossings; `None` also if [`MAX_INTERVALS`] do not tell.
pub(super) fn isolate_crossing(
    surface: Interface<f64>,
    p: Vec3<f64>,
    k: Vec3<f64>,
    start: f64,
) -> Option<f64> {
    let across = k.x.hypot(k.y);
    let ray = RayAtAsphere { surface, p, k, across, slant: p.x * k.x + p.y * k.y, start };
    let mut search = CrossingSearch { ray: &ray, budget: MAX_INTERVALS };
    search.nearest_crossing().unwrap_or(None)
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

    #[inline]
    fn r2(&self, s: f64) -> f64 {
        let (x, y) = (self.p.x + s * self.k.x, self.p.y + s * self.k.y);
        x * x + y * y
    }

    /// The least and the largest distance from the axis on a part of the ray that lies within
    /// `radius`.
    #[inline]
    fn distances(&self, from: f64, to: f64, radius: f64) -> (f64, f64) {
        let nearest = (-self.slant / (self.across * self.across)).max(from).min(to);
        let low = if nearest.is_finite() { self.r2(nearest).sqrt() } else { 0.0 };
        let high = self.r2(from).max(self.r2(to)).sqrt().min(radius);
        (low.min(high), high)
    }

    /// A bound of the slope of the surface between two distances from the axis.
    #[inline]
    fn slope_bound(&self, distances: (f64, f64)) -> f64 {
        let surface = &self.surface;
        slope_bound_between(surface.curvature, surface.conic, &surface.terms, distances, 2)
    }

    /// A bound of the second derivative of the height along the ray, within `radius` of the axis.
    #[inline]
    fn bend_bound(&self, radius: f64) -> f64 {
        let Interface { curvature, conic, terms, .. } = &self.surface;
        self.across * self.across * second_derivative_bound(*curvature, *conic, terms, radius)
    }

    /// True if the heights of a part of the ray are all above or all below those of the surface at its
    /// distances from the axis, by more than rounding.
    #[inline]
    fn is_apart(&self, from: f64, to: f64, distances: (f64, f64)) -> bool {
        let (low, high, size) = self.surface.sag_bounds(distances);
        let (a, b) = (self.p.z + from * self.k.z, self.p.z + to * self.k.z);
        let margin = 1e-12 * (a.abs() + b.abs() + size);
        a.max(b) + margin < low || a.min(b) - margin > high
    }

    /// The height of the surface above the ray, and its derivative along the ray.
    #[inline]
    fn height(&self, s: f64) -> (f64, f64) {
        let (z, dz_dr2) = self.surface.sag(self.r2(s));
        let along = self.slant + s * self.across * self.across;
        (z - (self.p.z + s * self.k.z), 2.0 * along * dz_dr2 - self.k.z)
    }

    fn scale(&self) -> f64 {
        let k = self.across.hypot(self.k.z);
        (self.p.x.abs() + self.p.y.abs() + self.p.z.abs()) / k
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

    /// True if a part of the ray whose ends are on one side of the surface cannot cross it in between:
    /// the ends are too far from it for its slope or its curvature, or all of the part is.
    #[inline]
    fn stays_on_its_side(
        &self,
        from: IntervalEnd,
        to: IntervalEnd,
        steep: f64,
        distances: (f64, f64),
    ) -> bool {
        let width = to.s - from.s;
        let (from_height, to_height) = (from.height.abs(), to.height.abs());
        from_height + to_height > (self.k.z.abs() + steep) * width
            || from_height.min(to_height) > 0.125 * width * width * self.bend_bound(distances.1)
            || self.is_apart(from.s, to.s, distances)
    }

    #[inline]
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

/// A search for one crossing, with the number of intervals that are left to it.
struct CrossingSearch<'a> {
    ray: &'a RayAtAsphere,
    budget: u32,
}

/// The end of a search without a decision: no interval is left.
struct Undecided;

/// A crossing, or the certainty that there is none.
type Decision = Result<Option<f64>, Undecided>;

/// Heights that exclude nothing.
const ANY_HEIGHT: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

impl CrossingSearch<'_> {
    /// The first crossing inside the semi-diameter, else outside.
    fn nearest_crossing(&mut self) -> Decision {
        let (rim, edge) = (self.ray.surface.rim2.sqrt(), self.ray.domain_radius());
        let (inside, outside) = if rim < edge {
            ((rim, self.ray.surface.sag_range), edge.min(4.0 * rim))
        } else if edge.is_finite() {
            ((edge, self.ray.surface.sag_range), edge)
        } else {
            let reach = self.ray.search_radius();
            ((reach, ANY_HEIGHT), 64.0 * reach)
        };
        match self.first_crossing(inside)? {
            None if inside != (outside, ANY_HEIGHT) => self.first_crossing((outside, ANY_HEIGHT)),
            found => Ok(found),
        }
    }

    /// The first crossing behind the start of the ray, or else the last one in front of it, within
    /// `radius` of the axis and between two heights.
    fn first_crossing(&mut self, (radius, heights): (f64, (f64, f64))) -> Decision {
        let ray = self.ray;
        let Some((from, to)) = ray.part_within(radius) else { return Ok(None) };
        let (low, high) = ray.part_between(heights);
        let (from, to) = (from.max(low), to.min(high));
        if !(from <= to) {
            return Ok(None);
        }
        let start = ray.start.max(from).min(to);
        let [from, start, to] = [from, start, to].map(|s| ray.endpoint(s));
        match self.isolate(start, to, radius, CrossingChoice::First)? {
            None => self.isolate(from, start, radius, CrossingChoice::Last),
            found => Ok(found),
        }
    }

    /// A crossing from above between two points; halves intervals that cannot be decided.
    fn isolate(
        &mut self,
        from: IntervalEnd,
        to: IntervalEnd,
        radius: f64,
        order: CrossingChoice,
    ) -> Decision {
        self.budget = self.budget.checked_sub(1).ok_or(Undecided)?;
        let ray = self.ray;
        let width = to.s - from.s;
        let distances = ray.distances(from.s, to.s, radius);
        let steep = ray.slope_bound(distances) * ray.across;
        let monotone = steep < ray.k.z.abs();
        let same_side = (from.height > 0.0) == (to.height > 0.0);
        if same_side && (monotone || ray.stays_on_its_side(from, to, steep, distances)) {
            return Ok(None);
        }
        let narrow = width <= 1e-13 * (from.s.abs() + to.s.abs() + ray.scale());
        if monotone || narrow {
            let crosses = !same_side && from.height > 0.0;
            return Ok(crosses.then(|| ray.solve_bracketed(from.s, to.s)));
        }
        let middle = ray.endpoint(0.5 * (from.s + to.s));
        let mut halves = [(from, middle), (middle, to)];
        if order == CrossingChoice::Last {
            halves.reverse();
        }
        for (from, to) in halves {
            let found = self.isolate(from, to, radius, order)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
}

/// An end of an interval of the ray, with the signed height of the surface above the ray.
#[derive(Clone, Copy)]
struct IntervalEnd {
    s: f64,
    height: f64,
}

/// The number of intervals after which a ray counts as one that misses. Hardly a ray needs a hundred,
/// whatever the numbers of the surface.
const MAX_INTERVALS: u32 = 5_000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{ASPHERE_TERMS, Shape, Surface, System};
    use crate::trace::interface::interfaces;

    /// A surface of a semi-diameter of 3 mm, from its curvature, conic constant and first terms.
    fn surface(curvature: f64, conic: f64, first: &[f64]) -> Interface<f64> {
        let mut terms = [0.0; ASPHERE_TERMS];
        terms[..first.len()].copy_from_slice(first);
        let shape = Shape::Asphere { curvature, conic, terms };
        let plane = Surface::plane(0.0, 1.5);
        let surfaces = vec![Surface { shape, semi_diameter: 3.0, ..plane }];
        interfaces(&System { index_before: 1.0, surfaces, stop: None })[0]
    }

    /// A ray that crosses the vertex plane at a point, with two direction cosines.
    fn ray(surface: Interface<f64>, [x, y]: [f64; 2], [l, m]: [f64; 2]) -> RayAtAsphere {
        let k = Vec3::new(l, m, (1.0 - l * l - m * m).sqrt());
        let p = Vec3::new(x, y, 0.0) - k * (0.4 / k.z);
        let across = l.hypot(m);
        RayAtAsphere { surface, p, k, across, slant: p.x * l + p.y * m, start: 0.0 }
    }

    /// The mean and the largest number of intervals of rays through a square of this half side.
    fn cost(surface: Interface<f64>, half: f64) -> (f64, u32) {
        let (mut sum, mut most) = (0, 0);
        for i in 0..1000 {
            // A sequence of four coordinates that fills the square and the directions evenly.
            let at = |step: f64| 2.0 * (f64::from(i) * step).fract() - 1.0;
            let point = [half * at(0.856_674_8), half * at(0.733_891_8)];
            let ray = ray(surface, point, [0.6 * at(0.628_706_7), 0.6 * at(0.538_597_4)]);
            let mut search = CrossingSearch { ray: &ray, budget: MAX_INTERVALS };
            assert!(search.nearest_crossing().is_ok());
            sum += MAX_INTERVALS - search.budget;
            most = most.max(MAX_INTERVALS - search.budget);
        }
        (f64::from(sum) / 1000.0, most)
    }

    #[test]
    fn no_surface_takes_many_intervals_of_a_ray() {
        let phone = [0.123_512, 0.076_650_2, -0.050_375_5, 0.108_034];
        let cases: [(f64, f64, &[f64], f64, f64); 7] = [
            // Conics that end 8 µm and 0.2 nm from the axis.
            (0.127, 1e6, &phone, 0.008, 20.0),
            (4e9, 14.8, &phone, 6e-11, 20.0),
            // Cones with a sharp tip, in part with a wave.
            (4.33e8, -11_778.5, &[1.5e-9, -0.0727], 3.0, 250.0),
            (-9.58e8, -1194.7, &[-1.517], 3.0, 250.0),
            // A small ball that rays touch, and a wall.
            (-35.66, -0.1476, &[2e-9], 0.04, 60.0),
            (0.0, 0.0, &[1e6, -1e5, 1e4], 3.0, 250.0),
            // A floor that rises to 4e8 mm at the rim.
            (-0.008, 0.0, &[0.0, 0.0, 6e4], 3.0, 30.0),
        ];
        for (curvature, conic, terms, half, limit) in cases {
            let (mean, most) = cost(surface(curvature, conic, terms), half);
            assert!(
                mean < limit,
                "{curvature}, {conic}: {mean} intervals of a ray, at most {most}"
            );
        }
    }

    /// A ray whose crossing is not known misses, and is not sent to one behind its start.
    #[test]
    fn a_search_without_intervals_decides_nothing() {
        let ray = ray(surface(4.33e8, -11_778.5, &[0.0, -0.0727]), [1.0, 1.0], [0.5, 0.1]);
        let decide = |budget: u32| CrossingSearch { ray: &ray, budget }.nearest_crossing();
        assert!(matches!(decide(MAX_INTERVALS), Ok(Some(_))));
        assert!((0..5).all(|budget| decide(budget).is_err()));
    }

    /// The sag of a conic with terms in r⁴, r⁶ and so on.
    fn sag(curvature: f64, conic: f64, terms: &[f64], r2: f64) -> f64 {
        let root = (1.0 - (1.0 + conic) * curvature * curvature * r2).sqrt();
        let powers = terms.iter().enumerate().map(|(j, a)| a * r2.powi(j as i32 + 2));
        curvature * r2 / (1.0 + root) + powers.sum::<f64>()
    }

    /// The place where a function falls below zero between two others.
    fn bisect([mut low, mut high]: [f64; 2], above: &impl Fn(f64) -> f64) -> f64 {
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            [low, high] = if above(middle) > 0.0 { [middle, high] } else { [low, middle] };
        }
        low
    }

    #[test]
    fn the_first_crossing_is_that_of_a_fine_scan() {
        let cases: [(f64, f64, &[f64]); 4] = [
            (0.123_512, -0.3, &[0.076_650_2, -0.050_375_5, 0.008_034]),
            (0.15, -0.5, &[-0.03, 0.004, -1e-4]),
            (0.0, 0.0, &[0.1, -0.03, 0.002]),
            (-0.05, 0.0, &[-0.1, 0.025, -0.0015]),
        ];
        let mut compared = 0;
        for (curvature, conic, terms) in cases {
            let surface = surface(curvature, conic, terms);
            for i in 0..80 {
                let at = |step: f64| 2.0 * (f64::from(i) * step).fract() - 1.0;
                let point = [2.5 * at(0.856_674_8), 2.5 * at(0.733_891_8)];
                let ray = ray(surface, point, [0.6 * at(0.628_706_7), 0.6 * at(0.538_597_4)]);
                let r2 = |s: f64| (ray.p.x + s * ray.k.x).powi(2) + (ray.p.y + s * ray.k.y).powi(2);
                let above = |s: f64| sag(curvature, conic, terms, r2(s)) - ray.p.z - s * ray.k.z;
                let within = |s: f64| r2(s) < 9.0;
                if !within(0.0) || above(0.0) < 0.0 {
                    continue;
                }
                let mut scan = (0..4000).map(|n| 1e-3 * f64::from(n));
                let end = scan.find(|s| !within(*s) || above(*s) < 0.0);
                let Some(end) = end.filter(|s| within(*s)) else { continue };
                let low = bisect([end - 1e-3, end], &above);
                let mut search = CrossingSearch { ray: &ray, budget: MAX_INTERVALS };
                let found = search.nearest_crossing().ok().flatten().unwrap();
                assert!((found - low).abs() < 1e-12, "{curvature} {i}: {found} {low}");
                compared += 1;
            }
        }
        assert!(compared > 150, "{compared}");
    }

    #[test]
    fn the_bound_of_the_slope_is_none_below_it_and_not_far_above() {
        let surface = surface(0.15, -0.5, &[-0.03, 0.004]);
        for (from, to) in [(0.0, 0.5), (0.5, 1.5), (2.0, 2.2), (1.0, 3.0)] {
            for intervals in [1, 4, 64] {
                let (c, conic, terms) = (surface.curvature, surface.conic, &surface.terms);
                let bound = slope_bound_between(c, conic, terms, (from, to), intervals);
                let sag = |r: f64| sag(0.15, -0.5, &[-0.03, 0.004], r * r);
                let slope = |r: f64| ((sag(r + 1e-6) - sag(r - 1e-6)) / 2e-6).abs();
                let places = (0..=100).map(|i| from + (to - from) * f64::from(i) / 100.0);
                let steepest = places.map(slope).fold(0.0, f64::max);
                assert!(steepest <= bound + 1e-8, "{from} {to} {intervals}: {steepest} {bound}");
                let near = bound <= 1.2 * steepest + 0.02;
                assert!(intervals < 64 || near, "{from} {to}: {steepest} {bound}");
            }
        }
    }

    #[test]
    fn the_distances_of_a_part_of_a_ray_are_those_of_its_points() {
        let surface = surface(0.1, 0.0, &[0.01]);
        for (point, direction) in [([1.0, -0.5], [0.3, 0.4]), ([-2.0, 0.1], [0.5, 0.0])] {
            let ray = ray(surface, point, direction);
            for (from, to) in [(-6.0, 6.0), (0.0, 1.0), (-3.0, -1.0), (2.0, 5.0)] {
                let at = |i: i32| from + (to - from) * f64::from(i) / 20_000.0;
                let off = (0..=20_000).map(|i| {
                    let (s, p, k) = (at(i), ray.p, ray.k);
                    (p.x + s * k.x).hypot(p.y + s * k.y)
                });
                let exact = off.fold([f64::INFINITY, 0.0f64], |[a, b], r| [a.min(r), b.max(r)]);
                let (low, high) = ray.distances(from, to, 100.0);
                assert!((low - exact[0]).abs() < 1e-3, "{from} {to}: {low} {exact:?}");
                assert!((high - exact[1]).abs() < 1e-9, "{from} {to}: {high} {exact:?}");
                assert_eq!(ray.distances(from, to, 0.5 * high).1, 0.5 * high);
            }
        }
    }
}
