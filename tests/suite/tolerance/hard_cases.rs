//! Errors of making that end rays, do nothing, or ask too much of a quadratic form.

use super::reference::{lenses, tolerances};
use crate::cli::{Scratch, done, done_json, refused};
use aplanat::lens::{
    ErrorDistribution, FieldPoint, Perturbation, PerturbationKind, ToleranceSheet, lie_on_one_side,
};
use aplanat::tolerance::{
    MeritOptions, PupilTreatment, ToleranceError, ToleranceGrade, ToleranceRequest, ToleranceScene,
    analyze, graded_sheet, merits, perturb,
};

pub(super) fn scene(number: usize, rule: (usize, usize)) -> ToleranceScene {
    let lens = &lenses()[number];
    ToleranceScene {
        lens: lens.nominal(),
        beam: lens.beam(rule.0, rule.1),
        options: MeritOptions { wavefront: None, ..lens.options() },
        sampling_error: 0.0,
        pupils: PupilTreatment::Held("the rays are given"),
    }
}

/// A tilt far beyond the critical angle, and an element that is pushed out of the beam.
#[test]
fn an_error_that_ends_rays_is_reported_with_their_fate() {
    let scene = scene(0, (2, 6));
    for (kind, value) in
        [(PerturbationKind::SurfaceTiltX, 1.2), (PerturbationKind::ElementDecenterY, 60.0)]
    {
        let error = match kind {
            PerturbationKind::SurfaceTiltX => Perturbation::of_surface(kind, 1),
            _ => Perturbation { kind, first: 2, last: 3 },
        };
        let systems = perturb(&scene.lens, &[(error, value)]).unwrap();
        let judged = merits(&systems, &scene.beam, scene.options);
        assert!(matches!(judged, Err(ToleranceError::RayLost { .. })), "{kind:?}");
    }
}

/// Fields along x stand for both sides of the axis of a lens that is symmetric about it, as those along y do.
#[test]
fn tolerances_know_no_direction_of_the_field() {
    let as_built = |[x, y]: [f64; 2]| {
        let mut lens = aplanat::files::open("lenses/cooke_triplet_100_f27.json").unwrap().lens;
        lens.fields.values = vec![FieldPoint { x, y, weight: 1.0 }];
        let scene = ToleranceScene::new(&lens, 0, 1e-4).unwrap();
        let sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Commercial);
        let request = ToleranceRequest { seed: 1, samples: 2, limit: None };
        analyze(&scene, &sheet, request).unwrap().spots[1].form_root_mean_square
    };
    let along_y = as_built([0.0, 5.0]);
    for field in [[-5.0, 0.0], [3.0, -4.0]] {
        let other = as_built(field);
        assert!((other / along_y - 1.0).abs() < 5e-4, "{field:?}: {other} {along_y}");
    }
    let [near, opposite, aside] = [[0.3, 0.4], [-0.3, -0.4], [0.3, 0.0]].map(|[x, y]| {
        [FieldPoint { x, y, weight: 1.0 }, FieldPoint { x: 0.6, y: 0.8, weight: 1.0 }]
    });
    assert!(lie_on_one_side(&near) && !lie_on_one_side(&opposite) && !lie_on_one_side(&aside));
}

/// Lenses that lose rays are counted as bad and leave finite numbers.
#[test]
fn lenses_that_lose_rays_count_as_bad() {
    let scene = scene(0, (2, 4));
    let mut errors = tolerances(&lenses()[0], ErrorDistribution::Ends);
    errors.retain(|t| t.error.kind == PerturbationKind::ElementDecenterY);
    errors.iter_mut().for_each(|t| t.half_range = 25.0);
    let sheet = ToleranceSheet::of_errors(errors);
    let request = ToleranceRequest { seed: 1, samples: 8, limit: Some(1.0) };
    let found = analyze(&scene, &sheet, request).unwrap();
    assert!(found.lost > 0);
    assert!(found.spots.iter().all(|spot| spot.mean_rms[0].is_finite()));
}

/// A chief ray that an error sends past a surface is reported where the wavefront asks for it.
#[test]
fn a_chief_ray_that_is_lost_ends_the_wavefront_alone() {
    let mut scene = scene(0, (2, 4));
    scene.beam.fields[1].chief.0.point.y += 500.0;
    let spots = merits(&scene.lens.systems, &scene.beam, scene.options).unwrap();
    assert!(spots.mean_square().is_finite() && spots.wavefronts.is_empty());
    let judged = merits(&scene.lens.systems, &scene.beam, lenses()[0].options());
    assert!(matches!(judged, Err(ToleranceError::RayLost { field: 1, .. })), "{judged:?}");
}

