//! The rays of the views of a task, with their targets and tracing setups.

use super::screen::{Screen, image_screen, screen_face};
use super::targets::{MeasuredTargets, RayTarget, RingTarget, ring_target, trace_targets};
use crate::grin::{EndCondition, GrinRay, GrinSetup, IndexField, LastStep, plan_tracing};
use crate::grin_design::GrinTaskError;
use crate::grin_design::task::source::{RaySet, SourceRay};
use crate::grin_design::task::{Domain, GrinTask, LightGoal, LightView, TracingSettings};
use crate::math::Vec3;

/// Steps tied to voxels are not a simple fraction of one; without voxels they are tied to this
/// fraction of the domain; and a ray counts as trapped when it is this many times longer than the
/// domain.
const INCOMMENSURATE: f64 = 0.974;
const RELATIVE_STEP: f64 = 0.02;
const MAX_RELATIVE_LENGTH: f64 = 32.0;

/// The rays of a view, ready to be traced.
#[derive(Debug, Clone)]
pub(in crate::grin_design) struct ViewRays {
    pub(in crate::grin_design) rays: Vec<GrinRay<f64>>,
    pub(super) targets: Vec<RayTarget>,
    pub(in crate::grin_design) setup: GrinSetup<f64>,
    pub(super) weight: f64,
    /// The penalty of an excluded ray, in mm²: more than that of any valid one.
    pub(super) lost_penalty: f64,
    /// The screen of an image.
    pub(in crate::grin_design) screen: Option<Screen>,
    /// The rings that rays should pass through, anywhere on them.
    pub(super) ring: Option<RingTarget>,
    /// The number of rays without a known target; they are not among the others.
    pub(super) unmeasured: usize,
}

impl GrinTask {
    /// The domain of a view, and its scoring rays.
    pub fn scoring_rays(&self, view: &LightView) -> (Domain, Vec<GrinRay<f64>>) {
        let space = view.space.unwrap_or(self.space);
        let rays = view.source.rays(space, RaySet::Scoring);
        (space, rays.into_iter().map(|source| source.ray).collect())
    }
}

/// The tracing setup of each view, chosen for the current field.
pub(in crate::grin_design) fn plan_views(
    task: &GrinTask,
    field: &dyn IndexField<f64>,
    set: RaySet,
) -> Result<Vec<GrinSetup<f64>>, GrinTaskError> {
    let setup = |view: &LightView| {
        let space = view.space.unwrap_or(task.space);
        let rays: Vec<GrinRay<f64>> = view.source.rays(space, set).iter().map(|s| s.ray).collect();
        let mut setup = match task.tracing {
            Some(tracing) => tie_to_voxels(task, field, space, tracing),
            None => plan_tracing(field, &space.region(), task.launch, &rays, task.tolerance)?.setup,
        };
        setup.screen = screen_face(view, space);
        Ok(setup)
    };
    task.views.iter().map(setup).collect()
}

/// A setup with steps tied to the voxels, or to the domain where the field has none.
fn tie_to_voxels(
    task: &GrinTask,
    field: &dyn IndexField<f64>,
    space: Domain,
    tracing: TracingSettings,
) -> GrinSetup<f64> {
    let voxel = field.resolution().voxel.unwrap_or(RELATIVE_STEP * space.diameter());
    let step = INCOMMENSURATE * voxel / tracing.per_voxel;
    let limit = (MAX_RELATIVE_LENGTH * space.diameter() / step).clamp(64.0, 1e9) as u32;
    let end = EndCondition::Boundary { region: space.region(), last: LastStep::BrokenLine, limit };
    let TracingSettings { integrator, .. } = tracing;
    GrinSetup { integrator, step, launch: task.launch, end, screen: None }
}

/// The rays of every view with their targets.
pub(in crate::grin_design) fn view_rays(
    task: &GrinTask,
    measured: &MeasuredTargets,
    setups: &[GrinSetup<f64>],
    set: RaySet,
) -> Result<Vec<ViewRays>, GrinTaskError> {
    let of_view =
        |((view, setup), measured): ((&LightView, &GrinSetup<f64>), &Option<Vec<RayTarget>>)| {
            let space = view.space.unwrap_or(task.space);
            let RayBundle { rays, targets, unmeasured } =
                ray_bundle(task, view, measured.as_deref(), set)?;
            let lost = space.diameter() * space.diameter();
            let (setup, weight, screen) = (setup.clone(), view.weight, image_screen(view, space)?);
            // The difference of images has no unit.
            let lost = if screen.is_some() { 1.0 } else { lost };
            Ok(ViewRays {
                rays,
                targets,
                setup,
                weight,
                lost_penalty: lost,
                screen,
                ring: ring_target(view),
                unmeasured,
            })
        };
    task.views.iter().zip(setups).zip(measured).map(of_view).collect()
}

/// Replaces the rays of the views by those of another step.
pub(in crate::grin_design) fn resample_views(
    task: &GrinTask,
    measured: &MeasuredTargets,
    views: &mut [ViewRays],
    set: RaySet,
) -> Result<(), GrinTaskError> {
    for ((view, of_view), measured) in task.views.iter().zip(views).zip(measured) {
        let bundle = ray_bundle(task, view, measured.as_deref(), set)?;
        (of_view.rays, of_view.targets, of_view.unmeasured) =
            (bundle.rays, bundle.targets, bundle.unmeasured);
    }
    Ok(())
}

/// The rays of a view with a known target, and the number of others.
struct RayBundle {
    rays: Vec<GrinRay<f64>>,
    targets: Vec<RayTarget>,
    unmeasured: usize,
}

fn ray_bundle(
    task: &GrinTask,
    view: &LightView,
    measured: Option<&[RayTarget]>,
    set: RaySet,
) -> Result<RayBundle, GrinTaskError> {
    let space = view.space.unwrap_or(task.space);
    let sources = view.source.rays(space, set);
    let mut targets = match measured {
        Some(measured) => measured.to_vec(),
        None => ray_targets(task, view, space, &sources)?,
    };
    let is_measured = |i: usize| targets.get(i).is_none_or(|target| target.measured);
    let measured = sources.iter().enumerate().filter(|(i, _)| is_measured(*i));
    let rays: Vec<GrinRay<f64>> = measured.map(|(_, source)| source.ray).collect();
    let unmeasured = sources.len() - rays.len();
    targets.retain(|target| target.measured);
    Ok(RayBundle { rays, targets, unmeasured })
}

fn ray_targets(
    task: &GrinTask,
    view: &LightView,
    space: Domain,
    sources: &[SourceRay],
) -> Result<Vec<RayTarget>, GrinTaskError> {
    let at = |x| RayTarget { x, v: Vec3::default(), direction: 0.0, measured: true };
    Ok(match &view.goal {
        LightGoal::Image { .. } | LightGoal::Far { .. } | LightGoal::Ring { .. } => Vec::new(),
        LightGoal::Point([x, y, z]) => vec![at(Vec3::new(*x, *y, *z)); sources.len()],
        LightGoal::Antipode => {
            let reach = 0.5 * space.diameter();
            sources.iter().map(|source| at(source.antipode * reach)).collect()
        }
        LightGoal::Like { field, direction } => {
            trace_targets(task, view, field, sources, *direction)?
        }
    })
}
