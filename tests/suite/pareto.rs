//! The front of sharpness against light.

use super::merit::bundled;
use aplanat::lens::{FieldPoint, Lens, Wavelength};
use aplanat::merit::{Goal, PupilEdge};
use aplanat::optimize::pareto::{Front, ParetoError, ParetoPoint, ParetoSettings, ParetoSweep};
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
    let settings = ParetoSettings { points: 4, steps: 100, pupil, ..ParetoSettings::default() };
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
        ParetoSettings { blur: [0.0, 1e-3], ..ParetoSettings::default() },
        ParetoSettings { blur: [f64::NAN, 1e-3], ..ParetoSettings::default() },
        ParetoSettings { semi_diameter_factors: [1.1, 1.3], ..ParetoSettings::default() },
        ParetoSettings { tolerance: 0.0, ..ParetoSettings::default() },
    ] {
        let refused = ParetoSweep::new(&lens(), &settings).unwrap_err();
        assert!(matches!(refused, ParetoError::Settings { .. }), "{refused}");
    }
    let mut made = lens();
    let grade = Some(ToleranceGrade::Precision);
    made.merit = Some(Goal::default_for(&made).unwrap().as_built(grade));
    let refused = ParetoSweep::new(&made, &ParetoSettings::default()).unwrap_err();
    assert!(refused.to_string().contains("the term `as_built`"), "{refused}");
    let mut dark = lens();
    dark.surfaces[0].semi_diameter = Some(0.0);
    assert!(matches!(
        ParetoSweep::new(&dark, &ParetoSettings::default()),
        Err(ParetoError::NoLight(_))
    ));
}
