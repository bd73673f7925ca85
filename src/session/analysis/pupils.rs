//! The pupils of all fields, each with its time.

use super::AnalysisSettings;
use crate::analysis;
use crate::analysis::{Estimate, FieldPupil, RimSensitivities};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, DerivativeError, RayModel};
use crate::session::clock::{Timed, time};
use rayon::prelude::*;

/// The pupils of all fields at one wavelength.
#[derive(Debug, Clone)]
pub struct FieldPupils {
    /// The index of the wavelength.
    pub wavelength: usize,
    /// The pupil of each field, in order.
    pub fields: Vec<Timed<FieldPupil>>,
    /// The area of the pupil on the axis, in mm²; `None` if that pupil is dark.
    pub axis: Option<Estimate>,
    /// The sensitivities of each field to the semi-diameters, or the reason why they are unknown.
    pub rims: Timed<Vec<Result<RimSensitivities, DerivativeError>>>,
    /// The mean sensitivities of all fields with light.
    pub all_rims: Option<RimSensitivities>,
}

/// The pupils of all fields at the wavelength of the settings, or the primary one.
pub(super) fn field_pupils(
    bench: &RayModel,
    settings: &AnalysisSettings,
    accuracy: Accuracy,
) -> FieldPupils {
    let chosen = settings.pupil_wavelength.filter(|chosen| *chosen < bench.channels.len());
    let wavelength = chosen.unwrap_or(bench.primary);
    let pupil = |field: FieldPoint| time(|| analysis::pupil(bench, field, wavelength, accuracy));
    let fields = for_each_field(bench, pupil);
    let on_axis =
        |pupil: &&Timed<FieldPupil>| pupil.value.field.x == 0.0 && pupil.value.field.y == 0.0;
    let axis = fields.iter().find(on_axis).cloned();
    let axis = axis.unwrap_or_else(|| pupil(FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }));
    let rims = time(|| {
        for_each_field(bench, |field| {
            analysis::rim_sensitivities(bench, field, wavelength, accuracy)
        })
    });
    let known = rims.value.iter().zip(&bench.fields);
    let known = known.filter_map(|(rims, field)| Some((field.weight, rims.as_ref().ok()?)));
    let all_rims = analysis::mean_rim_sensitivities(&known.collect::<Vec<_>>());
    FieldPupils {
        wavelength,
        fields,
        axis: axis.value.extent.map(|light| light.area),
        rims,
        all_rims,
    }
}

/// Calls a function for each field in parallel; the results are in the order of the fields.
pub(super) fn for_each_field<T: Send>(
    bench: &RayModel,
    of: impl Fn(FieldPoint) -> T + Sync,
) -> Vec<T> {
    bench.fields.par_iter().map(|field| of(*field)).collect()
}
