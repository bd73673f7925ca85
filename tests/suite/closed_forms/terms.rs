//! The values of merit terms. Their derivatives are compared with differences elsewhere.

use super::{FOCAL, assert_near, field, lens, row, thin_rows};
use aplanat::lens::{Aperture, FieldPoint, Lens, Medium, Parameter, Quantity, Row, Variable};
use aplanat::lens::{Wavelength, glass};
use aplanat::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};

fn value(lens: &Lens, term: Term) -> f64 {
    let terms = vec![WeightedTerm::new(term, 1.0)];
    let goal = Goal {
        terms,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Moving,
    };
    let mut lens = lens.clone();
    let parameter = Parameter::new(lens.surfaces.len() - 1, Quantity::Thickness);
    lens.variables = vec![Variable { parameter, min: None, max: None }];
    let merit = Merit::new(&lens, &goal, 1e-6).unwrap();
    merit.value(&merit.values(&lens)).unwrap()
}

/// A thin lens 10 mm behind a stop of radius 5 mm.
fn behind_a_stop(fields: &[f64]) -> Lens {
    let stop = Row { stop: true, semi_diameter: Some(5.0), ..row(0.0, 10.0, 1.0) };
    let rows = [stop].into_iter().chain(thin_rows(FOCAL)).collect();
    lens(rows, Aperture::StopSemiDiameter(5.0), fields)
}

#[test]
fn illumination_falls_with_the_fourth_power_of_the_cosine() {
    // A stop in front of everything is as large for every field.
    let lens = behind_a_stop(&[0.0, 20.0, 30.0]);
    for (number, angle) in [(1, 20f64), (2, 30.0)] {
        let got = value(&lens, Term::RelativeIllumination { field: number, min: 1.5 });
        assert_near(got, (1.5 - angle.to_radians().cos().powi(4)).powi(2), 1e-9);
    }
    assert_eq!(value(&lens, Term::RelativeIllumination { field: 2, min: 0.56 }), 0.0);
}

#[test]
fn the_f_number_term_is_focal_length_over_diameter() {
    let lens = behind_a_stop(&[0.0]);
    assert_near(value(&lens, Term::FNumber(7.0)), 9.0, 1e-9);
    assert_near(value(&lens, Term::FNumber(14.0)), 16.0, 1e-9);
}

#[test]
fn distortion_weighs_its_fields() {
    // Through the middle of a thin lens no ray is bent: a chief ray lands at d tan θ.
    let distance = FOCAL + 4.0;
    let [front, rear] = thin_rows(distance);
    let front = Row { stop: true, ..front };
    let mut lens =
        lens(vec![front, rear], Aperture::EntrancePupilDiameter(2.0), &[0.0, 10.0, 20.0]);
    for (one, other) in [(1.0, 1.0), (1.0, 5.0), (5.0, 1.0)] {
        let fields = &mut lens.fields.values;
        fields[1] = FieldPoint { weight: one, ..fields[1] };
        fields[2] = FieldPoint { weight: other, ..fields[2] };
        let square = |degrees: f64| (4.0 * degrees.to_radians().tan()).powi(2);
        let exact = (one * square(10.0) + other * square(20.0)) / (1.0 + one + other);
        assert_near(value(&lens, Term::Distortion), exact, 1e-9);
    }
}

#[test]
fn a_lens_without_distortion_has_none_in_any_direction() {
    let [front, rear] = thin_rows(FOCAL);
    let front = Row { stop: true, ..front };
    let mut lens = lens(vec![front, rear], Aperture::EntrancePupilDiameter(2.0), &[0.0]);
    lens.fields.values = vec![field(0.0, 0.0), field(12.0, -16.0), field(20.0, 0.0)];
    assert!(value(&lens, Term::Distortion) < 1e-24);
}

#[test]
fn a_spot_term_weighs_its_wavelengths() {
    // A narrow beam of radius R out of focus by d − f has the mean square radius (R (1 − d/f))²/2.
    let bk7 = Medium::Glass("SCHOTT N-BK7".to_owned());
    let front = Row { stop: true, medium: bk7, ..row(0.01, 0.0, 1.5) };
    let (radius, distance) = (0.05, 96.0);
    let rows = vec![front, row(-0.01, distance, 1.0)];
    let mut lens = lens(rows, Aperture::EntrancePupilDiameter(2.0 * radius), &[0.0]);
    let blur = |um: f64| {
        let index = glass::find("SCHOTT N-BK7").unwrap().index(um).unwrap();
        let focal = 1.0 / ((index - 1.0) * 0.02);
        (radius * (1.0 - distance / focal)).powi(2) / 2.0
    };
    let (blue, red) = (0.4, 0.7);
    for (first, second) in [(1.0, 0.0), (3.0, 1.0), (1.0, 3.0)] {
        let wave = |um, weight, primary| Wavelength { um, weight, primary };
        lens.wavelengths = vec![wave(blue, first, true), wave(red, second, false)];
        let exact = (first * blur(blue) + second * blur(red)) / (first + second);
        assert_near(value(&lens, Term::Spot), exact, 1e-4);
    }
    assert!(blur(blue) / blur(red) < 0.9 || blur(red) / blur(blue) < 0.9);
}

/// A stop in front of everything gives all fields their light: what is relative does not change with
/// its size.
#[test]
fn the_size_of_the_stop_does_not_change_what_fields_have_relative_to_the_axis() {
    let mut lens = behind_a_stop(&[0.0, 20.0]);
    let parameter = Parameter::new(0, Quantity::SemiDiameter);
    lens.variables = vec![Variable { parameter, min: None, max: None }];
    let slope = |term: Term| {
        let goal = Goal {
            terms: vec![WeightedTerm::new(term, 1.0)],
            zoom_ratios: Vec::new(),
            limits: LimitTreatment::default(),
            pupil: PupilEdge::Moving,
        };
        let merit = Merit::new(&lens, &goal, 1e-6).unwrap();
        merit.evaluate(&merit.values(&lens), DerivativeLevel::Gradient).unwrap().gradient[0]
    };
    let relative = slope(Term::RelativeIllumination { field: 1, min: 1.5 });
    assert!(relative.abs() < 1e-6, "{relative}");
    // The f-number does: by -N/r.
    let number = FOCAL / 10.0;
    assert_near(slope(Term::FNumber(7.0)), 2.0 * (number - 7.0) * -number / 5.0, 1e-6);
}
