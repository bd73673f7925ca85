//! Effects that a plan leaves out change the numbers by no more than it promises, on every lens.

use aplanat::analysis::{AnalysisError, Estimate, Spot, distortion, spots};
use aplanat::effects::{
    Effect, EffectDecision, EffectOverride, EffectOverrides, EffectPlan, TracePurpose,
    build_ray_model, measure_effects, plan, simplify,
};
use aplanat::files;
use aplanat::lens::{FieldKind, FieldPoint, Lens, Object, Row, Shape};
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use aplanat::trace::TraceSink as _;
use std::collections::BTreeSet;

const TASK: TracePurpose = TracePurpose::Spot(1e-3);

fn library() -> impl Iterator<Item = (&'static str, Lens)> {
    files::bundled_lenses()
        .iter()
        .map(|lens| (lens.name, files::json::read(lens.text, lens.name).unwrap()))
}

fn lens(name: &str) -> Lens {
    library().find(|(other, _)| *other == name).unwrap().1
}

fn planned(lens: &Lens, zoom: usize, task: TracePurpose, choices: &EffectOverrides) -> EffectPlan {
    plan(&measure_effects(lens, zoom).unwrap(), task, choices)
}

fn forced(effect: Effect, choice: EffectOverride) -> EffectOverrides {
    EffectOverrides::default().with(effect, choice)
}

fn exact(model: &RayModel) -> Vec<Result<Spot, AnalysisError>> {
    spots(model, Accuracy { tolerance: 1e-4, ..Accuracy::default() })
}

/// The largest change of the RMS radius of any field, in mm, and the errors of both; `None` where
/// a field is dark in one of the two.
fn change(a: &RayModel, b: &RayModel) -> Option<(f64, f64)> {
    difference(&exact(a), &exact(b))
}

fn difference(
    a: &[Result<Spot, AnalysisError>],
    b: &[Result<Spot, AnalysisError>],
) -> Option<(f64, f64)> {
    let (mut change, mut error) = (0.0f64, 0.0f64);
    for pair in a.iter().zip(b) {
        match pair {
            (Ok(a), Ok(b)) => {
                change = change.max((a.rms.value - b.rms.value).abs());
                error = error.max(a.rms.error + b.rms.error);
            }
            (Err(_), Err(_)) => {}
            _ => return None,
        }
    }
    Some((change, error))
}

/// The largest distance in mm between the image points of the chief rays of any field at the
/// primary wavelength in two models, as spots and fans see them; `None` where one has none.
fn chief_change(a: &RayModel, b: &RayModel) -> Option<f64> {
    let mut most = 0.0f64;
    for field in &a.fields {
        let point = |model: &RayModel| {
            let launch = model.launch(*field, model.primary).ok()?;
            Some(launch.unclipped_landing([0.0, 0.0])?.ray.point.value())
        };
        let (a, b) = (point(a)?, point(b)?);
        most = most.max((a.x - b.x).hypot(a.y - b.y));
    }
    Some(most)
}

/// A lens by its plan, with its spots.
struct PlannedLens<'a> {
    name: &'a str,
    zoom: usize,
    lens: &'a Lens,
    auto: &'a EffectPlan,
    model: RayModel,
    spots: Vec<Result<Spot, AnalysisError>>,
}

impl<'a> PlannedLens<'a> {
    fn new(name: &'a str, zoom: usize, lens: &'a Lens, auto: &'a EffectPlan) -> Self {
        let model = build_ray_model(lens, zoom, auto).unwrap();
        Self { name, zoom, lens, auto, spots: exact(&model), model }
    }
}

fn check(by_plan: &PlannedLens<'_>, decision: &EffectDecision) {
    let PlannedLens { name, zoom, lens, auto, model: off, spots } = by_plan;
    let zoom = *zoom;
    let effect = decision.effect;
    let forced = planned(lens, zoom, TASK, &forced(effect, EffectOverride::On));
    let same = forced.as_conic == auto.as_conic && forced.unclipped == auto.unclipped;
    if same && Effect::ALL.iter().all(|e| forced.computes(*e) == auto.computes(*e)) {
        return; // It is computed anyway.
    }
    let on = build_ray_model(lens, zoom, &forced).unwrap();
    if effect == Effect::Aiming {
        let change = chief_change(&on, off).unwrap();
        assert!(change <= decision.residual * (1.0 + 1e-9), "{name} aiming: {change}");
    }
    let allowed = if decision.unit == "mm" { decision.residual } else { 0.0 };
    let found = difference(&exact(&on), spots);
    let (change, error) = found.unwrap_or_else(|| panic!("{name} {effect:?}: dark"));
    assert!(
        change <= allowed + error + 1e-12,
        "{name} zoom {zoom}, {effect:?}: {change:e} mm against {allowed:e} ± {error:e}"
    );
}

