//! Contrast at a few spatial frequencies, over the field and through focus.

use super::AnalysisSettings;
use super::contrast::highest_frequency;
use crate::analysis::{
    AnalysisError, ContrastAtHeight, MtfPoint, Spot, contrast_over_field, through_focus_mtf,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use crate::session::clock::{Timed, time};
use rayon::prelude::*;

/// Contrast over the field.
#[derive(Debug, Clone)]
pub struct FieldContrastCurves {
    /// The spatial frequencies in cycles/mm, ascending.
    pub frequencies: Vec<f64>,
    /// The contrast from the axis to the edge of the field, over all wavelengths.
    pub points: Vec<ContrastAtHeight>,
}

/// Contrast of the fields through focus.
#[derive(Debug, Clone)]
pub struct FocusContrasts {
    /// The spatial frequency in cycles/mm.
    pub frequency: f64,
    /// The wavelength in micrometres.
    pub um: f64,
    /// The contrast of each field against the shift of the image plane in mm, which is the `frequency` of a
    /// point; or the reason why it has none.
    pub fields: Vec<Timed<Result<Vec<MtfPoint>, AnalysisError>>>,
}

/// The intervals between the axis and the edge of the field.
const INTERVALS: u32 = 10;
/// The parts of the frequency that is asked for at which contrast is shown over the field.
const PARTS: [f64; 3] = [0.25, 0.5, 1.0];
/// The positions of the image plane on each side.
const POSITIONS: i32 = 10;
/// The place of the best focus of a field in the range that is shown is at most one over this.
const BEYOND: f64 = 1.3;
/// The error of contrasts that are looked at.
const LOOKED_AT: f64 = 3e-3;

/// The frequency in cycles/mm that is asked for, or half of the highest one that the sharpest field shows.
fn frequency(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    settings: &AnalysisSettings,
) -> f64 {
    let asked = settings.contrast_frequency.filter(|nu| *nu > 0.0 && nu.is_finite());
    asked.unwrap_or_else(|| 0.5 * highest_frequency(model, spots))
}

fn accuracy(settings: &AnalysisSettings) -> Accuracy {
    Accuracy { tolerance: settings.tolerance.clamp(1e-6, LOOKED_AT), ..Accuracy::default() }
}

/// The contrast over the field; `None` if it was interrupted.
pub(super) fn field_contrast_curves(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    settings: &AnalysisSettings,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<FieldContrastCurves> {
    let highest = frequency(model, spots, settings);
    let frequencies = PARTS.map(|part| part * highest).to_vec();
    let accuracy = accuracy(settings);
    let points = contrast_over_field(model, INTERVALS, &frequencies, accuracy, interrupted).ok()?;
    Some(FieldContrastCurves { frequencies, points })
}

/// The contrast through focus; `None` if it was interrupted, which is asked for between fields.
pub(super) fn focus_contrasts(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    settings: &AnalysisSettings,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<FocusContrasts> {
    let frequency = frequency(model, spots, settings);
    let f_number = model.first_order.working_f_number.unwrap_or(1.0).abs();
    // The contrast of a perfect lens falls to zero at about F/nu; the best foci of the fields are shown too.
    let foci = spots.iter().filter_map(|spot| spot.as_ref().ok()?.best_focus());
    let reach = foci.map(|focus| BEYOND * focus.abs()).fold(f_number / frequency, f64::max);
    let step = reach / f64::from(POSITIONS);
    let shifts: Vec<f64> = (-POSITIONS..=POSITIONS).map(|i| f64::from(i) * step).collect();
    let accuracy = accuracy(settings);
    let contrast = |field: &FieldPoint| {
        time(|| {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            through_focus_mtf(model, *field, model.primary, frequency, &shifts, accuracy)
        })
    };
    let fields = model.fields.par_iter().map(contrast).collect();
    let um = model.channels[model.primary].um;
    (!interrupted()).then_some(FocusContrasts { frequency, um, fields })
}
