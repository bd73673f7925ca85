//! The wavefront of lenses with errors of making.
//!
//! The mean over all fields of the wavefront's variance at the primary wavelength, less piston and tilt,
//! is a mean square over rays, as the spot is: a quadratic form of the errors with the derivatives of the
//! wavefront of each ray, from one sweep back ([`super::wave_effects`]), at the fixed image plane and with
//! all compensators adjusted within their travel. It is in squares of the primary wavelength; its root is
//! the RMS wavefront.

use super::adjusted::Sensor;
use super::compensation::adjustments;
use super::effects::different_errors;
use super::form::growth_shares;
use super::sensitivity::Stages;
use super::wave_beam::{ArrivedField, WaveBeam};
use super::wave_effects::{WaveNumbers, wave_effects};
use super::{
    Beam, Derivatives, Jet2, Merits, NominalLens, QuadraticForm, RealMerit, RealMeritRequest,
    SecondDerivatives, StopTest, ToleranceError, ToleranceScene, form_spots, perturb,
    refuse_if_stopped,
};
use crate::lens::{Compensator, Lens, Perturbation, System, ToleranceSheet};
use crate::math::{Dual, Real};
use rayon::prelude::*;

/// The wavefront of a lens and what errors of making do to it.
#[derive(Debug, Clone)]
pub struct WavefrontModel {
    /// The mean variance in squared waves as a quadratic form of the errors, at the fixed image plane and
    /// adjusted.
    pub forms: [QuadraticForm; 2],
    adjustments: Vec<Compensator>,
    beam: WaveBeam,
}

impl WavefrontModel {
    /// The wavefront of a lens at a zoom position with its tolerances; all compensators are adjusted for its
    /// least variance.
    ///
    /// # Errors
    /// A lens that focuses nothing, a field without light at the primary wavelength, a ray that does not
    /// arrive, and [`ToleranceError::Stopped`] once `stop` says so.
    pub fn new(
        (lens, zoom): (&Lens, usize),
        scene: &ToleranceScene,
        (sheet, second): (&ToleranceSheet, SecondDerivatives),
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let beam = WaveBeam::new((lens, zoom), scene)?;
        let arrived = beam.trace(&scene.lens.systems)?;
        let adjustments = adjustments(sheet);
        let travel = adjustments[0].travel;
        let focus = best_plane(&beam, &arrived).clamp(-travel, travel);
        let numbers = WaveNumbers::new(scene, sheet)?;
        let effects = wave_effects((scene, &beam), &numbers, (&arrived, focus), stop)?;
        let [mut near, mut best] = effects;
        if second == SecondDerivatives::Traced {
            let errors: Vec<Perturbation> = sheet.errors.iter().map(|own| own.error).collect();
            near.exact = Some(second_derivatives((scene, &beam), &errors, 0.0, stop)?);
            best.exact = Some(second_derivatives((scene, &beam), &errors, focus, stop)?);
        }
        Ok(Self { forms: [near.fixed(), best.adjusted(&adjustments)], adjustments, beam })
    }

    /// The variance of the lens as designed in squared waves, at the fixed image plane and adjusted.
    pub fn nominal(&self) -> [f64; 2] {
        self.forms.each_ref().map(QuadraticForm::as_designed)
    }

    /// The displacement of the image plane of the lens as designed in mm.
    pub fn focus(&self) -> f64 {
        let adjusted = self.forms[1].adjusted.as_ref();
        adjusted.and_then(|own| own.as_designed().first().copied()).unwrap_or_default()
    }

    /// The derivatives of the variance by an error at the fixed image plane and adjusted, in squared waves
    /// per unit and squared unit of the error.
    pub fn derivatives(&self, error: usize) -> [Derivatives; 2] {
        self.forms.each_ref().map(|form| form.derivatives(error))
    }

    /// The variance of lenses with random errors by their rays, in squared waves. Each is adjusted as the form
    /// has it, within the travel of the compensators, and then refocused for its own least variance.
    ///
    /// # Errors
    /// Correlations that no errors can have, an error of making that is not possible, and
    /// [`ToleranceError::Stopped`] if there is no lens yet.
    pub fn real_lenses(
        &self,
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        request: RealMeritRequest,
        stop: StopTest<'_>,
    ) -> Result<RealMerit, ToleranceError> {
        RealMerit::new(sheet, request, stop, |errors| self.lens(&scene.lens, errors))
    }

