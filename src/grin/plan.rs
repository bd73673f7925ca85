//! The choice of integrator and step size for a field, with its reasons.
//!
//! On a trilinear grid the force jumps between voxels, which holds every integrator to the first
//! order: the cheapest one with about two steps a voxel is right. A smooth field rewards order 4.
//! The step comes from a sample of rays traced with it and with half of it. The conserved quantity
//! `|v|² - η²` would be cheaper, but it underestimates the error of Blanes and Moan's method up to a
//! hundredfold.

use super::fate::GrinFate;
use super::field::IndexField;
use super::integrator::Integrator;
use super::region::GrinRegion;
use super::setup::{EndCondition, GrinSetup, GrinSetupError, LastStep, LaunchMode};
use super::state::GrinRay;
use super::step::GrinTracer;
use crate::math::Vec3;

/// Rays used to test a step.
const SAMPLE: usize = 64;
/// Largest number of tried step sizes.
const TRIES: usize = 24;
/// After this many step sizes in a row that do not halve an error of this fraction of the path,
/// light counts as chaotic: smaller steps do not reduce the error, and their number explodes.
const MAX_STALLED: usize = 3;
const CHAOTIC_ERROR: f64 = 0.1;
/// A ray may be this many times longer than the longest straight path through the region.
const MAX_RELATIVE_LENGTH: f64 = 32.0;
/// Most steps along a straight path before the plan gives up on a tolerance.
const MAX_STEPS: f64 = 1e6;
/// Most steps per voxel where the force jumps.
const MAX_STEPS_PER_VOXEL: f64 = 16.0;
/// Steps that are a simple fraction of a voxel would sample the same place of every voxel, and on a
/// ray along the grid its faces, where rounding decides to which voxel a point belongs.
const INCOMMENSURATE: f64 = 0.974;

/// A tracing setup and the reasons for it.
#[derive(Debug, Clone, PartialEq)]
pub struct TracingPlan {
    /// The setup to trace with.
    pub setup: GrinSetup<f64>,
    /// The largest change of an exit position in the sample when the step is halved, a length.
    pub error: f64,
    /// True if that change is within the tolerance.
    pub is_within_tolerance: bool,
    /// A sentence for each decision, with the number it rests on.
    pub reasons: Vec<String>,
}

/// Chooses integrator, step and last step for light in a region, so that exit positions are
/// accurate to `tolerance`, judged by a sample of the rays.
///
/// # Errors
/// An empty region.
pub fn plan_tracing<F: IndexField<f64> + ?Sized>(
    field: &F,
    region: &GrinRegion<f64>,
    launch: LaunchMode,
    rays: &[GrinRay<f64>],
    tolerance: f64,
) -> Result<TracingPlan, GrinSetupError> {
    let stride = rays.len().div_ceil(SAMPLE).max(1);
    let sample: Vec<GrinRay<f64>> = rays.iter().step_by(stride).copied().collect();
    let path = sample.iter().map(|ray| straight_path(region, ray)).fold(0.0, f64::max);
    let path = if path > 0.0 { path } else { 1.0 };
    let mut reasons = Vec::new();
    let (integrator, last) = choose_integrator(field, &mut reasons);
    let longest = longest_step(field, integrator, &sample, path, &mut reasons);
    let setup = |step: f64| GrinSetup {
        integrator,
        step,
        launch,
        end: EndCondition::Boundary {
            region: region.clone(),
            last,
            limit: (MAX_RELATIVE_LENGTH * path / step).clamp(64.0, f64::from(u32::MAX)) as u32,
        },
        screen: None,
    };
    // Where the force jumps, the error does not decrease further once a voxel has several steps.
    let (finest, order) = if field.resolution().continuous_force {
        (path / MAX_STEPS, integrator.order())
    } else {
        (longest / MAX_STEPS_PER_VOXEL, 1)
    };
    let steps = StepSearch { longest, finest, order, tolerance, chaotic: CHAOTIC_ERROR * path };
    let (step, error) =
        steps.find(|step| exit_change(field, &setup(step), &setup(0.5 * step), &sample))?;
    let reached = error <= tolerance;
    let verdict = if reached { "within" } else { "not within" };
    reasons.push(format!(
        "step {step:.3e}: halving it moves the exits of {} rays by at most {error:.1e}, {verdict} {tolerance:.1e}",
        sample.len(),
    ));
    Ok(TracingPlan { setup: setup(step), error, is_within_tolerance: reached, reasons })
}

