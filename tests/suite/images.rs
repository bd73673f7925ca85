//! Illumination, wavefronts, point spread and contrast against `images.json`.

use crate::reference::{Worst, number, read};
use aplanat::analysis::{
    energy_irradiance, geometric_mtf, illumination, path_differences, wavefront,
};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::measure::{ImageLens, measure_images};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::sync::LazyLock;

pub(crate) const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, max_rays: 400_000 };

/// The file of exact answers.
pub(crate) fn image_file() -> &'static Value {
    static FILE: LazyLock<Value> = LazyLock::new(|| read("images.json"));
    &FILE
}

pub(crate) fn image_lenses() -> Vec<ImageLens<'static>> {
    ImageLens::read_all(image_file()).unwrap()
}

/// The lens of the file with a name.
pub(crate) fn image_lens(id: &str) -> ImageLens<'static> {
    image_lenses().into_iter().find(|lens| lens.id() == id).unwrap()
}

pub(crate) fn on_y(y: f64) -> FieldPoint {
    FieldPoint { x: 0.0, y, weight: 1.0 }
}

/// All numbers of some kinds, each within its bound.
#[track_caller]
fn compare(kinds: &[(&str, usize)]) {
    let only: Vec<String> = kinds.iter().map(|(kind, _)| (*kind).to_owned()).collect();
    let found = measure_images(image_file(), &only, |_, _| ControlFlow::Continue(())).unwrap();
    let numbers: Vec<_> = found.iter().map(|answers| (answers.kind, answers.numbers)).collect();
    assert_eq!(numbers, kinds);
    for answers in found {
        println!("{answers:?}");
        assert!(answers.kept && answers.difference.is_some(), "{answers:?}");
    }
}

#[test]
fn pupils_of_the_books() {
    compare(&[
        ("airy-disc", 44),
        ("ring", 48),
        ("defocus", 48),
        ("aberrated-disc", 171),
        ("other-pupils", 37),
    ]);
}

#[test]
fn coatings_photons_sensors_and_blur() {
    compare(&[("coating", 156), ("photons", 7), ("sensor", 60), ("blur", 10)]);
}

#[test]
fn single_rays_and_path_differences_of_lenses() {
    compare(&[("first-order", 16), ("paths", 1267)]);
}

#[test]
fn wavefronts_of_lenses() {
    compare(&[("wavefront", 24), ("zernike", 148)]);
}

#[test]
fn point_spread_of_lenses() {
    compare(&[("psf", 40)]);
}

#[test]
fn distortion_and_light_of_lenses() {
    compare(&[("distortion", 228), ("illumination", 50)]);
}

#[test]
fn ghosts_and_their_rays() {
    compare(&[("ghosts", 588), ("ghost-rays", 300)]);
}

/// A wrong number breaks the bound of its kind and of no other; one that is no number is refused by its place.
#[test]
fn a_wrong_answer_is_told() {
    let mut file = image_file().clone();
    let only = ["photons", "blur"].map(str::to_owned);
    let compare = |file: &Value| measure_images(file, &only, |_, _| ControlFlow::Continue(()));
    file["photons"][1]["photons"] = json!("1181.8");
    let found = compare(&file).unwrap();
    assert_eq!([found[0].kept, found[1].kept], [false, true]);
    assert_eq!(found[0].place, "photons[1].photons");
    file["photons"][1]["photons"] = json!("many");
    let told = compare(&file).unwrap_err().to_string();
    assert_eq!(told, "photons[1].photons: expected a number");
    file["photons"] = json!([]);
    file["black_body_photon_radiance"] = json!([]);
    assert!(!compare(&file).unwrap()[0].kept, "no number says nothing");
}

