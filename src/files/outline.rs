//! Outlines of apertures and obscurations of foreign files, as a surface here has them.
//!
//! A circle about the vertex is the rim or the obstruction of a row; any other outline is one of its
//! apertures, in the same place and with the same form.

use crate::lens::{ApertureShape, BlockedSide, Lens, LensError, Row, SurfaceAperture, SystemError};

/// The form of an outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OutlineForm {
    Circle,
    Rectangle,
    Ellipse,
}

/// The outline of an aperture or an obscuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ForeignOutline {
    pub(super) form: OutlineForm,
    /// The half widths along x and y.
    pub(super) half: [f64; 2],
    /// The place of its centre beside the vertex.
    pub(super) offset: [f64; 2],
    /// The angle by which it is turned about its centre, from +x towards +y, in degrees.
    pub(super) angle: f64,
}

impl ForeignOutline {
    /// Writes the outline into a row, its lengths times `unit`: as the rim or the obstruction if it is a circle
    /// about the vertex and that is still free, else as a further aperture.
    pub(super) fn add_to(&self, row: &mut Row, blocks: BlockedSide, unit: f64) {
        let circle = match blocks {
            BlockedSide::Outside => &mut row.semi_diameter,
            BlockedSide::Inside => &mut row.obstruction,
        };
        match self.centred_radius().filter(|_| circle.is_none()) {
            Some(radius) => *circle = Some(radius * unit),
            None => row.apertures.push(self.aperture(blocks).scaled(unit)),
        }
    }

    /// The radius of a circle about the vertex.
    pub(super) fn centred_radius(&self) -> Option<f64> {
        (self.is_circle() && self.offset == [0.0; 2]).then_some(self.half[0])
    }

    fn is_circle(&self) -> bool {
        let round = self.form != OutlineForm::Rectangle && self.half[0] == self.half[1];
        round || self.form == OutlineForm::Circle
    }

    fn aperture(&self, blocks: BlockedSide) -> SurfaceAperture {
        let [half_width, half_height] = self.half;
        let shape = match self.form {
            _ if self.is_circle() => ApertureShape::Circle { radius: half_width },
            OutlineForm::Rectangle => ApertureShape::Rectangle { half_width, half_height },
            OutlineForm::Circle | OutlineForm::Ellipse => {
                ApertureShape::Ellipse { half_width, half_height }
            }
        };
        SurfaceAperture { shape, center: self.offset, angle: self.angle, blocks }
    }

    /// The words of the report.
    pub(super) fn note(&self, blocks: BlockedSide) -> String {
        if self.centred_radius().is_some() {
            return String::new();
        }
        format!("{}: traced", self.aperture(blocks))
    }
}

/// Refuses an aperture that an export cannot hold, where it has no lines of a file of its own kind in place
/// of all of them. `fault` gives the index of such an aperture of a row.
pub(super) fn unwritten_aperture(
    lens: &Lens,
    format: &'static str,
    fault: impl Fn(&Row) -> Option<usize>,
) -> Result<(), LensError> {
    for (i, row) in lens.surfaces.iter().enumerate() {
        let is_kept = row.kept_aperture(format.trim_start_matches('.')).is_some();
        let found = if is_kept || row.apertures.is_empty() { None } else { fault(row) };
        if let Some(k) = found {
            let own = &row.apertures[k];
            let why = format!(
                "({own}) is one that a {format} file cannot hold there; expected the native format (.json)"
            );
            return Err(SystemError::Aperture { surface: i.into(), aperture: k + 1, why }.into());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_about_the_vertex_are_rims_and_all_else_is_an_aperture() {
        let outline = |form, half, offset| ForeignOutline { form, half, offset, angle: 0.0 };
        let mut row = Row::default();
        let (outside, inside) = (BlockedSide::Outside, BlockedSide::Inside);
        outline(OutlineForm::Ellipse, [2.0; 2], [0.0; 2]).add_to(&mut row, outside, 10.0);
        outline(OutlineForm::Circle, [1.0; 2], [0.0; 2]).add_to(&mut row, inside, 10.0);
        assert_eq!((row.semi_diameter, row.obstruction), (Some(20.0), Some(10.0)));
        assert!(row.apertures.is_empty());
        outline(OutlineForm::Circle, [2.0; 2], [1.0, 0.0]).add_to(&mut row, outside, 10.0);
        let turned = outline(OutlineForm::Rectangle, [2.0, 1.0], [0.0; 2]);
        ForeignOutline { angle: 30.0, ..turned }.add_to(&mut row, inside, 1.0);
        let [circle, rectangle] = &row.apertures[..] else { panic!("{:?}", row.apertures) };
        assert_eq!(circle.to_string(), "circle ±20 at 10, 0");
        let text = "obscuring rectangle ±2 x ±1 turned 30";
        assert_eq!(rectangle.to_string(), text);
    }
}
