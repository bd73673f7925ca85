//! The first intersection of a ray with a freeform.
//!
//! Newton's iteration is trusted where bounds of both slopes over the aperture exclude a second
//! crossing. Else the crossings are isolated by interval arithmetic: a part of the ray whose heights
//! above the surface exclude zero, or along which the surface does not exist, has no crossing; one
//! along which the height is monotone has at most one; any other is halved. The bounds follow from the
//! formula of the sag itself, so that they hold for every form. The work on a ray is limited: what is
//! not decided after [`MAX_PARTS`] counts as a miss.

use super::interface::{Interface, Intersection};
use crate::lens::{BaseSag, Freeform, FreeformKind};
use crate::math::{Arithmetic, Interval, Real, Vec3};
use std::sync::Arc;

/// The length in mm that stands for the size of a surface where neither it nor the ray has one: at the
/// vertex.
const LEAST_LENGTH: f64 = 1e-3;
/// The square of the slope up to which a ray counts as parallel to the axis: over any lens it stays at its
/// distance from it to rounding.
const PARALLEL: f64 = 1e-34;

/// A freeform with bounds of its sag.
#[derive(Debug, Clone)]
pub(super) struct FreeformFace<R> {
    pub(super) form: Freeform<R>,
    /// The coefficient of y², in 1/mm, of an irregularity; 0 for none.
    pub(super) astigmatism: R,
    search: Arc<FreeformSearch>,
}

impl<R: Real> FreeformFace<R> {
    pub(super) fn new(surface: &Interface<R>, form: &Freeform<R>, astigmatism: R) -> Self {
        let plain = form.map(Real::value);
        let search = Arc::new(FreeformSearch::new(surface.value(), plain, astigmatism.value()));
        Self { form: form.clone(), astigmatism, search }
    }

    /// The same form with every number mapped by `f`.
    pub(super) fn map<S: Real>(&self, f: impl Fn(R) -> S) -> FreeformFace<S> {
        let astigmatism = f(self.astigmatism);
        FreeformFace { form: self.form.map(f), astigmatism, search: Arc::clone(&self.search) }
    }

    /// The base of the sag with the numbers of the surface.
    pub(super) fn base(&self, surface: &Interface<R>) -> BaseSag<R> {
        self.form.base_of(surface.curvature, surface.conic, surface.terms)
    }

    /// The sag, and its derivatives by x and y.
    fn sag(&self, base: &BaseSag<R>, point: Vec3<R>) -> [R; 3] {
        let [z, by_x, by_y] = self.form.sag(base, point.x, point.y);
        let lean = self.astigmatism * point.y;
        [z + lean * point.y, by_x, by_y + lean + lean]
    }

    /// The intersection with a ray that starts at `p` in the frame of the surface.
    pub(super) fn intersect(
        &self,
        surface: &Interface<R>,
        p: Vec3<R>,
        k: Vec3<R>,
    ) -> Intersection<R> {
        let (start, before) = surface.closest_approach(p, k);
        let found = self.search.crossing(start.value(), k.value(), -before.value());
        let mut s = R::from_f64(found.unwrap_or(f64::NAN));
        let base = self.base(surface);
        for _ in 0..R::ORDER {
            let point = start + k * s;
            let [z, by_x, by_y] = self.sag(&base, point);
            s -= (z - point.z) / (by_x * k.x + by_y * k.y - k.z);
        }
        let point = start + k * s;
        let [_, by_x, by_y] = self.sag(&base, point);
        let normal = Vec3::new(-by_x, -by_y, R::ONE);
        let a = k.dot(normal);
        let missed = !(surface.sense * a > R::ZERO);
        Intersection { point, s: before + s, normal, a, m: normal.dot(normal), missed }
    }
}

/// A freeform in plain numbers, with bounds over its aperture.
#[derive(Debug)]
struct FreeformSearch {
    surface: Interface<f64>,
    form: Freeform<f64>,
    astigmatism: f64,
    base: BaseSag<f64>,
    bounds: BaseSag<Interval>,
    /// The largest absolute slopes along x and y inside the semi-diameter; infinite if there is none.
    steepest: [f64; 2],
    /// The bounds of the sag inside the semi-diameter, in mm.
    sags: Interval,
}

/// The number of cells along each side of the square in which a surface is bounded.
const CELLS: u32 = 8;
/// The number of rings in which a form of revolution is bounded.
const RINGS: u32 = 64;

