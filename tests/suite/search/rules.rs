//! Invalid rules, unsatisfiable limits, violated limits, and permitted glasses.

use super::super::merit::bundled;
use aplanat::lens::{Lens, Medium};
use aplanat::search::lens_landscape::{
    LensLandscape, SearchPlan, describe_violation, finalize, run,
};
use aplanat::search::{Landscape as _, MutationKind, SearchMethod, SearchRules, SearchSettings};
use std::ops::ControlFlow;

fn triplet() -> Lens {
    bundled("cooke_triplet_100_f27")
}

fn under(lens: &Lens, rules: SearchRules) -> Result<LensLandscape, String> {
    let plan = SearchPlan { rules, ..SearchPlan::default() };
    plan.landscape(lens).map_err(|refusal| refusal.to_string())
}

#[test]
fn every_rule_is_checked_by_name() {
    let usual = SearchRules::default;
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    let bad: [(&str, &str, SearchRules); 23] = [
        ("elements", "[0, 0]", SearchRules { elements: [0, 0], ..usual() }),
        ("elements", "[4, 2]", SearchRules { elements: [4, 2], ..usual() }),
        ("kept", "[3, 5]", SearchRules { fixed_ends: [3, 5], ..usual() }),
        ("kept", "7 of the lens", SearchRules { fixed_ends: [usize::MAX, usize::MAX], ..usual() }),
        ("bend", "-1", SearchRules { weights: vec![(MutationKind::Bend, -1.0)], ..usual() }),
        ("flip", "NaN", SearchRules { weights: vec![(MutationKind::Flip, nan)], ..usual() }),
        (
            "global draw",
            "gamma",
            SearchRules { weights: vec![(MutationKind::Global, 2.0)], ..usual() },
        ),
        ("bend", "twice", SearchRules { weights: vec![(MutationKind::Bend, 1.0); 2], ..usual() }),
        ("glass_center", "[3, 1]", SearchRules { glass_center: [3.0, 1.0], ..usual() }),
        ("glass_center", "[-1, 1]", SearchRules { glass_center: [-1.0, 1.0], ..usual() }),
        ("glass_center", "inf", SearchRules { glass_center: [1.0, infinite], ..usual() }),
        ("air_center", "NaN", SearchRules { air_center: [nan, 1.0], ..usual() }),
        ("glass_edge", "-0.1", SearchRules { glass_edge: -0.1, ..usual() }),
        ("air_edge", "NaN", SearchRules { air_edge: nan, ..usual() }),
        ("steepness", "0", SearchRules { steepness: 0.0, ..usual() }),
        ("semi_diameter", "-1e300", SearchRules { semi_diameter: Some(-1e300), ..usual() }),
        ("track", "NaN", SearchRules { track: Some(nan), ..usual() }),
        ("track", "0", SearchRules { track: Some(0.0), ..usual() }),
        ("back_focus", "-1", SearchRules { back_focus: Some(-1.0), ..usual() }),
        ("back_focus", "inf", SearchRules { back_focus: Some(infinite), ..usual() }),
        ("glasses[0]", "SCHOTT N-BK7", SearchRules { glasses: vec!["BK7".into()], ..usual() }),
        (
            "glasses[1]",
            "N-BK77",
            SearchRules { glasses: vec!["F2".into(), "N-BK77".into()], ..usual() },
        ),
        ("glasses[0]", "``", SearchRules { glasses: vec![String::new()], ..usual() }),
    ];
    for (name, word, rules) in bad {
        let refusal = under(&triplet(), rules).unwrap_err();
        assert!(refusal.starts_with("rules: "), "{refusal}");
        for part in [name, word, " is ", "; expected "] {
            assert!(refusal.contains(part), "{part}: {refusal}");
        }
        assert!(refusal.len() < 250, "{refusal}");
    }
    assert!(under(&triplet(), SearchRules { fixed_ends: [3, 4], ..usual() }).is_ok());
}

#[test]
fn glasses_are_known_by_short_names_too() {
    let names = ["n-bk7", "SCHOTT N-BK7", "schott f2"].map(str::to_owned);
    let rules = SearchRules { glasses: names.to_vec(), ..SearchRules::default() };
    let landscape = under(&triplet(), rules).unwrap();
    assert_eq!(landscape.rules().glasses, ["SCHOTT N-BK7", "SCHOTT F2"]);
    let mut infrared = triplet();
    infrared.wavelengths[0].um = 9.0;
    let rules = SearchRules { glasses: vec!["N-BK7".into()], ..SearchRules::default() };
    for row in &mut infrared.surfaces {
        if row.medium != Medium::Air {
            row.medium = Medium::Index(1.6);
        }
    }
    let refusal = under(&infrared, rules).unwrap_err();
    assert!(refusal.contains("wavelength"), "{refusal}");
}

