//! A lens with one effect left out.

use crate::lens::{
    ASPHERE_TERMS, Aperture, Environment, FieldKind, FieldPoint, Lens, Object, Shape, Surface,
    System,
};
use crate::paraxial::Beam;
use crate::pupil::RayModel;

/// Removes the aspheric terms of a surface, which leaves a conic.
pub(super) fn reduce_to_conic(surface: &mut Surface<f64>) {
    let (curvature, conic, _) = surface.shape.numbers();
    surface.shape = Shape::simplest(curvature, conic, [0.0; ASPHERE_TERMS]);
}

/// The indices of the surfaces that are tilted or decentred, or at which the axis is broken.
pub(super) fn placed_surfaces(system: &System<f64>) -> Vec<usize> {
    let is_placed = |surface: &Surface<f64>| surface.pose.is_some() || surface.axis.is_some();
    let placed = system.surfaces.iter().enumerate().filter(|(_, surface)| is_placed(surface));
    placed.map(|(i, _)| i).collect()
}

/// Centres all surfaces on a straight axis.
pub(super) fn centre(system: &mut System<f64>) {
    for surface in &mut system.surfaces {
        (surface.pose, surface.axis) = (None, None);
    }
}

/// The lens with the indices of its catalogues.
pub(super) fn at_room_temperature(lens: &Lens) -> Lens {
    let environment = Environment { celsius: None, ..lens.environment };
    Lens { environment, ..lens.clone() }
}

/// The beam and the fields of a lens with its object points moved to infinity along their chief rays;
/// `None` if the object lies in the entrance pupil or the pupil has no size.
pub(super) fn collimate_fields(model: &RayModel, beam: &Beam) -> Option<(Beam, Vec<FieldPoint>)> {
    let Object::Finite(distance) = beam.object else { return None };
    let pupil = model.first_order.entrance_pupil;
    let (reach, diameter) = (distance + pupil.position?, pupil.diameter?);
    let height = |value: f64| match beam.field {
        FieldKind::Angle => Some(value),
        FieldKind::ObjectHeight => Some(-(value / reach).atan().to_degrees()),
        FieldKind::ImageHeight => {
            Some(-(value / model.first_order.magnification? / reach).atan().to_degrees())
        }
    };
    let turned = |field: &FieldPoint| {
        let size = field.x.hypot(field.y);
        let angle = if size == 0.0 { 0.0 } else { height(size)? / size };
        Some(FieldPoint { x: field.x * angle, y: field.y * angle, ..*field })
    };
    let fields: Option<Vec<FieldPoint>> = model.fields.iter().map(turned).collect();
    let far = Beam {
        object: Object::Infinity,
        aperture: match beam.aperture {
            stop @ Aperture::StopSemiDiameter(_) => stop,
            _ => Aperture::EntrancePupilDiameter(diameter),
        },
        field: FieldKind::Angle,
        edge: height(beam.edge)?,
    };
    (reach != 0.0).then_some((far, fields?))
}