/// The search for a step size whose error is within a tolerance.
struct StepSearch {
    /// The step size to begin with.
    longest: f64,
    /// The step size below which the search gives up.
    finest: f64,
    /// The power of the step size with which the error decreases.
    order: u32,
    tolerance: f64,
    /// Only errors above this count as stalled.
    chaotic: f64,
}

impl StepSearch {
    /// The last step size tried, and its error.
    fn find(
        &self,
        error_of: impl Fn(f64) -> Result<f64, GrinSetupError>,
    ) -> Result<(f64, f64), GrinSetupError> {
        let (mut step, mut error) = (self.longest, f64::INFINITY);
        let (mut least, mut stalled) = (f64::INFINITY, 0);
        for _ in 0..TRIES {
            error = error_of(step)?;
            stalled = if error < (0.5 * least).max(self.chaotic) { 0 } else { stalled + 1 };
            least = least.min(error);
            if error <= self.tolerance || step <= self.finest || stalled == MAX_STALLED {
                break;
            }
            let factor = (0.8 * self.tolerance / error).powf(1.0 / f64::from(self.order));
            step = (step * factor.clamp(0.2, 0.7)).max(self.finest);
        }
        Ok((step, error))
    }
}

/// The integrator and the last step that suit the continuity of the force.
fn choose_integrator<F: IndexField<f64> + ?Sized>(
    field: &F,
    reasons: &mut Vec<String>,
) -> (Integrator, LastStep) {
    if field.resolution().continuous_force {
        reasons.push(
            "blanes_moan: the force is smooth, and this is the most accurate for a given number of \
             kicks; the last step is cut to length, which keeps its order"
                .into(),
        );
        return (Integrator::BlanesMoan, LastStep::Fractional);
    }
    reasons.push(
        "leapfrog_dkd: the force jumps between voxels, so no order beyond the first is to be had; \
         the last step is a broken line, which costs no accuracy between kicks"
            .into(),
    );
    (Integrator::LeapfrogDkd, LastStep::BrokenLine)
}

/// The longest step to try first.
fn longest_step<F: IndexField<f64> + ?Sized>(
    field: &F,
    integrator: Integrator,
    rays: &[GrinRay<f64>],
    path: f64,
    reasons: &mut Vec<String>,
) -> f64 {
    let free = path / if integrator.order() > 2 { 4.0 } else { 32.0 };
    let Some(voxel) = field.resolution().voxel else { return free };
    // The ray moves by η times the step.
    let index = rays.iter().map(|ray| field.sample(ray.x).index).fold(1.0, f64::max);
    let limit = INCOMMENSURATE * voxel / index;
    if limit >= free {
        return free;
    }
    reasons.push(format!(
        "at most one voxel of {voxel:.3e} a step, so that the gradient reaches every voxel, and no \
         simple fraction of it"
    ));
    limit
}

/// The length of the straight path of a ray through the region, in σ.
fn straight_path(region: &GrinRegion<f64>, ray: &GrinRay<f64>) -> f64 {
    let start = match region.entry(ray.x, ray.v) {
        Some((_, t)) if region.level(ray.x) > 0.0 => ray.x + ray.v * t,
        _ => ray.x,
    };
    let ahead = |n| region.face(n).crossings(start, ray.v).unwrap_or([f64::INFINITY; 2]);
    let size = start.dot(start).sqrt() * 1e-9;
    let far = (0..region.face_count())
        .flat_map(ahead)
        .filter(|t| *t > size)
        .fold(f64::INFINITY, f64::min);
    if far.is_finite() { far } else { 0.0 }
}

/// The largest change of an exit position between two setups, over the rays that arrive with both.
fn exit_change<F: IndexField<f64> + ?Sized>(
    field: &F,
    coarse: &GrinSetup<f64>,
    fine: &GrinSetup<f64>,
    rays: &[GrinRay<f64>],
) -> Result<f64, GrinSetupError> {
    let trace =
        |setup: &GrinSetup<f64>| GrinTracer::new(field, setup.clone()).map(|t| t.trace_batch(rays));
    let length = |v: Vec3<f64>| v.dot(v).sqrt();
    let pairs = trace(coarse)?.into_iter().zip(trace(fine)?);
    let moved = pairs.map(|(a, b)| match (a.fate, b.fate) {
        (a_fate, b_fate) if a_fate.has_arrived() && b_fate.has_arrived() => length(a.x - b.x),
        (GrinFate::Trapped | GrinFate::NeverEntered, _) => 0.0,
        (a_fate, b_fate) if a_fate == b_fate => 0.0,
        _ => f64::INFINITY,
    });
    Ok(moved.fold(0.0, f64::max))
}
