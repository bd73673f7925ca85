//! Images of a point in the light of several wavelengths, and at each of them.

use crate::cli::{done, done_json, refused};
use aplanat::analysis::{
    EncircledRequest, ImageLight, encircled_energy, encircled_energy_unless, point_spread,
    point_spread_unless, strehl_unless, wavefront,
};
use aplanat::files;
use aplanat::pupil::{Accuracy, RayModel};

const ACHROMAT: &str = "lenses/achromat_ac254_100.json";

fn achromat() -> RayModel {
    let text = std::fs::read_to_string(ACHROMAT).unwrap();
    RayModel::from_lens(&files::json::read(&text, ACHROMAT).unwrap(), 0).unwrap()
}

fn never() -> bool {
    false
}

/// Circles in all light hold the mean of what those of each wavelength hold about the same point; a circle that is
/// looked for holds its share; and the share of a tiny circle over that without aberrations is the Strehl ratio.
#[test]
fn circles_and_points_in_all_light_are_sums_of_those_of_each_wavelength() {
    let model = achromat();
    let field = model.fields[1];
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let radii = [1e-5, 0.004, 0.03];
    let request = EncircledRequest { center: [0.0; 2], radii: &radii, shares: &[0.5, 0.999] };
    let image = (ImageLight::All, request);
    let found = encircled_energy_unless(&model, field, image, accuracy, &never).unwrap();
    let chief = |w: usize| point_spread(&model, field, w, &[], accuracy).unwrap().center;
    let origin = chief(model.primary);
    let weights: f64 = model.channels.iter().map(|channel| channel.weight).sum();
    let mut mean = [0.0; 3];
    for (w, channel) in model.channels.iter().enumerate() {
        let own = chief(w);
        let center = [origin[0] - own[0], origin[1] - own[1]];
        let shares = encircled_energy(&model, field, w, center, &radii, accuracy).unwrap();
        (0..3).for_each(|k| mean[k] += channel.weight / weights * shares[k].value);
    }
    // Lateral colour is seen.
    let blue = chief(0);
    assert!((blue[1] - origin[1]).abs() > 1e-5, "{blue:?} {origin:?}");
    for (k, mean) in mean.into_iter().enumerate() {
        assert!((found.energy[k].value - mean).abs() < 1e-9, "{k}: {found:?} {mean}");
    }
    assert!(found.energy[2].value < 0.999 && found.share_radii[1].is_none(), "{found:?}");
    let half = found.share_radii[0].unwrap();
    let request = EncircledRequest { center: [0.0; 2], radii: &[half.value], shares: &[] };
    let there =
        encircled_energy_unless(&model, field, (ImageLight::All, request), accuracy, &never);
    assert!((there.unwrap().energy[0].value - 0.5).abs() < 2e-4, "{half:?}");
    let spread = point_spread_unless(&model, field, (ImageLight::All, &[]), accuracy, &never);
    let at_chief = spread.unwrap().strehl;
    let ratio = found.energy[0].value / found.perfect[0].value;
    assert!((at_chief.value - ratio).abs() < 1e-3 * ratio, "{at_chief:?} {ratio}");
    let strehl = strehl_unless(&model, field, ImageLight::All, accuracy, &never).unwrap();
    assert!((strehl.at_chief.value - at_chief.value).abs() < 1e-4, "{strehl:?}");
    assert!(strehl.best.value >= strehl.at_chief.value && !strehl.is_brightest, "{strehl:?}");
}

