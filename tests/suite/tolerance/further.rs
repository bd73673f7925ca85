//! What errors do to the wavefront and to the contrast; lenses that are saved; pictures and sums of shares.

use crate::cli::{Scratch, done, done_json, refused};
use crate::merit::bundled;
use aplanat::analysis::polychromatic_geometric_mtf;
use aplanat::lens::{
    AdjustedPart, Compensator, ErrorDistribution, Lens, Perturbation, PerturbationKind, Tolerance,
    ToleranceSheet,
};
use aplanat::math::{Dual, Real};
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::tolerance::{
    ContrastChanges, Derivatives, Jet2, MeritOptions, NominalLens, RealMeritRequest,
    SecondDerivatives, ToleranceGrade, ToleranceScene, WavefrontModel, graded_sheet, merits,
    perturb,
};

fn never() -> bool {
    false
}

fn sheet(errors: &[(PerturbationKind, usize, usize, f64)]) -> ToleranceSheet {
    let distribution = ErrorDistribution::Ends;
    let tolerance = |(kind, first, last, half_range): &(_, usize, usize, f64)| Tolerance {
        error: Perturbation { kind: *kind, first: *first, last: *last },
        half_range: *half_range,
        distribution,
    };
    ToleranceSheet::of_errors(errors.iter().map(tolerance).collect())
}

fn triplet() -> Lens {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.fields.values.truncate(2);
    lens
}

/// The derivatives of the variance of the wavefront are those of differences between lenses with errors,
/// each at its own best focus.
#[test]
fn derivatives_of_the_wavefront_are_those_of_differences() {
    let lens = triplet();
    let scene = ToleranceScene::new(&lens, 0, 0.05).unwrap();
    let sheet = sheet(&[
        (PerturbationKind::Curvature, 1, 1, 2e-6),
        (PerturbationKind::Index, 0, 0, 2e-5),
        (PerturbationKind::ElementDecenterY, 2, 3, 2e-3),
    ]);
    let model = |scene: &ToleranceScene, second: SecondDerivatives| {
        WavefrontModel::new((&lens, 0), scene, (&sheet, second), &never).unwrap()
    };
    let swept = model(&scene, SecondDerivatives::Neglected);
    let found = model(&scene, SecondDerivatives::Traced);
    let nominal = found.nominal();
    assert!(nominal[1] <= nominal[0] && nominal[1] > 0.0, "{nominal:?}");
    for (i, tolerance) in sheet.errors.iter().enumerate() {
        let step = tolerance.half_range;
        let at = |value: f64| {
            let systems = perturb(&scene.lens, &[(tolerance.error, value)]).unwrap();
            let lens = NominalLens { systems, ..scene.lens.clone() };
            let scene = ToleranceScene { lens, ..scene.clone() };
            model(&scene, SecondDerivatives::Neglected).nominal()
        };
        let (low, high) = (at(-step), at(step));
        for plane in 0..2 {
            let by = found.derivatives(i)[plane];
            let first = (high[plane] - low[plane]) / (2.0 * step);
            let second = (high[plane] - 2.0 * nominal[plane] + low[plane]) / (step * step);
            let scale = by.first.abs().max((nominal[plane] * by.second.abs()).sqrt());
            let what = (tolerance.error.kind, plane, by, first, second);
            assert!((by.first - first).abs() < 1e-3 * scale, "{what:?}");
            assert!((by.second - second).abs() < 0.02 * by.second.abs(), "{what:?}");
            let without = swept.derivatives(i)[plane];
            assert_eq!(without.first, by.first);
            // The wavefront of 2.5 waves times its second derivative by an error.
            assert!((without.second / by.second - 1.0).abs() < 0.15, "{what:?}");
        }
    }
    let [fixed, refocused] = found.expected_rms(&sheet).unwrap();
    assert!(fixed > refocused && refocused >= nominal[1].sqrt(), "{fixed} {refocused}");
}

