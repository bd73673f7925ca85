//! Figures 4.4 to 4.7: the gain by structure search, and the contributions of its parts.
//!
//! All of them start from lenses of the library in one colour, with fields at four heights of a
//! full frame. A usual limit that a published lens violates, such as the edge thickness of an
//! element, is relaxed to its value there: so a search starts with aberrations to correct, not with
//! violated limits. Experiments read no clock; methods are compared after the same number of
//! gradients. A gradient costs the same for all of them: one merit with all its derivatives at one
//! lens. A step of damped least squares counts as many as it tries.

pub(super) mod baselines;
pub(super) mod front_with_mutations;
pub(super) mod overview_figure;
pub(super) mod projection;
mod recorded_search;
mod sampler_comparison;

use super::sharpness_vs_light::{focal_length, with_field_angles};
use super::{ExperimentResult, lens};
use crate::lens::{Lens, at_zoom};
use crate::merit::{ConstraintMargin, Goal, MeritError, Term, WeightedTerm, constraint_margins};
use crate::pupil::limited_by_stop;
use crate::search::lens_landscape::SearchPlan;
use crate::search::{SearchMethod, SearchRules, SearchSettings};

/// The image heights in mm: from the centre of a full frame nearly to its corner.
const HEIGHTS: [f64; 4] = [0.0, 7.0, 14.0, 21.0];

/// A lens of the figures of the thesis, and its file.
#[derive(Debug, Clone, Copy)]
struct StudyLens {
    name: &'static str,
    file: &'static str,
}

/// The four lenses.
const STUDY_LENSES: [StudyLens; 4] = [
    StudyLens { name: "wide-angle, 28 mm", file: "wide_nikkor_28_f28" },
    StudyLens { name: "normal, 50 mm", file: "double_gauss_nikkor_s_50" },
    StudyLens { name: "macro, 105 mm", file: "macro_micro_nikkor_105_f28" },
    StudyLens { name: "telephoto, 135 mm", file: "telephoto_nikkor_135_f28" },
];

/// A lens of the library at four image heights, in one colour, focused at infinity, limited by its
/// stop.
fn at_heights(file: &str) -> ExperimentResult<Lens> {
    let single = at_zoom(&lens(file)?, 0);
    let focal = focal_length(&single)?;
    let angles = HEIGHTS.map(|height| (height / focal).atan().to_degrees());
    Ok(limited_by_stop(&with_field_angles(single, &angles))?)
}

/// The search rules for the four lenses: the largest of them has ten elements.
fn rules() -> SearchRules {
    SearchRules { elements: [2, 12], ..SearchRules::default() }
}

/// A search by RESTORE from a lens with one chain, as in the thesis, over a number of gradients: sharp spots,
/// all of the light, the relaxed limits.
fn plan(start: &Lens, rules: SearchRules, gradients: u64) -> ExperimentResult<SearchPlan> {
    let usual = Goal::with_limits(start, &rules.goal_limits(), None, 1.0)?;
    let relaxed = relax_limits(start, &usual)?;
    let default = SearchPlan::default();
    let settings = SearchSettings {
        method: SearchMethod::Restore,
        chains: 1,
        gradients: Some(gradients),
        ..default.settings
    };
    Ok(SearchPlan { goal: Some(relaxed), rules, settings, ..default })
}

/// The goal with each limit of a thickness, an edge or a steepness relaxed to the value of the lens
/// if that violates it.
fn relax_limits(lens: &Lens, goal: &Goal) -> Result<Goal, MeritError> {
    let found = constraint_margins(lens, goal.terms.iter().copied())?;
    let relaxed_term = |w: &WeightedTerm| WeightedTerm { term: relax_term(w.term, &found), ..*w };
    Ok(Goal { terms: goal.terms.iter().map(relaxed_term).collect(), ..goal.clone() })
}

fn relax_term(term: Term, found: &[ConstraintMargin]) -> Term {
    let values = || found.iter().filter(|margin| margin.term == term.name()).map(|m| m.value);
    let least = |min: f64| values().fold(min, f64::min);
    let most = |max: f64| values().fold(max, f64::max);
    match term {
        Term::GlassCenter { min, max } => Term::GlassCenter { min: least(min), max: most(max) },
        Term::AirCenter { min, max } => Term::AirCenter { min: least(min), max: most(max) },
        Term::GlassEdge(min) => Term::GlassEdge(least(min)),
        Term::AirEdge(min) => Term::AirEdge(least(min)),
        Term::Steepness(max) => Term::Steepness(most(max)),
        other => other,
    }
}

/// The mean of some values and the variance of this mean.
fn mean_and_variance(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    [mean, square / (count * (count - 1.0).max(1.0))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::structure::{STUDY_LENSES, at_heights, rules};

    #[test]
    fn a_lens_keeps_its_own_limits_and_no_others_are_loosened() {
        for subject in STUDY_LENSES {
            let lens = at_heights(subject.file).unwrap();
            let usual = Goal::with_limits(&lens, &rules().goal_limits(), None, 1.0).unwrap();
            let relaxed = relax_limits(&lens, &usual).unwrap();
            let terms = |goal: &Goal| goal.terms.iter().map(|w| w.term).collect::<Vec<_>>();
            let slack = |goal: &Goal| {
                let found = constraint_margins(&lens, goal.terms.iter().copied()).unwrap();
                found.iter().map(ConstraintMargin::slack).fold(f64::INFINITY, f64::min)
            };
            assert!(slack(&relaxed) >= 0.0, "{}: {}", subject.name, slack(&relaxed));
            assert_eq!(slack(&usual) >= 0.0, terms(&usual) == terms(&relaxed), "{}", subject.name);
        }
    }
}
