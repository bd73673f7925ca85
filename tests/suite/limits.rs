//! Limits that the optimizer keeps.

use super::merit::{bundled, vary, vary_at};
use aplanat::analysis::distortion;
use aplanat::lens::{
    Lens, OperandKind, Parameter, ParameterKind, Quantity, ZoomNumber, ZoomPosition, add_variables,
};
use aplanat::merit::{
    DerivativeLevel, Goal, Limit, LimitTreatment, Merit, MeritError, PupilEdge, Term, WeightedTerm,
};
use aplanat::optimize::{DescentMethod, OptimizationEnd, Optimizer, start};
use aplanat::pupil::RayModel;

/// The largest violation at the end.
const KEPT: f64 = 1e-9;

fn goal(terms: &[Term]) -> Goal {
    let terms = terms.iter().map(|term| WeightedTerm::new(*term, 1.0)).collect();
    Goal {
        terms,
        pupil: PupilEdge::Moving,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::Constraints,
    }
}

fn default_goal(lens: &Lens) -> Goal {
    Goal::default_for(lens).unwrap()
}

fn free(name: &str) -> Lens {
    let mut lens = bundled(name);
    if lens.variables.is_empty() {
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    }
    lens
}

fn run(lens: &Lens, goal: &Goal, steps: usize) -> Box<dyn Optimizer> {
    let mut optimizer = start(DescentMethod::TrustRegion, lens, goal, 1e-4).unwrap();
    let taken = (0..steps).take_while(|_| optimizer.step().end.is_none()).count();
    println!("{taken} steps");
    optimizer.verify_best();
    optimizer
}

/// The largest violation of the limits of a lens, judged by its own rays, and its merit.
fn judge(best: &Lens, start: &Lens, goal: &Goal) -> (f64, f64) {
    let light = Merit::new(start, goal, 1e-4).unwrap().initial_light().to_vec();
    let merit = Merit::new(best, goal, 1e-4).unwrap().with_initial_light(&light);
    let found = merit.evaluate_with_limits(&merit.values(best), DerivativeLevel::Value).unwrap();
    for limit in found.limits.iter().filter(|limit| limit.violation() > KEPT) {
        println!("broken: {} is {}", limit.margin.name(), limit.margin.value);
    }
    (found.limits.iter().map(Limit::violation).fold(0.0, f64::max), found.objective.value)
}

#[test]
fn lenses_end_within_their_limits() {
    for name in ["tessar_50_f28", "achromat_ac254_100", "double_gauss_nikkor_s_50"] {
        let lens = free(name);
        let goal = default_goal(&lens);
        let (_, before) = judge(&lens, &lens, &goal);
        let (violation, merit) = judge(run(&lens, &goal, 30).best(), &lens, &goal);
        assert!(violation <= KEPT && merit < before, "{name}: {violation:e} {before:e} {merit:e}");
    }
}

#[test]
fn a_start_outside_every_limit_is_led_in() {
    let lens = free("tessar_50_f28");
    let goal = goal(&[
        Term::Spot,
        Term::FocalLength(46.0),
        Term::GlassCenter { min: 3.2, max: 20.0 },
        Term::GlassEdge(1.5),
        Term::AirCenter { min: 1.5, max: 12.0 },
        Term::TotalTrack(54.0),
        Term::BackFocus(35.0),
    ]);
    let merit = Merit::new(&lens, &goal, 1e-4).unwrap();
    let at_start =
        merit.evaluate_with_limits(&merit.values(&lens), DerivativeLevel::Value).unwrap();
    let broken = at_start.limits.iter().filter(|limit| limit.violation() > 0.0).count();
    assert!(broken >= 4, "{broken}");
    let (violation, merit) = judge(run(&lens, &goal, 60).best(), &lens, &goal);
    assert!(violation <= KEPT && merit.is_finite(), "{violation:e}");
}

#[test]
fn limits_that_contradict_each_other_are_named() {
    let lens = free("tessar_50_f28");
    let goal = goal(&[
        Term::Spot,
        Term::GlassCenter { min: 0.5, max: 20.0 },
        Term::TotalTrack(30.0),
        Term::Steepness(0.9),
        Term::BackFocus(38.0),
        Term::AirCenter { min: 0.1, max: 40.0 },
    ]);
    let refused = start(DescentMethod::TrustRegion, &lens, &goal, 1e-3).unwrap_err();
    let MeritError::ConflictingLimits { limits } = refused else { panic!("{refused}") };
    let kinds = ["total track", "back focus", "glass center", "air center", "steepness"];
    let kind = |name: &String| *kinds.iter().find(|kind| name.starts_with(**kind)).unwrap();
    let names: Vec<&str> = limits.iter().map(kind).collect();
    println!("{limits:?}");
    assert!(names.contains(&"total track") && names.contains(&"back focus"), "{names:?}");
    // Every inner gap could be as thin as nothing and even negative, were it not for its own limit.
    let gaps = |name: &&&str| **name == "glass center" || **name == "air center";
    assert_eq!(names.len(), 2 + names.iter().filter(gaps).count(), "{names:?}");
    assert!(!names.contains(&"steepness"));
}

