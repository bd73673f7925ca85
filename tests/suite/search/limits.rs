//! Limits inside a search: what it retains keeps every limit, and is of different minima.

use super::super::merit::bundled;
use aplanat::lens::Wavelength;
use aplanat::optimize::DescentState;
use aplanat::search::lens_landscape::{SearchPlan, run};
use aplanat::search::{
    Landscape as _, OfferOutcome, SearchMethod, SearchRules, SearchSettings, Settlement,
};
use std::ops::ControlFlow;
use std::sync::Arc;

fn plan(rules: SearchRules) -> SearchPlan {
    let method = SearchMethod::IteratedLocalSearch;
    let settings = SearchSettings {
        method,
        gradients: Some(1500),
        seed: 2,
        reservoir: Some(12),
        ..SearchSettings::default()
    };
    SearchPlan { rules, settings, ..SearchPlan::default() }
}

/// Moves by penalties come first; once they gain little, moves keep every limit.
#[test]
fn a_descent_keeps_its_limits_once_it_gains_little() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let landscape = plan(SearchRules::default()).landscape(&lens).unwrap();
    let (mut at, mut memory) = (landscape.start().clone(), DescentState::default());
    let mut loss = landscape.loss(&at);
    let mut kept = 0;
    for _ in 0..16 {
        let keeps_limits = memory.keeps_limits;
        let (there, found, gradients) = landscape.descend(&at, &mut memory);
        assert!(gradients > 0 && found < 1.05 * loss, "{loss:e} {found:e}");
        assert_eq!(found, landscape.loss(&there));
        if keeps_limits && there != at {
            assert!(landscape.limit_violation(&there).unwrap() <= 1e-9);
            kept += 1;
        }
        (at, loss) = (there, found);
    }
    assert!(kept > 3, "{kept} moves kept the limits");
}

/// The start breaks limits of its glass, of its air and of its track.
#[test]
fn a_search_from_outside_its_limits_retains_what_keeps_them() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let track = lens.total_track();
    let rules = SearchRules {
        elements: [3, 4],
        track: Some(0.97 * track),
        glass_center: [3.0, 30.0],
        glass_edge: 1.5,
        air_center: [0.5, 100.0],
        ..SearchRules::default()
    };
    let plan = plan(rules);
    let landscape = plan.landscape(&lens).unwrap();
    assert!(landscape.limit_violation(landscape.start()).unwrap() > 1.0);
    let found = run(&lens, &plan, |_, _| ControlFlow::Continue(())).unwrap();
    let retained: Vec<_> =
        found.reservoir().entries().iter().filter(|entry| entry.number > 0).collect();
    assert!(retained.len() > 2, "{}", retained.len());
    for entry in &retained {
        let violation = landscape.limit_violation(&entry.point).unwrap();
        assert!(violation <= 1e-9, "generation {}: {violation:e}", entry.number);
        assert_eq!(entry.loss, landscape.loss(&entry.point));
    }
    let best = landscape.settled(&found.best().point);
    assert!(landscape.limit_violation(&best).unwrap() <= 1e-9);
    assert!(landscape.loss(&best) < found.start().loss);
    // Different minima, several of one structure perhaps, none of them twice.
    for (i, one) in retained.iter().enumerate() {
        for other in retained[i + 1..].iter().filter(|other| other.topology == one.topology) {
            let [here, there] = [(one, other), (other, one)]
                .map(|(a, b)| landscape.is_same_minimum(&a.point, &b.point));
            assert!(!here || !there, "{} {}", one.number, other.number);
        }
    }
    let nodes = found.lineage().nodes().iter();
    assert!(nodes.filter_map(|node| node.offer).any(OfferOutcome::is_accepted));
}

#[test]
fn a_lens_that_breaks_a_limit_is_moved_to_where_it_holds() {
    let lens = bundled("cooke_triplet_100_f27");
    let plan = plan(SearchRules::default());
    let landscape = plan.landscape(&lens).unwrap();
    let settled = landscape.settled(landscape.start());
    assert!(matches!(landscape.settle(&settled), Settlement::Kept));
    let track = settled.total_track() - 0.2;
    let tight = SearchRules { track: Some(track), ..SearchRules::default() };
    let tight = SearchPlan { rules: tight, ..plan }.landscape(&lens).unwrap();
    let before = tight.limit_violation(&settled).unwrap();
    let Settlement::Restored { point, loss, gradients } = tight.settle(&settled) else {
        panic!("a correction of {before} mm of the track")
    };
    assert!(before > 0.1 && gradients > 0 && loss.is_finite());
    assert!(tight.limit_violation(&point).unwrap() <= 1e-9);
}

/// A lens is at its own minimum, and so is one a little beside it; one with another bending is not.
#[test]
fn minima_are_told_apart_by_signs_glasses_and_distance() {
    let lens = bundled("cooke_triplet_100_f27");
    let landscape = plan(SearchRules::default()).landscape(&lens).unwrap();
    let start = landscape.start();
    let changed = |change: &dyn Fn(&mut aplanat::lens::Lens)| {
        let mut other = (**start).clone();
        change(&mut other);
        Arc::new(other)
    };
    assert!(landscape.is_same_minimum(start, start));
    let near = changed(&|lens| lens.surfaces[0].curvature *= 1.0 + 1e-6);
    assert!(landscape.is_same_minimum(start, &near));
    let bent = changed(&|lens| lens.surfaces[0].curvature *= -1.0);
    assert!(!landscape.is_same_minimum(start, &bent));
    let far = changed(&|lens| lens.surfaces[0].curvature *= 1.1);
    assert!(!landscape.is_same_minimum(start, &far));
    let glass = changed(&|lens| {
        lens.surfaces[0].medium = aplanat::lens::Medium::Model { nd: 1.5168, vd: 64.2 };
    });
    assert!(!landscape.is_same_minimum(start, &glass));
}
