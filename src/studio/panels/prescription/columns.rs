//! The columns of the table: what they hold, and which of them are shown.

use std::collections::BTreeSet;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Button, Id, PopupCloseBehavior, Ui};
use egui_extras::Column as Width;
use serde::{Deserialize, Serialize};

use crate::lens::{ASPHERE_TERMS, Lens, Medium, PROFILE_TERMS, Parameter, Quantity};
use crate::studio::panels::widgets::hint_beside;

/// A column of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum TableColumn {
    Radius,
    Thickness,
    Glass,
    SemiDiameter,
    Conic,
    Obstruction,
    Apertures,
    Asphere(usize),
    Grin(usize),
    Tolerances,
    Comment,
}

/// Powers of the radius in the titles of asphere columns.
const ASPHERE_TITLES: [&str; ASPHERE_TERMS] = ["r⁴", "r⁶", "r⁸", "r¹⁰", "r¹²", "r¹⁴", "r¹⁶"];
/// Powers in the titles of the columns of gradients.
const GRIN_TITLES: [&str; PROFILE_TERMS] = [
    "GRIN r²",
    "GRIN r⁴",
    "GRIN r⁶",
    "GRIN r⁸",
    "GRIN r¹⁰",
    "GRIN r¹²",
    "GRIN z",
    "GRIN z²",
    "GRIN z³",
    "GRIN z⁴",
];

impl TableColumn {
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Radius => "Radius",
            Self::Thickness => "Thickness",
            Self::Glass => "Glass",
            Self::SemiDiameter => "Semi-diameter",
            Self::Conic => "Conic",
            Self::Obstruction => "Obstruction",
            Self::Apertures => "Apertures",
            Self::Asphere(term) => ASPHERE_TITLES.get(term).copied().unwrap_or("r¹⁶"),
            Self::Grin(term) => GRIN_TITLES.get(term).copied().unwrap_or("GRIN z⁴"),
            Self::Tolerances => "Tolerances",
            Self::Comment => "Remark",
        }
    }

    pub(super) const fn hint(self) -> &'static str {
        match self {
            Self::Radius => {
                "Radius of curvature in mm, positive where the centre lies to the right; \
                 Infinity for a plane. The optimizer works on the curvature 1/R. \
                 Arithmetic starts from the old value: *2, /2, +5, - 3."
            }
            Self::Thickness => "Distance along the axis to the next surface, in mm",
            Self::Glass => {
                "What fills the gap behind the surface; empty for air. The menu of a row (right \
                 button on its number) makes a glass a gradient."
            }
            Self::SemiDiameter => {
                "In mm. Automatic, in grey: it follows the rays of all fields and zoom positions and \
                 clips nothing. Fixed, with the badge U: rays that meet the surface farther from \
                 the axis are clipped. Type a number to fix one, clear the cell to make it \
                 automatic. Most programs do not clip at a semi-diameter: an export says so."
            }
            Self::Conic => "Conic constant: 0 a sphere, -1 a paraboloid",
            Self::Obstruction => {
                "Rays that meet the surface nearer to the axis than this are blocked, in mm: a \
                 central obstruction, or the hole of a mirror; empty for none"
            }
            Self::Apertures => {
                "Apertures that are no circles about the vertex, half widths in mm: rectangle ±3 x ±2 at \
                 0, 1 turned 45; obscuring circle ±2; spider 3 x 0.5 (arms and their width). Clear the \
                 cell to remove them. \"Shape, apertures, tilt\" has a field for each number."
            }
            Self::Asphere(_) => "Coefficient of the even asphere, in powers of mm",
            Self::Grin(_) => "Coefficient of the gradient behind the surface, in powers of mm",
            Self::Tolerances => {
                "Half ranges of the surface, of the gap behind it and of the elements that begin with it: \
                 R radius, t thickness, n index, v Abbe number, irr irregularity; lengths in mm. They are \
                 changed in the panel Tolerances."
            }
            Self::Comment => "A remark on the surface",
        }
    }

    pub(super) fn width(self) -> Width {
        match self {
            Self::Radius => Width::initial(94.0).at_least(70.0),
            Self::Thickness => Width::initial(90.0).at_least(70.0),
            Self::Glass => Width::initial(118.0).at_least(70.0),
            Self::SemiDiameter => Width::initial(114.0).at_least(70.0),
            Self::Conic => Width::initial(76.0).at_least(50.0),
            Self::Obstruction => Width::initial(86.0).at_least(60.0),
            Self::Asphere(_) | Self::Grin(_) => Width::initial(112.0).at_least(60.0),
            Self::Tolerances => Width::initial(190.0).at_least(60.0).clip(true),
            Self::Apertures => Width::initial(230.0).at_least(60.0).clip(true),
            Self::Comment => Width::remainder().at_least(60.0).clip(true),
        }
    }

    pub(super) const fn has_badge(self) -> bool {
        !self.is_text() && !matches!(self, Self::Obstruction)
    }

    /// True for text, which stands to the left.
    pub(super) const fn is_text(self) -> bool {
        matches!(self, Self::Glass | Self::Comment | Self::Apertures | Self::Tolerances)
    }

    /// The number in a row of this column; `None` for text, and for what no optimizer changes.
    pub(super) fn parameter(self, lens: &Lens, zoom: usize, surface: usize) -> Option<Parameter> {
        let quantity = match self {
            Self::Radius => Quantity::Curvature,
            Self::Thickness => Quantity::Thickness,
            Self::SemiDiameter => Quantity::SemiDiameter,
            Self::Conic => Quantity::Conic,
            Self::Asphere(term) => Quantity::Asphere(term),
            Self::Grin(term) => Quantity::Grin(term),
            Self::Glass
            | Self::Comment
            | Self::Obstruction
            | Self::Apertures
            | Self::Tolerances => return None,
        };
        Some(lens.parameter_at(zoom, surface, quantity))
    }
}