/// The number of parts of a ray after which it counts as one that misses.
const MAX_PARTS: u32 = 2_000;

/// The largest number of steps of Newton's iteration.
const NEWTON_STEPS: usize = 20;

impl FreeformSearch {
    fn new(surface: Interface<f64>, form: Freeform<f64>, astigmatism: f64) -> Self {
        let base = form.base_of(surface.curvature, surface.conic, surface.terms);
        let bounds = base.map(Interval::constant);
        let (steepest, sags) = ([f64::INFINITY; 2], Interval::WHOLE);
        let mut search = Self { surface, form, astigmatism, base, bounds, steepest, sags };
        if search.is_plane() {
            search.steepest = [0.0; 2];
        } else if let Some((steepest, sags)) = search.bounds_inside(surface.rim2.sqrt()) {
            (search.steepest, search.sags) = (steepest, sags);
        }
        search
    }

    fn is_plane(&self) -> bool {
        let of_row = [self.surface.curvature, self.astigmatism].into_iter();
        let numbers: &[f64] = if self.form.kind.is_phase() { &[] } else { &self.form.numbers };
        let mut all = of_row.chain(self.surface.terms).chain(numbers.iter().copied());
        all.all(|number| number == 0.0)
    }

    fn sag(&self, x: f64, y: f64) -> [f64; 3] {
        let [z, by_x, by_y] = self.form.sag(&self.base, x, y);
        let lean = self.astigmatism * y;
        [z + lean * y, by_x, by_y + lean + lean]
    }

    fn sag_bounds(&self, x: Interval, y: Interval) -> [Interval; 3] {
        let base = self.bounds.sag(x, y);
        let series = self.form.series_sag(&self.bounds, x, y, Interval::constant);
        let q = Interval::constant(self.astigmatism);
        let lean = q * y;
        let irregular = [q * y.square(), Interval::constant(0.0), lean + lean];
        std::array::from_fn(|i| base[i] + series[i] + irregular[i])
    }

    /// The largest slopes along x and y and the bounds of the sag within a radius; `None` for an
    /// unlimited surface.
    fn bounds_inside(&self, radius: f64) -> Option<([f64; 2], Interval)> {
        if !radius.is_finite() {
            return None;
        }
        if self.form.kind.is_round() && self.form.kind != FreeformKind::OddAsphere {
            return Some(self.bounds_in_rings(radius));
        }
        let (mut steepest, mut sags) = ([0.0_f64; 2], Interval::EMPTY);
        let edge = |i: u32| radius * (2.0 * f64::from(i) / f64::from(CELLS) - 1.0);
        for cell in 0..CELLS * CELLS {
            let side = |i: u32| Interval::between(edge(i), edge(i + 1));
            let (x, y) = (side(cell % CELLS), side(cell / CELLS));
            if (x.square() + y.square()).low > radius * radius {
                continue;
            }
            let [z, by_x, by_y] = self.sag_bounds(x, y);
            if z.is_empty() {
                continue;
            }
            sags = sags.hull(z);
            for (most, slope) in steepest.iter_mut().zip([by_x, by_y]) {
                let slope = slope.magnitude();
                *most = if slope.is_nan() { f64::INFINITY } else { most.max(slope) };
            }
        }
        Some((steepest, sags))
    }

    /// As [`FreeformSearch::bounds_inside`] for a form of revolution: no slope is larger than that along
    /// the radius. Narrow rings keep the bounds of its recurrences tight.
    fn bounds_in_rings(&self, radius: f64) -> ([f64; 2], Interval) {
        let (mut steepest, mut sags) = (0.0_f64, Interval::EMPTY);
        let edge = |i: u32| radius * f64::from(i) / f64::from(RINGS);
        for ring in 0..RINGS {
            let x = Interval::between(edge(ring), edge(ring + 1));
            let y = Interval::constant(0.0);
            let (own, series) = (
                self.bounds.sag(x, y),
                self.form.series_sag(&self.bounds, x, y, Interval::constant),
            );
            let (z, slope) = (own[0] + series[0], (own[1] + series[1]).magnitude());
            if z.is_empty() {
                continue;
            }
            sags = sags.hull(z);
            steepest = if slope.is_nan() { f64::INFINITY } else { steepest.max(slope) };
        }
        let most = self.astigmatism * radius;
        let lean = Interval::between(0.0, most * radius);
        ([steepest, steepest + 2.0 * most.abs()], sags + lean)
    }

