//! A tracer with its settings, and its steps.

use super::field::IndexField;
use super::integrator::IntegratorOp;
use super::setup::{GrinSetup, GrinSetupError};
use super::state::RayState;
use crate::math::Real;

/// Traces rays through one field, forwards and backwards.
#[derive(Debug)]
pub struct GrinTracer<'a, R, F: ?Sized> {
    pub(super) field: &'a F,
    pub(super) setup: GrinSetup<R>,
    pub(super) ops: Vec<IntegratorOp<R>>,
}

impl<'a, R: Real, F: IndexField<R> + ?Sized> GrinTracer<'a, R, F> {
    /// Prepares a field for tracing.
    ///
    /// # Errors
    /// A step that is not positive, no steps, or an empty region.
    pub fn new(field: &'a F, setup: GrinSetup<R>) -> Result<Self, GrinSetupError> {
        setup.check()?;
        let ops = setup.integrator.ops();
        Ok(Self { field, setup, ops })
    }

    /// One step of length `h`.
    pub(super) fn advance(&self, state: RayState<R>, h: R) -> RayState<R> {
        let RayState { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                IntegratorOp::Drift(c) => x = x + v * (c * h),
                IntegratorOp::Kick(c) => {
                    let sample = self.field.sample(x);
                    let weight = c * h * sample.index;
                    v = v + sample.gradient * weight;
                    path += weight * sample.index;
                }
            }
        }
        RayState { x, v, path }
    }

    /// One step of length `h`, and the derivative of its end with respect to `h`.
    pub(super) fn advance_with_rate(&self, state: RayState<R>, h: R) -> (RayState<R>, RayState<R>) {
        let mut rate = RayState::default();
        let RayState { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                IntegratorOp::Drift(c) => {
                    x = x + v * (c * h);
                    rate.x = rate.x + (v + rate.v * h) * c;
                }
                IntegratorOp::Kick(c) => {
                    let (sample, hessian) = self.field.sample_and_hessian(x);
                    let (index, gradient) = (sample.index, sample.gradient);
                    let weight = c * h * index;
                    v = v + gradient * weight;
                    path += weight * index;
                    let climb = gradient.dot(rate.x);
                    let turn = gradient * climb + hessian.times(rate.x) * index;
                    rate.v = rate.v + (gradient * index + turn * h) * c;
                    rate.path += c * index * (index + R::TWO * h * climb);
                }
            }
        }
        (RayState { x, v, path }, rate)
    }
}
