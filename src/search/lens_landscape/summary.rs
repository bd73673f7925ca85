//! The summary of a lens: sharpness and light of every field, its focal length and its size.

use crate::analysis::{Estimate, field_qualities};
use crate::lens::{Lens, at_zoom};
use crate::paraxial::{Beam, first_order};
use crate::pupil::{Accuracy, RayModel, RayModelError};
use crate::search::element;
use serde::Serialize;

/// The characteristic numbers of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LensSummary {
    /// The focal length at every zoom position, in mm; `None` for an afocal lens.
    pub focal_lengths: Vec<Option<f64>>,
    /// The number of pieces of glass.
    pub elements: usize,
    /// The topology, the pattern of glass and air.
    pub topology: String,
    /// The total track from the first vertex to the image, in mm, with the signs of the
    /// prescription.
    pub track: f64,
    /// The fields of all zoom positions.
    pub fields: Vec<FieldSummary>,
}

/// The sharpness and light of a field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldSummary {
    /// The index of the zoom position, from 0.
    pub zoom: usize,
    /// The index of the field, from 0.
    pub field: usize,
    /// Its sagittal coordinate, in the unit of the lens's fields.
    pub x: f64,
    /// Its tangential coordinate.
    pub y: f64,
    /// The RMS radius of the polychromatic spot about its centroid for a uniformly lit pupil, in
    /// mm; `None` without light.
    pub spot: Option<Estimate>,
    /// The clear area of the pupil in mm² of the first vertex plane, averaged over the wavelengths
    /// by weight; 0 without light.
    pub light: Estimate,
}

impl LensSummary {
    /// The summary of a lens, with the radius of every spot to a relative tolerance.
    ///
    /// # Errors
    /// The lens cannot be set up.
    pub fn new(lens: &Lens, tolerance: f64) -> Result<Self, RayModelError> {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let mut fields = Vec::new();
        let mut focal_lengths = Vec::new();
        for zoom in 0..lens.zoom_positions() {
            let model = RayModel::from_lens(lens, zoom)?;
            focal_lengths.push(focal_length_of(&at_zoom(lens, zoom)));
            for (i, quality) in field_qualities(&model, accuracy).into_iter().enumerate() {
                let (x, y) = (model.fields[i].x, model.fields[i].y);
                let (spot, light) = (quality.spot.ok(), quality.light);
                fields.push(FieldSummary { zoom, field: i, x, y, spot, light });
            }
        }
        Ok(Self {
            focal_lengths,
            elements: element::piece_count(lens),
            topology: element::topology(lens),
            track: lens.surfaces.iter().map(|row| row.thickness).sum(),
            fields,
        })
    }

    /// The number of rays traced for it.
    pub fn rays(&self) -> usize {
        self.fields.iter().map(|f| f.spot.map_or(0, |spot| spot.rays)).sum()
    }
}

/// The focal length of a lens at its first zoom position, in mm; `None` for an afocal one.
pub(super) fn focal_length_of(lens: &Lens) -> Option<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let efl = first_order(&system, &Beam::for_lens(lens, 0)).ok()?.efl?;
    efl.is_finite().then_some(efl)
}

/// The reference length of a lens: its focal length, or its track if it is afocal.
pub(super) fn reference_length(lens: &Lens) -> f64 {
    focal_length_of(lens).map_or_else(|| lens.total_track(), f64::abs).max(f64::MIN_POSITIVE)
}
