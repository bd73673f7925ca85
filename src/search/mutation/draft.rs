//! A lens under mutation: the origin of each parameter moves with its row.

use super::kind::MutationKind;
use super::queries::{has_solve, is_gap, is_zoomed};
use super::record::StructureChange;
use super::singlet::SingletProposal;
use super::spacing::SpacingChoice;
use crate::lens::{Lens, Parameter, Quantity, Row, ZoomNumber, add_variable};
use crate::search::SearchRules;
use crate::search::projection::{ProjectionMap, RowOrigin, scale};

/// The input of a mutation.
#[derive(Debug)]
pub(super) struct MutationContext<'a> {
    /// The lens, with its pickups resolved.
    pub(super) lens: Lens,
    pub(super) rules: &'a SearchRules,
    /// A length of the order of the focal length, in mm.
    pub(super) scale: f64,
}

/// The reverse of a mutation and its proposal density.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReverseMove {
    /// The kind of the reverse mutation.
    pub(super) kind: MutationKind,
    /// The logarithm of the ratio of the densities of the draws, reverse over forward, times the
    /// determinant of the map between the parameters; without the probabilities of kinds and sites
    /// and without the projection.
    pub(super) log_density_ratio: f64,
    /// A choice of the reverse mutation that depends on the final length of a gap.
    pub(super) spacing: Option<SpacingChoice>,
    /// The singlet that the reverse mutation draws, whose density depends on its final neighbour.
    pub(super) singlet: Option<SingletProposal>,
}

impl ReverseMove {
    /// A reverse mutation without choices.
    pub(super) fn new(kind: MutationKind, log: f64) -> Self {
        Self { kind, log_density_ratio: log, spacing: None, singlet: None }
    }
}

/// A mutated lens before projection and repair.
#[derive(Debug)]
pub(super) struct MutationDraft {
    pub(super) lens: Lens,
    pub(super) origins: Vec<RowOrigin>,
    pub(super) change: StructureChange,
    /// Rows with new glass behind them.
    pub(super) new_glass: Vec<usize>,
    /// Rows without a semi-diameter.
    pub(super) rimless: Vec<usize>,
    pub(super) map: ProjectionMap,
    /// The number of sites where the mutation could have been made.
    pub(super) sites: usize,
    pub(super) reverse: Option<ReverseMove>,
}

impl<'a> MutationContext<'a> {
    pub(super) fn new(lens: Lens, rules: &'a SearchRules, scale: f64) -> Self {
        Self { lens, rules, scale }
    }

    /// The scale of the lens after a mutation; unchanged if it is projected.
    pub(super) fn scale_after(&self, mutated: &Lens) -> Option<f64> {
        if self.rules.projection { Some(self.scale) } else { scale(mutated).ok() }
    }

    pub(super) fn start_draft(&self, sites: usize) -> MutationDraft {
        let origin = |row| RowOrigin { curvature: Some((row, 1.0)), gap: Some(row) };
        MutationDraft {
            lens: self.lens.clone(),
            origins: (0..self.lens.surfaces.len()).map(origin).collect(),
            change: StructureChange::Start,
            new_glass: Vec::new(),
            rimless: Vec::new(),
            map: ProjectionMap::Nearest,
            sites,
            reverse: None,
        }
    }
}

impl MutationDraft {
    /// Inserts a row in front of row `at`, without an origin.
    pub(super) fn insert(&mut self, at: usize, row: Row) {
        self.lens.surfaces.insert(at, row);
        self.origins.insert(at, RowOrigin::default());
        self.lens.renumber_rows(|row| Some(if row < at { row } else { row + 1 }));
    }

    /// Removes a row with all references to it.
    pub(super) fn remove(&mut self, at: usize) {
        self.lens.surfaces.remove(at);
        self.origins.remove(at);
        self.lens.renumber_rows(|row| match row {
            row if row == at => None,
            row if row > at => Some(row - 1),
            row => Some(row),
        });
    }

