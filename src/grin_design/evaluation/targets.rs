//! The targets of rays: simulated measurements, which are their exits from a reference field, and
//! rings.
//!
//! The reference field is traced with the settings for its own kind, and to a tighter tolerance
//! than the field under optimization, so that the optimization does not reproduce its own tracing
//! errors. A ray without information, because it is trapped, chaotic or grazing there, is excluded
//! and counted with its reason.

use super::outcome::{RayCounts, count_rays, is_valid};
use crate::grin::{GrinRay, GrinTracer, RayAdjoint, RayExit, plan_tracing};
use crate::grin_design::GrinTaskError;
use crate::grin_design::task::checks::invalid;
use crate::grin_design::task::geometry::{length, radians, unit};
use crate::grin_design::task::source::{RaySet, SourceRay};
use crate::grin_design::task::{GrinTask, LightGoal, LightView, ReferenceField};
use crate::math::Vec3;

/// The tolerance for the reference field relative to that of the task.
const FINER: f64 = 0.1;

/// The target of a ray.
#[derive(Debug, Clone, Copy)]
pub(in crate::grin_design) struct RayTarget {
    pub(super) x: Vec3<f64>,
    pub(super) v: Vec3<f64>,
    /// The weight of a squared difference in `v`.
    pub(super) direction: f64,
    /// True if the target is known.
    pub(super) measured: bool,
}

/// The measured targets of the views whose rays are the same in every step; `None` for other views.
pub(in crate::grin_design) type MeasuredTargets = Vec<Option<Vec<RayTarget>>>;

/// The simulated measurement of a view in its reference field.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewMeasurement {
    /// The name of the view.
    pub view: String,
    /// The largest angle between a ray and its exit, in radians, over the valid rays.
    pub deflection: f64,
    /// The number of rays with each outcome.
    pub counts: RayCounts,
}

impl GrinTask {
    /// The simulated measurements of the views with the goal `like`, for the scoring rays.
    ///
    /// # Errors
    /// A volume that has not been read.
    pub fn measurements(&self) -> Result<Vec<ViewMeasurement>, GrinTaskError> {
        let measured = |view: &LightView| {
            let LightGoal::Like { field, .. } = &view.goal else { return Ok(None) };
            let space = view.space.unwrap_or(self.space);
            let sources = view.source.rays(space, RaySet::Scoring);
            let exits = trace_reference(self, view, field, &sources)?;
            let angle = |exit: &RayExit<f64>, source: &SourceRay| {
                let chord = length(unit(exit.v) - unit(source.ray.v));
                2.0 * (0.5 * chord).min(1.0).asin()
            };
            let pairs = exits.iter().zip(&sources).filter(|(exit, _)| is_valid(exit));
            let deflection = pairs.map(|(exit, source)| angle(exit, source)).fold(0.0, f64::max);
            Ok(Some(ViewMeasurement {
                view: view.name.clone(),
                deflection,
                counts: count_rays(&exits),
            }))
        };
        self.views.iter().filter_map(|view| measured(view).transpose()).collect()
    }
}

/// Traces the rays of a view through its reference field, and back.
fn trace_reference(
    task: &GrinTask,
    view: &LightView,
    field: &ReferenceField,
    sources: &[SourceRay],
) -> Result<Vec<RayExit<f64>>, GrinTaskError> {
    let space = view.space.unwrap_or(task.space);
    let place = format!("view {}", view.name);
    let field =
        field.field().map_err(|source| GrinTaskError::Field { place, source: Box::new(source) })?;
    let rays: Vec<GrinRay<f64>> = sources.iter().map(|source| source.ray).collect();
    let finer = FINER * task.tolerance;
    let setup = plan_tracing(&*field, &space.region(), task.launch, &rays, finer)?.setup;
    let tracer = GrinTracer::new(&*field, setup)?;
    let mut exits = tracer.trace_batch(&rays);
    // Retracing finds the chaotic rays.
    tracer.gradient(&rays, &mut exits, &vec![RayAdjoint::default(); rays.len()]);
    Ok(exits)
}

/// The targets of the rays of a view, measured in its reference field.
pub(super) fn trace_targets(
    task: &GrinTask,
    view: &LightView,
    field: &ReferenceField,
    sources: &[SourceRay],
    direction: f64,
) -> Result<Vec<RayTarget>, GrinTaskError> {
    let exits = trace_reference(task, view, field, sources)?;
    if !exits.iter().any(is_valid) {
        let found = "no ray that leaves the field";
        return Err(invalid(format!("view {}", view.name), found, "light that tells something"));
    }
    let target = |exit: &RayExit<f64>| {
        let measured = is_valid(exit);
        RayTarget { x: exit.x, v: exit.v, direction, measured }
    };
    Ok(exits.iter().map(target).collect())
}

/// Measures the targets of all views whose rays are the same in every step.
pub(in crate::grin_design) fn measure_targets(
    task: &GrinTask,
) -> Result<MeasuredTargets, GrinTaskError> {
    let targets = |view: &LightView| match &view.goal {
        LightGoal::Like { field, direction } if !view.source.is_resampled() => {
            let sources = view.source.rays(view.space.unwrap_or(task.space), RaySet::Scoring);
            trace_targets(task, view, field, &sources, *direction).map(Some)
        }
        _ => Ok(None),
    };
    task.views.iter().map(targets).collect()
}

/// A shorter vector has no direction.
const MIN_LENGTH: f64 = 1e-9;

/// Two rings about the direction of a beam.
#[derive(Debug, Clone)]
pub(super) struct RingTarget {
    direction: Vec3<f64>,
    radius: f64,
    /// The sine of the angular radius of the far ring.
    sine: f64,
    /// The weight of a squared difference in direction.
    pub(super) direction_weight: f64,
}

impl RingTarget {
    /// `angle` is the angular radius of the far ring in degrees.
    pub(super) fn new(direction: Vec3<f64>, radius: f64, angle: f64, far: f64) -> Self {
        Self { direction, radius, sine: radians(angle).sin(), direction_weight: far }
    }

    /// The distance vector of a ray from the nearest point of the near ring, and of its unit
    /// direction from that of the far ring. A ray on the axis has no nearest point: the centre
    /// counts instead.
    pub(super) fn residuals(&self, exit: &RayExit<f64>) -> (Vec3<f64>, Vec3<f64>) {
        let across = |v: Vec3<f64>| v - self.direction * v.dot(self.direction);
        let (x, v) = (across(exit.x), across(unit(exit.v)));
        let outwards = if length(x) > MIN_LENGTH { unit(x) } else { Vec3::default() };
        let onwards = if length(v) > MIN_LENGTH { unit(v) } else { outwards };
        (x - outwards * self.radius, v - onwards * self.sine)
    }

    /// The derivative with respect to a velocity of a quantity that depends on its direction.
    pub(super) fn by_velocity(v: Vec3<f64>, by_direction: Vec3<f64>) -> Vec3<f64> {
        let d = unit(v);
        (by_direction - d * d.dot(by_direction)) * (1.0 / length(v))
    }
}

/// The rings of a view.
pub(super) fn ring_target(view: &LightView) -> Option<RingTarget> {
    let LightGoal::Ring { radius, angle, far, .. } = view.goal else { return None };
    Some(RingTarget::new(view.source.axis()?, radius, angle, far))
}
