//! The landscape of lenses: the loss of a start, its descent, and the constraints that a whole
//! search satisfies, with hard cases.

use super::super::merit::bundled;
use super::seeded;
use aplanat::lens::{
    FieldKind, FieldPoint, Fields, Lens, Medium, Parameter, Quantity, Variable, Wavelength,
};
use aplanat::math::quadrature::gauss_legendre;
use aplanat::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, DescentState};
use aplanat::search::lens_landscape::{
    DescentSettings, LensLandscape, LensSummary, SearchPlan, finalize, run, with_open_apertures,
};
use aplanat::search::{
    Landscape, MutationKind, SearchMethod, SearchRules, SearchRunOn, SearchSettings, Temperature,
};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The double Gauss at four image heights in one colour, everything free, rims as open as it leaves
/// room for, at most 20 mm: the start of Teh's chapter 4.
fn wide_open() -> Lens {
    let mut lens = bundled("double_gauss_nikkor_s_50");
    lens.variables.clear();
    let angle = |height: f64| (height / 50.0).atan().to_degrees();
    let field = |height| FieldPoint { x: 0.0, y: angle(height), weight: 1.0 };
    let values = [0.0, 7.0, 14.0, 21.0].map(field).to_vec();
    lens.fields = Fields { kind: FieldKind::Angle, values };
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    with_open_apertures(&lens, 20.0)
}

/// A triplet in one colour.
fn triplet() -> Lens {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    lens
}

fn plan(gradients: u64) -> SearchPlan {
    let (usual, method) = (SearchPlan::default().settings, SearchMethod::Restore);
    let settings =
        SearchSettings { method, gradients: Some(gradients), chains: 3, seed: 5, c: 0.3, ..usual };
    SearchPlan { settings, ..SearchPlan::default() }
}

fn whole(lens: &Lens, plan: &SearchPlan) -> SearchRunOn<LensLandscape> {
    run(lens, plan, |_, _| ControlFlow::Continue(())).unwrap()
}

/// Clear areas as Teh's program sees them: it samples a disc of 20 mm by 50 rings of equal weight,
/// Gauss nodes in the square of the radius, and so loses a part of the outermost one.
#[test]
fn the_start_is_that_of_the_thesis() {
    let figures = LensSummary::new(&wide_open(), 1e-5).unwrap();
    assert!((figures.focal_lengths[0].unwrap() - 50.16).abs() < 0.01);
    assert_eq!(figures.topology, "1|2|stop|2|1|1");
    // Clear areas in mm² and RMS radii in mm that its program reaches there.
    let theirs = [(1133.0, 0.151), (991.0, 0.194), (743.0, 0.204), (434.0, 0.186)];
    for (field, (area, rms)) in figures.fields.iter().zip(theirs) {
        let (light, spot) = (field.light.value, field.spot.unwrap().value);
        println!("{:.2} degrees: {light:.1} and {area} mm^2, {spot:.4} and {rms} mm", field.y);
        assert!((light - area).abs() < 0.015 * area && (spot - rms).abs() < 0.08 * rms);
    }
    let disc = 400.0 * PI;
    let whole = figures.fields[0].light.value / disc;
    let rings = gauss_legendre(50, 0.0, 1.0);
    let seen: f64 = rings.iter().filter(|(square, _)| *square < whole).map(|ring| ring.1).sum();
    assert!((disc * seen - 1133.0).abs() < 0.5, "{}", disc * seen);
}

/// A move must be repeatable from what a checkpoint keeps.
#[test]
fn a_move_depends_only_on_lens_and_memory() {
    let lens = wide_open();
    let landscape = plan(1).landscape(&lens).unwrap();
    let (mut at, mut memory) = (landscape.start().clone(), DescentState::default());
    let before = landscape.loss(&at);
    let mut loss = before;
    for _ in 0..14 {
        let written = serde_json::to_string(&(&at, &memory)).unwrap();
        let (there, found, gradients) = landscape.descend(&at, &mut memory);
        let (read, mut remembered): (Arc<Lens>, DescentState) =
            serde_json::from_str(&written).unwrap();
        let again = landscape.descend(&read, &mut remembered);
        assert_eq!((&there, found.to_bits()), (&again.0, again.1.to_bits()));
        assert_eq!((memory.clone(), gradients), (remembered, again.2));
        (at, loss) = (there, found);
    }
    println!("loss {before:.5} to {loss:.5}");
    assert!(loss < 0.01 * before);
    assert_eq!(loss, landscape.loss(&at), "the loss of a move is that of the lens where it ends");
    let descended = LensSummary::new(&at, 1e-4).unwrap();
    let start = LensSummary::new(&lens, 1e-4).unwrap();
    let square = |figures: &LensSummary| {
        figures.fields.iter().map(|field| field.spot.unwrap().value.powi(2)).sum::<f64>()
    };
    assert!(square(&descended) < 0.25 * square(&start));
    for (now, then) in descended.fields.iter().zip(&start.fields) {
        assert!(now.light.value > 0.9 * then.light.value);
    }
}