/// The energy of the field element knows nothing of rays backwards.
#[test]
fn the_irradiance_is_that_of_the_energy_of_the_field() {
    let mut compared = 0;
    for (k, lens) in image_lenses().iter().enumerate() {
        let mut worst = Worst::default();
        for exact in image_file()["lenses"][k]["irradiance"].as_array().unwrap() {
            let field = on_y(number(&exact["field_deg"]));
            let model = RayModel { fields: vec![field], ..lens.model(true).unwrap() };
            let w = lens.primary();
            let light = illumination(&model, w, ACCURACY)[0].irradiance.value;
            let accuracy = Accuracy { tolerance: 1e-8, ..ACCURACY };
            let energy = energy_irradiance(&model, field, w, accuracy).unwrap().value;
            worst.note(energy, light, 1.5e-3 * light, field.y.to_string());
        }
        compared += worst.check(&format!("energy {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 10);
}

/// A thin achromat with its stop in the front focal plane.
fn telecentric(front: f64) -> RayModel {
    let glass = |curvature, thickness, index| Surface {
        shape: Shape::Sphere { curvature },
        ..Surface::plane(thickness, index)
    };
    let surfaces = vec![
        Surface::plane(front, 1.0),
        glass(1.0 / 62.8, 4.0, 1.5168),
        glass(-1.0 / 45.7, 2.5, 1.6727),
        glass(-1.0 / 128.2, 97.1, 1.0),
        Surface::plane(0.0, 1.0),
    ];
    let system = System { index_before: 1.0, surfaces, stop: Some(0) };
    let aperture = Aperture::EntrancePupilDiameter(20.0);
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: 1.0 };
    RayModel::from_systems(vec![(0.5875618, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
}

#[test]
fn an_exit_pupil_at_infinity_is_the_limit_of_far_ones() {
    let focal = -telecentric(0.0).first_order.ffl.unwrap();
    let points = [[0.0, 1.0], [0.0, -1.0], [0.6, 0.5]];
    let at = |front: f64| {
        let model = telecentric(front);
        let pupil = model.first_order.exit_pupil.position;
        let found = path_differences(&model, on_y(1.0), 0, &points).unwrap();
        (pupil, found.into_iter().map(Result::unwrap).collect::<Vec<_>>())
    };
    // Through 1e9 mm: the front focal distance is not a round number.
    let (far, exact) = at(focal + 1e-5);
    assert!(far.is_none_or(|z| z.abs() > 1e8), "{far:?}");
    let mut model = telecentric(focal);
    model.first_order.exit_pupil.position = None;
    let found = path_differences(&model, on_y(1.0), 0, &points).unwrap();
    for (found, exact) in found.into_iter().map(Result::unwrap).zip(exact) {
        assert!((found - exact).abs() < 1e-6, "{found} {exact}");
    }
}

#[test]
fn a_ray_that_misses_the_reference_sphere_says_so() {
    let mut model = image_lens("double_gauss_rudolph_50").model(false).unwrap();
    let last = model.channels[0].system.surfaces.len() - 2;
    let image = model.channels[0].system.surfaces[last].thickness;
    // An exit pupil a tenth of a millimetre from the image, with errors of several tenths.
    let chief = aplanat::analysis::distortion(&model, on_y(24.0), model.primary).unwrap().height;
    model.first_order.exit_pupil.position = Some(image - 1e-3);
    let far = path_differences(&model, on_y(24.0), model.primary, &[[0.0, 0.9]]).unwrap();
    assert!(far[0].is_ok(), "a sphere of {chief} mm is met");
    let found = path_differences(&model, on_y(0.0), model.primary, &[[0.0, 0.9]]).unwrap();
    assert_eq!(found[0], Err(aplanat::analysis::PathError::MissesSphere));
    // The wavefront takes another sphere, and says so.
    let found = wavefront(&model, on_y(0.0), model.primary, Accuracy::default()).unwrap();
    assert!(matches!(found.reference, aplanat::analysis::ReferenceForm::Replaced(_)));
    assert!(found.rms.value.is_finite() && found.missed == 0.0, "{found:?}");
}

#[test]
fn rays_aimed_at_the_stop_weigh_the_arriving_beam() {
    // The spot of a beam does not depend on how its rays are named.
    let paraxial = image_lens("double_gauss_nikkor_s_50").model(true).unwrap();
    let stop = RayModel { aiming: Aiming::Stop, ..paraxial.clone() };
    let paraxial = RayModel { fields: vec![on_y(16.0)], ..paraxial };
    let accuracy = Accuracy { tolerance: 1e-8, ..ACCURACY };
    let spot = |model: &RayModel| {
        let found = aplanat::analysis::spot(model, on_y(16.0), accuracy).unwrap();
        found.channels[1].unwrap().rms.value
    };
    let (exact, found) = (spot(&paraxial), spot(&stop));
    assert!((found / exact - 1.0).abs() < 1e-6, "{found} {exact}");
    let alike = RayModel { measure: aplanat::pupil::PupilMeasure::Coordinates, ..stop };
    assert!((spot(&alike) / exact - 1.0).abs() > 1e-4);
    let nu = [10.0];
    let at = |model: &RayModel| geometric_mtf(model, on_y(16.0), 1, &nu, accuracy).unwrap();
    let (exact, found) = (
        at(&paraxial).points[0].tangential,
        at(&RayModel { measure: aplanat::pupil::PupilMeasure::ArrivingBeam, ..alike }).points[0]
            .tangential,
    );
    assert!((found.modulus.value - exact.modulus.value).abs() < 1e-6, "{found:?} {exact:?}");
}
