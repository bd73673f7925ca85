//! A gap with a GRIN medium, and the steps of a ray through it.
//!
//! A ray obeys `dx/dσ = v`, `dv/dσ = n ∇n` with `|v| = n`, so that `v` is the optical direction `k` of
//! homogeneous media. Its steps are drifts and kicks of [`grin`](crate::grin). All have the same
//! length, which a plan chooses ([`plan`]), but the last one ends on the next surface. On the way back
//! each step is undone exactly and its transpose is applied ([`adjoint`]): a ray stores one number
//! per gap, as in homogeneous media, the length of σ.

mod adjoint;
mod plan;

pub(super) use adjoint::StateAdjoint;
pub use plan::GrinStepPlan;

use super::Ray;
use super::fate::{MISSED, TRAPPED, TURNED};
use super::interface::Interface;
use crate::grin::{Integrator, IntegratorOp, RayState};
use crate::lens::RotationalProfile;
use crate::math::{Real, Vec3};

/// A gap with a GRIN medium, prepared for tracing.
#[derive(Debug, Clone)]
pub(super) struct GrinGap<R> {
    pub(super) field: RotationalProfile<R>,
    pub(super) ops: Vec<IntegratorOp<R>>,
    /// The length of a step in σ, in mm over the index.
    pub(super) step: R,
    /// The number of steps after which a ray counts as trapped.
    pub(super) max_steps: u32,
    /// The square of the radius of the glass, the larger semi-diameter of its two surfaces.
    pub(super) side2: R,
}

/// A ray at the end of a gap.
pub(super) struct GapExit<R> {
    pub(super) state: RayState<R>,
    /// The length in σ, negative for a ray that goes back.
    pub(super) length: R,
    /// The largest square of the distance from the axis on the way.
    pub(super) widest: R,
}

/// The integrator of a step: the most accurate one for its number of kicks, symplectic and symmetric.
const INTEGRATOR: Integrator = Integrator::BlanesMoan;

impl<R: Real> GrinGap<R> {
    /// The same steps in a field over another number type.
    pub(super) fn with_field<S: Real>(&self, field: RotationalProfile<S>) -> GrinGap<S> {
        GrinGap {
            field,
            ops: INTEGRATOR.ops(),
            step: S::from_f64(self.step.value()),
            max_steps: self.max_steps,
            side2: S::from_f64(self.side2.value()),
        }
    }

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

    /// The derivative by `h` of the end of a step of length `h`.
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
    /// where two surfaces cross, goes back to it. The error is the code of the cause of a loss, and
    /// the last state.
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

    /// The length of the last step, which ends on the surface, between 0 and `h`, and its end, by a
    /// bracketed Newton's iteration.
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
        // Each iteration adds as many correct digits to the derivatives as `v` has.
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

    /// The larger of `widest` and the largest square of the distance from the axis on a step. A
    /// maximum inside the step is located if it is near the side of the glass; the derivative of the
    /// distance does not depend on its exact position.
    fn widest_radius2(&self, widest: R, before: RayState<R>, h: R, after: RayState<R>) -> R {
        let end = square_of_distance(after.x);
        let widest = R::select(end > widest, end, widest);
        let (rises, falls) = (radial_rate(&before) * h, radial_rate(&after) * h);
        let peaks = rises > R::ZERO && falls < R::ZERO;
        // The tangent lies above a curve that bends down.
        let highest = square_of_distance(before.x) + R::TWO * rises;
        // The derivatives of a margin are needed even if nothing clips.
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

/// The least `|v|² = n²` for which the polynomial still describes a medium.
const MIN_INDEX2: f64 = 0.04;

/// The least number of points of a drawn ray inside a GRIN medium.
const DRAWN_POINTS: u32 = 24;

impl GrinGap<f64> {
    /// Intermediate points of a ray that starts behind the surface before.
    pub(super) fn sample_points(
        &self,
        surface: &Interface<f64>,
        ray: Ray<f64>,
    ) -> impl Iterator<Item = Vec3<f64>> {
        let index = self.field.index(ray.point);
        let start = RayState { x: ray.point, v: ray.direction * index, path: 0.0 };
        let length = self.cross(surface, None, start).map_or(0.0, |exit| exit.length);
        let pieces = (length.abs() / self.step).ceil().clamp(1.0, 4096.0) as u32;
        let pieces = pieces.max(DRAWN_POINTS);
        let mut state = start;
        (1..pieces).map(move |_| {
            state = self.advance(state, length / f64::from(pieces));
            state.x
        })
    }
}

/// The part of the square of the radius of the glass below which a maximum is not located.
const NEAR_SIDE: f64 = 0.8;

/// The square of the distance from the axis.
fn square_of_distance<R: Real>(x: Vec3<R>) -> R {
    x.x * x.x + x.y * x.y
}

/// Half of the derivative of the square of the distance from the axis by σ.
fn radial_rate<R: Real>(state: &RayState<R>) -> R {
    state.x.x * state.v.x + state.x.y * state.v.y
}

/// True if a ray is in front of the surface by which it entered, and moves away from it.
fn is_turned_back<R: Real>(entry: Option<&Interface<R>>, state: &RayState<R>) -> bool {
    entry.is_some_and(|entry| {
        let (height, rate) = entry.signed_height(state.x, state.v, R::ZERO);
        height < R::ZERO && rate < R::ZERO
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{PROFILE_TERMS, ProfileCoefficients, ProfileLaw};

    /// In `n² = n₀² − a r²` a ray oscillates like a pendulum, `cos √a σ`: its largest distance is
    /// its amplitude, wherever a step begins and ends.
    #[test]
    fn the_widest_place_of_a_ray_is_that_of_a_pendulum() {
        let (amplitude, rate): (f64, f64) = (0.8, 0.3);
        let mut terms = [0.0; PROFILE_TERMS];
        terms[0] = -rate * rate;
        let coefficients = ProfileCoefficients::new(ProfileLaw::Square, terms);
        let gap = GrinGap {
            field: RotationalProfile { base: 1.6, coefficients },
            ops: INTEGRATOR.ops(),
            step: 1.0,
            max_steps: 100,
            side2: 0.7,
        };
        for [from, to] in [[-0.1_f64, 0.3], [-0.25, 0.1], [-0.2, 0.2]] {
            let x = Vec3::new(amplitude * from.cos(), 0.0, 0.0);
            let v = Vec3::new(-amplitude * rate * from.sin(), 0.0, 1.0);
            let before = RayState { x, v, path: 0.0 };
            let h = (to - from) / rate;
            let widest = gap.widest_radius2(0.0, before, h, gap.advance(before, h)).sqrt();
            assert!((widest / amplitude - 1.0).abs() < 1e-6, "{from} {to}: {widest}");
        }
    }
}