/// One sweep back and Fermat's principle tell of every error what a trace over numbers that carry its derivative
/// tells: through mirrors, aspheres, cemented elements, and lenses without such a sweep.
#[test]
fn one_sweep_gives_the_derivatives_of_the_wavefront_by_every_error() {
    for name in
        ["double_gauss_rudolph_50", "telescope_rc_f8", "phone_us7558005_1", "grin_rod_melles_griot"]
    {
        let mut lens = bundled(name);
        lens.fields.values.truncate(2);
        let scene = ToleranceScene::new(&lens, 0, 0.2).unwrap();
        let sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Commercial);
        let second = SecondDerivatives::Neglected;
        let found = WavefrontModel::new((&lens, 0), &scene, (&sheet, second), &never).unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let vertices = scene.lens.systems[scene.lens.primary].vertex_positions();
        let pupil = vertices[vertices.len() - 2] + model.first_order.exit_pupil.position.unwrap();
        let wavefront = Some((pupil, 1e-3 * scene.lens.wavelengths[scene.lens.primary]));
        let options = MeritOptions { primary: scene.lens.primary, wavefront };
        for (i, tolerance) in sheet.errors.iter().enumerate().step_by(2) {
            let variable = Jet2::variable(Dual::variable(0.0, 0), 0);
            let systems = perturb(&scene.lens, &[(tolerance.error, variable)]).unwrap();
            let exact = merits(&systems, &scene.beam, options).unwrap();
            let fields = exact.wavefronts.iter().zip(&scene.beam.fields);
            let mean = fields.fold(Jet2::ZERO, |sum, (own, field)| {
                sum + own.tilt_removed * Jet2::from_f64(field.weight)
            });
            let (by, exact) = (found.derivatives(i)[0], Derivatives::from(mean));
            let scale = exact.first.abs().max((exact.value * by.second).sqrt());
            let what = (name, tolerance.error, by, exact);
            // The rounding of paths of some metres.
            assert!((by.value - exact.value).abs() < 1e-7 * exact.value, "{what:?}");
            assert!((by.first - exact.first).abs() <= 1e-7 * scale, "{what:?}");
        }
    }
}

/// A focus of bounded travel leaves a part of the wavefront, in the form and in real lenses alike; a gap as a
/// second compensator wins back what it makes.
#[test]
fn compensators_of_the_wavefront_have_stops() {
    let lens = triplet();
    let scene = ToleranceScene::new(&lens, 0, 0.05).unwrap();
    let errors =
        [(PerturbationKind::Curvature, 1, 1, 2e-6), (PerturbationKind::Thickness, 1, 1, 0.02)];
    let request = RealMeritRequest { seed: 3, most: 64, error: 0.02 };
    let second = SecondDerivatives::Neglected;
    let judged = |sheet: &ToleranceSheet| {
        let model = WavefrontModel::new((&lens, 0), &scene, (sheet, second), &never).unwrap();
        let real = model.real_lenses(&scene, sheet, request, &never).unwrap();
        let expected = model.expected_rms(sheet).unwrap()[1].powi(2);
        let apart = (real.mean[1] - expected).abs();
        assert!(apart < 4.0 * real.error[1] + 0.02 * expected, "{expected} {real:?}");
        expected
    };
    let free = sheet(&errors);
    let held = ToleranceSheet { focus_travel: Some(0.0), ..free.clone() };
    let part =
        AdjustedPart::Lens(Perturbation { kind: PerturbationKind::Thickness, first: 1, last: 1 });
    let gap = Compensator { part, travel: f64::INFINITY };
    let adjusted = ToleranceSheet { compensators: vec![gap], ..free.clone() };
    let (free, held, adjusted) = (judged(&free), judged(&held), judged(&adjusted));
    assert!(adjusted < free && free < 0.9 * held, "{adjusted} {free} {held}");
}

/// Errors that lie at the ends of their ranges: the mean variance of real lenses is that of the derivatives,
/// by as many lenses as it needs and no more.
#[test]
fn real_lenses_confirm_the_expected_wavefront() {
    let lens = triplet();
    let scene = ToleranceScene::new(&lens, 0, 0.05).unwrap();
    let sheet = sheet(&[
        (PerturbationKind::ElementDecenterX, 2, 3, 0.01),
        (PerturbationKind::ElementTiltY, 0, 1, 5e-5),
        (PerturbationKind::Curvature, 1, 1, 2e-6),
    ]);
    let second = SecondDerivatives::Neglected;
    let model = WavefrontModel::new((&lens, 0), &scene, (&sheet, second), &never).unwrap();
    let real = |most: usize, error: f64| {
        let request = RealMeritRequest { seed: 3, most, error };
        model.real_lenses(&scene, &sheet, request, &never).unwrap()
    };
    let found = real(256, 0.02);
    let expected = model.expected_rms(&sheet).unwrap().map(|rms| rms * rms);
    assert!(found.reached && found.lost == 0, "{found:?}");
    assert_eq!(found.differs_from(expected, 0.01), None, "{found:?} {expected:?}");
    assert!(found.differs_from(expected.map(|value| 1.5 * value), 0.01).is_some(), "{found:?}");
    let few = real(2, 0.0);
    assert!(few.lenses == 2 && !few.reached, "{few:?}");
    let root = found.root();
    assert!((root.mean[1] * root.mean[1] / found.mean[1] - 1.0).abs() < 1e-12);
}

