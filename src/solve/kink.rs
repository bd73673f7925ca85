//! Kinks of limited functions.
//!
//! A limited function may be the least or the largest of several smooth ones, as the light through
//! two rims of the same size is the light through the narrower one. Its derivatives tell of one
//! branch alone, and a step that follows that branch runs into the other. So the branches that were
//! met on the way are remembered by their value and slope, and every step keeps their limits too
//! (cutting planes; Kelley, SIAM J. 8 (1960) 703).

use super::limit_values::LimitValues;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// The branches of kinked limits beside those of the current point.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct KinkBranches {
    branches: Vec<Branch>,
}

/// A trial step of a search for kinks.
#[derive(Debug, Clone, Copy)]
pub(super) struct KinkTrial<'a> {
    /// The change of the parameters by the derivatives of the limits.
    pub(super) proposed: &'a DVector<f64>,
    /// The change that was tried.
    pub(super) change: &'a DVector<f64>,
    /// The limited functions behind the proposed change by their derivatives.
    pub(super) promised: &'a DVector<f64>,
}

/// A branch of a limited function.
#[derive(Debug, Clone, PartialEq)]
struct Branch {
    limit: usize,
    /// Its value at the current point, by its derivatives.
    value: f64,
    slope: DVector<f64>,
    /// The accepted steps since it was met or has held a step.
    age: usize,
}

/// A [`Branch`] in the units of the parameters themselves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BranchMemory {
    limit: usize,
    value: f64,
    slope: Vec<f64>,
    age: usize,
}

/// The violation beyond the one promised that tells of a kink, in the unit of the limit.
const SURPRISE: f64 = 1e-7;
/// The difference of two slopes, relative to one of them, above which they are of two branches.
const DISTINCT: f64 = 0.05;
/// The difference above which no smooth curvature explains it.
const KINKED: f64 = 0.3;
/// The accepted steps after which a branch is forgotten unless it has held one.
const MAX_AGE: usize = 10;

impl KinkBranches {
    /// The branches of so many limits as they were, for parameters scaled by `units`.
    pub(super) fn resume(memory: &[BranchMemory], units: &[f64], limits: usize) -> Self {
        let is_known =
            |branch: &&BranchMemory| branch.limit < limits && branch.slope.len() == units.len();
        let scaled = |branch: &BranchMemory| Branch {
            limit: branch.limit,
            value: branch.value,
            slope: DVector::from_fn(units.len(), |i, _| branch.slope[i] * units[i]),
            age: branch.age,
        };
        Self { branches: memory.iter().filter(is_known).map(scaled).collect() }
    }

    /// The branches, for parameters scaled by `units`; `None` if a number of them is not finite.
    pub(super) fn memory(&self, units: &[f64]) -> Option<Vec<BranchMemory>> {
        let unscaled = |branch: &Branch| BranchMemory {
            limit: branch.limit,
            value: branch.value,
            slope: branch.slope.iter().zip(units).map(|(slope, unit)| slope / unit).collect(),
            age: branch.age,
        };
        let all: Vec<BranchMemory> = self.branches.iter().map(unscaled).collect();
        let is_finite = |branch: &BranchMemory| {
            branch.value.is_finite() && branch.slope.iter().all(|slope| slope.is_finite())
        };
        all.iter().all(is_finite).then_some(all)
    }

    /// The limits at a point, and after them those of the branches.
    pub(super) fn with_branches(&self, limits: &LimitValues) -> LimitValues {
        let (own, count) = (limits.values.len(), limits.values.len() + self.branches.len());
        let all = |i: usize| i.checked_sub(own).map(|k| &self.branches[k]);
        let limit = |i: usize| all(i).map_or(i, |branch| branch.limit);
        LimitValues {
            values: DVector::from_fn(count, |i, _| {
                all(i).map_or_else(|| limits.values[i], |b| b.value)
            }),
            slopes: DMatrix::from_fn(count, limits.slopes.ncols(), |i, j| {
                all(i).map_or_else(|| limits.slopes[(i, j)], |branch| branch.slope[j])
            }),
            bounds: (0..count).map(|i| limits.bounds[limit(i)]).collect(),
            weights: (0..count).map(|i| limits.weights[limit(i)]).collect(),
        }
    }

    /// The multipliers of limits and of the branches after them, added up for every limit.
    pub(super) fn total(&self, multipliers: &DVector<f64>) -> DVector<f64> {
        let own = multipliers.len() - self.branches.len();
        let mut total = multipliers.rows(0, own).into_owned();
        for (branch, multiplier) in self.branches.iter().zip(multipliers.iter().skip(own)) {
            total[branch.limit] += multiplier;
        }
        total
    }

    pub(super) fn forget(&mut self) {
        self.branches.clear();
    }

    /// Follows an accepted step; branches with a multiplier stay young.
    pub(super) fn advance(&mut self, change: &DVector<f64>, to: &LimitValues, multipliers: &[f64]) {
        let held = |k: usize| multipliers.get(k).is_some_and(|m| m.abs() > 1e-12);
        for (k, branch) in self.branches.iter_mut().enumerate() {
            branch.age = if held(k) { 0 } else { branch.age + 1 };
        }
        self.branches.retain(|branch| branch.age <= MAX_AGE);
        self.follow(change, to);
    }

    /// Follows a change of the parameters.
    pub(super) fn follow(&mut self, change: &DVector<f64>, to: &LimitValues) {
        for branch in &mut self.branches {
            branch.value += branch.slope.dot(change);
            branch.value =
                not_beyond(to.bounds[branch.limit], branch.value, to.values[branch.limit]);
        }
    }