#[test]
fn forcing_an_effect_on_changes_no_more_than_the_plan_said() {
    for (name, lens) in library() {
        let last = lens.zoom_positions() - 1;
        for zoom in BTreeSet::from([0, last]) {
            let auto = planned(&lens, zoom, TASK, &EffectOverrides::default());
            let by_plan = PlannedLens::new(name, zoom, &lens, &auto);
            println!("{name} zoom {zoom}");
            for decision in &auto.decisions {
                println!(
                    "  {:17} {:3} {:9.2e} of {:8.2e} {}: {}",
                    effect_name(decision),
                    if decision.computed { "yes" } else { "no" },
                    decision.error,
                    decision.limit,
                    decision.unit,
                    decision.reason
                );
                check(&by_plan, decision);
            }
        }
    }
}

fn effect_name(decision: &EffectDecision) -> &'static str {
    decision.effect.name()
}

#[test]
fn forcing_an_effect_off_changes_no_more_than_its_number() {
    let mut checked = 0;
    for (name, lens) in library() {
        for effect in [Effect::Dispersion, Effect::Asphere, Effect::FiniteObject, Effect::Aiming] {
            let on = planned(&lens, 0, TASK, &forced(effect, EffectOverride::On));
            let off = planned(&lens, 0, TASK, &forced(effect, EffectOverride::Off));
            let error = off.decision(effect).unwrap().residual;
            let (on, off) =
                (build_ray_model(&lens, 0, &on).unwrap(), build_ray_model(&lens, 0, &off).unwrap());
            if !error.is_finite() {
                continue;
            }
            if let Some((change, rounding)) = change(&on, &off) {
                checked += usize::from(change > 0.0);
                assert!(change <= error + rounding + 1e-12, "{name} {effect:?}: {change} {error}");
            }
        }
    }
    assert!(checked > 15, "only {checked} effects did anything");
}

#[test]
fn an_excluded_effect_is_not_modelled() {
    let um = 0.5875618;
    let phone = lens("phone_us7558005_1");
    let choices =
        forced(Effect::Asphere, EffectOverride::Off).with(Effect::Clipping, EffectOverride::On);
    let off = planned(&phone, 0, TASK, &choices);
    let mut plain = phone.clone();
    plain.surfaces.iter_mut().for_each(|row| row.asphere.clear());
    let mut system = phone.resolve(0, um).unwrap();
    simplify(&mut system, &off);
    assert!(system.surfaces.iter().all(|s| !matches!(s.shape, Shape::Asphere { .. })));
    assert_eq!(system, plain.resolve(0, um).unwrap());

    let gauss = lens("double_gauss_rudolph_50");
    let off = planned(&gauss, 0, TASK, &forced(Effect::Clipping, EffectOverride::Off));
    let mut open = gauss.clone();
    open.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let mut system = gauss.resolve(0, um).unwrap();
    simplify(&mut system, &off);
    assert_eq!(system, open.resolve(0, um).unwrap());

    let off = planned(&gauss, 0, TASK, &forced(Effect::Dispersion, EffectOverride::Off));
    assert_eq!(build_ray_model(&gauss, 0, &off).unwrap().channels.len(), 1);
}

#[test]
fn negligible_asphere_terms_are_dropped_and_others_kept() {
    let mut lens = lens("double_gauss_rudolph_50");
    lens.surfaces[3].asphere = vec![1e-14];
    lens.surfaces[8].asphere = vec![1e-6];
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    let asphere = auto.decision(Effect::Asphere).unwrap();
    assert_eq!((&auto.as_conic, &asphere.surfaces), (&vec![3], &vec![8]));
    assert!(asphere.residual > 0.0 && asphere.residual < asphere.limit, "{asphere:?}");
    check(&PlannedLens::new("figured double Gauss", 0, &lens, &auto), asphere);
    let traced = planned(&lens, 0, TracePurpose::Trace, &EffectOverrides::default());
    assert!(traced.as_conic.len() < 2, "a ray as such is exact");
    let drawn = planned(&lens, 0, TracePurpose::Layout, &EffectOverrides::default());
    assert!(!drawn.computes(Effect::Dispersion), "nobody sees colours in a drawing of the lens");
}