#[test]
fn a_search_is_the_same_on_one_thread_and_on_two() {
    let lens = wide_open();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| whole(&lens, &plan(800)))
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one, two);
    assert!(one.best().loss < 0.1 * one.start().loss);
    assert!(one.lineage().total() > 3);
    let other =
        SearchPlan { settings: SearchSettings { seed: 6, ..plan(80).settings }, ..plan(80) };
    assert_ne!(whole(&lens, &other).best().point, one.best().point);
}

#[test]
fn searches_with_extreme_settings_stay_finite() {
    let lens = triplet();
    let base = plan(120);
    let with = |change: &dyn Fn(&mut SearchSettings)| {
        let mut plan = base.clone();
        change(&mut plan.settings);
        plan
    };
    let temperature = |value| Temperature::new(value);
    for plan in [
        with(&|s| s.temperature = temperature(0.0)),
        with(&|s| s.temperature = temperature(f64::INFINITY)),
        with(&|s| s.reservoir = Some(1)),
        with(&|s| s.gamma = 1.0),
        with(&|s| (s.c, s.chains) = (0.0, 1)),
        with(&|s| s.method = SearchMethod::Metropolis),
        with(&|s| s.method = SearchMethod::BruteForce),
    ] {
        let run = whole(&lens, &plan);
        assert!(run.best().loss.is_finite() && run.best().loss <= run.start().loss);
        run.best().point.check().unwrap();
        for entry in run.reservoir().entries() {
            assert!(entry.loss.is_finite());
            entry.point.check().unwrap();
        }
    }
}

#[test]
fn forbidden_kinds_are_not_tried_and_elements_are_counted() {
    let lens = triplet();
    let mut plan = plan(400);
    plan.settings.gamma = 0.0;
    plan.settings.c = 0.5;
    plan.rules.elements = [3, 4];
    let tried = [MutationKind::AddSinglet, MutationKind::RemoveSinglet];
    let forbidden = MutationKind::MUTATIONS.into_iter().filter(|kind| !tried.contains(kind));
    plan.rules.weights = forbidden.map(|kind| (kind, 0.0)).collect();
    let run = whole(&lens, &plan);
    assert!(run.lineage().total() > 4);
    assert!(run.statistics().kinds.keys().all(|kind| tried.contains(kind)));
    for node in run.lineage().nodes() {
        assert!(
            (3..=4).contains(&aplanat::search::element::piece_count(&node.point)),
            "{}",
            node.mutation
        );
    }
}

/// A person who flags some numbers holds the others of their kind, wherever mutations carry them.
#[test]
fn parameters_that_are_not_variable_stay_fixed() {
    let mut lens = triplet();
    let rows = lens.surfaces.len();
    lens.variables.clear();
    let flag = |surface, quantity| Variable {
        parameter: Parameter::new(surface, quantity),
        min: None,
        max: None,
    };
    lens.variables.push(flag(0, Quantity::Curvature));
    lens.variables.push(flag(rows - 1, Quantity::Thickness));
    let plan = plan(400);
    let run = whole(&lens, &plan);
    let held = |v: &&Variable| v.min.is_some() && v.min == v.max;
    let start = run.start().point.variables.iter().filter(held).count();
    assert!(start > rows);
    let mut checked = 0;
    for node in run.lineage().nodes() {
        for variable in node.point.variables.iter().filter(held) {
            assert_eq!(node.point.get(variable.parameter), variable.min, "{}", node.mutation);
            checked += 1;
        }
    }
    assert!(checked > start);
    assert_ne!(run.best().point.surfaces[0].curvature, lens.surfaces[0].curvature);
}

