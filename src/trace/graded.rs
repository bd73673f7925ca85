//! Light in a gap that a gradient fills.
//!
//! A ray is refracted into the gap by the index at the very point, then moved by the steps of
//! [`grin`](crate::grin): `dx/dσ = v`, `dv/dσ = n ∇n` with `|v| = n`, so that `v` is what elsewhere
//! is called the optical direction `k`. The last step is cut so that it ends on the next surface, and
//! the index there refracts it. Each step is undone exactly on the way back, and its transpose is
//! applied: what is kept of a ray is one number a gap, as in glass, the length of σ.
//!
//! The steps of a gap all have the same length, which a plan chooses (see [`super::step`]).

use super::fate::{CLIPPED, MISSED, TOTAL_REFLECTION, TRAPPED, TURNED};
use super::interface::{Crossing, Form, Interface, Meeting};
use super::{Ray, Tracer};
use crate::grin::field::GradeSlopes;
use crate::grin::{Op, State};
use crate::lens::Graded;
use crate::math::{Real, Vec3};

/// A gap filled with a gradient, ready for rays.
#[derive(Debug, Clone)]
pub(super) struct Gap<R> {
    pub(super) field: Graded<R>,
    pub(super) ops: Vec<Op<R>>,
    /// The length of a step in σ, in mm over the index.
    pub(super) step: R,
    /// Steps after which a ray counts as trapped.
    pub(super) limit: u32,
    /// The square of the radius of the glass: of the wider of its two faces.
    pub(super) side2: R,
}

/// A ray that has come to a surface, or is lost on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival<R> {
    /// The surface, with the indices at the place where it is met.
    pub(super) surface: Interface<R>,
    pub(super) met: Meeting<R>,
    /// The optical direction in front of the surface.
    pub(super) k: Vec3<R>,
    /// The optical path from the surface before.
    pub(super) path: R,
    /// Why it does not arrive, if it does not.
    pub(super) lost: Option<u32>,
    /// In a gradient, by how much the square of its distance from the axis stays below that of the
    /// side of the glass.
    pub(super) side: Option<R>,
}

impl<R: Real> Arrival<R> {
    /// Clips at the rim and refracts.
    pub(super) fn go_on(&self) -> Crossing<R> {
        let crossing = self.surface.go_on(self.met, self.k);
        Crossing { clipped: crossing.clipped || self.surface.obstructs(self.met.point), ..crossing }
    }

    /// The first thing that goes wrong.
    pub(super) fn cause(&self, crossing: &Crossing<R>) -> Option<u32> {
        let at_surface = if crossing.clipped {
            Some(CLIPPED)
        } else {
            crossing.reflected.then_some(TOTAL_REFLECTION)
        };
        self.lost.or(at_surface)
    }

    /// Where a ray stands that came from `p` and misses the surface, in the frame of the surface:
    /// where the gradient leaves it, or in glass where it was before.
    pub(super) fn stand(&self, p: Vec3<R>) -> Vec3<R> {
        match self.lost {
            Some(MISSED) | None => Vec3::new(p.x, p.y, p.z - self.surface.gap),
            Some(_) => self.met.point,
        }
    }
}

/// A ray at the end of a gap.
struct Crossed<R> {
    state: State<R>,
    /// All of σ, negative for a ray that went back.
    length: R,
    /// The largest square of the distance from the axis on the way.
    widest: R,
}

impl<R: Real> Tracer<R> {
    /// The gradient in front of a surface.
    pub(super) fn gap_before(&self, surface: usize) -> Option<&Gap<R>> {
        self.gap_behind(surface.checked_sub(1)?)
    }

    /// The gradient behind a surface.
    pub(super) fn gap_behind(&self, surface: usize) -> Option<&Gap<R>> {
        self.gaps.get(surface)?.as_ref()
    }

    /// Whether a gradient touches a surface.
    #[inline(always)]
    pub(super) fn touches_gradient(&self, surface: usize) -> bool {
        !self.gaps.is_empty()
            && (self.gap_before(surface).is_some() || self.gap_behind(surface).is_some())
    }

