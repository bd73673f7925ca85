//! Rays forwards: single ones and blocks of them.
//!
//! A block has a seat for each lane. A ray that ends leaves its seat to the next one, so the lanes
//! stay full however different the rays are. An empty seat has a step of length 0: drifts and kicks
//! leave it alone, and the loops need no branch on a ray.

use super::exit::Exit;
use super::fate::Fate;
use super::field::{Field, Samples};
use super::integrator::Op;
use super::lanes::{Column, Columns, LANES, get, put};
use super::setup::{Setup, SetupError};
use crate::math::Real;
use crate::math::Vec3;
use crate::math::Width;
use crate::math::widest;
use rayon::prelude::*;

/// Rays that one task traces when all cores work.
const CHUNK: usize = 16 * LANES;

/// Where a ray starts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ray<R> {
    /// Position.
    pub x: Vec3<R>,
    /// Velocity `dx/dσ`: the direction times the index, unless [`Launch`](super::Launch) says
    /// otherwise.
    pub v: Vec3<R>,
}

impl<R: Real> Ray<R> {
    /// The same ray in another number type.
    pub fn lift<S: Real>(&self) -> Ray<S> {
        Ray { x: Vec3::from_f64(self.x.value()), v: Vec3::from_f64(self.v.value()) }
    }
}

/// A ray on its way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State<R> {
    /// Position.
    pub x: Vec3<R>,
    /// Velocity `dx/dσ`.
    pub v: Vec3<R>,
    /// Optical path since the start.
    pub path: R,
}

impl<R: Real> State<R> {
    pub(super) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.v.is_finite() && self.path.is_finite()
    }
}

/// Traces rays through one field, forwards and backwards.
#[derive(Debug)]
pub struct Tracer<'a, R, F: ?Sized> {
    pub(super) field: &'a F,
    pub(super) setup: Setup<R>,
    pub(super) ops: Vec<Op<R>>,
}

/// Rays side by side; a column begins where a line of the cache does.
#[derive(Clone, Default)]
#[repr(C, align(64))]
struct Block<R> {
    x: Columns<R>,
    v: Columns<R>,
    path: Column<R>,
    /// The length of the step: 0 for an empty seat.
    h: Column<R>,
    /// After how many steps of the block the ray has used up its own.
    deadline: [u64; LANES],
    /// The earliest of these.
    soonest: u64,
    /// Which ray sits here.
    seat: [Option<usize>; LANES],
}

impl<R: Real> Block<R> {
    fn state(&self, lane: usize) -> State<R> {
        State { x: get(&self.x, lane), v: get(&self.v, lane), path: self.path[lane] }
    }

    fn board(&mut self, lane: usize, ray: usize, state: &State<R>) {
        put(&mut self.x, lane, state.x);
        put(&mut self.v, lane, state.v);
        self.path[lane] = state.path;
        self.seat[lane] = Some(ray);
    }

    fn earliest(&self) -> u64 {
        self.deadline.into_iter().min().unwrap_or(u64::MAX)
    }

    /// Empties a seat; what was not finite must not stay, since it would survive a step of 0.
    fn leave(&mut self, lane: usize) {
        self.board(lane, 0, &State::default());
        self.seat[lane] = None;
        self.h[lane] = R::ZERO;
        self.deadline[lane] = u64::MAX;
    }
}

impl<'a, R: Real, F: Field<R> + ?Sized> Tracer<'a, R, F> {
    /// Makes a field ready for rays.
    ///
    /// # Errors
    /// A step that is not positive, no steps, or an empty region.
    pub fn new(field: &'a F, setup: Setup<R>) -> Result<Self, SetupError> {
        setup.check()?;
        let ops = setup.integrator.ops();
        Ok(Self { field, setup, ops })
    }

    /// How rays are traced.
    pub fn setup(&self) -> &Setup<R> {
        &self.setup
    }

    /// Traces one ray; the same bits as in a batch.
    pub fn ray(&self, ray: &Ray<R>) -> Exit<R> {
        self.follow(ray, |_| {})
    }

    /// Traces one ray and keeps every point between steps, for a drawing.
    pub fn path(&self, ray: &Ray<R>) -> (Vec<State<R>>, Exit<R>) {
        let mut points = Vec::new();
        let exit = self.follow(ray, |state| points.push(*state));
        (points, exit)
    }

    /// Traces one ray and shows every state inside.
    fn follow(&self, ray: &Ray<R>, mut visit: impl FnMut(&State<R>)) -> Exit<R> {
        let mut state = match self.enter(ray) {
            Ok(entry) => entry.state,
            Err(fate) => return Exit::lost(fate, &State { x: ray.x, v: ray.v, path: R::ZERO }, 0),
        };
        let mut steps = 0;
        loop {
            visit(&state);
            let before = state;
            state = self.advance(before, self.setup.step);
            steps += 1;
            if steps == self.setup.limit() || self.is_out(state.x) {
                return self.land(ray, &before, &state, steps);
            }
        }
    }

    /// Traces rays, in the order given, on all cores.
    pub fn rays(&self, rays: &[Ray<R>]) -> Vec<Exit<R>> {
        let mut exits = vec![Exit::lost(Fate::Diverged, &State::default(), 0); rays.len()];
        rays.par_chunks(CHUNK)
            .zip(exits.par_chunks_mut(CHUNK))
            .for_each(|(rays, exits)| self.fly(rays, exits));
        exits
    }

