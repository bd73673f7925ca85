//! What is adjusted after assembly: sensor, gaps, elements, each with a bounded travel.

use super::hard_cases::scene;
use super::reference::{assert_close, lenses, tolerances};
use crate::cli::{Scratch, done, done_json, refused};
use aplanat::lens::{
    AdjustedPart, Compensator, ErrorDistribution, Perturbation, PerturbationKind, Pose, Tolerance,
    ToleranceSheet,
};
use aplanat::math::Vec3;
use aplanat::tolerance::{
    ColourRays, FieldBeam, RealLens, ToleranceAnalysis, ToleranceRequest, ToleranceScene, analyze,
    merits, perturb, real_lenses,
};
use aplanat::trace::Tracer;
use std::sync::atomic::AtomicBool;

const MIDDLE: Perturbation =
    Perturbation { kind: PerturbationKind::ElementDecenterY, first: 2, last: 3 };

fn in_lens(part: Perturbation, travel: f64) -> Compensator {
    Compensator { part: AdjustedPart::Lens(part), travel }
}

fn sensor(travel: f64) -> [Compensator; 2] {
    [AdjustedPart::SensorTiltX, AdjustedPart::SensorTiltY].map(|part| Compensator { part, travel })
}

/// The tolerances of the triplet with compensators.
fn sheet(distribution: ErrorDistribution, compensators: &[Compensator]) -> ToleranceSheet {
    let errors = tolerances(&lenses()[0], distribution);
    ToleranceSheet { compensators: compensators.to_vec(), ..ToleranceSheet::of_errors(errors) }
}

fn analysis(scene: &ToleranceScene, sheet: &ToleranceSheet, samples: usize) -> ToleranceAnalysis {
    analyze(scene, sheet, ToleranceRequest { seed: 4, samples, limit: None }).unwrap()
}

fn made(scene: &ToleranceScene, sheet: &ToleranceSheet, count: usize) -> Vec<RealLens> {
    real_lenses(scene, sheet, 4, count, 0, &AtomicBool::new(false)).unwrap()
}

/// The least mean square of a lens at its best focus over one adjustment, by ever finer steps.
fn least(scene: &ToleranceScene, sheet: &ToleranceSheet, lens: &RealLens) -> (f64, f64) {
    let Compensator { part: AdjustedPart::Lens(part), travel } = sheet.compensators[0] else {
        panic!("a part of the lens")
    };
    let at = |position: f64| {
        let errors = sheet.errors.iter().zip(&lens.errors).map(|(t, value)| (t.error, *value));
        let all: Vec<_> = errors.chain([(part, position)]).collect();
        let systems = perturb(&scene.lens, &all).unwrap();
        merits(&systems, &scene.beam, scene.options).unwrap().mean_square_focused()
    };
    let (mut center, mut step) = (0.0_f64, travel);
    let mut best = at(center);
    while step > 1e-6 * travel {
        let tries = [center - step, center + step].map(|p| p.clamp(-travel, travel));
        match tries.into_iter().map(|p| (p, at(p))).find(|(_, value)| *value < best) {
            Some((position, value)) => (center, best) = (position, value),
            None => step *= 0.5,
        }
    }
    (center, best)
}

/// Real lenses are at the least spot that their compensator and their focus can reach.
#[test]
fn a_real_lens_is_adjusted_to_its_least_spot() {
    let scene = scene(0, (2, 6));
    let gap = Perturbation::of_surface(PerturbationKind::Thickness, 1);
    for (part, travel) in [(MIDDLE, 0.2), (MIDDLE, 0.01), (gap, 0.3)] {
        let sheet = sheet(ErrorDistribution::Normal, &[in_lens(part, travel)]);
        for lens in made(&scene, &sheet, 4) {
            let (position, value) = least(&scene, &sheet, &lens);
            let what = format!("{:?} {travel}", part.kind);
            assert_close(lens.mean_square.unwrap()[1], value, 1e-7 * value, &what);
            assert_close(lens.adjustments[1], position, 1e-3 * travel, &what);
            assert!(lens.adjustments[1].abs() <= travel, "{what}");
        }
    }
}

