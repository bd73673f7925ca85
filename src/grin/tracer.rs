//! Forward tracing: single rays and blocks of them.
//!
//! A block has one lane per ray. A ray that ends leaves its lane to the next one, so the lanes stay
//! full however different the rays are. An empty lane has a step of length 0: drifts and kicks
//! leave it unchanged, and the loops need no branch on a ray.

use super::exit::RayExit;
use super::fate::GrinFate;
use super::field::{IndexField, IndexSamples};
use super::integrator::IntegratorOp;
use super::lanes::{LANES, LaneScalars, LaneVectors, drift, get, put};
use super::state::{GrinRay, RayState};
use super::step::GrinTracer;
use crate::math::{Real, SimdWidth, Vec3, run_vectorized};
use rayon::prelude::*;

/// Rays that one task traces when all cores work.
const CHUNK: usize = 16 * LANES;

/// Rays side by side; each column is aligned with a cache line.
#[derive(Clone, Default)]
#[repr(C, align(64))]
struct ForwardBlock<R> {
    x: LaneVectors<R>,
    v: LaneVectors<R>,
    path: LaneScalars<R>,
    /// The length of the step; 0 for an empty lane.
    h: LaneScalars<R>,
    /// The step of the block at which each ray has taken its largest number of steps.
    step_limit: [u64; LANES],
    /// The earliest of these.
    next_limit: u64,
    /// The number of the ray in each lane.
    ray: [Option<usize>; LANES],
}

impl<R: Real> ForwardBlock<R> {
    fn state(&self, lane: usize) -> RayState<R> {
        RayState { x: get(&self.x, lane), v: get(&self.v, lane), path: self.path[lane] }
    }

    fn load_lane(&mut self, lane: usize, ray: usize, state: &RayState<R>) {
        put(&mut self.x, lane, state.x);
        put(&mut self.v, lane, state.v);
        self.path[lane] = state.path;
        self.ray[lane] = Some(ray);
    }

    fn earliest_limit(&self) -> u64 {
        self.step_limit.into_iter().min().unwrap_or(u64::MAX)
    }

    /// Empties a lane. Values that are not finite must not remain, since they would survive a step
    /// of 0.
    fn clear_lane(&mut self, lane: usize) {
        self.load_lane(lane, 0, &RayState::default());
        self.ray[lane] = None;
        self.h[lane] = R::ZERO;
        self.step_limit[lane] = u64::MAX;
    }
}

