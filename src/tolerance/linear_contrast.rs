//! The contrast of lenses with errors of making, of which each ray moves by its derivatives.
//!
//! The contrast is no linear function of the errors even where the motion of each ray is: it is computed of
//! the moved rays. None is traced but for the sweep that gives their derivatives by all errors at once.

use super::adjusted::Sensor;
use super::compensation::{Compensation, adjustments};
use super::contrast::{ContrastChange, field_contrast, tangential};
use super::effects::{ErrorCombinations, combinations};
use super::form::AdjustedForm;
use super::merits::open_tracers;
use super::monte_carlo::LandedField;
use super::spot::ImageRay;
use super::two_planes::{SweptRays, TwoPlanes};
use super::{
    ColourRays, FocusTreatment, MadeNumber, QuadraticForm, RayEffects, SecondDerivatives, StopTest,
    ToleranceError, ToleranceScene, refuse_if_stopped,
};
use crate::lens::{Compensator, Perturbation, ToleranceSheet};
use crate::trace::{Rays, Tracer};
use rayon::prelude::*;

/// The changes of the contrast of the rays of `scene` by each error; compensators are adjusted as the spots of
/// the rays of `coarse` need it. `None` for a lens whose rays are not swept back.
///
/// # Errors
/// An error or a compensator that is not possible, a ray that does not arrive, and
/// [`ToleranceError::Stopped`] once `stop` says so.
pub(super) fn linear_changes(
    (coarse, scene): (&ToleranceScene, &ToleranceScene),
    (sheet, frequency): (&ToleranceSheet, f64),
    stop: StopTest<'_>,
) -> Result<Option<Vec<ContrastChange>>, ToleranceError> {
    if !open_tracers(&scene.lens.systems)?.iter().all(Tracer::has_error_slopes) {
        return Ok(None);
    }
    let judge = LinearJudge::new(coarse, (sheet, frequency), stop)?;
    let planes = TwoPlanes::new(scene, 0.0)?;
    let mut sum: Option<Vec<ContrastChange>> = None;
    for field in 0..scene.beam.fields.len() {
        let found = judge.field((scene, &planes), field, stop)?;
        sum = Some(match sum {
            None => found,
            Some(sum) => sum.into_iter().zip(found).map(|(a, b)| a.plus(b)).collect(),
        });
    }
    Ok(sum)
}

/// The errors and compensators of a lens as combinations of its numbers.
struct LinearJudge<'a> {
    sheet: &'a ToleranceSheet,
    frequency: f64,
    /// The compensators, focus first, and how they are adjusted.
    adjustments: Vec<Compensator>,
    adjusted: AdjustedForm,
    numbers: Vec<MadeNumber>,
    /// The combinations of the errors, then those of what is adjusted in the lens.
    combinations: ErrorCombinations,
}

