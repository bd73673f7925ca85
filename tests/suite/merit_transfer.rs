//! Contrast by diffraction and ghosts as terms of a merit function: their values against those of the analyses,
//! their derivatives against central differences.

use super::merit::{bundled, step, vary};
use aplanat::analysis::{Coating, polychromatic_diffraction_mtf, rank_ghosts};
use aplanat::lens::{Lens, Parameter, Quantity};
use aplanat::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
use aplanat::pupil::{Accuracy, RayModel};

fn goal_of(term: Term) -> Goal {
    Goal {
        terms: vec![WeightedTerm::new(term, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Moving,
    }
}

/// The largest difference between the derivatives of a term and central differences of the fourth order, over the
/// largest change of the term by any step.
fn gradient_error(lens: &Lens, term: Term, tolerance: f64, scale: f64) -> f64 {
    let merit = Merit::new(lens, &goal_of(term), tolerance).unwrap();
    let values = merit.values(lens);
    let sum = merit.evaluate(&values, DerivativeLevel::Normal).unwrap();
    assert!(sum.value > 0.0, "{term:?} asks for nothing");
    // Without the matrix, both directions go back through the lens together.
    let alone = merit.evaluate(&values, DerivativeLevel::Gradient).unwrap();
    let apart = (&alone.gradient - &sum.gradient).amax();
    assert!((alone.value / sum.value - 1.0).abs() < 1e-12, "{} {}", alone.value, sum.value);
    assert!(apart < 1e-9 * sum.gradient.amax(), "{apart:e}");
    let mut pairs = Vec::new();
    for (i, variable) in merit.variables().iter().enumerate() {
        let step = scale * step(variable.parameter.quantity);
        let at = |offset: f64| {
            let mut moved = values.clone();
            moved[i] += offset * step;
            merit.value(&moved).unwrap()
        };
        let change = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / 12.0;
        println!("{}: {:e} and {change:e}", variable.parameter, step * sum.gradient[i]);
        pairs.push((step * sum.gradient[i], change));
    }
    let largest = pairs.iter().map(|(_, change)| change.abs()).fold(0.0, f64::max);
    let error = pairs.iter().map(|(found, change)| (found - change).abs()).fold(0.0, f64::max);
    println!("{}: {:.1e}", term.name(), error / largest);
    error / largest
}

/// A lens with rims that clip its field, each a variable, and shapes, gaps and an index.
fn clipped(name: &str, colors: usize) -> Lens {
    let mut lens = bundled(name);
    lens.wavelengths.truncate(colors);
    for (i, wavelength) in lens.wavelengths.iter_mut().enumerate() {
        wavelength.primary = i == 0;
    }
    lens.variables.clear();
    for surface in 0..lens.surfaces.len() {
        let rim = Parameter::new(surface, Quantity::SemiDiameter);
        lens.set(rim, lens.get(rim).unwrap() * (1.0 + 1e-3 * surface as f64));
        if surface % 3 == 0 {
            vary(&mut lens, surface, Quantity::SemiDiameter);
            vary(&mut lens, surface, Quantity::Curvature);
        }
        if surface % 4 == 1 {
            vary(&mut lens, surface, Quantity::Thickness);
        }
    }
    lens
}

#[test]
fn contrast_by_diffraction_is_that_of_the_analysis() {
    for (name, frequency) in [("achromat_ac254_100", 60.0), ("heliar_100_f45", 25.0)] {
        let lens = bundled(name);
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let accuracy = Accuracy { tolerance: 1e-6, ..Accuracy::default() };
        for field in model.fields.clone() {
            let exact =
                polychromatic_diffraction_mtf(&model, field, &[frequency], accuracy).unwrap();
            let [t, s] = [exact.points[0].tangential, exact.points[0].sagittal];
            let square = |modulus: f64| 0.5 * (1.0 - modulus).powi(2);
            let expected = square(t.modulus.value) + square(s.modulus.value);
            let mut one = lens.clone();
            one.fields.values = vec![field];
            vary(&mut one, 0, Quantity::Curvature);
            let merit =
                Merit::new(&one, &goal_of(Term::Mtf { frequency, min: 1.0 }), 1e-6).unwrap();
            let found = merit.terms(&merit.values(&one)).unwrap();
            let (value, error) = (found[0].value, found[0].error);
            println!("{name} {}: {value} and {expected}, error {error:.1e}", field.y);
            // Another radius of the sphere for aberrations of some waves.
            let spheres = t.modulus.error + s.modulus.error;
            assert!((value - expected).abs() < 1e-5 + 2.0 * spheres, "{name}: {value} {expected}");
            assert!(found[0].reached, "{name}");
        }
    }
}

#[test]
fn contrast_by_diffraction_has_the_derivative_of_its_value() {
    let mut lens = clipped("achromat_ac254_100", 2);
    vary(&mut lens, 2, Quantity::Curvature);
    let term = Term::Mtf { frequency: 40.0, min: 1.0 };
    let error = gradient_error(&lens, term, 1e-9, 0.02);
    assert!(error < 1e-5, "{error}");
}

/// Rims that clip the field move the edge of its pupil.
#[test]
fn contrast_by_diffraction_includes_the_motion_of_the_pupil() {
    let mut lens = clipped("heliar_100_f45", 1);
    lens.fields.values.drain(..lens.fields.values.len() - 1);
    let term = Term::Mtf { frequency: 15.0, min: 1.0 };
    let error = gradient_error(&lens, term, 1e-8, 0.01);
    assert!(error < 1e-4, "{error}");
}

/// A shadow in the middle of the pupil.
#[test]
fn contrast_of_a_ring_has_the_derivative_of_its_value() {
    let mut lens = clipped("achromat_ac254_100", 1);
    lens.fields.values.truncate(1);
    lens.surfaces[0].obstruction = Some(4.0);
    let term = Term::Mtf { frequency: 60.0, min: 1.0 };
    let error = gradient_error(&lens, term, 1e-9, 0.02);
    assert!(error < 1e-5, "{error}");
}

#[test]
fn ghosts_are_those_of_the_ranking_and_have_derivatives() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    for surface in 0..lens.surfaces.len() {
        vary(&mut lens, surface, Quantity::Curvature);
        vary(&mut lens, surface, Quantity::Thickness);
    }
    let model = RayModel::from_lens(&lens, 0).unwrap();
    for (reflectance, coating) in [(None, Coating::Bare), (Some(0.003), Coating::Flat(0.003))] {
        let ranking = rank_ghosts(&model, model.primary, coating).unwrap();
        let limit = 0.3 * ranking.ghosts[5].irradiance;
        let shortfall = |irradiance: f64| (1.0 - (limit / irradiance).sqrt()).max(0.0).powi(2);
        let sum: f64 = ranking.ghosts.iter().map(|ghost| shortfall(ghost.irradiance)).sum();
        let expected = sum / ranking.ghosts.len() as f64;
        let term = Term::Ghosts { irradiance: limit, reflectance };
        let merit = Merit::new(&lens, &goal_of(term), 1e-3).unwrap();
        let value = merit.value(&merit.values(&lens)).unwrap();
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
        let error = gradient_error(&lens, term, 1e-3, 0.1);
        assert!(error < 1e-6, "{error}");
    }
    let wide = Term::Ghosts { irradiance: 1e6, reflectance: None };
    let merit = Merit::new(&lens, &goal_of(wide), 1e-3).unwrap();
    let sum = merit.evaluate(&merit.values(&lens), DerivativeLevel::Normal).unwrap();
    assert!(sum.gradient.amax() < 1e-3, "ghosts that are wide enough ask for something");
}

#[test]
fn terms_that_do_not_apply_are_refused_by_name() {
    let mut lens = bundled("heliar_100_f45");
    vary(&mut lens, 0, Quantity::Curvature);
    for (frequency, min) in [(0.0, 0.5), (-3.0, 0.5), (10.0, 1.5), (f64::NAN, 0.5)] {
        let error = Merit::new(&lens, &goal_of(Term::Mtf { frequency, min }), 1e-3).unwrap_err();
        assert!(error.to_string().contains("mtf"), "{error}");
    }
    let frozen =
        Goal { pupil: PupilEdge::Frozen, ..goal_of(Term::Mtf { frequency: 9.0, min: 0.5 }) };
    let error = Merit::new(&lens, &frozen, 1e-3).unwrap_err().to_string();
    assert!(error.contains("mtf") && error.contains("moving"), "{error}");
    for (irradiance, reflectance) in [(0.0, None), (1e-3, Some(1.5)), (f64::NAN, None)] {
        let term = Term::Ghosts { irradiance, reflectance };
        let error = Merit::new(&lens, &goal_of(term), 1e-3).unwrap_err().to_string();
        assert!(error.contains("ghosts"), "{error}");
    }
}