#[test]
fn a_start_without_light_is_refused_or_recovered() {
    let mut lens = wide_open();
    let stop = lens.stop().unwrap();
    let sharp = vec![WeightedTerm::new(Term::Spot, 1.0)];
    let only = Goal {
        terms: sharp,
        pupil: PupilEdge::Moving,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    lens.surfaces[stop + 1].semi_diameter = Some(0.0);
    let dark = SearchPlan { goal: Some(only), ..plan(40) };
    let refusal = run(&lens, &dark, |_, _| ControlFlow::Continue(())).unwrap_err();
    assert!(refusal.to_string().contains("no light gets through"), "{refusal}");
    match run(&lens, &plan(60), |_, _| ControlFlow::Continue(())) {
        Ok(run) => assert!(run.best().loss.is_finite() && run.best().loss <= run.start().loss),
        Err(refusal) => assert!(refusal.to_string().contains("light"), "{refusal}"),
    }
}

#[test]
fn an_overflowing_merit_is_refused() {
    let lens = wide_open();
    let terms = vec![WeightedTerm::new(Term::FocalLength(-1e200), 1e200)];
    let absurd = Goal {
        terms,
        pupil: PupilEdge::Moving,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    let plan = SearchPlan { goal: Some(absurd), ..plan(40) };
    let refusal = run(&lens, &plan, |_, _| ControlFlow::Continue(())).unwrap_err();
    assert!(refusal.to_string().contains("finite") || refusal.to_string().contains("loss"));
    let local = DescentSettings { tolerance: 0.0, ..DescentSettings::default() };
    let refusal =
        run(&lens, &SearchPlan { local, goal: None, ..plan }, |_, _| ControlFlow::Break(()));
    assert!(refusal.unwrap_err().to_string().contains("tolerance"));
}

#[test]
fn a_zoom_lens_in_three_colours_descends() {
    let lens = bundled("zoom_nikkor_28_80");
    // A published zoom lies in a narrow valley: the first few dampings are too small for it.
    let local = DescentSettings { steps: 12, tolerance: 0.03, ..DescentSettings::default() };
    let landscape = SearchPlan { local, ..SearchPlan::default() }.landscape(&lens).unwrap();
    let mut memory = DescentState::default();
    let start = landscape.start();
    let (there, loss, gradients) = landscape.descend(start, &mut memory);
    assert!(gradients > 0 && loss < landscape.loss(start));
    assert_eq!(there.zoom.len(), lens.zoom.len());
}

#[test]
fn lenses_from_anywhere_have_the_focal_length_and_pass_light() {
    let mut free = triplet();
    free.variables.clear();
    let landscape = SearchPlan::default().landscape(&free).unwrap();
    let mut random = seeded(3);
    for _ in 0..3 {
        let drawn = landscape.draw(&mut random).unwrap();
        let focal = LensSummary::new(&drawn, 1e-2).unwrap().focal_lengths[0].unwrap();
        assert!((focal / 100.0 - 1.0).abs() < 0.02, "{focal}");
        assert_eq!(landscape.topology(&drawn), landscape.topology(landscape.start()));
        assert!(landscape.loss(&drawn).is_finite());
    }
}

/// Model glasses become those of a catalogue, and limits are kept, not only penalised.
#[test]
fn a_finalized_lens_satisfies_all_manufacturing_limits() {
    let mut lens = triplet();
    lens.variables.clear();
    lens.surfaces[0].medium = Medium::Model { nd: 1.6204, vd: 60.3 };
    let rules = SearchRules { glass_edge: 1.2, air_edge: 0.2, ..SearchRules::default() };
    let wanted = Goal::with_limits(&lens, &rules.goal_limits(), None, 0.98).unwrap();
    let landscape =
        LensLandscape::new(&lens, &wanted, &rules, &DescentSettings::default()).unwrap();
    let finished = finalize(&landscape, landscape.start()).unwrap();
    assert_eq!(finished.failures(), Vec::<String>::new());
    assert_eq!(finished.glasses.len(), 3, "an old prescription knows index and Abbe number only");
    let glass = &finished.glasses[0];
    assert!((glass.is.0 - 1.6204).abs() < 2e-3 && (glass.is.1 - 60.3).abs() < 1.0, "{glass:?}");
    assert!(finished.limits.iter().filter(|limit| limit.term == "glass_edge").count() == 3);
    assert!(finished.limits.iter().all(|limit| limit.slack() >= 0.0));
    finished.lens.check().unwrap();
    let impossible = SearchRules { track: Some(20.0), ..rules };
    let wanted = Goal::with_limits(&lens, &impossible.goal_limits(), None, 0.98).unwrap();
    let landscape =
        LensLandscape::new(&lens, &wanted, &impossible, &DescentSettings::default()).unwrap();
    let failures = finalize(&landscape, landscape.start()).unwrap().failures();
    assert!(failures.iter().any(|failure| failure.contains("total track")), "{failures:?}");
}

#[test]
fn adam_and_coarse_tolerances_descend() {
    let lens = wide_open();
    for local in [
        DescentSettings { method: DescentMethod::Adam, ..DescentSettings::default() },
        DescentSettings { coarse: 0.1, coarse_steps: 60, ..DescentSettings::default() },
        DescentSettings { semi_diameters: false, ..DescentSettings::default() },
    ] {
        let landscape = SearchPlan { local, ..plan(1) }.landscape(&lens).unwrap();
        let (mut at, mut memory) = (landscape.start().clone(), DescentState::default());
        let before = landscape.loss(&at);
        let mut after = before;
        for _ in 0..6 {
            (at, after, _) = landscape.descend(&at, &mut memory);
        }
        assert!(after < 0.5 * before, "{before} {after}");
    }
}

#[test]
fn light_can_be_requested_per_field() {
    let lens = wide_open();
    let asking = |light: &[f64]| {
        let plan = SearchPlan { light: light.to_vec(), ..plan(1) };
        plan.landscape(&lens).map(|landscape| landscape.loss(landscape.start()))
    };
    let usual = asking(&[1.0]).unwrap();
    assert!((asking(&[1.0; 4]).unwrap() / usual - 1.0).abs() < 1e-12);
    // A field that is to have a quarter more lacks a fifth of it: a quarter of 1 mm² times 0.04.
    let more = asking(&[1.0, 1.25, 1.0, 1.0]).unwrap() - usual;
    assert!((more - 0.25 * 0.04 * 1.003_f64.powi(2)).abs() < 2e-4, "{more}");
    assert!(asking(&[1.0, 1.0]).unwrap_err().to_string().contains("each field"));
    assert!(asking(&[1.0, 0.0, 1.0, 1.0]).unwrap_err().to_string().contains("each field"));
}