    /// Whether a point is not inside the region, or no point at all.
    fn is_out(&self, x: Vec3<R>) -> bool {
        self.setup.region().is_some_and(|region| !(region.height(x) < R::ZERO))
    }

    /// One step of length `h`.
    pub(super) fn advance(&self, state: State<R>, h: R) -> State<R> {
        let State { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                Op::Drift(c) => x = x + v * (c * h),
                Op::Kick(c) => {
                    let sample = self.field.sample(x);
                    let weight = c * h * sample.index;
                    v = v + sample.gradient * weight;
                    path += weight * sample.index;
                }
            }
        }
        State { x, v, path }
    }

    /// One step of length `h`, and the derivative of its end by `h`.
    pub(super) fn advance_with_rate(&self, state: State<R>, h: R) -> (State<R>, State<R>) {
        let mut rate = State::default();
        let State { mut x, mut v, mut path } = state;
        for op in &self.ops {
            match *op {
                Op::Drift(c) => {
                    x = x + v * (c * h);
                    rate.x = rate.x + (v + rate.v * h) * c;
                }
                Op::Kick(c) => {
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
        (State { x, v, path }, rate)
    }

    /// Traces the rays of one chunk.
    fn fly(&self, rays: &[Ray<R>], exits: &mut [Exit<R>]) {
        let mut block = Block::default();
        (0..LANES).for_each(|lane| block.leave(lane));
        let mut queue = 0..rays.len();
        (0..LANES).for_each(|lane| self.fill(&mut block, lane, (&mut queue, 0), rays, exits));
        block.soonest = block.earliest();
        let (mut clock, mut before) = (0, block.clone());
        // An empty seat is never due.
        while block.soonest != u64::MAX {
            if self.setup.is_fractional() {
                (before.x, before.v, before.path) = (block.x, block.v, block.path);
            }
            clock += 1;
            let any_due = widest(
                Width::Bits512,
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
                let Some(ray) = block.seat[lane] else { continue };
                let state = block.state(lane);
                if clock < block.deadline[lane] && !self.is_out(state.x) {
                    continue;
                }
                let steps = self.steps(clock, block.deadline[lane]);
                exits[ray] = self.land(&rays[ray], &before.state(lane), &state, steps);
                self.fill(&mut block, lane, (&mut queue, clock), rays, exits);
            }
            block.soonest = block.earliest();
        }
    }

    /// How many steps a ray has taken.
    fn steps(&self, clock: u64, deadline: u64) -> u32 {
        self.setup.limit() - (deadline - clock) as u32
    }

    /// Gives an empty seat to the next ray that enters; those that do not, end.
    fn fill(
        &self,
        block: &mut Block<R>,
        lane: usize,
        (queue, clock): (&mut std::ops::Range<usize>, u64),
        rays: &[Ray<R>],
        exits: &mut [Exit<R>],
    ) {
        block.leave(lane);
        for ray in queue {
            let start = &rays[ray];
            match self.enter(start) {
                Ok(entry) => {
                    block.board(lane, ray, &entry.state);
                    block.h[lane] = self.setup.step;
                    block.deadline[lane] = clock + u64::from(self.setup.limit());
                    return;
                }
                Err(fate) => {
                    let state = State { x: start.x, v: start.v, path: R::ZERO };
                    exits[ray] = Exit::lost(fate, &state, 0);
                }
            }
        }
    }

    /// Whether any ray has to be looked at.
    #[inline(always)]
    fn any_due(&self, block: &Block<R>, clock: u64) -> bool {
        let Some(region) = self.setup.region() else { return clock >= block.soonest };
        let mut due = false;
        for (out, h) in region.outside(&block.x).into_iter().zip(block.h) {
            // The step of an empty seat has no length.
            due |= out * h > R::ZERO;
        }
        due | (clock >= block.soonest)
    }

    /// One step of every ray of a block.
    #[inline(always)]
    fn advance_block(&self, block: &mut Block<R>) {
        let mut samples = Samples::default();
        for op in &self.ops {
            match *op {
                Op::Drift(c) => drift(&mut block.x, &block.v, &block.h, c),
                Op::Kick(c) => {
                    self.field.samples(&block.x, &mut samples);
                    kick(block, &samples, c);
                }
            }
        }
    }
}

/// `x += c h v` for every lane.
#[inline(always)]
pub(super) fn drift<R: Real>(x: &mut Columns<R>, v: &Columns<R>, h: &Column<R>, c: R) {
    for (lane, h) in h.iter().enumerate() {
        let step = c * *h;
        x.x[lane] += v.x[lane] * step;
        x.y[lane] += v.y[lane] * step;
        x.z[lane] += v.z[lane] * step;
    }
}

/// `v += c h η ∇η` for every lane, and the optical path grows.
#[inline(always)]
fn kick<R: Real>(block: &mut Block<R>, samples: &Samples<R>, c: R) {
    let (v, g) = (&mut block.v, &samples.gradient);
    for lane in 0..LANES {
        let weight = c * block.h[lane] * samples.index[lane];
        v.x[lane] += g.x[lane] * weight;
        v.y[lane] += g.y[lane] * weight;
        v.z[lane] += g.z[lane] * weight;
        block.path[lane] += weight * samples.index[lane];
    }
}
