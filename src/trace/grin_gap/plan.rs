//! The number of steps for a gap with a GRIN medium.
//!
//! A few rays that fill the gap are traced with a number of steps and with twice as many, until that
//! moves none of them by more than a tolerance. The number is a power of two, so that it stays the
//! same while an optimizer changes the lens; it depends only on the gap and its two surfaces, so that
//! every number type takes the same steps.

use super::{GrinGap, INTEGRATOR};
use crate::grin::RayState;
use crate::lens::{ProfileLaw, RADIAL_TERMS, RotationalProfile, SystemError};
use crate::math::{Real, Vec3};
use crate::trace::interface::Interface;
use serde::Serialize;

/// The largest number of steps that is tried.
const MAX_STEPS: u32 = 4096;
/// The permitted length of a ray, as a multiple of the length on the axis.
const MAX_LENGTH_RATIO: u32 = 8;

/// The steps of one gap, and their accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinStepPlan {
    /// The index of the surface in front of the gap.
    pub surface: usize,
    /// The number of steps of a ray along the axis.
    pub steps: u32,
    /// The largest change when the steps are halved, of a position in mm or of a direction times the
    /// length of the gap.
    pub error: f64,
    /// The largest permitted change, in mm.
    pub tolerance: f64,
    /// The number of evaluations of the field for a ray along the axis.
    pub kicks: u32,
    /// The length of a step in σ, in mm over the index.
    pub step: f64,
}

impl<R: Real> GrinGap<R> {
    /// Prepares a gap between two surfaces; `number` is the index of the first one, and `tolerance` the permitted
    /// error of a ray behind the gap as a part of its length.
    ///
    /// # Errors
    /// A GRIN medium that is too strong for any number of steps.
    pub(in crate::trace) fn new(
        field: RotationalProfile<R>,
        number: usize,
        faces: [&Interface<R>; 2],
        tolerance: f64,
    ) -> Result<(Self, GrinStepPlan), SystemError> {
        let side2 = R::select(faces[0].rim2 > faces[1].rim2, faces[0].rim2, faces[1].rim2);
        let plain = RotationalProfile {
            base: field.base.value(),
            coefficients: field.coefficients.map(Real::value),
        };
        let plan = choose_steps(&plain, (number, tolerance), &faces.map(Interface::value))?;
        let gap = Self {
            field,
            ops: INTEGRATOR.ops(),
            step: R::from_f64(plan.step),
            max_steps: MAX_LENGTH_RATIO * plan.steps + 64,
            side2,
        };
        Ok((gap, plan))
    }
}

/// Tries powers of two as the number of steps.
fn choose_steps(
    field: &RotationalProfile<f64>,
    (surface, tolerance): (usize, f64),
    faces: &[Interface<f64>; 2],
) -> Result<GrinStepPlan, SystemError> {
    let reach = trial_radius(field, faces[1].gap.abs());
    let length = longest_length(faces, reach);
    let whole = length / field.base;
    let trial = |steps: u32| GrinGap {
        field: *field,
        ops: INTEGRATOR.ops(),
        step: whole / f64::from(steps),
        max_steps: steps,
        side2: f64::INFINITY,
    };
    let starts = trial_rays(field, &faces[0], reach, faces[1].sense);
    let allowed = tolerance * length;
    let mut steps = min_steps(field, reach, whole);
    let mut error = f64::INFINITY;
    while steps <= MAX_STEPS {
        let tried = [*field, with_trial_terms(field, reach, length)].map(|field| {
            let gaps = [steps, 2 * steps].map(|steps| GrinGap { field, ..trial(steps) });
            let moved = starts.iter().map(|s| end_difference(s, &gaps[0], &gaps[1], reach, length));
            moved.fold(0.0, f64::max)
        });
        error = tried[0];
        if error <= allowed && tried[1] <= allowed / TRIAL_CHANGE {
            let kicks = steps * INTEGRATOR.kicks_per_step() as u32;
            let step = whole / f64::from(steps);
            return Ok(GrinStepPlan { surface, steps, error, tolerance: allowed, kicks, step });
        }
        steps *= 2;
    }
    let why = if error.is_finite() {
        format!(
            "is too strong: with {MAX_STEPS} steps rays still move by {error:.1e} mm when they are \
             halved, and {allowed:.1e} mm is allowed"
        )
    } else {
        format!("is too strong for {MAX_STEPS} steps")
    };
    Err(SystemError::Grin { surface: surface.into(), why })
}

