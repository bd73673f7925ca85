//! Images in other planes than that of the sensor, in none at all, and the errors of numbers that need many rays.

use crate::cli::{Scratch, done, done_json, refused};
use crate::drag::bundled;
use aplanat::analysis::{
    AnalysisError, ImageLight, ZernikeOrder, diffraction_mtf, encircled_energy, point_spread,
    strehl, strehl_unless, through_focus_mtf, zernike,
};
use aplanat::files::json;
use aplanat::lens::{FieldPoint, Lens};
use aplanat::pupil::{Accuracy, RayModel};

fn at(tolerance: f64) -> Accuracy {
    Accuracy { tolerance, ..Accuracy::default() }
}

/// The contrast in a displaced plane is that of the lens whose last gap is longer by the displacement, though the
/// pupils of both are seen from other points: within the sum of both errors, of which the change on doubling the
/// reference sphere is but half of that to an infinite one.
#[test]
fn contrast_through_focus_is_that_of_a_lens_with_another_last_gap() {
    for (name, y) in [("wide_nikkor_28_f28", 37.65), ("double_gauss_rudolph_50", 10.0)] {
        let lens = bundled(name);
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let field = FieldPoint { x: 0.0, y, weight: 1.0 };
        let shifts = [-0.2, 0.0, 0.13375, 0.2675];
        let found =
            through_focus_mtf(&model, field, model.primary, 10.0, &shifts, at(1e-5)).unwrap();
        for (shift, point) in shifts.iter().zip(found) {
            let mut other = lens.clone();
            let last = other.surfaces.len() - 1;
            other.surfaces[last].thickness += shift;
            let model = RayModel::from_lens(&other, 0).unwrap();
            let curve = diffraction_mtf(&model, field, model.primary, &[10.0], at(1e-5)).unwrap();
            let pairs = [
                (point.tangential, curve.points[0].tangential),
                (point.sagittal, curve.points[0].sagittal),
            ];
            for (own, other) in pairs {
                let apart = (own.modulus.value - other.modulus.value).abs();
                let error = own.modulus.error + other.modulus.error;
                assert!(apart <= 2.0 * error + 1e-6, "{name} {shift}: {own:?} {other:?}");
                assert!(error < 2e-2, "{name} {shift}: {error}");
            }
        }
    }
    let model = RayModel::from_lens(&bundled("double_gauss_rudolph_50"), 0).unwrap();
    let axis = model.fields[0];
    let shifts = [-1e4, 0.0];
    let through =
        |shifts: &[f64]| through_focus_mtf(&model, axis, model.primary, 10.0, shifts, at(1e-3));
    assert_eq!(through(&shifts[..1]).err(), Some(AnalysisError::BeyondPupil));
    let near = through(&shifts).unwrap();
    assert_eq!(near.iter().map(|point| point.frequency).collect::<Vec<_>>(), [0.0]);
    let lens = "lenses/double_gauss_rudolph_50.json";
    let zero = ["analyze", lens, "through-focus-mtf", "--frequencies", "0"];
    refused(2, &zero, "", &["--frequencies", "above zero"]);
}

/// A paraxial lens of 100 mm at f/10.
fn perfect(gap: f64) -> Lens {
    let text = format!(
        r#"{{"aplanat": 1, "name": "perfect", "object": "infinity", "aperture": {{"entrance_pupil_diameter": 10}},
        "fields": {{"kind": "angle", "values": [{{"y": 0}}]}}, "wavelengths": [{{"um": 0.5, "primary": true}}],
        "surfaces": [{{"ideal": {{"lens": {{"focal_length": 100}}}}, "thickness": {gap}, "semi_diameter": 5,
        "stop": true}}]}}"#
    );
    json::read(&text, "perfect").unwrap()
}

#[test]
fn the_best_focus_is_the_focal_plane_however_far_the_sensor_is() {
    for gap in [98.5, 100.4, 101.2] {
        let model = RayModel::from_lens(&perfect(gap), 0).unwrap();
        let found = strehl(&model, model.fields[0], model.primary, at(1e-6)).unwrap();
        let [x, y, z] = found.best_at;
        assert!((z - (100.0 - gap)).abs() < 1e-4, "{gap}: {z}");
        assert!(x.hypot(y) < 1e-9 && (found.best.value - 1.0).abs() < 1e-3, "{found:?}");
        let all = ImageLight::All;
        let all = strehl_unless(&model, model.fields[0], all, at(1e-6), &|| false).unwrap().best_at;
        assert!((all[2] - z).abs() < 1e-9, "{all:?}");
    }
}