/// A price is what the merit gains when its bound is loosened.
#[test]
fn a_price_is_the_change_of_the_best_merit_by_the_bound() {
    let mut lens = bundled("achromat_ac254_100");
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    vary(&mut lens, 2, Quantity::Thickness);
    let at = |focal: f64| {
        let goal = goal(&[Term::Spot, Term::FocalLength(focal)]);
        let optimizer = run(&lens, &goal, 80);
        let price = optimizer.binding_limits()[0].price;
        (judge(optimizer.best(), &lens, &goal).1, price)
    };
    let ([longer, shorter], price) = ([at(100.01).0, at(99.99).0], at(100.0).1);
    let measured = (shorter - longer) / 0.02;
    println!("{price:e} {measured:e}");
    assert!((price - measured).abs() < 0.02 * measured.abs(), "{price:e} {measured:e}");
}

#[test]
fn variables_at_their_bounds_stay_there() {
    let mut lens = free("tessar_50_f28");
    for i in 0..lens.variables.len() {
        let value = lens.get(lens.variables[i].parameter).unwrap();
        (lens.variables[i].min, lens.variables[i].max) = (Some(value), Some(value));
    }
    let goal = default_goal(&lens);
    let optimizer = run(&lens, &goal, 20);
    let kept: Vec<_> = lens.variables.iter().map(|v| optimizer.best().get(v.parameter)).collect();
    let asked: Vec<_> = lens.variables.iter().map(|v| lens.get(v.parameter)).collect();
    assert_eq!(kept, asked);
    // Then nothing can bring the focal length closer.
    let goal = self::goal(&[Term::Spot, Term::FocalLength(51.0)]);
    let refused = start(DescentMethod::TrustRegion, &lens, &goal, 1e-3).unwrap_err();
    let MeritError::ConflictingLimits { limits } = refused else { panic!("{refused}") };
    let (bounds, others): (Vec<_>, Vec<_>) =
        limits.into_iter().partition(|limit| limit.contains("a bound of the variable"));
    assert!(others.len() == 1 && others[0].starts_with("focal length"), "{others:?}");
    assert!(!bounds.is_empty());
}

#[test]
fn a_dark_field_is_lit() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.surfaces[10].semi_diameter = Some(0.5);
    vary(&mut lens, 10, Quantity::SemiDiameter);
    vary(&mut lens, 0, Quantity::Curvature);
    let goal = goal(&[Term::Spot, Term::Light(0.3)]);
    let optimizer = run(&lens, &goal, 60);
    let (violation, _) = judge(optimizer.best(), &lens, &goal);
    println!("{violation:e} {:?}", optimizer.conflict());
    assert!(violation <= KEPT || !optimizer.conflict().is_empty(), "{violation:e}");
}

/// A paraboloid with a distant point on its axis has no aberration, and only the limit is left.
#[test]
fn a_perfect_mirror_keeps_its_limit() {
    let mut lens = bundled("telescope_rc_f8");
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    lens.fields.values.truncate(1);
    let focal = goal(&[Term::FocalLength(8000.0)]);
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &focal, 1e-4).unwrap();
    let progress = (0..40).map(|_| optimizer.step()).last().unwrap();
    assert!(progress.merit == 0.0, "{progress:?}");
    optimizer.verify_best();
    assert!(judge(optimizer.best(), &lens, &focal).0 <= KEPT);
}

/// Two variables with the same effect leave the Hessian singular.
#[test]
fn equal_surfaces_do_no_harm() {
    let mut lens = free("achromat_ac254_100");
    let rear = lens.surfaces.len() - 1;
    let mut plate = lens.surfaces[rear].clone();
    plate.curvature = 0.0;
    plate.thickness = 1.0;
    lens.surfaces.insert(rear, plate.clone());
    lens.surfaces.insert(rear, plate);
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let goal = default_goal(&lens);
    let (_, before) = judge(&lens, &lens, &goal);
    let (violation, merit) = judge(run(&lens, &goal, 25).best(), &lens, &goal);
    assert!(violation <= KEPT && merit <= before, "{violation:e} {before:e} {merit:e}");
}