    /// Brings a ray from the frame of the surface before to a surface.
    pub(super) fn arrive_at(&self, i: usize, p: Vec3<R>, k: Vec3<R>) -> Arrival<R> {
        let surface = &self.interfaces[i];
        let start = Vec3::new(p.x, p.y, p.z - surface.gap);
        let Some(gap) = self.gap_before(i) else {
            let met = surface.meeting(start, k);
            let lost = met.missed.then_some(MISSED);
            let (surface, path) = (self.local(i, met.point), met.s * surface.n2);
            return Arrival { surface, met, k, path, lost, side: None };
        };
        let entry = i.checked_sub(1).map(|before| &self.interfaces[before]);
        match gap.cross(surface, entry, State { x: p, v: k, path: R::ZERO }) {
            Ok(crossed) => {
                let State { x, v, path } = crossed.state;
                let point = Vec3::new(x.x, x.y, x.z - surface.gap);
                let met = surface.meeting_at(point, v, crossed.length);
                let side = gap.side2 - crossed.widest;
                let lost = if side < R::ZERO { Some(CLIPPED) } else { None };
                let lost = if met.missed { Some(MISSED) } else { lost };
                Arrival { surface: self.local(i, point), met, k: v, path, lost, side: Some(side) }
            }
            Err((cause, state)) => {
                let point = Vec3::new(state.x.x, state.x.y, state.x.z - surface.gap);
                let met = surface.meeting_at(point, state.v, R::ZERO);
                let met = Meeting { missed: true, ..met };
                let (k, path) = (state.v, state.path);
                Arrival { surface: *surface, met, k, path, lost: Some(cause), side: None }
            }
        }
    }

    /// A surface with the indices at one of its points.
    pub(super) fn local(&self, i: usize, point: Vec3<R>) -> Interface<R> {
        let surface = self.interfaces[i];
        if !self.touches_gradient(i) {
            return surface;
        }
        let there = Vec3::new(point.x, point.y, point.z + surface.gap);
        let before2 = self.gap_before(i).map_or(surface.n2, |gap| gap.field.force(there).square);
        let behind2 = match self.gap_behind(i) {
            Some(gap) => gap.field.force(point).square,
            None => surface.index_behind * surface.index_behind,
        };
        Interface {
            index_before: before2.sqrt(),
            n2: before2,
            index_behind: behind2.sqrt(),
            dn2: behind2 - before2,
            ..surface
        }
    }
}

impl<R: Real> Interface<R> {
    /// The meeting at a point that lies on the surface.
    fn meeting_at(&self, point: Vec3<R>, k: Vec3<R>, s: R) -> Meeting<R> {
        let slope = -(self.steepness(point) * R::TWO);
        let normal = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Meeting { point, s, normal, a, m: normal.dot(normal), missed }
    }

    /// `dz/dr²` at a point.
    fn steepness(&self, point: Vec3<R>) -> R {
        if self.form == Form::Plane {
            return R::ZERO;
        }
        self.sag(point.x * point.x + point.y * point.y).1
    }

    /// How far a point lies behind the surface along the sense of travel, and how fast that grows
    /// along `v`. The point is in the frame of the surface before, from which this one is `gap` away.
    fn passed_by(&self, x: Vec3<R>, v: Vec3<R>, gap: R) -> (R, R) {
        let z = x.z - gap;
        if self.form == Form::Plane {
            return (self.sense * z, self.sense * v.z);
        }
        let (sag, steep) = self.sag(x.x * x.x + x.y * x.y);
        let along = (x.x * v.x + x.y * v.y) * steep;
        (self.sense * (z - sag), self.sense * (v.z - along - along))
    }

    /// Whether the conic exists so far from the axis.
    fn exists_at(&self, x: Vec3<R>) -> bool {
        let r2 = x.x * x.x + x.y * x.y;
        (R::ONE + self.conic) * self.curvature * self.curvature * r2 < R::ONE
    }
}