    /// The parameter along `k` of the first crossing in the sense of travel: inside the semi-diameter if
    /// there is one, else outside. `p` is any point of the ray, which starts at `p + start k`.
    fn crossing(&self, p: Vec3<f64>, k: Vec3<f64>, start: f64) -> Option<f64> {
        if let Some(s) = self.newton(p, k) {
            return Some(s);
        }
        let mut parts = PartSearch { face: self, p, k, start, budget: MAX_PARTS };
        parts.nearest_crossing().unwrap_or(None)
    }

    /// The result of Newton's iteration if no other crossing is possible.
    fn newton(&self, p: Vec3<f64>, k: Vec3<f64>) -> Option<f64> {
        let [along_x, along_y] = self.steepest;
        if !(along_x * k.x.abs() + along_y * k.y.abs() < k.z.abs()) {
            return None;
        }
        let conic = Interface { starts_far: false, ..self.surface }.intersect_conic(p, k);
        let mut s = if conic.missed { -p.z / k.z } else { conic.s };
        let tolerance = f64::EPSILON.powf(2.0 / 3.0) * (p.x.abs() + p.y.abs() + p.z.abs());
        for _ in 0..NEWTON_STEPS {
            let at = p + k * s;
            let [z, by_x, by_y] = self.sag(at.x, at.y);
            let step = (z - at.z) / (by_x * k.x + by_y * k.y - k.z);
            s -= step;
            if step * step * self.surface.n2 <= tolerance * tolerance {
                let at = p + k * s;
                let inside = at.x * at.x + at.y * at.y <= self.surface.rim2;
                return inside.then_some(s);
            }
        }
        None
    }
}

/// A search for one crossing, with the number of parts of the ray that are left to it.
struct PartSearch<'a> {
    face: &'a FreeformSearch,
    p: Vec3<f64>,
    k: Vec3<f64>,
    start: f64,
    budget: u32,
}

/// The end of a search without a decision: no part is left.
struct UndecidedPart;

/// An end of a part of the ray, with the height of the surface above it along the sense of travel.
#[derive(Clone, Copy)]
struct PartEnd {
    s: f64,
    height: f64,
}

