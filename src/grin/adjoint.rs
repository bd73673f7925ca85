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

use super::exit::{Entry, Exit};
use super::fate::Fate;
use super::field::{Field, Samples};
use super::integrator::Op;
use super::lanes::{Column, Columns, LANES, get, put};
use super::tracer::{Ray, Tracer, drift};
use crate::math::Real;
use crate::math::Vec3;
use crate::math::Width;
use crate::math::widest;

/// The derivative of a loss by a ray's position, velocity and optical path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seed<R> {
    /// By the position.
    pub x: Vec3<R>,
    /// By the velocity.
    pub v: Vec3<R>,
    /// By the optical path.
    pub path: R,
}

impl<R: Real> Seed<R> {
    pub(super) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.v.is_finite() && self.path.is_finite()
    }
}

/// Rays side by side on their way back; a column begins where a line of the cache does.
#[derive(Clone, Default)]
#[repr(C, align(64))]
struct Block<R> {
    x: Columns<R>,
    v: Columns<R>,
    /// `λ`.
    by_x: Columns<R>,
    /// `μ`.
    by_v: Columns<R>,
    by_path: Column<R>,
    /// The length of the step to be undone: 0 for an empty seat.
    h: Column<R>,
    /// At which step of the block the ray is back.
    due: [u64; LANES],
    /// Which ray sits here.
    seat: [Option<usize>; LANES],
}

/// Room for what a kick needs.
#[repr(C, align(64))]
struct Scratch<R> {
    samples: Samples<R>,
    /// `Hess(η) μ`.
    bent: Columns<R>,
    /// What goes to the parameters with `∂η/∂θ`, and with `∂∇η/∂θ`.
    weight: Column<R>,
    pull: Columns<R>,
}

impl<R: Real> Default for Scratch<R> {
    fn default() -> Self {
        let (samples, bent, pull) = (Samples::default(), Columns::default(), Columns::default());
        Self { samples, bent, weight: [R::ZERO; LANES], pull }
    }
}

impl<R: Real> Block<R> {
    fn board(&mut self, lane: usize, ray: usize, exit: &Exit<R>, seed: &Seed<R>) {
        put(&mut self.x, lane, exit.landing.state.x);
        put(&mut self.v, lane, exit.landing.state.v);
        put(&mut self.by_x, lane, seed.x);
        put(&mut self.by_v, lane, seed.v);
        self.by_path[lane] = seed.path;
        self.h[lane] = exit.landing.last;
        self.seat[lane] = Some(ray);
    }

    /// Empties a seat; what was not finite must not stay, since it would survive a step of 0.
    fn leave(&mut self, lane: usize) {
        for columns in [&mut self.x, &mut self.v, &mut self.by_x, &mut self.by_v] {
            put(columns, lane, Vec3::default());
        }
        self.by_path[lane] = R::ZERO;
        self.h[lane] = R::ZERO;
        self.due[lane] = u64::MAX;
        self.seat[lane] = None;
    }

    /// Gives every ray on its way a whole step.
    fn go_on(&mut self, step: R) {
        for (h, due) in self.h.iter_mut().zip(&self.due) {
            *h = R::select(*due == u64::MAX, R::ZERO, step);
        }
    }

    fn earliest(&self) -> u64 {
        self.due.into_iter().min().unwrap_or(u64::MAX)
    }

    fn seed(&self, lane: usize) -> Seed<R> {
        Seed { x: get(&self.by_x, lane), v: get(&self.by_v, lane), path: self.by_path[lane] }
    }
}

/// One chunk of rays with what is known of them.
pub(super) struct Chunk<'a, R> {
    pub(super) rays: &'a [Ray<R>],
    pub(super) exits: &'a mut [Exit<R>],
    pub(super) seeds: &'a [Seed<R>],
    /// The gradient by the start of each ray.
    pub(super) starts: &'a mut [Seed<R>],
}

/// What retracing a chunk showed.
#[derive(Default)]
pub(super) struct Retraced {
    /// The largest distance between a start and where the way back ended, in steps.
    pub(super) worst: f64,
    /// How many rays turned out to have no gradient; what they deposited must be thrown away.
    pub(super) lost: usize,
}

