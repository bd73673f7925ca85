//! Contrast at a few spatial frequencies from the axis to the edge of the field, as data sheets of lenses have
//! it.

use super::{
    AnalysisError, MtfCurve, polychromatic_diffraction_mtf_unless, polychromatic_geometric_mtf,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;

/// The contrast at a distance from the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ContrastAtHeight {
    /// The distance of the field from the axis, in the unit of the lens's fields.
    pub height: f64,
    /// The contrast over all wavelengths at the frequencies asked for, or the reason why there is none.
    pub curve: Result<MtfCurve, AnalysisError>,
    /// The reason why the contrast is that of rays alone; `None` if it includes diffraction.
    pub without_diffraction: Option<AnalysisError>,
}

/// The contrast at evenly spaced heights from the axis to the field farthest from it, along its direction; at the
/// axis alone if no field lies beside it. Frequencies are in cycles/mm.
///
/// # Errors
/// [`AnalysisError::Interrupted`], which is asked for before every frequency.
pub fn contrast_over_field(
    model: &RayModel,
    intervals: u32,
    frequencies: &[f64],
    accuracy: Accuracy,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ContrastAtHeight>, AnalysisError> {
    let height = |field: &FieldPoint| field.x.hypot(field.y);
    let farthest = model.fields.iter().max_by(|a, b| height(a).total_cmp(&height(b)));
    let Some(edge) = farthest else { return Ok(Vec::new()) };
    let intervals = if height(edge) > 0.0 { intervals.max(1) } else { 0 };
    let at = |i: u32| {
        let share = f64::from(i) / f64::from(intervals.max(1));
        let field = FieldPoint { x: share * edge.x, y: share * edge.y, ..*edge };
        let (curve, without_diffraction) =
            contrast(model, field, frequencies, accuracy, interrupted);
        ContrastAtHeight { height: height(&field), curve, without_diffraction }
    };
    let found = (0..=intervals).into_par_iter().map(at).collect();
    // A part of the field is of no use.
    if interrupted() { Err(AnalysisError::Interrupted) } else { Ok(found) }
}

/// The contrast by diffraction, or by rays with the reason where a pupil allows no diffraction.
fn contrast(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> (Result<MtfCurve, AnalysisError>, Option<AnalysisError>) {
    match polychromatic_diffraction_mtf_unless(model, field, frequencies, accuracy, interrupted) {
        Err(why) if why.is_of_diffraction() => {
            (polychromatic_geometric_mtf(model, field, frequencies, accuracy), Some(why))
        }
        found => (found, None),
    }
}
