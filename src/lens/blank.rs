//! A lens to start a new design from.

use super::{Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Row, Wavelength};

/// A new lens: a plane-parallel plate of N-BK7 whose front is the stop, and one field on the axis.
pub fn blank() -> Lens {
    let row = |thickness: f64, medium: Medium, stop: bool| Row {
        thickness,
        medium,
        stop,
        semi_diameter: Some(10.0),
        ..Row::default()
    };
    Lens {
        name: "New lens".to_owned(),
        source: String::new(),
        notes: String::new(),
        object: Object::Infinity,
        object_medium: Medium::Air,
        aperture: Aperture::EntrancePupilDiameter(10.0),
        fields: Fields {
            kind: FieldKind::Angle,
            values: vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }],
        },
        wavelengths: vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }],
        surfaces: vec![
            row(5.0, Medium::Glass("SCHOTT N-BK7".to_owned()), true),
            row(50.0, Medium::Air, false),
        ],
        zoom: Vec::new(),
        variables: Vec::new(),
        pickups: Vec::new(),
        image_solve: None,
    }
}
