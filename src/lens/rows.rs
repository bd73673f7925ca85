//! Rows come, go and turn around; everything that names a row by its number follows.

use super::{Lens, Medium, Parameter, Pickup, Quantity, Variable, ZoomThickness};

impl Lens {
    /// Renames every parameter that a variable or pickup mentions; what has no name any more goes.
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

    /// Gives every row that variables, pickups and zoom positions name a new number, or none: for
    /// rows that were put in or taken out.
    pub fn renumber_rows(&mut self, map: impl Fn(usize) -> Option<usize>) {
        self.map_parameters(|p| map(p.surface).map(|surface| Parameter { surface, ..p }));
        for position in &mut self.zoom {
            let gap = |gap: &ZoomThickness| {
                map(gap.surface).map(|surface| ZoomThickness { surface, ..*gap })
            };
            position.thicknesses = position.thicknesses.iter().filter_map(gap).collect();
        }
    }

    /// Turns the rows `first` to `last` around: surfaces and the gaps between them in reverse order,
    /// every curvature and asphere coefficient with the other sign. The gap behind the group stays. A
    /// gradient along the axis keeps its coefficients, which count from the new surface in front.
    ///
    /// # Panics
    /// If the rows are no group: `first` behind `last`, or `last` behind the lens.
    pub fn reverse_rows(&mut self, first: usize, last: usize) {
        let turn = Reversal { first, last };
        turn.reverse(self);
        self.map_parameters(|parameter| Some(turn.parameter(parameter)));
        self.variables.iter_mut().for_each(|variable| turn.swap_bounds(variable));
        self.pickups.iter_mut().for_each(|pickup| turn.adjust_pickup(pickup));
        for gap in self.zoom.iter_mut().flat_map(|position| &mut position.thicknesses) {
            gap.surface = turn.gap(gap.surface);
        }
    }
}

/// A group of rows that is turned around.
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
            Quantity::Thickness
            | Quantity::ZoomThickness(_)
            | Quantity::Index
            | Quantity::Gradient(_) => self.gap(parameter.surface),
            Quantity::Curvature
            | Quantity::Conic
            | Quantity::Asphere(_)
            | Quantity::SemiDiameter => self.surface(parameter.surface),
        };
        Parameter { surface, ..parameter }
    }

    /// Whether a number of the turned lens has the other sign.
    fn changes_sign(self, parameter: Parameter) -> bool {
        (self.first..=self.last).contains(&parameter.surface)
            && matches!(parameter.quantity, Quantity::Curvature | Quantity::Asphere(_))
    }

    fn swap_bounds(self, variable: &mut Variable) {
        if self.changes_sign(variable.parameter) {
            (variable.min, variable.max) = (variable.max.map(negate), variable.min.map(negate));
        }
    }

    fn adjust_pickup(self, pickup: &mut Pickup) {
        if self.changes_sign(pickup.parameter) {
            pickup.scale = negate(pickup.scale);
            pickup.offset = negate(pickup.offset);
        }
        if self.changes_sign(pickup.source) {
            pickup.scale = negate(pickup.scale);
        }
    }
}

/// The other sign; a zero keeps its own.
fn negate(value: f64) -> f64 {
    if value == 0.0 { value } else { -value }
}
