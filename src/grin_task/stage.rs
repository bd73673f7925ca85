//! The screens and rings of a view.

use super::check::GrinTaskError;
use super::image::Screen;
use super::ring::RingTarget;
use super::space::radians;
use super::task::{Domain, LightGoal, LightView};
use crate::grin::Face;

/// The plane behind the domain in which the light of a view is evaluated; `None` for its boundary
/// or infinity.
pub(super) fn screen_face(view: &LightView, space: Domain) -> Option<Face<f64>> {
    match (&view.goal, &view.source) {
        (LightGoal::Image { distance, .. } | LightGoal::Ring { distance, .. }, source) => {
            Some(space.plane_behind(source.axis()?, *distance))
        }
        _ => None,
    }
}

/// The image screen of a view.
pub(super) fn image_screen(
    view: &LightView,
    space: Domain,
) -> Result<Option<Screen>, GrinTaskError> {
    let Some(direction) = view.source.axis() else { return Ok(None) };
    let (half, drawing, pixels) = match &view.goal {
        LightGoal::Image { drawing, half, pixels, .. } => (*half, drawing, *pixels),
        LightGoal::Far { drawing, angle, pixels } => (radians(*angle).tan(), drawing, *pixels),
        _ => return Ok(None),
    };
    let screen = Screen::new(screen_face(view, space), direction, half, (drawing, pixels));
    let place = || format!("view {}", view.name);
    screen.map(Some).map_err(|source| GrinTaskError::Picture { place: place(), source })
}

/// The rings of a view.
pub(super) fn ring_target(view: &LightView) -> Option<RingTarget> {
    let LightGoal::Ring { radius, angle, far, .. } = view.goal else { return None };
    Some(RingTarget::new(view.source.axis()?, radius, angle, far))
}

#[cfg(test)]
mod tests {
    use crate::grin_task::hold::FieldPenalties;
    use crate::grin_task::measured::measure_targets;
    use crate::grin_task::medium::GrinField;
    use crate::grin_task::scene::{evaluate, plan_views, view_rays};
    use crate::grin_task::source::RaySet;
    use crate::grin_task::{GrinTask, LightGoal, LightSource, find_builtin};
    use crate::math::Vec3;

    /// A task with few rays, traced so accurately that its loss is smooth.
    fn smooth(name: &str) -> Option<GrinTask> {
        let mut task = find_builtin(name)?.task().ok()?;
        (task.tracing, task.tolerance) = (None, 1e-6);
        for view in &mut task.views {
            if let LightSource::Beam { rays, .. } = &mut view.source {
                *rays = 20;
            }
            if let LightGoal::Image { pixels, .. } | LightGoal::Far { pixels, .. } = &mut view.goal
            {
                *pixels = 8;
            }
        }
        Some(task)
    }

    /// The directional derivative of the loss along a change of the field, by the adjoint and by
    /// differences.
    fn slopes(task: &GrinTask) -> Option<[f64; 2]> {
        let wave = |p: Vec3<f64>| 1.1 + 0.02 * (2.0 * p.x + p.y).sin() * (p.z - 0.4 * p.x).cos();
        let medium = GrinField::from_function(task.field, 6, wave).ok()?;
        let setups = plan_views(task, medium.field(), RaySet::Scoring).ok()?;
        let shots = view_rays(task, &measure_targets(task).ok()?, &setups, RaySet::Scoring).ok()?;
        let hold = FieldPenalties::new(task);
        let count = medium.field().parameters().len();
        let change: Vec<f64> = (0..count).map(|i| (0.7 * i as f64).sin()).collect();
        let moved = |by: f64| {
            let mut other = medium.clone();
            let numbers = other.parameters_mut().iter_mut().zip(&change);
            numbers.for_each(|(value, change)| *value += by * change);
            Some(evaluate(other.field(), &shots, &hold).ok()?.loss)
        };
        let found = evaluate(medium.field(), &shots, &hold).ok()?;
        let adjoint = found.gradient.iter().zip(&change).map(|(g, c)| g * c).sum();
        let step = 1e-6;
        Some([adjoint, (moved(step)? - moved(-step)?) / (2.0 * step)])
    }

    #[test]
    fn gradients_of_what_a_beam_shows_are_those_of_differences() {
        for name in ["display", "multifocal", "caustic-near", "caustic-far", "caustic"] {
            let Some([adjoint, difference]) = smooth(name).as_ref().and_then(slopes) else {
                panic!("{name} cannot be evaluated")
            };
            let off = (adjoint - difference).abs() / difference.abs();
            assert!(off < 1e-5, "{name}: {adjoint} {difference}");
        }
    }
}