/// The contrast of a lens is that of its analysis; a gap in front of the image changes it as that gap
/// does in the design, and focus takes it back.
#[test]
fn the_contrast_of_a_lens_with_errors_is_that_of_the_lens() {
    let mut lens = triplet();
    lens.fields.values.truncate(1);
    let last = lens.surfaces.len() - 1;
    let sheet = sheet(&[(PerturbationKind::Thickness, last, last, 0.1)]);
    let contrast = |lens: &Lens| {
        let scene = ToleranceScene::new(lens, 0, 0.01).unwrap();
        ContrastChanges::new((lens, 0, 0.01), &scene, (&sheet, 10.0), &never).unwrap()
    };
    let found = contrast(&lens);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let curve = polychromatic_geometric_mtf(&model, model.fields[0], &[10.0], accuracy).unwrap();
    let exact = curve.points[0].tangential.modulus.value;
    let error = found.sampling_error + 1e-3;
    assert!((found.nominal[0] - exact).abs() < error, "{} {exact} {error}", found.nominal[0]);
    // A frequency that no affordable rays resolve has no error of zero.
    let scene = ToleranceScene::new(&lens, 0, 0.01).unwrap();
    let far = ContrastChanges::new((&lens, 0, 0.01), &scene, (&sheet, 1e6), &never).unwrap();
    assert!(found.sampling_error > 0.0 && far.sampling_error > 1e-3, "{}", far.sampling_error);
    let [fixed, refocused] = found.changes[0].unwrap().ends;
    let mut longer = lens.clone();
    longer.surfaces[last].thickness += 0.1;
    let expected = contrast(&longer).nominal[0] - found.nominal[0];
    assert!((fixed[1] - expected).abs() < 2.0 * error, "{fixed:?} {expected}");
    assert!(refocused.iter().all(|change| change.abs() < 1e-6), "{refocused:?}");
    assert!(fixed.iter().any(|change| change.abs() > 0.01), "{fixed:?}");
}

/// The rays that move by their derivatives have the contrast of traced ones, at the fixed image plane and with
/// focus and a gap adjusted; the derivative is that of small errors.
#[test]
fn the_contrast_by_one_sweep_is_that_of_traced_rays() {
    let lens = triplet();
    let scene = ToleranceScene::new(&lens, 0, 0.01).unwrap();
    let gap = Perturbation { kind: PerturbationKind::Thickness, first: 1, last: 1 };
    let compensator = Compensator { part: AdjustedPart::Lens(gap), travel: 0.05 };
    let request = RealMeritRequest { seed: 3, most: 2, error: 0.0 };
    let changes = |kind, first, last, half_range| {
        let mut sheet = sheet(&[(kind, first, last, half_range)]);
        sheet.compensators = vec![compensator];
        let place = (&lens, 0, 0.01);
        let sheet = (&sheet, 10.0);
        let found = ContrastChanges::with_real_lenses(place, &scene, sheet, request, &never);
        let (found, real) = found.unwrap();
        (found.changes[0].unwrap(), [0, 1].map(|i| real.mean[i] - found.nominal[i]), real)
    };
    // Both ends are mirror images.
    for kind in [PerturbationKind::ElementDecenterX, PerturbationKind::ElementTiltY] {
        let half_range = if kind == PerturbationKind::ElementTiltY { 2e-3 } else { 0.05 };
        let (found, real, _) = changes(kind, 2, 3, half_range);
        for plane in 0..2 {
            let [low, high] = found.ends[plane];
            let what = (kind, found, real);
            assert!(low.abs() > 0.005 && (high - low).abs() < 1e-9, "{what:?}");
            assert!((real[plane] / low - 1.0).abs() < 0.03, "{what:?}");
            assert!(found.first[plane].abs() * half_range < 1e-6, "{what:?}");
        }
    }
    let (small, ..) = changes(PerturbationKind::Curvature, 1, 1, 1e-7);
    let [low, high] = small.ends[0];
    assert!((small.first[0] * 2e-7 / (high - low) - 1.0).abs() < 1e-3, "{small:?}");
}

