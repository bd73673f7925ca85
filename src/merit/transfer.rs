//! The shortfall of the modulation transfer by diffraction of each field.
//!
//! The transfer of a field is the sum of the complex transfers of its wavelengths by weight, with phases about one
//! image point; with `O = |O| exp(iθ)` the derivative of its modulus is `Re(exp(−iθ) dO)`, which the
//! [derivative of each pupil's transfer](crate::analysis::TransferSlopes::gradient) gives by one trace back.

use super::scoped_part::ScopedPart;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::analysis::{AnalysisError, RayTransfer, TransferSlopes};
use crate::lens::TermScope;
use nalgebra::DVector;
use rayon::prelude::*;

/// The transfer that is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct TransferAsked {
    /// The spatial frequency, in cycles/mm.
    pub(super) frequency: f64,
    /// The minimum modulation.
    pub(super) min: f64,
    /// The absolute tolerance of the transfer.
    pub(super) tolerance: f64,
}

/// The transfer of a pupil, with its weight in that of its field.
struct PupilPart<'a> {
    field: usize,
    wavelength: usize,
    weight: f64,
    transfer: RayTransfer<'a>,
}

/// Adds the mean squared shortfalls, tangential and sagittal, of the modulation from a minimum.
pub(super) fn add_transfer_shortfall(
    context: &EvaluationContext<'_>,
    asked: TransferAsked,
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let part = ScopedPart::new(context, scope)?;
    let pupils = transfers(context, asked.tolerance, part)?;
    for field in 0..context.sampling.fields.len() {
        let own: Vec<&PupilPart<'_>> = pupils.iter().filter(|pupil| pupil.field == field).collect();
        let share: f64 = own.iter().map(|pupil| pupil.weight).sum();
        let Some(first) = own.first().filter(|_| share > 0.0) else { continue };
        let origin = first.transfer.center();
        let mut slopes = None;
        for frequency in [[asked.frequency, 0.0], [0.0, asked.frequency]] {
            let value = |pupil: &&PupilPart<'_>| {
                pupil.transfer.value(frequency, origin).map(|part| pupil.weight / share * part)
            };
            let values: Vec<[f64; 2]> = own.par_iter().map(value).collect();
            let [re, im] = values.iter().fold([0.0; 2], |sum, v| [sum[0] + v[0], sum[1] + v[1]]);
            let modulation = re.hypot(im);
            let shortfall = asked.min - modulation;
            if !(shortfall > 0.0) {
                continue;
            }
            let mut slope = DVector::zeros(context.values.len());
            if sum.level > DerivativeLevel::Value && modulation > 0.0 {
                let slopes = match &mut slopes {
                    Some(known) => known,
                    empty => empty.insert(slopes_of(&own)?),
                };
                let turned = [re, -im].map(|part| part / modulation / share);
                slope = modulation_slope(context, (&own, slopes), (frequency, origin), turned);
            }
            sum.add_residual(0.5 * share, shortfall, &-slope);
        }
    }
    Ok(())
}

/// The derivatives of a modulation by the variables; `factor` is the conjugate of its phase over the weight of all
/// pupils.
fn modulation_slope(
    context: &EvaluationContext<'_>,
    (pupils, slopes): (&[&PupilPart<'_>], &[TransferSlopes<'_, '_>]),
    (frequency, origin): ([f64; 2], [f64; 2]),
    factor: [f64; 2],
) -> DVector<f64> {
    let slope = |(pupil, slopes): (&&PupilPart<'_>, &TransferSlopes<'_, '_>)| {
        let factor = factor.map(|part| pupil.weight * part);
        let by_number = slopes.gradient(frequency, origin, factor);
        context.zoom.by_variables(context.systems, pupil.wavelength, &by_number)
    };
    let slopes: Vec<DVector<f64>> = pupils.par_iter().zip(slopes).map(slope).collect();
    let zero = DVector::zeros(context.values.len());
    slopes.into_iter().fold(zero, |total, slope| total + slope)
}

/// The numbers that the derivatives of some pupils need.
fn slopes_of<'t, 'a>(
    pupils: &[&'t PupilPart<'a>],
) -> Result<Vec<TransferSlopes<'t, 'a>>, MeritError> {
    let slopes = |pupil: &&'t PupilPart<'a>| pupil.transfer.slopes().map_err(refusal);
    pupils.par_iter().map(slopes).collect()
}

/// The transfers of the pupils that a term is about, those without light left out.
fn transfers<'a>(
    context: &'a EvaluationContext<'_>,
    tolerance: f64,
    part: ScopedPart,
) -> Result<Vec<PupilPart<'a>>, MeritError> {
    let pupils = context.sampling.pupils.par_iter().zip(context.traced_pupils);
    let transfer = |(pupil, traced): (&super::SampledPupil, &'a crate::pupil::TracedPupil<'_>)| {
        let weight = pupil.share * part.factor(pupil.field, pupil.wavelength);
        if !(weight > 0.0 && traced.has_light()) {
            return Ok(None);
        }
        let found = match pupil.transfer {
            Some(rays) => RayTransfer::new(traced.region(), rays, tolerance),
            None => Err(AnalysisError::IrregularPupil),
        };
        let (field, wavelength) = (pupil.field, pupil.wavelength);
        match found {
            Ok(transfer) => Ok(Some(PupilPart { field, wavelength, weight, transfer })),
            Err(AnalysisError::NoLight) => Ok(None),
            Err(why) => Err(refusal(why)),
        }
    };
    let found: Result<Vec<_>, MeritError> = pupils.map(transfer).collect();
    Ok(found?.into_iter().flatten().collect())
}

fn refusal(why: AnalysisError) -> MeritError {
    let why = match why {
        AnalysisError::FoldedPupil => {
            "a pupil folds: two of its rays have the same direction from the reference sphere"
        }
        AnalysisError::NoChief => "a chief ray does not reach the image",
        AnalysisError::IdealPath => "the optical path through a paraxial lens is not known",
        _ => "a pupil is irregular: diffraction needs an edge that is known and star-shaped",
    };
    MeritError::DoesNotApply { term: "mtf", why }
}
