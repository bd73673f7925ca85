//! The shortfall of the modulation transfer by diffraction of each field.
//!
//! The transfer of a field is the sum of the complex transfers of its wavelengths by weight, with phases about one
//! image point; with `O = |O| exp(iθ)` the derivative of its modulus is `Re(exp(−iθ) dO)`, which the
//! [derivative of each pupil's transfer](RayTransfer::gradient) gives by one trace back, of both directions together.

use super::scoped_part::ScopedPart;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::analysis::{AnalysisError, RayTransfer, TransferAtFrequency};
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
    wanted: TransferAsked,
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let part = ScopedPart::new(context, scope)?;
    let pupils = transfers(context, wanted.tolerance, part)?;
    for field in 0..context.sampling.fields.len() {
        let own: Vec<&PupilPart<'_>> = pupils.iter().filter(|pupil| pupil.field == field).collect();
        let share: f64 = own.iter().map(|pupil| pupil.weight).sum();
        let Some(first) = own.first().filter(|_| share > 0.0) else { continue };
        let origin = first.transfer.center();
        let mut shortfalls = Vec::with_capacity(2);
        for frequency in [[wanted.frequency, 0.0], [0.0, wanted.frequency]] {
            let found = |pupil: &&PupilPart<'_>| pupil.transfer.at(frequency, origin);
            let found: Vec<TransferAtFrequency> = own.par_iter().map(found).collect();
            let [re, im] = [0, 1].map(|k| {
                let parts = own.iter().zip(&found);
                parts.map(|(pupil, at)| pupil.weight / share * at.value[k]).sum::<f64>()
            });
            let modulation = re.hypot(im);
            let shortfall = wanted.min - modulation;
            if shortfall > 0.0 {
                let conjugate = if modulation > 0.0 { [re, -im] } else { [0.0; 2] };
                let factor = conjugate.map(|part| part / modulation.max(f64::MIN_POSITIVE) / share);
                shortfalls.push(Shortfall { found, factor, lacking: shortfall });
            }
        }
        add_shortfalls(context, &own, &shortfalls, share, sum);
    }
    Ok(())
}

/// A modulation below its minimum: the transfer of each pupil, the conjugate of the phase of all over their weight, and
/// what is lacking.
struct Shortfall {
    found: Vec<TransferAtFrequency>,
    factor: [f64; 2],
    lacking: f64,
}

/// Adds the mean square of the shortfalls of a field of some weight.
fn add_shortfalls(
    context: &EvaluationContext<'_>,
    pupils: &[&PupilPart<'_>],
    shortfalls: &[Shortfall],
    share: f64,
    sum: &mut SumOfSquares,
) {
    if sum.level == DerivativeLevel::Normal {
        for one in shortfalls {
            let slope = modulation_slope(context, pupils, &[(one, 1.0)]);
            sum.add_residual(0.5 * share, one.lacking, &-slope);
        }
        return;
    }
    sum.value += shortfalls.iter().map(|one| 0.5 * share * one.lacking * one.lacking).sum::<f64>();
    if sum.level == DerivativeLevel::Gradient && !shortfalls.is_empty() {
        let slope = |one: &Shortfall| -share * one.lacking;
        let by_modulation: Vec<_> = shortfalls.iter().map(|one| (one, slope(one))).collect();
        sum.gradient += modulation_slope(context, pupils, &by_modulation);
    }
}

/// The derivatives by the variables of the sum of some modulations, each times a number.
fn modulation_slope(
    context: &EvaluationContext<'_>,
    pupils: &[&PupilPart<'_>],
    modulations: &[(&Shortfall, f64)],
) -> DVector<f64> {
    let slope = |(number, pupil): (usize, &&PupilPart<'_>)| {
        let transfers = modulations.iter().map(|(one, times)| {
            (one.found[number], one.factor.map(|part| times * pupil.weight * part))
        });
        let by_number = pupil.transfer.gradient(transfers);
        context.zoom.by_variables(context.systems, pupil.wavelength, &by_number)
    };
    let slopes: Vec<DVector<f64>> = pupils.par_iter().enumerate().map(slope).collect();
    let zero = DVector::zeros(context.values.len());
    slopes.into_iter().fold(zero, |total, slope| total + slope)
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
        AnalysisError::Afocal => "the lens is afocal",
        AnalysisError::NoChief => "a chief ray does not reach the image",
        AnalysisError::IdealPath => "the optical path through a paraxial lens is not known",
        _ => "a pupil is irregular: diffraction needs an edge that is known and star-shaped",
    };
    MeritError::DoesNotApply { term: "mtf", why }
}
