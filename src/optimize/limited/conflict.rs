//! Limits that no lens keeps together.

use super::{KEPT, LimitedOptimizer, PATIENCE, limit_values};
use crate::merit::{DerivativeLevel, Limit, MeritError};
use crate::solve::smallest_conflict;

/// The number of corrections after which limits are believed to be compatible.
const RESTORATIONS: usize = 50;

impl LimitedOptimizer {
    /// The smallest conflict among the limits at the current lens, by their derivatives.
    pub(super) fn conflict_here(&self) -> Vec<String> {
        let all: Vec<usize> = (0..self.limits.len()).collect();
        let room = self.state.room();
        let is_conflict = |set: &[usize]| {
            let chosen: Vec<Limit> = set.iter().map(|i| self.limits[*i].clone()).collect();
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
        let named = smallest_conflict(&all, is_conflict);
        named.into_iter().map(|i| self.limits[i].margin.name()).collect()
    }

    /// Refuses limits that need no rays and that no lens near the first one can keep together.
    pub(super) fn refuse_contradictions(&mut self) -> Result<(), MeritError> {
        let room = self.state.room();
        // The scales of the method are those of its first step.
        drop(self.method.propose(&self.point, &room));
        self.method.forget_radius();
        let all: Vec<usize> = (0..self.limits.len()).collect();
        if self.can_keep(&all) {
            return Ok(());
        }
        let conflict = smallest_conflict(&all, |set| !self.can_keep(set));
        let limits = conflict.into_iter().map(|i| self.limits[i].margin.name()).collect();
        Err(MeritError::ConflictingLimits { limits })
    }

    /// True if a lens near the current one keeps the chosen ones of the limits that need no rays.
    fn can_keep(&self, chosen: &[usize]) -> bool {
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
            match self.corrected(&values, &limits) {
                Some(next) => values = next,
                None => return false,
            }
        }
        true
    }
}
