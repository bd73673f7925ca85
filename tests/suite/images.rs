//! Illumination, wavefronts, point spread and contrast against `images.json`.

use crate::reference::{Worst, count, number, numbers, read};
use aplanat::analysis::{
    AnalysisError, MtfCurve, energy_irradiance, geometric_mtf, illumination, irradiance,
    path_differences, polychromatic_geometric_mtf, wavefront,
};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use serde_json::Value;

pub(crate) const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, max_rays: 400_000 };

/// A lens of `images.json`.
pub(crate) struct ImageLens {
    data: Value,
}

pub(crate) fn image_lenses() -> Vec<ImageLens> {
    let file = read("images.json");
    file["lenses"].as_array().unwrap().iter().map(|data| ImageLens { data: data.clone() }).collect()
}

fn on_y(y: f64) -> FieldPoint {
    FieldPoint { x: 0.0, y, weight: 1.0 }
}

impl ImageLens {
    pub(crate) fn id(&self) -> &str {
        self.data["id"].as_str().unwrap()
    }

    pub(crate) fn primary(&self) -> usize {
        count(&self.data["primary"])
    }

    /// The lens over the unit disc if no rim clips, else limited by its rims alone.
    pub(crate) fn model(&self, clipped: bool) -> RayModel {
        let waves = numbers(&self.data["wavelengths_um"]);
        let weights = numbers(&self.data["weights"]);
        let systems: Vec<_> =
            (0..waves.len()).map(|w| (waves[w], weights[w], self.system(w, clipped))).collect();
        let stop = count(&self.data["stop_surface"]);
        let aperture = if clipped {
            Aperture::StopSemiDiameter(systems[0].2.surfaces[stop].semi_diameter)
        } else {
            Aperture::EntrancePupilDiameter(number(&self.data["epd"]))
        };
        let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: 30.0 };
        RayModel::from_systems(systems, self.primary(), beam, Aiming::Paraxial).unwrap()
    }

    fn system(&self, wavelength: usize, clipped: bool) -> System<f64> {
        let rows = self.data["surfaces"].as_array().unwrap();
        let surface = |row: &Value| {
            let curvature = row["radius"].as_f64().map_or(0.0, f64::recip);
            let terms = numbers(&row["asphere"]);
            let rim = row["semi_diameter"].as_f64().filter(|_| clipped);
            Surface {
                shape: Shape::new(curvature, number(&row["conic"]), &terms, 0).unwrap(),
                semi_diameter: rim.unwrap_or(f64::INFINITY),
                ..Surface::plane(number(&row["thickness"]), number(&row["n"][wavelength]))
            }
        };
        let mut surfaces: Vec<_> = rows.iter().map(surface).collect();
        surfaces.push(Surface::plane(0.0, 1.0));
        let stop = Some(count(&self.data["stop_surface"]));
        System { index_before: 1.0, surfaces, stop }
    }

    /// Every field with its model.
    pub(crate) fn fields(&self) -> Vec<(Value, RayModel, FieldPoint)> {
        let fields = self.data["fields"].as_array().unwrap();
        let field = |data: &Value| {
            let model = self.model(data["pupil"] == "clip");
            (data.clone(), model, on_y(number(&data["field_deg"])))
        };
        fields.iter().map(field).collect()
    }
}

/// The error allowed of an integral.
pub(crate) fn allowed(err: &Value) -> f64 {
    (10.0 * number(err)).max(1e-9)
}

