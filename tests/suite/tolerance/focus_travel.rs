//! A focus whose travel is short or none: shares, loosest tolerances and the wavefront of lenses at their stops.

use super::reference::assert_close;
use crate::cli::{Scratch, done, done_json, refused};
use crate::drag::bundled;
use aplanat::lens::{
    AdjustedPart, Compensator, ErrorDistribution, Lens, Perturbation, PerturbationKind, Tolerance,
    ToleranceSheet,
};
use aplanat::tolerance::{
    ErrorModel, QuadraticForm, SecondDerivatives, ToleranceScene, WavefrontModel,
    loosest_tolerances,
};

/// The last gap of the triplet, which a focus undoes, and a decentre of its middle element, which it does not.
fn errors(distribution: ErrorDistribution) -> Vec<Tolerance> {
    let gap = Perturbation::of_surface(PerturbationKind::Thickness, 6);
    let kind = PerturbationKind::ElementDecenterY;
    let middle = Perturbation { kind, first: 2, last: 3 };
    let of = |(error, half_range)| Tolerance { error, half_range, distribution };
    [(gap, 0.5), (middle, 0.05)].map(of).to_vec()
}

fn sheet(travel: Option<f64>) -> ToleranceSheet {
    sheet_of(ErrorDistribution::Normal, travel)
}

fn sheet_of(distribution: ErrorDistribution, travel: Option<f64>) -> ToleranceSheet {
    let errors = errors(distribution);
    ToleranceSheet { focus_travel: travel, ..ToleranceSheet::of_errors(errors) }
}

fn scene() -> (Lens, ToleranceScene) {
    let lens = bundled("cooke_triplet_100_f27");
    let scene = ToleranceScene::new(&lens, 0, 1e-2).unwrap();
    (lens, scene)
}

fn forms(scene: &ToleranceScene, sheet: &ToleranceSheet) -> [QuadraticForm; 2] {
    forms_with(SecondDerivatives::Neglected, scene, sheet)
}

fn forms_with(
    second: SecondDerivatives,
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
) -> [QuadraticForm; 2] {
    ErrorModel::new(scene, sheet, second, &|| false).unwrap().forms
}

fn shares(form: &QuadraticForm, sheet: &ToleranceSheet) -> Vec<f64> {
    let growth = form.growth(sheet).unwrap();
    let sum: f64 = growth.iter().sum();
    growth.iter().map(|own| own / sum).collect()
}

#[test]
fn a_focus_without_travel_is_the_fixed_image_plane() {
    let ((lens, scene), held) = (scene(), sheet(Some(0.0)));
    let [fixed, refocused] = forms(&scene, &held);
    assert!(!refocused.has_stops());
    let near = |a: f64, b: f64, what: &str| assert_close(a, b, 1e-9 * b.abs(), what);
    near(refocused.as_designed(), fixed.as_designed(), "as designed");
    near(refocused.expectation(&held).unwrap(), fixed.expectation(&held).unwrap(), "expectation");
    for (own, other) in shares(&refocused, &held).iter().zip(shares(&fixed, &held)) {
        near(*own, other, "share");
    }
    for i in 0..2 {
        let [a, b] = [&refocused, &fixed].map(|form| form.derivatives(i));
        assert_close(a.first, b.first, 1e-9 * b.value, "first derivative");
        near(a.second, b.second, "second derivative");
    }
    let target = 1.2 * fixed.as_designed();
    let loosest = [&refocused, &fixed].map(|form| loosest_tolerances(form, &held, target).unwrap());
    for (own, other) in loosest[0].iter().zip(&loosest[1]) {
        near(own.half_range, other.half_range, "loosest");
    }
    let second = SecondDerivatives::Traced;
    let model = WavefrontModel::new((&lens, 0), &scene, (&held, second), &|| false).unwrap();
    let ([fixed, refocused], expected) = (model.nominal(), model.expected_rms(&held).unwrap());
    near(refocused, fixed, "wavefront");
    near(expected[1], expected[0], "expected wavefront");
}

/// The values of an error with a half range of 1, and the share of the lenses that have about that one.
fn values(distribution: ErrorDistribution) -> Vec<[f64; 2]> {
    const STEPS: usize = 160;
    let far = if distribution == ErrorDistribution::Normal { 3.0 } else { 1.0 };
    let density = |x: f64| match distribution {
        ErrorDistribution::Normal | ErrorDistribution::NormalCut => (-2.0 * x * x).exp(),
        ErrorDistribution::Uniform => 1.0,
        ErrorDistribution::Parabolic => x * x,
        ErrorDistribution::Ends => 0.0,
    };
    if distribution == ErrorDistribution::Ends {
        return vec![[-1.0, 0.5], [1.0, 0.5]];
    }
    let middle = |i: usize| far * (2.0 * (i as f64 + 0.5) / STEPS as f64 - 1.0);
    let all: Vec<[f64; 2]> = (0..STEPS).map(|i| [middle(i), density(middle(i))]).collect();
    let sum: f64 = all.iter().map(|own| own[1]).sum();
    all.into_iter().map(|[x, density]| [x, density / sum]).collect()
}

