//! Gradients of a loss on the exits of many rays, with respect to the parameters of the field and
//! to the starts.
//!
//! Rays are split into a number of parts that depends on the problem alone, never on the threads.
//! Each part has its own gradient, and they are added in order: the same bits on any number of
//! threads.

use super::adjoint::{Chunk, RetraceResult};
use super::exit::RayExit;
use super::fate::{GrinFate, GrinFateCounts};
use super::field::IndexField;
use super::lanes::LANES;
use super::state::{GrinRay, RayAdjoint};
use super::step::GrinTracer;
use crate::math::Real;
use rayon::prelude::*;

/// The largest number of private gradients in memory at a time.
const PARTS: usize = 16;
/// A private gradient is worth clearing and adding from this many parameters per ray on.
const PARAMETERS_PER_RAY: usize = 64;
/// The same for the second private gradient, which halves the time on two threads.
const PARAMETERS_PER_RAY_OF_TWO: usize = 512;
/// Parameters that one task adds.
const STRIP: usize = 4096;

/// The gradient of a loss, by the adjoint method.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjointGradient<R> {
    /// With respect to the parameters of the field.
    pub parameters: Vec<R>,
    /// With respect to the start of each ray; zero for a ray that has no gradient.
    pub starts: Vec<RayAdjoint<R>>,
    /// The largest distance between a start and the end of its retraced ray, in steps, of the rays
    /// with a gradient: rounding, unless the light is chaotic.
    pub retrace_error: f64,
}

/// A loss with its gradient.
#[derive(Debug, Clone, PartialEq)]
pub struct LossAndGradient<R> {
    /// The sum over all rays.
    pub loss: R,
    /// The gradient of the sum.
    pub gradient: AdjointGradient<R>,
    /// The exit of each ray.
    pub exits: Vec<RayExit<R>>,
    /// The number of rays with each fate.
    pub fates: GrinFateCounts,
}

impl<R: Real, F: IndexField<R> + ?Sized> GrinTracer<'_, R, F> {
    /// The sum of `loss` over rays, with its gradient.
    ///
    /// `loss` receives the number of the ray and its exit, and returns the loss and its derivative
    /// with respect to the exit. It is called for every ray, also for one that did not arrive,
    /// whose derivative is ignored: a constant loss for those keeps an optimizer from driving rays
    /// away. If retracing shows that a ray is chaotic, `loss` is called again with
    /// [`GrinFate::Chaotic`].
    pub fn loss_and_gradient(
        &self,
        rays: &[GrinRay<R>],
        loss: impl Fn(usize, &RayExit<R>) -> (R, RayAdjoint<R>) + Sync,
    ) -> LossAndGradient<R> {
        let mut exits = self.trace_batch(rays);
        let indexed = exits.par_iter().enumerate();
        let (mut losses, seeds): (Vec<R>, Vec<RayAdjoint<R>>) =
            indexed.map(|(i, exit)| loss(i, exit)).unzip();
        let before: Vec<GrinFate> = exits.iter().map(|exit| exit.fate).collect();
        let gradient = self.gradient(rays, &mut exits, &seeds);
        for (i, exit) in exits.iter().enumerate() {
            if exit.fate != before[i] {
                losses[i] = loss(i, exit).0;
            }
        }
        let mut sum = R::ZERO;
        losses.into_iter().for_each(|loss| sum += loss);
        let fates = exits.iter().map(|exit| exit.fate).collect();
        LossAndGradient { loss: sum, gradient, exits, fates }
    }

    /// The gradient of a loss whose derivatives with respect to the exits are known: the second
    /// pass after [`Self::trace_batch`] with the same rays. A ray that turns out to have no
    /// gradient when it is retraced gets its new fate and contributes nothing.
    ///
    /// # Panics
    /// If there is not one exit and one seed for each ray.
    pub fn gradient(
        &self,
        rays: &[GrinRay<R>],
        exits: &mut [RayExit<R>],
        seeds: &[RayAdjoint<R>],
    ) -> AdjointGradient<R> {
        assert!(rays.len() == exits.len() && rays.len() == seeds.len(), "one exit and seed a ray");
        let mut starts = vec![RayAdjoint::default(); rays.len()];
        let size = self.rays_per_part(rays.len());
        let parts: Vec<(Vec<R>, f64)> = rays
            .par_chunks(size)
            .zip(exits.par_chunks_mut(size))
            .zip(seeds.par_chunks(size).zip(starts.par_chunks_mut(size)))
            .map(|((rays, exits), (seeds, starts))| {
                self.gradient_of_part(&mut Chunk { rays, exits, seeds, starts })
            })
            .collect();
        let retrace_error = parts.iter().fold(0.0, |worst: f64, part| worst.max(part.1));
        let mut parts = parts.into_iter().map(|part| part.0);
        let zero = || vec![R::ZERO; self.field.parameters().len()];
        let mut parameters = parts.next().unwrap_or_else(zero);
        parts.for_each(|part| add(&mut parameters, &part));
        AdjointGradient { parameters, starts, retrace_error }
    }

    /// The gradient of one part of the rays. A chaotic ray is detected when it is retraced, after
    /// it has already contributed invalid terms: the part is then repeated without it.
    fn gradient_of_part(&self, chunk: &mut Chunk<'_, R>) -> (Vec<R>, f64) {
        loop {
            let mut parameters = vec![R::ZERO; self.field.parameters().len()];
            let RetraceResult { largest_error: worst, lost_rays: lost } =
                self.retrace(chunk, &mut parameters);
            if lost == 0 {
                return (parameters, worst);
            }
        }
    }

    /// The memory in bytes that [`Self::gradient`] needs: for the rays, and for the private
    /// gradients. Neither depends on the number of steps.
    pub fn gradient_bytes(&self, rays: usize) -> [usize; 2] {
        let each =
            size_of::<GrinRay<R>>() + size_of::<RayExit<R>>() + 2 * size_of::<RayAdjoint<R>>();
        let parts = rays.div_ceil(self.rays_per_part(rays));
        [rays * each, parts * self.field.parameters().len() * size_of::<R>()]
    }

    /// The number of rays that share a private gradient.
    fn rays_per_part(&self, rays: usize) -> usize {
        let parameters = self.field.parameters().len().max(1);
        let two = 1 + usize::from(rays * PARAMETERS_PER_RAY_OF_TWO >= parameters);
        let worth = rays * PARAMETERS_PER_RAY / parameters;
        let parts = worth.clamp(two, PARTS).min(rays.div_ceil(LANES)).max(1);
        rays.div_ceil(parts).max(1)
    }
}

fn add<R: Real>(sum: &mut [R], part: &[R]) {
    sum.par_chunks_mut(STRIP).zip(part.par_chunks(STRIP)).for_each(|(sum, part)| {
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += *part);
    });
}
