//! Elements that are added at saddle points: the merit is unchanged at birth, and descents on both sides
//! lead to two minima.

use super::super::merit::bundled;
use aplanat::lens::{Lens, Parameter, ParameterKind, Quantity, Wavelength, add_variables};
use aplanat::merit::{Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, start};
use aplanat::search::lens_landscape::{LensLandscape, SearchPlan, run};
use aplanat::search::{Landscape as _, MutationKind, SearchMethod, SearchRules, SearchSettings};
use std::ops::ControlFlow;

fn goal() -> Goal {
    let terms = [Term::Spot, Term::FocalLength(100.0)];
    let terms = terms.map(|term| WeightedTerm::new(term, 1.0)).to_vec();
    let limits = LimitTreatment::Penalties;
    Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: Vec::new(), limits }
}

fn value(lens: &Lens) -> f64 {
    let merit = Merit::new(lens, &goal(), 1e-3).unwrap();
    merit.value(&merit.values(lens)).unwrap()
}

/// The lens after a descent of its curvatures.
fn descended(lens: &Lens) -> Lens {
    let mut lens = Lens { variables: Vec::new(), ..lens.clone() };
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    let last = Parameter::new(lens.surfaces.len() - 1, Quantity::Thickness);
    aplanat::lens::add_variable(&mut lens, last);
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal(), 1e-3).unwrap();
    for _ in 0..120 {
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    optimizer.best().clone()
}

/// A triplet in one colour at a minimum of its curvatures.
fn at_a_minimum() -> Lens {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let mut lens = descended(&lens);
    lens.variables.clear();
    lens
}

fn landscape(lens: &Lens) -> LensLandscape {
    let plan = SearchPlan { goal: Some(goal()), ..SearchPlan::default() };
    plan.landscape(lens).unwrap()
}

#[test]
fn a_null_meniscus_leaves_the_merit_as_it_is() {
    let lens = at_a_minimum();
    let landscape = landscape(&lens);
    let start = landscape.start();
    let before = value(start);
    let mut born = 0;
    for surface in 0..start.surfaces.len() {
        for behind in [true, false] {
            for glass in ["SCHOTT N-BK7", "SCHOTT SF10"] {
                let place = (surface, behind);
                let Some(saddle) = landscape.saddle_point(start, place, glass) else { continue };
                let rows = &saddle.lens.surfaces[saddle.first..=saddle.first + 1];
                assert_eq!(saddle.lens.surfaces.len(), start.surfaces.len() + 2);
                assert!(rows[0].curvature == rows[1].curvature && rows[0].thickness == 0.0);
                let after = value(&saddle.lens);
                assert!((after / before - 1.0).abs() < 1e-12, "{place:?}: {after:e} {before:e}");
                assert!(saddle.second_derivatives[0] < 0.0, "{saddle:?}");
                born += 1;
            }
        }
    }
    assert!(born > 4, "{born}");
}

#[test]
fn descents_on_both_sides_of_a_saddle_lead_below_it() {
    let lens = at_a_minimum();
    let landscape = landscape(&lens);
    let before = value(landscape.start());
    let saddle = landscape.saddle_point(landscape.start(), (1, true), "SCHOTT N-BK7").unwrap();
    let side = |sign: f64| {
        let mut lens = saddle.lens.clone();
        for (i, part) in saddle.direction.iter().enumerate() {
            lens.surfaces[saddle.first + i].curvature += sign * 2e-4 * part;
        }
        descended(&lens)
    };
    let [one, other] = [1.0, -1.0].map(side);
    for lens in [&one, &other] {
        assert!(value(lens) < (1.0 - 1e-3) * before, "{:e} {before:e}", value(lens));
    }
}

#[test]
fn a_search_adds_elements_at_saddle_points() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let others = MutationKind::MUTATIONS.into_iter().filter(|k| *k != MutationKind::AddSinglet);
    let rules = SearchRules {
        saddles: true,
        elements: [3, 4],
        weights: others.map(|kind| (kind, 0.0)).collect(),
        ..SearchRules::default()
    };
    let method = SearchMethod::IteratedLocalSearch;
    let settings = SearchSettings { method, gradients: Some(900), ..SearchSettings::default() };
    let plan = SearchPlan { rules, settings, ..SearchPlan::default() };
    let found = run(&lens, &plan, |_, _| ControlFlow::Continue(())).unwrap();
    let added = &found.statistics().kinds[&MutationKind::AddSinglet];
    assert!(added.ended > 2 && found.statistics().gradients_beside > 0, "{added:?}");
    assert!(found.best().loss.is_finite());
    let landscape = plan.landscape(&lens).unwrap();
    assert!(found.lineage().nodes().iter().all(|node| landscape.loss(&node.point).is_finite()));
}
