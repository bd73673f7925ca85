//! Limits restored with the rays of the lens itself.

use super::{KEPT, LimitedOptimizer, RESTORED, scaled_point};
use crate::merit::{DerivativeLevel, Limit};
use crate::optimize::LimitPrice;
use crate::solve::{LimitValues, SLACK};

/// The distance from the bounds for which a correction aims.
const AIM: f64 = 1e-10;
/// The largest such distance, for limits whose rays are found a little differently each time.
const LARGEST_AIM: f64 = 1e-5;
/// The number of corrections of a lens that is to keep its limits.
const CORRECTIONS: usize = 8;
/// The number of times that the rays are found anew while the limits are restored.
const SETTLEMENTS: usize = 6;

impl LimitedOptimizer {
    /// Finds the rays of the current lens anew, restores its limits with them, and makes it the best
    /// lens if it is. Returns true if the merit is another one by more than the tolerance.
    pub(super) fn settle(&mut self) -> bool {
        self.settle_within(f64::INFINITY)
    }

    /// [`Self::settle`] on the way: limits that are broken by more than the slack are left to the
    /// steps.
    pub(super) fn check_rays(&mut self) -> bool {
        self.settle_within(SLACK)
    }

    /// Finds the rays anew and restores limits that are broken by at most this.
    fn settle_within(&mut self, restorable: f64) -> bool {
        let before = self.state.value;
        self.unchecked = 0;
        let mut margin = AIM;
        for _ in 0..SETTLEMENTS {
            let violation = if self.find_rays() { self.point.limits.violation() } else { 0.0 };
            if violation <= KEPT || violation > restorable {
                break;
            }
            self.restore(margin);
            // What is still broken after a correction is the difference that new rays make.
            margin = (2.0 * violation).clamp(AIM, LARGEST_AIM);
        }
        self.adopt_verified();
        (self.state.value - before).abs() > 2.0 * self.tolerance * before.abs()
    }

    /// Finds the rays of the current lens anew; false if that fails.
    fn find_rays(&mut self) -> bool {
        let mut merit = self.state.merit.clone();
        let found = merit
            .resample(&self.state.current)
            .and_then(|()| merit.evaluate_with_limits(&self.state.values, DerivativeLevel::Normal));
        match found {
            Ok(found) if found.limits.len() == self.limits.len() => {
                self.state.merit = merit;
                self.state.value = found.objective.value;
                self.point = scaled_point(&self.state, &found.objective, &found.limits);
                self.limits = found.limits;
                true
            }
            Ok(_) => false,
            Err(cause) => {
                self.state.refused = Some(cause.to_string());
                false
            }
        }
    }

    /// Corrects the current lens until it keeps its limits with the present rays, by a margin.
    fn restore(&mut self, margin: f64) {
        for _ in 0..CORRECTIONS {
            let limits = self.method.with_margin(&self.point.limits, margin);
            if limits.violation() <= RESTORED.max(0.1 * margin) || !self.correct(&limits) {
                break;
            }
        }
    }

    /// Corrects the current lens once; false if no other correction may follow.
    fn correct(&mut self, limits: &LimitValues) -> bool {
        if self.evaluations_left() == 0 {
            return false;
        }
        let Some(change) = self.method.restoration(&self.point, limits, &self.state.room()) else {
            return false;
        };
        let values = self.state.moved(&self.state.values, change.as_slice());
        let Ok(found) = self.state.merit.evaluate_with_limits(&values, DerivativeLevel::Normal)
        else {
            return false;
        };
        self.state.evaluations += 1;
        let point = scaled_point(&self.state, &found.objective, &found.limits);
        let change = self.state.scaled_change(&values);
        let to = &point.limits.with_bounds(&limits.bounds);
        let [accepted, met_kink] = self.method.note_restoration(&change, [limits, to]);
        if accepted {
            self.state.merit.follow_pupils(found.pupils);
            self.state.values = values;
            self.state.value = point.objective.value;
            self.state.current = self.state.merit.lens(&self.state.values);
            (self.point, self.limits) = (point, found.limits);
        }
        accepted || met_kink
    }

    /// Makes the current lens, whose rays are its own, the best one, or returns to the one verified
    /// before if that is better.
    fn adopt_verified(&mut self) {
        let rank = self.rank();
        match self.verified.take() {
            // Limits that are broken may have to be broken more on the way to where they are kept.
            Some((lens, before)) if before < rank && before.0 == 0.0 => {
                self.state.current.clone_from(&lens);
                self.state.values = self.state.merit.values(&lens);
                self.find_rays();
                self.method.note_other_function(true);
                self.state.failed_verifications += 1;
                self.verified = Some((lens, before));
            }
            _ => {
                self.state.failed_verifications = 0;
                self.verified = Some((self.state.current.clone(), rank));
            }
        }
        self.best_violation = self.rank().0;
        self.state.best_value = self.state.value;
        self.state.best.clone_from(&self.state.current);
        self.note_prices();
    }

    /// The violation and the merit of the current lens: the smaller the better, in this order.
    fn rank(&self) -> (f64, f64) {
        let violation = self.point.limits.violation();
        (if violation <= KEPT { 0.0 } else { violation }, self.state.value)
    }

    /// Notes the binding limits of the current lens with their multipliers.
    pub(super) fn note_prices(&mut self) {
        let room = self.state.room();
        let Some((step, _)) = self.method.unconfined(&self.point, &room) else { return };
        let price = |(limit, multiplier): (&Limit, &f64)| LimitPrice::new(limit, *multiplier);
        let all = self.limits.iter().zip(step.multipliers.iter());
        self.prices = all.filter_map(price).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Lens, ParameterKind, add_variables, blank};
    use crate::merit::{Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
    use crate::optimize::Optimizer as _;

    /// A biconvex lens, and the least back focus that is asked for.
    fn optimizer(back_focus: f64) -> LimitedOptimizer {
        let mut lens = blank();
        (lens.surfaces[0].curvature, lens.surfaces[1].curvature) = (0.02, -0.02);
        add_variables(&mut lens, &[ParameterKind::Thicknesses]);
        let goal = Goal {
            terms: [Term::Spot, Term::BackFocus(back_focus)]
                .map(|term| WeightedTerm::new(term, 1.0))
                .to_vec(),
            pupil: PupilEdge::Moving,
            zoom_ratios: Vec::new(),
            limits: LimitTreatment::Constraints,
        };
        LimitedOptimizer::new(Merit::new(&lens, &goal, 1e-3).unwrap(), &lens, 1e-3).unwrap()
    }

    fn back_focus(lens: &Lens) -> f64 {
        lens.surfaces[1].thickness
    }

    /// Broken limits count before the merit, and limits that are kept do not count.
    #[test]
    fn a_lens_is_ranked_by_its_broken_limits_first() {
        let kept = optimizer(45.0);
        assert_eq!(kept.rank(), (0.0, kept.state.value));
        let mut broken = optimizer(52.5);
        let missing = 52.5 - back_focus(broken.current());
        let (violation, merit) = broken.rank();
        assert!((violation - missing).abs() < 1e-9 && merit > 0.0, "{violation} {missing}");
        assert!(kept.rank() < broken.rank());
        (0..5).for_each(|_| drop(broken.step()));
        broken.verify_best();
        assert!(back_focus(broken.best()) > 52.5 - 1e-9 && broken.rank().0 == 0.0);
    }
}