/// A stop that is pushed out of the beam takes all light: such lenses are counted, and no mean over the
/// others stands for them.
#[test]
fn a_rim_that_closes_the_pupil_is_counted() {
    let lens = |half_range: f64| {
        format!(
            r#"{{ "aplanat": 1, "name": "Stop in front", "object": "infinity",
  "aperture": {{"entrance_pupil_diameter": 8.0}},
  "fields": {{"kind": "angle", "values": [{{"y": 0.0}}]}},
  "wavelengths": [{{"um": 0.5875618}}],
  "surfaces": [
    {{"curvature": 0.0, "thickness": 5.0, "semi_diameter": 4.0, "stop": true}},
    {{"radius": 100, "thickness": 5.0, "glass": {{"index": 1.5}}, "semi_diameter": 12.0}},
    {{"radius": -100, "thickness": 98.0, "semi_diameter": 12.0}}],
  "tolerances": {{"errors": [{{"kind": "surface_decenter_y", "first": 0,
    "half_range": {half_range}, "distribution": "ends"}}]}} }}"#
        )
    };
    let run = |half_range: f64, more: &[&str]| {
        let file = Scratch::with("stop_in_front.json", &lens(half_range));
        let own = ["tolerance", file.path(), "--samples", "6", "--error", "1%"];
        done_json(&[&own[..], more].concat(), "")
    };
    // The pupil goes with the stop, as long as the lens behind is wide enough, and takes all of its light.
    let (closed, open) = (run(20.0, &[]), run(0.5, &[]));
    assert_eq!((closed["dark"].as_u64(), open["dark"].as_u64()), (Some(6), Some(0)));
    assert!(closed["pupils"]["moves"] == true && open["pupils"]["moves"] == true);
    assert!(closed["warnings"].to_string().contains("gets no light"), "{}", closed["warnings"]);
    let (closed, open) = (run(20.0, &["--hold-pupils"]), run(0.5, &["--hold-pupils"]));
    assert_eq!((closed["dark"].as_u64(), open["dark"].as_u64()), (Some(6), Some(0)));
    assert_eq!(closed["lost"].as_u64(), Some(0));
    assert!(closed["clipping"].is_null() && open["clipping"][2].as_f64().unwrap() > 0.01);
    assert!(closed["warnings"].to_string().contains("gets no light"), "{}", closed["warnings"]);
}

/// A gap that becomes negative moves surfaces through each other: rays follow the order of the list.
#[test]
fn an_element_that_overlaps_its_neighbour_is_traced_in_order() {
    let scene = scene(0, (2, 4));
    let error = Perturbation::of_surface(PerturbationKind::Thickness, 1);
    let systems = perturb(&scene.lens, &[(error, -12.0_f64)]).unwrap();
    let judged = merits(&systems, &scene.beam, scene.options).unwrap();
    assert!(f64::is_finite(judged.mean_square()));
}

