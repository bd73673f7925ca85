//! The lens on which speed is measured: a double Gauss.

use crate::lens::{Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Row, blank};
use crate::math::Vec3;
use crate::trace::{Ray, Rays};

/// Radius in mm, thickness behind in mm, index behind and semi-diameter in mm of each surface.
const SURFACES: [(f64, f64, f64, f64); 11] = [
    (56.20238, 8.750, 1.62041, 30.0),
    (152.28580, 0.500, 1.0, 30.0),
    (37.68262, 12.500, 1.62041, 24.0),
    (f64::INFINITY, 3.800, 1.60342, 24.0),
    (24.23130, 16.369, 1.0, 15.5),
    (f64::INFINITY, 13.748, 1.0, 15.0),
    (-28.37731, 3.800, 1.60342, 16.0),
    (f64::INFINITY, 11.000, 1.62041, 20.0),
    (-37.92546, 0.500, 1.0, 22.0),
    (177.41176, 7.000, 1.62041, 24.0),
    (-79.41143, 61.4878, 1.0, 24.0),
];
const STOP: usize = 5;
const ENTRANCE_PUPIL_DIAMETER: f64 = 33.33; // mm
const ENTRANCE_PUPIL: f64 = 58.34775410472952; // mm behind the first vertex
const FIELD: f64 = 7.0; // degrees, of the bundle on which speed is measured

/// A double Gauss lens of 100 mm, f/3: eleven surfaces and the image plane, at one wavelength.
pub fn double_gauss() -> Lens {
    let row =
        |(i, &(radius, thickness, index, semi_diameter)): (usize, &(f64, f64, f64, f64))| Row {
            curvature: if radius.is_finite() { 1.0 / radius } else { 0.0 },
            thickness,
            medium: if index == 1.0 { Medium::Air } else { Medium::Index(index) },
            semi_diameter: Some(semi_diameter),
            stop: i == STOP,
            ..Row::default()
        };
    let field = |y: f64| FieldPoint { x: 0.0, y, weight: 1.0 };
    Lens {
        name: "Double Gauss 100 mm f/3".to_owned(),
        source: "the double Gauss of many textbooks and of the Zemax samples, indices at 588 nm"
            .into(),
        aperture: Aperture::EntrancePupilDiameter(ENTRANCE_PUPIL_DIAMETER),
        fields: Fields {
            kind: FieldKind::Angle,
            values: [0.0, 5.0, 10.0, 14.0].map(field).to_vec(),
        },
        surfaces: SURFACES.iter().enumerate().map(row).collect(),
        ..blank()
    }
}

/// A bundle at 7 degrees that fills the entrance pupil evenly, along a golden spiral.
pub(super) fn bundle(count: usize) -> Rays<f64> {
    let (sin, cos) = FIELD.to_radians().sin_cos();
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let ray = |i: usize| {
        let position = i as f64 + 0.5;
        let radius = 0.5 * ENTRANCE_PUPIL_DIAMETER * (position / count as f64).sqrt();
        let (y, x) = (golden * position).sin_cos();
        let offset = ENTRANCE_PUPIL * sin / cos;
        Ray {
            point: Vec3::new(radius * x, radius * y - offset, 0.0),
            direction: Vec3::new(0.0, sin, cos),
        }
    };
    (0..count).map(ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::glass::line;
    use crate::paraxial::{Beam, first_order};

    #[test]
    fn it_is_what_it_says() {
        let lens = double_gauss();
        let system = lens.resolve(0, line::D).unwrap();
        let data = first_order(&system, &Beam::for_lens(&lens, 0)).unwrap();
        assert!((data.efl.unwrap() - 98.96).abs() < 0.01, "{:?}", data.efl);
        assert!((data.entrance_pupil.position.unwrap() - ENTRANCE_PUPIL).abs() < 1e-9);
    }

    #[test]
    fn the_bundle_fills_the_entrance_pupil_evenly() {
        let count = 4000;
        let rays = bundle(count);
        let at_pupil = |i: usize| {
            let Ray { point, direction } = rays.get(i);
            let t = ENTRANCE_PUPIL / direction.z;
            [point.x + t * direction.x, point.y + t * direction.y]
        };
        let mean = |of: &dyn Fn([f64; 2]) -> f64| {
            (0..count).map(|i| of(at_pupil(i))).sum::<f64>() / count as f64
        };
        let radius = 0.5 * ENTRANCE_PUPIL_DIAMETER;
        // A disc has means of x² and y² of a quarter of its squared radius.
        assert!(mean(&|p| p[0]).abs() < 0.01 * radius && mean(&|p| p[1]).abs() < 0.01 * radius);
        let square = 0.25 * radius * radius;
        for axis in [0, 1] {
            let found = mean(&|p| p[axis] * p[axis]);
            assert!((found / square - 1.0).abs() < 0.01, "{axis}: {found} {square}");
        }
        assert!(mean(&|p| p[0] * p[1]).abs() < 0.01 * square);
        // No two rays are closer than half of the mean distance.
        let apart = |i: usize, j: usize| {
            let (a, b) = (at_pupil(i), at_pupil(j));
            (a[0] - b[0]).hypot(a[1] - b[1])
        };
        let least = (0..200).flat_map(|i| (i + 1..400).map(move |j| (i, j)));
        let least = least.map(|(i, j)| apart(i, j)).fold(f64::INFINITY, f64::min);
        assert!(least > 0.5 * radius * (std::f64::consts::PI / count as f64).sqrt(), "{least}");
    }

    #[test]
    fn every_surface_of_the_lens_has_its_rim() {
        let lens = double_gauss();
        assert!(lens.surfaces.iter().all(|row| row.semi_diameter.is_some()));
        assert_eq!(lens.surfaces[STOP].semi_diameter, Some(15.0));
    }
}