impl<'a> LinearJudge<'a> {
    fn new(
        scene: &ToleranceScene,
        (sheet, frequency): (&'a ToleranceSheet, f64),
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let errors: Vec<Perturbation> = sheet.errors.iter().map(|own| own.error).collect();
        let effects = RayEffects::new(scene, &errors, SecondDerivatives::Neglected, stop)?;
        let compensation = Compensation::new(scene, sheet)?;
        let form = QuadraticForm::new(&effects, FocusTreatment::Refocused, &compensation);
        let missing = || ToleranceError::Other("the lens has no best focus".to_owned());
        let adjustments = adjustments(sheet);
        let in_lens = adjustments.iter().filter_map(|own| own.part.in_lens());
        let all: Vec<Perturbation> = errors.iter().copied().chain(in_lens).collect();
        let (numbers, combinations) = combinations(scene, &all);
        let adjusted = form.adjusted.ok_or_else(missing)?;
        Ok(Self { sheet, frequency, adjustments, adjusted, numbers, combinations })
    }

    /// The changes of the contrast of a field, times its weight.
    fn field(
        &self,
        (scene, planes): (&ToleranceScene, &TwoPlanes),
        field: usize,
        stop: StopTest<'_>,
    ) -> Result<Vec<ContrastChange>, ToleranceError> {
        let beam = &scene.beam.fields[field];
        let rays = |colour: &ColourRays| {
            (colour.wavelength, colour.rays.iter().copied().collect::<Rays<f64>>())
        };
        let colours: Vec<_> = beam.colours.iter().map(rays).collect();
        let swept = planes.rays(scene, field, &colours)?;
        let weights: Vec<f64> = beam.colours.iter().flat_map(|c| c.weights.clone()).collect();
        let at_rest = swept.at_rest();
        let landed = landed(beam.weight, at_rest.iter().copied().zip(weights.iter().copied()));
        let errors = self.sheet.errors.len();
        let linear = LinearField {
            judge: self,
            weight: beam.weight,
            along: tangential(&landed),
            adjusted_by: (errors..self.combinations.len())
                .map(|i| self.changes(&swept, i))
                .collect(),
            rays: at_rest,
            weights,
        };
        let nominal = linear.contrast(&[], (0, 0.0));
        let change = |i: usize| {
            refuse_if_stopped(stop)?;
            let changes = self.changes(&swept, i);
            let contrast = |value: f64| Ok(Some(linear.contrast(&changes, (i, value))));
            let half_range = self.sheet.errors[i].half_range;
            let found = ContrastChange::of_range(half_range, nominal, contrast)?;
            Ok(found.unwrap_or_default())
        };
        (0..errors).into_par_iter().map(change).collect()
    }

    /// The derivatives of rays by an error or by what is adjusted in the lens.
    fn changes(&self, swept: &SweptRays, number: usize) -> Vec<ImageRay<f64>> {
        swept.changes(self.combinations[number].iter().map(|(m, by)| (&self.numbers[*m], *by)))
    }
}

/// The rays of a field at the image plane with their derivatives.
struct LinearField<'a> {
    judge: &'a LinearJudge<'a>,
    weight: f64,
    /// The tangential direction.
    along: [f64; 2],
    rays: Vec<ImageRay<f64>>,
    weights: Vec<f64>,
    /// By each compensator in the lens.
    adjusted_by: Vec<Vec<ImageRay<f64>>>,
}

impl LinearField<'_> {
    /// The contrast with an error by which the rays change so, at the fixed image plane and adjusted.
    fn contrast(&self, changes: &[ImageRay<f64>], (error, value): (usize, f64)) -> [f64; 2] {
        let judge = self.judge;
        let mut errors = vec![0.0; judge.sheet.errors.len()];
        if let Some(own) = errors.get_mut(error) {
            *own = value;
        }
        let positions = judge.adjusted.with_errors(&errors);
        let sensor = Sensor::new(&judge.adjustments, &positions);
        let moved = |i: usize| -> ImageRay<f64> {
            let by = changes.get(i).copied().unwrap_or_default();
            std::array::from_fn(|k| self.rays[i][k] + value * by[k])
        };
        let in_lens = judge.adjustments.iter().zip(&positions);
        let in_lens: Vec<f64> =
            in_lens.filter(|(own, _)| own.part.in_lens().is_some()).map(|(_, at)| *at).collect();
        let adjusted = |i: usize| -> ImageRay<f64> {
            let mut ray = moved(i);
            for (by, position) in self.adjusted_by.iter().zip(&in_lens) {
                ray.iter_mut().zip(by[i]).for_each(|(to, by)| *to += position * by);
            }
            let ([x, y, _], _) = sensor.meet(&ray);
            [x, y, ray[2], ray[3]]
        };
        let contrast = |ray: &dyn Fn(usize) -> ImageRay<f64>| {
            let rays = (0..self.rays.len()).map(|i| (ray(i), self.weights[i]));
            field_contrast(&landed(self.weight, rays), self.along, judge.frequency)
        };
        [contrast(&moved), contrast(&adjusted)]
    }
}

fn landed(weight: f64, rays: impl Iterator<Item = (ImageRay<f64>, f64)>) -> LandedField {
    LandedField { weight, rays: rays.collect() }
}
