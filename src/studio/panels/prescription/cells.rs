//! The text of a cell, and the edit for a text that is typed or pasted into it.

use egui::Id;

use super::columns::{TableColumn, parameter_name};
use super::glass;
use crate::lens::{Edit, Lens, Object, Parameter, Quantity, apertures_text, parse_apertures};
use crate::math::expression::evaluate;
use crate::report::surface_tolerances;
use crate::studio::number;

/// The row of the object; surfaces follow from 1, and the image is the last row.
pub(super) const OBJECT: usize = 0;

/// A cell of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct CellPlace {
    /// The row as it is counted in the window: the object is 0, the first surface 1.
    pub(super) row: usize,
    pub(super) column: TableColumn,
}

impl CellPlace {
    pub(super) const fn new(row: usize, column: TableColumn) -> Self {
        Self { row, column }
    }

    /// The text field of the cell.
    pub(super) fn id(self) -> Id {
        Id::unique(("prescription cell", self))
    }

    /// The index of the surface; `None` in the row of the object.
    pub(super) fn surface(self) -> Option<usize> {
        self.row.checked_sub(1)
    }

    /// True if the cell can be edited.
    pub(super) fn is_editable(self, lens: &Lens) -> bool {
        match self.row {
            OBJECT => matches!(self.column, TableColumn::Thickness | TableColumn::Glass),
            row => row <= lens.surfaces.len() && self.has_value(lens, row - 1),
        }
    }

    /// True unless the column is one of gradients and the surface has none, or one that is only shown.
    fn has_value(self, lens: &Lens, surface: usize) -> bool {
        match self.column {
            TableColumn::Grin(term) => {
                lens.get(Parameter::new(surface, Quantity::Grin(term))).is_some()
            }
            TableColumn::Tolerances => false,
            _ => true,
        }
    }

    /// The accessible name.
    pub(super) fn name(self, lens: &Lens, zoom: usize) -> String {
        let Some(surface) = self.surface() else {
            let glass = self.column == TableColumn::Glass;
            return if glass { "Medium of the object" } else { "Object distance" }.to_owned();
        };
        match self.column.parameter(lens, zoom, surface) {
            Some(parameter) => parameter_name(parameter),
            None if self.column == TableColumn::Apertures => {
                format!("Apertures of surface {}", self.row)
            }
            None if self.column == TableColumn::Comment => {
                format!("Remark on surface {}", self.row)
            }
            None => format!("{} of surface {}", self.column.title(), self.row),
        }
    }

    /// The text of the cell with numbers as `show` writes them; empty where there is nothing.
    pub(super) fn text(self, lens: &Lens, zoom: usize, show: impl Fn(f64) -> String) -> String {
        let Some(surface) = self.surface() else { return self.object_text(lens, show) };
        let Some(row) = lens.surfaces.get(surface) else { return String::new() };
        match self.column {
            TableColumn::Glass => glass::format_medium(&row.medium),
            TableColumn::Comment => row.comment.clone(),
            TableColumn::Tolerances => surface_tolerances(lens, surface),
            TableColumn::Obstruction => row.obstruction.map(show).unwrap_or_default(),
            // What is edited here is read again as a whole: a number that was not touched keeps its digits.
            TableColumn::Apertures => apertures_text(&row.apertures),
            _ => {
                let value = self.column.parameter(lens, zoom, surface).and_then(|p| lens.get(p));
                let radius = self.column == TableColumn::Radius;
                let value = if radius { value.map(number::radius) } else { value };
                value.map(show).unwrap_or_default()
            }
        }
    }

    fn object_text(self, lens: &Lens, show: impl Fn(f64) -> String) -> String {
        match (self.column, lens.object) {
            (TableColumn::Glass, _) => glass::format_medium(&lens.object_medium),
            (TableColumn::Thickness, Object::Infinity) => show(f64::INFINITY),
            (TableColumn::Thickness, Object::Finite(distance)) => show(distance),
            _ => String::new(),
        }
    }

    /// The edit of a text that was typed or pasted into the cell.
    pub(super) fn edit(self, lens: &Lens, zoom: usize, text: &str) -> Result<Edit, String> {
        let Some(surface) = self.surface() else { return self.object_edit(lens, text) };
        match self.column {
            TableColumn::Glass => {
                Ok(Edit::SetMedium { surface, medium: glass::typed_medium(text)? })
            }
            TableColumn::Comment => Ok(Edit::SetComment { surface, text: text.to_owned() }),
            TableColumn::Obstruction => {
                let old = lens.surfaces.get(surface).and_then(|row| row.obstruction);
                let value = optional(text, old)?;
                Ok(Edit::SetObstruction { surface, value })
            }
            TableColumn::Apertures => {
                Ok(Edit::SetApertures { surface, apertures: parse_apertures(text)? })
            }
            _ => match self.column.parameter(lens, zoom, surface) {
                Some(parameter) => number_edit(lens, parameter, text),
                None => Err("this cell cannot be edited".to_owned()),
            },
        }
    }

    fn object_edit(self, lens: &Lens, text: &str) -> Result<Edit, String> {
        if self.column == TableColumn::Glass {
            return Ok(Edit::SetObjectMedium(glass::parse_medium(text)));
        }
        let old = match lens.object {
            Object::Infinity => f64::INFINITY,
            Object::Finite(distance) => distance,
        };
        let distance = evaluate(text, old).map_err(|why| why.to_string())?;
        let is_far = distance.is_infinite();
        Ok(Edit::SetObject(if is_far { Object::Infinity } else { Object::Finite(distance) }))
    }

    /// The text that empties the cell.
    pub(super) const fn empty_text(self) -> &'static str {
        match self.column {
            TableColumn::Radius => "Infinity",
            TableColumn::Thickness if self.row == OBJECT => "Infinity",
            TableColumn::Thickness
            | TableColumn::Conic
            | TableColumn::Asphere(_)
            | TableColumn::Grin(_) => "0",
            TableColumn::Glass
            | TableColumn::SemiDiameter
            | TableColumn::Obstruction
            | TableColumn::Apertures
            | TableColumn::Tolerances
            | TableColumn::Comment => "",
        }
    }
}

/// The edit of a number: a curvature is typed as a radius, and an empty or infinite semi-diameter is
/// automatic.
fn number_edit(lens: &Lens, parameter: Parameter, text: &str) -> Result<Edit, String> {
    let (surface, value) = (parameter.surface, lens.get(parameter));
    let number = |old: f64| evaluate(text, old).map_err(|why| why.to_string());
    match parameter.quantity {
        Quantity::Curvature => {
            let empty = text.trim().is_empty();
            let old = number::radius(value.unwrap_or(0.0));
            Ok(Edit::set_curvature(parameter, if empty { f64::INFINITY } else { number(old)? }))
        }
        Quantity::SemiDiameter if parameter.zoom.is_none() => {
            Ok(Edit::SetSemiDiameter { surface, value: optional(text, value)? })
        }
        _ => Ok(Edit::Set { parameter, value: number(value.unwrap_or(0.0))? }),
    }
}

/// A number that may be absent: nothing is typed, or infinity, or `auto`.
fn optional(text: &str, old: Option<f64>) -> Result<Option<f64>, String> {
    let text = text.trim();
    if text.is_empty() || text.eq_ignore_ascii_case("auto") {
        return Ok(None);
    }
    let value = evaluate(text, old.unwrap_or(f64::INFINITY)).map_err(|why| why.to_string())?;
    Ok((value != f64::INFINITY).then_some(value))
}