    /// Moves the gap behind row `from`, with its variables and zoom thicknesses, to row `to`,
    /// replacing the gap there.
    pub(super) fn move_gap(&mut self, from: usize, to: usize) {
        self.drop_gap_references(to);
        self.lens.surfaces[to].thickness = self.lens.surfaces[from].thickness;
        self.origins[to].gap = self.origins[from].gap.take();
        self.lens.map_parameters(|p| {
            let surface = if p.surface == from && is_gap(p.quantity) { to } else { p.surface };
            Some(Parameter { surface, ..p })
        });
        zoom_gaps(&mut self.lens, from).for_each(|gap| gap.surface = to);
    }

    /// Removes all references to the gap behind a row.
    pub(super) fn drop_gap_references(&mut self, row: usize) {
        self.lens.map_parameters(|p| (p.surface != row || !is_gap(p.quantity)).then_some(p));
        for position in &mut self.lens.zoom {
            position.remove_number(row, Quantity::Thickness);
        }
    }

    /// Removes the variables and pickups of some quantities of a row.
    pub(super) fn drop_parameters(&mut self, row: usize, is_it: impl Fn(Quantity) -> bool) {
        self.lens.map_parameters(|p| (p.surface != row || !is_it(p.quantity)).then_some(p));
    }

    /// Lengthens a gap by `by` mm along the light, at every zoom position.
    pub(super) fn lengthen(&mut self, row: usize, by: f64) {
        let by = by * self.lens.light_direction(row);
        self.lens.surfaces[row].thickness += by;
        zoom_gaps(&mut self.lens, row).for_each(|gap| gap.value += by);
    }

    /// Adds the gap behind row `from` to the one behind row `to`, at every zoom position.
    pub(super) fn add_gap(&mut self, to: usize, from: usize) {
        let lens = &mut self.lens;
        let zooming = [to, from].map(|row| is_zoomed(lens, row));
        let sums: Vec<f64> = (0..lens.zoom.len())
            .map(|zoom| [to, from].iter().filter_map(|row| lens.thickness_at(*row, zoom)).sum())
            .collect();
        lens.surfaces[to].thickness += lens.surfaces[from].thickness;
        if zooming.contains(&true) {
            for (position, thickness) in lens.zoom.iter_mut().zip(sums) {
                position.set_number(to, Quantity::Thickness, thickness);
            }
        }
    }

    /// Marks the parameters of new rows as variables if the lens has variables of their kind, and
    /// widens the bounds of parameters that lie outside, since the mutation has changed their
    /// meaning.
    pub(super) fn inherit_variables(&mut self, rows: &[usize]) {
        let varies = |p: Parameter, quantity| p.quantity == quantity && p.zoom.is_none();
        let has = |quantity| self.lens.variables.iter().any(|v| varies(v.parameter, quantity));
        let kinds = [Quantity::Curvature, Quantity::Thickness].map(|q| (q, has(q)));
        for (row, (quantity, wanted)) in rows.iter().flat_map(|row| kinds.map(|kind| (*row, kind)))
        {
            if wanted {
                add_variable(&mut self.lens, Parameter::new(row, quantity));
            }
        }
        self.drop_solved();
        let lens = &self.lens;
        let values: Vec<_> = lens.variables.iter().map(|v| lens.get(v.parameter)).collect();
        for (variable, value) in self.lens.variables.iter_mut().zip(values) {
            let Some(value) = value else { continue };
            variable.min = variable.min.map(|min| min.min(value));
            variable.max = variable.max.map(|max| max.max(value));
        }
    }

    /// A last gap that is solved for focus is not a variable.
    fn drop_solved(&mut self) {
        let last = self.lens.surfaces.len() - 1;
        if has_solve(&self.lens, last) {
            self.lens
                .variables
                .retain(|v| v.parameter.surface != last || !is_gap(v.parameter.quantity));
            self.origins[last].gap = None;
        }
    }
}

/// The thicknesses of a gap at the zoom positions with one of their own.
fn zoom_gaps(lens: &mut Lens, row: usize) -> impl Iterator<Item = &mut ZoomNumber> {
    let numbers = lens.zoom.iter_mut().flat_map(|position| &mut position.numbers);
    numbers.filter(move |own| own.surface == row && is_gap(own.quantity))
}
