//! Decentre and tilt of a surface and of its element, and the breaks of the axis before and behind it.

use egui::{Grid, Ui};

use super::row_edit;
use crate::lens::{AxisBreak, Edit, Lens, Row};
use crate::studio::panels::edit_form::{EditForm, heading};
use crate::studio::panels::widgets::hint_beside;

/// The width of a number.
const FIELD: f32 = 52.0;
/// The axes of the numbers.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Something that is decentred and tilted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Placed {
    /// The surface alone.
    Surface,
    /// All surfaces of its element as one body, from the first to the last.
    Element(usize, usize),
    /// The axis in front of the surface, with all that follows.
    AxisBefore,
    /// The axis behind the surface.
    AxisBehind,
}

impl Placed {
    fn title(self) -> String {
        match self {
            Self::Surface => "Surface".to_owned(),
            Self::Element(first, last) => format!("Element {}–{}", first + 1, last + 1),
            Self::AxisBefore => "Axis before".to_owned(),
            Self::AxisBehind => "Axis behind".to_owned(),
        }
    }

    const fn hint(self) -> &'static str {
        match self {
            Self::Surface => {
                "The surface alone: decentred first, then tilted about x, then y, at its vertex; all \
                 behind it stays where it is"
            }
            Self::Element(..) => {
                "All surfaces of the element as one body, about its first vertex; all behind it stays \
                 where it is. It is made of a break of the axis in front and one that takes it back: \
                 after a change of a thickness inside, type the place anew"
            }
            Self::AxisBefore => {
                "A break of the axis in front of the surface: the surface and everything behind it stand \
                 on the new axis"
            }
            Self::AxisBehind => {
                "A break of the axis behind the surface, as at a fold mirror: the thickness is measured \
                 along the new axis"
            }
        }
    }

    /// The accessible beginning of the names of its numbers.
    fn name(self, surface: usize) -> String {
        match self {
            Self::Element(..) => self.title(),
            _ => format!("{} {}", self.title(), surface + 1),
        }
    }

    /// Decentre and tilt, zero where there is none; `None` for an element that cannot be moved as a body.
    fn place(self, lens: &Lens, surface: usize) -> Option<AxisBreak> {
        let row = lens.surfaces.get(surface)?;
        let ([x, y], [about_x, about_y]) = (row.decenter, row.tilt);
        match self {
            Self::Surface => {
                Some(AxisBreak { decenter: [x, y, 0.0], tilt: [about_x, about_y, 0.0] })
            }
            Self::Element(first, last) => lens.group_place((first, last)),
            Self::AxisBefore => Some(row.break_before.unwrap_or_default()),
            Self::AxisBehind => Some(row.break_after.unwrap_or_default()),
        }
    }

    /// The edit that places it there.
    fn edit(self, lens: &Lens, surface: usize, place: AxisBreak) -> Edit {
        let written = (place != AxisBreak::default()).then_some(place);
        let AxisBreak { decenter: [x, y, _], tilt: [about_x, about_y, _] } = place;
        let changed = |change: &dyn Fn(&mut Row)| row_edit(lens, surface, change);
        match self {
            Self::Surface => changed(&|row| {
                (row.decenter, row.tilt) = ([x, y], [about_x, about_y]);
            }),
            Self::AxisBefore => changed(&|row| row.break_before = written),
            Self::AxisBehind => changed(&|row| row.break_after = written),
            Self::Element(first, last) => {
                let mut moved = lens.clone();
                moved.set_group_place((first, last), &place);
                let row = |i: usize| Edit::SetRow { surface: i, row: moved.surfaces[i].clone() };
                let title = format!("place of surfaces {} to {}", first + 1, last + 1);
                Edit::Sequence { title, edits: vec![row(first), row(last)] }
            }
        }
    }

    /// True if a number of it exists: a surface alone has none along z.
    fn has_axis(self, axis: usize) -> bool {
        axis < 2 || self != Self::Surface
    }
}

/// Shows the numbers of all that can be placed at a surface.
pub(super) fn show(ui: &mut Ui, fields: &mut EditForm<'_>, surface: usize) {
    let lens = &fields.view.lens;
    let element = lens.element_around(surface).map(|(first, last)| Placed::Element(first, last));
    let shown =
        [Some(Placed::Surface), element, Some(Placed::AxisBefore), Some(Placed::AxisBehind)];
    heading(ui, "Decentre and tilt");
    Grid::new("places").num_columns(4).spacing([4.0, 2.0]).show(ui, |ui| {
        ui.label("");
        for axis in AXES {
            ui.vertical_centered(|ui| ui.weak(axis));
        }
        ui.end_row();
        for placed in shown.into_iter().flatten() {
            rows(ui, fields, (placed, surface));
        }
    });
}

/// Two rows: displacements in mm and angles in degrees.
fn rows(ui: &mut Ui, fields: &mut EditForm<'_>, (placed, surface): (Placed, usize)) {
    let Some(place) = placed.place(&fields.view.lens, surface) else {
        hint_beside(ui.label(placed.title()), placed.hint());
        ui.weak("has breaks").on_hover_text(
            "Breaks of the axis at this element do not take the axis back: edit them at its surfaces",
        );
        ui.end_row();
        return;
    };
    hint_beside(ui.label(format!("{}, mm", placed.title())), placed.hint());
    for axis in 0..AXES.len() {
        number(ui, fields, (placed, surface), (place, false, axis));
    }
    ui.end_row();
    hint_beside(ui.label("about, °"), placed.hint());
    for axis in 0..AXES.len() {
        number(ui, fields, (placed, surface), (place, true, axis));
    }
    ui.end_row();
}

/// One number of a place: a displacement, or an angle.
fn number(
    ui: &mut Ui,
    fields: &mut EditForm<'_>,
    (placed, surface): (Placed, usize),
    (place, angle, axis): (AxisBreak, bool, usize),
) {
    if !placed.has_axis(axis) {
        ui.label("");
        return;
    }
    let what = if angle { "tilt about" } else { "decentre" };
    let name = format!("{}: {what} {}", placed.name(surface), AXES[axis]);
    let value = if angle { place.tilt[axis] } else { place.decenter[axis] };
    let lens = std::sync::Arc::clone(&fields.view.lens);
    fields.number(ui, &name, (value, FIELD), |value| {
        let mut moved = place;
        let numbers = if angle { &mut moved.tilt } else { &mut moved.decenter };
        numbers[axis] = value;
        placed.edit(&lens, surface, moved)
    });
}
