//! The weighted sum `L_spot + β L_throughput` (Teh, *Computational Lens Design*, eq. 3.26) for a
//! sequence of weights β.
//!
//! At the optimum the marginal ray misses the centroid by √β, so weights are given as this blur. A
//! descent gives up light faster than it corrects aberrations, and does not regain light lost at
//! the start. So a chain of weights begins with a corrected lens: once corrected at the largest
//! weight, and once with frozen pupils, as without the derivative of light. From either, the
//! weights fall in one chain and rise in another.

use super::{
    EVALUATION_TOLERANCE, FIRST, MIN_LIGHT, ParetoPoint, ParetoSettings, STEPS_PER_SLICE,
    SweepChain, goal_size,
};
use crate::lens::Lens;
use crate::merit::{
    Goal, LimitTreatment, MAX_STEEPNESS, MeritError, PupilEdge, Term, WeightedTerm,
};
use crate::optimize::{DescentMethod, Optimizer, start, start_annealed};

/// A sequence of weights, each starting from the result of the one before.
#[derive(Debug)]
pub(super) struct WeightChain {
    lens: Lens,
    goal: Goal,
    /// The weight and the treatment of the pupil of the initial correction, until it has begun.
    first_correction: Option<(f64, PupilEdge)>,
    /// The remaining weights, the next one last.
    weights: Vec<f64>,
    method: DescentMethod,
    steps: usize,
    tolerance: f64,
    active: Option<ActiveDescent>,
    refused: Option<String>,
}

/// The descent for one weight.
#[derive(Debug)]
struct ActiveDescent {
    weight: f64,
    search: Box<dyn Optimizer>,
    /// The number of steps that it may still take.
    remaining_steps: usize,
}

impl SweepChain for WeightChain {
    fn run_slice(&mut self) -> Vec<ParetoPoint> {
        if self.active.is_none() {
            self.start_next();
        }
        let Some(ActiveDescent { weight, search, remaining_steps: left }) = &mut self.active else {
            return Vec::new();
        };
        for _ in 0..STEPS_PER_SLICE.min(*left) {
            *left -= 1;
            if search.step().finished {
                *left = 0;
                break;
            }
        }
        let judge =
            |lens: &Lens| ParetoPoint::evaluate(lens, Some(*weight), EVALUATION_TOLERANCE).ok();
        if *left > 0 {
            return judge(search.current()).into_iter().collect();
        }
        search.verify_best();
        self.lens.clone_from(search.best());
        let found = judge(&self.lens);
        self.active = None;
        found.into_iter().collect()
    }

    fn remaining_steps(&self) -> usize {
        let coming = self.weights.len() + if self.first_correction.is_some() { FIRST } else { 0 };
        coming * self.steps + self.active.as_ref().map_or(0, |running| running.remaining_steps)
    }

    fn take_refusal(&mut self) -> Option<String> {
        self.refused.take()
    }
}

impl WeightChain {
    /// The chains of a sweep: from a correction at the largest weight, and from one with frozen
    /// pupils, the weights fall in one chain and rise in another.
    pub(super) fn all(lens: &Lens, goal: &Goal, settings: &ParetoSettings) -> Vec<Self> {
        let weights = settings.weights(goal_focal_length(goal, lens));
        let last = weights.last().copied().unwrap_or(0.0);
        let begin = [(last, goal.pupil), (0.0, PupilEdge::Frozen)];
        let both = begin.into_iter().flat_map(|begin| [(begin, true), (begin, false)]);
        let chain = |(begin, falling)| Self {
            lens: lens.clone(),
            goal: goal.clone(),
            first_correction: Some(begin),
            // The next one is the last.
            weights: if falling {
                weights.clone()
            } else {
                weights.iter().rev().copied().collect()
            },
            method: settings.method,
            steps: settings.steps,
            tolerance: settings.tolerance,
            active: None,
            refused: None,
        };
        both.map(chain).collect()
    }