/// The name of a number.
pub(super) fn parameter_name(parameter: Parameter) -> String {
    let what = match parameter.quantity {
        Quantity::Curvature => "Radius",
        Quantity::Thickness => "Thickness",
        Quantity::SemiDiameter => "Semi-diameter",
        Quantity::Conic => "Conic",
        Quantity::Index => "Index",
        Quantity::Grin(term) => TableColumn::Grin(term).title(),
        Quantity::Asphere(term) => TableColumn::Asphere(term).title(),
        Quantity::Freeform(number) => &format!("Freeform number {}", number + 1),
    };
    let name = format!("{what} of surface {}", parameter.surface + 1);
    match parameter.zoom {
        Some(zoom) => format!("{name} at position {}", zoom + 1),
        None => name,
    }
}

/// The columns that a lens needs.
fn needed(lens: &Lens) -> Vec<TableColumn> {
    let mut columns = vec![
        TableColumn::Radius,
        TableColumn::Thickness,
        TableColumn::Glass,
        TableColumn::SemiDiameter,
        TableColumn::Conic,
    ];
    if lens.surfaces.iter().any(|row| row.obstruction.is_some()) {
        columns.push(TableColumn::Obstruction);
    }
    if lens.surfaces.iter().any(|row| !row.apertures.is_empty()) {
        columns.push(TableColumn::Apertures);
    }
    let terms = lens.surfaces.iter().map(|row| row.asphere.len()).max().unwrap_or(0);
    columns.extend((0..terms).map(TableColumn::Asphere));
    let written = lens.surfaces.iter().filter_map(|row| match &row.medium {
        Medium::Grin(gradient) => Some(gradient.written_terms()),
        _ => None,
    });
    let gradients: BTreeSet<usize> = written.flatten().collect();
    columns.extend(gradients.into_iter().map(TableColumn::Grin));
    if lens.tolerances.is_some() {
        columns.push(TableColumn::Tolerances);
    }
    columns.push(TableColumn::Comment);
    columns
}

/// The columns that a person has hidden, as the window stores them.
fn hidden(ui: &Ui) -> BTreeSet<TableColumn> {
    ui.data_mut(|data| data.get_persisted(store())).unwrap_or_default()
}

fn store() -> Id {
    Id::unique("hidden columns of the prescription")
}

/// The columns that are shown of a lens.
pub(super) fn shown(ui: &Ui, lens: &Lens) -> Vec<TableColumn> {
    let hidden = hidden(ui);
    needed(lens).into_iter().filter(|column| !hidden.contains(column)).collect()
}

/// A menu to hide columns and to show them again.
pub(super) fn menu(ui: &mut Ui, lens: &Lens) {
    let mut hidden = hidden(ui);
    let before = hidden.clone();
    let stay = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let (button, _) = MenuButton::new("Columns").config(stay).ui(ui, |ui| {
        for column in needed(lens) {
            let mut on = !hidden.contains(&column);
            let item = ui.checkbox(&mut on, column.title());
            if hint_beside(item, column.hint()).changed() {
                if on {
                    hidden.remove(&column)
                } else {
                    hidden.insert(column)
                };
            }
        }
        if ui.add_enabled(!hidden.is_empty(), Button::new("Show all columns")).clicked() {
            hidden.clear();
        }
    });
    button.on_hover_text("Hide columns, or show them again");
    if hidden != before {
        ui.data_mut(|data| data.insert_persisted(store(), hidden));
    }
}