/// With an object at infinity the focal surface of a lens turns with the lens: so does the sensor, but
/// for the curvature of the field, which is met at another place and turns it back by an eighth here.
#[test]
fn a_sensor_follows_a_lens_that_is_tilted_as_a_whole() {
    let scene = scene(0, (2, 6));
    for (i, kind) in
        [PerturbationKind::ElementTiltX, PerturbationKind::ElementTiltY].into_iter().enumerate()
    {
        let error = Perturbation { kind, first: 0, last: 6 };
        let distribution = ErrorDistribution::Ends;
        let errors = vec![Tolerance { error, half_range: 2e-3, distribution }];
        let compensators = sensor(0.02).to_vec();
        let sheet = ToleranceSheet { compensators, ..ToleranceSheet::of_errors(errors) };
        let found = analysis(&scene, &sheet, 8);
        // The fields are not even about the axis, so that the sensor of the lens itself is tilted too.
        let nominal = [1, 2].map(|k| found.travels[k].nominal);
        for lens in made(&scene, &sheet, 8) {
            let turned = |k: usize| lens.adjustments[1 + k] - nominal[k];
            assert_close(turned(i), 0.88 * lens.errors[0], 0.01 * lens.errors[0].abs(), "tilt");
            assert!(turned(1 - i).abs() < 0.03 * lens.errors[0].abs(), "{}", turned(1 - i));
            let [fixed, adjusted] = lens.mean_square.unwrap().map(f64::sqrt);
            let nominal = found.spots[1].nominal_rms;
            assert!(adjusted < 1.01 * nominal && adjusted < fixed, "{adjusted} {nominal} {fixed}");
        }
        assert!(found.spots[1].form_agrees, "{:?}", found.spots[1].difference);
        let [form, real] = [found.travels[1 + i].form, found.travels[1 + i].real.unwrap()];
        assert_close(form.deviation, 0.88 * 2e-3, 0.01 * 2e-3, "form");
        // Eight lenses at one end or the other.
        assert_close(real.deviation, 0.88 * 2e-3, 0.1 * 2e-3, "real");
    }
}

/// The mean square spot of a lens on a sensor that is tilted and displaced, by rays that end on it.
fn on_sensor(scene: &ToleranceScene, lens: &RealLens, error: Perturbation, at: [f64; 3]) -> f64 {
    let mut systems = perturb(&scene.lens, &[(error, lens.errors[0])]).unwrap();
    for system in &mut systems {
        let last = system.surfaces.len() - 1;
        system.surfaces[last - 1].thickness += at[0];
        system.surfaces[last].pose = Some(Pose::new([0.0; 2], [at[1], at[2]]));
    }
    let tracers: Vec<_> = systems.iter().map(|s| Tracer::new(s).unwrap()).collect();
    let field = |field: &FieldBeam| {
        let ends = |colour: &ColourRays| -> Vec<(Vec3<f64>, f64)> {
            let tracer = &tracers[colour.wavelength];
            let rays = colour.rays.iter().zip(&colour.weights);
            rays.map(|(ray, weight)| (tracer.trace(*ray).ray.point, *weight)).collect()
        };
        let ends: Vec<_> = field.colours.iter().flat_map(ends).collect();
        let center = ends.iter().fold(Vec3::default(), |sum, (p, weight)| sum + *p * *weight);
        let square = |(p, weight): &(Vec3<f64>, f64)| weight * (*p - center).dot(*p - center);
        field.weight * ends.iter().map(square).sum::<f64>()
    };
    scene.beam.fields.iter().map(field).sum()
}

/// The adjusted sensor is that on which traced rays end with the least spot.
#[test]
fn rays_that_end_on_the_adjusted_sensor_make_its_spot() {
    let scene = scene(0, (2, 6));
    let error = Perturbation { kind: PerturbationKind::ElementTiltX, first: 0, last: 6 };
    let distribution = ErrorDistribution::Ends;
    let errors = vec![Tolerance { error, half_range: 0.01, distribution }];
    let compensators = sensor(0.1).to_vec();
    let sheet = ToleranceSheet { compensators, ..ToleranceSheet::of_errors(errors) };
    for lens in made(&scene, &sheet, 3) {
        let at = [lens.adjustments[0], lens.adjustments[1], lens.adjustments[2]];
        let found = on_sensor(&scene, &lens, error, at);
        let adjusted = lens.mean_square.unwrap()[1];
        assert_close(found, adjusted, 1e-9 * adjusted, "spot");
        for (i, step) in [(0, 0.01), (1, 1e-3), (2, 1e-3)] {
            for sign in [-1.0, 1.0] {
                let mut moved = at;
                moved[i] += sign * step;
                assert!(on_sensor(&scene, &lens, error, moved) > adjusted, "{i} {sign}");
            }
        }
    }
}

