//! The images of a point by rays alone at all fields.

use super::wavefronts::{ENERGY_SHARES, half_width};
use crate::analysis::{AnalysisError, RayImage, RayImageRequest, Spot, ray_image};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use crate::session::clock::{Timed, time};
use rayon::prelude::*;

/// The images of a point by rays at all fields, over all wavelengths.
#[derive(Debug, Clone)]
pub struct RayImages {
    /// The image of each field, in order, or the reason why it has none.
    pub fields: Vec<Timed<Result<FieldRayImage, AnalysisError>>>,
}

/// The image of a field by rays.
#[derive(Debug, Clone)]
pub struct FieldRayImage {
    /// The image.
    pub image: RayImage,
    /// The radii of the circles of its encircled energy, in mm.
    pub radii: Vec<f64>,
}

/// The number of columns.
const COLUMNS: usize = 41;
/// The number of circles, the largest of which is as wide as the image.
const CIRCLES: usize = 24;
/// The tolerance of shares that are looked at, and the rays of a wavelength.
const LOOKED_AT: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 60_000 };

/// The images by rays of all fields; `None` if it was interrupted.
pub(super) fn ray_images(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<RayImages> {
    let image = |(field, spot): (&FieldPoint, &Result<Spot, AnalysisError>)| {
        time(|| {
            // As wide as that by diffraction, but the whole spot if that is larger.
            let reach = spot.as_ref().map_or(0.0, |spot| 1.05 * spot.radius.value);
            let half_width = half_width(model, spot).max(reach);
            let part = |k: usize| half_width * (k + 1) as f64 / CIRCLES as f64;
            let radii: Vec<f64> = (0..CIRCLES).map(part).collect();
            let request = RayImageRequest {
                count: COLUMNS,
                half_width,
                radii: &radii,
                shares: &ENERGY_SHARES,
            };
            let image = ray_image(model, *field, request, LOOKED_AT, interrupted)?;
            Ok(FieldRayImage { image, radii })
        })
    };
    let fields = model.fields.par_iter().zip(spots).map(image).collect();
    (!interrupted()).then_some(RayImages { fields })
}