/// Every position of the zoom has gaps of its own, a thousand variables in all, and its own track and
/// back focus to keep.
#[test]
fn a_zoom_of_a_thousand_variables_gets_sharper() {
    let mut lens = bundled("achromat_ac254_100");
    lens.fields.values.truncate(1);
    lens.wavelengths.retain(|line| line.primary);
    lens.variables.clear();
    let gaps: Vec<f64> = lens.surfaces.iter().map(|row| row.thickness).collect();
    let position = |i: usize| ZoomPosition {
        numbers: gaps
            .iter()
            .enumerate()
            .map(|(surface, gap)| ZoomNumber::thickness(surface, gap + 1e-4 * i as f64))
            .collect(),
        ..ZoomPosition::default()
    };
    let positions = 1000 / gaps.len() + 1;
    lens.zoom = (0..positions).map(position).collect();
    for i in 0..positions {
        (0..gaps.len())
            .for_each(|gap| vary_at(&mut lens, Parameter::at_zoom(gap, Quantity::Thickness, i)));
    }
    assert!(lens.variables.len() >= 1000, "{}", lens.variables.len());
    let goal = goal(&[Term::Spot, Term::TotalTrack(120.0), Term::BackFocus(80.0)]);
    let merit = Merit::new(&lens, &goal, 1e-2).unwrap();
    let before = merit.value(&merit.values(&lens)).unwrap();
    let optimizer = run(&lens, &goal, 2);
    let after = merit.value(&merit.values(optimizer.best())).unwrap();
    assert!(after < before, "{before:e} {after:e}");
}

/// A new goal has constraints, and its file says so; one without the key was written before there
/// was a choice, and means what it meant.
#[test]
fn new_goals_have_constraints_and_old_files_have_penalties() {
    let goal = default_goal(&free("tessar_50_f28"));
    assert_eq!(goal.limits, LimitTreatment::Constraints);
    let mut file = serde_json::to_value(&goal).unwrap();
    assert_eq!(file["limits"], "constraints");
    assert_eq!(serde_json::from_value::<Goal>(file.clone()).unwrap(), goal);
    file.as_object_mut().unwrap().remove("limits");
    let old: Goal = serde_json::from_value(file.clone()).unwrap();
    assert_eq!(old.limits, LimitTreatment::Penalties);
    assert_eq!(serde_json::to_value(&old).unwrap(), file);
}

/// A constraint of light is kept exactly where the penalty of the same term vanishes.
#[test]
fn light_is_limited_alike_as_constraint_and_as_penalty() {
    let start = free("wide_nikkor_28_f35");
    let goal = goal(&[Term::Light(1.0)]);
    let merit = Merit::new(&start, &goal, 1e-3).unwrap();
    let mut narrow = start.clone();
    for row in &mut narrow.surfaces {
        row.semi_diameter = row.semi_diameter.map(|rim| 0.97 * rim);
    }
    let merit = Merit::new(&narrow, &goal, 1e-3).unwrap().with_initial_light(merit.initial_light());
    let values = merit.values(&narrow);
    let limits = merit.evaluate_with_limits(&values, DerivativeLevel::Value).unwrap().limits;
    let pupils = merit.spot_samplings().len();
    assert_eq!(limits.len(), pupils);
    let by_limits: f64 = limits.iter().map(|limit| limit.weight * limit.violation().powi(2)).sum();
    let penalty = merit.value(&values).unwrap();
    assert!(penalty > 0.0 && (by_limits / penalty - 1.0).abs() < 1e-9, "{by_limits:e} {penalty:e}");
}

#[test]
fn penalties_are_kept_when_a_goal_asks_for_them() {
    let lens = free("achromat_ac254_100");
    let penalties =
        Goal { limits: LimitTreatment::Penalties, ..goal(&[Term::Spot, Term::FocalLength(90.0)]) };
    let optimizer = run(&lens, &penalties, 30);
    assert!(optimizer.binding_limits().is_empty());
    let hard = Goal { limits: LimitTreatment::Constraints, ..penalties };
    let text = serde_json::to_string(&hard).unwrap();
    assert!(text.contains(r#""limits":"constraints""#), "{text}");
    assert!(judge(optimizer.best(), &lens, &hard).0 > KEPT, "a penalty gives way");
    assert!(run(&lens, &hard, 30).conflict().is_empty());
}

/// At the best lens the light of a field is clipped by a crescent that the rays of the lens on the
/// other side of the clipping do not see.
#[test]
fn light_is_kept_where_clipping_begins() {
    let mut lens = bundled("telescope_rc_f8");
    lens.surfaces[0].obstruction = None;
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let goal = default_goal(&lens);
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, 1e-3).unwrap();
    let end = (0..60).find_map(|_| optimizer.step().end);
    let (violation, merit) = judge(optimizer.best(), &lens, &goal);
    assert!(end.is_some_and(|end| end != OptimizationEnd::Conflict), "{end:?}");
    assert!(violation <= KEPT && merit < 1.41e-3, "{violation:e} {merit:e}");
}

/// The focal length at two zoom positions and the light of an f-number beam, which the focal length
/// fixes at one wavelength and nearly at the others.
#[test]
fn limits_that_depend_on_each_other_are_approached() {
    let lens = free("macro_micro_nikkor_105_f28");
    let goal = default_goal(&lens);
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, 1e-2).unwrap();
    let progress = (0..12).map(|_| optimizer.step()).last().unwrap();
    assert!(progress.end.is_none() && progress.merit < 1.0, "{progress:?}");
}