    fn start_next(&mut self) {
        let begin = self.first_correction.take();
        let left = if begin.is_some() { FIRST * self.steps } else { self.steps };
        let next = begin.or_else(|| Some((self.weights.pop()?, self.goal.pupil)));
        let Some((weight, pupil)) = next else { return };
        let mut goal = Goal { pupil, ..self.goal.clone() };
        if weight > 0.0 {
            goal.terms.push(WeightedTerm::new(Term::Throughput, weight));
        }
        let search = match self.method {
            DescentMethod::Adam => start_annealed(&self.lens, &goal, self.tolerance, left),
            DescentMethod::TrustRegion | DescentMethod::DampedLeastSquares => {
                start(self.method, &self.lens, &goal, self.tolerance)
            }
        };
        match search {
            Ok(search) => {
                self.active = Some(ActiveDescent { weight, search, remaining_steps: left });
            }
            Err(cause) => self.refused = Some(cause.to_string()),
        }
    }
}

/// The objective (3.26) without its term for light, for a lens with this mean area of its pupils in
/// mm²: the integrals of the spots, and the constraints of the default goal: focal length,
/// thicknesses that can be manufactured, limited steepness, and a minimum of light at every field.
///
/// # Errors
/// A lens without first-order data.
pub fn weighted_sum_goal(lens: &Lens, light: f64, pupil: PupilEdge) -> Result<Goal, MeritError> {
    let default_goal = Goal::default_for(lens)?;
    let mut terms = vec![WeightedTerm::new(Term::SpotIntegral, 1.0)];
    // The integral of a spot is its mean square radius times the light, so the other terms are
    // scaled by the light too.
    let others =
        default_goal.terms.into_iter().filter(|w| !matches!(w.term, Term::Spot | Term::Light(_)));
    terms.extend(others.map(|w| WeightedTerm { weight: light * w.weight, ..w }));
    terms.push(WeightedTerm::new(Term::Steepness(MAX_STEEPNESS), light));
    // No field may go dark: an empty spot would be the sharpest of all.
    let light_term = terms[0].weight * light * goal_size(lens).powi(2);
    terms.push(WeightedTerm::new(Term::Light(MIN_LIGHT), light_term));
    Ok(Goal {
        terms,
        pupil,
        zoom_ratios: default_goal.zoom_ratios,
        limits: LimitTreatment::Penalties,
    })
}

/// The target focal length of the goal in mm, or the total track of an afocal lens.
fn goal_focal_length(goal: &Goal, lens: &Lens) -> f64 {
    let asked = goal.terms.iter().find_map(|w| match w.term {
        Term::FocalLength(focal) => Some(focal.abs()),
        _ => None,
    });
    asked.unwrap_or_else(|| lens.total_track())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::pareto::with_sweep_variables;
    use crate::pupil::limited_by_stop;

    /// The first correction of a chain is the descent of its goal with the pupil of the correction.
    #[test]
    fn a_chain_begins_with_the_pupil_of_its_correction() {
        let found = crate::files::bundled_lenses();
        let found = found.iter().find(|b| b.name == "double_gauss_rudolph_50").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let lens = with_sweep_variables(&limited_by_stop(&lens).unwrap(), [0.5, 1.5]);
        let goal = weighted_sum_goal(&lens, 100.0, PupilEdge::Moving).unwrap();
        let method = DescentMethod::TrustRegion;
        let descent = |pupil: PupilEdge| {
            let goal = Goal { pupil, ..goal.clone() };
            let mut search = start(method, &lens, &goal, 1e-2).unwrap();
            (0..3).for_each(|_| drop(search.step()));
            search.current().clone()
        };
        assert!(descent(PupilEdge::Frozen) != descent(PupilEdge::Moving));
        let mut chain = WeightChain {
            lens: lens.clone(),
            goal: goal.clone(),
            first_correction: Some((0.0, PupilEdge::Frozen)),
            weights: Vec::new(),
            method,
            steps: 1,
            tolerance: 1e-2,
            active: None,
            refused: None,
        };
        chain.start_next();
        let mut search = chain.active.unwrap().search;
        (0..3).for_each(|_| drop(search.step()));
        assert!(*search.current() == descent(PupilEdge::Frozen));
    }
}
