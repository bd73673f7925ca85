//! The change of light that leaving dispersion out makes.
//!
//! It takes the pupil of every field and wavelength, so it is measured only for a model that leaves
//! dispersion out.

use crate::lens::FieldPoint;
use crate::pupil::{RayModel, Region};
use rayon::prelude::*;

/// The order of quadrature of the areas of pupils, whose errors are nearly the same at all
/// wavelengths.
const AREA_ORDER: usize = 2;

/// The largest relative change of the light of a field if all of it had the primary wavelength; 0
/// with a single wavelength.
pub(super) fn light_change(model: &RayModel) -> f64 {
    if model.channels.len() == 1 {
        return 0.0;
    }
    model.fields.par_iter().map(|field| field_change(model, *field)).reduce(|| 0.0, f64::max)
}

/// The change at one field. A field that is dark at the primary wavelength has no light to change.
///
/// The pupil is searched for at the primary wavelength; those of the others are tracked from it.
fn field_change(model: &RayModel, field: FieldPoint) -> f64 {
    let Ok(launch) = model.launch(field, model.primary) else { return 0.0 };
    let primary = Region::new(launch);
    let area = |wavelength: usize| {
        let Ok(launch) = model.launch(field, wavelength) else { return 0.0 };
        clear_area(&Region::track(&primary.kind, launch))
    };
    let weighted = model.channels.iter().enumerate().map(|(i, channel)| channel.weight * area(i));
    let weights: f64 = model.channels.iter().map(|channel| channel.weight).sum();
    let mean = weighted.sum::<f64>() / weights;
    if mean == 0.0 { 0.0 } else { (clear_area(&primary) / mean - 1.0).abs() }
}

/// The clear area of a pupil, in mm² or as a solid angle.
fn clear_area(region: &Region<'_>) -> f64 {
    region.launch.area() * region.moments(&region.nodes(AREA_ORDER)).area
}
