//! The edge of a pupil that errors of making move: derivatives against lenses that are written with
//! their errors, opened, and judged by pupils found anew.

use aplanat::lens::{
    Aperture, ErrorDistribution, FieldPoint, Lens, Perturbation, PerturbationKind, Tolerance,
    ToleranceSheet,
};
use aplanat::pupil::{RayModel, Region};
use aplanat::tolerance::{
    ErrorModel, PupilTreatment, RealLens, SecondDerivatives, ToleranceScene, made_lens,
};

/// A lens at its primary wavelength, with a stop of fixed size and fields on both sides, one of which
/// weighs little, so that errors across the axis have first derivatives.
fn lens(name: &str, field: f64) -> Lens {
    let mut lens = aplanat::files::open(format!("lenses/{name}.json")).unwrap().lens;
    let radius = RayModel::from_lens(&lens, 0).unwrap().stop_radius();
    lens.aperture = Aperture::StopSemiDiameter(radius);
    let primary = lens.primary();
    lens.wavelengths.swap(0, primary);
    lens.wavelengths.truncate(1);
    (lens.wavelengths[0].primary, lens.wavelengths[0].weight) = (true, 1.0);
    let point = |y: f64, weight: f64| FieldPoint { x: 0.0, y, weight };
    lens.fields.values = vec![point(field, 1.0), point(-field, 0.2)];
    lens.tolerances = None;
    lens
}

/// The mean square spot at the image plane in mm², with the pupils of the lens as it is.
fn mean_square(lens: &Lens) -> f64 {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let (mut sum, mut weights) = (0.0, 0.0);
    for field in &model.fields {
        let region = Region::new(model.launch(*field, 0).unwrap());
        let moments = region.moments(&region.nodes(9));
        sum += field.weight * moments.spread / moments.area;
        weights += field.weight;
    }
    sum / weights
}

fn sheet(errors: Vec<Perturbation>) -> ToleranceSheet {
    let distribution = ErrorDistribution::Normal;
    let of = |error| Tolerance { error, half_range: 1e-9, distribution };
    ToleranceSheet::of_errors(errors.into_iter().map(of).collect())
}

/// The lens with one error, as a lens of its own at the fixed image plane.
fn made(lens: &Lens, scene: &ToleranceScene, error: Perturbation, value: f64) -> Lens {
    let mut sheet = sheet(vec![error]);
    sheet.focus_travel = Some(0.0);
    let real = RealLens {
        errors: vec![value],
        mean_square: Some([0.0; 2]),
        adjustments: vec![0.0],
        clipped: None,
    };
    made_lens((lens, 0), scene, &sheet, &real).unwrap()
}

/// For an error the first and the second derivative of the mean square by differences.
fn differences(lens: &Lens, scene: &ToleranceScene, error: Perturbation, step: f64) -> [f64; 2] {
    let at = |value: f64| mean_square(&made(lens, scene, error, value));
    let [low, middle, high] = [-step, 0.0, step].map(at);
    [(high - low) / (2.0 * step), (high - 2.0 * middle + low) / (step * step)]
}

/// The derivatives of the form with the motion of the edge, whether it is taken or not.
fn derivatives(scene: &ToleranceScene, errors: &[Perturbation]) -> Vec<[f64; 2]> {
    let mut sheet = sheet(errors.to_vec());
    sheet.errors.iter_mut().for_each(|own| own.half_range = 1.0);
    let model = ErrorModel::new(scene, &sheet, SecondDerivatives::Traced, &|| false).unwrap();
    assert!(model.pupils.moves || matches!(scene.pupils, PupilTreatment::Held(_)));
    let form = &model.forms[0];
    (0..errors.len()).map(|i| [form.first[i], form.second.of(i, i)]).collect()
}

fn errors_of(first: usize, last: usize) -> Vec<(Perturbation, f64)> {
    use PerturbationKind::{
        AsphereSlope, Curvature, ElementDecenterX, ElementDecenterY, ElementTiltX, Index,
        Irregularity, SurfaceDecenterY, SurfaceTiltX, Thickness,
    };
    let alone = |kind| Perturbation::of_surface(kind, first);
    let body = |kind| Perturbation { kind, first, last };
    vec![
        (alone(Curvature), 1e-6),
        (alone(Thickness), 1e-3),
        (alone(Index), 1e-5),
        (alone(Irregularity), 1e-5),
        (alone(AsphereSlope), 1e-5),
        (alone(SurfaceDecenterY), 1e-3),
        (alone(SurfaceTiltX), 1e-5),
        (body(ElementDecenterX), 1e-3),
        (body(ElementDecenterY), 1e-3),
        (body(ElementTiltX), 1e-5),
    ]
}

/// Rims that clip the beam of a triplet on both sides: every error in front of a rim, or of the element
/// that has it, moves the edge.
#[test]
fn the_derivative_knows_the_pupil_that_a_decentred_rim_moves() {
    let mut triplet = lens("cooke_triplet_100_f27", 8.0);
    let heights = [0, triplet.surfaces.len() - 2];
    let model = RayModel::from_lens(&triplet, 0).unwrap();
    let stop = model.stop_radius();
    for surface in heights {
        triplet.surfaces[surface].semi_diameter = Some(1.25 * stop);
    }
    let scene = ToleranceScene::new(&triplet, 0, 1e-7).unwrap();
    assert!(matches!(scene.pupils, PupilTreatment::Known(_)), "{:?}", scene.pupils);
    let errors = errors_of(0, 1);
    let kinds: Vec<Perturbation> = errors.iter().map(|(error, _)| *error).collect();
    let moving = derivatives(&scene, &kinds);
    let held = derivatives(&scene.clone().with_held_pupils(), &kinds);
    for (i, (error, step)) in errors.into_iter().enumerate() {
        let found = differences(&triplet, &scene, error, step);
        agrees(error, found, (moving[i], held[i]), 0.05);
    }
}

/// The first derivatives are exact but for the sampling, the second ones but for a share of what held pupils
/// miss.
fn agrees(error: Perturbation, found: [f64; 2], (moving, held): ([f64; 2], [f64; 2]), share: f64) {
    let apart = |of: [f64; 2], i: usize| (of[i] - found[i]).abs();
    let text = format!("{error:?}: differences {found:?}, moving {moving:?}, held {held:?}");
    let first = 0.1 * apart(held, 0) + 2e-6 * found[0].abs() + 1e-12;
    assert!(apart(moving, 0) < first, "{text}");
    assert!(apart(moving, 1) < share * apart(held, 1) + 1e-5 * found[1].abs(), "{text}");
}

/// The aspheres of a phone camera, whose stop is in front of all glass or among it.
#[test]
fn the_derivative_knows_the_moving_pupil_of_a_phone_camera() {
    let phone = lens("phone_us7558005_1", 20.0);
    let scene = ToleranceScene::new(&phone, 0, 1e-6).unwrap();
    let (first, last) = (0..phone.surfaces.len()).find_map(|i| phone.element_around(i)).unwrap();
    let errors = errors_of(first, last).into_iter().map(|(error, step)| (error, 0.1 * step));
    let errors: Vec<(Perturbation, f64)> = errors.skip(4).step_by(2).collect();
    let kinds: Vec<Perturbation> = errors.iter().map(|(error, _)| *error).collect();
    let moving = derivatives(&scene, &kinds);
    let held = derivatives(&scene.clone().with_held_pupils(), &kinds);
    for (i, (error, step)) in errors.into_iter().enumerate() {
        let found = differences(&phone, &scene, error, step);
        agrees(error, found, (moving[i], held[i]), 0.05);
    }
}
