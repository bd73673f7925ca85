//! Coordinate breaks: a run of them that restores the axis affects no ray and is read as planes; any
//! other is refused.

use super::file::ZemaxSurface;
use crate::files::error::ParseError;
use nalgebra::{Rotation3, Vector3};

/// True for a coordinate break.
pub(super) fn is_break(surface: &ZemaxSurface) -> bool {
    surface.kind.0 == "COORDBRK"
}

/// Refuses runs of coordinate breaks that decentre or tilt the axis.
pub(super) fn check_breaks(surfaces: &[ZemaxSurface]) -> Result<(), ParseError> {
    let mut frame = AxisFrame::default();
    let mut first = None;
    for (number, surface) in surfaces.iter().enumerate() {
        if is_break(surface) {
            first.get_or_insert((number, surface));
            frame.apply(surface);
        }
        let gap = surface.thickness.map_or(0.0, |(value, _)| value);
        let run_ends = !is_break(surface) || gap != 0.0 || number + 1 == surfaces.len();
        let Some((start, at)) = first.filter(|_| run_ends) else { continue };
        if !frame.is_identity() {
            let found = format!("surface {start}, a coordinate break that is not undone");
            let expected = "surfaces that are centred on the axis".to_owned();
            return Err(ParseError { place: format!("line {}", at.kind.1), found, expected });
        }
        (frame, first) = (AxisFrame::default(), None);
    }
    Ok(())
}

/// The current frame relative to the frame before the run: a point `q` becomes `p = R q + d`.
struct AxisFrame {
    rotation: Rotation3<f64>,
    shift: Vector3<f64>,
}

impl Default for AxisFrame {
    fn default() -> Self {
        Self { rotation: Rotation3::identity(), shift: Vector3::zeros() }
    }
}

impl AxisFrame {
    /// Applies a break. Parameters: 1, 2 decentre; 3, 4, 5 tilts about x, y, z in degrees; 6: zero for
    /// decentre first and tilts in this order, else the reverse.
    fn apply(&mut self, surface: &ZemaxSurface) {
        let value = |index| {
            let found = surface.parameters.iter().rfind(|(i, ..)| *i == index);
            found.map_or(0.0, |(_, value, _)| *value)
        };
        let decentre = Vector3::new(value(1), value(2), 0.0);
        let about = |axis, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
        let [x, y, z] = [(Vector3::x_axis(), 3), (Vector3::y_axis(), 4), (Vector3::z_axis(), 5)]
            .map(|(axis, index)| about(axis, value(index)));
        if value(6) == 0.0 {
            self.shift += self.rotation * decentre;
            self.rotation *= x * y * z;
        } else {
            self.rotation *= z * y * x;
            self.shift += self.rotation * decentre;
        }
    }

    fn is_identity(&self) -> bool {
        let tilt = (self.rotation.matrix() - nalgebra::Matrix3::identity()).amax();
        // Not written with `>`, so that NaN is not the identity.
        tilt < 1e-12 && self.shift.amax() < 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coordinate_break(parameters: [f64; 6]) -> ZemaxSurface {
        let numbered = (1..).zip(parameters).map(|(i, value)| (i, value, 0)).collect();
        ZemaxSurface {
            kind: ("COORDBRK".to_owned(), 7),
            parameters: numbered,
            thickness: Some((0.0, 8)),
            ..ZemaxSurface::default()
        }
    }

    #[test]
    fn a_break_and_its_inverse_cancel() {
        let there = coordinate_break([1.0, -2.0, 10.0, 20.0, 30.0, 0.0]);
        let back = coordinate_break([-1.0, 2.0, -10.0, -20.0, -30.0, 1.0]);
        assert!(check_breaks(&[there, back]).is_ok());
        assert!(check_breaks(&[coordinate_break([0.0; 6])]).is_ok());
    }

    #[test]
    fn a_break_that_stays_is_refused() {
        let there = || coordinate_break([0.0, 0.0, 45.0, 0.0, 0.0, 0.0]);
        let error =
            check_breaks(&[ZemaxSurface::default(), there(), ZemaxSurface::default()]).unwrap_err();
        assert_eq!(error.place, "line 7");
        assert!(error.found.contains("surface 1"));
        // With a surface between them the two breaks tilt that surface.
        let back = || coordinate_break([0.0, 0.0, -45.0, 0.0, 0.0, 1.0]);
        assert!(check_breaks(&[there(), ZemaxSurface::default(), back()]).is_err());
        let same_order = coordinate_break([1.0, 0.0, -45.0, 0.0, 0.0, 0.0]);
        assert!(check_breaks(&[there(), same_order]).is_err());
    }
}
