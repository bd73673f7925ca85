//! The gap that a gradient fills, and the steps through it.
//!
//! Drifts and kicks of [`grin`](crate::grin), all steps of the same length, the last one cut so that it
//! ends on the next surface. Each step is undone exactly on the way back, and its transpose is applied:
//! what is kept of a ray is one number a gap, as in glass, the length of σ.

use super::Ray;
use super::fate::{MISSED, TRAPPED, TURNED};
use super::interface::Interface;
use crate::grin::field::ProfileGradient;
use crate::grin::{IntegratorOp, RayState};
use crate::lens::RotationalProfile;
use crate::math::{Real, Vec3};

/// A gap filled with a gradient, ready for rays.
#[derive(Debug, Clone)]
pub(super) struct GrinGap<R> {
    pub(super) field: RotationalProfile<R>,
    pub(super) ops: Vec<IntegratorOp<R>>,
    /// The length of a step in σ, in mm over the index.
    pub(super) step: R,
    /// Steps after which a ray counts as trapped.
    pub(super) max_steps: u32,
    /// The square of the radius of the glass: of the wider of its two faces.
    pub(super) side2: R,
}

/// A ray at the end of a gap.
pub(super) struct GapExit<R> {
    pub(super) state: RayState<R>,
    /// All of σ, negative for a ray that went back.
    pub(super) length: R,
    /// The largest square of the distance from the axis on the way.
    pub(super) widest: R,
}

impl<R: Real> GrinGap<R> {
    /// One step of length `h`.
    #[inline(always)]
    pub(super) fn advance(&self, state: RayState<R>, h: R) -> RayState<R> {
        let RayState { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                IntegratorOp::Drift(c) => x = x + v * (c * h),
                IntegratorOp::Kick(c) => {
                    let here = self.field.force(x);
                    v = v + here.force * (c * h);
                    path += c * h * here.square;
                }
            }
        }
        RayState { x, v, path }
    }

    /// How fast the end of a step of length `h` moves with `h`.
    fn rate(&self, state: RayState<R>, h: R) -> RayState<R> {
        let RayState { mut x, mut v, .. } = state;
        let mut rate = RayState::default();
        for op in &self.ops {
            match *op {
                IntegratorOp::Drift(c) => {
                    x = x + v * (c * h);
                    rate.x = rate.x + (v + rate.v * h) * c;
                }
                IntegratorOp::Kick(c) => {
                    let here = self.field.force(x);
                    v = v + here.force * (c * h);
                    let climb = here.force.dot(rate.x);
                    rate.v = rate.v + (here.force + self.field.force_derivative(x, rate.x) * h) * c;
                    rate.path += c * (here.square + R::TWO * h * climb);
                }
            }
        }
        rate
    }

    /// Steps through the gap to the surface behind it. A ray that starts behind that surface, as
    /// where two surfaces cross, goes back to it.
    pub(super) fn cross(
        &self,
        surface: &Interface<R>,
        entry: Option<&Interface<R>>,
        start: RayState<R>,
    ) -> Result<GapExit<R>, (u32, RayState<R>)> {
        let gap = surface.gap;
        let back = surface.signed_height(start.x, start.v, gap).0 > R::ZERO;
        let h = if back { -self.step } else { self.step };
        let mut state = start;
        let mut widest = square_of_distance(start.x);
        for count in 0..=self.max_steps {
            let next = self.advance(state, h);
            let height = surface.signed_height(next.x, next.v, gap).0;
            let some_index = next.v.dot(next.v) > R::from_f64(MIN_INDEX2);
            if !(some_index && next.x.is_finite() && next.v.is_finite()) {
                return Err((TRAPPED, state));
            }
            let over = if back { height <= R::ZERO } else { height >= R::ZERO };
            if over {
                let last = self.last_step(surface, gap, state, h);
                let (length, end) = last.ok_or((MISSED, state))?;
                widest = self.widest_radius2(widest, state, length, end);
                let length = h * R::from_f64(f64::from(count)) + length;
                return Ok(GapExit { state: end, length, widest });
            }
            if !back && is_turned_back(entry, &next) {
                return Err((TURNED, next));
            }
            widest = self.widest_radius2(widest, state, h, next);
            state = next;
        }
        Err((TRAPPED, state))
    }

    /// The length of the last step that ends on the surface, between 0 and `h`, and its end: Newton's
    /// iteration between two lengths on either side.
    fn last_step(
        &self,
        surface: &Interface<R>,
        gap: R,
        before: RayState<R>,
        h: R,
    ) -> Option<(R, RayState<R>)> {
        let (from, _) = surface.signed_height(before.x, before.v, gap);
        let after = self.advance(before, h);
        let (to, _) = surface.signed_height(after.x, after.v, gap);
        let (mut near, mut far) = (R::ZERO, h);
        let start = from / (from - to);
        let inside = start >= R::ZERO && start <= R::ONE;
        let mut length = R::select(inside, start, R::ZERO) * h;
        let settled = self.step.value() * 4.0 * R::EPSILON;
        let half = R::from_f64(0.5);
        for _ in 0..60 {
            let end = self.advance(before, length);
            let (height, slope) = surface.signed_height(end.x, end.v, gap);
            // The same side as the start of the step.
            if (height < R::ZERO) == (from < R::ZERO) {
                near = length;
            } else {
                far = length;
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
            let (height, slope) = surface.signed_height(end.x, end.v, gap);
            length -= height / slope;
        }
        let end = self.advance(before, length);
        let (height, _) = surface.signed_height(end.x, end.v, gap);
        let size = end.x.x.abs() + end.x.y.abs() + end.x.z.abs() + self.step;
        let near = height.value().abs() <= 64.0 * R::EPSILON * size.value();
        (near && surface.exists_at(end.x)).then_some((length, end))
    }

    /// The larger of a square of the distance from the axis and the largest one on a step. Where the
    /// step has its farthest point inside and near the side of the glass, that point is looked for;
    /// the derivative of its distance does not depend on where exactly it is.
    fn widest_radius2(&self, widest: R, before: RayState<R>, h: R, after: RayState<R>) -> R {
        let end = square_of_distance(after.x);
        let widest = R::select(end > widest, end, widest);
        let (rises, falls) = (radial_rate(&before) * h, radial_rate(&after) * h);
        let peaks = rises > R::ZERO && falls < R::ZERO;
        // The tangent lies above a curve that bends down.
        let highest = square_of_distance(before.x) + R::TWO * rises;
        // The slopes of a margin are asked for where nothing clips, too.
        let far = R::ORDER == 0 && highest.value() < NEAR_SIDE * self.side2.value();
        if !peaks || far {
            return widest;
        }
        let mut share = rises / (rises - falls);
        for _ in 0..3 {
            let there = self.advance(before, h * share);
            let across = there.v.x * there.v.x + there.v.y * there.v.y;
            let force = self.field.force(there.x).force;
            let bend = across + there.x.x * force.x + there.x.y * force.y;
            let newton = share - radial_rate(&there) / (bend * h);
            let inside = newton > R::ZERO && newton < R::ONE;
            share = R::select(inside, newton, share);
        }
        let top = square_of_distance(self.advance(before, h * share).x);
        R::select(top > widest, top, widest)
    }
}

