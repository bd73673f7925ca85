//! Reverse mode with a stored path, for comparison with the retraced one.
//!
//! It keeps the position of every kick, the least that reverse-mode differentiation of this tracer
//! can do with, and walks them backwards. Its memory grows with the number of steps.

use super::adjoint::Seed;
use super::exit::Exit;
use super::field::Field;
use super::integrator::Op;
use super::tracer::{Ray, Tracer};
use crate::math::Real;
use crate::math::Vec3;

/// A gradient by a stored path, and what that took.
#[derive(Debug, Clone, PartialEq)]
pub struct Taped<R> {
    /// By the parameters of the field.
    pub parameters: Vec<R>,
    /// By the start of each ray.
    pub starts: Vec<Seed<R>>,
    /// The largest number of bytes on the tape at a time, all rays being on their way at once.
    pub bytes: usize,
}

impl<R: Real, F: Field<R> + ?Sized> Tracer<'_, R, F> {
    /// What [`Self::gradient`] gives, with every ray's path stored first, on one thread.
    ///
    /// # Panics
    /// If there is not one exit and one seed for each ray.
    pub fn taped_gradient(
        &self,
        rays: &[Ray<R>],
        exits: &[Exit<R>],
        seeds: &[Seed<R>],
    ) -> Taped<R> {
        assert!(rays.len() == exits.len() && rays.len() == seeds.len(), "one exit and seed a ray");
        let tapes: Vec<_> =
            rays.iter().zip(exits).map(|(ray, exit)| self.tape(ray, exit)).collect();
        let stored: usize = tapes.iter().map(Vec::len).sum();
        let mut parameters = vec![R::ZERO; self.field.parameters().len()];
        let mut starts = vec![Seed::default(); rays.len()];
        for (i, tape) in tapes.into_iter().enumerate() {
            if exits[i].fate.arrived() {
                let seed = self.leave_back(&exits[i], seeds[i]);
                let inside = self.play_back(tape, &exits[i], seed, &mut parameters);
                if let Ok(entry) = self.enter(&rays[i]) {
                    starts[i] = self.enter_back(&rays[i], &entry, inside, &mut parameters);
                }
            }
        }
        Taped { parameters, starts, bytes: stored * size_of::<Vec3<R>>() }
    }

    /// The lengths of the steps of a ray.
    fn lengths<'a>(&'a self, exit: &'a Exit<R>) -> impl DoubleEndedIterator<Item = R> + 'a {
        let length = |n| if n == exit.steps { exit.landing.last } else { self.setup.step };
        (1..=exit.steps).map(length)
    }

    /// The positions of all kicks.
    fn tape(&self, ray: &Ray<R>, exit: &Exit<R>) -> Vec<Vec3<R>> {
        let mut tape = Vec::new();
        let Ok(entry) = self.enter(ray) else { return tape };
        let (mut x, mut v) = (entry.state.x, entry.state.v);
        for h in self.lengths(exit) {
            for op in &self.ops {
                match *op {
                    Op::Drift(c) => x = x + v * (c * h),
                    Op::Kick(c) => {
                        tape.push(x);
                        let sample = self.field.sample(x);
                        v = v + sample.gradient * (c * h * sample.index);
                    }
                }
            }
        }
        tape
    }

    /// The transpose of all steps.
    fn play_back(
        &self,
        mut tape: Vec<Vec3<R>>,
        exit: &Exit<R>,
        mut seed: Seed<R>,
        gradient: &mut [R],
    ) -> Seed<R> {
        for h in self.lengths(exit).rev() {
            for op in self.ops.iter().rev() {
                match *op {
                    Op::Drift(c) => seed.v = seed.v + seed.x * (c * h),
                    Op::Kick(c) => {
                        let x = tape.pop().unwrap_or_default();
                        self.kick_back(x, c * h, &mut seed, gradient);
                    }
                }
            }
        }
        seed
    }

    /// The transpose of one kick over `step`.
    fn kick_back(&self, x: Vec3<R>, step: R, seed: &mut Seed<R>, gradient: &mut [R]) {
        let (sample, hessian) = self.field.sample_and_hessian(x);
        let (index, g) = (sample.index, sample.gradient);
        let by_index = step * (seed.v.dot(g) + R::TWO * seed.path * index);
        let force = step * index;
        self.field.deposit(x, by_index, seed.v * force, gradient);
        seed.x = seed.x + g * by_index + hessian.times(seed.v) * force;
    }
}
