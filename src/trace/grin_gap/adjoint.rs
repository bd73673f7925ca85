//! The adjoint of a GRIN gap: its steps are undone one by one, and their transposes applied.

use super::GrinGap;
use crate::grin::field::ProfileGradient;
use crate::grin::{IntegratorOp, RayState};
use crate::math::{Real, Vec3};

/// The derivatives of a result by a state.
#[derive(Debug, Clone, Copy)]
pub(in crate::trace) struct StateAdjoint<R> {
    pub(in crate::trace) x: Vec3<R>,
    pub(in crate::trace) v: Vec3<R>,
    pub(in crate::trace) path: R,
}

impl<R: Real> GrinGap<R> {
    /// The length of the last step, the number of the steps before and their length, for a ray of
    /// length `length` in σ.
    fn steps(&self, length: R) -> (R, u32, R) {
        let h = if length < R::ZERO { -self.step } else { self.step };
        let whole = (length.value() / h.value()).floor();
        let count = if whole > 0.0 { whole as u32 } else { 0 };
        (length - h * R::from_f64(f64::from(count)), count, h)
    }

    /// The derivative of the end of the last step by its length.
    pub(in crate::trace) fn final_rate(&self, end: RayState<R>, length: R) -> RayState<R> {
        let (last, _, _) = self.steps(length);
        // The negative step undoes it, because the integrator is symmetric.
        let before = self.advance(end, -last);
        self.rate(before, last)
    }

    /// Undoes all steps of a ray of length `length` in σ, and the derivatives along with it.
    pub(in crate::trace) fn backward(
        &self,
        end: RayState<R>,
        length: R,
        adjoint: StateAdjoint<R>,
        by: &mut ProfileGradient<R>,
    ) -> (RayState<R>, StateAdjoint<R>) {
        let (last, count, h) = self.steps(length);
        let (mut state, mut adjoint) = self.undo(end, last, adjoint, by);
        for _ in 0..count {
            (state, adjoint) = self.undo(state, h, adjoint, by);
        }
        (state, adjoint)
    }

    /// Undoes one step and applies its transpose.
    fn undo(
        &self,
        state: RayState<R>,
        h: R,
        adjoint: StateAdjoint<R>,
        by: &mut ProfileGradient<R>,
    ) -> (RayState<R>, StateAdjoint<R>) {
        let RayState { mut x, mut v, mut path } = state;
        let mut adjoint = adjoint;
        for op in self.ops.iter().rev() {
            match *op {
                IntegratorOp::Drift(c) => {
                    x = x - v * (c * h);
                    adjoint.v = adjoint.v + adjoint.x * (c * h);
                }
                IntegratorOp::Kick(c) => {
                    let weight = c * h;
                    let here = self.field.force(x);
                    v = v - here.force * weight;
                    path -= weight * here.square;
                    self.field.accumulate(x, adjoint.path * weight, adjoint.v * weight, by);
                    let by_x = self.field.force_derivative(x, adjoint.v)
                        + here.force * (R::TWO * adjoint.path);
                    adjoint.x = adjoint.x + by_x * weight;
                }
            }
        }
        (RayState { x, v, path }, adjoint)
    }
}
