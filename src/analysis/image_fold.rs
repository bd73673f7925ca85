//! Fields that share their image points: where the image height turns round within the field.
//!
//! Beyond the turn light of a second field arrives at the same points from other directions. These are no part of
//! the set of directions about the first field's chief ray, which is followed from the image, so that a number that
//! rests on that set alone would miss the half of the light without a sign of it.

use super::{AnalysisError, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;

/// The fields from the axis to the farthest one that are compared.
const STEPS: usize = 24;
/// The fall of a height, as a share of the largest, that is no rounding.
const FALL: f64 = 1e-9;

/// The distances from the axis in mm between which light of two fields arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFold {
    /// The least and the largest of them.
    pub radii: [f64; 2],
}

impl ImageFold {
    /// The fold of a lens at a wavelength within the fields of its beam; `None` without one, and for a lens that is
    /// not symmetric about its axis.
    pub fn find(model: &RayModel, wavelength: usize) -> Option<Self> {
        if !model.channels[wavelength].system.has_rotational_symmetry() {
            return None;
        }
        let sizes = model.fields.iter().map(|field| field.x.hypot(field.y));
        let reach = sizes.fold(model.beam.edge.abs(), f64::max);
        let field =
            |i: usize| FieldPoint { x: 0.0, y: reach * i as f64 / STEPS as f64, weight: 1.0 };
        let landing = |i: usize, p: [f64; 2]| {
            let launch = model.launch(field(i), wavelength).ok()?;
            Some(launch.unclipped_landing(p)?.ray.point.value().y)
        };
        let heights: Vec<Option<f64>> = (0..=STEPS).map(|i| landing(i, [0.0; 2])).collect();
        let facing = heights.iter().flatten().find(|h| **h != 0.0)?.signum();
        let known: Vec<f64> = heights.iter().map_while(|h| h.map(|h| facing * h)).collect();
        let falls = |pair: &[f64]| pair[1] < pair[0] - FALL * pair[0].abs();
        let turn = known.windows(2).position(falls)?;
        let is_lit = |i: &usize| lit_region(model, field(*i), wavelength).is_ok();
        let lit = (turn + 1..known.len()).take_while(is_lit).count();
        if lit == 0 {
            return None;
        }
        // The light ends between two fields: the fold reaches to the second of them, with its blur, or anywhere if
        // where that one lands is not known.
        let next = (turn + lit + 1).min(STEPS);
        let least = known.get(turn + 1..=next).and_then(|heights| {
            let edges = [-1.0, 1.0].map(|p| landing(next, [0.0, p]).map(|h| facing * h));
            let [low, high] = [edges[0]?, edges[1]?];
            Some(heights.iter().copied().fold(low.min(high), f64::min))
        });
        Some(Self { radii: [least.unwrap_or(0.0).max(0.0), known[turn]] })
    }

    /// Refuses a point of the image at which light of two fields arrives.
    ///
    /// # Errors
    /// [`AnalysisError::FoldedImage`].
    pub fn refuse(
        model: &RayModel,
        wavelength: usize,
        [x, y]: [f64; 2],
    ) -> Result<(), AnalysisError> {
        let radius = x.hypot(y);
        match Self::find(model, wavelength) {
            Some(Self { radii: [least, most] }) if (least..=most).contains(&radius) => {
                Err(AnalysisError::FoldedImage)
            }
            _ => Ok(()),
        }
    }
}