impl PartSearch<'_> {
    /// The first crossing inside the semi-diameter, else outside.
    fn nearest_crossing(&mut self) -> Result<Option<f64>, UndecidedPart> {
        let rim = self.face.surface.rim2.sqrt();
        let (inside, outside) = if rim.is_finite() {
            ((rim, self.face.sags), 4.0 * rim)
        } else {
            let reach = self.search_radius();
            ((reach, Interval::WHOLE), 64.0 * reach)
        };
        match self.first_crossing(inside)? {
            None => self.first_crossing((outside, Interval::WHOLE)),
            found => Ok(found),
        }
    }

    /// The distance from the axis up to which an unlimited surface is searched.
    fn search_radius(&self) -> f64 {
        let (p, k) = (self.p, self.k);
        let across = k.x.hypot(k.y);
        let at_vertex_plane = if k.z == 0.0 { 0.0 } else { (p.z / k.z).abs() * across };
        let lengths = self.face.form.kind.lengths().into_iter().fold(0.0, f64::max);
        let start = p.x.hypot(p.y) + at_vertex_plane;
        let largest = start.max(p.z.abs()).max(self.start.abs() * across).max(lengths);
        4.0 * largest.max(LEAST_LENGTH)
    }

    /// The first crossing behind the start of the ray, or else the last one in front of it, within
    /// `radius` of the axis and between two heights.
    fn first_crossing(
        &mut self,
        (radius, sags): (f64, Interval),
    ) -> Result<Option<f64>, UndecidedPart> {
        let Some([low, high]) = self.part_within(radius) else { return Ok(None) };
        let [from, to] = self.part_between(sags).unwrap_or([low, high]);
        let (from, to) = (from.max(low), to.min(high));
        if !(from <= to) {
            return Ok(None);
        }
        let start = self.start.max(from).min(to);
        let [from, start, to] = [from, start, to].map(|s| self.end(s));
        match self.isolate(start, to, true)? {
            None => self.isolate(from, start, false),
            found => Ok(found),
        }
    }

    /// The part of the ray within `radius` of the axis.
    fn part_within(&self, radius: f64) -> Option<[f64; 2]> {
        let (p, k) = (self.p, self.k);
        let (r2, square) = (p.x * p.x + p.y * p.y, k.x * k.x + k.y * k.y);
        let size = (p.x.abs() + p.y.abs() + p.z.abs()) / k.dot(k).sqrt();
        if square <= PARALLEL * k.dot(k) {
            let s = (self.face.sag(p.x, p.y)[0] - p.z) / k.z;
            let width = s.abs().max(size).max(LEAST_LENGTH) * 1e-6;
            return (r2 <= radius * radius && s.is_finite()).then_some([s - width, s + width]);
        }
        let slant = p.x * k.x + p.y * k.y;
        let root = slant * slant - square * (r2 - radius * radius);
        (root >= 0.0).then(|| [(-slant - root.sqrt()) / square, (-slant + root.sqrt()) / square])
    }

    /// The part of the ray between two heights, with a margin for rounding; `None` for all of it.
    fn part_between(&self, sags: Interval) -> Option<[f64; 2]> {
        let (a, b) = ((sags.low - self.p.z) / self.k.z, (sags.high - self.p.z) / self.k.z);
        let slack = 1e-9 * (a.abs() + b.abs() + self.p.z.abs());
        slack.is_finite().then(|| [a.min(b) - slack, a.max(b) + slack])
    }

    fn height(&self, s: f64) -> (f64, f64) {
        let (at, k) = (self.p + self.k * s, self.k);
        let [z, by_x, by_y] = self.face.sag(at.x, at.y);
        (z - at.z, by_x * k.x + by_y * k.y - k.z)
    }

    fn end(&self, s: f64) -> PartEnd {
        PartEnd { s, height: self.face.surface.sense * self.height(s).0 }
    }

    /// Bounds of the height and of its derivative along a part of the ray.
    fn bounds(&self, from: f64, to: f64) -> [Interval; 2] {
        let s = Interval::between(from, to);
        let along =
            |start: f64, step: f64| Interval::constant(start) + Interval::constant(step) * s;
        let (p, k) = (self.p, self.k);
        let [z, by_x, by_y] = self.face.sag_bounds(along(p.x, k.x), along(p.y, k.y));
        let step = Interval::constant;
        [z - along(p.z, k.z), by_x * step(k.x) + by_y * step(k.y) - step(k.z)]
    }

    /// A crossing from above between two points, the first or the last one; halves parts that cannot be
    /// decided.
    fn isolate(
        &mut self,
        from: PartEnd,
        to: PartEnd,
        first: bool,
    ) -> Result<Option<f64>, UndecidedPart> {
        self.budget = self.budget.checked_sub(1).ok_or(UndecidedPart)?;
        let [height, slope] = self.bounds(from.s, to.s);
        if !height.contains(0.0) {
            return Ok(None);
        }
        let monotone = slope.magnitude().is_finite() && !slope.contains(0.0);
        let (p, k) = (self.p, self.k);
        let start = (p.x.abs() + p.y.abs() + p.z.abs()) / k.dot(k).sqrt();
        let narrow = to.s - from.s <= 1e-13 * (from.s.abs() + to.s.abs() + start);
        if monotone || narrow {
            let crosses = from.height > 0.0 && to.height <= 0.0;
            return Ok(crosses.then(|| self.solve_bracketed(from.s, to.s)));
        }
        let middle = self.end(0.5 * (from.s + to.s));
        let mut halves = [(from, middle), (middle, to)];
        if !first {
            halves.reverse();
        }
        for (from, to) in halves {
            let found = self.isolate(from, to, first)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// The crossing between two points with heights of opposite sign, by a bracketed Newton's iteration.
    fn solve_bracketed(&self, mut above: f64, mut below: f64) -> f64 {
        let mut s = 0.5 * (above + below);
        for _ in 0..200 {
            let (f, slope) = self.height(s);
            if self.face.surface.sense * f > 0.0 {
                above = s;
            } else {
                below = s;
            }
            let newton = s - f / slope;
            let inside = newton > above.min(below) && newton < above.max(below);
            let next = if inside { newton } else { 0.5 * (above + below) };
            if (next - s).abs() <= 2.0 * f64::EPSILON * s.abs() {
                return next;
            }
            s = next;
        }
        s
    }
}