    /// The share of each error in the growth of the expected variance, at the fixed image plane and adjusted;
    /// correlated errors share what they do together.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn growth_shares(&self, sheet: &ToleranceSheet) -> Result<Vec<[f64; 2]>, ToleranceError> {
        growth_shares(&self.forms, sheet)
    }

    /// The root of the expected variance of lenses that are made in waves, at the fixed image plane and
    /// adjusted; where the travel of a compensator has an end, that of random lenses by the form.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn expected_rms(&self, sheet: &ToleranceSheet) -> Result<[f64; 2], ToleranceError> {
        let [fixed, adjusted] = self.forms.each_ref().map(|form| expected(form, sheet));
        Ok([fixed?, adjusted?].map(|variance| variance.max(0.0).sqrt()))
    }

    /// The variance of a lens with errors at its image plane and adjusted; `None` if a ray does not arrive.
    fn lens(
        &self,
        lens: &NominalLens,
        errors: &[(Perturbation, f64)],
    ) -> Result<Option<[f64; 2]>, ToleranceError> {
        let traced = |systems: &[System<f64>]| match self.beam.trace(systems) {
            Err(ToleranceError::RayLost { .. }) => Ok(None),
            found => found.map(Some),
        };
        let Some(arrived) = traced(&perturb(lens, errors)?)? else { return Ok(None) };
        let fixed = self.beam.variance(&arrived, &vec![0.0; arrived.len()]);
        let Some(adjusted) = &self.forms[1].adjusted else { return Ok(Some([fixed; 2])) };
        let values: Vec<f64> = errors.iter().map(|(_, value)| *value).collect();
        let positions = adjusted.with_errors(&values);
        let moved = self.adjustments.iter().zip(&positions);
        let moved: Vec<_> =
            moved.filter_map(|(own, position)| Some((own.part.in_lens()?, *position))).collect();
        let arrived = if moved.is_empty() {
            Some(arrived)
        } else {
            let all: Vec<_> = errors.iter().copied().chain(moved).collect();
            traced(&perturb(lens, &all)?)?
        };
        Ok(arrived.map(|arrived| [fixed, self.refocused(&arrived, positions)]))
    }

    /// The least variance of a lens with its compensators in some positions over those of the focus.
    fn refocused(&self, arrived: &[ArrivedField<f64>], mut positions: Vec<f64>) -> f64 {
        let jets: Vec<_> = arrived.iter().map(|field| field.map(Jet2::from_f64)).collect();
        let travel = self.adjustments[0].travel;
        let at = |positions: &[f64]| -> Derivatives {
            let sensor = Sensor::new(&self.adjustments, positions);
            let shift = |field: &ArrivedField<f64>| {
                let [x, y, u, v, _] = field.chief();
                let ([_, _, z], advance) = sensor.meet(&[x, y, u, v]);
                Jet2::from_f64(z)
                    + Jet2::from_f64(advance) * Jet2::variable(Dual::variable(0.0, 0), 0)
            };
            let shifts: Vec<Jet2> = arrived.iter().map(shift).collect();
            self.beam.variance(&jets, &shifts).into()
        };
        let mut found = at(&positions);
        for _ in 0..LENS_STEPS {
            if !(found.second > 0.0) {
                break;
            }
            let mut next = positions.clone();
            next[0] = (next[0] - found.first / found.second).clamp(-travel, travel);
            let better = at(&next);
            if !(better.value < found.value) {
                break;
            }
            (positions, found) = (next, better);
        }
        found.value
    }
}

/// The expectation of a form; of random lenses where it is no quadratic one.
fn expected(form: &QuadraticForm, sheet: &ToleranceSheet) -> Result<f64, ToleranceError> {
    if !form.has_stops() {
        return form.expectation(sheet);
    }
    let lenses = form_spots(form, sheet, SEED)?;
    Ok(lenses.iter().map(|rms| rms * rms).sum::<f64>() / lenses.len().max(1) as f64)
}

/// The seed of random lenses by a form.
const SEED: u64 = 0xA7E5;
/// Steps to the best image plane: the variance is nearly a quadratic function of its position.
const STEPS: usize = 5;
/// The same for a lens with errors, which begins near it.
const LENS_STEPS: usize = 2;

/// The displacement of the image plane in mm at which the mean variance is least.
fn best_plane(beam: &WaveBeam, arrived: &[ArrivedField<f64>]) -> f64 {
    let jets: Vec<_> = arrived.iter().map(|field| field.map(Jet2::from_f64)).collect();
    let mut focus = 0.0;
    for _ in 0..STEPS {
        let shift = Jet2::variable(Dual::variable(focus, 0), 0);
        let found: Derivatives = beam.variance(&jets, &vec![shift; jets.len()]).into();
        if !(found.second > 0.0) {
            break;
        }
        focus -= found.first / found.second;
    }
    focus
}

/// The second derivatives of the variance by each error at an image plane that is displaced, those of rays by
/// errors included: by second-order jets, once for each different error.
fn second_derivatives(
    (scene, beam): (&ToleranceScene, &WaveBeam),
    errors: &[Perturbation],
    plane: f64,
    stop: StopTest<'_>,
) -> Result<Vec<f64>, ToleranceError> {
    let mut lens = scene.lens.clone();
    for system in &mut lens.systems {
        let last = system.surfaces.len().saturating_sub(2);
        system.surfaces[last].thickness += plane;
    }
    let options = beam.options();
    let rays = primary_rays(scene);
    let stages = Stages::new(&lens, &rays, options)?;
    let (different, places) = different_errors(errors);
    let mean = |merits: &Merits<Jet2>| {
        let fields = merits.wavefronts.iter().zip(&rays.fields);
        fields.fold(Jet2::ZERO, |sum, (wavefront, field)| {
            sum + wavefront.tilt_removed * Jet2::from_f64(field.weight)
        })
    };
    let one = |error: &Perturbation| {
        refuse_if_stopped(stop)?;
        let variable = Jet2::variable(Dual::variable(0.0, 0), 0);
        let merits = stages.merits(&lens, options, &[(*error, variable)])?.0;
        Ok(Derivatives::from(mean(&merits)).second)
    };
    let found: Vec<f64> = different.par_iter().map(one).collect::<Result<_, ToleranceError>>()?;
    Ok(places.iter().map(|place| found[*place]).collect())
}

/// The rays of the primary wavelength alone.
fn primary_rays(scene: &ToleranceScene) -> Beam {
    let mut beam = scene.beam.clone();
    for field in &mut beam.fields {
        field.colours.retain(|colour| colour.wavelength == scene.lens.primary);
    }
    beam
}
