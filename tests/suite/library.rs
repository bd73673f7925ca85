//! Every lens of the library opens, has the focal length that its source states, and round-trips.

use aplanat::files::{self, BundledLens, bundled_lenses, json};
use aplanat::lens::{
    Aperture, Lens, Object, ParameterKind, RotationalProfile, System, add_variables, at_zoom,
};
use aplanat::math::Vec3;
use aplanat::measure::double_gauss;
use aplanat::trace::{Ray, Tracer};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

/// The reference prints six or seven digits, and takes catalogue indices rounded to five.
const DIGITS: f64 = 1e-5;

/// `tests/reference/library.json`.
#[derive(Deserialize)]
struct Table {
    lenses: Vec<Stated>,
}

#[derive(Deserialize)]
struct Stated {
    lens: String,
    efl: Vec<FocalLength>,
    bfl_computed_mm: f64,
}

#[derive(Deserialize)]
struct FocalLength {
    zoom: usize,
    stated_mm: f64,
    computed_mm: f64,
    error_percent: f64,
}

fn table() -> Vec<Stated> {
    let text = std::fs::read_to_string("tests/reference/library.json").unwrap();
    serde_json::from_str::<Table>(&text).unwrap().lenses
}

fn opened(bundled: &BundledLens) -> Lens {
    let name = format!("lenses/{}.json", bundled.name);
    files::open(&name).unwrap_or_else(|error| panic!("{error}")).lens
}

/// Focal length and back focal length of a paraxial ray from infinity.
fn focal_lengths(system: &System<f64>) -> (f64, f64) {
    let (mut n, mut y, mut nu, mut sense) = (system.index_before, 1.0, 0.0, 1.0);
    let (_image, surfaces) = system.surfaces.split_last().unwrap();
    let mut last_height = y;
    for surface in surfaces {
        if surface.mirror {
            sense = -sense;
        }
        let behind = sense * surface.index;
        nu -= y * (behind - n) * surface.shape.curvature();
        n = behind;
        last_height = y;
        if let Some(field) = surface.grin_profile() {
            (y, nu) = through(&field, surface.thickness, y, nu);
            n = sense * field.index(Vec3::new(0.0, 0.0, surface.thickness));
        } else {
            y += surface.thickness * nu / n;
        }
    }
    (-sense / nu, -last_height * n / nu)
}

/// A paraxial ray through a gradient, `dy/dz = p/n` and `dp/dz = y ∂n/∂r / r`, by the classical
/// method of fourth order.
fn through(field: &RotationalProfile<f64>, length: f64, mut y: f64, mut p: f64) -> (f64, f64) {
    const STEPS: u32 = 1000;
    let near = 1e-4;
    let slope = |z: f64, y: f64, p: f64| {
        let [n, beside] = [0.0, near].map(|r| field.index(Vec3::new(0.0, r, z)));
        (p / n, 2.0 * (beside - n) / (near * near) * y)
    };
    let h = length / f64::from(STEPS);
    for i in 0..STEPS {
        let z = f64::from(i) * h;
        let (a, b) = slope(z, y, p);
        let (c, d) = slope(z + 0.5 * h, y + 0.5 * h * a, p + 0.5 * h * b);
        let (e, f) = slope(z + 0.5 * h, y + 0.5 * h * c, p + 0.5 * h * d);
        let (g, k) = slope(z + h, y + h * e, p + h * f);
        y += h / 6.0 * (a + 2.0 * c + 2.0 * e + g);
        p += h / 6.0 * (b + 2.0 * d + 2.0 * f + k);
    }
    (y, p)
}

fn at_primary(lens: &Lens, zoom: usize) -> System<f64> {
    lens.resolve(zoom, lens.wavelengths[lens.primary()].um).unwrap()
}

#[test]
fn the_embedded_lenses_are_those_of_the_folder() {
    let embedded: BTreeSet<String> =
        bundled_lenses().iter().map(|b| format!("{}.json", b.name)).collect();
    let folder: BTreeSet<String> = std::fs::read_dir("lenses")
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| Path::new(name).extension().is_some_and(|end| end == "json"))
        .collect();
    assert_eq!(embedded, folder);
    assert_eq!(embedded.len(), bundled_lenses().len());
    for bundled in bundled_lenses() {
        let text = std::fs::read_to_string(format!("lenses/{}.json", bundled.name)).unwrap();
        assert_eq!(bundled.text, text, "{}: build again", bundled.name);
    }
}

