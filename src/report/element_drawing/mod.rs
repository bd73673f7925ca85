//! The drawing of one element after ISO 10110: its section with dimensions, and the table of both surfaces
//! and the material.
//!
//! Tolerances are those of the lens file; a dash stands for what it does not say. The codes: 0/ stress
//! birefringence, 1/ bubbles, 2/ homogeneity and striae, 3/ surface form in fringes of 546.07 nm as
//! power(irregularity), 4/ centring, 5/ imperfections.

mod indications;
mod section;

use super::body::LensBody;
use super::error::ReportError;
use super::layout_drawing::LayoutScene;
use super::materials::material_name;
use super::sheet::{DrawingSheet, standard_scale};
use crate::lens::{Lens, SurfaceNumber};
use crate::math::ShortNumber;
use crate::plot::{Pen, SheetScale, TextAlign, VectorDrawing};
use indications::{ElementTolerances, material_column, surface_column};
use section::draw_section;

/// The height of the table above the title field, and of its heads and lines, in mm.
const TABLE: f64 = 52.0;
const HEAD: f64 = 7.0;
const LINE: f64 = 5.4;
/// The distance of the frame from the edge of the sheet, in mm.
const MARGIN: f64 = 10.0;
/// The room for dimensions around the section, in mm.
const DIMENSIONS: [f64; 2] = [90.0, 46.0];

/// The drawing of the element with a number, from 1, of a lens at a zoom position.
///
/// # Errors
/// A lens through which no ray can be traced, a number that no element has, or an element that is not a
/// solid of revolution.
pub fn element_drawing(
    lens: &Lens,
    zoom: usize,
    number: usize,
) -> Result<VectorDrawing, ReportError> {
    let scene = LayoutScene::new(lens, zoom)?;
    let bodies = scene.bodies();
    let body = chosen_body(&bodies, number)?;
    Ok(ElementSheet { lens, bodies: &bodies, body }.drawn())
}

/// The element with this number.
///
/// # Errors
/// A number that no element has, or an element that is not a solid of revolution.
pub(super) fn chosen_body(bodies: &[LensBody], number: usize) -> Result<&LensBody, ReportError> {
    if bodies.is_empty() {
        return Err(ReportError::NoBodies);
    }
    let body = bodies.iter().find(|body| body.number == number);
    let expected = if bodies.len() == 1 { "1".into() } else { format!("1 to {}", bodies.len()) };
    let body = body.ok_or(ReportError::NoElement { found: number, expected })?;
    body.solid().map_err(|source| ReportError::Body { number, source })
}

struct ElementSheet<'a> {
    lens: &'a Lens,
    bodies: &'a [LensBody],
    body: &'a LensBody,
}