impl<R: Real, F: IndexField<R> + ?Sized> GrinTracer<'_, R, F> {
    /// Traces one ray; bit-identical to its trace in a batch.
    pub fn trace(&self, ray: &GrinRay<R>) -> RayExit<R> {
        self.trace_with(ray, |_| {})
    }

    /// Traces one ray and returns every state between steps, for drawing.
    pub fn trace_path(&self, ray: &GrinRay<R>) -> (Vec<RayState<R>>, RayExit<R>) {
        let mut points = Vec::new();
        let exit = self.trace_with(ray, |state| points.push(*state));
        (points, exit)
    }

    /// Traces one ray and passes every state inside to `visit`.
    fn trace_with(&self, ray: &GrinRay<R>, mut visit: impl FnMut(&RayState<R>)) -> RayExit<R> {
        let mut state = match self.enter(ray) {
            Ok(entry) => entry.state,
            Err(fate) => {
                return RayExit::from_state(
                    fate,
                    &RayState { x: ray.x, v: ray.v, path: R::ZERO },
                    0,
                );
            }
        };
        let mut steps = 0;
        loop {
            visit(&state);
            let before = state;
            state = self.advance(before, self.setup.step);
            steps += 1;
            if steps == self.setup.max_steps() || self.is_outside(state.x) {
                return self.end_ray(ray, &before, &state, steps);
            }
        }
    }

    /// Traces rays on all cores; the exits are in the order of the rays.
    pub fn trace_batch(&self, rays: &[GrinRay<R>]) -> Vec<RayExit<R>> {
        let mut exits =
            vec![RayExit::from_state(GrinFate::Diverged, &RayState::default(), 0); rays.len()];
        rays.par_chunks(CHUNK)
            .zip(exits.par_chunks_mut(CHUNK))
            .for_each(|(rays, exits)| self.trace_chunk(rays, exits));
        exits
    }

    /// True if a point is not inside the region or is not a number.
    fn is_outside(&self, x: Vec3<R>) -> bool {
        self.setup.region().is_some_and(|region| !(region.level(x) < R::ZERO))
    }

    /// Traces the rays of one chunk.
    fn trace_chunk(&self, rays: &[GrinRay<R>], exits: &mut [RayExit<R>]) {
        let mut block = ForwardBlock::default();
        (0..LANES).for_each(|lane| block.clear_lane(lane));
        let mut queue = 0..rays.len();
        (0..LANES).for_each(|lane| self.refill(&mut block, lane, (&mut queue, 0), rays, exits));
        block.next_limit = block.earliest_limit();
        let (mut clock, mut before) = (0, block.clone());
        // The step limit of an empty lane is never reached.
        while block.next_limit != u64::MAX {
            if self.setup.is_fractional() {
                (before.x, before.v, before.path) = (block.x, block.v, block.path);
            }
            clock += 1;
            let any_due = run_vectorized(
                SimdWidth::Bits512,
                #[inline(always)]
                || {
                    self.advance_block(&mut block);
                    self.any_due(&block, clock)
                },
            );
            if !any_due {
                continue;
            }
            for lane in 0..LANES {
                let Some(ray) = block.ray[lane] else { continue };
                let state = block.state(lane);
                if clock < block.step_limit[lane] && !self.is_outside(state.x) {
                    continue;
                }
                let steps = self.steps_taken(clock, block.step_limit[lane]);
                exits[ray] = self.end_ray(&rays[ray], &before.state(lane), &state, steps);
                self.refill(&mut block, lane, (&mut queue, clock), rays, exits);
            }
            block.next_limit = block.earliest_limit();
        }
    }

    /// The number of steps that a ray has taken.
    fn steps_taken(&self, clock: u64, deadline: u64) -> u32 {
        self.setup.max_steps() - (deadline - clock) as u32
    }

    /// Loads the next ray that enters the region into a lane; rays that do not enter get their
    /// exits.
    fn refill(
        &self,
        block: &mut ForwardBlock<R>,
        lane: usize,
        (queue, clock): (&mut std::ops::Range<usize>, u64),
        rays: &[GrinRay<R>],
        exits: &mut [RayExit<R>],
    ) {
        block.clear_lane(lane);
        for ray in queue {
            let start = &rays[ray];
            match self.enter(start) {
                Ok(entry) => {
                    block.load_lane(lane, ray, &entry.state);
                    block.h[lane] = self.setup.step;
                    block.step_limit[lane] = clock + u64::from(self.setup.max_steps());
                    return;
                }
                Err(fate) => {
                    let state = RayState { x: start.x, v: start.v, path: R::ZERO };
                    exits[ray] = RayExit::from_state(fate, &state, 0);
                }
            }
        }
    }

    /// True if any ray of the block has left the region or reached its step limit.
    #[inline(always)]
    fn any_due(&self, block: &ForwardBlock<R>, clock: u64) -> bool {
        let Some(region) = self.setup.region() else { return clock >= block.next_limit };
        let mut due = false;
        for (out, h) in region.count_outside(&block.x).into_iter().zip(block.h) {
            // The step of an empty lane has no length.
            due |= out * h > R::ZERO;
        }
        due | (clock >= block.next_limit)
    }

    /// One step of every ray of a block.
    #[inline(always)]
    fn advance_block(&self, block: &mut ForwardBlock<R>) {
        let mut samples = IndexSamples::default();
        for op in &self.ops {
            match *op {
                IntegratorOp::Drift(c) => drift(&mut block.x, &block.v, &block.h, c),
                IntegratorOp::Kick(c) => {
                    self.field.sample_block(&block.x, &mut samples);
                    kick(block, &samples, c);
                }
            }
        }
    }
}

/// `v += c h η ∇η` in every lane, and the optical path grows.
#[inline(always)]
fn kick<R: Real>(block: &mut ForwardBlock<R>, samples: &IndexSamples<R>, c: R) {
    let (v, g) = (&mut block.v, &samples.gradient);
    for lane in 0..LANES {
        let weight = c * block.h[lane] * samples.index[lane];
        v.x[lane] += g.x[lane] * weight;
        v.y[lane] += g.y[lane] * weight;
        v.z[lane] += g.z[lane] * weight;
        block.path[lane] += weight * samples.index[lane];
    }
}