#[test]
fn every_lens_has_its_stated_focal_length() {
    let table = table();
    assert_eq!(table.len(), bundled_lenses().len());
    for bundled in bundled_lenses() {
        let lens = opened(bundled);
        let stated = table.iter().find(|stated| stated.lens == bundled.name).unwrap();
        for position in &stated.efl {
            let (efl, bfl) = focal_lengths(&at_primary(&lens, position.zoom));
            let relative = efl / position.computed_mm - 1.0;
            assert!(relative.abs() < DIGITS, "{}: {efl} mm, {relative:e}", bundled.name);
            let percent = 100.0 * (efl / position.stated_mm - 1.0);
            let off = (percent - position.error_percent).abs();
            assert!(off < 6e-3, "{}: {percent} % from the stated value", bundled.name);
            if position.zoom == 0 {
                let off = (bfl - stated.bfl_computed_mm).abs() / efl.abs();
                assert!(off < DIGITS, "{}: back focus {bfl} mm, off by {off:e}", bundled.name);
            }
        }
    }
}

#[test]
fn every_lens_round_trips() {
    for bundled in bundled_lenses() {
        let lens = opened(bundled);
        let text = json::write(&lens);
        assert_eq!(text, bundled.text, "{}: not in the form in which it is written", bundled.name);
        assert_eq!(json::read(&text, bundled.name).unwrap(), lens, "{}", bundled.name);
        assert!(!lens.source.is_empty(), "{}: no source", bundled.name);
    }
}

/// A ray from the object on the axis that is paraxially at `height` on the first vertex plane.
fn axial_ray(object: Object, height: f64) -> Ray<f64> {
    let point = Vec3::new(0.0, height, 0.0);
    match object {
        Object::Infinity => Ray { point, direction: Vec3::new(0.0, 0.0, 1.0) },
        Object::Finite(distance) => {
            let direction = Vec3::new(0.0, height, distance);
            let length = direction.dot(direction).sqrt();
            Ray { point, direction: direction * (1.0 / length) }
        }
    }
}

/// Half the stated beam on the axis, at the first vertex plane.
fn half_beam(lens: &Lens, zoom: usize) -> f64 {
    let stop = lens.stop().unwrap();
    let system = at_primary(lens, zoom);
    match (lens.aperture_at(zoom), lens.object) {
        (Aperture::FNumber(f), _) => focal_lengths(&system).0.abs() / (4.0 * f),
        (Aperture::ObjectNa(na), Object::Finite(distance)) => 0.5 * na * distance,
        (Aperture::StopSemiDiameter(radius), _) => {
            let narrow = axial_ray(lens.object, 1e-6);
            let at_stop = Tracer::new(&system).unwrap().trace_to(narrow, stop).ray.point.y;
            0.5e-6 * radius / at_stop.abs()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn axial_light_passes_every_lens_at_every_zoom_position() {
    for bundled in bundled_lenses() {
        let lens = opened(bundled);
        for zoom in 0..lens.zoom_positions() {
            let tracer = Tracer::new(&at_primary(&lens, zoom)).unwrap();
            let height = half_beam(&lens, zoom);
            // The shadow of a secondary mirror.
            let shadow = lens.surfaces[0].obstruction.unwrap_or(0.0);
            for step in -8..=8 {
                let at = height * f64::from(step) / 8.0;
                if at.abs() < shadow {
                    continue;
                }
                let landing = tracer.trace(axial_ray(lens.object, at));
                let place = format!("{} at zoom {zoom}, step {step}", bundled.name);
                assert!(landing.fate.is_imaged(), "{place}: {:?}", landing.fate);
                let off = landing.ray.point.y.abs();
                // The macro lens at its close position is not focused at infinity.
                let focused = bundled.name != "macro_micro_nikkor_105_f28" || zoom == 0;
                assert!(!focused || off < 0.1 * height, "{place}: {off} mm from the axis");
            }
        }
    }
}
#[test]
fn a_plane_stop_in_air_is_not_varied() {
    let mut lens = double_gauss();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    assert_eq!(lens.variables.len(), 10 + 11);
    assert!(lens.check().is_ok());
}

#[test]
fn a_zoom_lens_at_a_position_is_that_lens() {
    let zoom = bundled_lenses().iter().find(|b| b.name == "zoom_nikkor_28_80").unwrap();
    let mut lens = json::read(zoom.text, zoom.name).unwrap();
    let um = lens.wavelengths[lens.primary()].um;
    for position in 0..lens.zoom.len() {
        let single = at_zoom(&lens, position);
        assert_eq!(single.resolve(0, um).unwrap(), lens.resolve(position, um).unwrap());
    }
    add_variables(&mut lens, &[ParameterKind::Thicknesses]);
    assert!(lens.check().is_ok());
    let moving = lens.zoom[0].numbers.len() * lens.zoom.len();
    let fixed = lens.surfaces.len() - lens.zoom[0].numbers.len();
    assert_eq!(lens.variables.len(), moving + fixed);
}
