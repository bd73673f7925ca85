//! Renumbering and reversing rows, along with the variables, pickups and zoom positions that name
//! them.

use super::{Lens, Medium, Parameter, Pickup, Quantity, Row, TermSelection, Variable, ZoomNumber};

impl Lens {
    /// Maps the parameters of all variables and pickups; those mapped to `None` are removed.
    pub fn map_parameters(&mut self, map: impl Fn(Parameter) -> Option<Parameter>) {
        let variable =
            |v: &Variable| map(v.parameter).map(|parameter| Variable { parameter, ..*v });
        let pickup = |p: &Pickup| {
            let (parameter, source) = (map(p.parameter)?, map(p.source)?);
            Some(Pickup { parameter, source, ..*p })
        };
        self.variables = self.variables.iter().filter_map(variable).collect();
        self.pickups = self.pickups.iter().filter_map(pickup).collect();
    }

    /// Maps the row indices of variables, pickups, zoom positions and merit terms, for rows that were inserted or
    /// removed; those mapped to `None` are removed.
    pub fn renumber_rows(&mut self, map: impl Fn(usize) -> Option<usize>) {
        self.map_parameters(|p| map(p.surface).map(|surface| Parameter { surface, ..p }));
        if let Some(sheet) = &mut self.tolerances {
            sheet.renumber(|_, i| map(i));
        }
        if let Some(goal) = &mut self.merit {
            goal.renumber(TermSelection::Surfaces, |_, i| map(i));
        }
        for position in &mut self.zoom {
            let number =
                |own: &ZoomNumber| map(own.surface).map(|surface| ZoomNumber { surface, ..*own });
            position.numbers = position.numbers.iter().filter_map(number).collect();
        }
    }

    /// Reverses the group of rows `first` to `last`: surfaces and the gaps between them in reverse
    /// order, every curvature and asphere coefficient with the opposite sign. The gap behind the
    /// group stays. An axial GRIN profile keeps its coefficients, which then refer to the new surface
    /// in front.
    ///
    /// # Panics
    /// If `first` is greater than `last`, or `last` is not a row of the lens.
    pub fn reverse_rows(&mut self, first: usize, last: usize) {
        let reversal = Reversal { first, last };
        reversal.reverse(self);
        let rows = self.surfaces.clone();
        self.map_parameters(|parameter| Some(reversal.parameter(parameter)));
        self.variables.iter_mut().for_each(|variable| reversal.swap_bounds(variable, &rows));
        self.pickups.iter_mut().for_each(|pickup| reversal.adjust_pickup(pickup, &rows));
        if let Some(sheet) = &mut self.tolerances {
            sheet.renumber(|kind, i| {
                Some(if kind.is_of_gap() { reversal.gap(i) } else { reversal.surface(i) })
            });
        }
        if let Some(goal) = &mut self.merit {
            goal.renumber(TermSelection::Surfaces, |term, i| {
                Some(if term.is_of_gaps() { reversal.gap(i) } else { reversal.surface(i) })
            });
        }
        for own in self.zoom.iter_mut().flat_map(|position| &mut position.numbers) {
            *own = reversal.zoom_number(*own, &rows);
        }
    }
}

/// The reversal of a group of rows.
#[derive(Clone, Copy)]
struct Reversal {
    first: usize,
    last: usize,
}

impl Reversal {
    fn reverse(self, lens: &mut Lens) {
        let group = &mut lens.surfaces[self.first..=self.last];
        let gaps: Vec<(f64, Medium)> =
            group.iter().map(|row| (row.thickness, row.medium.clone())).collect();
        group.reverse();
        let inner = gaps.len() - 1;
        for (i, row) in group.iter_mut().enumerate() {
            row.curvature = negate(row.curvature);
            row.asphere.iter_mut().for_each(|a| *a = negate(*a));
            if let Some(form) = &mut row.freeform {
                let kind = form.kind;
                let signed = form.numbers.iter_mut().enumerate().filter(|(k, _)| kind.has_sign(*k));
                signed.for_each(|(_, a)| *a = negate(*a));
            }
            let from = if i < inner { inner - 1 - i } else { inner };
            (row.thickness, row.medium) = gaps[from].clone();
        }
    }

    /// The new index of a surface.
    fn surface(self, i: usize) -> usize {
        if (self.first..=self.last).contains(&i) { self.first + self.last - i } else { i }
    }

    /// The new index of a gap.
    fn gap(self, i: usize) -> usize {
        if (self.first..self.last).contains(&i) { self.first + self.last - 1 - i } else { i }
    }

    fn parameter(self, parameter: Parameter) -> Parameter {
        let surface = match parameter.quantity {
            Quantity::Thickness | Quantity::Index | Quantity::Grin(_) => {
                self.gap(parameter.surface)
            }
            Quantity::Curvature
            | Quantity::Conic
            | Quantity::Asphere(_)
            | Quantity::Freeform(_)
            | Quantity::SemiDiameter => self.surface(parameter.surface),
        };
        Parameter { surface, ..parameter }
    }

    /// True if a parameter of the reversed rows has the opposite sign after the reversal.
    fn changes_sign(self, parameter: Parameter, rows: &[Row]) -> bool {
        let form = rows.get(parameter.surface).and_then(|row| row.freeform.as_ref());
        let signed = match parameter.quantity {
            Quantity::Curvature | Quantity::Asphere(_) => true,
            Quantity::Freeform(k) => form.is_some_and(|form| form.kind.has_sign(k)),
            _ => false,
        };
        signed && (self.first..=self.last).contains(&parameter.surface)
    }

    fn zoom_number(self, own: ZoomNumber, rows: &[Row]) -> ZoomNumber {
        let moved = self.parameter(Parameter::new(own.surface, own.quantity));
        let value = if self.changes_sign(moved, rows) { negate(own.value) } else { own.value };
        ZoomNumber { surface: moved.surface, value, ..own }
    }

    fn swap_bounds(self, variable: &mut Variable, rows: &[Row]) {
        if self.changes_sign(variable.parameter, rows) {
            (variable.min, variable.max) = (variable.max.map(negate), variable.min.map(negate));
        }
    }

    fn adjust_pickup(self, pickup: &mut Pickup, rows: &[Row]) {
        if self.changes_sign(pickup.parameter, rows) {
            pickup.scale = negate(pickup.scale);
            pickup.offset = negate(pickup.offset);
        }
        if self.changes_sign(pickup.source, rows) {
            pickup.scale = negate(pickup.scale);
        }
    }
}

/// The opposite sign; a zero keeps its own.
fn negate(value: f64) -> f64 {
    if value == 0.0 { value } else { -value }
}