/// The least number of steps that is tried: in one step light may turn by about a third of a right
/// angle, because with fewer steps rays would leave the glass and hide the error.
fn min_steps(field: &RotationalProfile<f64>, reach: f64, whole: f64) -> u32 {
    let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
    let places = [0.0, 0.5, 1.0].map(|share| Vec3::new(0.0, share * reach, 0.0));
    let bends = places
        .iter()
        .flat_map(|at| axes.map(|along| field.force_derivative(*at, along).dot(along)));
    let strongest = bends.fold(0.0, |most: f64, bend| most.max(bend.abs()));
    let turns = whole * strongest.sqrt();
    // Otherwise more than the largest number that is tried.
    if turns < f64::from(MAX_STEPS) {
        (turns.ceil() as u32).max(1).next_power_of_two()
    } else {
        2 * MAX_STEPS
    }
}

/// The relative change of the index by which an active coefficient that is zero is raised.
const TRIAL_CHANGE: f64 = 1e-3;

/// The same field with the active coefficients that are zero raised, because an optimizer is about to
/// change them.
fn with_trial_terms(
    field: &RotationalProfile<f64>,
    reach: f64,
    length: f64,
) -> RotationalProfile<f64> {
    let mut field = *field;
    let [radial, axial] = field.coefficients.used;
    let across = (0..radial).map(|i| (i, reach.powi(2 * i as i32 + 2)));
    let along = (0..axial).map(|j| (RADIAL_TERMS + j, length.powi(j as i32 + 1)));
    for (k, power) in across.chain(along) {
        let term = &mut field.coefficients.terms[k];
        if *term == 0.0 && field.coefficients.law != ProfileLaw::Sech {
            *term = TRIAL_CHANGE * field.base / power;
        }
    }
    field
}

/// The distance from the axis up to which rays are tried: that of the rim or, without a rim, that at
/// which the index has changed by a twentieth, but at most the length of the gap.
fn trial_radius(field: &RotationalProfile<f64>, length: f64) -> f64 {
    if field.coefficients.reach.is_finite() {
        return field.coefficients.reach;
    }
    let length = if length > 0.0 { length } else { 1.0 };
    let changes = |r: f64| {
        let change = field.index(Vec3::new(r, 0.0, 0.0)) - field.base;
        !(change.abs() < 0.05 * field.base)
    };
    let mut r = 1e-3 * length;
    while r < length && !changes(1.25 * r) {
        r *= 1.25;
    }
    r
}

/// The largest length of the gap, in mm.
fn longest_length(faces: &[Interface<f64>; 2], reach: f64) -> f64 {
    let edge = |face: &Interface<f64>| {
        let sag = face.sag(reach * reach).0;
        if sag.is_finite() { sag } else { 0.0 }
    };
    let along = faces[1].gap.abs();
    let at_rim = (faces[1].gap + edge(&faces[1]) - edge(&faces[0])).abs();
    // A gap between surfaces that touch has no length on the axis, but a ray may cross it.
    along.max(at_rim).max(1e-3 * reach)
}

/// Rays at the first surface, through its vertex, its zone and its rim, parallel to the axis and
/// inclined.
fn trial_rays(
    field: &RotationalProfile<f64>,
    face: &Interface<f64>,
    reach: f64,
    sense: f64,
) -> Vec<RayState<f64>> {
    let mut starts = Vec::new();
    for height in [0.0, 0.6, 1.0] {
        let y = height * reach;
        let sag = face.sag(y * y).0;
        let x = Vec3::new(0.0, y, if sag.is_finite() { sag } else { 0.0 });
        let n = field.index(x);
        for slope in [0.0, -0.15, 0.25] {
            let direction = Vec3::new(0.3 * slope, slope, sense);
            let v = direction * (n / direction.dot(direction).sqrt());
            starts.push(RayState { x, v, path: 0.0 });
        }
    }
    starts
}

/// The difference between the ends of a ray with two numbers of steps; 0 for a ray that leaves the
/// glass.
fn end_difference(
    start: &RayState<f64>,
    coarse: &GrinGap<f64>,
    fine: &GrinGap<f64>,
    reach: f64,
    length: f64,
) -> f64 {
    let end = |gap: &GrinGap<f64>| {
        let mut state = *start;
        for _ in 0..gap.max_steps {
            state = gap.advance(state, gap.step);
            let inside = state.x.x.hypot(state.x.y) <= 1.1 * reach && state.v.is_finite();
            if !inside {
                return None;
            }
        }
        Some(state)
    };
    let (Some(a), Some(b)) = (end(coarse), end(fine)) else {
        // A ray that leaves with only one of the two numbers of steps is an error.
        return if end(fine).is_none() { 0.0 } else { f64::INFINITY };
    };
    let size = |v: Vec3<f64>| v.dot(v).sqrt();
    let turned = length * size(a.v - b.v) / coarse.field.base;
    size(a.x - b.x).max(turned).max((a.path - b.path).abs())
}
