//! Integrals over pupils whose edge moves, against the cases of `aperture_gradients.json`.

mod boundary;
mod estimators;
mod fields;
mod hard;
mod warp;

use crate::reference::{count, number, numbers, read};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Aiming, Launch, QuadraticIntegrand, RayModel};
use aplanat::trace::{SurfaceGradient, SystemGradient};
use serde_json::Value;

/// A lens and a field with the exact integrals.
pub(crate) struct Case {
    data: Value,
}

/// Every case of the file.
pub(crate) fn cases() -> Vec<Case> {
    let file = read("aperture_gradients.json");
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty(), "no cases");
    cases.iter().map(|data| Case { data: data.clone() }).collect()
}

impl Case {
    pub(crate) fn name(&self) -> String {
        let field = number(&self.data["field_deg"]);
        format!("{} at {field} deg", self.data["lens"]["name"].as_str().unwrap())
    }

    pub(crate) fn number(&self, key: &str) -> f64 {
        number(&self.data[key])
    }

    pub(crate) fn system(&self) -> System<f64> {
        let lens = &self.data["lens"];
        let column = |key: &str| numbers(&lens[key]);
        let (c, t, sd, n) = (
            column("curvature"),
            column("thickness"),
            column("semi_diameter"),
            column("index_after"),
        );
        let row = |i: usize| Surface {
            shape: Shape::simplest(c[i], 0.0, [0.0; 7]),
            thickness: t[i],
            index: n[i],
            semi_diameter: sd[i],
            ..Surface::plane(0.0, 1.0)
        };
        let surfaces = (0..c.len()).map(row).chain([Surface::plane(0.0, 1.0)]).collect();
        let stop = lens["stop_surface"].as_u64().map(|_| count(&lens["stop_surface"]) - 1);
        System { index_before: number(&lens["index_before_first"]), surfaces, stop }
    }

    pub(crate) fn model(&self) -> RayModel {
        self.model_of(self.system())
    }

    /// A changed system with the field of the case.
    pub(crate) fn model_of(&self, system: System<f64>) -> RayModel {
        let edge = self.number("field_deg");
        let rim = system.surfaces[system.stop.unwrap_or(0)].semi_diameter;
        let beam = Beam {
            object: Object::Infinity,
            aperture: Aperture::StopSemiDiameter(rim),
            field: FieldKind::Angle,
            edge,
        };
        RayModel::from_systems(vec![(0.5876, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
    }

    pub(crate) fn launch<'a>(&self, model: &'a RayModel) -> Launch<'a> {
        let field = FieldPoint { x: 0.0, y: self.number("field_deg"), weight: 1.0 };
        model.launch(field, 0).unwrap()
    }

    /// The spot about the exact centroid, and the exact derivative of its integral.
    pub(crate) fn spot(&self) -> (QuadraticIntegrand, &Value) {
        (QuadraticIntegrand::spread([0.0, self.number("centroid_y")]), &self.data["d_L_spot"])
    }

    /// The throughput and the exact derivative of its integral.
    pub(crate) fn throughput(&self) -> (QuadraticIntegrand, &Value) {
        (QuadraticIntegrand::throughput(), &self.data["d_L_throughput"])
    }
}

/// The three groups of parameters of the file.
pub(crate) const GROUPS: [&str; 3] = ["curvature", "thickness", "semi_diameter"];

/// A group of a derivative.
pub(crate) fn group(gradient: &SystemGradient<f64>, name: &str) -> Vec<f64> {
    let of = |surface: &SurfaceGradient<f64>| match name {
        "curvature" => surface.curvature,
        "thickness" => surface.thickness,
        "semi_diameter" => surface.semi_diameter,
        other => panic!("group {other}"),
    };
    gradient.surfaces.iter().map(of).collect()
}

/// The exact numbers of a group; `None` for what is no parameter.
pub(crate) fn exact(values: &Value, name: &str) -> Vec<Option<f64>> {
    let list = values[name].as_array().unwrap();
    list.iter().map(|value| (!value.is_null()).then(|| number(value))).collect()
}

pub(crate) fn image() -> Surface<f64> {
    Surface::plane(0.0, 1.0)
}