/// A wavelength is chosen by its micrometres, and the result is that of the library there.
#[test]
fn a_wavefront_is_that_of_the_wavelength_asked_for() {
    let model = achromat();
    let exact = |w: usize| wavefront(&model, model.fields[0], w, Accuracy::default()).unwrap().rms;
    let asked = |more: &[&str]| {
        let arguments = ["analyze", ACHROMAT, "wavefront", "--field=0", "--pupil=0,0.5"];
        done_json(&[&arguments[..], more].concat(), "")
    };
    let (blue, primary) = (asked(&["--wavelength=0.4861"]), asked(&[]));
    assert_eq!(blue["wavelength_um"], 0.486_132_7);
    for (found, w) in [(blue, 0), (primary, model.primary)] {
        let rms = found["fields"][0]["rms"]["value"].as_f64().unwrap();
        assert!((rms - exact(w).value).abs() < 1e-3 * rms, "{found}");
    }
    let apart = (exact(0).value - exact(model.primary).value).abs();
    assert!(apart > 0.02, "{apart}");
    let other = ["analyze", ACHROMAT, "zernike", "--wavelength=0.9"];
    refused(2, &other, "", &["--wavelength: found 0.9; expected one of 0.4861327, 0.5875618"]);
    let all = ["analyze", ACHROMAT, "wavefront", "--wavelength=all"];
    refused(2, &all, "", &["--wavelength: found all; expected one wavelength"]);
    let word = ["analyze", ACHROMAT, "psf", "--wavelength=red"];
    refused(2, &word, "", &["expected a wavelength in um"]);
}

/// The circles of half and of four fifths of the light are reported in text, JSON and CSV, in one and in all light.
#[test]
fn the_radii_of_shares_are_reported() {
    let csv = crate::cli::Scratch::new("encircled.csv");
    let asked = ["analyze", ACHROMAT, "encircled-energy", "--field=0", "--error=1%"];
    let all = [&asked[..], &["--wavelength=all", "--csv", csv.path()]].concat();
    let found = &done_json(&all, "")["fields"][0];
    let radius = |key: &str| found[key]["value"].as_f64().unwrap();
    assert!(radius("radius_50") > 0.0 && radius("radius_80") > radius("radius_50"), "{found}");
    let rows = std::fs::read_to_string(csv.path()).unwrap();
    assert!(
        rows.contains("radius_80.value,") && rows.contains("circles.9.perfect.value,"),
        "{rows}"
    );
    let text = done(&asked, "");
    assert!(
        text.contains("radius of 50 %, mm") && text.contains("--wavelength all sums"),
        "{text}"
    );
    // The largest circle holds nearly all light.
    let last = found["circles"][9]["energy"]["value"].as_f64().unwrap();
    assert!(last > 0.95, "{found}");
}

/// An option that an analysis does not read is refused by name.
#[test]
fn options_without_effect_are_refused() {
    for (what, option, readers) in [
        ("spot", "--frequencies=10", "mtf"),
        ("mtf", "--radii=0.01", "encircled-energy"),
        ("seidel", "--field=0", "spot"),
        ("fan", "--wavelength=0.5876", "wavefront"),
        ("spot", "--coating=v", "ghosts"),
    ] {
        let name = option.split('=').next().unwrap();
        let words = [&format!("{name}: has no effect on {what}; expected it with"), readers];
        refused(2, &["analyze", ACHROMAT, what, option], "", &words);
    }
}

/// The secondary mirror shades the middle of the primary one of a Ritchey-Chretien telescope, and holds its beams.
#[test]
fn the_telescope_has_the_shadow_of_its_secondary_mirror() {
    let file = "lenses/telescope_rc_f8.json";
    let lens = files::json::read(&std::fs::read_to_string(file).unwrap(), file).unwrap();
    let [primary, secondary] = &lens.surfaces[..] else {
        panic!("{} surfaces", lens.surfaces.len())
    };
    let shadow = primary.obstruction.unwrap();
    assert_eq!(Some(shadow), secondary.semi_diameter);
    // First-order heights at the secondary mirror: the primary one is the stop.
    let distance = primary.thickness.abs();
    let marginal = 1981.2 * (1.0 - distance * 2.0 * primary.curvature.abs());
    let chief = distance * 0.2f64.to_radians().tan();
    assert!(marginal + chief < shadow && shadow < 1.02 * (marginal + chief), "{marginal} {chief}");
    let spot = done_json(&["analyze", file, "spot", "--field=0", "--error=1%"], "");
    let lit = spot["fields"][0]["colors"][0]["lit_area"]["value"].as_f64().unwrap();
    let expected = std::f64::consts::PI * (1.0 - (shadow / 1981.2).powi(2));
    assert!((lit - expected).abs() < 1e-3 * expected, "{lit} {expected}");
}