#[test]
fn the_irradiance_is_that_of_the_directions_at_the_image_point() {
    let mut compared = 0;
    for lens in image_lenses() {
        let mut worst = Worst::default();
        for exact in lens.data["irradiance"].as_array().unwrap() {
            let field = on_y(number(&exact["field_deg"]));
            let model = RayModel { fields: vec![field], ..lens.model(true) };
            let w = lens.primary();
            let light = illumination(&model, w, ACCURACY)[0];
            let place = format!("{} deg", field.y);
            worst.note(light.cone.value, number(&exact["forward_cone"]), 1e-9, &place);
            worst.note(light.point[1], number(&exact["centroid_y"]), 1e-9, &place);
            let at = [0.0, number(&exact["image_y"])];
            let found = irradiance(&model, w, at, ACCURACY).unwrap();
            let solid = number(&exact["backward_projected_solid_angle"]);
            worst.note(found.value, solid, allowed(&exact["backward_err"]), &place);
            // The energy of the field element knows nothing of rays backwards.
            let energy =
                energy_irradiance(&model, field, w, Accuracy { tolerance: 1e-8, ..ACCURACY });
            let (energy, light) = (energy.unwrap().value, light.irradiance.value);
            worst.note(energy, light, 1.5e-3 * light, format!("energy {place}"));
        }
        compared += worst.check(&format!("irradiance {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 40);
}

#[test]
fn the_irradiance_of_a_uniform_scene() {
    let file = read("images.json");
    let lens = image_lenses().into_iter().find(|l| l.id() == file["scene"]["lens"]).unwrap();
    let model = lens.model(true);
    for point in file["scene"]["points"].as_array().unwrap() {
        let at = [number(&point["x"]), number(&point["y"])];
        let found = irradiance(&model, lens.primary(), at, ACCURACY).unwrap();
        let exact = number(&point["uniform"]["value"]);
        assert!((found.value - exact).abs() < 1e-9 * exact, "{found:?} {exact}");
    }
}

#[test]
fn path_differences_of_single_rays() {
    let mut compared = 0;
    for lens in image_lenses() {
        let mut worst = Worst::default();
        for (exact, model, field) in lens.fields() {
            // No rim clips the rays of the table.
            let open = lens.model(false);
            for ray in exact["opd"].as_array().unwrap() {
                if ray["waves"].is_null() {
                    continue;
                }
                let p = [number(&ray["px"]), number(&ray["py"])];
                let got = path_differences(&open, field, lens.primary(), &[p]).unwrap()[0];
                worst.note(got.unwrap(), number(&ray["waves"]), 1e-8, format!("{p:?}"));
            }
            if !exact["opd_rms_waves"].is_null() {
                let got = wavefront(&model, field, lens.primary(), ACCURACY).unwrap();
                for (got, name) in [(got.rms, "opd_rms_waves"), (got.mean, "opd_mean_waves")] {
                    let place = format!("{name} at {} {got:?}", field.y);
                    let tolerance = allowed(&exact[name]["err"]).max(1e-8);
                    worst.note(got.value, number(&exact[name]["value"]), tolerance, place);
                }
            }
        }
        compared += worst.check(&format!("path differences {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 429);
}

/// Compares the contrast of an entry; of a mean over wavelengths, the modulus alone.
fn note_contrast(
    worst: &mut Worst,
    exact: &Value,
    (model, field, primary): (&RayModel, FieldPoint, usize),
    mtf: impl Fn(&RayModel, FieldPoint, usize, &[f64], Accuracy) -> Result<MtfCurve, AnalysisError>,
    is_complex: bool,
) {
    let nu = [number(&exact["frequency"])];
    let point = mtf(model, field, primary, &nu, ACCURACY).unwrap().points[0];
    let tangential = exact["lines"] == "tangential";
    let got = if tangential { point.tangential } else { point.sagittal };
    let tolerance = allowed(&exact["geometric_err"]);
    let place = format!("{} {nu:?} {got:?}", field.y);
    worst.note(got.modulus.value, number(&exact["geometric"]), tolerance, &place);
    if is_complex {
        worst.note(got.re, number(&exact["geometric_re"]), tolerance, &place);
        worst.note(got.im, number(&exact["geometric_im"]), tolerance, &place);
    }
}

#[test]
fn geometric_contrast_is_complex_and_adds_over_wavelengths() {
    let mut compared = 0;
    for lens in image_lenses() {
        let mut worst = Worst::default();
        for (exact, model, field) in lens.fields() {
            let at = (&model, field, lens.primary());
            for exact in exact["mtf"].as_array().into_iter().flatten() {
                note_contrast(&mut worst, exact, at, geometric_mtf, true);
            }
            let mean = |model: &RayModel, field, _, nu: &[f64], accuracy| {
                polychromatic_geometric_mtf(model, field, nu, accuracy)
            };
            for exact in exact["poly"]["mtf"].as_array().into_iter().flatten() {
                note_contrast(&mut worst, exact, at, mean, false);
            }
        }
        compared += worst.check(&format!("geometric contrast {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 87);
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
    let lens = image_lenses().into_iter().find(|l| l.id() == "double_gauss_rudolph_50").unwrap();
    let mut model = lens.model(false);
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
    let lens = image_lenses().into_iter().find(|l| l.id() == "double_gauss_nikkor_s_50").unwrap();
    let paraxial = lens.model(true);
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
