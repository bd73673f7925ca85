//! Focusing by moving the image plane.

use super::PictureError;
use crate::lens::{Lens, Object};
use crate::pupil::{RayModel, RayModelError, limited_by_stop};

/// The same lens focused at a distance in front of its first vertex in mm by moving the image plane: as
/// far behind the paraxial image as before. The stop stays as large as it was.
///
/// # Errors
/// A lens that cannot be traced, or no image of an object at the distance.
pub fn focused(lens: &Lens, zoom: usize, distance: f64) -> Result<Lens, PictureError> {
    let before = RayModel::from_lens(lens, zoom)?.first_order;
    let defocus = lens.image_solve.or(before.image_defocus).ok_or(PictureError::Afocal)?;
    let mut moved = limited_by_stop(lens)?;
    moved.object = Object::Finite(distance);
    moved.image_solve = Some(defocus);
    let model = RayModel::from_lens(&moved, zoom).map_err(|error| match error {
        RayModelError::Undefined(_) => PictureError::Afocal,
        other => other.into(),
    })?;
    let image = model.first_order.paraxial_image.ok_or(PictureError::Afocal)?;
    let system = &model.channels[model.primary].system;
    let along = image * system.light_direction(system.surfaces.len().saturating_sub(2));
    if along > 0.0 { Ok(moved) } else { Err(PictureError::NotImaged { distance }) }
}