    /// Remembers the branches that a trial has met although its point's derivatives did not tell of
    /// them: those by whose derivatives the proposed step breaks a limit more than was promised. Of
    /// an accepted trial the branch of the point it came from is remembered. True if there was a
    /// kink.
    pub(super) fn meet(
        &mut self,
        trial: KinkTrial<'_>,
        [from, to]: [&LimitValues; 2],
        accepted: bool,
        scales: &DVector<f64>,
    ) -> bool {
        let KinkTrial { proposed, change, promised } = trial;
        let reached = &to.values + &to.slopes * (proposed - change);
        let [real, promised] = [&reached, promised].map(|values| from.excesses(values));
        let mut met = false;
        for i in 0..promised.len() {
            let [low, high] = from.bounds[i];
            if low == high || real[i].abs() <= promised[i].abs() + SURPRISE {
                continue;
            }
            let [here, there] = [from, to].map(|limits| limits.slopes.row(i).transpose());
            let difference = difference(&here, &there, scales);
            if !(difference > DISTINCT) {
                continue;
            }
            met |= difference > KINKED;
            let (value, now, slope) = if accepted {
                (from.values[i] + here.dot(change), to.values[i], here)
            } else {
                (to.values[i] - there.dot(change), from.values[i], there)
            };
            self.remember(i, not_beyond([low, high], value, now), slope, scales);
        }
        met
    }

    fn remember(&mut self, limit: usize, value: f64, slope: DVector<f64>, scales: &DVector<f64>) {
        self.branches.retain(|branch| {
            branch.limit != limit || difference(&slope, &branch.slope, scales) > DISTINCT
        });
        self.branches.push(Branch { limit, value, slope, age: 0 });
    }
}

/// The value of a branch, or that of the limited function where the branch would already break the
/// limit more than that does.
fn not_beyond([low, high]: [f64; 2], value: f64, now: f64) -> f64 {
    let above = if low.is_finite() { value.max(now.min(low)) } else { value };
    if high.is_finite() { above.min(now.max(high)) } else { above }
}

/// The length of the difference of two slopes relative to that of the first.
fn difference(a: &DVector<f64>, b: &DVector<f64>, scales: &DVector<f64>) -> f64 {
    let [a, b] = [a, b].map(|slope| slope.component_div(scales));
    (&b - &a).norm() / a.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_differ_relative_to_the_first_one() {
        let of = |values: [f64; 2]| DVector::from_row_slice(&values);
        let scales = of([1.0, 1.0]);
        for size in [0.1, 1.0, 7.0] {
            let (a, b) = (of([size, 0.0]), of([0.0, size]));
            assert!((difference(&a, &b, &scales) - 2f64.sqrt()).abs() < 1e-12, "{size}");
            assert_eq!(difference(&a, &a, &scales), 0.0);
            // In other units of the parameters both have other lengths.
            let found = difference(&a, &b, &of([2.0, 0.5]));
            assert!((found - 17f64.sqrt()).abs() < 1e-12, "{found}");
        }
    }

    #[test]
    fn branches_are_resumed_in_any_units() {
        let slope = DVector::from_vec(vec![1.0, -3.0]);
        let branch = Branch { limit: 1, value: 2.0, slope, age: 4 };
        let branches = KinkBranches { branches: vec![branch] };
        let memory = branches.memory(&[0.5, 8.0]).unwrap();
        assert_eq!(KinkBranches::resume(&memory, &[0.5, 8.0], 2), branches);
        let other = KinkBranches::resume(&memory, &[1.0, 4.0], 2);
        assert_eq!(other.branches[0].slope.as_slice(), [2.0, -1.5]);
        // Branches of a limit or of a parameter that there is no longer are forgotten.
        assert!(KinkBranches::resume(&memory, &[0.5, 8.0], 1).branches.is_empty());
        assert!(KinkBranches::resume(&memory, &[0.5], 2).branches.is_empty());
        let lost = Branch { value: f64::NAN, ..branches.branches[0].clone() };
        assert_eq!(KinkBranches { branches: vec![lost] }.memory(&[1.0, 1.0]), None);
    }

    #[test]
    fn a_branch_follows_its_slope_and_is_forgotten_when_it_is_asked_to_or_old() {
        let limits = LimitValues {
            values: DVector::from_element(1, 9.0),
            slopes: DMatrix::from_element(1, 2, 0.0),
            bounds: vec![[f64::NEG_INFINITY, 10.0]],
            weights: vec![1.0],
        };
        let branch =
            |age| Branch { limit: 0, value: 2.0, slope: DVector::from_vec(vec![1.0, -3.0]), age };
        let mut branches = KinkBranches { branches: vec![branch(0)] };
        let change = DVector::from_vec(vec![0.5, 0.1]);
        branches.follow(&change, &limits);
        assert!((branches.branches[0].value - 2.2).abs() < 1e-12);
        branches.advance(&(-change), &limits, &[1.0]);
        assert!((branches.branches[0].value - 2.0).abs() < 1e-12);
        assert_eq!(branches.with_branches(&limits).values.as_slice(), [9.0, 2.0]);
        let still = DVector::zeros(2);
        (0..MAX_AGE).for_each(|_| branches.advance(&still, &limits, &[0.0]));
        assert_eq!(branches.branches.len(), 1);
        branches.advance(&still, &limits, &[0.0]);
        assert!(branches.branches.is_empty(), "it has held no step");
        branches.branches.push(branch(0));
        branches.forget();
        assert_eq!(branches.with_branches(&limits).values.as_slice(), [9.0]);
    }
}