impl<R: Real> Gap<R> {
    /// One step of length `h`.
    #[inline(always)]
    pub(super) fn advance(&self, state: State<R>, h: R) -> State<R> {
        let State { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                Op::Drift(c) => x = x + v * (c * h),
                Op::Kick(c) => {
                    let here = self.field.force(x);
                    v = v + here.force * (c * h);
                    path += c * h * here.square;
                }
            }
        }
        State { x, v, path }
    }

    /// How fast the end of a step of length `h` moves with `h`.
    fn rate(&self, state: State<R>, h: R) -> State<R> {
        let State { mut x, mut v, .. } = state;
        let mut rate = State::default();
        for op in &self.ops {
            match *op {
                Op::Drift(c) => {
                    x = x + v * (c * h);
                    rate.x = rate.x + (v + rate.v * h) * c;
                }
                Op::Kick(c) => {
                    let here = self.field.force(x);
                    v = v + here.force * (c * h);
                    let climb = here.force.dot(rate.x);
                    rate.v = rate.v + (here.force + self.field.bend(x, rate.x) * h) * c;
                    rate.path += c * (here.square + R::TWO * h * climb);
                }
            }
        }
        rate
    }

    /// Steps through the gap to the surface behind it. A ray that starts behind that surface, as
    /// where two surfaces cross, goes back to it.
    fn cross(
        &self,
        surface: &Interface<R>,
        entry: Option<&Interface<R>>,
        start: State<R>,
    ) -> Result<Crossed<R>, (u32, State<R>)> {
        let gap = surface.gap;
        let back = surface.passed_by(start.x, start.v, gap).0 > R::ZERO;
        let h = if back { -self.step } else { self.step };
        let mut state = start;
        let mut widest = square_of_distance(start.x);
        for count in 0..=self.limit {
            let next = self.advance(state, h);
            let height = surface.passed_by(next.x, next.v, gap).0;
            let some_index = next.v.dot(next.v) > R::from_f64(LEAST_SQUARE);
            if !(some_index && next.x.is_finite() && next.v.is_finite()) {
                return Err((TRAPPED, state));
            }
            let over = if back { height <= R::ZERO } else { height >= R::ZERO };
            if over {
                let last = self.cut(surface, gap, state, h);
                let (length, end) = last.ok_or((MISSED, state))?;
                widest = self.wider(widest, state, length, end);
                let length = h * R::from_f64(f64::from(count)) + length;
                return Ok(Crossed { state: end, length, widest });
            }
            if !back && is_turned(entry, &next) {
                return Err((TURNED, next));
            }
            widest = self.wider(widest, state, h, next);
            state = next;
        }
        Err((TRAPPED, state))
    }

    /// The length of the last step that ends on the surface, between 0 and `h`, and its end: Newton's
    /// iteration between two lengths on either side.
    fn cut(&self, surface: &Interface<R>, gap: R, before: State<R>, h: R) -> Option<(R, State<R>)> {
        let (from, _) = surface.passed_by(before.x, before.v, gap);
        let after = self.advance(before, h);
        let (to, _) = surface.passed_by(after.x, after.v, gap);
        let (mut near, mut far) = (R::ZERO, h);
        let start = from / (from - to);
        let inside = start >= R::ZERO && start <= R::ONE;
        let mut length = R::select(inside, start, R::ZERO) * h;
        let settled = self.step.value() * 4.0 * R::EPSILON;
        let half = R::from_f64(0.5);
        for _ in 0..60 {
            let end = self.advance(before, length);
            let (height, slope) = surface.passed_by(end.x, end.v, gap);
            // The same side as the start of the step.
            if (height < R::ZERO) == (from < R::ZERO) {
                near = length
            } else {
                far = length
            }
            let newton = length - height / slope;
            let between = if h > R::ZERO {
                newton >= near && newton <= far
            } else {
                newton <= near && newton >= far
            };
            let next = R::select(between, newton, (near + far) * half);
            let change = (next - length).value().abs();
            length = next;
            if change <= settled {
                break;
            }
        }
        // The derivatives that a number carries settle by as many digits a step as the velocity is
        // good for.
        for _ in 0..2 * R::ORDER {
            let end = self.advance(before, length);
            let (height, slope) = surface.passed_by(end.x, end.v, gap);
            length -= height / slope;
        }
        let end = self.advance(before, length);
        let (height, _) = surface.passed_by(end.x, end.v, gap);
        let size = end.x.x.abs() + end.x.y.abs() + end.x.z.abs() + self.step;
        let near = height.value().abs() <= 64.0 * R::EPSILON * size.value();
        (near && surface.exists_at(end.x)).then_some((length, end))
    }

    /// The larger of a square of the distance from the axis and the largest one on a step. Where the
    /// step has its farthest point inside and near the side of the glass, that point is looked for;
    /// the derivative of its distance does not depend on where exactly it is.
    fn wider(&self, widest: R, before: State<R>, h: R, after: State<R>) -> R {
        let end = square_of_distance(after.x);
        let widest = R::select(end > widest, end, widest);
        let (rises, falls) = (outwards(&before) * h, outwards(&after) * h);
        let peaks = rises > R::ZERO && falls < R::ZERO;
        // The tangent lies above a curve that bends down.
        let highest = square_of_distance(before.x) + R::TWO * rises;
        if !peaks || highest.value() < NEAR_SIDE * self.side2.value() {
            return widest;
        }
        let mut share = rises / (rises - falls);
        for _ in 0..3 {
            let there = self.advance(before, h * share);
            let across = there.v.x * there.v.x + there.v.y * there.v.y;
            let force = self.field.force(there.x).force;
            let bend = across + there.x.x * force.x + there.x.y * force.y;
            let newton = share - outwards(&there) / (bend * h);
            let inside = newton > R::ZERO && newton < R::ONE;
            share = R::select(inside, newton, share);
        }
        let top = square_of_distance(self.advance(before, h * share).x);
        R::select(top > widest, top, widest)
    }
}

