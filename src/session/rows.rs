//! Rows come, go and turn around; everything that names a row by its number follows.

use super::edit::EditError;
use crate::lens::{Lens, Medium, Parameter, Pickup, Quantity, Row, Variable, ZoomThickness};

/// Puts a row in front of row `at`. A solved last gap stays with the last row.
pub(super) fn insert(lens: &mut Lens, at: usize, row: &Row) -> Result<(), EditError> {
    let count = lens.surfaces.len();
    if at > count {
        return Err(EditError::NoRow { surface: at, last: count });
    }
    let focus = lens.focus;
    if at == count {
        lens.freeze_focus()?;
    }
    lens.surfaces.insert(at, row.clone());
    lens.focus = focus;
    renumber(lens, |surface| Some(if surface < at { surface } else { surface + 1 }));
    Ok(())
}

/// Takes a row out. What followed one of its numbers keeps its value and follows no longer.
pub(super) fn remove(lens: &mut Lens, surface: usize) -> Result<(), EditError> {
    lens.row(surface)?;
    if lens.surfaces.len() == 1 {
        return Err(EditError::OnlyRow);
    }
    if lens.surfaces[surface].stop {
        return Err(EditError::IsStop(surface));
    }
    lens.surfaces.remove(surface);
    renumber(lens, |row| match row {
        row if row == surface => None,
        row if row > surface => Some(row - 1),
        row => Some(row),
    });
    Ok(())
}

/// Replaces a row; variables and pickups of numbers that it does not have go.
pub(super) fn replace(lens: &mut Lens, surface: usize, row: &Row) -> Result<(), EditError> {
    lens.row(surface)?.clone_from(row);
    for quantity in [Quantity::Index, Quantity::SemiDiameter] {
        let parameter = Parameter::new(surface, quantity);
        if lens.get(parameter).is_none() {
            lens.forget(parameter);
        }
    }
    Ok(())
}

/// Gives every row a new number, or none.
fn renumber(lens: &mut Lens, map: impl Fn(usize) -> Option<usize>) {
    lens.map_parameters(|p| map(p.surface).map(|surface| Parameter { surface, ..p }));
    for position in &mut lens.zoom {
        let gap =
            |gap: &ZoomThickness| map(gap.surface).map(|surface| ZoomThickness { surface, ..*gap });
        position.thicknesses = position.thicknesses.iter().filter_map(gap).collect();
    }
}

/// Turns the rows `first` to `last` around: surfaces and the gaps between them in reverse order,
/// every curvature and asphere coefficient with the other sign. The gap behind the group stays.
pub(super) fn flip(lens: &mut Lens, first: usize, last: usize) -> Result<(), EditError> {
    lens.row(last)?;
    if first > last {
        return Err(EditError::NoGroup { first, last });
    }
    if let Some(i) = (first..=last).find(|i| lens.surfaces[*i].medium == Medium::Mirror) {
        return Err(EditError::Mirror(i));
    }
    let turn = Turn { first, last };
    turn.rows(lens);
    lens.map_parameters(|parameter| Some(turn.parameter(parameter)));
    lens.variables.iter_mut().for_each(|variable| turn.bounds(variable));
    lens.pickups.iter_mut().for_each(|pickup| turn.law(pickup));
    for gap in lens.zoom.iter_mut().flat_map(|position| &mut position.thicknesses) {
        gap.surface = turn.gap(gap.surface);
    }
    Ok(())
}

/// A group of rows that is turned around.
#[derive(Clone, Copy)]
struct Turn {
    first: usize,
    last: usize,
}

impl Turn {
    fn rows(self, lens: &mut Lens) {
        let group = &mut lens.surfaces[self.first..=self.last];
        let gaps: Vec<(f64, Medium)> =
            group.iter().map(|row| (row.thickness, row.medium.clone())).collect();
        group.reverse();
        let inner = gaps.len() - 1;
        for (i, row) in group.iter_mut().enumerate() {
            row.curvature = negative(row.curvature);
            row.asphere.iter_mut().for_each(|a| *a = negative(*a));
            let from = if i < inner { inner - 1 - i } else { inner };
            (row.thickness, row.medium) = gaps[from].clone();
        }
    }

    /// Where a surface goes.
    fn surface(self, i: usize) -> usize {
        if (self.first..=self.last).contains(&i) { self.first + self.last - i } else { i }
    }

    /// Where a gap goes.
    fn gap(self, i: usize) -> usize {
        if (self.first..self.last).contains(&i) { self.first + self.last - 1 - i } else { i }
    }

    fn parameter(self, parameter: Parameter) -> Parameter {
        let surface = match parameter.quantity {
            Quantity::Thickness | Quantity::ZoomThickness(_) | Quantity::Index => {
                self.gap(parameter.surface)
            }
            Quantity::Curvature
            | Quantity::Conic
            | Quantity::Asphere(_)
            | Quantity::SemiDiameter => self.surface(parameter.surface),
        };
        Parameter { surface, ..parameter }
    }

    /// Whether a number of the turned lens has the other sign.
    fn turns(self, parameter: Parameter) -> bool {
        (self.first..=self.last).contains(&parameter.surface)
            && matches!(parameter.quantity, Quantity::Curvature | Quantity::Asphere(_))
    }

    fn bounds(self, variable: &mut Variable) {
        if self.turns(variable.parameter) {
            (variable.min, variable.max) = (variable.max.map(negative), variable.min.map(negative));
        }
    }

    fn law(self, pickup: &mut Pickup) {
        if self.turns(pickup.parameter) {
            pickup.scale = negative(pickup.scale);
            pickup.offset = negative(pickup.offset);
        }
        if self.turns(pickup.source) {
            pickup.scale = negative(pickup.scale);
        }
    }
}

/// The other sign; a zero keeps its own.
fn negative(value: f64) -> f64 {
    if value == 0.0 { value } else { -value }
}
