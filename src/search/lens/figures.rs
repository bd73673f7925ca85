//! What a lens has come to, in the numbers that a designer compares: sharpness and light of every
//! field.

use super::goal::focal_length_of;
use crate::analysis::{Estimate, Spot, spots};
use crate::lens::{Lens, at_zoom};
use crate::pupil::{Accuracy, RayModel, RayModelError};
use crate::search::element;
use serde::Serialize;

/// A lens in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LensSummary {
    /// The focal length at every zoom position, in mm; none for an afocal lens.
    pub focal_lengths: Vec<Option<f64>>,
    /// How many pieces of glass there are.
    pub elements: usize,
    /// The pattern of glass and air.
    pub topology: String,
    /// From the first vertex to the image, in mm, as it is written.
    pub track: f64,
    /// Every field of every zoom position.
    pub fields: Vec<FieldSummary>,
}

/// A field in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldSummary {
    /// The zoom position.
    pub zoom: usize,
    /// The field, counted from 0.
    pub field: usize,
    /// Its sagittal coordinate, in the unit of the lens's fields.
    pub x: f64,
    /// Its tangential coordinate.
    pub y: f64,
    /// The RMS radius of the spot about its centroid, uniform over the pupil, all colours by
    /// weight, in mm; none without light.
    pub spot: Option<Estimate>,
    /// The clear area of the pupil in mm² of the first vertex plane, the mean over the colours by
    /// weight; 0 without light.
    pub light: Estimate,
}

impl LensSummary {
    /// The figures of a lens, the radius of every spot good to a tolerance.
    ///
    /// # Errors
    /// A lens that cannot be set up.
    pub fn new(lens: &Lens, tolerance: f64) -> Result<Self, RayModelError> {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let mut fields = Vec::new();
        let mut focal_lengths = Vec::new();
        for zoom in 0..lens.zoom_positions() {
            let bench = RayModel::from_lens(lens, zoom)?;
            focal_lengths.push(focal_length_of(&at_zoom(lens, zoom)));
            for (i, spot) in spots(&bench, accuracy).into_iter().enumerate() {
                let spot = spot.ok();
                let light =
                    spot.as_ref().map_or(Estimate::new(0.0, 0.0, 0), |s| mean_light(s, &bench));
                let (x, y) = (bench.fields[i].x, bench.fields[i].y);
                let spot = spot.map(|spot| spot.rms);
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

    /// Rays that they rest on.
    pub fn rays(&self) -> usize {
        self.fields.iter().map(|f| f.spot.map_or(0, |spot| spot.rays)).sum()
    }
}

/// The mean area over the colours by weight; a dark colour has none.
fn mean_light(spot: &Spot, bench: &RayModel) -> Estimate {
    let total: f64 = bench.channels.iter().map(|color| color.weight).sum();
    let mut light = Estimate::new(0.0, 0.0, 0);
    for (color, found) in bench.channels.iter().zip(&spot.channels) {
        if let Ok(found) = found {
            let share = color.weight / total;
            light.value += share * found.light.value;
            light.error += share * found.light.error;
            light.rays += found.light.rays;
        }
    }
    light
}
