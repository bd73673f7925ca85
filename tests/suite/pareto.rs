//! The front of sharpness against light.

use super::merit::bundled;
use aplanat::lens::{FieldPoint, Lens, Parameter, Quantity, Variable, Wavelength};
use aplanat::merit::{Goal, Merit, PupilEdge};
use aplanat::optimize::pareto::{
    Front, ParetoError, ParetoPoint, ParetoSettings, ParetoSweep, Scalarization,
};
use aplanat::pupil::RayModel;
use aplanat::tolerance::ToleranceGrade;

/// A lens in one colour at three fields.
fn lens() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.wavelengths = vec![Wavelength { um: 0.587_561_8, weight: 1.0, primary: true }];
    lens.fields.values = [0.0, 10.0, 20.0].map(|y| FieldPoint { x: 0.0, y, weight: 1.0 }).to_vec();
    lens
}

fn swept(pupil: PupilEdge) -> ParetoSweep {
    let thesis = ParetoSettings::weighted_sum();
    let settings = ParetoSettings { points: 4, steps: 100, pupil, ..thesis };
    let mut sweep = ParetoSweep::new(&lens(), &settings).unwrap();
    let mut before = 0.0;
    loop {
        let slice = sweep.step();
        let covered = sweep.hypervolume();
        assert!(covered >= before && slice.done <= slice.total);
        before = covered;
        if slice.finished {
            return sweep;
        }
    }
}

#[test]
fn the_unbiased_front_has_a_larger_hypervolume() {
    let [ours, biased] = [PupilEdge::Moving, PupilEdge::Frozen].map(swept);
    let [a, b] = [&ours, &biased].map(ParetoSweep::hypervolume);
    println!("hypervolume {a:.4}, biased {b:.4}");
    assert!(a > b);
    let designs = ours.front().points();
    for pair in designs.windows(2) {
        assert!(pair[0].light < pair[1].light && pair[0].spot < pair[1].spot);
    }
    for design in designs {
        design.lens.check().unwrap();
        let again = ParetoPoint::evaluate(&design.lens, design.weight, 1e-6).unwrap();
        assert!((again.spot / design.spot - 1.0).abs() < 1e-3, "{} {}", again.spot, design.spot);
        assert!((again.light / design.light - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_front_is_the_same_on_one_thread_and_on_two() {
    let settings = ParetoSettings { points: 2, steps: 5, ..ParetoSettings::default() };
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sweep = ParetoSweep::new(&lens(), &settings).unwrap();
            while !sweep.step().finished {}
            sweep.front().clone()
        })
    });
    assert_eq!(one, two);
}

/// The sweep of a lens, and the reasons for which levels were not reached.
fn finished(lens: &Lens, settings: &ParetoSettings) -> (ParetoSweep, Vec<String>) {
    let mut sweep = ParetoSweep::new(lens, settings).unwrap();
    let mut refusals = Vec::new();
    loop {
        let slice = sweep.step();
        assert!(slice.done <= slice.total);
        refusals.extend(slice.refused);
        if slice.finished {
            return (sweep, refusals);
        }
    }
}

/// At every level of light there is a lens, and all keep the focal length and the bounds of the rims.
#[test]
fn levels_of_light_are_reached_by_lenses_that_keep_the_limits() {
    let settings =
        ParetoSettings { points: 3, steps: 30, light: [0.7, 1.2], ..ParetoSettings::default() };
    let (sweep, _) = finished(&lens(), &settings);
    let start = &sweep.start;
    let focal_length = |lens: &Lens| RayModel::from_lens(lens, 0).unwrap().first_order.efl.unwrap();
    for share in [0.7, (0.7f64 * 1.2).sqrt(), 1.2] {
        let has = |p: &&ParetoPoint| p.light >= share * start.light * (1.0 - 1e-4);
        let best = sweep.front().points().iter().find(has).unwrap();
        assert!(best.spot < 0.5 * start.spot, "{share}: {} {}", best.spot, start.spot);
    }
    for point in sweep.front().points() {
        let [found, asked] = [&point.lens, &start.lens].map(focal_length);
        assert!((found - asked).abs() < 1e-5, "{found} {asked}");
        for variable in &point.lens.variables {
            let value = point.lens.get(variable.parameter).unwrap();
            assert!(variable.min.is_none_or(|min| value >= min));
            assert!(variable.max.is_none_or(|max| value <= max));
        }
    }
}

