//! Where the light of a beam is looked at: on a screen, at infinity, at rings.

use super::check::TaskError;
use super::image::Screen;
use super::ring::Ring;
use super::space::radians;
use super::task::{Goal, Space, View};
use crate::grin::Face;

/// Where the light of a view is looked at behind its space, unless at its boundary or at infinity.
pub(super) fn face(view: &View, space: Space) -> Option<Face<f64>> {
    match (&view.goal, &view.source) {
        (Goal::Image { distance, .. } | Goal::Ring { distance, .. }, source) => {
            Some(space.behind(source.axis()?, *distance))
        }
        _ => None,
    }
}

/// What a view makes its image on.
pub(super) fn screen(view: &View, space: Space) -> Result<Option<Screen>, TaskError> {
    let Some(direction) = view.source.axis() else { return Ok(None) };
    let (half, drawing, pixels) = match &view.goal {
        Goal::Image { drawing, half, pixels, .. } => (*half, drawing, *pixels),
        Goal::Far { drawing, angle, pixels } => (radians(*angle).tan(), drawing, *pixels),
        _ => return Ok(None),
    };
    let screen = Screen::new(face(view, space), direction, half, (drawing, pixels));
    let place = || format!("view {}", view.name);
    screen.map(Some).map_err(|source| TaskError::Picture { place: place(), source })
}

/// The rings of a view.
pub(super) fn ring(view: &View) -> Option<Ring> {
    let Goal::Ring { radius, angle, far, .. } = view.goal else { return None };
    Some(Ring::new(view.source.axis()?, radius, angle, far))
}

#[cfg(test)]
mod tests {
    use crate::grin_task::hold::Hold;
    use crate::grin_task::measured::known;
    use crate::grin_task::medium::Medium;
    use crate::grin_task::scene::{evaluate, setups, shots};
    use crate::grin_task::source::Draw;
    use crate::grin_task::{Goal, Source, Task, find};
    use crate::math::Vec3;

    /// A task with few rays, traced so well that its loss is smooth.
    fn smooth(name: &str) -> Option<Task> {
        let mut task = find(name)?.task().ok()?;
        (task.tracing, task.tolerance) = (None, 1e-6);
        for view in &mut task.views {
            if let Source::Beam { rays, .. } = &mut view.source {
                *rays = 20;
            }
            if let Goal::Image { pixels, .. } | Goal::Far { pixels, .. } = &mut view.goal {
                *pixels = 8;
            }
        }
        Some(task)
    }

    /// The slope of the loss along a change of the field, by the adjoint and by differences.
    fn slopes(task: &Task) -> Option<[f64; 2]> {
        let wave = |p: Vec3<f64>| 1.1 + 0.02 * (2.0 * p.x + p.y).sin() * (p.z - 0.4 * p.x).cos();
        let medium = Medium::of(task.field, 6, wave).ok()?;
        let setups = setups(task, medium.field(), Draw::Judge).ok()?;
        let shots = shots(task, &known(task).ok()?, &setups, Draw::Judge).ok()?;
        let hold = Hold::new(task);
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
