//! Errors of making that are not independent: elements of one barrel.

use super::hard_cases::scene;
use super::reference::assert_close;
use crate::cli::{Scratch, done, refused};
use aplanat::lens::{
    ErrorCorrelation, ErrorDistribution, Perturbation, PerturbationKind, Tolerance, ToleranceSheet,
};
use aplanat::tolerance::{
    ToleranceAnalysis, ToleranceRequest, ToleranceScene, analyze, real_lenses,
};
use std::sync::atomic::AtomicBool;

const WIDTH: f64 = 0.05;

fn tolerance(kind: PerturbationKind, first: usize, last: usize) -> Tolerance {
    let error = Perturbation { kind, first, last };
    Tolerance { error, half_range: WIDTH, distribution: ErrorDistribution::Normal }
}

/// The decentres of the front two elements of the triplet, with this correlation.
fn barrel(coefficient: f64) -> ToleranceSheet {
    let kind = PerturbationKind::ElementDecenterY;
    let errors = vec![tolerance(kind, 0, 1), tolerance(kind, 2, 3)];
    let correlations = vec![ErrorCorrelation { errors: vec![0, 1], coefficient }];
    ToleranceSheet { correlations, ..ToleranceSheet::of_errors(errors) }
}

/// Both as one group.
fn group() -> ToleranceSheet {
    ToleranceSheet::of_errors(vec![tolerance(PerturbationKind::ElementDecenterY, 0, 3)])
}

fn analysis(scene: &ToleranceScene, sheet: &ToleranceSheet) -> ToleranceAnalysis {
    analyze(scene, sheet, ToleranceRequest { seed: 2, samples: 40, limit: None }).unwrap()
}

/// A singular matrix: elements that share all of their decentre are one group.
#[test]
fn elements_that_share_all_of_their_decentre_are_a_group() {
    let scene = scene(0, (3, 6));
    let real = |sheet: &ToleranceSheet| {
        let lenses = real_lenses(&scene, sheet, 7, 6, 0, &AtomicBool::new(false)).unwrap();
        lenses.iter().map(|lens| lens.mean_square.unwrap()).collect::<Vec<_>>()
    };
    for (a, b) in real(&barrel(1.0)).iter().zip(real(&group())) {
        assert_close(a[0], b[0], 1e-10 * b[0], "fixed");
        assert_close(a[1], b[1], 1e-10 * b[1], "refocused");
    }
    let (shared, one) = (analysis(&scene, &barrel(1.0)), analysis(&scene, &group()));
    for focus in 0..2 {
        let growth = |found: &ToleranceAnalysis, sheet: &ToleranceSheet| {
            found.forms[focus].growth(sheet).unwrap().iter().sum::<f64>()
        };
        let (a, b) = (growth(&shared, &barrel(1.0)), growth(&one, &group()));
        // The derivative of rays by both decentres, which is left out of the form.
        assert_close(a, b, 2e-2 * b, "growth");
        let (a, b) = (&shared.spots[focus], &one.spots[focus]);
        assert_close(a.form_mean_rms, b.form_mean_rms, 5e-3 * b.form_mean_rms, "form");
        assert!(a.form_agrees, "{:?}", a.difference);
    }
}

/// Between opposite and equal decentres the expectation is linear in the coefficient, by form and rays.
#[test]
fn the_expected_spot_is_linear_in_the_correlation() {
    let scene = scene(0, (2, 6));
    let at = |coefficient: f64| {
        let found = analysis(&scene, &barrel(coefficient));
        assert!(found.spots[1].form_agrees, "{coefficient}: {:?}", found.spots[1].difference);
        let shares = found.growth_shares(&barrel(coefficient)).unwrap();
        let sum: f64 = shares.iter().map(|share| share[1]).sum();
        assert_close(sum.abs(), 1.0, 1e-9, "shares");
        found.forms[1].expectation(&barrel(coefficient)).unwrap()
    };
    let [opposite, none, half, equal] = [-1.0, 0.0, 0.5, 1.0].map(at);
    assert_close(opposite + equal, 2.0 * none, 1e-12 * none, "middle");
    assert_close(2.0 * half, none + equal, 1e-12 * none, "half");
    assert!((equal - opposite).abs() > 0.005 * none, "{opposite} {equal}");
}

