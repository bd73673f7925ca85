//! Local optimization of real lenses.

use super::merit::{bundled, vary};
use aplanat::lens::{Aperture, Lens, Parameter, ParameterKind, Pickup, Quantity, add_variables};
use aplanat::merit::{Goal, LimitTreatment, Merit, MeritError, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, start, start_from};

/// Sharpness alone, with pupils that are kept, or all that a designer would ask for, light among it.
fn goals(lens: &Lens) -> [Goal; 2] {
    let all = Goal::default_for(lens).unwrap();
    let mut sharp = Goal { pupil: PupilEdge::Frozen, ..all.clone() };
    sharp.terms.retain(|weighted| !weighted.term.concerns_light());
    [sharp, all]
}

/// The RMS radius of the spots before and after a search, and the share of the light that is left.
fn improve(method: DescentMethod, steps: usize, goal: usize) -> (f64, f64, f64) {
    let lens = bundled("double_gauss_rudolph_50");
    let goal = goals(&lens)[goal].clone();
    let area = |lens: &Lens| {
        let sampled = Merit::new(lens, &goal, 1e-6).unwrap().spot_samplings();
        sampled.iter().map(|s| s.area).sum::<f64>()
    };
    let mut optimizer = start(method, &lens, &goal, 1e-3).unwrap();
    let before = optimizer.terms().unwrap()[0].value.sqrt();
    for _ in 0..steps {
        let progress = optimizer.step();
        assert!(progress.merit.is_finite() && progress.best <= progress.merit * (1.0 + 1e-12));
        optimizer.current().check().unwrap();
        if progress.finished {
            break;
        }
    }
    let best = optimizer.best();
    best.check().unwrap();
    let terms = optimizer.terms().unwrap();
    println!("{method:?}: {terms:?}");
    let (after, light) = (terms[0].value.sqrt(), area(best) / area(&lens));
    println!("RMS radius {before:.5} mm to {after:.5} mm, light to {light:.4}");
    (before, after, light)
}

#[test]
fn least_squares_sharpens_the_double_gauss() {
    let (before, after, _) = improve(DescentMethod::DampedLeastSquares, 60, 0);
    assert!(after < 0.4 * before);
}

#[test]
fn the_trust_region_method_sharpens_the_double_gauss() {
    let (before, after, _) = improve(DescentMethod::TrustRegion, 60, 0);
    assert!(after < 0.4 * before);
}

/// The minima that three independent methods have found (two of Gauss and Newton, one of quasi-Newton
/// type); damped least squares stops at up to 1.2 times as much.
#[test]
fn the_trust_region_method_arrives_at_the_minimum() {
    let minima = [
        ("tessar_50_f28", 2.4887e-4),
        ("telephoto_nikkor_135_f28", 4.862e-5),
        ("achromat_ac254_100", 5.3026e-6),
        ("double_gauss_nikkor_s_50", 2.2525e-4),
    ];
    for (name, minimum) in minima {
        let mut lens = bundled(name);
        if lens.variables.is_empty() {
            add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
        }
        let goal = Goal { limits: LimitTreatment::Penalties, ..Goal::default_for(&lens).unwrap() };
        let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, 1e-4).unwrap();
        let steps = (0..1000).take_while(|_| !optimizer.step().finished).count();
        let found: f64 = optimizer.terms().unwrap().iter().map(|t| t.weight * t.value).sum();
        println!("{name}: {found:.4e} after {steps} steps");
        assert!(found < 1.01 * minimum, "{name}: {found:e} after {steps} steps");
    }
}

