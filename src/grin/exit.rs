//! Both ends of a ray: how it enters the region, and how it leaves it and reaches the screen; each
//! with its transpose.

use super::adjoint::Seed;
use super::fate::Fate;
use super::field::Field;
use super::region::{Face, Region, rounding};
use super::setup::{End, LastStep, Launch};
use super::tracer::{Ray, State, Tracer};
use crate::math::Real;
use crate::math::Vec3;

/// Where a ray ended, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exit<R> {
    /// How it ended.
    pub fate: Fate,
    /// Where: on the screen, else on the boundary, else where it stood after its last step.
    pub x: Vec3<R>,
    /// Its velocity there: in air the direction.
    pub v: Vec3<R>,
    /// The optical path from its start.
    pub path: R,
    /// How many steps it took.
    pub steps: u32,
    /// The cosine between the ray and the outward normal of the boundary; 1 where there is none.
    /// The derivative of the exit grows as its inverse: a loss should give a flat exit less weight.
    pub cosine: R,
    /// `|v|² - η²` before it leaves. Zero for light, up to the error of the integrator; a start with
    /// the wrong speed, or a jump of the index at the boundary that nothing refracts, stays in it.
    pub excess: R,
    pub(super) landing: Landing<R>,
}

/// What the way back needs to know.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Landing<R> {
    /// Where the way back begins.
    pub(super) state: State<R>,
    /// The length of the last step.
    pub(super) last: R,
    /// The derivative of the state by the length of the last step, if that was cut to length.
    rate: Option<State<R>>,
    /// The way along `v` from the state to the boundary: not positive.
    slide: R,
    /// The face by which it left.
    face: Option<usize>,
    /// The way along `v` from the boundary to the screen.
    flight: R,
}

impl<R: Real> Exit<R> {
    pub(super) fn lost(fate: Fate, state: &State<R>, steps: u32) -> Self {
        let landing = Landing { state: *state, ..Landing::default() };
        let State { x, v, path } = *state;
        Self { fate, x, v, path, steps, cosine: R::ONE, excess: R::ZERO, landing }
    }
}

/// How a ray came in.
pub(super) struct Entry<R> {
    pub(super) state: State<R>,
    /// The way along `v` in air.
    slide: R,
    /// The face it came through; none for a start inside.
    face: Option<Face<R>>,
}