/// The expectation of a form of two independent errors, summed over their values.
fn expected(form: &QuadraticForm, sheet: &ToleranceSheet) -> f64 {
    let [first, second] = [0, 1].map(|i| {
        let Tolerance { half_range, distribution, .. } = sheet.errors[i];
        values(distribution).into_iter().map(move |[x, share]| [half_range * x, share])
    });
    let second: Vec<[f64; 2]> = second.collect();
    first
        .flat_map(|[a, of_a]| second.iter().map(move |[b, of_b]| ([a, *b], of_a * of_b)))
        .map(|(errors, share)| share * form.at(&errors))
        .sum()
}

/// The growth of an error as the integral over the variances of all errors of the derivative of the expectation by
/// the variance of that error.
fn growth_by_variances(form: &QuadraticForm, sheet: &ToleranceSheet, error: usize) -> f64 {
    const STEP: f64 = 0.05;
    let scaled = |variance: f64, own: f64| {
        let mut scaled = sheet.clone();
        for (i, tolerance) in scaled.errors.iter_mut().enumerate() {
            let own = if i == error { own } else { 1.0 };
            tolerance.half_range *= (variance * own).sqrt();
        }
        expected(form, &scaled)
    };
    let nodes = 8;
    let at = |i: usize| (i as f64 + 0.5) / nodes as f64;
    let slope = |v: f64| (scaled(v, 1.0 + STEP) - scaled(v, 1.0 - STEP)) / (2.0 * STEP * v);
    (0..nodes).map(|i| slope(at(i)) / nodes as f64).sum()
}

#[test]
fn shares_of_lenses_at_their_stops_are_derivatives_by_variances() {
    let (_, scene) = scene();
    let mut before = 1.0;
    for travel in [0.0, 0.1, 0.3, 0.6, f64::INFINITY] {
        let sheet = sheet(travel.is_finite().then_some(travel));
        let form = &forms(&scene, &sheet)[1];
        let gap = shares(form, &sheet)[0];
        assert!(gap < before, "{travel}: {gap} {before}");
        before = gap;
        if !form.has_stops() {
            continue;
        }
        let growth = form.growth(&sheet).unwrap();
        let total: f64 = growth.iter().sum();
        for (i, own) in growth.iter().enumerate() {
            let other = growth_by_variances(form, &sheet, i);
            assert_close(*own, other, 0.02 * total, "growth");
        }
        let mean = expected(form, &sheet);
        assert_close(form.as_designed() + total, mean, 0.03 * total, "sum");
        // Each costs about the same: the gap is held tighter than where focus undoes it.
        let target = 1.1 * form.as_designed();
        let ends = [form, &forms(&scene, &self::sheet(None))[1]];
        let gaps = ends.map(|form| loosest_tolerances(form, &sheet, target).unwrap()[0].half_range);
        assert!(gaps[0] < gaps[1], "{travel}: {gaps:?}");
    }
}

/// Errors that are not normal are at the stops more often or less: the growths of all are that of the expectation.
#[test]
fn the_growths_of_other_errors_at_stops_are_that_of_the_expectation() {
    let (_, scene) = scene();
    for distribution in [
        ErrorDistribution::NormalCut,
        ErrorDistribution::Uniform,
        ErrorDistribution::Parabolic,
        ErrorDistribution::Ends,
    ] {
        let sheet = sheet_of(distribution, Some(0.4));
        let form = &forms(&scene, &sheet)[1];
        let total: f64 = form.growth(&sheet).unwrap().iter().sum();
        let exact = expected(form, &sheet) - form.as_designed();
        assert_close(total, exact, 0.02 * exact, &format!("{distribution:?}"));
    }
}

/// Second derivatives of rays are those in the plane that the focus reaches.
#[test]
fn a_little_travel_changes_a_little() {
    let (_, scene) = scene();
    let of = |travel: f64| {
        let form = &forms_with(SecondDerivatives::Traced, &scene, &sheet(Some(travel)))[1];
        [0, 1].map(|i| form.derivatives(i))
    };
    for (held, short) in of(0.0).iter().zip(of(1e-5)) {
        assert_close(short.value, held.value, 1e-4 * held.value, "value");
        assert_close(short.first, held.first, 1e-3 * held.first.abs() + 1e-9, "first");
        assert_close(short.second, held.second, 1e-3 * held.second, "second");
    }
}

