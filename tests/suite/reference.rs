//! Reading the reference cases: `tests/reference/`, or the folder that `APLANAT_REFERENCE` names.

use aplanat::lens::{
    ASPHERE_TERMS, Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System,
};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Aiming, PupilMeasure, RayModel};
use serde_json::Value;
use std::path::PathBuf;

/// The folder of the reference cases.
pub(crate) fn folder() -> PathBuf {
    std::env::var_os("APLANAT_REFERENCE").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/reference"),
        PathBuf::from,
    )
}

/// One JSON file of that folder.
pub(crate) fn read(name: &str) -> Value {
    let path = folder().join(name);
    let text = std::fs::read_to_string(&path);
    let text = text.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A number, or the decimal text of one.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().or_else(|| value.as_str()?.parse().ok()).unwrap_or_else(|| panic!("{value}"))
}

/// A list of numbers.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

/// A count or an index.
pub(crate) fn count(value: &Value) -> usize {
    usize::try_from(value.as_u64().unwrap()).unwrap()
}

/// A lens of `lenses.json`.
pub(crate) struct Reference {
    pub(crate) data: Value,
}

/// Every lens of `lenses.json`.
pub(crate) fn lenses() -> Vec<Reference> {
    let file = read("lenses.json");
    file["lenses"].as_array().unwrap().iter().map(|data| Reference { data: data.clone() }).collect()
}

impl Reference {
    pub(crate) fn id(&self) -> &str {
        self.data["id"].as_str().unwrap()
    }

    pub(crate) fn wavelengths(&self) -> Vec<f64> {
        numbers(&self.data["wavelengths_um"])
    }

    pub(crate) fn primary(&self) -> usize {
        count(&self.data["primary"])
    }

    pub(crate) fn fields(&self) -> Vec<f64> {
        numbers(&self.data["fields"]["y"])
    }

    pub(crate) fn field_kind(&self) -> FieldKind {
        match self.data["fields"]["type"].as_str().unwrap() {
            "angle_deg" => FieldKind::Angle,
            "object_height_mm" => FieldKind::ObjectHeight,
            other => panic!("field type {other}"),
        }
    }

    pub(crate) fn object(&self) -> Object {
        self.data["object_distance"].as_f64().map_or(Object::Infinity, Object::Finite)
    }

    pub(crate) fn aimed_at_stop(&self) -> bool {
        match self.data["pupil_mode"].as_str().unwrap() {
            "paraxial_ep" => false,
            "stop_aimed" => true,
            other => panic!("pupil mode {other}"),
        }
    }

    /// The beam up to the last field.
    pub(crate) fn beam(&self) -> Beam {
        Beam {
            object: self.object(),
            aperture: Aperture::EntrancePupilDiameter(number(&self.data["aperture"]["epd"])),
            field: self.field_kind(),
            edge: *self.fields().last().unwrap(),
        }
    }

    /// The lens ready for rays over the whole unit disc of the pupil, clipped by nothing.
    pub(crate) fn open_model(&self) -> RayModel {
        let systems = self.systems(|w| self.open(w));
        let (aiming, mut beam) = (self.aiming(), self.beam());
        if aiming == Aiming::Stop {
            beam.aperture = Aperture::StopSemiDiameter(number(&self.data["stop_radius"]));
        }
        self.with_fields(RayModel::from_systems(systems, self.primary(), beam, aiming).unwrap())
    }

    /// The lens ready for rays, limited by its stop and clipped by its semi-diameters; by its stop
    /// alone where rays are aimed at that.
    pub(crate) fn clipped_model(&self) -> RayModel {
        let aimed = self.aimed_at_stop();
        let systems = self.systems(|w| if aimed { self.open(w) } else { self.clipped(w) });
        let mut beam = self.beam();
        beam.aperture = Aperture::StopSemiDiameter(number(&self.data["stop_radius"]));
        self.with_fields(
            RayModel::from_systems(systems, self.primary(), beam, self.aiming()).unwrap(),
        )
    }

    fn systems(&self, system: impl Fn(usize) -> System<f64>) -> Vec<(f64, f64, System<f64>)> {
        let waves = self.wavelengths();
        waves.iter().enumerate().map(|(w, um)| (*um, 1.0, system(w))).collect()
    }

    fn aiming(&self) -> Aiming {
        if self.aimed_at_stop() { Aiming::Stop } else { Aiming::Paraxial }
    }

    fn with_fields(&self, model: RayModel) -> RayModel {
        let field = |y: f64| FieldPoint { x: 0.0, y, weight: 1.0 };
        // The file weighs the coordinates of its pupils alike.
        let measure = PupilMeasure::Coordinates;
        RayModel { fields: self.fields().into_iter().map(field).collect(), measure, ..model }
    }

    /// The lens at a wavelength, clipped by nothing.
    pub(crate) fn open(&self, wavelength: usize) -> System<f64> {
        let mut system = self.clipped(wavelength);
        system.surfaces.iter_mut().for_each(|surface| surface.semi_diameter = f64::INFINITY);
        system
    }

    /// The lens at a wavelength, clipped by the semi-diameters of the file.
    pub(crate) fn clipped(&self, wavelength: usize) -> System<f64> {
        let rows = self.data["surfaces"].as_array().unwrap();
        System {
            index_before: number(&self.data["n_object"]),
            surfaces: rows.iter().map(|row| surface(row, wavelength)).collect(),
            stop: Some(count(&self.data["stop_surface"])),
        }
    }
}

fn surface(row: &Value, wavelength: usize) -> Surface<f64> {
    let curvature = row["radius"].as_f64().map_or(0.0, f64::recip);
    let mut terms = [0.0; ASPHERE_TERMS];
    if let Some(given) = row["a"].as_array() {
        terms.iter_mut().zip(given).for_each(|(to, from)| *to = number(from));
    }
    Surface {
        shape: Shape::simplest(curvature, number(&row["k"]), terms),
        semi_diameter: row["sd"].as_f64().unwrap_or(f64::INFINITY),
        mirror: row["mirror"].as_bool().unwrap_or(false),
        ..Surface::plane(row["t"].as_f64().unwrap_or(0.0), number(&row["n"][wavelength]))
    }
}

/// The largest error of a family of numbers so far, where it was, and how many were compared.
#[derive(Default)]
pub(crate) struct Worst {
    error: f64,
    place: String,
    compared: usize,
}

impl Worst {
    /// Notes `|got - exact| / scale`.
    pub(crate) fn note(&mut self, got: f64, exact: f64, scale: f64, place: impl Into<String>) {
        self.compared += 1;
        let difference = (got - exact).abs();
        let error = if difference == 0.0 { 0.0 } else { difference / scale };
        // A number that is not one must win, hence the negation.
        if !(error <= self.error) {
            (self.error, self.place) = (error, place.into());
        }
    }

    /// Prints the error, fails if it is above the tolerance, and returns how many numbers were
    /// compared.
    pub(crate) fn check(&self, what: &str, tolerance: f64) -> usize {
        println!(
            "{what}: worst {:.2e} of the tolerance {tolerance:.0e} in {}",
            self.error, self.place
        );
        assert!(self.error <= tolerance, "{what}: {:e} in {}", self.error, self.place);
        self.compared
    }
}