impl<R: Real, F: Field<R> + ?Sized> Tracer<'_, R, F> {
    /// Brings a ray to the region and gives it its speed.
    pub(super) fn enter(&self, ray: &Ray<R>) -> Result<Entry<R>, Fate> {
        if !(ray.x.is_finite() && ray.v.is_finite()) {
            return Err(Fate::Diverged);
        }
        let (face, slide) = match self.setup.region() {
            Some(region) => approach(region, ray).ok_or(Fate::NeverEntered)?,
            None => (None, R::ZERO),
        };
        let x = ray.x + ray.v * slide;
        let v = match (self.setup.launch, face) {
            (Launch::Scaled, _) => ray.v * self.field.sample(x).index,
            (Launch::Refracted, Some(face)) => {
                let index = self.field.sample(x).index;
                refract(ray.v, face.normal(x), index * index).ok_or(Fate::TotalReflection)?
            }
            (Launch::AsGiven | Launch::Refracted, _) => ray.v,
        };
        let path = slide * ray.v.dot(ray.v);
        Ok(Entry { state: State { x, v, path }, slide, face })
    }

    /// The transpose of [`Self::enter`]: takes the gradient from the state inside to the ray.
    pub(super) fn enter_back(
        &self,
        ray: &Ray<R>,
        entry: &Entry<R>,
        inside: Seed<R>,
        gradient: &mut [R],
    ) -> Seed<R> {
        let x = entry.state.x;
        let mut seed = inside;
        // What the speed takes from the index at the start.
        let by_index = match (self.setup.launch, entry.face) {
            (Launch::Scaled, _) => {
                let by_index = seed.v.dot(ray.v);
                seed.v = seed.v * self.field.sample(x).index;
                by_index
            }
            (Launch::Refracted, Some(face)) => {
                let index = self.field.sample(x).index;
                let back = refract_back(ray.v, face.normal(x), index * index, seed.v);
                seed.v = back.v;
                seed.x = seed.x + across(face.square, back.normal);
                back.square * R::TWO * index
            }
            (Launch::AsGiven | Launch::Refracted, _) => R::ZERO,
        };
        if by_index != R::ZERO {
            seed.x = seed.x + self.field.sample(x).gradient * by_index;
            self.field.deposit(x, by_index, Vec3::default(), gradient);
        }
        match entry.face {
            Some(face) if entry.slide != R::ZERO => {
                slide_back(entry.slide, ray.v, face.normal(x), seed)
            }
            _ => seed,
        }
    }

    /// Ends a ray whose last step led from `before` to `after`.
    pub(super) fn land(
        &self,
        ray: &Ray<R>,
        before: &State<R>,
        after: &State<R>,
        steps: u32,
    ) -> Exit<R> {
        if !after.is_finite() {
            return Exit::lost(Fate::Diverged, after, steps);
        }
        let Some(landing) = self.meet_boundary(before, after) else {
            return Exit::lost(Fate::Grazing, after, steps);
        };
        let state = slid(&landing.state, landing.slide);
        let fate = match &self.setup.end {
            End::Steps(_) => Fate::Stopped,
            End::Boundary { .. } if landing.face.is_none() => Fate::Trapped,
            End::Boundary { .. } if state.v.dot(ray.v) < R::ZERO => Fate::Turned,
            End::Boundary { .. } => Fate::Left,
        };
        let mut exit = Exit { landing, ..Exit::lost(fate, &state, steps) };
        if let Some(normal) = self.normal(&landing, state.x) {
            let lengths = (normal.dot(normal) * state.v.dot(state.v)).sqrt();
            exit.cosine = normal.dot(state.v) / lengths;
        }
        let index = self.field.sample(state.x).index;
        exit.excess = state.v.dot(state.v) - index * index;
        if fate.arrived() { self.go_out(exit) } else { exit }
    }

    /// The outward normal where a ray leaves.
    fn normal(&self, landing: &Landing<R>, x: Vec3<R>) -> Option<Vec3<R>> {
        let region = self.setup.region()?;
        Some(region.face(landing.face?).normal(x))
    }

    /// Finds where the last step met the boundary; none if that cannot be told.
    fn meet_boundary(&self, before: &State<R>, after: &State<R>) -> Option<Landing<R>> {
        let whole = Landing { state: *after, last: self.setup.step, ..Landing::default() };
        let End::Boundary { region, last, .. } = &self.setup.end else { return Some(whole) };
        if region.height(after.x) < R::ZERO {
            return Some(whole);
        }
        match last {
            LastStep::BrokenLine => {
                let (face, back) = region.entry(after.x, -after.v)?;
                Some(Landing { slide: -back, face: Some(face), ..whole })
            }
            LastStep::Fractional => self.cut_last_step(region, before, after),
        }
    }

    /// The length of the last step that ends on the boundary, by Newton's iteration between two
    /// lengths that lie inside and outside.
    fn cut_last_step(
        &self,
        region: &Region<R>,
        before: &State<R>,
        after: &State<R>,
    ) -> Option<Landing<R>> {
        let step = self.setup.step;
        let (mut inside, mut outside) = (R::ZERO, step);
        let (from, to) = (region.outermost(before.x).1, region.outermost(after.x).1);
        let mut length = R::select(from < R::ZERO, step * (from / (from - to)), step);
        let settled = step.value() * R::EPSILON.sqrt();
        for _ in 0..60 {
            // The end moves with the velocity, up to the error of the integrator.
            let end = self.advance(*before, length);
            let (face, distance) = region.outermost(end.x);
            if distance < R::ZERO {
                inside = length;
            } else {
                outside = length;
            }
            let newton = length - correction(&region.face(face), end.x, end.v);
            let bracketed = newton > inside && newton < outside;
            let next = R::select(bracketed, newton, (inside + outside) * R::from_f64(0.5));
            let change = (next - length).value().abs();
            length = next;
            if change <= settled {
                break;
            }
        }
        // With the exact derivative; those that a number carries settle one step after its value.
        for _ in 0..=R::ORDER {
            let (end, rate) = self.advance_with_rate(*before, length);
            let (face, _) = region.outermost(end.x);
            length -= correction(&region.face(face), end.x, rate.x);
        }
        let (state, rate) = self.advance_with_rate(*before, length);
        let (face, distance) = region.outermost(state.x);
        let near = distance.abs() <= rounding(state.x, state.x - before.x);
        let cut = Landing { state, last: length, rate: Some(rate), ..Landing::default() };
        (near && length.is_finite()).then_some(Landing { face: Some(face), ..cut })
    }

    /// From the boundary into air and on to the screen.
    fn go_out(&self, mut exit: Exit<R>) -> Exit<R> {
        if let (Launch::Refracted, Some(normal)) =
            (self.setup.launch, self.normal(&exit.landing, exit.x))
        {
            match refract(exit.v, normal, R::ONE) {
                Some(v) => exit.v = v,
                None => exit.fate = Fate::TotalReflection,
            }
        }
        let Some(screen) = self.setup.screen.filter(|_| exit.fate.arrived()) else { return exit };
        // A screen that touches the boundary may lie behind the exit by a rounding error.
        let ahead = |t: &R| *t >= -self.setup.step && t.is_finite();
        let Some(t) = screen.crossings(exit.x, exit.v).and_then(|t| t.into_iter().find(ahead))
        else {
            exit.fate = Fate::MissedScreen;
            return exit;
        };
        let there = slid(&State { x: exit.x, v: exit.v, path: exit.path }, t);
        (exit.x, exit.path, exit.landing.flight) = (there.x, there.path, t);
        exit
    }

    /// The transpose of everything behind the last step: from the gradient by the exit to the one
    /// by the state where the way back begins.
    pub(super) fn leave_back(&self, exit: &Exit<R>, seed: Seed<R>) -> Seed<R> {
        let landing = &exit.landing;
        let mut seed = seed;
        if let Some(screen) = self.setup.screen {
            seed = slide_back(landing.flight, exit.v, screen.normal(exit.x), seed);
        }
        let inside = slid(&landing.state, landing.slide);
        let Some(normal) = self.normal(landing, inside.x) else { return seed };
        if self.setup.launch == Launch::Refracted {
            let back = refract_back(inside.v, normal, R::ONE, seed.v);
            let region = self.setup.region();
            let square = region.zip(landing.face).map(|(region, face)| region.face(face).square);
            seed.v = back.v;
            seed.x = seed.x + across(square.unwrap_or_default(), back.normal);
        }
        match landing.rate {
            None => slide_back(landing.slide, inside.v, normal, seed),
            // The length of the last step gives way so that the end stays on the boundary.
            Some(rate) => {
                let gain = seed.x.dot(rate.x) + seed.v.dot(rate.v) + seed.path * rate.path;
                Seed { x: seed.x - normal * (gain / normal.dot(rate.x)), ..seed }
            }
        }
    }
}