/// Where `|v|² = n²` is less than this the polynomial means no glass any more.
const LEAST_SQUARE: f64 = 0.04;

/// Points of a drawn ray inside a gradient.
const DRAWN: u32 = 24;

impl Gap<f64> {
    /// Points of a ray that starts behind the surface before, between its ends.
    pub(super) fn between(
        &self,
        surface: &Interface<f64>,
        ray: Ray<f64>,
    ) -> impl Iterator<Item = Vec3<f64>> {
        let index = self.field.index(ray.point);
        let start = State { x: ray.point, v: ray.direction * index, path: 0.0 };
        let length = self.cross(surface, None, start).map_or(0.0, |crossed| crossed.length);
        let pieces = (length.abs() / self.step).ceil().clamp(1.0, 4096.0) as u32;
        let pieces = pieces.max(DRAWN);
        let mut state = start;
        (1..pieces).map(move |_| {
            state = self.advance(state, length / f64::from(pieces));
            state.x
        })
    }
}

/// Rays that stay below this part of the square of the radius of the glass are not looked at more
/// closely.
const NEAR_SIDE: f64 = 0.8;

fn square_of_distance<R: Real>(x: Vec3<R>) -> R {
    x.x * x.x + x.y * x.y
}

/// Half of how fast the square of the distance from the axis grows.
fn outwards<R: Real>(state: &State<R>) -> R {
    state.x.x * state.v.x + state.x.y * state.v.y
}

/// Whether a ray is in front of the surface by which it came, and on its way from it.
fn is_turned<R: Real>(entry: Option<&Interface<R>>, state: &State<R>) -> bool {
    entry.is_some_and(|entry| {
        let (height, rate) = entry.passed_by(state.x, state.v, R::ZERO);
        height < R::ZERO && rate < R::ZERO
    })
}

/// The derivative of something by a state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull<R> {
    pub(super) x: Vec3<R>,
    pub(super) v: Vec3<R>,
    pub(super) path: R,
}

impl<R: Real> Gap<R> {
    /// The length of the last step and the number of those before it, of a ray that took `length`.
    fn steps(&self, length: R) -> (R, u32, R) {
        let h = if length < R::ZERO { -self.step } else { self.step };
        let whole = (length.value() / h.value()).floor();
        let count = if whole > 0.0 { whole as u32 } else { 0 };
        (length - h * R::from_f64(f64::from(count)), count, h)
    }

    /// How fast the end of the last step moves with its length.
    pub(super) fn final_rate(&self, end: State<R>, length: R) -> State<R> {
        let (last, _, _) = self.steps(length);
        // Undone by its negative: every list of pieces reads the same backwards.
        let before = self.advance(end, -last);
        self.rate(before, last)
    }

    /// Undoes all steps of a ray that took `length`, and takes the derivatives along.
    pub(super) fn go_back(
        &self,
        end: State<R>,
        length: R,
        pull: Pull<R>,
        by: &mut GradeSlopes<R>,
    ) -> (State<R>, Pull<R>) {
        let (last, count, h) = self.steps(length);
        let (mut state, mut pull) = self.undo(end, last, pull, by);
        for _ in 0..count {
            (state, pull) = self.undo(state, h, pull, by);
        }
        (state, pull)
    }

    /// Undoes one step and applies its transpose.
    fn undo(
        &self,
        state: State<R>,
        h: R,
        pull: Pull<R>,
        by: &mut GradeSlopes<R>,
    ) -> (State<R>, Pull<R>) {
        let State { mut x, mut v, mut path } = state;
        let mut pull = pull;
        for op in self.ops.iter().rev() {
            match *op {
                Op::Drift(c) => {
                    x = x - v * (c * h);
                    pull.v = pull.v + pull.x * (c * h);
                }
                Op::Kick(c) => {
                    let weight = c * h;
                    let here = self.field.force(x);
                    v = v - here.force * weight;
                    path -= weight * here.square;
                    self.field.deposit(x, pull.path * weight, pull.v * weight, by);
                    let turn = self.field.bend(x, pull.v) + here.force * (R::TWO * pull.path);
                    pull.x = pull.x + turn * weight;
                }
            }
        }
        (State { x, v, path }, pull)
    }
}