/// Several limits hold a lens whose focal length is stiff: penalties lead to where constraints do, and not
/// by many short steps along the edges of limits.
#[test]
fn penalties_arrive_where_constraints_do() {
    let mut lens = bundled("tessar_50_f28");
    lens.aperture = Aperture::EntrancePupilDiameter(50.0 / 5.6);
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens.fields.values.iter_mut().zip([0.0, 10.0, 15.0]).for_each(|(point, y)| point.y = y);
    lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let terms = [
        Term::Spot,
        Term::FocalLength(50.0),
        Term::GlassCenter { min: 1.0, max: 20.0 },
        Term::AirCenter { min: 0.1, max: 60.0 },
    ];
    let [penalties, constraints] =
        [LimitTreatment::Penalties, LimitTreatment::Constraints].map(|limits| {
            let terms = terms.map(|term| WeightedTerm::new(term, 1.0)).to_vec();
            let pupil = PupilEdge::Moving;
            let goal = Goal { terms, pupil, zoom_ratios: Vec::new(), limits };
            let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, 1e-6).unwrap();
            let steps = (0..1000).take_while(|_| !optimizer.step().finished).count();
            let found: f64 = optimizer.terms().unwrap().iter().map(|t| t.weight * t.value).sum();
            println!("{limits:?}: {found:.5e} after {steps} steps");
            (found, steps)
        });
    assert!((penalties.0 / constraints.0 - 1.0).abs() < 2e-3, "{penalties:?} {constraints:?}");
    assert!(penalties.1 < 300, "{penalties:?}");
}

/// The merit that the optimizer reports is that of the lens in its file, whose aperture is an
/// f-number: the stop has changed with the lens.
#[test]
fn the_merit_is_that_of_the_lens_read_again() {
    let mut lens = bundled("cooke_triplet_100_f27");
    assert!(matches!(lens.aperture, Aperture::FNumber(_)));
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let goal = Goal::default_for(&lens).unwrap();
    let light = Merit::new(&lens, &goal, 1e-6).unwrap().initial_light().to_vec();
    for method in DescentMethod::ALL {
        let mut optimizer = start(method, &lens, &goal, 1e-5).unwrap();
        for _ in 0..40 {
            optimizer.step();
        }
        optimizer.verify_best();
        let reported: f64 = optimizer.terms().unwrap().iter().map(|t| t.weight * t.value).sum();
        let best = optimizer.best().clone();
        let own = Merit::new(&best, &goal, 1e-6).unwrap().with_initial_light(&light);
        let value = own.value(&own.values(&best)).unwrap();
        assert!((value / reported - 1.0).abs() < 1e-3, "{method:?}: {value:e} {reported:e}");
    }
}

#[test]
fn adam_sharpens_the_double_gauss() {
    let (before, after, _) = improve(DescentMethod::Adam, 200, 0);
    assert!(after < 0.6 * before);
}

/// A goal that asks for light gets sharpness without paying with it; one that does not, clips.
#[test]
fn sharpness_is_not_gained_by_vignetting() {
    for method in DescentMethod::ALL {
        let (before, after, light) = improve(method, 120, 1);
        assert!(after < 0.75 * before && light > 0.97, "{method:?}");
    }
    let (_, _, light) = improve(DescentMethod::DampedLeastSquares, 120, 0);
    assert!(light < 0.8, "with pupils that are kept");
}

#[test]
fn bounds_hold_and_lenses_without_variables_are_refused() {
    let mut lens = bundled("achromat_ac254_100");
    lens.variables.clear();
    let goal = Goal::default_for(&lens).unwrap();
    assert_eq!(
        start(DescentMethod::Adam, &lens, &goal, 1e-3).unwrap_err(),
        MeritError::NoVariables
    );
    vary(&mut lens, 2, Quantity::Thickness);
    vary(&mut lens, 0, Quantity::Curvature);
    let thickness = lens.surfaces[2].thickness;
    lens.variables[0].min = Some(thickness + 0.0);
    lens.variables[0].max = Some(thickness + 0.001);
    for method in DescentMethod::ALL {
        let mut optimizer = start(method, &lens, &goal, 1e-3).unwrap();
        for _ in 0..30 {
            optimizer.step();
            let t = optimizer.current().surfaces[2].thickness;
            assert!((thickness..=thickness + 0.001).contains(&t), "{method:?}: {t}");
        }
    }
}

/// Somewhere on its way this search proposes a lens in which a ray dies: the step is shortened, the
/// ray and the number are named, and no lens on the way is ever invalid.
#[test]
fn a_step_that_loses_a_ray_is_shortened_and_reported() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::BackFocus(400.0), 1.0), spot()],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Frozen,
    };
    lens.variables.retain(|v| v.parameter.quantity == Quantity::Curvature);
    let mut optimizer = start(DescentMethod::DampedLeastSquares, &lens, &goal, 1e-3).unwrap();
    let mut reasons = Vec::new();
    for _ in 0..60 {
        let progress = optimizer.step();
        assert!(progress.merit.is_finite());
        optimizer.current().check().unwrap();
        reasons.extend(progress.refused);
    }
    assert!(reasons.iter().any(|r| r.contains("ray ") && r.contains("moved the")), "{reasons:?}");
}