const SINGLET: &str = r#"{ "aplanat": 1, "name": "Singlet", "object": "infinity",
  "aperture": {"entrance_pupil_diameter": 10.0},
  "fields": {"kind": "angle", "values": [{"y": 0.0}, {"y": 2.0}]},
  "wavelengths": [{"um": 0.5875618}],
  "surfaces": [
    {"radius": 100, "thickness": 5.0, "glass": {"index": 1.5}, "semi_diameter": 6.0, "stop": true},
    {"radius": -100, "thickness": 98.0, "semi_diameter": 6.0}],
  "tolerances": {"errors": [
    {"kind": "thickness", "first": 0, "half_range": 0.1},
    {"kind": "thickness", "first": 1, "half_range": 0.1},
    {"kind": "surface_tilt_x", "first": 1, "half_range": 0.05, "distribution": "uniform"}]} }"#;

/// A run that goes on from saved lenses gives the same result; those of another lens or seed are refused.
#[test]
fn saved_lenses_give_the_result_of_one_run() {
    let (lens, file) = (Scratch::with("saved_singlet.json", SINGLET), Scratch::new("saved.json"));
    let run = |samples: &str, more: &[&str]| {
        let few = ["tolerance", lens.path(), "--error", "10%", "--samples", samples];
        done_json(&[&few[..], more].concat(), "")
    };
    let saved = ["--checkpoint", file.path()];
    let whole = run("12", &[]);
    assert_ne!(run("5", &saved), whole);
    assert_eq!(run("12", &saved), whole);
    assert_eq!(run("12", &saved), whole);
    let few = ["tolerance", lens.path(), "--samples", "5"];
    let other = |more: &[&str], words: &str| {
        refused(2, &[&few[..], &saved[..], more].concat(), "", &[words]);
    };
    other(&["--error", "10%", "--seed", "2"], "another --seed");
    other(&["--error", "20%"], "another --zoom");
    other(&["--grade", "commercial"], "another lens or other tolerances");
    std::fs::write(file.path(), "{}").unwrap();
    other(&[], "not a valid checkpoint");
}

