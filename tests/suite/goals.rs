//! Default goals of scaled lenses, and merits of glasses whose index varies.

use super::merit::bundled;
use aplanat::lens::{Edit, Lens, Medium, Parameter, Quantity, Variable, Wavelength, apply_edit};
use aplanat::merit::{Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};

/// Two and a half times the lens asks for as much longer thicknesses.
#[test]
fn the_default_goal_of_a_scaled_lens_is_the_scaled_goal() {
    let lengths = |goal: &Goal| -> Vec<f64> {
        let of = |weighted: &WeightedTerm| match weighted.term {
            Term::FocalLength(length)
            | Term::GlassEdge(length)
            | Term::AirEdge(length)
            | Term::TotalTrack(length) => vec![length],
            Term::GlassCenter { min, max } | Term::AirCenter { min, max } => vec![min, max],
            _ => Vec::new(),
        };
        goal.terms.iter().flat_map(of).collect()
    };
    for name in ["double_gauss_rudolph_50", "tessar_50_f28"] {
        let lens = bundled(name);
        let large = apply_edit(&lens, &Edit::Scale(2.5)).unwrap();
        let [small, large] = [&lens, &large].map(|lens| lengths(&Goal::default_for(lens).unwrap()));
        assert!(small.len() == 8 && small.iter().all(|length| *length > 0.0), "{small:?}");
        for (small, large) in small.iter().zip(&large) {
            assert!((large / small - 2.5).abs() < 1e-9, "{name}: {small} {large}");
        }
    }
}

/// Patterns of a lens of twice the size are twice as coarse, and so is the frequency that a goal is
/// about.
#[test]
fn a_goal_of_contrast_keeps_its_cycles_per_lens() {
    let mut lens = bundled("tessar_50_f28");
    let term = Term::GeometricMtf { frequency: 30.0, min: 0.5 };
    lens.merit = Some(Goal {
        terms: vec![WeightedTerm::new(term, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Frozen,
    });
    // A frequency is no minimum, though it is the larger one of the two numbers.
    lens.check().unwrap();
    let large = apply_edit(&lens, &Edit::Scale(2.5)).unwrap();
    let Term::GeometricMtf { frequency, .. } = large.merit.unwrap().terms[0].term else {
        panic!("another term");
    };
    assert!((2.5 * frequency - 30.0).abs() < 1e-12, "{frequency}");
}

/// In the blue the index of a model glass grows by another amount than at the d line.
#[test]
fn a_model_glass_of_another_index_has_the_merit_of_the_lens_with_it() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.surfaces[0].medium = Medium::Model { nd: 1.62, vd: 36.0 };
    let parameter = Parameter::new(0, Quantity::Index);
    lens.variables = vec![Variable { parameter, min: None, max: None }];
    for wave in [0, 2] {
        let mut one = lens.clone();
        one.wavelengths = vec![Wavelength { primary: true, ..lens.wavelengths[wave] }];
        let merit = |lens: &Lens| {
            let goal = Goal {
                terms: vec![WeightedTerm::new(Term::FocalLength(60.0), 1.0)],
                zoom_ratios: Vec::new(),
                limits: LimitTreatment::default(),
                pupil: PupilEdge::Frozen,
            };
            Merit::new(lens, &goal, 1e-4).unwrap()
        };
        let before = merit(&one);
        for index in [1.55, 1.62, 1.7] {
            let mut other = one.clone();
            assert!(other.set(parameter, index));
            let after = merit(&other);
            let exact = after.value(&after.values(&other)).unwrap();
            let found = before.value(&[index]).unwrap();
            assert!((found / exact - 1.0).abs() < 1e-9, "{wave} {index}: {found} {exact}");
        }
    }
}
