//! What a designer reads, against closed forms: thin lenses, a paraboloid, an ellipsoid that
//! focuses into glass, two mirrors, the cos⁴ law.

mod constraints;
mod drawings;
mod effects;
mod first_order;
mod images;
mod terms;

use crate::aperture::image;
use aplanat::lens::{
    Aperture, FieldKind, FieldPoint, Lens, Medium, Object, Row, Shape, Surface, System, blank,
};
use aplanat::paraxial::Beam;

/// The focal length of the lenses and mirrors here, in mm.
const FOCAL: f64 = 100.0;

fn field(x: f64, y: f64) -> FieldPoint {
    FieldPoint { x, y, weight: 1.0 }
}

/// A system with the image plane at the last thickness behind its surfaces.
fn system(surfaces: Vec<Surface<f64>>, stop: usize) -> System<f64> {
    let index = surfaces.last().unwrap().index;
    let surfaces = surfaces.into_iter().chain([Surface { index, ..image() }]).collect();
    System { index_before: 1.0, surfaces, stop: Some(stop) }
}

/// The two surfaces of a thin lens of index 1.5 in air.
fn thin_lens(focal: f64, distance: f64) -> [Surface<f64>; 2] {
    let shape = |curvature| Shape::Sphere { curvature };
    [
        Surface { shape: shape(1.0 / focal), index: 1.5, ..image() },
        Surface { shape: shape(-1.0 / focal), thickness: distance, ..image() },
    ]
}

/// A paraboloid mirror, its own stop, with the image plane `defocus` behind its focus.
fn paraboloid(defocus: f64) -> System<f64> {
    let shape = Shape::Conic { curvature: -0.5 / FOCAL, conic: -1.0 };
    let mirror = Surface { shape, mirror: true, thickness: -FOCAL - defocus, ..image() };
    system(vec![mirror], 0)
}

fn beam(diameter: f64, edge: f64) -> Beam {
    Beam {
        object: Object::Infinity,
        aperture: Aperture::EntrancePupilDiameter(diameter),
        field: FieldKind::Angle,
        edge,
    }
}

/// A lens of these rows at one wavelength, with fields along y in degrees.
fn lens(surfaces: Vec<Row>, aperture: Aperture, fields: &[f64]) -> Lens {
    let mut lens = Lens { surfaces, aperture, ..blank() };
    lens.fields.values = fields.iter().map(|y| field(0.0, *y)).collect();
    lens
}

fn row(curvature: f64, thickness: f64, index: f64) -> Row {
    let medium = if index == 1.0 { Medium::Air } else { Medium::Index(index) };
    Row { curvature, thickness, medium, ..Row::default() }
}

/// The rows of a thin lens of index 1.5.
fn thin_rows(distance: f64) -> [Row; 2] {
    [row(1.0 / FOCAL, 0.0, 1.5), row(-1.0 / FOCAL, distance, 1.0)]
}

/// The sag of a sphere.
fn sphere_sag(curvature: f64, height: f64) -> f64 {
    let radius = 1.0 / curvature;
    radius - radius.signum() * (radius * radius - height * height).sqrt()
}

#[track_caller]
fn assert_near(got: f64, exact: f64, relative: f64) {
    let error = (got - exact).abs();
    assert!(error <= relative * exact.abs(), "{got} instead of {exact}, off by {error:e}");
}