/// Where `|v|² = n²` is less than this the polynomial means no glass any more.
const MIN_INDEX2: f64 = 0.04;

/// Points of a drawn ray inside a gradient.
const DRAWN_POINTS: u32 = 24;

impl GrinGap<f64> {
    /// Points of a ray that starts behind the surface before, between its ends.
    pub(super) fn sample_points(
        &self,
        surface: &Interface<f64>,
        ray: Ray<f64>,
    ) -> impl Iterator<Item = Vec3<f64>> {
        let index = self.field.index(ray.point);
        let start = RayState { x: ray.point, v: ray.direction * index, path: 0.0 };
        let length = self.cross(surface, None, start).map_or(0.0, |crossed| crossed.length);
        let pieces = (length.abs() / self.step).ceil().clamp(1.0, 4096.0) as u32;
        let pieces = pieces.max(DRAWN_POINTS);
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
fn radial_rate<R: Real>(state: &RayState<R>) -> R {
    state.x.x * state.v.x + state.x.y * state.v.y
}

/// Whether a ray is in front of the surface by which it came, and on its way from it.
fn is_turned_back<R: Real>(entry: Option<&Interface<R>>, state: &RayState<R>) -> bool {
    entry.is_some_and(|entry| {
        let (height, rate) = entry.signed_height(state.x, state.v, R::ZERO);
        height < R::ZERO && rate < R::ZERO
    })
}

/// The derivative of something by a state.
#[derive(Debug, Clone, Copy)]
pub(super) struct StateAdjoint<R> {
    pub(super) x: Vec3<R>,
    pub(super) v: Vec3<R>,
    pub(super) path: R,
}

impl<R: Real> GrinGap<R> {
    /// The length of the last step and the number of those before it, of a ray that took `length`.
    fn steps(&self, length: R) -> (R, u32, R) {
        let h = if length < R::ZERO { -self.step } else { self.step };
        let whole = (length.value() / h.value()).floor();
        let count = if whole > 0.0 { whole as u32 } else { 0 };
        (length - h * R::from_f64(f64::from(count)), count, h)
    }

    /// How fast the end of the last step moves with its length.
    pub(super) fn final_rate(&self, end: RayState<R>, length: R) -> RayState<R> {
        let (last, _, _) = self.steps(length);
        // Undone by its negative: every list of pieces reads the same backwards.
        let before = self.advance(end, -last);
        self.rate(before, last)
    }

    /// Undoes all steps of a ray that took `length`, and takes the derivatives along.
    pub(super) fn backward(
        &self,
        end: RayState<R>,
        length: R,
        pull: StateAdjoint<R>,
        by: &mut ProfileGradient<R>,
    ) -> (RayState<R>, StateAdjoint<R>) {
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
        state: RayState<R>,
        h: R,
        pull: StateAdjoint<R>,
        by: &mut ProfileGradient<R>,
    ) -> (RayState<R>, StateAdjoint<R>) {
        let RayState { mut x, mut v, mut path } = state;
        let mut pull = pull;
        for op in self.ops.iter().rev() {
            match *op {
                IntegratorOp::Drift(c) => {
                    x = x - v * (c * h);
                    pull.v = pull.v + pull.x * (c * h);
                }
                IntegratorOp::Kick(c) => {
                    let weight = c * h;
                    let here = self.field.force(x);
                    v = v - here.force * weight;
                    path -= weight * here.square;
                    self.field.accumulate(x, pull.path * weight, pull.v * weight, by);
                    let turn =
                        self.field.force_derivative(x, pull.v) + here.force * (R::TWO * pull.path);
                    pull.x = pull.x + turn * weight;
                }
            }
        }
        (RayState { x, v, path }, pull)
    }
}
