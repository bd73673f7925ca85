//! Reverse-mode differentiation with a stored path, for comparison with the retraced one.
//!
//! It stores the position of every kick, the minimum for reverse-mode differentiation of this
//! tracer, and processes them backwards. Its memory grows with the number of steps.

use super::exit::RayExit;
use super::field::IndexField;
use super::integrator::IntegratorOp;
use super::state::{GrinRay, RayAdjoint};
use super::step::GrinTracer;
use crate::math::{Real, Vec3};

/// A gradient by a stored path, and its memory.
#[derive(Debug, Clone, PartialEq)]
pub struct TapeGradient<R> {
    /// With respect to the parameters of the field.
    pub parameters: Vec<R>,
    /// With respect to the start of each ray.
    pub starts: Vec<RayAdjoint<R>>,
    /// The largest size of the tape in bytes, with all rays in flight at once.
    pub bytes: usize,
}

impl<R: Real, F: IndexField<R> + ?Sized> GrinTracer<'_, R, F> {
    /// The same as [`Self::gradient`], but with every ray's path stored first, on one thread.
    ///
    /// # Panics
    /// If there is not one exit and one adjoint for each ray.
    pub fn tape_gradient(
        &self,
        rays: &[GrinRay<R>],
        exits: &[RayExit<R>],
        seeds: &[RayAdjoint<R>],
    ) -> TapeGradient<R> {
        assert!(rays.len() == exits.len() && rays.len() == seeds.len(), "one exit and seed a ray");
        let tapes: Vec<_> =
            rays.iter().zip(exits).map(|(ray, exit)| self.record_tape(ray, exit)).collect();
        let stored: usize = tapes.iter().map(Vec::len).sum();
        let mut parameters = vec![R::ZERO; self.field.parameters().len()];
        let mut starts = vec![RayAdjoint::default(); rays.len()];
        for (i, tape) in tapes.into_iter().enumerate() {
            if exits[i].fate.has_arrived() {
                let seed = self.exit_adjoint(&exits[i], seeds[i]);
                let inside = self.backpropagate(tape, &exits[i], seed, &mut parameters);
                if let Ok(entry) = self.enter(&rays[i]) {
                    starts[i] = self.enter_adjoint(&rays[i], &entry, inside, &mut parameters);
                }
            }
        }
        TapeGradient { parameters, starts, bytes: stored * size_of::<Vec3<R>>() }
    }

    /// The lengths of the steps of a ray.
    fn step_lengths<'a>(&'a self, exit: &'a RayExit<R>) -> impl DoubleEndedIterator<Item = R> + 'a {
        let length = |n| if n == exit.steps { exit.record.last } else { self.setup.step };
        (1..=exit.steps).map(length)
    }

    /// The positions of all kicks.
    fn record_tape(&self, ray: &GrinRay<R>, exit: &RayExit<R>) -> Vec<Vec3<R>> {
        let mut tape = Vec::new();
        let Ok(entry) = self.enter(ray) else { return tape };
        let (mut x, mut v) = (entry.state.x, entry.state.v);
        for h in self.step_lengths(exit) {
            for op in &self.ops {
                match *op {
                    IntegratorOp::Drift(c) => x = x + v * (c * h),
                    IntegratorOp::Kick(c) => {
                        tape.push(x);
                        let sample = self.field.sample(x);
                        v = v + sample.gradient * (c * h * sample.index);
                    }
                }
            }
        }
        tape
    }

    /// The adjoint of all steps.
    fn backpropagate(
        &self,
        mut tape: Vec<Vec3<R>>,
        exit: &RayExit<R>,
        mut seed: RayAdjoint<R>,
        gradient: &mut [R],
    ) -> RayAdjoint<R> {
        for h in self.step_lengths(exit).rev() {
            for op in self.ops.iter().rev() {
                match *op {
                    IntegratorOp::Drift(c) => seed.v = seed.v + seed.x * (c * h),
                    IntegratorOp::Kick(c) => {
                        let x = tape.pop().unwrap_or_default();
                        self.kick_adjoint(x, c * h, &mut seed, gradient);
                    }
                }
            }
        }
        seed
    }

    /// The adjoint of one kick over `step`.
    fn kick_adjoint(&self, x: Vec3<R>, step: R, seed: &mut RayAdjoint<R>, gradient: &mut [R]) {
        let (sample, hessian) = self.field.sample_and_hessian(x);
        let (index, g) = (sample.index, sample.gradient);
        let by_index = step * (seed.v.dot(g) + R::TWO * seed.path * index);
        let force = step * index;
        self.field.accumulate(x, by_index, seed.v * force, gradient);
        seed.x = seed.x + g * by_index + hessian.times(seed.v) * force;
    }
}
