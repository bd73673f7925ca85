//! Both ends of a ray: its entry into the region, its exit, and the way to the screen; each with
//! its adjoint.

use super::fate::GrinFate;
use super::field::IndexField;
use super::region::{Face, GrinRegion, rounding_error};
use super::setup::{EndCondition, LastStep, LaunchMode};
use super::state::{GrinRay, RayAdjoint, RayState};
use super::step::GrinTracer;
use crate::math::{Real, Vec3};

/// The end of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayExit<R> {
    /// The fate of the ray.
    pub fate: GrinFate,
    /// The position in mm: on the screen, else on the boundary, else after the last step.
    pub x: Vec3<R>,
    /// The velocity there; in air it is the unit direction.
    pub v: Vec3<R>,
    /// The optical path from the start.
    pub path: R,
    /// The number of steps.
    pub steps: u32,
    /// The cosine between the ray and the outward normal of the boundary; 1 where there is none.
    /// The derivative of the exit grows as its inverse: a loss should give a grazing exit less
    /// weight.
    pub cosine: R,
    /// `|v|² - η²` before the ray leaves. Zero for light, up to the error of the integrator; a
    /// start with the wrong speed, or a jump of the index at the boundary without refraction,
    /// remains in it.
    pub excess: R,
    pub(super) record: ExitRecord<R>,
}

/// The intermediate results of an exit that its adjoint needs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ExitRecord<R> {
    /// The state from which the ray is retraced.
    pub(super) state: RayState<R>,
    /// The length of the last step.
    pub(super) last: R,
    /// The derivative of the state with respect to the length of the last step, if that step was
    /// shortened.
    rate: Option<RayState<R>>,
    /// The distance along `v` from the state to the boundary, not positive.
    slide: R,
    /// The face through which the ray left.
    face: Option<usize>,
    /// The distance along `v` from the boundary to the screen.
    flight: R,
}

impl<R: Real> RayExit<R> {
    pub(super) fn from_state(fate: GrinFate, state: &RayState<R>, steps: u32) -> Self {
        let landing = ExitRecord { state: *state, ..ExitRecord::default() };
        let RayState { x, v, path } = *state;
        Self { fate, x, v, path, steps, cosine: R::ONE, excess: R::ZERO, record: landing }
    }
}

impl<R: Real> RayExit<R> {
    /// The distance along `v`, in units of its length, from here to a screen in air; `None` if the ray does not go
    /// there. A screen that touches the boundary may lie behind the exit by a rounding error: by less than a step of
    /// the tracer.
    pub fn flight_to(&self, screen: &Face<R>, step: R) -> Option<R> {
        let ahead = |t: &R| *t >= -step && t.is_finite();
        screen.crossings(self.x, self.v)?.into_iter().find(ahead)
    }
}

/// The entry of a ray into the region.
pub(super) struct RegionEntry<R> {
    pub(super) state: RayState<R>,
    /// The distance along `v` in air.
    slide: R,
    /// The face through which the ray entered; none for a start inside.
    face: Option<Face<R>>,
}