/// Tolerances of zero change nothing; surfaces that do not exist and rolls of planes are refused.
#[test]
fn no_tolerance_and_impossible_errors() {
    let scene = scene(0, (2, 4));
    let mut errors = tolerances(&lenses()[0], ErrorDistribution::NormalCut);
    errors.truncate(4);
    errors.iter_mut().for_each(|t| t.half_range = 0.0);
    let sheet = ToleranceSheet { errors, focus_travel: Some(0.0), ..ToleranceSheet::default() };
    let request = ToleranceRequest { seed: 1, samples: 4, limit: None };
    let found = analyze(&scene, &sheet, request).unwrap();
    for spot in &found.spots {
        assert!((spot.mean_rms[0] / spot.nominal_rms - 1.0).abs() < 1e-5, "{spot:?}");
    }
    let refuse = |kind: PerturbationKind, first: usize, words: &str| {
        let error = Perturbation { kind, first, last: first };
        let message = perturb(&scene.lens, &[(error, 0.1)]).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refuse(PerturbationKind::Thickness, 7, "expected surfaces from 1 to 7");
    refuse(PerturbationKind::ElementRollX, 4, "a plane does not have");
    refuse(PerturbationKind::ThicknessAdjusted, 6, "has no gap behind the next surface");
}

/// A focus whose travel ends at once is no focus; one that ends somewhere lies between.
#[test]
fn a_compensator_at_its_stop_leaves_the_rest() {
    let scene = scene(0, (2, 6));
    let mut errors = tolerances(&lenses()[0], ErrorDistribution::NormalCut);
    errors.retain(|t| t.error.kind == PerturbationKind::Thickness);
    let run = |travel: Option<f64>| {
        let sheet = ToleranceSheet {
            errors: errors.clone(),
            focus_travel: travel,
            ..ToleranceSheet::default()
        };
        let request = ToleranceRequest { seed: 1, samples: 30, limit: None };
        analyze(&scene, &sheet, request).unwrap().spots
    };
    let [free, some, none] = [run(None), run(Some(0.1)), run(Some(0.0))].map(|s| s[1].mean_rms[0]);
    let fixed = run(None)[0].mean_rms[0];
    assert!(free < some && some < none, "{free} {some} {none}");
    assert!((none / fixed - 1.0).abs() < 0.02, "{none} {fixed}");
}

/// A phone lens whose elements are decentred tenfold: the form says by itself that it fails.
#[test]
fn a_form_that_fails_says_so() {
    let scene = scene(2, (3, 6));
    let mut errors = tolerances(&lenses()[2], ErrorDistribution::Normal);
    errors.retain(|t| t.error.kind == PerturbationKind::ElementDecenterY);
    errors.iter_mut().for_each(|t| t.half_range *= 10.0);
    let sheet = ToleranceSheet::of_errors(errors);
    let request = ToleranceRequest { seed: 2, samples: 120, limit: None };
    let found = analyze(&scene, &sheet, request).unwrap();
    assert!(!found.spots[1].form_agrees, "{:?}", found.spots[1].difference);
}

/// A singlet with tolerances in its file.
const SINGLET: &str = r#"{ "aplanat": 1, "name": "Singlet", "object": "infinity",
  "aperture": {"entrance_pupil_diameter": 10.0},
  "fields": {"kind": "angle", "values": [{"y": 0.0}, {"y": 2.0}]},
  "wavelengths": [{"um": 0.5875618}],
  "surfaces": [
    {"radius": 100, "thickness": 5.0, "glass": {"index": 1.5}, "semi_diameter": 6.0, "stop": true},
    {"radius": -100, "thickness": 98.0, "semi_diameter": 6.0}],
  "tolerances": {"errors": [
    {"kind": "thickness", "first": 0, "half_range": 0.1},
    {"kind": "surface_tilt_x", "first": 1, "half_range": 0.05, "distribution": "uniform"},
    {"kind": "element_decenter_x", "first": 0, "last": 1, "half_range": 0.05}]} }"#;

/// The command: text, JSON, and what it refuses.
#[test]
fn the_command_shows_sensitivities_and_spots() {
    let folder = std::env::temp_dir().join(format!("aplanat_tolerance_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("singlet.json");
    std::fs::write(&path, SINGLET).unwrap();
    let lens = path.to_str().unwrap();
    let few = ["tolerance", lens, "--samples", "4", "--error", "10%"];
    let text = done(&few, "");
    for word in [
        "3 manufacturing errors",
        "as designed",
        "element decenter x",
        "1-2",
        "3'",
        "moving pupils: o",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let json = done_json(&[&few[..], &["--rms", "0.05", "--loosest", "0.5"]].concat(), "");
    assert_eq!(json["spots"].as_array().unwrap().len(), 2);
    assert!(json["spots"][1]["good"]["interval"][1].as_f64().unwrap() <= 1.0);
    assert_eq!(json["loosest"].as_array().unwrap().len(), 3);
    // Far more is asked for than any shop makes wide: held, and confirmed by rays.
    let confirmed = &json["prices"]["confirmed"];
    let [real, form] = [0, 1].map(|i| confirmed[i].as_f64().unwrap());
    assert!(real < 0.5 && (real / form - 1.0).abs() < 0.5, "{real} {form}");
    assert!(json["warnings"].to_string().contains("held at ten times"), "{}", json["warnings"]);
    refused(2, &["tolerance", lens, "--rms=-1"], "", &["--rms"]);
    refused(2, &["tolerance", lens, "--rms=0"], "", &["--rms"]);
    refused(2, &["tolerance", lens, "--loosest=0"], "", &["--loosest"]);
    refused(2, &["tolerance", lens, "--samples", "1"], "", &["--samples", "2 or more"]);
    refused(2, &["tolerance", lens, "--grade", "good"], "", &["commercial"]);
    // A tilt of the rear by 80 degrees: nearly all lenses lose rays.
    let broken =
        SINGLET.replace("0.05, \"distribution\": \"uniform\"", "80.0, \"distribution\": \"ends\"");
    std::fs::write(&path, broken).unwrap();
    refused(1, &few, "", &["of 4 lenses", "lose rays", "tighter"]);
    std::fs::write(&path, SINGLET.replace("\"last\": 1", "\"last\": 7")).unwrap();
    refused(2, &few, "", &["surfaces 1 to 8; expected 1 to 2"]);
    std::fs::remove_dir_all(&folder).unwrap();
}