#[test]
fn distant_objects_count_as_infinite() {
    let mut lens = lens("double_gauss_rudolph_50");
    for (distance, finite) in [(1e9, false), (500.0, true)] {
        lens.object = Object::Finite(distance);
        let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
        let object = auto.decision(Effect::FiniteObject).unwrap();
        assert_eq!(object.computed, finite, "{object:?}");
        let model = build_ray_model(&lens, 0, &auto).unwrap();
        assert_eq!(model.beam.object == Object::Infinity, !finite);
        check(&PlannedLens::new("double Gauss", 0, &lens, &auto), object);
    }
    assert_eq!(lens.fields.kind, FieldKind::Angle);
}

#[test]
fn a_tilt_or_a_temperature_that_moves_no_ray_counts_as_none() {
    let gauss = lens("double_gauss_rudolph_50");
    for (degrees, tilted) in [(1e-9, false), (0.2, true)] {
        let mut lens = gauss.clone();
        lens.surfaces[3].tilt = [degrees, 0.0];
        let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
        let poses = auto.decision(Effect::Poses).unwrap();
        assert_eq!(poses.computed, tilted, "{poses:?}");
        assert!(poses.error > 0.0 && poses.residual <= poses.limit, "{poses:?}");
        check(&PlannedLens::new("tilted double Gauss", 0, &lens, &auto), poses);
        let off = planned(&lens, 0, TASK, &forced(Effect::Poses, EffectOverride::Off));
        let mut system = lens.resolve(0, 0.5875618).unwrap();
        simplify(&mut system, &off);
        assert!(!system.has_poses());
    }
    let singlet = lens("singlet_la1131");
    for (celsius, matters) in [(20.0001, false), (60.0, true)] {
        let mut lens = singlet.clone();
        lens.environment.celsius = Some(celsius);
        let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
        let warmth = auto.decision(Effect::Temperature).unwrap();
        assert_eq!(warmth.computed, matters, "{warmth:?}");
        assert!(warmth.error > 0.0 && warmth.residual <= warmth.limit, "{warmth:?}");
        check(&PlannedLens::new("warm singlet", 0, &lens, &auto), warmth);
        let off = planned(&lens, 0, TASK, &forced(Effect::Temperature, EffectOverride::Off));
        let [off, plain] = [(&lens, off), (&singlet, auto.clone())].map(|(lens, plan)| {
            build_ray_model(lens, 0, &plan).unwrap().channels[0].system.clone()
        });
        assert_eq!(off, plain);
    }
    let idle = planned(&gauss, 0, TASK, &EffectOverrides::default());
    for effect in [Effect::Poses, Effect::Temperature] {
        assert!(!idle.computes(effect) && idle.decision(effect).unwrap().error == 0.0);
    }
}

#[test]
fn unreached_semi_diameters_are_dropped_and_others_kept() {
    let mut lens = lens("double_gauss_rudolph_50");
    lens.surfaces[0].semi_diameter = Some(50.0);
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    assert!(auto.unclipped.contains(&0), "{:?}", auto.unclipped);
    let clipping = auto.decision(Effect::Clipping).unwrap();
    assert!(clipping.computed && !clipping.surfaces.contains(&0), "{clipping:?}");
}

/// The numbers of a field that depend on the beam: RMS radius, light and height of the chief ray,
/// each with its error.
fn beam_numbers(model: &RayModel, tolerance: f64) -> Vec<Option<[(f64, f64); 3]>> {
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    let numbers = |spot: Result<Spot, AnalysisError>| {
        let spot = spot.ok()?;
        let chief = distortion(model, spot.field, model.primary).ok()?.height;
        let of = |estimate: Estimate| (estimate.value, estimate.error);
        Some([of(spot.rms), of(spot.light), (chief, 1e-9)])
    };
    spots(model, accuracy).into_iter().map(numbers).collect()
}