/// A focus without travel is held beside another compensator that has some.
#[test]
fn a_focus_without_travel_is_held_beside_other_compensators() {
    let (_, scene) = scene();
    let part = Perturbation::of_surface(PerturbationKind::Thickness, 1);
    let gap = Compensator { part: AdjustedPart::Lens(part), travel: 1e3 };
    let held = ToleranceSheet { compensators: vec![gap], ..sheet(Some(0.0)) };
    let form = &forms(&scene, &held)[1];
    assert!(form.has_stops());
    let [found, mean] = [form.expectation(&held).unwrap(), expected(form, &held)];
    // No lens reaches the stops of the gap.
    assert_close(found, mean, 1e-3 * (mean - form.as_designed()), "expectation");
    assert!(found > forms(&scene, &sheet(None))[1].expectation(&held).unwrap());
}

/// The triplet with a list of tolerances.
fn triplet(tolerances: &str) -> String {
    let text = std::fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: serde_json::Value = serde_json::from_str(&text).unwrap();
    lens["tolerances"] = serde_json::from_str(tolerances).unwrap();
    lens.to_string()
}

const GAP: &str = r#"{"kind": "thickness", "first": 1, "half_range": 0.05}"#;

#[test]
fn wrong_tolerances_are_named_by_their_place() {
    for (wrong, words) in [
        (r#"{"kind": "thickness", "first": 1, "last": 2, "half_range": 0.1}"#, "`last` is for"),
        (r#"{"kind": "element_tilt_x", "first": 4, "last": 2, "half_range": 0.1}"#, "in front of"),
        (r#"{"kind": "thickness", "first": 70, "half_range": 0.1}"#, "expected 1 to 7"),
        (r#"{"kind": "thickness", "first": 1, "half_range": -0.1}"#, "zero or more"),
        (r#"{"kind": "curvature", "first": 1, "half_range": 1, "fringes": 1}"#, "several"),
        (r#"{"kind": "curvature", "first": 1}"#, "no half range"),
    ] {
        let list = format!(r#"{{"errors": [{GAP}, {wrong}]}}"#);
        let file = Scratch::with("wrong_place.json", &triplet(&list));
        refused(2, &["tolerance", file.path(), "--samples", "2"], "", &["errors[1]", words]);
    }
    let list = format!(
        r#"{{"errors": [{GAP}], "correlations": [{{"errors": [0], "coefficient": 0.5}}]}}"#
    );
    let file = Scratch::with("alone.json", &triplet(&list));
    refused(2, &["tolerance", file.path()], "", &["correlations", "two or more"]);
    let file = Scratch::with("one.json", &triplet(&format!(r#"{{"errors": [{GAP}]}}"#)));
    let few = ["tolerance", file.path(), "--samples", "2"];
    for (option, value, words) in [
        ("--compensator", "thickness=1", "thickness@SURFACES"),
        ("--compensator", "sensor_tilt_x@2=1", "sensor_tilt_x=TRAVEL"),
        ("--mtf", "1e9", "diffraction ends"),
    ] {
        refused(2, &[&few[..], &[option, value]].concat(), "", &[words]);
    }
    assert!(done(&few, "").contains("1 manufacturing error, "));
}

#[test]
fn tolerances_that_are_seldom_meant_are_taken_with_a_warning() {
    let odd = [
        GAP,
        GAP,
        r#"{"kind": "index", "first": 1, "half_range": 0.001}"#,
        r#"{"kind": "element_tilt_x", "first": 1, "half_range": 0.01}"#,
    ];
    let list = format!(r#"{{"errors": [{}], "focus_travel": 0}}"#, odd.join(", "));
    let file = Scratch::with("seldom.json", &triplet(&list));
    let json = done_json(&["tolerance", file.path(), "--samples", "2", "--error", "10%"], "");
    let warnings = json["warnings"].to_string();
    for words in [
        "`thickness` of surface 2: listed several times",
        "`index` of surface 2: an error of the air",
        "`element tilt x` of surface 2: moves one surface alone",
        "`refocused` is the fixed image plane",
    ] {
        assert!(warnings.contains(words), "{words}: {warnings}");
    }
    let grin = "lenses/grin_rod_melles_griot.json";
    let json = done_json(&["tolerance", grin, "--samples", "2", "--error", "10%"], "");
    assert!(json["warnings"].to_string().contains("beside a GRIN medium (1, 2)"), "{json}");
}

/// An error that a compensator undoes leaves a growth below what the model leaves out.
#[test]
fn shares_of_a_growth_that_is_left_out_have_a_warning() {
    let list = r#"{"errors": [{"kind": "element_decenter_y", "first": 2, "last": 3, "half_range": 0.2},
        {"kind": "surface_tilt_x", "first": 1, "half_range": 0.001}],
        "compensators": [{"kind": "element_decenter_y", "first": 2, "last": 3, "travel": 1}]}"#;
    let file = Scratch::with("undone.json", &triplet(list));
    let json = done_json(&["tolerance", file.path(), "--samples", "60"], "");
    let warnings = json["warnings"].to_string();
    assert!(warnings.contains("refocused: the errors change the rms so little"), "{warnings}");
}