/// Nothing that may change opens the rim through which a field has to get, and the limit is named.
#[test]
fn a_limit_that_nothing_can_keep_is_named() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.surfaces[10].semi_diameter = Some(0.5);
    vary(&mut lens, 10, Quantity::Curvature);
    let mut optimizer =
        start(DescentMethod::TrustRegion, &lens, &goal(&[Term::Spot, Term::Light(0.9)]), 1e-3)
            .unwrap();
    let end = (0..100).find_map(|_| optimizer.step().end);
    assert_eq!(end, Some(OptimizationEnd::Conflict));
    assert!(!optimizer.conflict().is_empty());
    assert!(optimizer.conflict().iter().all(|name| name.contains("light")));
}

/// A lens of two radii of 50 mm, 3 mm thick, in a beam of 20 mm: the light fills the first surface to
/// 10 mm, where two sags of 1.0102 mm leave 0.9796 mm of glass, whether the rim is fixed or not.
#[test]
fn an_edge_is_measured_where_the_light_ends_if_no_rim_is_fixed() {
    let mut lens = aplanat::lens::blank();
    lens.aperture = aplanat::lens::Aperture::EntrancePupilDiameter(20.0);
    lens.surfaces[0].thickness = 3.0;
    for (row, curvature) in lens.surfaces.iter_mut().zip([0.02, -0.02]) {
        (row.curvature, row.semi_diameter) = (curvature, None);
    }
    let edge = 3.0 - 2.0 * (50.0 - f64::sqrt(2500.0 - 100.0));
    let terms = [Term::GlassEdge(2.0), Term::Steepness(0.1)].map(|t| WeightedTerm::new(t, 1.0));
    let found = aplanat::merit::constraint_margins(&lens, terms.into_iter()).unwrap();
    let value = |term: &str| found.iter().find(|margin| margin.term == term).unwrap().value;
    assert!((value("glass_edge") - edge).abs() < 1e-8, "{}", value("glass_edge"));
    assert!((value("steepness") - 0.2).abs() < 1e-9);
    // A penalty counts what is missing at both rims, once each.
    let mut goal = goal(&[Term::GlassEdge(2.0)]);
    goal.limits = LimitTreatment::Penalties;
    let merit = Merit::new(&lens, &goal, 1e-3).unwrap();
    let cost = merit.value(&merit.values(&lens)).unwrap();
    assert!(cost >= (2.0 - edge).powi(2) - 1e-6, "{cost}");
    lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = Some(10.0));
    let fixed = aplanat::merit::constraint_margins(&lens, terms.into_iter()).unwrap();
    let fixed = fixed.iter().find(|margin| margin.term == "glass_edge").unwrap().value;
    assert!((fixed - edge).abs() < 1e-12, "{fixed}");
}

/// The largest distortion of the fields of a lens, in percent.
fn largest_distortion(lens: &Lens) -> f64 {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let off_axis = model.fields.iter().filter(|field| field.y != 0.0);
    let percent = |field: &aplanat::lens::FieldPoint| {
        100.0 * distortion(&model, *field, model.primary).unwrap().distortion.unwrap()
    };
    off_axis.map(percent).map(f64::abs).fold(0.0, f64::max)
}

/// Distortion within bounds is a limit: it is kept as it is measured, and its price is told if it holds.
#[test]
fn distortion_is_kept_within_its_limit() {
    let lens = free("double_gauss_nikkor_s_50");
    let before = largest_distortion(&lens);
    let most = 0.5 * before;
    let operand =
        Term::Operand { kind: OperandKind::Distortion, min: Some(-most), max: Some(most) };
    let mut goal = default_goal(&lens);
    goal.terms.push(WeightedTerm::new(operand, 1.0));
    let (start_violation, _) = judge(&lens, &lens, &goal);
    assert!(before > 0.01 && start_violation > 0.4 * before, "{before} {start_violation}");
    let optimizer = run(&lens, &goal, 60);
    let best = optimizer.best();
    let (violation, merit) = judge(best, &lens, &goal);
    assert!(violation <= KEPT && merit.is_finite(), "{violation:e}");
    assert!(largest_distortion(best) < most + 1e-4, "{} {most}", largest_distortion(best));
    let held = |price: &&aplanat::optimize::LimitPrice| price.limit.term == "distortion";
    for price in optimizer.binding_limits().iter().filter(held) {
        assert!(price.price >= 0.0 && price.bound.abs() == most, "{price:?}");
    }
}
