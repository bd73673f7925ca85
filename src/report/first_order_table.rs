//! The first-order data of a lens by name, as tables and texts list them.

use crate::paraxial::FirstOrder;

/// The quantities of first-order optics that tables list, by name; lengths in mm. `None` for one that
/// the lens does not have. `track` is the distance from the first vertex to the image plane.
pub fn first_order_numbers(
    data: &FirstOrder<f64>,
    track: f64,
) -> [(&'static str, Option<f64>); 19] {
    [
        ("focal length", data.efl),
        ("back focal length, from the last vertex", data.bfl),
        ("front focal length, from the first vertex", data.ffl),
        ("front principal plane, from the first vertex", data.front_principal_plane),
        ("rear principal plane, from the last vertex", data.rear_principal_plane),
        ("f-number", data.f_number),
        ("working f-number", data.working_f_number),
        ("entrance pupil, from the first vertex", data.entrance_pupil.position),
        ("entrance pupil diameter", data.entrance_pupil.diameter),
        ("exit pupil, from the last vertex", data.exit_pupil.position),
        ("exit pupil diameter", data.exit_pupil.diameter),
        ("stop semi-diameter", Some(data.stop_semi_diameter)),
        ("first vertex to image plane", Some(track)),
        ("paraxial image, from the last vertex", data.paraxial_image),
        ("defocus: image plane from the paraxial image", data.image_defocus),
        ("magnification", data.magnification),
        ("Lagrange invariant", data.lagrange),
        ("Petzval sum, 1/mm", Some(data.petzval_sum)),
        ("Petzval radius", data.petzval_radius()),
    ]
}
