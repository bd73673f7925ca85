//! Limits that no lens keeps together, bounds of variables among them.

use super::{KEPT, LimitedOptimizer, PATIENCE, limit_values};
use crate::lens::Variable;
use crate::merit::{DerivativeLevel, Limit, MeritError};
use crate::solve::smallest_conflict;

/// The number of corrections after which limits are believed to be compatible.
const RESTORATIONS: usize = 50;

/// A bound of a variable: its number, and whether it is the upper one.
type VariableBound = (usize, bool);

impl LimitedOptimizer {
    /// The bounds of the variables, which take part in conflicts behind the limits.
    fn variable_bounds(&self) -> Vec<VariableBound> {
        let variables = self.state.merit.variables().iter().enumerate();
        let of = |(i, variable): (usize, &Variable)| {
            [variable.min.map(|_| (i, false)), variable.max.map(|_| (i, true))]
        };
        variables.flat_map(of).flatten().collect()
    }

    /// The limits and the bounds of a set of both.
    fn parts(&self, set: &[usize], bounds: &[VariableBound]) -> (Vec<usize>, Vec<VariableBound>) {
        let count = self.limits.len();
        let limits = set.iter().copied().filter(|i| *i < count).collect();
        let chosen = set.iter().filter_map(|i| bounds.get(i.checked_sub(count)?).copied());
        (limits, chosen.collect())
    }

    /// The range by which each scaled variable may change from some values if only these bounds hold.
    fn room_within(&self, values: &[f64], bounds: &[VariableBound]) -> Vec<[f64; 2]> {
        let mut room = vec![[f64::NEG_INFINITY, f64::INFINITY]; values.len()];
        let all = self.state.room_from(values);
        for &(i, is_upper) in bounds {
            let side = usize::from(is_upper);
            room[i][side] = all[i][side];
        }
        room
    }

    /// The names of limits and of bounds.
    fn names(&self, set: &[usize], bounds: &[VariableBound]) -> Vec<String> {
        let (limits, chosen) = self.parts(set, bounds);
        let bound = |(i, is_upper): VariableBound| {
            let Variable { parameter, min, max } = self.state.merit.variables()[i];
            let (sign, bound) = if is_upper { ("<=", max) } else { (">=", min) };
            let bound = bound.map_or(f64::NAN, |bound| bound);
            format!("{parameter} {sign} {bound} (a bound of the variable)")
        };
        let limits = limits.into_iter().map(|i| self.limits[i].margin.name());
        limits.chain(chosen.into_iter().map(bound)).collect()
    }

    /// The smallest conflict among the limits and the bounds of variables at the current lens, by their
    /// derivatives.
    pub(super) fn conflict_here(&self) -> Vec<String> {
        let bounds = self.variable_bounds();
        let all: Vec<usize> = (0..self.limits.len() + bounds.len()).collect();
        let is_conflict = |set: &[usize]| {
            let (limits, chosen) = self.parts(set, &bounds);
            let room = self.room_within(&self.state.values, &chosen);
            let chosen: Vec<Limit> = limits.iter().map(|i| self.limits[*i].clone()).collect();
            let limits = limit_values(&self.state, &chosen);
            let remaining = self.method.correction(&limits, &room).map_or_else(
                || limits.violation(),
                |change| limits.excesses(&limits.linearized(&change)).amax(),
            );
            remaining > 1e-7
        };
        if !is_conflict(&all) {
            let broken = self.limits.iter().filter(|limit| limit.violation() > KEPT);
            return broken.map(|limit| limit.margin.name()).collect();
        }
        self.names(&smallest_conflict(&all, is_conflict), &bounds)
    }

    /// Refuses limits that need no rays and that no lens near the first one can keep together.
    pub(super) fn refuse_contradictions(&mut self) -> Result<(), MeritError> {
        let room = self.state.room();
        // The scales of the method are those of its first step.
        drop(self.method.propose(&self.point, &room));
        self.method.forget_radius();
        let bounds = self.variable_bounds();
        let all: Vec<usize> = (0..self.limits.len() + bounds.len()).collect();
        let can_keep = |set: &[usize]| {
            let (limits, chosen) = self.parts(set, &bounds);
            self.can_keep(&limits, &chosen)
        };
        if can_keep(&all) {
            return Ok(());
        }
        let limits = self.names(&smallest_conflict(&all, |set| !can_keep(set)), &bounds);
        Err(MeritError::ConflictingLimits { limits })
    }

    /// True if a lens near the current one keeps the chosen ones of the limits that need no rays, within
    /// some bounds of variables.
    fn can_keep(&self, chosen: &[usize], bounds: &[VariableBound]) -> bool {
        let mut values = self.state.values.clone();
        let (mut least, mut stalls) = (f64::INFINITY, 0);
        for _ in 0..RESTORATIONS {
            let merit = &self.state.merit;
            let Ok(found) = merit.mechanical_limits(&values, DerivativeLevel::Gradient) else {
                return true;
            };
            let kept: Vec<Limit> = chosen.iter().filter_map(|i| found.get(*i)).cloned().collect();
            let limits = limit_values(&self.state, &kept);
            let violation = limits.excesses(&limits.values).abs().sum();
            if violation <= KEPT {
                return true;
            }
            stalls = if violation < 0.999 * least { 0 } else { stalls + 1 };
            if stalls >= PATIENCE {
                return false;
            }
            least = least.min(violation);
            let room = self.room_within(&values, bounds);
            let Some(change) = self.method.correction(&limits, &room) else { return false };
            for ((value, step), scale) in values.iter_mut().zip(&change).zip(&self.state.scales) {
                *value += step * scale;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::lens::{Lens, ParameterKind, Quantity, add_variables, blank};
    use crate::merit::{Goal, LimitTreatment, MeritError, PupilEdge, Term, WeightedTerm};
    use crate::optimize::{DescentMethod, start};

    /// The limits that contradict each other for a biconvex lens with a bound of its last gap.
    fn conflict(most: Option<f64>) -> Vec<String> {
        let mut lens: Lens = blank();
        (lens.surfaces[0].curvature, lens.surfaces[1].curvature) = (0.02, -0.02);
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
        let is_gap = |p: Quantity| p == Quantity::Thickness;
        let gaps = lens.variables.iter_mut().filter(|v| is_gap(v.parameter.quantity));
        gaps.for_each(|gap| (gap.min, gap.max) = (Some(0.5), Some(100.0)));
        if let Some(last) = lens.variables.last_mut() {
            last.max = most;
        }
        let terms = [Term::Spot, Term::BackFocus(55.0), Term::TotalTrack(80.0)];
        let terms = terms.map(|term| WeightedTerm::new(term, 1.0)).to_vec();
        let limits = LimitTreatment::Constraints;
        let goal = Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: Vec::new(), limits };
        match start(DescentMethod::TrustRegion, &lens, &goal, 1e-3) {
            Err(MeritError::ConflictingLimits { limits }) => limits,
            _ => Vec::new(),
        }
    }

    #[test]
    fn a_bound_of_a_variable_that_contradicts_a_limit_is_named() {
        assert_eq!(conflict(None), Vec::<String>::new());
        let [limit, bound] = &conflict(Some(50.0))[..] else {
            panic!("{:?}", conflict(Some(50.0)))
        };
        assert!(limit.starts_with("back focus") && limit.ends_with(">= 55"), "{limit}");
        assert_eq!(bound, "thickness after surface 2 <= 50 (a bound of the variable)");
    }
}