/// How a ray comes to the region: the face and the way along `v`; no face for a start inside.
fn approach<R: Real>(region: &Region<R>, ray: &Ray<R>) -> Option<(Option<Face<R>>, R)> {
    let (face, distance) = region.outermost(ray.x);
    let tolerance = rounding(ray.x, Vec3::default());
    if distance < -tolerance {
        return Some((None, R::ZERO));
    }
    let (face, slide) =
        if distance <= tolerance { (face, R::ZERO) } else { region.entry(ray.x, ray.v)? };
    let face = region.face(face);
    let inwards = face.normal(ray.x + ray.v * slide).dot(ray.v) < R::ZERO;
    inwards.then_some((Some(face), slide))
}

/// Newton's correction to a length whose end `x` should lie on the face and moves at this rate.
fn correction<R: Real>(face: &Face<R>, x: Vec3<R>, rate: Vec3<R>) -> R {
    face.height(x) / face.normal(x).dot(rate)
}

/// The state after a straight way `t v`, whose optical path is `t |v|²`.
fn slid<R: Real>(state: &State<R>, t: R) -> State<R> {
    let v = state.v;
    State { x: state.x + v * t, v, path: state.path + t * v.dot(v) }
}

/// The transpose of a straight way `t v` that ends on a face with this normal: `t` gives way so that
/// the end stays on the face.
fn slide_back<R: Real>(t: R, v: Vec3<R>, normal: Vec3<R>, seed: Seed<R>) -> Seed<R> {
    let gain = seed.x.dot(v) + seed.path * v.dot(v);
    let x = seed.x - normal * (gain / normal.dot(v));
    Seed { x, v: seed.v + x * t + v * (R::TWO * t * seed.path), path: seed.path }
}

/// A diagonal Hessian, twice these squares, times a vector.
fn across<R: Real>(square: Vec3<R>, v: Vec3<R>) -> Vec3<R> {
    Vec3::new(square.x * v.x, square.y * v.y, square.z * v.z) * R::TWO
}

/// Snell's law: the part of `v` along the surface stays, its length becomes the root of `square`;
/// none where that is impossible.
fn refract<R: Real>(v: Vec3<R>, normal: Vec3<R>, square: R) -> Option<Vec3<R>> {
    let unit = normal * (R::ONE / normal.dot(normal).sqrt());
    let along = v.dot(unit);
    let radicand = along * along - v.dot(v) + square;
    if !(radicand > R::ZERO) {
        return None;
    }
    let root = radicand.sqrt();
    Some(v + unit * (R::select(along < R::ZERO, -root, root) - along))
}

/// What the transpose of [`refract`] gives.
struct RefractBack<R> {
    v: Vec3<R>,
    normal: Vec3<R>,
    square: R,
}

/// The transpose of [`refract`], where it is possible.
fn refract_back<R: Real>(v: Vec3<R>, normal: Vec3<R>, square: R, seed: Vec3<R>) -> RefractBack<R> {
    let scale = R::ONE / normal.dot(normal).sqrt();
    let unit = normal * scale;
    let along = v.dot(unit);
    let root = (along * along - v.dot(v) + square).sqrt();
    let root = R::select(along < R::ZERO, -root, root);
    let by_jump = seed.dot(unit);
    let by_radicand = by_jump / (R::TWO * root);
    let by_along = R::TWO * along * by_radicand - by_jump;
    let by_unit = seed * (root - along) + v * by_along;
    RefractBack {
        v: seed + unit * by_along - v * (R::TWO * by_radicand),
        normal: (by_unit - unit * unit.dot(by_unit)) * scale,
        square: by_radicand,
    }
}
