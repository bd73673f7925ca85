//! The contrast of all fields against spatial frequency.

use crate::analysis::{
    self, AnalysisError, Estimate, MtfCurve, Spot, Wavefront, polychromatic_diffraction_mtf_unless,
    polychromatic_geometric_mtf,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use crate::session::clock::{Timed, time};
use rayon::prelude::*;

/// The contrast of all fields over all wavelengths.
#[derive(Debug, Clone)]
pub struct FieldContrasts {
    /// The spatial frequencies of the curves, in cycles/mm.
    pub frequencies: Vec<f64>,
    /// The contrast of a perfect lens of the same working f-number at each frequency; `None` for an
    /// afocal lens.
    pub limit: Option<Vec<f64>>,
    /// The contrast of each field, in order, or the reason why it has none.
    pub fields: Vec<Timed<Result<FieldContrast, AnalysisError>>>,
}

/// The contrast of a field.
#[derive(Debug, Clone)]
pub struct FieldContrast {
    /// The curve.
    pub curve: MtfCurve,
    /// The reason why the curve is that of rays alone; `None` if it includes diffraction.
    pub without_diffraction: Option<AnalysisError>,
    /// The wavefront at the primary wavelength, or the reason why it has none.
    pub wavefront: Result<Wavefront, AnalysisError>,
}

/// The number of frequencies above zero.
const FREQUENCIES: usize = 24;
/// The highest frequency over the reciprocal of the smallest RMS radius.
const REACH: f64 = 2.0;
/// The error allowed of a curve that is looked at.
const LARGEST_ERROR: f64 = 1e-3;

/// The contrast of all fields up to a frequency that the sharpest one still shows; `None` if it was
/// interrupted.
pub(super) fn field_contrasts(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    tolerance: f64,
    interrupted: impl Fn() -> bool + Sync,
) -> Option<FieldContrasts> {
    let highest = highest_frequency(model, spots);
    let step = highest / FREQUENCIES as f64;
    let frequencies: Vec<f64> = (0..=FREQUENCIES).map(|i| step * i as f64).collect();
    let accuracy = Accuracy { tolerance: tolerance.min(LARGEST_ERROR), ..Accuracy::default() };
    let contrast = |field: &FieldPoint| {
        time(|| field_contrast(model, *field, &frequencies, accuracy, &interrupted))
    };
    let mut fields = Vec::with_capacity(model.fields.len());
    for together in model.fields.chunks(rayon::current_num_threads()) {
        if interrupted() {
            return None;
        }
        fields.par_extend(together.par_iter().map(contrast));
    }
    if interrupted() {
        return None;
    }
    let cutoff = cutoff(model);
    let limit = |nu: &f64| cutoff.map(|cutoff| analysis::perfect_contrast(nu / cutoff));
    Some(FieldContrasts { limit: frequencies.iter().map(limit).collect(), frequencies, fields })
}

fn field_contrast(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
    interrupted: &(impl Fn() -> bool + Sync),
) -> Result<FieldContrast, AnalysisError> {
    let wavefront = analysis::wavefront(model, field, model.primary, accuracy);
    match polychromatic_diffraction_mtf_unless(model, field, frequencies, accuracy, interrupted) {
        Ok(curve) => Ok(FieldContrast { curve, without_diffraction: None, wavefront }),
        Err(why) if why.is_of_diffraction() => {
            let curve = polychromatic_geometric_mtf(model, field, frequencies, accuracy)?;
            Ok(FieldContrast { curve, without_diffraction: Some(why), wavefront })
        }
        Err(why) => Err(why),
    }
}

/// The frequency in cycles/mm at which the contrast of a perfect lens ends.
fn cutoff(model: &RayModel) -> Option<f64> {
    let f_number = model.first_order.working_f_number?.abs();
    Some(1e3 / (model.channels[model.primary].um * f_number)).filter(|nu| nu.is_finite())
}

/// A round frequency up to which the sharpest field has contrast.
pub(super) fn highest_frequency(model: &RayModel, spots: &[Result<Spot, AnalysisError>]) -> f64 {
    let radii = spots.iter().filter_map(|spot| spot.as_ref().ok()).map(|spot| spot.rms);
    let sharpest = radii.map(|Estimate { value, .. }| value).fold(f64::INFINITY, f64::min);
    let seen = REACH / sharpest;
    let most = cutoff(model).map_or(seen, |cutoff| seen.min(cutoff));
    if !(most > 0.0 && most.is_finite()) {
        return cutoff(model).unwrap_or(100.0);
    }
    let power = 10f64.powf(most.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .rev()
        .map(|digit| digit * power)
        .find(|nu| *nu <= most)
        .unwrap_or(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A field takes long where the image is blurred: the next version of the design does not wait for
    /// its end.
    #[test]
    fn contrast_is_interrupted_within_a_field() {
        let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "singlet_la1131");
        let lens = files::json::read(bundled.map_or("", |lens| lens.text), "singlet").unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let asked = AtomicUsize::new(0);
        let chunks = model.fields.len().div_ceil(rayon::current_num_threads());
        let found = field_contrasts(&model, &[], 1e-2, || {
            asked.fetch_add(1, Ordering::SeqCst) > chunks + 2
        });
        assert!(found.is_none(), "it was asked {} times", asked.load(Ordering::SeqCst));
    }
}