#[test]
fn planned_beams_are_those_aimed_at_the_stop() {
    let (mut fields, mut left_out) = (0, 0);
    for (name, lens) in library() {
        for zoom in 0..lens.zoom_positions() {
            let auto = planned(&lens, zoom, TASK, &EffectOverrides::default());
            left_out += usize::from(!auto.computes(Effect::Aiming));
            let on = planned(&lens, zoom, TASK, &forced(Effect::Aiming, EffectOverride::On));
            let auto = beam_numbers(&build_ray_model(&lens, zoom, &auto).unwrap(), 1e-3);
            let on = beam_numbers(&build_ray_model(&lens, zoom, &on).unwrap(), 1e-3);
            for (number, (auto, on)) in auto.iter().zip(&on).enumerate() {
                assert_eq!(auto.is_some(), on.is_some(), "{name} zoom {zoom} field {number}");
                let (Some(auto), Some(on)) = (auto, on) else { continue };
                fields += 1;
                for ((a, a_error), (b, b_error)) in auto.iter().zip(on) {
                    assert!(
                        (a - b).abs() <= a_error + b_error,
                        "{name} zoom {zoom} field {number}: {a} ± {a_error:e}, {b} ± {b_error:e}"
                    );
                }
            }
        }
    }
    assert!(fields > 80 && left_out > 0, "{fields} fields, {left_out} lenses not aimed");
}

#[test]
fn an_effect_plan_exists_for_lenses_without_light() {
    let mut lens = lens("double_gauss_rudolph_50");
    lens.surfaces[0].semi_diameter = Some(0.0);
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    assert_eq!(auto.decisions.len(), Effect::ALL.len());
    lens.surfaces.push(Row { curvature: 10.0, thickness: -5.0, ..Row::default() });
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    let text = serde_json::to_string(&auto).unwrap();
    assert!(text.contains("\"effect\":\"dispersion\""), "{text}");
}

#[test]
fn numbers_that_no_shift_bounds_are_planned_exactly() {
    let mut lens = lens("double_gauss_rudolph_50");
    lens.surfaces[8].asphere = vec![1e-14];
    lens.object = Object::Finite(1e9);
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    assert!(!auto.computes(Effect::Asphere) && !auto.computes(Effect::FiniteObject));
    let exact = planned(&lens, 0, TracePurpose::Exact, &EffectOverrides::default());
    for decision in &exact.decisions {
        assert!(decision.computed || !(decision.error > 0.0) || decision.unit != "mm");
    }
    assert_eq!(exact.neglected().shift, 0.0);
    assert!(exact.computes(Effect::Asphere) && exact.computes(Effect::FiniteObject));
}

#[test]
fn beams_that_are_not_aimed_are_not_searched_for() {
    let lens = lens("cooke_triplet_100_f27");
    let off = planned(&lens, 0, TASK, &forced(Effect::Aiming, EffectOverride::Off));
    let model = build_ray_model(&lens, 0, &off).unwrap();
    assert_eq!(model.aiming, Aiming::Paraxial);
    assert!(model.neglected.shift > 0.0 && model.neglected.ray_shift > model.neglected.shift);
    assert_eq!(off.unmeasured().count(), 0);
    let open = planned(&lens, 0, TASK, &forced(Effect::Clipping, EffectOverride::Off));
    assert_eq!(open.unmeasured().collect::<Vec<_>>(), [Effect::Clipping]);
}

#[test]
fn a_rim_that_holds_back_light_far_from_the_beam_is_kept() {
    // Without it, islands of light beyond the beam reach the image at this field.
    let mut lens = lens("cooke_triplet_100_f27");
    lens.fields.values = vec![FieldPoint { x: 0.0, y: 14.0, weight: 1.0 }];
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    let on = planned(&lens, 0, TASK, &forced(Effect::Clipping, EffectOverride::On));
    let rms = |plan| exact(&build_ray_model(&lens, 0, plan).unwrap())[0].as_ref().unwrap().rms;
    let (auto, on) = (rms(&auto), rms(&on));
    assert!((auto.value - on.value).abs() <= auto.error + on.error, "{auto:?} {on:?}");
}