impl<R: Real, F: IndexField<R> + ?Sized> GrinTracer<'_, R, F> {
    /// Brings a ray to the region and gives it its speed.
    pub(super) fn enter(&self, ray: &GrinRay<R>) -> Result<RegionEntry<R>, GrinFate> {
        if !(ray.x.is_finite() && ray.v.is_finite()) {
            return Err(GrinFate::Diverged);
        }
        let (face, slide) = match self.setup.region() {
            Some(region) => find_entry(region, ray).ok_or(GrinFate::NeverEntered)?,
            None => (None, R::ZERO),
        };
        let x = ray.x + ray.v * slide;
        let v = match (self.setup.launch, face) {
            (LaunchMode::Scaled, _) => ray.v * self.field.sample(x).index,
            (LaunchMode::Refracted, Some(face)) => {
                let index = self.field.sample(x).index;
                refract(ray.v, face.normal(x), index * index).ok_or(GrinFate::TotalReflection)?
            }
            (LaunchMode::AsGiven | LaunchMode::Refracted, _) => ray.v,
        };
        let path = slide * ray.v.dot(ray.v);
        Ok(RegionEntry { state: RayState { x, v, path }, slide, face })
    }

    /// The adjoint of [`Self::enter`]: carries the adjoint from the state inside to the start of
    /// the ray.
    pub(super) fn enter_adjoint(
        &self,
        ray: &GrinRay<R>,
        entry: &RegionEntry<R>,
        inside: RayAdjoint<R>,
        gradient: &mut [R],
    ) -> RayAdjoint<R> {
        let x = entry.state.x;
        let mut seed = inside;
        // The derivative of the speed with respect to the index at the start.
        let by_index = match (self.setup.launch, entry.face) {
            (LaunchMode::Scaled, _) => {
                let by_index = seed.v.dot(ray.v);
                seed.v = seed.v * self.field.sample(x).index;
                by_index
            }
            (LaunchMode::Refracted, Some(face)) => {
                let index = self.field.sample(x).index;
                let back = refract_adjoint(ray.v, face.normal(x), index * index, seed.v);
                seed.v = back.v;
                seed.x = seed.x + diagonal_hessian_times(face.square, back.normal);
                back.square * R::TWO * index
            }
            (LaunchMode::AsGiven | LaunchMode::Refracted, _) => R::ZERO,
        };
        if by_index != R::ZERO {
            seed.x = seed.x + self.field.sample(x).gradient * by_index;
            self.field.accumulate(x, by_index, Vec3::default(), gradient);
        }
        match entry.face {
            Some(face) if entry.slide != R::ZERO => {
                slide_adjoint(entry.slide, ray.v, face.normal(x), seed)
            }
            _ => seed,
        }
    }

    /// Ends a ray whose last step went from `before` to `after`.
    pub(super) fn end_ray(
        &self,
        ray: &GrinRay<R>,
        before: &RayState<R>,
        after: &RayState<R>,
        steps: u32,
    ) -> RayExit<R> {
        if !after.is_finite() {
            return RayExit::from_state(GrinFate::Diverged, after, steps);
        }
        let Some(landing) = self.find_boundary(before, after) else {
            return RayExit::from_state(GrinFate::Grazing, after, steps);
        };
        let state = move_straight(&landing.state, landing.slide);
        let fate = match &self.setup.end {
            EndCondition::Steps(_) => GrinFate::Stopped,
            EndCondition::Boundary { .. } if landing.face.is_none() => GrinFate::Trapped,
            EndCondition::Boundary { .. } if state.v.dot(ray.v) < R::ZERO => GrinFate::Turned,
            EndCondition::Boundary { .. } => GrinFate::Left,
        };
        let mut exit = RayExit { record: landing, ..RayExit::from_state(fate, &state, steps) };
        if let Some(normal) = self.normal(&landing, state.x) {
            let lengths = (normal.dot(normal) * state.v.dot(state.v)).sqrt();
            exit.cosine = normal.dot(state.v) / lengths;
        }
        let index = self.field.sample(state.x).index;
        exit.excess = state.v.dot(state.v) - index * index;
        if fate.has_arrived() { self.propagate_to_screen(exit) } else { exit }
    }

    /// The outward normal at the exit.
    fn normal(&self, landing: &ExitRecord<R>, x: Vec3<R>) -> Option<Vec3<R>> {
        let region = self.setup.region()?;
        Some(region.face(landing.face?).normal(x))
    }

    /// Finds the point where the last step met the boundary; none if it cannot be determined.
    fn find_boundary(&self, before: &RayState<R>, after: &RayState<R>) -> Option<ExitRecord<R>> {
        let whole = ExitRecord { state: *after, last: self.setup.step, ..ExitRecord::default() };
        let EndCondition::Boundary { region, last, .. } = &self.setup.end else {
            return Some(whole);
        };
        if region.level(after.x) < R::ZERO {
            return Some(whole);
        }
        match last {
            LastStep::BrokenLine => {
                let (face, back) = region.entry(after.x, -after.v)?;
                Some(ExitRecord { slide: -back, face: Some(face), ..whole })
            }
            LastStep::Fractional => self.cut_last_step(region, before, after),
        }
    }

    /// Shortens the last step so that it ends on the boundary, by Newton's iteration bracketed
    /// between a length that ends inside and one that ends outside.
    fn cut_last_step(
        &self,
        region: &GrinRegion<R>,
        before: &RayState<R>,
        after: &RayState<R>,
    ) -> Option<ExitRecord<R>> {
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
            let newton = length - newton_correction(&region.face(face), end.x, end.v);
            let bracketed = newton > inside && newton < outside;
            let next = R::select(bracketed, newton, (inside + outside) * R::from_f64(0.5));
            let change = (next - length).value().abs();
            length = next;
            if change <= settled {
                break;
            }
        }
        // Corrects with the exact derivative; derivatives carried by the number type converge one
        // step after its value.
        for _ in 0..=R::ORDER {
            let (end, rate) = self.advance_with_rate(*before, length);
            let (face, _) = region.outermost(end.x);
            length -= newton_correction(&region.face(face), end.x, rate.x);
        }
        let (state, rate) = self.advance_with_rate(*before, length);
        let (face, distance) = region.outermost(state.x);
        let near = distance.abs() <= rounding_error(state.x, state.x - before.x);
        let cut = ExitRecord { state, last: length, rate: Some(rate), ..ExitRecord::default() };
        (near && length.is_finite()).then_some(ExitRecord { face: Some(face), ..cut })
    }

    /// Continues from the boundary through air to the screen.
    fn propagate_to_screen(&self, mut exit: RayExit<R>) -> RayExit<R> {
        if let (LaunchMode::Refracted, Some(normal)) =
            (self.setup.launch, self.normal(&exit.record, exit.x))
        {
            match refract(exit.v, normal, R::ONE) {
                Some(v) => exit.v = v,
                None => exit.fate = GrinFate::TotalReflection,
            }
        }
        let Some(screen) = self.setup.screen.filter(|_| exit.fate.has_arrived()) else {
            return exit;
        };
        let Some(t) = exit.flight_to(&screen, self.setup.step) else {
            exit.fate = GrinFate::MissedScreen;
            return exit;
        };
        let there = move_straight(&RayState { x: exit.x, v: exit.v, path: exit.path }, t);
        (exit.x, exit.path, exit.record.flight) = (there.x, there.path, t);
        exit
    }

    /// The adjoint of everything after the last step: from the adjoint of the exit to that of the
    /// state from which the ray is retraced.
    pub(super) fn exit_adjoint(&self, exit: &RayExit<R>, seed: RayAdjoint<R>) -> RayAdjoint<R> {
        let landing = &exit.record;
        let mut seed = seed;
        if let Some(screen) = self.setup.screen {
            seed = slide_adjoint(landing.flight, exit.v, screen.normal(exit.x), seed);
        }
        let inside = move_straight(&landing.state, landing.slide);
        let Some(normal) = self.normal(landing, inside.x) else { return seed };
        if self.setup.launch == LaunchMode::Refracted {
            let back = refract_adjoint(inside.v, normal, R::ONE, seed.v);
            let region = self.setup.region();
            let square = region.zip(landing.face).map(|(region, face)| region.face(face).square);
            seed.v = back.v;
            seed.x = seed.x + diagonal_hessian_times(square.unwrap_or_default(), back.normal);
        }
        match landing.rate {
            None => slide_adjoint(landing.slide, inside.v, normal, seed),
            // The length of the last step changes so that the end stays on the boundary.
            Some(rate) => {
                let gain = seed.x.dot(rate.x) + seed.v.dot(rate.v) + seed.path * rate.path;
                RayAdjoint { x: seed.x - normal * (gain / normal.dot(rate.x)), ..seed }
            }
        }
    }
}

