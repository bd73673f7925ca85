//! The lenses, rays and perturbations of `tolerances.json`.

use crate::reference::{count, number, numbers, read};
use aplanat::lens::{
    ASPHERE_TERMS, ErrorDistribution, Perturbation, PerturbationKind, Shape, Surface, System,
    Tolerance,
};
use aplanat::math::Vec3;
use aplanat::tolerance::{Beam, ColourRays, FieldBeam, MeritOptions, NominalLens};
use aplanat::trace::Ray;
use serde_json::Value;
use std::f64::consts::PI;

/// A lens of the file.
pub(super) struct ToleranceCase {
    pub(super) data: Value,
}

/// The four rays of `base` and `derivatives`: field and pupil point.
pub(super) const RAYS: [(usize, [f64; 2]); 4] =
    [(0, [0.0, 0.0]), (0, [0.0, 1.0]), (1, [0.6, -0.7]), (2, [-0.8, 0.5])];

/// Every lens of the file.
pub(super) fn lenses() -> Vec<ToleranceCase> {
    let file = read("tolerances.json");
    let lenses = file["lenses"].as_array().unwrap();
    lenses.iter().map(|data| ToleranceCase { data: data.clone() }).collect()
}

/// The kind of a name of the file.
pub(super) fn kind(name: &Value) -> PerturbationKind {
    serde_json::from_value(name.clone()).unwrap()
}

/// A perturbation of the file.
pub(super) fn perturbation(data: &Value) -> Perturbation {
    Perturbation {
        kind: kind(&data["kind"]),
        first: count(&data["first"]),
        last: count(&data["last"]),
    }
}

/// A perturbation of the file with its value.
pub(super) fn valued(data: &Value) -> (Perturbation, f64) {
    (perturbation(data), number(&data["value"]))
}

impl ToleranceCase {
    pub(super) fn id(&self) -> &str {
        self.data["id"].as_str().unwrap()
    }

    pub(super) fn primary(&self) -> usize {
        count(&self.data["primary"])
    }

    pub(super) fn wavelengths(&self) -> Vec<f64> {
        numbers(&self.data["wavelengths_um"])
    }

    pub(super) fn surfaces(&self) -> &Vec<Value> {
        self.data["surfaces"].as_array().unwrap()
    }

    fn system(&self, wavelength: usize) -> System<f64> {
        let surface = |data: &Value| {
            let curvature = data["radius"].as_f64().map_or(0.0, |radius| 1.0 / radius);
            let mut terms = [0.0; ASPHERE_TERMS];
            terms.iter_mut().zip(numbers(&data["asphere"])).for_each(|(to, from)| *to = from);
            let shape = Shape::simplest(curvature, number(&data["conic"]), terms);
            let index = number(&data["n"][wavelength]);
            Surface { shape, ..Surface::plane(number(&data["thickness"]), index) }
        };
        let mut surfaces: Vec<_> = self.surfaces().iter().map(surface).collect();
        surfaces.push(Surface::plane(0.0, 1.0));
        System { index_before: 1.0, surfaces, stop: None }
    }

    pub(super) fn nominal(&self) -> NominalLens {
        NominalLens {
            systems: (0..self.wavelengths().len()).map(|w| self.system(w)).collect(),
            wavelengths: self.wavelengths(),
            primary: self.primary(),
            semi_diameters: self.surfaces().iter().map(|s| number(&s["semi_diameter"])).collect(),
            rims: Vec::new(),
        }
    }

    pub(super) fn options(&self) -> MeritOptions {
        let um = self.wavelengths()[self.primary()];
        let wavefront = Some((number(&self.data["z_xp"]), um * 1e-3));
        MeritOptions { primary: self.primary(), wavefront }
    }

    /// A ray of the file, and its optical path up to its start.
    pub(super) fn ray(&self, field: usize, [px, py]: [f64; 2]) -> (Ray<f64>, f64) {
        let angles = numbers(&self.data["fields_deg"][field]);
        let [x, y] = [0, 1].map(|i| angles[i].to_radians().tan());
        let length = (x * x + y * y + 1.0).sqrt();
        let direction = Vec3::new(x / length, y / length, 1.0 / length);
        let half = 0.5 * number(&self.data["entrance_pupil_diameter"]);
        let point = Vec3::new(px * half, py * half, number(&self.data["z_ep"]));
        // Started in front of the lens: the phone's pupil is inside.
        let back = (point.z + 5.0) / direction.z;
        let start = point + direction * -back;
        (Ray { point: start, direction }, start.dot(direction))
    }

    /// Rays through the pupil: Gauss-Legendre rings in r² times azimuths at half steps.
    pub(super) fn beam(&self, rings: usize, azimuths: usize) -> Beam {
        let fields = self.data["fields_deg"].as_array().unwrap().len();
        let weights = numbers(&self.data["wavelength_weights"]);
        let total: f64 = weights.iter().sum();
        let field = |field: usize| FieldBeam {
            weight: 1.0 / fields as f64,
            colours: (0..weights.len())
                .map(|w| self.colour(field, w, weights[w] / total, (rings, azimuths)))
                .collect(),
            chief: self.ray(field, [0.0, 0.0]),
        };
        Beam { fields: (0..fields).map(field).collect() }
    }

    fn colour(
        &self,
        field: usize,
        wavelength: usize,
        share: f64,
        (rings, azimuths): (usize, usize),
    ) -> ColourRays {
        let mut colour = ColourRays::new(wavelength);
        for (square, weight) in aplanat::math::quadrature::gauss_legendre(rings, 0.0, 1.0) {
            for j in 0..azimuths {
                let angle = 2.0 * PI * (j as f64 + 0.5) / azimuths as f64;
                let pupil = [square.sqrt() * angle.cos(), square.sqrt() * angle.sin()];
                let (ray, path) = self.ray(field, pupil);
                colour.push(ray, share * weight / azimuths as f64, pupil, path);
            }
        }
        colour
    }
}

/// The tolerances of `as_built`, all with this distribution.
pub(super) fn tolerances(lens: &ToleranceCase, distribution: ErrorDistribution) -> Vec<Tolerance> {
    let all = lens.data["as_built"]["tolerances"].as_array().unwrap().iter();
    let tolerance = |data: &Value| Tolerance {
        error: perturbation(data),
        half_range: number(&data["half_range"]),
        distribution,
    };
    all.map(tolerance).collect()
}

/// Checks that two numbers agree within an absolute tolerance; NaN does not.
pub(super) fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let apart = (found - expected).abs();
    assert!(apart <= tolerance, "{what}: {found:e}, expected {expected:e} within {tolerance:e}");
}
