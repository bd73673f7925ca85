//! Rays backwards: the exact transpose of the discrete ray map, without a stored path.
//!
//! From `λ = ∂C/∂x`, `μ = ∂C/∂v` at the end, each drift and kick is undone in turn:
//!
//! ```text
//! drift:  x -= c h v            μ += c h λ
//! kick:   v -= c h η ∇η         θ̄ += c h [(μ·∇η + 2 p η) ∂η/∂θ + η μ·∂∇η/∂θ]
//!                               λ += c h [(μ·∇η + 2 p η) ∇η + η Hess(η) μ]
//! ```
//!
//! with `p` the derivative by the optical path. These are equations 5.23 and 5.28 to 5.31 of the
//! thesis for any list of drifts and kicks (its Algorithm 3 accumulates after `μ` has changed and
//! lacks the factor `h`).

use super::exit::{RayExit, RegionEntry};
use super::fate::GrinFate;
use super::field::{IndexField, IndexSamples};
use super::integrator::IntegratorOp;
use super::lanes::{LANES, LaneScalars, LaneVectors, drift, get, put};
use super::state::{GrinRay, RayAdjoint};
use super::step::GrinTracer;
use crate::math::{Real, SimdWidth, Vec3, run_vectorized};

/// Rays side by side, traced backwards; each column is aligned with a cache line.
#[derive(Clone, Default)]
#[repr(C, align(64))]
struct BackwardBlock<R> {
    x: LaneVectors<R>,
    v: LaneVectors<R>,
    /// `λ`.
    by_x: LaneVectors<R>,
    /// `μ`.
    by_v: LaneVectors<R>,
    by_path: LaneScalars<R>,
    /// The length of the step to be undone; 0 for an empty lane.
    h: LaneScalars<R>,
    /// The step of the block at which the ray is back at its start.
    due_step: [u64; LANES],
    /// The number of the ray in each lane.
    ray: [Option<usize>; LANES],
}

/// Work space for one kick.
#[repr(C, align(64))]
struct KickScratch<R> {
    samples: IndexSamples<R>,
    /// `Hess(η) μ`.
    hessian_product: LaneVectors<R>,
    /// The weights of `∂η/∂θ` and of `∂∇η/∂θ` in the gradient by the parameters.
    weight: LaneScalars<R>,
    pull: LaneVectors<R>,
}

impl<R: Real> Default for KickScratch<R> {
    fn default() -> Self {
        let (samples, bent, pull) =
            (IndexSamples::default(), LaneVectors::default(), LaneVectors::default());
        Self { samples, hessian_product: bent, weight: [R::ZERO; LANES], pull }
    }
}

impl<R: Real> BackwardBlock<R> {
    fn load_lane(&mut self, lane: usize, ray: usize, exit: &RayExit<R>, seed: &RayAdjoint<R>) {
        put(&mut self.x, lane, exit.record.state.x);
        put(&mut self.v, lane, exit.record.state.v);
        put(&mut self.by_x, lane, seed.x);
        put(&mut self.by_v, lane, seed.v);
        self.by_path[lane] = seed.path;
        self.h[lane] = exit.record.last;
        self.ray[lane] = Some(ray);
    }

    /// Empties a lane. Values that are not finite must not remain, since they would survive a step
    /// of 0.
    fn clear_lane(&mut self, lane: usize) {
        for columns in [&mut self.x, &mut self.v, &mut self.by_x, &mut self.by_v] {
            put(columns, lane, Vec3::default());
        }
        self.by_path[lane] = R::ZERO;
        self.h[lane] = R::ZERO;
        self.due_step[lane] = u64::MAX;
        self.ray[lane] = None;
    }

    /// Gives every ray in flight a whole step.
    fn set_full_step(&mut self, step: R) {
        for (h, due) in self.h.iter_mut().zip(&self.due_step) {
            *h = R::select(*due == u64::MAX, R::ZERO, step);
        }
    }

    fn earliest_due(&self) -> u64 {
        self.due_step.into_iter().min().unwrap_or(u64::MAX)
    }

    fn adjoint(&self, lane: usize) -> RayAdjoint<R> {
        RayAdjoint { x: get(&self.by_x, lane), v: get(&self.by_v, lane), path: self.by_path[lane] }
    }
}

/// One chunk of rays with their exits and adjoints.
pub(super) struct Chunk<'a, R> {
    pub(super) rays: &'a [GrinRay<R>],
    pub(super) exits: &'a mut [RayExit<R>],
    pub(super) seeds: &'a [RayAdjoint<R>],
    /// The gradient with respect to the start of each ray.
    pub(super) starts: &'a mut [RayAdjoint<R>],
}

/// The result of retracing a chunk.
#[derive(Default)]
pub(super) struct RetraceResult {
    /// The largest distance between a start and the end of the retraced ray, in steps.
    pub(super) largest_error: f64,
    /// The number of rays that turned out to have no gradient; their contributions must be
    /// discarded.
    pub(super) lost_rays: usize,
}