#[test]
fn light_that_no_lens_has_is_named_and_the_rest_of_the_front_is_found() {
    let settings =
        ParetoSettings { points: 2, steps: 20, light: [0.8, 30.0], ..ParetoSettings::default() };
    let (sweep, refusals) = finished(&lens(), &settings);
    assert!(refusals.iter().any(|why| why.contains("mm^2 of light")), "{refusals:?}");
    let dark = sweep.front().points().iter().find(|p| p.light >= 0.8 * sweep.start.light).unwrap();
    assert!(dark.spot < 0.5 * sweep.start.spot);
    assert!(sweep.front().points().iter().all(|p| p.light < 30.0 * sweep.start.light));
}

/// A field without light at the start: a limit asks for light there.
#[test]
fn a_field_that_is_dark_at_the_start_is_lit() {
    let mut dark = lens();
    dark.fields = bundled("double_gauss_rudolph_50").fields;
    dark.surfaces[10].semi_diameter = Some(0.5);
    let settings = ParetoSettings {
        points: 1,
        steps: 40,
        light: [0.5, 0.5],
        semi_diameter_factors: [0.25, 30.0],
        ..ParetoSettings::default()
    };
    let (sweep, _) = finished(&dark, &settings);
    assert!(!sweep.start.has_light);
    let brightest = sweep.front().points().last().unwrap();
    assert!(brightest.has_light && brightest.light > sweep.start.light);
}

#[test]
fn a_sweep_of_one_variable_and_one_without_room_end() {
    let mut one = bundled("achromat_ac254_100");
    for row in &mut one.surfaces {
        row.semi_diameter = None;
    }
    one.surfaces[0].semi_diameter = Some(10.0);
    let rim = Parameter::new(0, Quantity::SemiDiameter);
    one.variables = vec![Variable { parameter: rim, min: None, max: None }];
    let settings =
        ParetoSettings { points: 3, steps: 10, light: [0.5, 1.0], ..ParetoSettings::default() };
    let (sweep, refusals) = finished(&one, &settings);
    assert!(sweep.start.lens.variables.len() == 1 && refusals.is_empty(), "{refusals:?}");
    // The sharpest lens has more than the least light: its focus is that of a wide pupil.
    let sharpest = &sweep.front().points()[0];
    assert!(sharpest.spot < sweep.start.spot);
    assert!((0.5..1.0).contains(&(sharpest.light / sweep.start.light)), "{}", sharpest.light);

    let mut held = sweep.start.lens.clone();
    let values: Vec<_> = held.variables.iter().map(|v| held.get(v.parameter)).collect();
    for (variable, value) in held.variables.iter_mut().zip(values) {
        (variable.min, variable.max) = (value, value);
    }
    let (sweep, refusals) = finished(&held, &ParetoSettings { light: [0.5, 1.4], ..settings });
    assert_eq!(sweep.front().points().len(), 1);
    assert!(!refusals.is_empty());
}

#[test]
fn a_sweep_with_frozen_pupils_is_one_of_weighted_sums() {
    let biased = ParetoSettings::default().biased();
    assert_eq!(biased.scalarization, Scalarization::WeightedSum);
    assert_eq!(biased, ParetoSettings::weighted_sum().biased());
    let few = ParetoSettings { points: 1, steps: 1, ..biased };
    let frozen = ParetoSettings { pupil: PupilEdge::Frozen, ..ParetoSettings::default() };
    let named = ParetoSettings { points: 1, steps: 1, ..frozen };
    let [one, other] = [few, named].map(|settings| finished(&lens(), &settings).0);
    assert_eq!(one.front(), other.front());
}

