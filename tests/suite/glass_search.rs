//! Exchange of glasses: what it gains, what it keeps, and what it refuses.

use crate::cli::{done_json, refused};
use aplanat::files;
use aplanat::lens::glass::{self, Glass};
use aplanat::lens::{Lens, Medium, Parameter, ParameterKind, Quantity, Variable, add_variables};
use aplanat::merit::Goal;
use aplanat::optimize::{DescentMethod, GlassRound, GlassSearch, GlassSearchError, start};

/// The relative accuracy of the spots.
const TOLERANCE: f64 = 1e-3;

fn lens(name: &str) -> Lens {
    let bundled = files::bundled_lenses().iter().find(|lens| lens.name == name).unwrap();
    let mut lens = files::json::read(bundled.text, name).unwrap();
    if lens.variables.is_empty() {
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    }
    lens
}

/// A lens after a descent with its own glasses.
fn optimized(lens: &Lens, goal: &Goal) -> Lens {
    let mut optimizer = start(DescentMethod::TrustRegion, lens, goal, TOLERANCE).unwrap();
    for _ in 0..60 {
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    optimizer.best().clone()
}

fn search(lens: &Lens, goal: &Goal) -> GlassSearch {
    let mut search = GlassSearch::new(lens, goal, TOLERANCE, glass::catalogue(), 0).unwrap();
    search.restart(&optimized(lens, goal)).unwrap();
    search
}

/// The largest violation of a limit, squared, in mm².
fn violation(search: &GlassSearch) -> f64 {
    let optimizer = search.resume().unwrap();
    let limits = optimizer.terms().unwrap().into_iter().filter(|term| term.term != "spot");
    limits.map(|term| term.value).fold(0.0, f64::max)
}

fn names(lens: &Lens) -> Vec<String> {
    let name = |medium: &Medium| match medium {
        Medium::Glass(name) => Some(glass::find(name).unwrap().full_name()),
        _ => None,
    };
    lens.surfaces.iter().filter_map(|row| name(&row.medium)).collect()
}

#[test]
fn other_glasses_make_a_double_gauss_sharper_within_its_limits() {
    let lens = lens("double_gauss_rudolph_50");
    let goal = Goal::default_for(&lens).unwrap();
    let mut search = search(&lens, &goal);
    let before = search.merit();
    let mut exchanged = Vec::new();
    for _ in 0..4 {
        let round = search.round().unwrap();
        assert_eq!(round.tried.len(), 8);
        assert_eq!(round.merit, search.merit());
        exchanged.extend(round.accepted);
    }
    assert!(search.merit() < 0.9 * before, "{before} -> {}", search.merit());
    assert!(violation(&search) < 1e-15, "{}", violation(&search));
    let (now, first) = (names(search.best()), names(&lens));
    let changed = now.iter().zip(first).filter(|(now, first)| *now != first).count();
    assert!((1..=exchanged.len()).contains(&changed), "{exchanged:?}: {now:?}");
    assert!(now.contains(&exchanged.last().unwrap().to));
}

/// What a small exchange promises is what it brings, and the order of the others is foreseen.
#[test]
fn the_merit_with_another_glass_is_predicted() {
    let lens = lens("cooke_triplet_100_f27");
    let goal = Goal::default_for(&lens).unwrap();
    let mut guided = search(&lens, &goal);
    let before = guided.merit();
    let round = guided.round().unwrap();
    for tried in &round.tried {
        let (predicted, found) = (tried.predicted.unwrap(), tried.merit.unwrap());
        assert!(predicted > 0.0 && predicted <= 3.0 * before, "{tried:?}");
        assert!((0.3..3.0).contains(&(found / predicted)), "{tried:?}");
    }
    let mut random = search(&lens, &goal).without_predictions();
    let round = random.round().unwrap();
    assert!(round.tried.iter().all(|tried| tried.predicted.is_none()), "{round:?}");
}

#[test]
fn a_search_among_glasses_does_not_depend_on_threads() {
    let run = |threads: usize| -> GlassRound {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let achromat = lens("achromat_ac254_100");
            let goal = Goal::default_for(&achromat).unwrap();
            search(&achromat, &goal).round().unwrap()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_model_glass_is_replaced_even_if_that_costs_sharpness() {
    let mut achromat = lens("achromat_ac254_100");
    let index = Parameter::new(0, Quantity::Index);
    achromat.surfaces[0].medium = Medium::Model { nd: 1.7345, vd: 61.0 };
    achromat.variables.push(Variable { parameter: index, min: None, max: None });
    let goal = Goal::default_for(&achromat).unwrap();
    let mut search = GlassSearch::new(&achromat, &goal, TOLERANCE, glass::catalogue(), 0).unwrap();
    let round = search.round().unwrap();
    assert!(round.tried.iter().all(|tried| tried.surface.index() == 0), "{round:?}");
    let best = search.best();
    assert!(matches!(best.surfaces[0].medium, Medium::Glass(_)));
    assert!(best.variables.iter().all(|variable| variable.parameter != index));
    best.check().unwrap();
}

#[test]
fn a_lens_without_glasses_to_exchange_is_refused_by_name() {
    let achromat = lens("achromat_ac254_100");
    let goal = Goal::default_for(&achromat).unwrap();
    let start = |lens: &Lens, glasses: &[&'static Glass]| {
        let glasses = glasses.iter().copied();
        GlassSearch::new(lens, &goal, TOLERANCE, glasses, 0).map(|_| ())
    };
    let all: Vec<&Glass> = glass::catalogue().iter().collect();
    assert!(start(&achromat, &all).is_ok());
    assert!(matches!(start(&achromat, &[]), Err(GlassSearchError::NoCandidate)));
    let mut plain = achromat.clone();
    for row in plain.surfaces.iter_mut().filter(|row| row.medium != Medium::Air) {
        row.medium = Medium::Index(1.5);
    }
    assert!(matches!(start(&plain, &all), Err(GlassSearchError::NoGlass)));
}

#[test]
fn the_command_line_exchanges_glasses() {
    let out = std::env::temp_dir().join(format!("aplanat-glasses-{}.json", std::process::id()));
    let path = out.to_str().unwrap();
    let lens = "lenses/achromat_ac254_100.json";
    let vary = ["--vary", "curvatures,thicknesses", "--error", "1e-3", "--out", path];
    let base = [&["optimize", lens][..], &vary[..]].concat();
    let with = |words: &'static str| [&base[..], &["--glasses", words]].concat();
    refused(2, &with("unobtainium"), "", &["--glasses", "unobtainium"]);
    refused(2, &with("nd=x"), "", &["--glasses", "range `x`"]);
    let report = done_json(&with("schott"), "");
    let glasses = &report["glasses"];
    let [before, after] = ["merit_before", "merit_after"].map(|key| glasses[key].as_f64().unwrap());
    assert!(after <= before && glasses["finished"] == true, "{glasses}");
    for exchange in glasses["accepted"].as_array().unwrap() {
        assert!(exchange["to"].as_str().unwrap().starts_with("SCHOTT "), "{exchange}");
    }
    let saved = files::json::read(&std::fs::read_to_string(&out).unwrap(), path).unwrap();
    let opened = names(&saved);
    if let Some(exchange) = glasses["accepted"].as_array().unwrap().last() {
        assert!(opened.contains(&exchange["to"].as_str().unwrap().to_owned()), "{opened:?}");
    }
    std::fs::remove_file(out).unwrap();
}