/// Two confocal paraboloids.
const KEPLER: &str = r#"{"aplanat": 1, "name": "Kepler", "object": "infinity",
    "aperture": {"entrance_pupil_diameter": 10},
    "fields": {"kind": "angle", "values": [{"y": 0}, {"y": 1}]}, "wavelengths": [{"um": 0.55, "primary": true}],
    "surfaces": [{"curvature": -0.0005, "conic": -1, "thickness": -1250, "glass": "mirror", "semi_diameter": 5,
                  "stop": true},
                 {"curvature": 0.002, "conic": -1, "thickness": 100, "glass": "mirror", "semi_diameter": 30}]}"#;

#[test]
fn an_afocal_lens_has_no_image_by_diffraction() {
    let lens = json::read(KEPLER, "Kepler").unwrap();
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let refused = Some(AnalysisError::Afocal);
    for field in &model.fields {
        let (field, color) = (*field, model.primary);
        let accuracy = Accuracy::default();
        assert_eq!(diffraction_mtf(&model, field, color, &[0.05], accuracy).err(), refused);
        assert_eq!(through_focus_mtf(&model, field, color, 0.05, &[0.0], accuracy).err(), refused);
        assert_eq!(point_spread(&model, field, color, &[[0.0; 2]], accuracy).err(), refused);
        assert_eq!(strehl(&model, field, color, accuracy).err(), refused);
        assert_eq!(
            encircled_energy(&model, field, color, [0.0; 2], &[0.1], accuracy).err(),
            refused
        );
    }
    let file = Scratch::with("kepler.json", KEPLER);
    let text = done(&["analyze", file.path(), "mtf", "--frequencies", "0.05"], "");
    assert!(text.contains("the lens is afocal"), "{text}");
    let text = done(&["analyze", file.path(), "illumination"], "");
    assert!(!text.contains("relative cone"), "{text}");
}

/// Coarse nodes cannot tell polynomials of high degree apart, and their fit is no number whose change is an error.
#[test]
fn coefficients_over_clipped_pupils_are_known_as_well_as_their_rest() {
    let mut checked = 0;
    for name in ["microscope_us5000548_1", "phone_us7558005_1", "double_gauss_nikkor_s_50"] {
        let model = RayModel::from_lens(&bundled(name), 0).unwrap();
        for field in &model.fields {
            for order in [ZernikeOrder::Noll, ZernikeOrder::Fringe] {
                let found = zernike(&model, *field, model.primary, (order, 37), at(1e-3));
                let Ok(found) = found else { continue };
                let errors = found.coefficients.iter().map(|coefficient| coefficient.error);
                let worst = errors.fold(0.0, f64::max);
                assert!(found.reached && worst <= 1e-3, "{name} {field:?}: {worst:e}");
                checked += 1;
            }
        }
    }
    assert!(checked >= 16, "{checked} sums");
}

#[test]
fn a_density_of_rays_follows_its_tolerance_or_says_that_it_does_not() {
    let image = |error: &str| {
        let lens = "lenses/telescope_rc_f8.json";
        done_json(&["analyze", lens, "geometric-psf", "--field", "0", "--error", error], "")
            ["fields"][0]
            .clone()
    };
    let coarse = image("50%");
    assert!(coarse["error"].as_f64().unwrap() <= 0.5 || coarse["reached"] == false, "{coarse}");
    let fine = image("0.1%");
    assert_eq!(fine["reached"], false, "{fine}");
    assert!(fine["error"].as_f64().unwrap() <= coarse["error"].as_f64().unwrap());
}

#[test]
fn a_full_pixel_has_no_signal_to_noise_ratio() {
    let out = std::env::temp_dir().join("aplanat-full.png").display().to_string();
    let lens = "lenses/achromat_ac254_100.json";
    let base = ["picture", lens, "--scene", "white", "--gray", "--pixels", "16x16", "--pitch", "5"];
    let exposed = ["--sensor", "industrial", "--seconds", "0.1", "--error", "10%", "--out", &out];
    let all = [&base[..], &exposed].concat();
    let text = done(&all, "");
    assert!(text.contains("none (saturated) at white"), "{text}");
    let ratios = done_json(&all, "")["sensor"]["signal_to_noise"].clone();
    assert!(ratios[0].is_null() && ratios[2].as_f64().unwrap() > 1.0, "{ratios}");
}

#[test]
fn what_has_no_ghosts_is_named() {
    let telescope = "lenses/telescope_rc_f8.json";
    let what = "surface 1 is a mirror";
    refused(2, &["analyze", telescope, "ghosts", "--coating", "none"], "", &[what]);
}