#[test]
fn a_front_drops_dominated_points() {
    let start = ParetoPoint::evaluate(&lens(), None, 1e-4).unwrap();
    let design = |spot: f64, light: f64| ParetoPoint { spot, light, ..start.clone() };
    let mut front = Front::default();
    assert!(front.insert(design(2.0, 1.0)) && front.insert(design(3.0, 2.0)));
    assert!(!front.insert(design(2.5, 1.0)) && !front.insert(design(2.0, 1.0)));
    assert!(!front.insert(design(f64::NAN, 9.0)));
    assert!(!front.insert(ParetoPoint { has_light: false, ..design(0.1, 9.0) }));
    // (4 - 2) x 1 + (4 - 3) x (2 - 1), in multiples of 4 x 1.
    assert!((front.hypervolume(4.0, 1.0) - 0.75).abs() < 1e-15);
    assert!(front.insert(design(1.0, 3.0)));
    assert_eq!(front.points().len(), 1);
}

#[test]
fn settings_without_meaning_and_lenses_without_light_are_refused() {
    for settings in [
        ParetoSettings { points: 0, ..ParetoSettings::default() },
        ParetoSettings { steps: 0, ..ParetoSettings::default() },
        ParetoSettings { light: [0.0, 1.0], ..ParetoSettings::default() },
        ParetoSettings { light: [1.0, 0.9], ..ParetoSettings::default() },
        ParetoSettings { light: [1.0, f64::INFINITY], ..ParetoSettings::default() },
        ParetoSettings { blur: [0.0, 1e-3], ..ParetoSettings::default() },
        ParetoSettings { blur: [f64::NAN, 1e-3], ..ParetoSettings::default() },
        ParetoSettings { semi_diameter_factors: [1.1, 1.3], ..ParetoSettings::default() },
        ParetoSettings { tolerance: 0.0, ..ParetoSettings::default() },
    ] {
        let refused = ParetoSweep::new(&lens(), &settings).unwrap_err();
        assert!(matches!(refused, ParetoError::Settings { .. }), "{refused}");
    }
    let mut dark = lens();
    dark.surfaces[0].semi_diameter = Some(0.0);
    assert!(matches!(
        ParetoSweep::new(&dark, &ParetoSettings::default()),
        Err(ParetoError::NoLight(_))
    ));
}

/// Lenses that are compared as built are in the order of what errors of making leave of their sharpness.
#[test]
fn a_front_of_lenses_as_built_compares_them_with_their_errors() {
    let mut lens = bundled("tessar_50_f28");
    lens.variables.clear();
    lens.wavelengths.truncate(2);
    lens.fields.values.truncate(2);
    let grade = Some(ToleranceGrade::Commercial);
    let light = [0.8, 1.2];
    let few = ParetoSettings { points: 2, steps: 4, light, ..ParetoSettings::default() };
    let settings = ParetoSettings { as_built: grade, ..few.clone() };
    let mut sweep = ParetoSweep::new(&lens, &settings).unwrap();
    while !sweep.step().finished {}
    let designs = sweep.front().points();
    assert!(designs.len() > 1);
    for pair in designs.windows(2) {
        assert!(pair[0].light < pair[1].light && pair[0].radius() < pair[1].radius());
    }
    for design in designs {
        let made = design.as_built.unwrap();
        assert!(made.value > design.spot && made.error < 1e-3 * made.value, "{made:?}");
        let goal = Goal::default_for(&design.lens).unwrap().as_built(grade);
        let merit = Merit::new(&design.lens, &goal, 1e-6).unwrap();
        let terms = merit.terms(&merit.values(&design.lens)).unwrap();
        let term = terms.iter().find(|term| term.term == "as_built").unwrap();
        assert!((term.value.sqrt() / made.value - 1.0).abs() < 1e-3, "{} {made:?}", term.value);
    }

    // The merit function of a lens may ask for the same.
    let mut asked = lens.clone();
    asked.merit = Some(Goal::default_for(&asked).unwrap().as_built(grade));
    let own = ParetoSweep::new(&asked, &few).unwrap();
    assert_eq!(own.start.as_built, sweep.start.as_built);
    let sums = ParetoSettings { as_built: grade, ..ParetoSettings::weighted_sum() };
    let refused = ParetoSweep::new(&lens, &sums).unwrap_err();
    assert_eq!(refused, ParetoError::AsBuilt);
}