fn spot() -> WeightedTerm {
    WeightedTerm::new(Term::Spot, 1.0)
}

#[test]
fn a_goal_that_is_not_finite_or_does_not_apply_is_refused() {
    let lens = bundled("double_gauss_rudolph_50");
    for term in [Term::FocalLength(f64::NAN), Term::TotalTrack(f64::INFINITY)] {
        let goal = Goal {
            terms: vec![WeightedTerm::new(term, 1.0)],
            zoom_ratios: Vec::new(),
            limits: LimitTreatment::default(),
            pupil: PupilEdge::default(),
        };
        let refused = start(DescentMethod::Adam, &lens, &goal, 1e-3).unwrap_err();
        assert!(matches!(refused, MeritError::DoesNotApply { .. }), "{refused}");
    }
    let mut afocal = lens.clone();
    afocal.surfaces.iter_mut().for_each(|row| row.curvature = 0.0);
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::FocalLength(50.0), 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    };
    assert!(start(DescentMethod::Adam, &afocal, &goal, 1e-3).is_err());
}

/// Dark fields leave their share to the others; a lens with none but dark ones is refused.
#[test]
fn a_lens_without_light_has_no_merit() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.surfaces[0].semi_diameter = Some(0.0);
    let goal = Goal {
        terms: vec![spot()],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    };
    let refused = start(DescentMethod::DampedLeastSquares, &lens, &goal, 1e-3).unwrap_err();
    assert!(matches!(refused, MeritError::NoLight { .. }), "{refused}");
}

/// The light of the sound lens is found again from darkness, of all fields and of some.
#[test]
fn a_lens_without_light_recovers_under_a_light_term() {
    let mut sound = bundled("double_gauss_rudolph_50");
    // One colour: light is lost and found alike in all of them.
    sound.wavelengths = vec![sound.wavelengths[sound.primary()]];
    let goal = Goal::default_for(&sound).unwrap();
    let asked = Merit::new(&sound, &goal, 1e-3).unwrap();
    let full = asked.light();
    for (surface, rim) in [(0, 0.0), (10, 0.5)] {
        let mut lens = sound.clone();
        lens.surfaces[surface].semi_diameter = Some(rim);
        add_variables(&mut lens, &[ParameterKind::SemiDiameters]);
        let merit = Merit::new(&lens, &goal, 1e-3).unwrap();
        let merit = merit.with_initial_light(asked.initial_light());
        for method in DescentMethod::ALL {
            let mut optimizer = start_from(method, merit.clone(), &lens, 1e-3).unwrap();
            let ended = (0..600).find(|_| optimizer.step().finished);
            optimizer.verify_best();
            let found = Merit::new(optimizer.best(), &goal, 1e-3).unwrap();
            let share = found.light() / full;
            println!("{method:?}, surface {surface}, ended {ended:?}: {share:.3} of the light");
            assert!(found.has_light() && share > 0.8, "{method:?}, surface {surface}: {share}");
        }
    }
}

/// Pickups are applied to every intermediate lens, so that a table shows them.
#[test]
fn pickups_follow_the_optimization() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let (front, back) = (Quantity::Curvature, Parameter::new(10, Quantity::Curvature));
    lens.variables.retain(|v| v.parameter != back);
    let source = Parameter::new(0, front);
    lens.pickups.push(Pickup { parameter: back, source, scale: -1.0, offset: 0.0 });
    let goal = Goal {
        terms: vec![spot()],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    };
    let mut optimizer = start(DescentMethod::DampedLeastSquares, &lens, &goal, 1e-3).unwrap();
    for _ in 0..5 {
        optimizer.step();
    }
    optimizer.verify_best();
    let best = optimizer.best();
    assert_ne!(best.surfaces[0].curvature, lens.surfaces[0].curvature);
    assert_eq!(best.surfaces[10].curvature, -best.surfaces[0].curvature);
}