/// All errors of a triplet: every compensator lowers the spot, and the form knows by how much.
#[test]
fn the_form_knows_what_compensators_win_back() {
    let scene = scene(0, (3, 6));
    let across = Perturbation { kind: PerturbationKind::ElementDecenterX, ..MIDDLE };
    let gap = Perturbation::of_surface(PerturbationKind::Thickness, 1);
    let all = [
        vec![],
        sensor(0.02).to_vec(),
        [&sensor(0.02)[..], &[in_lens(MIDDLE, 0.5), in_lens(across, 0.5)]].concat(),
        [&sensor(0.02)[..], &[in_lens(MIDDLE, 0.5), in_lens(across, 0.5), in_lens(gap, 0.5)]]
            .concat(),
    ];
    let mut last = f64::INFINITY;
    for compensators in all {
        let sheet = sheet(ErrorDistribution::NormalCut, &compensators);
        let found = analysis(&scene, &sheet, 40);
        let spot = &found.spots[1];
        let [difference, error] = spot.difference;
        assert!(difference.abs() < 0.01 * spot.form_mean_rms + 3.0 * error, "{spot:?}");
        assert!(spot.mean_rms[0] < last, "{} {last}", spot.mean_rms[0]);
        last = spot.mean_rms[0];
        assert_eq!(found.travels.len(), compensators.len() + 1);
        for own in &found.travels {
            let real = own.real.unwrap();
            // The gap is not the best one by design: it goes to its end in every lens.
            let is_gap = own.part == AdjustedPart::Lens(gap);
            assert_eq!(real.at_stop, if is_gap { 1.0 } else { 0.0 }, "{own:?}");
            assert_eq!(real.at_stop, own.form.at_stop, "{own:?}");
            // Forty lenses tell a deviation to 11 %.
            let ratio = real.deviation / own.form.deviation;
            assert!(is_gap || (ratio - 1.0).abs() < 0.4, "{own:?}");
        }
    }
}

/// At its stop a compensator leaves the rest: between that of a free one and that of none; the analysis
/// tells how many lenses are there, and what that does to the form.
#[test]
fn compensators_at_their_stops_leave_the_rest() {
    let scene = scene(0, (2, 6));
    let run = |travel: Option<f64>| {
        let across = Perturbation { kind: PerturbationKind::ElementDecenterX, ..MIDDLE };
        let both = |travel: f64| vec![in_lens(MIDDLE, travel), in_lens(across, travel)];
        let compensators = travel.map_or_else(Vec::new, both);
        analysis(&scene, &sheet(ErrorDistribution::NormalCut, &compensators), 40)
    };
    let [free, some, none, absent] = [Some(1.0), Some(0.02), Some(0.0), None].map(run);
    let mean = |found: &ToleranceAnalysis| found.spots[1].mean_rms[0];
    assert!(mean(&free) < mean(&some) && mean(&some) < mean(&none));
    assert_close(mean(&none), mean(&absent), 1e-6 * mean(&absent), "no travel");
    assert!(free.stopped.is_none() && none.stopped.is_none() && absent.stopped.is_none());
    let stopped = some.stopped.unwrap();
    assert!(stopped.share > 0.3, "{stopped:?}");
    for own in &some.travels[1..] {
        assert!(own.form.largest <= 0.02 && own.real.unwrap().largest <= 0.02, "{own:?}");
        assert!(own.form.at_stop > 0.2 && own.real.unwrap().at_stop > 0.2, "{own:?}");
    }
    // The model counts the stops: without them it would be that of free compensators.
    let form = |found: &ToleranceAnalysis| found.spots[1].form_mean_rms;
    let missing = form(&some) - form(&free);
    assert!(stopped.difference[0].abs() < 0.1 * missing, "{stopped:?} {missing}");
}

/// The gap in front of the sensor does what focus does: together they are no more than one of them.
#[test]
fn two_compensators_that_do_the_same_are_one() {
    let scene = scene(0, (2, 6));
    let last = Perturbation::of_surface(PerturbationKind::Thickness, 6);
    let alone = analysis(&scene, &sheet(ErrorDistribution::NormalCut, &[]), 12);
    let twins = sheet(ErrorDistribution::NormalCut, &[in_lens(last, 2.0)]);
    let both = analysis(&scene, &twins, 12);
    let mean = |found: &ToleranceAnalysis| found.spots[1].mean_rms[0];
    assert_close(mean(&both), mean(&alone), 1e-4 * mean(&alone), "mean");
    // A focus that is stuck leaves all of it to its twin.
    let stuck = ToleranceSheet { focus_travel: Some(0.0), ..twins };
    let found = analysis(&scene, &stuck, 12);
    assert_close(mean(&found), mean(&alone), 1e-2 * mean(&alone), "stuck");
    assert_eq!(found.travels[0].real.unwrap().largest, 0.0);
}