/// The picture, the further merits and the sums of shares of the command.
#[test]
fn the_command_draws_and_groups() {
    let lens = Scratch::with("drawn_singlet.json", SINGLET);
    let (png, svg, csv) =
        (Scratch::new("drawn.png"), Scratch::new("drawn.svg"), Scratch::new("drawn.csv"));
    let few = ["tolerance", lens.path(), "--error", "10%", "--samples", "6"];
    let merits = ["--wavefront", "--mtf", "5", "--csv", csv.path()];
    let json = done_json(&[&few[..], &merits, &["--plot", png.path()]].concat(), "");
    let groups = &json["groups"];
    for list in [&groups["by_part"], &groups["by_kind"]] {
        let sum = |key: &str| -> f64 {
            list.as_array().unwrap().iter().map(|own| own[key].as_f64().unwrap()).sum()
        };
        assert!((sum("fixed") - 1.0).abs() < 1e-9 && (sum("refocused") - 1.0).abs() < 1e-9);
        assert_eq!(sum("errors"), 3.0);
    }
    let parts: Vec<_> =
        groups["by_part"].as_array().unwrap().iter().map(|own| &own["part"]).collect();
    assert!(parts.len() == 2 && parts.iter().any(|part| *part == "gap"), "{parts:?}");
    assert!(json["wavefront"]["expected_rms"][1].as_f64().unwrap() > 0.0);
    assert!(json["mtf"]["nominal"][0].as_f64().unwrap() <= 1.0);
    for merit in ["wavefront", "mtf"] {
        let real = &json[merit]["real"];
        assert_eq!(real["lenses"].as_u64().unwrap() + real["lost"].as_u64().unwrap(), 6);
        let [mean, error] = ["mean", "error"].map(|key| real[key][1].as_f64().unwrap());
        let expected =
            json[merit][if merit == "mtf" { "expected" } else { "expected_rms" }][1].as_f64();
        assert!((mean - expected.unwrap()).abs() < 5.0 * error + 0.02 * mean, "{merit}: {real}");
    }
    assert!(json["sensitivities"][0]["wavefront"]["refocused"]["share"].is_number());
    assert_eq!(json["second_derivatives"], false);
    let table = std::fs::read_to_string(csv.path()).unwrap();
    let columns = |line: &str| line.split(',').count();
    let tilt = table.lines().find(|line| line.starts_with("surface tilt x")).unwrap();
    let cells: Vec<&str> = tilt.split(',').collect();
    assert!(
        cells[1..4] == ["2", "2", "arcmin"] && (number_of(cells[4]) - 3.0).abs() < 1e-9,
        "{tilt}"
    );
    let row =
        json["sensitivities"].as_array().unwrap().iter().find(|row| row["first"] == 1).unwrap();
    // Per radian in JSON, per minute of arc in the table.
    let arcmin = (1.0_f64 / 60.0).to_radians();
    for (cell, exact) in [
        (cells[8], row["fixed"]["second"].as_f64().unwrap() * arcmin * arcmin),
        (cells[14], row["wavefront"]["fixed"]["second"].as_f64().unwrap() * arcmin * arcmin),
    ] {
        assert!((number_of(cell) - exact).abs() <= 1e-12 * exact.abs(), "{cell} {exact}");
    }
    assert!(table.lines().all(|line| columns(line) == 13 + 6 + 6), "{table}");
    assert!(std::fs::read(png.path()).unwrap().starts_with(b"\x89PNG"));
    let drawn = ["--plot", svg.path(), "--second-derivatives"];
    let text = done(&[&few[..], &drawn].concat(), "");
    assert!(text.contains("element") && text.contains("thickness"), "{text}");
    let drawing = std::fs::read_to_string(svg.path()).unwrap();
    for words in ["<svg", "thickness 1", "yield", "share of the growth"] {
        assert!(drawing.contains(words), "{words}");
    }
    let wrong = ["expected `.png` or `.svg` or `.pdf`"];
    refused(2, &[&few[..], &["--plot", "drawn.jpg"]].concat(), "", &wrong);
    refused(2, &[&few[..], &["--mtf=0"]].concat(), "", &["--mtf", "cycles/mm"]);
}

fn number_of(text: &str) -> f64 {
    text.parse().unwrap()
}

/// The order of the errors is asked for, and the text has all of them or says how many it leaves out; a spot
/// better than that of the lens is an error of its option.
#[test]
fn errors_are_sorted_by_either_share_and_printed_all() {
    let few = ["tolerance", "lenses/tessar_50_f28.json", "--error", "10%", "--samples", "2"];
    let csv = Scratch::new("sorted.csv");
    let shares = |sort: &str| -> Vec<f64> {
        let more = ["--sort", sort, "--csv", csv.path()];
        let json = done_json(&[&few[..], &more].concat(), "");
        let rows = json["sensitivities"].as_array().unwrap().clone();
        let table = std::fs::read_to_string(csv.path()).unwrap();
        let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        let column = head.iter().position(|name| *name == format!("{sort}_share")).unwrap();
        let written: Vec<f64> = table
            .lines()
            .skip(1)
            .map(|line| number_of(line.split(',').nth(column).unwrap()))
            .collect();
        let shares: Vec<f64> =
            rows.iter().map(|row| row[sort]["share"].as_f64().unwrap()).collect();
        assert_eq!(shares, written);
        shares
    };
    for sort in ["fixed", "refocused"] {
        let found = shares(sort);
        assert!(found.len() > 20 && found.is_sorted_by(|a, b| a >= b), "{sort}: {found:?}");
    }
    let brief = done(&few, "");
    assert!(brief.contains(" more (--all)") && brief.contains("standard deviation"), "{brief}");
    let all = done(&[&few[..], &["--all"]].concat(), "");
    assert!(!all.contains(" more (--all)") && all.lines().count() > brief.lines().count());
    let sharp = ["--loosest", "0.0001"];
    refused(
        2,
        &[&few[..], &sharp].concat(),
        "",
        &["error: --loosest: an rms of 0.0001 mm is asked for; expected"],
    );
    let sharp = ["--rms", "0.0001", "--loosest-yield", "90%"];
    refused(
        2,
        &[&few[..], &sharp].concat(),
        "",
        &["error: --rms: an rms of 0.0001 mm is asked for; expected"],
    );
}
