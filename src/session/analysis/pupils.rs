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
    pub sensitivities: Timed<Vec<Result<RimSensitivities, DerivativeError>>>,
    /// The mean sensitivities of all fields with light.
    pub mean_sensitivities: Option<RimSensitivities>,
}

/// The pupils of all fields at the wavelength of the settings, or the primary one.
pub(super) fn field_pupils(
    model: &RayModel,
    settings: &AnalysisSettings,
    accuracy: Accuracy,
) -> FieldPupils {
    let chosen = settings.pupil_wavelength.filter(|chosen| *chosen < model.channels.len());
    let wavelength = chosen.unwrap_or(model.primary);
    let pupil = |field: FieldPoint| time(|| analysis::pupil(model, field, wavelength, accuracy));
    let fields = for_each_field(model, pupil);
    let on_axis =
        |pupil: &&Timed<FieldPupil>| pupil.value.field.x == 0.0 && pupil.value.field.y == 0.0;
    let axis = fields.iter().find(on_axis).cloned();
    let axis = axis.unwrap_or_else(|| pupil(FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }));
    let sensitivities = time(|| {
        for_each_field(model, |field| {
            analysis::rim_sensitivities(model, field, wavelength, accuracy)
        })
    });
    let known = sensitivities.value.iter().zip(&model.fields);
    let known = known
        .filter_map(|(sensitivities, field)| Some((field.weight, sensitivities.as_ref().ok()?)));
    let mean_sensitivities = analysis::mean_rim_sensitivities(&known.collect::<Vec<_>>());
    FieldPupils {
        wavelength,
        fields,
        axis: axis.value.extent.map(|light| light.area),
        sensitivities,
        mean_sensitivities,
    }
}

/// Calls a function for each field in parallel; the results are in the order of the fields.
pub(super) fn for_each_field<T: Send>(
    model: &RayModel,
    of: impl Fn(FieldPoint) -> T + Sync,
) -> Vec<T> {
    model.fields.par_iter().map(|field| of(*field)).collect()
}
