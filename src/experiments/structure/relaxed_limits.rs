//! Manufacturing limits, relaxed to those that a published lens satisfies.

use crate::lens::Lens;
use crate::merit::{ConstraintMargin, Goal, MeritError, Term, WeightedTerm, constraint_margins};

/// The goal with each limit of a thickness, an edge or a steepness relaxed to the value of the lens
/// if that violates it.
pub(super) fn relax_limits(lens: &Lens, goal: &Goal) -> Result<Goal, MeritError> {
    let found = constraint_margins(lens, goal.terms.iter().map(|w| w.term))?;
    let loosened = |w: &WeightedTerm| WeightedTerm { term: relax_term(w.term, &found), ..*w };
    Ok(Goal { terms: goal.terms.iter().map(loosened).collect(), ..goal.clone() })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::structure::{STUDY_LENSES, at_heights, rules};

    #[test]
    fn a_lens_keeps_its_own_limits_and_no_others_are_loosened() {
        for subject in STUDY_LENSES {
            let lens = at_heights(subject.file).unwrap();
            let usual = Goal::with_limits(&lens, &rules().goal_limits(), None, 1.0).unwrap();
            let kept = relax_limits(&lens, &usual).unwrap();
            let terms = |goal: &Goal| goal.terms.iter().map(|w| w.term).collect::<Vec<_>>();
            let room = |goal: &Goal| {
                let found = constraint_margins(&lens, terms(goal).into_iter()).unwrap();
                found.iter().map(ConstraintMargin::slack).fold(f64::INFINITY, f64::min)
            };
            assert!(room(&kept) >= 0.0, "{}: {}", subject.name, room(&kept));
            assert_eq!(room(&usual) >= 0.0, terms(&usual) == terms(&kept), "{}", subject.name);
        }
    }
}
