//! Lateral and axial colour, longitudinal aberration and footprints, against what is known of them otherwise.

use crate::cli::{done_json, refused};
use crate::pictures::bundled;
use aplanat::analysis::{footprint, lateral_color, longitudinal_aberration};
use aplanat::lens::FieldPoint;
use aplanat::paraxial::{Beam, first_order};
use aplanat::pupil::RayModel;

fn field(y: f64) -> FieldPoint {
    FieldPoint { x: 0.0, y, weight: 1.0 }
}

#[test]
fn axial_colour_is_that_of_the_paraxial_images() {
    let lens = bundled("achromat_ac254_100");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let found = longitudinal_aberration(&model, 8).unwrap();
    let focus = |um: f64| {
        let system = lens.resolve(0, um).unwrap();
        first_order(&system, &Beam::for_lens(&lens, 0)).unwrap().image_defocus.unwrap()
    };
    for color in &found {
        // The image plane lies `image_defocus` behind the focus.
        let exact = -focus(model.channels[color.wavelength].um);
        let middle = color.zones[0].focus.unwrap();
        assert!((middle - exact).abs() < 1e-9, "{color:?} {exact}");
        // Spherical aberration grows with the square of the zone, and is small in the first one.
        let [inner, outer] = [1, 8].map(|zone| color.zones[zone].focus.unwrap() - middle);
        assert!(inner.abs() < outer.abs() / 10.0 && color.zones[8].error < 1e-9, "{color:?}");
    }
}

#[test]
fn lateral_colour_is_nothing_on_the_axis_and_at_the_primary_wavelength() {
    let model = RayModel::from_lens(&bundled("double_gauss_nikkor_s_50"), 0).unwrap();
    let on_axis = lateral_color(&model, field(0.0)).unwrap();
    assert!(on_axis.iter().all(|color| color.shift == [0.0, 0.0]));
    let off_axis = lateral_color(&model, field(16.0)).unwrap();
    for color in &off_axis {
        assert_eq!(color.shift[0], 0.0);
        assert_eq!(color.shift[1] == 0.0, color.wavelength == model.primary, "{color:?}");
    }
    let mirrored = lateral_color(&model, field(-16.0)).unwrap();
    for (a, b) in off_axis.iter().zip(&mirrored) {
        assert!((a.shift[1] + b.shift[1]).abs() < 1e-9, "{a:?} {b:?}");
    }
}

#[test]
fn the_beam_on_the_axis_fills_the_stop() {
    let model = RayModel::from_lens(&bundled("double_gauss_rudolph_50"), 0).unwrap();
    let found = footprint(&model, field(0.0), model.primary, model.stop(), 36).unwrap();
    assert_eq!(found.outline.len(), 36);
    assert!((found.reach / model.stop_radius() - 1.0).abs() < 1e-6, "{found:?}");
    for [x, y] in &found.outline {
        assert!((x.hypot(*y) / found.reach - 1.0).abs() < 1e-6);
    }
    // No point lies outside the rim.
    for surface in 0..model.channels[model.primary].system.surfaces.len() - 1 {
        let found = footprint(&model, field(17.0), model.primary, surface, 24).unwrap();
        let rim = found.semi_diameter.unwrap_or(f64::INFINITY);
        assert!(found.reach <= rim * (1.0 + 1e-6), "{surface}: {} {rim}", found.reach);
    }
}

#[test]
fn they_are_printed() {
    let lens = "lenses/double_gauss_rudolph_50.json";
    for (what, key) in
        [("lateral-color", "colors"), ("longitudinal", "colors"), ("footprint", "outline")]
    {
        let report = done_json(&["analyze", lens, what], "");
        let first = &report["fields"][0];
        assert!(!first[key].as_array().unwrap().is_empty(), "{what}: {first}");
    }
    refused(2, &["analyze", lens, "footprint", "--surface", "99"], "", &["--surface", "99"]);
}
