//! Limits as constraints against limits as penalties: how far they are broken at the end of a
//! descent, and what it costs to keep them.

use super::timing::Stopwatch;
use crate::lens::{Lens, ParameterKind, add_variables};
use crate::merit::{DerivativeLevel, Goal, Limit, LimitTreatment, Merit, MeritError};
use crate::optimize::{DescentMethod, OptimizationEnd, OptimizationProgress, start};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The ends of two descents of a lens, one with its limits as constraints, one with penalties.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimitComparison {
    /// The number of variables.
    pub variables: usize,
    /// The merit at the start, penalties left out.
    pub merit_before: f64,
    /// The largest amount by which a limit is broken at the start, in its unit.
    pub violation_before: f64,
    /// The descent with constraints.
    pub constraints: LimitedDescent,
    /// The descent with penalties.
    pub penalties: LimitedDescent,
}

/// The end of a descent under limits, evaluated with the rays of the lens itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimitedDescent {
    /// The merit, penalties left out.
    pub merit: f64,
    /// The merit with the penalties.
    pub penalized: f64,
    /// The largest amount by which a limit is broken, in its unit.
    pub violation: f64,
    /// The limit that is broken most, if one is.
    pub broken: Option<String>,
    /// The number of limits that hold the lens.
    pub binding: usize,
    /// The number of steps.
    pub steps: usize,
    /// The number of evaluations of the merit with its derivatives.
    pub evaluations: usize,
    /// The time, in milliseconds.
    pub ms: f64,
    /// The reason of the end; `None` after the last step allowed.
    pub end: Option<OptimizationEnd>,
}

/// Optimizes a lens by the trust-region method with its limits as constraints and as penalties, up
/// to this many steps each. A lens without a goal gets the default one, a lens without variables
/// all curvatures and thicknesses. `None` once `stop` is true.
///
/// # Errors
/// A lens without a merit, or with limits that contradict each other.
pub fn compare_limit_treatments(
    lens: &Lens,
    steps: usize,
    tolerance: f64,
    stop: &AtomicBool,
) -> Result<Option<LimitComparison>, MeritError> {
    let lens = with_variables(lens);
    let goal = Goal { limits: LimitTreatment::Constraints, ..Goal::of_lens(&lens)? };
    let judge = LimitJudge::new(&lens, &goal, tolerance)?;
    let start = judge.judge(&lens)?;
    let descend = |limits| judge.descend(&Goal { limits, ..goal.clone() }, steps, stop);
    let Some(constraints) = descend(LimitTreatment::Constraints)? else { return Ok(None) };
    let penalties = descend(LimitTreatment::Penalties)?;
    Ok(penalties.map(|penalties| LimitComparison {
        variables: lens.variables.len(),
        merit_before: start.merit,
        violation_before: start.violation,
        constraints,
        penalties,
    }))
}

/// The lens, with all curvatures and thicknesses as variables if it has none.
pub(super) fn with_variables(lens: &Lens) -> Lens {
    let mut lens = lens.clone();
    if lens.variables.is_empty() {
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    }
    lens
}

/// The limits and the light by which the lenses of both descents are judged.
struct LimitJudge<'a> {
    start: &'a Lens,
    /// The goal with constraints.
    goal: &'a Goal,
    light: Vec<Vec<f64>>,
    tolerance: f64,
}

impl<'a> LimitJudge<'a> {
    fn new(start: &'a Lens, goal: &'a Goal, tolerance: f64) -> Result<Self, MeritError> {
        let light = Merit::new(start, goal, tolerance)?.initial_light().to_vec();
        Ok(Self { start, goal, light, tolerance })
    }

    /// The merit and the limits of a lens, as of a descent that has taken no step.
    fn judge(&self, lens: &Lens) -> Result<LimitedDescent, MeritError> {
        let merit = Merit::new(lens, self.goal, self.tolerance)?.with_initial_light(&self.light);
        let values = merit.values(lens);
        let found = merit.evaluate_with_limits(&values, DerivativeLevel::Value)?;
        let worst = found.limits.iter().max_by(|a, b| a.violation().total_cmp(&b.violation()));
        let violation = worst.map_or(0.0, Limit::violation);
        Ok(LimitedDescent {
            merit: found.objective.value,
            penalized: merit.value(&values)?,
            violation,
            broken: worst.filter(|_| violation > 0.0).map(|limit| limit.margin.name()),
            binding: 0,
            steps: 0,
            evaluations: 0,
            ms: 0.0,
            end: None,
        })
    }

    /// A whole descent; `None` once `stop` is true.
    fn descend(
        &self,
        goal: &Goal,
        steps: usize,
        stop: &AtomicBool,
    ) -> Result<Option<LimitedDescent>, MeritError> {
        let watch = Stopwatch::start();
        let mut optimizer = start(DescentMethod::TrustRegion, self.start, goal, self.tolerance)?;
        let goes_on = |p: &OptimizationProgress| p.end.is_none() && p.step < steps;
        let mut last = None;
        while last.as_ref().is_none_or(goes_on) {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            last = Some(optimizer.step());
        }
        optimizer.verify_best();
        let ms = 1e3 * watch.seconds();
        let (evaluations, taken, end) =
            last.map_or((0, 0, None), |p| (p.evaluations, p.step, p.end));
        let binding = optimizer.binding_limits().len();
        let found = self.judge(optimizer.best())?;
        Ok(Some(LimitedDescent { binding, steps: taken, evaluations, ms, end, ..found }))
    }
}