impl ElementSheet<'_> {
    fn drawn(&self) -> VectorDrawing {
        let mut sheet = DrawingSheet::a4();
        let [right, bottom] = sheet.frame_end();
        let table_top = bottom - 20.0 - TABLE;
        let room = [right - MARGIN, table_top - MARGIN];
        let (low, high) = self.extent();
        let length = [high - low, 2.0 * self.body.rim()];
        let factor = standard_scale(length, [room[0] - DIMENSIONS[0], room[1] - DIMENSIONS[1]]);
        let x = MARGIN + 0.5 * room[0] - 0.5 * factor * (low + high);
        let y = MARGIN + 0.5 * room[1] - 4.0;
        let scale = SheetScale { origin: [x, y], factor };
        let tolerances = ElementTolerances { lens: self.lens, body: self.body };
        draw_section(&mut sheet.drawing, self.body, scale, &tolerances);
        sheet.drawing.scale = Some(scale);
        self.draw_table(&mut sheet.drawing, [MARGIN, table_top], right - MARGIN, &tolerances);
        self.draw_notes(&mut sheet.drawing, [MARGIN + 3.0, bottom - 20.0 + 5.0]);
        let material = material_name(&self.body.medium);
        let title = format!(
            "Element {}, surfaces {}: {material}",
            self.body.number,
            self.body.surface_numbers()
        );
        let name = if self.lens.name.is_empty() { "Element" } else { &self.lens.name };
        sheet.finish(name, &title, factor)
    }

    /// The least and the largest z of the body, in mm from its first vertex.
    fn extent(&self) -> (f64, f64) {
        let rim = self.body.rim();
        let z = |side, i: u32| self.body.z(side, rim * f64::from(i) / 50.0);
        let all = || [0, 1].into_iter().flat_map(|side| (0..=50).map(move |i| z(side, i)));
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    }

    fn draw_table(
        &self,
        sheet: &mut VectorDrawing,
        [left, top]: [f64; 2],
        width: f64,
        tolerances: &ElementTolerances<'_>,
    ) {
        let column = width / 3.0;
        sheet.rectangle([left, top], [left + width, top + TABLE], Pen::FRAME);
        sheet.line(&[[left, top + HEAD], [left + width, top + HEAD]], Pen::FRAME);
        let columns = [
            (
                format!("Left surface ({})", SurfaceNumber::new(self.body.surfaces[0])),
                surface_column(tolerances, 0),
            ),
            ("Material".to_owned(), material_column(tolerances)),
            (
                format!("Right surface ({})", SurfaceNumber::new(self.body.surfaces[1])),
                surface_column(tolerances, 1),
            ),
        ];
        for (i, (head, lines)) in columns.into_iter().enumerate() {
            let x = left + i as f64 * column;
            if i > 0 {
                sheet.line(&[[x, top], [x, top + TABLE]], Pen::FRAME);
            }
            sheet.text([x + 0.5 * column, top + 4.9], head, 3.4, TextAlign::Middle);
            for (k, line) in lines.into_iter().enumerate() {
                let y = top + HEAD + 4.4 + LINE * k as f64;
                let size = 3.2_f64.min(3.2 * (column - 6.0) / crate::plot::text_width(&line, 3.2));
                sheet.text([x + 3.0, y], line, size, TextAlign::Left);
            }
        }
    }

    fn draw_notes(&self, sheet: &mut VectorDrawing, [x, y]: [f64; 2]) {
        let mass = match (self.body.mass(), self.body.density()) {
            (Some(mass), Some(density)) => {
                format!("Mass {mass:.3} g at {density:.2} g/cm\u{b3}")
            }
            _ => "Mass unknown: the density of the material is not known".to_owned(),
        };
        let mut notes = vec![
            "Indications according to ISO 10110; \"-\": not in the lens file".to_owned(),
            "3/ in fringes of 546.07 nm over the effective diameter".to_owned(),
            format!("{mass}; volume {} mm\u{b3}", ShortNumber(self.body.volume())),
        ];
        notes.extend(self.cemented());
        for (i, note) in notes.into_iter().enumerate() {
            sheet.text([x, y + 4.4 * i as f64], note, 2.7, TextAlign::Left);
        }
    }

    /// The neighbours with which the element shares a surface.
    fn cemented(&self) -> Option<String> {
        let shared = |other: &LensBody| {
            let is_neighbour = other.number != self.body.number;
            self.body.surfaces.into_iter().find(|s| is_neighbour && other.surfaces.contains(s))
        };
        let joints: Vec<String> = self
            .bodies
            .iter()
            .filter_map(|other| {
                let surface = SurfaceNumber::new(shared(other)?);
                Some(format!("to element {} at surface {surface}", other.number))
            })
            .collect();
        (!joints.is_empty()).then(|| format!("Cemented {}", joints.join(" and ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};
    use crate::plot::{Mark, text_width};

    /// Words can be read, stay within the frame, and notes stand beside the title, below the table.
    #[test]
    fn the_words_of_an_element_are_legible_and_in_their_place() {
        for name in ["achromat_ac254_100", "phone_us7558005_1"] {
            let bundled = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
            let lens = json::read(bundled.text, name).unwrap();
            let drawing = element_drawing(&lens, 0, 1).unwrap();
            let [right, bottom] = drawing.size.map(|length| length - MARGIN);
            let table = bottom - 20.0 - TABLE;
            for mark in &drawing.marks {
                let Mark::Text { at: [x, y], text, size, align, of_sheet, .. } = mark else {
                    continue;
                };
                assert!(*size > 1.2, "{name}: {text} of {size} mm");
                if *of_sheet && *align == TextAlign::Left {
                    let end = x + text_width(text, *size);
                    assert!(*x >= MARGIN && end <= right + 1e-9, "{name}: {text} ends at {end}");
                }
                assert!(*y > MARGIN && *y < bottom, "{name}: {text} at {y}");
                if text.starts_with("Indications") || text.starts_with("Mass") {
                    assert!(*y > table + TABLE, "{name}: {text} at {y}");
                }
            }
        }
    }
}