/// Finds the entry into the region: the face and the distance along `v`; no face for a start
/// inside.
fn find_entry<R: Real>(region: &GrinRegion<R>, ray: &GrinRay<R>) -> Option<(Option<Face<R>>, R)> {
    let (face, distance) = region.outermost(ray.x);
    let tolerance = rounding_error(ray.x, Vec3::default());
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
fn newton_correction<R: Real>(face: &Face<R>, x: Vec3<R>, rate: Vec3<R>) -> R {
    face.level(x) / face.normal(x).dot(rate)
}

/// The state after a straight segment `t v`, whose optical path is `t |v|²`.
fn move_straight<R: Real>(state: &RayState<R>, t: R) -> RayState<R> {
    let v = state.v;
    RayState { x: state.x + v * t, v, path: state.path + t * v.dot(v) }
}

/// The adjoint of a straight segment `t v` that ends on a face with this normal: `t` changes so
/// that the end stays on the face.
fn slide_adjoint<R: Real>(t: R, v: Vec3<R>, normal: Vec3<R>, seed: RayAdjoint<R>) -> RayAdjoint<R> {
    let gain = seed.x.dot(v) + seed.path * v.dot(v);
    let x = seed.x - normal * (gain / normal.dot(v));
    RayAdjoint { x, v: seed.v + x * t + v * (R::TWO * t * seed.path), path: seed.path }
}

/// The Hessian of a face, twice the diagonal matrix of `square`, times a vector.
fn diagonal_hessian_times<R: Real>(square: Vec3<R>, v: Vec3<R>) -> Vec3<R> {
    Vec3::new(square.x * v.x, square.y * v.y, square.z * v.z) * R::TWO
}

/// Snell's law: the tangential part of `v` is kept, its length becomes the square root of `square`;
/// `None` for total reflection.
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

/// The adjoint of [`refract`] with respect to its arguments.
struct RefractAdjoint<R> {
    v: Vec3<R>,
    normal: Vec3<R>,
    square: R,
}

/// The adjoint of [`refract`], where refraction is possible.
fn refract_adjoint<R: Real>(
    v: Vec3<R>,
    normal: Vec3<R>,
    square: R,
    seed: Vec3<R>,
) -> RefractAdjoint<R> {
    let scale = R::ONE / normal.dot(normal).sqrt();
    let unit = normal * scale;
    let along = v.dot(unit);
    let root = (along * along - v.dot(v) + square).sqrt();
    let root = R::select(along < R::ZERO, -root, root);
    let by_jump = seed.dot(unit);
    let by_radicand = by_jump / (R::TWO * root);
    let by_along = R::TWO * along * by_radicand - by_jump;
    let by_unit = seed * (root - along) + v * by_along;
    RefractAdjoint {
        v: seed + unit * by_along - v * (R::TWO * by_radicand),
        normal: (by_unit - unit * unit.dot(by_unit)) * scale,
        square: by_radicand,
    }
}