/// Lenses and their adjustments do not depend on the number of threads.
#[test]
fn the_same_seed_gives_the_same_adjustments() {
    let scene = scene(0, (2, 4));
    let sheet =
        sheet(ErrorDistribution::Uniform, &[&sensor(0.01)[..], &[in_lens(MIDDLE, 0.1)]].concat());
    let run = || made(&scene, &sheet, 6).iter().flat_map(|l| l.adjustments.clone()).collect();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (many, one): (Vec<f64>, Vec<f64>) = (run(), alone.install(run));
    assert!(many.iter().zip(&one).all(|(a, b)| a.to_bits() == b.to_bits()));
}

const SINGLET: &str = r#"{ "aplanat": 1, "name": "Singlet", "object": "infinity",
  "aperture": {"entrance_pupil_diameter": 10.0},
  "fields": {"kind": "angle", "values": [{"y": 0.0}, {"y": 4.0}]},
  "wavelengths": [{"um": 0.5875618}],
  "surfaces": [
    {"radius": 100, "thickness": 5.0, "glass": {"index": 1.5}, "semi_diameter": 6.0, "stop": true},
    {"radius": -100, "thickness": 98.0, "semi_diameter": 6.0}],
  "tolerances": {"errors": [
    {"kind": "thickness", "first": 0, "half_range": 0.1},
    {"kind": "surface_tilt_x", "first": 1, "half_range": 0.5, "distribution": "uniform"},
    {"kind": "element_tilt_x", "first": 0, "last": 1, "half_range": 1.0}],
    "compensators": [{"kind": "sensor_tilt_x", "travel": 0.4}]} }"#;

/// In the file, as options, in text and JSON; what is wrong is refused by its name.
#[test]
fn compensators_are_read_shown_and_refused() {
    let file = Scratch::with("compensators.json", SINGLET);
    let few = ["tolerance", file.path(), "--samples", "20", "--error", "10%"];
    let text = done(&few, "");
    for word in ["sensor tilt x", "24'", "unlimited", "at stop", "a compensator ends at its stop"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let more = ["--compensator", "element_decenter_y@1-2=0.1", "--compensator", "focus=0.5"];
    let json = done_json(&[&few[..], &more].concat(), "");
    let own = json["compensators"].as_array().unwrap();
    assert_eq!(own.len(), 3);
    assert_eq!((own[0]["kind"].as_str(), own[0]["travel"].as_f64()), (Some("focus"), Some(0.5)));
    assert_eq!(own[1]["kind"], "sensor_tilt_x");
    assert_eq!((own[2]["first"].as_u64(), own[2]["last"].as_u64()), (Some(0), Some(1)));
    assert!(own[1]["real"]["largest"].as_f64().unwrap() <= 0.4_f64.to_radians());
    assert!(json["stopped"]["share"].as_f64().unwrap() > 0.0);
    for (option, words) in [
        ("index@1=0.1", "expected KIND=TRAVEL"),
        ("sensor_tilt_x@1=0.1", "expected sensor_tilt_x=TRAVEL"),
        (
            "thickness@9=0.1",
            "error: --compensator: the compensator `thickness` names surfaces 9 to 9",
        ),
        ("thickness@1-2=0.1", "expected one of 1 to 2"),
        ("focus=-1", "travel of the focus"),
        ("thickness@1=-1", "travel of the compensator"),
    ] {
        refused(2, &[&few[..], &["--compensator", option]].concat(), "", &[words]);
    }
    for (from, to, words) in [
        (r#""sensor_tilt_x""#, r#""curvature""#, "curvature"),
        (r#""travel""#, r#""play""#, "play"),
    ] {
        let wrong = Scratch::with("wrong_compensators.json", &SINGLET.replace(from, to));
        refused(2, &["tolerance", wrong.path(), "--samples", "2"], "", &[words]);
    }
    let twice = r#"0.4}, {"kind": "sensor_tilt_x", "travel": 0.1}"#;
    let wrong = Scratch::with("twice.json", &SINGLET.replace("0.4}", twice));
    refused(2, &["tolerance", wrong.path(), "--samples", "2"], "", &["twice"]);
}
