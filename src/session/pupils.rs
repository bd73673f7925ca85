//! The pupils of all fields, each with its time.

use super::analyst::each;
use super::clock::{Timed, timed};
use super::view::Settings;
use crate::analysis;
use crate::analysis::{Estimate, Pupil, Rims};
use crate::lens::Field;
use crate::pupil::{Accuracy, Bench, NoDerivative};

/// The pupils of all fields at one wavelength.
#[derive(Debug, Clone)]
pub struct Pupils {
    /// The wavelength.
    pub wavelength: usize,
    /// The pupil of each field, in order.
    pub fields: Vec<Timed<Pupil>>,
    /// The area of the pupil on the axis, in mm²; `None` where that one is dark.
    pub axis: Option<Estimate>,
    /// What the rims of the lens do to each field, or why that is not known.
    pub rims: Timed<Vec<Result<Rims, NoDerivative>>>,
    /// What they do to all fields with light together.
    pub all_rims: Option<Rims>,
}

/// The pupils of all fields at the wavelength that is asked for, or the primary one.
pub(super) fn pupils(bench: &Bench, settings: &Settings, accuracy: Accuracy) -> Pupils {
    let chosen = settings.pupil_wavelength.filter(|chosen| *chosen < bench.colors.len());
    let wavelength = chosen.unwrap_or(bench.primary);
    let pupil = |field: Field| timed(|| analysis::pupil(bench, field, wavelength, accuracy));
    let fields = each(bench, pupil);
    let on_axis = |pupil: &&Timed<Pupil>| pupil.value.field.x == 0.0 && pupil.value.field.y == 0.0;
    let axis = fields.iter().find(on_axis).cloned();
    let axis = axis.unwrap_or_else(|| pupil(Field { x: 0.0, y: 0.0, weight: 1.0 }));
    let rims = timed(|| each(bench, |field| analysis::rims(bench, field, wavelength, accuracy)));
    let known = rims.value.iter().zip(&bench.fields);
    let known = known.filter_map(|(rims, field)| Some((field.weight, rims.as_ref().ok()?)));
    let all_rims = analysis::together(&known.collect::<Vec<_>>());
    Pupils { wavelength, fields, axis: axis.value.light.map(|light| light.area), rims, all_rims }
}