impl<R: Real, F: Field<R> + ?Sized> Tracer<'_, R, F> {
    /// Traces the rays of a chunk backwards and adds to the gradient by the parameters.
    pub(super) fn retrace(&self, chunk: &mut Chunk<'_, R>, gradient: &mut [R]) -> Retraced {
        let (mut block, mut scratch) = (Block::default(), Scratch::default());
        let (mut queue, mut clock) = (0..chunk.rays.len(), 0);
        let mut retraced = Retraced::default();
        for lane in 0..LANES {
            self.fill_back(&mut block, lane, (&mut queue, clock), chunk);
        }
        let mut soonest = block.earliest();
        let mut boarded = true;
        // An empty seat is never due.
        while soonest != u64::MAX {
            widest(
                Width::Bits512,
                #[inline(always)]
                || self.undo_block(&mut block, &mut scratch, gradient),
            );
            clock += 1;
            if boarded {
                // Only the first step on the way back may be a cut one.
                block.go_on(self.setup.step);
            }
            boarded = clock >= soonest;
            if !boarded {
                continue;
            }
            for lane in 0..LANES {
                let Some(ray) = block.seat[lane].filter(|_| clock >= block.due[lane]) else {
                    continue;
                };
                self.arrive(&block, (lane, ray), chunk, gradient, &mut retraced);
                self.fill_back(&mut block, lane, (&mut queue, clock), chunk);
            }
            soonest = block.earliest();
        }
        retraced
    }

    /// Ends the way back of one ray: checks that it is where it started, and finishes its gradient.
    fn arrive(
        &self,
        block: &Block<R>,
        (lane, ray): (usize, usize),
        chunk: &mut Chunk<'_, R>,
        gradient: &mut [R],
        retraced: &mut Retraced,
    ) {
        let start = &chunk.rays[ray];
        let seed = block.seed(lane);
        if let Ok(entry) = self.enter(start) {
            let error = self.retrace_error(&entry, get(&block.x, lane));
            if error <= tolerance::<R>() && seed.is_finite() {
                retraced.worst = retraced.worst.max(error);
                chunk.starts[ray] = self.enter_back(start, &entry, seed, gradient);
                return;
            }
        }
        retraced.lost += 1;
        chunk.exits[ray].fate = Fate::Chaotic;
        chunk.starts[ray] = Seed::default();
    }

    /// How far the way back ended from the start, in steps; infinite for what is no number.
    fn retrace_error(&self, entry: &Entry<R>, back: Vec3<R>) -> f64 {
        let miss = (back - entry.state.x).value();
        let v = entry.state.v.value();
        let step = self.setup.step.value() * v.dot(v).sqrt();
        let error = miss.dot(miss).sqrt() / step;
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Gives an empty seat to the next ray that has anything to differentiate.
    fn fill_back(
        &self,
        block: &mut Block<R>,
        lane: usize,
        (queue, clock): (&mut std::ops::Range<usize>, u64),
        chunk: &mut Chunk<'_, R>,
    ) {
        block.leave(lane);
        for ray in queue {
            let exit = &mut chunk.exits[ray];
            let seed = chunk.seeds[ray];
            if !exit.fate.arrived() || seed == Seed::default() {
                continue;
            }
            let seed = self.leave_back(exit, seed);
            if !seed.is_finite() {
                exit.fate = Fate::Grazing;
                continue;
            }
            block.board(lane, ray, exit, &seed);
            block.due[lane] = clock + u64::from(exit.steps);
            return;
        }
    }

    /// Undoes one step of every ray of a block.
    #[inline(always)]
    fn undo_block(&self, block: &mut Block<R>, scratch: &mut Scratch<R>, gradient: &mut [R]) {
        for op in self.ops.iter().rev() {
            match *op {
                Op::Drift(c) => {
                    drift(&mut block.x, &block.v, &block.h, -c);
                    drift(&mut block.by_v, &block.by_x, &block.h, c);
                }
                Op::Kick(c) => {
                    let s = &mut *scratch;
                    let (x, by_v) = (&block.x, &block.by_v);
                    self.field.samples_and_hessians(x, by_v, &mut s.samples, &mut s.bent);
                    undo_kick(block, scratch, c);
                    self.field.deposits(&block.x, &scratch.weight, &scratch.pull, gradient);
                }
            }
        }
    }
}

/// How far a way back may end from its start, in steps, before its gradient counts as lost.
fn tolerance<R: Real>() -> f64 {
    if R::EPSILON > 1e-10 { 1e-2 } else { 1e-6 }
}

/// Undoes a kick of weight `c` for every lane, and works out what the parameters get.
#[inline(always)]
fn undo_kick<R: Real>(block: &mut Block<R>, scratch: &mut Scratch<R>, c: R) {
    let Scratch { samples, bent, weight, pull } = scratch;
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