/// Three errors of which one is given by the other two leave a singular matrix of rank two.
#[test]
fn a_singular_matrix_of_three_errors_is_no_obstacle() {
    let scene = scene(0, (2, 4));
    let kind = PerturbationKind::ElementDecenterX;
    let errors = vec![tolerance(kind, 0, 1), tolerance(kind, 2, 3), tolerance(kind, 5, 6)];
    let pair =
        |a: usize, b: usize, coefficient: f64| ErrorCorrelation { errors: vec![a, b], coefficient };
    let mut sheet = ToleranceSheet::of_errors(errors);
    sheet.correlations = vec![pair(0, 1, 0.6), pair(0, 2, 0.6), pair(1, 2, -0.28)];
    let lenses = real_lenses(&scene, &sheet, 3, 20, 0, &AtomicBool::new(false)).unwrap();
    // 0.6 L₁ + c L₂ with c = (−0.28 − 0.36)/0.8 = −0.8: the third is 1.2 p₀ − p₁.
    for lens in lenses {
        let [a, b, c] = [0, 1, 2].map(|i| lens.errors[i]);
        assert_close(c, 1.2 * a - b, 1e-7 * WIDTH, "third");
    }
    assert!(analysis(&scene, &sheet).spots[1].mean_rms[0].is_finite());
}

const PAIR: &str = r#"{ "aplanat": 1, "name": "Pair", "object": "infinity",
  "aperture": {"entrance_pupil_diameter": 10.0},
  "fields": {"kind": "angle", "values": [{"y": 0.0}, {"y": 2.0}]},
  "wavelengths": [{"um": 0.5875618}],
  "surfaces": [
    {"radius": 100, "thickness": 5.0, "glass": {"index": 1.5}, "semi_diameter": 6.0, "stop": true},
    {"radius": -100, "thickness": 98.0, "semi_diameter": 6.0}],
  "tolerances": {"errors": [
    {"kind": "surface_decenter_y", "first": 0, "half_range": 0.1},
    {"kind": "surface_decenter_y", "first": 1, "half_range": 0.1},
    {"kind": "surface_decenter_x", "first": 1, "half_range": 0.1}],
    "correlations": [{"errors": [0, 1], "coefficient": 0.7},
                     {"errors": [1, 2], "coefficient": 0.7}]} }"#;

/// In the file: a matrix that no errors can have is refused by its name.
#[test]
fn correlations_are_read_from_the_file_and_checked() {
    let file = Scratch::with("pair.json", PAIR);
    let run = |path: &str| done(&["tolerance", path, "--samples", "4", "--error", "10%"], "");
    assert!(run(file.path()).contains("3 manufacturing errors, 2 correlations"));
    for (from, to, words) in [
        ("[0, 1], \"coefficient\": 0.7", "[0, 1], \"coefficient\": 0.8", "positive semidefinite"),
        ("[1, 2]", "[1, 3]", "error 3, counted from 0; expected less than 3"),
        ("[1, 2]", "[0, 1]", "two coefficients"),
        ("[1, 2], \"coefficient\": 0.7", "[1, 2], \"coefficient\": 1.7", "expected -1 to 1"),
        ("\"coefficient\": 0.7}]", "\"share\": 0.7}]", "share"),
    ] {
        let wrong = Scratch::with("wrong_pair.json", &PAIR.replace(from, to));
        refused(2, &["tolerance", wrong.path(), "--samples", "2"], "", &[words]);
    }
    // Removing a surface removes its errors, and what they were correlated with stays.
    let mut lens = aplanat::files::open(file.path()).unwrap().lens;
    lens.renumber_rows(|surface| (surface != 0).then(|| surface - 1));
    let sheet = lens.tolerances.unwrap();
    assert_eq!(sheet.errors.len(), 2);
    assert_eq!(sheet.correlations.len(), 1);
    assert_eq!(sheet.correlations[0].errors, [0, 1]);
}