/// The glasses of a finished lens are those of the list, but those that are not to be touched.
#[test]
fn a_glass_list_applies_to_the_start() {
    let mut lens = triplet();
    for (row, glass) in [(0, "SCHOTT N-SK16"), (2, "SCHOTT SF2"), (5, "SCHOTT N-LAK9")] {
        assert!(matches!(lens.surfaces[row].medium, Medium::Model { .. }));
        lens.surfaces[row].medium = Medium::Glass(glass.to_owned());
    }
    let glasses = ["N-LAK9", "F2", "N-SSK2"].map(str::to_owned).to_vec();
    let finished = |fixed_ends| {
        let rules = SearchRules { glasses: glasses.clone(), fixed_ends, ..SearchRules::default() };
        let landscape = under(&lens, rules).unwrap();
        finalize(&landscape, &lens).unwrap()
    };
    let glass = |lens: &Lens, row: usize| match &lens.surfaces[row].medium {
        Medium::Glass(name) => name.clone(),
        other => panic!("{other:?}"),
    };
    let free = finished([0, 0]);
    let made = [0, 2, 5].map(|row| glass(&free.lens, row));
    assert_eq!(made, ["SCHOTT N-SSK2", "SCHOTT F2", "SCHOTT N-LAK9"]);
    assert_eq!(free.glasses.len(), 2);
    assert!(free.unlisted.is_empty());
    let kept = finished([2, 0]);
    assert_eq!(glass(&kept.lens, 0), "SCHOTT N-SK16");
    assert_eq!(kept.unlisted.len(), 1);
    assert_eq!((kept.unlisted[0].surface, kept.unlisted[0].glass.as_str()), (0, "SCHOTT N-SK16"));
}

#[test]
fn unsatisfiable_limits_are_refused() {
    let lens = triplet();
    let refusal = |rules| under(&lens, rules).unwrap_err();
    let narrow = refusal(SearchRules { semi_diameter: Some(5.0), ..SearchRules::default() });
    assert!(
        narrow.contains("semi-diameters of at most 5 mm") && narrow.contains("18."),
        "{narrow}"
    );
    let short = refusal(SearchRules { track: Some(1.0), ..SearchRules::default() });
    assert!(short.contains("a track of at most 1 mm"), "{short}");
    let long = refusal(SearchRules { back_focus: Some(1000.0), ..SearchRules::default() });
    assert!(long.contains("back focus of 1000 mm"), "{long}");
    // What is hard but may be possible is not refused.
    let rules =
        SearchRules { semi_diameter: Some(19.0), track: Some(85.0), ..SearchRules::default() };
    let landscape = under(&lens, rules).unwrap();
    let broken = landscape.violations(landscape.start()).unwrap();
    let words: Vec<String> = broken.iter().map(describe_violation).collect();
    let long = "total track: 119.07";
    assert!(words.iter().any(|words| words.starts_with(long)), "{words:?}");
    assert!(broken.iter().all(|limit| limit.term != "light"), "{words:?}");
}

#[test]
fn a_merit_is_the_sum_of_its_terms() {
    let landscape = under(&triplet(), SearchRules::default()).unwrap();
    let terms = landscape.term_values(landscape.start()).unwrap();
    let sum: f64 = terms.iter().map(|term| term.weight * term.value).sum();
    assert!((sum / landscape.loss(landscape.start()) - 1.0).abs() < 1e-12);
}

/// From a lens with too many elements a search goes towards those that may be.
#[test]
fn an_excess_of_elements_is_reduced() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let rules = SearchRules { elements: [1, 5], ..SearchRules::default() };
    let settings = SearchSettings {
        method: SearchMethod::Restore,
        gradients: Some(600),
        c: 0.3,
        seed: 2,
        ..SearchSettings::default()
    };
    let plan = SearchPlan { rules, settings, ..SearchPlan::default() };
    let landscape = plan.landscape(&lens).unwrap();
    assert_eq!(landscape.structure_violation(landscape.start()), 2);
    let words: Vec<String> =
        landscape.violations(landscape.start()).unwrap().iter().map(describe_violation).collect();
    assert!(words.iter().any(|words| words.starts_with("elements: 7")), "{words:?}");
    let found = run(&lens, &plan, |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!(landscape.structure_violation(&found.best().point), 0);
    assert_eq!(found.statistics().gradients, 600);
    assert!(found.reservoir().entries().iter().any(|entry| entry.structure_violation == 0));
    let asked = SearchRules::default().admit_element_count(12);
    assert_eq!(
        (asked.elements, SearchRules::default().admit_element_count(7).elements),
        ([2, 12], [2, 8])
    );
    let said = SearchRules { elements: [3, 4], ..SearchRules::default() };
    assert_eq!(said.admit_element_count(12).elements, [3, 4]);
}