/// Points spread evenly over the unit disc, and more about its edge: the rim of a stop on a curved surface
/// lies inside it on one side and outside on the other.
fn disc_points() -> Vec<[f64; 2]> {
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let spiral = (0..1200).map(|i| (((f64::from(i) + 0.5) / 1200.0).sqrt(), turn * f64::from(i)));
    let around = |i: i32| 0.01 + std::f64::consts::TAU * f64::from(i) / 120.0;
    let edges = [0.99, 0.995, 0.998, 0.999, 0.99999, 1.001, 1.002, 1.003, 1.004, 1.01];
    let edges = edges.into_iter().flat_map(|r| (0..120).map(move |i| (r, around(i))));
    spiral.chain(edges).map(|(r, angle)| [r * angle.sin(), r * angle.cos()]).collect()
}

/// Plans with all effects on: with the rims that are needed, and with all rims.
fn rim_plans(lens: &Lens) -> [EffectPlan; 2] {
    let every = Effect::ALL.iter().filter(|effect| **effect != Effect::Clipping);
    let choices = EffectOverrides::default();
    let choices = every.fold(choices, |all, effect| all.with(*effect, EffectOverride::On));
    let closed = choices.clone().with(Effect::Clipping, EffectOverride::On);
    [choices, closed].map(|choices| planned(lens, 0, TASK, &choices))
}

/// The rays of the library's fields and wavelengths that end otherwise by two plans, and all.
fn rays_let_through(lens: &Lens, plans: &[EffectPlan; 2]) -> (usize, usize) {
    let [open, closed] = [0, 1].map(|i| build_ray_model(lens, 0, &plans[i]).unwrap());
    let points = disc_points();
    let (mut different, mut all) = (0, 0);
    for field in &open.fields {
        for wavelength in 0..open.channels.len() {
            let landed = |model: &RayModel| {
                let (indices, landed) =
                    model.launch(*field, wavelength).ok()?.trace_points(&points);
                let imaged = |i: &usize| landed.fate(*i).is_imaged();
                let arrived = (0..indices.len()).filter(imaged).map(|i| indices[i]);
                Some(arrived.collect::<BTreeSet<_>>())
            };
            let (Some(open), Some(closed)) = (landed(&open), landed(&closed)) else { continue };
            different += open.symmetric_difference(&closed).count();
            all += closed.len();
        }
    }
    (different, all)
}

/// Rims that a plan leaves out hold back no ray: on every lens of the library, with rays that the plan
/// has not seen.
#[test]
fn a_rim_that_is_left_out_holds_back_no_ray() {
    let mut rays = 0;
    for entry in files::library_lenses() {
        let lens = files::json::read(entry.text().unwrap(), &entry.name).unwrap();
        let (different, all) = rays_let_through(&lens, &rim_plans(&lens));
        assert_eq!(different, 0, "{}: of {all} rays", entry.name);
        rays += all;
    }
    assert!(rays > 1_000_000, "{rays} rays");
}

/// The same rays tell that a rim is missing which only blue light meets.
#[test]
fn a_rim_that_one_wavelength_meets_is_missed() {
    let text = include_str!("../../lenses/more/microscope_us4037934_1.json");
    let lens = files::json::read(text, "microscope").unwrap();
    let [needed, all] = rim_plans(&lens);
    assert!(!needed.unclipped.contains(&13), "{:?}", needed.unclipped);
    let open = EffectPlan { unclipped: (1..10).chain(11..14).collect(), ..needed };
    assert!(rays_let_through(&lens, &[open, all]).0 > 0);
}

/// A few sampled rays that all end at rims do not show that colours take the same path.
#[test]
fn a_field_of_little_light_is_traced_at_all_its_wavelengths() {
    let mut lens = lens("wide_nikkor_28_f35");
    lens.fields.values = vec![FieldPoint { x: 0.0, y: 37.65, weight: 1.0 }];
    for task in [TASK, TracePurpose::Exact] {
        let auto = planned(&lens, 0, task, &EffectOverrides::default());
        let decision = auto.decision(Effect::Dispersion).unwrap();
        assert!(decision.computed && decision.reason.contains("too few rays"), "{decision:?}");
    }
    lens.wavelengths.truncate(1);
    lens.wavelengths[0].primary = true;
    let auto = planned(&lens, 0, TASK, &EffectOverrides::default());
    assert!(!auto.computes(Effect::Dispersion));
}