impl<R: Real, F: IndexField<R> + ?Sized> GrinTracer<'_, R, F> {
    /// Traces the rays of a chunk backwards and adds to the gradient by the parameters.
    pub(super) fn retrace(&self, chunk: &mut Chunk<'_, R>, gradient: &mut [R]) -> RetraceResult {
        let (mut block, mut scratch) = (BackwardBlock::default(), KickScratch::default());
        let (mut queue, mut clock) = (0..chunk.rays.len(), 0);
        let mut retraced = RetraceResult::default();
        for lane in 0..LANES {
            self.refill_backward(&mut block, lane, (&mut queue, clock), chunk);
        }
        let mut soonest = block.earliest_due();
        let mut loaded = true;
        // An empty seat is never due.
        while soonest != u64::MAX {
            run_vectorized(
                SimdWidth::Bits512,
                #[inline(always)]
                || self.undo_block(&mut block, &mut scratch, gradient),
            );
            clock += 1;
            if loaded {
                // Only the first step backwards may be a shortened one.
                block.set_full_step(self.setup.step);
            }
            loaded = clock >= soonest;
            if !loaded {
                continue;
            }
            for lane in 0..LANES {
                let Some(ray) = block.ray[lane].filter(|_| clock >= block.due_step[lane]) else {
                    continue;
                };
                self.finish_lane(&block, (lane, ray), chunk, gradient, &mut retraced);
                self.refill_backward(&mut block, lane, (&mut queue, clock), chunk);
            }
            soonest = block.earliest_due();
        }
        retraced
    }

    /// Finishes one retraced ray: checks that it is back at its start, and completes its gradient.
    fn finish_lane(
        &self,
        block: &BackwardBlock<R>,
        (lane, ray): (usize, usize),
        chunk: &mut Chunk<'_, R>,
        gradient: &mut [R],
        retraced: &mut RetraceResult,
    ) {
        let start = &chunk.rays[ray];
        let seed = block.adjoint(lane);
        if let Ok(entry) = self.enter(start) {
            let error = self.retrace_error(&entry, get(&block.x, lane));
            if error <= retrace_tolerance::<R>() && seed.is_finite() {
                retraced.largest_error = retraced.largest_error.max(error);
                chunk.starts[ray] = self.enter_adjoint(start, &entry, seed, gradient);
                return;
            }
        }
        retraced.lost_rays += 1;
        chunk.exits[ray].fate = GrinFate::Chaotic;
        chunk.starts[ray] = RayAdjoint::default();
    }

    /// The distance between the start and the end of the retraced ray, in steps; infinite for
    /// values that are not numbers.
    fn retrace_error(&self, entry: &RegionEntry<R>, back: Vec3<R>) -> f64 {
        let miss = (back - entry.state.x).value();
        let v = entry.state.v.value();
        let step = self.setup.step.value() * v.dot(v).sqrt();
        let error = miss.dot(miss).sqrt() / step;
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Loads the next ray that has a nonzero adjoint into a lane.
    fn refill_backward(
        &self,
        block: &mut BackwardBlock<R>,
        lane: usize,
        (queue, clock): (&mut std::ops::Range<usize>, u64),
        chunk: &mut Chunk<'_, R>,
    ) {
        block.clear_lane(lane);
        for ray in queue {
            let exit = &mut chunk.exits[ray];
            let seed = chunk.seeds[ray];
            if !exit.fate.has_arrived() || seed == RayAdjoint::default() {
                continue;
            }
            let seed = self.exit_adjoint(exit, seed);
            if !seed.is_finite() {
                exit.fate = GrinFate::Grazing;
                continue;
            }
            block.load_lane(lane, ray, exit, &seed);
            block.due_step[lane] = clock + u64::from(exit.steps);
            return;
        }
    }

    /// Undoes one step of every ray of a block.
    #[inline(always)]
    fn undo_block(
        &self,
        block: &mut BackwardBlock<R>,
        scratch: &mut KickScratch<R>,
        gradient: &mut [R],
    ) {
        for op in self.ops.iter().rev() {
            match *op {
                IntegratorOp::Drift(c) => {
                    drift(&mut block.x, &block.v, &block.h, -c);
                    drift(&mut block.by_v, &block.by_x, &block.h, c);
                }
                IntegratorOp::Kick(c) => {
                    let s = &mut *scratch;
                    let (x, by_v) = (&block.x, &block.by_v);
                    self.field.sample_block_with_hessians(
                        x,
                        by_v,
                        &mut s.samples,
                        &mut s.hessian_product,
                    );
                    undo_kick(block, scratch, c);
                    self.field.accumulate_block(&block.x, &scratch.weight, &scratch.pull, gradient);
                }
            }
        }
    }
}

/// The largest distance between a start and the end of its retraced ray, in steps, at which the
/// gradient is still trusted.
fn retrace_tolerance<R: Real>() -> f64 {
    if R::EPSILON > 1e-10 { 1e-2 } else { 1e-6 }
}

/// Undoes a kick of weight `c` in every lane, and computes the contributions to the gradient by the
/// parameters.
#[inline(always)]
fn undo_kick<R: Real>(block: &mut BackwardBlock<R>, scratch: &mut KickScratch<R>, c: R) {
    let KickScratch { samples, hessian_product: bent, weight, pull } = scratch;
    for (lane, weight) in weight.iter_mut().enumerate() {
        let (index, g) = (samples.index[lane], get(&samples.gradient, lane));
        let (step, by_v) = (c * block.h[lane], get(&block.by_v, lane));
        let force = step * index;
        let v = get(&block.v, lane) - g * force;
        put(&mut block.v, lane, v);
        let by_index = step * (by_v.dot(g) + R::TWO * block.by_path[lane] * index);
        let by_x = get(&block.by_x, lane) + g * by_index + get(bent, lane) * force;
        put(&mut block.by_x, lane, by_x);
        *weight = by_index;
        put(pull, lane, by_v * force);
    }
}
