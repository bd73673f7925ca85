//! The state shared by all local optimizers: scaled variables with bounds, the best lens, and steps
//! that never make the lens invalid.

use super::{OptimizationEnd, OptimizationProgress};
use crate::lens::{ASPHERE_TERMS, Lens, Medium, Quantity, RADIAL_TERMS, Variable};
use crate::merit::{DerivativeLevel, Merit, MeritError, PupilForms, SumOfSquares, TermValue};
use crate::solve::AdamMoments;
use nalgebra::DVector;

/// The number of times a step is halved before it is rejected.
const MAX_HALVINGS: usize = 12;
/// The number of steps after which the rays of the spots are found anew.
const RESAMPLE: usize = 25;
/// The number of consecutive verifications without a better lens that end the search.
const PATIENCE: usize = 4;
/// The relative improvement below which a lens counts as no better.
const SMALLEST_GAIN: f64 = 1e-4;

/// A lens under optimization, with its merit function and the best lens so far.
#[derive(Debug, Clone)]
pub(super) struct OptimizerState {
    pub(super) merit: Merit,
    /// The variables at the current step.
    pub(super) values: Vec<f64>,
    /// The change of each variable that corresponds to a scaled step of 1.
    pub(super) scales: Vec<f64>,
    /// The upper bound of each scale.
    max_scales: Vec<f64>,
    pub(super) current: Lens,
    pub(super) best: Lens,
    pub(super) value: f64,
    pub(super) best_value: f64,
    /// The best lens with newly found rays, and its merit.
    verified: Lens,
    verified_value: f64,
    /// The number of verifications since then that found no better lens.
    pub(super) failed_verifications: usize,
    pub(super) steps: usize,
    /// The number of successful evaluations of the merit; failed ones cost little.
    pub(super) evaluations: usize,
    pub(super) refused: Option<String>,
}

impl OptimizerState {
    pub(super) fn new(merit: Merit, lens: &Lens) -> Result<Self, MeritError> {
        Self::with_evaluation(merit, lens, DerivativeLevel::Value).map(|(state, _)| state)
    }

    /// Starts from a lens; returns its merit with the derivatives asked for.
    pub(super) fn with_evaluation(
        merit: Merit,
        lens: &Lens,
        detail: DerivativeLevel,
    ) -> Result<(Self, SumOfSquares), MeritError> {
        if merit.variables().is_empty() {
            return Err(MeritError::NoVariables);
        }
        let values = merit.values(lens);
        let sum = merit.evaluate(&values, detail)?;
        let value = sum.value;
        let scales: Vec<f64> = merit.variables().iter().map(|v| scale(lens, v)).collect();
        let state = Self {
            merit,
            values,
            max_scales: scales.clone(),
            scales,
            current: lens.clone(),
            best: lens.clone(),
            value,
            best_value: value,
            verified: lens.clone(),
            verified_value: value,
            failed_verifications: 0,
            steps: 0,
            evaluations: 1,
            refused: None,
        };
        Ok((state, sum))
    }

    /// Takes a step in scaled variables, halved until the lens is valid. Returns the fraction of
    /// the step that was taken, 0 if `accept` rejects the merit, and the new sum.
    pub(super) fn advance(
        &mut self,
        step: &[f64],
        detail: DerivativeLevel,
        accept: impl Fn(f64) -> bool,
    ) -> (f64, Option<SumOfSquares>) {
        let mut fraction = 1.0;
        for _ in 0..MAX_HALVINGS {
            let proposal = self.proposal(step, fraction);
            let found = self.evaluate(&proposal, detail);
            self.evaluations += usize::from(found.is_ok());
            match found {
                Ok((sum, pupils)) if accept(sum.value) => {
                    self.accept_step(proposal, sum.value, pupils);
                    return (fraction, Some(sum));
                }
                Ok(_) => return (0.0, None),
                Err(cause) => self.record_refusal(step, &cause),
            }
            fraction *= 0.5;
        }
        (0.0, None)
    }

    /// Rescales every variable by its effect: a scaled step of 1 changes the residuals by their own
    /// size.
    pub(super) fn rescale(&mut self, sum: &SumOfSquares) {
        for (i, scale) in self.scales.iter_mut().enumerate() {
            let measured = (sum.value / sum.normal[(i, i)]).sqrt();
            if measured.is_finite() && measured > 0.0 {
                *scale = measured.min(self.max_scales[i]);
            }
        }
    }

    /// The scaled change that leads from the current values to others.
    pub(super) fn scaled_change(&self, values: &[f64]) -> DVector<f64> {
        let changes = values.iter().zip(&self.values).zip(&self.scales);
        DVector::from_iterator(values.len(), changes.map(|((to, from), scale)| (to - from) / scale))
    }

    /// The variables after a fraction of a step, clamped to their bounds.
    pub(super) fn proposal(&self, step: &[f64], fraction: f64) -> Vec<f64> {
        let step: Vec<f64> = step.iter().map(|change| fraction * change).collect();
        self.moved(&self.values, &step)
    }

    /// Values of the variables after a scaled change, clamped to their bounds.
    pub(super) fn moved(&self, values: &[f64], change: &[f64]) -> Vec<f64> {
        let moved =
            |i: usize| clamp(&self.merit.variables()[i], values[i] + change[i] * self.scales[i]);
        (0..values.len()).map(moved).collect()
    }

    /// The merit at some values, and the pupils there; an error if the lens that they define is invalid.
    pub(super) fn evaluate(
        &self,
        values: &[f64],
        detail: DerivativeLevel,
    ) -> Result<(SumOfSquares, PupilForms), MeritError> {
        self.check_finite(values)?;
        self.merit.evaluate_with_pupils(values, detail)
    }

    /// Returns an error if a value of a variable is not finite.
    pub(super) fn check_finite(&self, values: &[f64]) -> Result<(), MeritError> {
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            let parameter = self.merit.variables()[i].parameter;
            let found = values[i];
            let what = parameter.to_string();
            let expected = "a finite number";
            return Err(crate::lens::LensError::InvalidNumber { what, found, expected }.into());
        }
        Ok(())
    }

    /// Goes to values with their merit. Further trials track the pupils from there: tracked from the lens
    /// whose rays were found last, an edge whose arcs have changed since would be searched for at every one.
    pub(super) fn accept_step(&mut self, values: Vec<f64>, value: f64, pupils: PupilForms) {
        self.merit.follow_pupils(pupils);
        self.values = values;
        self.value = value;
        self.current = self.merit.lens(&self.values);
        if value < self.best_value {
            self.best_value = value;
            self.best.clone_from(&self.current);
        }
    }

    /// Records the reason for which a step was rejected and the variable that it moved most.
    pub(super) fn record_refusal(&mut self, step: &[f64], cause: &MeritError) {
        let most = (0..step.len()).max_by(|a, b| step[*a].abs().total_cmp(&step[*b].abs()));
        let parameter = most.map(|i| self.merit.variables()[i].parameter.to_string());
        let parameter = parameter.unwrap_or_default();
        self.refused = Some(format!("{cause}; the step moved the {parameter} most"));
    }

    /// Finds the rays of the spots anew every [`RESAMPLE`] steps, because the pupil has moved.
    ///
    /// In between, the merit is that of the rays of an earlier lens. Here the best lens is verified
    /// with its own rays; a search that finds none better several times in a row has ended. A lens
    /// that has lost its light is replaced by the best one. Returns true if the merit function has
    /// changed.
    pub(super) fn resample_if_due(&mut self) -> bool {
        if self.steps == 0 || !self.steps.is_multiple_of(RESAMPLE) {
            return false;
        }
        self.verify_best();
        let mut merit = self.merit.clone();
        let value = merit.resample(&self.current).and_then(|()| merit.value(&self.values));
        match value {
            Ok(value) => (self.merit, self.value) = (merit, value),
            Err(cause) => {
                self.refused = Some(cause.to_string());
                self.return_to_best();
            }
        }
        true
    }

    /// Evaluates the best lens with its own rays, and returns to the best lens verified before if
    /// that is better.
    pub(super) fn verify_best(&mut self) {
        let mut merit = self.merit.clone();
        let values = merit.values(&self.best);
        let value = merit.resample(&self.best).and_then(|()| merit.value(&values));
        let enough = self.verified_value - SMALLEST_GAIN * self.verified_value.abs();
        match value {
            Ok(value) if value < enough => {
                self.verified.clone_from(&self.best);
                self.verified_value = value;
                self.failed_verifications = 0;
            }
            Ok(_) | Err(_) => self.failed_verifications += 1,
        }
        self.best.clone_from(&self.verified);
        self.best_value = self.verified_value;
    }

    /// True if the latest verifications have found no better lens.
    pub(super) fn has_ended(&self) -> bool {
        self.failed_verifications >= PATIENCE
    }

    /// Makes the best lens the current one.
    pub(super) fn return_to_best(&mut self) {
        self.current.clone_from(&self.best);
        self.values = self.merit.values(&self.best);
        self.value = self.merit.value(&self.values).unwrap_or(self.best_value);
    }

    pub(super) fn progress(
        &mut self,
        accepted: f64,
        end: Option<OptimizationEnd>,
    ) -> OptimizationProgress {
        self.steps += 1;
        OptimizationProgress {
            step: self.steps,
            evaluations: self.evaluations,
            merit: self.value,
            best: self.best_value,
            accepted,
            refused: self.refused.take(),
            finished: end.is_some(),
            end,
        }
    }

    /// The range by which each scaled variable may change.
    pub(super) fn room(&self) -> Vec<[f64; 2]> {
        self.room_from(&self.values)
    }

    /// The range by which each scaled variable may change from these values.
    pub(super) fn room_from(&self, values: &[f64]) -> Vec<[f64; 2]> {
        let range = |i: usize| {
            let (variable, value) = (&self.merit.variables()[i], values[i]);
            let low = variable.min.map_or(f64::NEG_INFINITY, |min| (min - value).min(0.0));
            let high = variable.max.map_or(f64::INFINITY, |max| (max - value).max(0.0));
            [low / self.scales[i], high / self.scales[i]]
        };
        (0..values.len()).map(range).collect()
    }

    /// Evaluates the current lens with newly found rays. As long as the merit agrees with that of
    /// the earlier rays to a relative tolerance, those stay. Otherwise the new ones take their
    /// place; if the lens is then worse than the one verified last, that lens becomes the current
    /// one. Returns the merit if the rays have changed.
    pub(super) fn check_rays(&mut self, tolerance: f64) -> Option<SumOfSquares> {
        let fresh = self.with_own_rays(&self.current);
        let value = fresh.as_ref().map_or(f64::INFINITY, |(_, sum)| sum.value);
        let is_same = (value - self.value).abs() <= tolerance * self.value.abs();
        let is_better = value <= self.verified_value;
        if is_better {
            self.verified.clone_from(&self.current);
            self.verified_value = value;
        }
        if is_same {
            self.best.clone_from(&self.current);
            self.best_value = self.value;
            return None;
        }
        self.best.clone_from(&self.verified);
        self.best_value = self.verified_value;
        self.failed_verifications = if is_better { 0 } else { self.failed_verifications + 1 };
        let (merit, sum) = if is_better { fresh } else { self.with_own_rays(&self.verified) }?;
        self.current.clone_from(&self.verified);
        self.values = merit.values(&self.current);
        (self.merit, self.value) = (merit, sum.value);
        Some(sum)
    }

    /// The merit function with the rays of a lens, and its value there.
    pub(super) fn with_own_rays(&self, lens: &Lens) -> Option<(Merit, SumOfSquares)> {
        let mut merit = self.merit.clone();
        merit.resample(lens).ok()?;
        let sum = merit.evaluate(&merit.values(lens), DerivativeLevel::Normal).ok()?;
        Some((merit, sum))
    }

    /// True for each variable at a bound that a descent would cross.
    pub(super) fn at_bounds(&self, gradient: &[f64]) -> Vec<bool> {
        let held = |i: usize| {
            let variable = &self.merit.variables()[i];
            let value = self.values[i];
            let down = gradient[i] > 0.0 && variable.min.is_some_and(|min| value <= min);
            let up = gradient[i] < 0.0 && variable.max.is_some_and(|max| value >= max);
            down || up
        };
        (0..self.values.len()).map(held).collect()
    }

    /// The step of Adam in scaled variables, zero for variables at an active bound; updates the
    /// moments with the gradient.
    pub(super) fn adam_step(
        &self,
        moments: &mut AdamMoments,
        gradient: &[f64],
        rate: f64,
    ) -> Vec<f64> {
        let scaled: Vec<f64> = gradient.iter().zip(&self.scales).map(|(g, s)| g * s).collect();
        let mut step = moments.step(&scaled, rate);
        let active = self.at_bounds(gradient);
        step.iter_mut().zip(active).filter(|(_, active)| *active).for_each(|(s, _)| *s = 0.0);
        step
    }

    /// The terms of the best lens, with its own rays.
    pub(super) fn terms(&self) -> Result<Vec<TermValue>, MeritError> {
        let mut merit = self.merit.clone();
        // The rays of the current lens were found a few steps ago.
        if self.best != self.current || self.has_ended() {
            merit.resample(&self.best)?;
        }
        merit.terms(&merit.values(&self.best))
    }
}

pub(super) fn clamp(variable: &Variable, value: f64) -> f64 {
    let low = variable.min.map_or(value, |min| value.max(min));
    variable.max.map_or(low, |max| low.min(max))
}

/// The scale of a variable: a change that deflects rays about as much as the scale of any other
/// variable does.
pub(super) fn scale(lens: &Lens, variable: &Variable) -> f64 {
    let size = lens.total_track().max(1e-6);
    let rim = lens.surfaces[variable.parameter.surface].semi_diameter.unwrap_or(0.1 * size);
    // A closed rim has to be able to open, by steps of the size of the others.
    let widest = lens.surfaces.iter().filter_map(|row| row.semi_diameter).fold(0.0, f64::max);
    let rim = rim.max(0.5 * widest).clamp(1e-3 * size, size);
    match variable.parameter.quantity {
        Quantity::Curvature => 0.1 / rim.max(0.05 * size),
        Quantity::Conic => 1.0,
        // The same sag at the rim as for the scale of the curvature.
        Quantity::Asphere(term) => {
            let power = 2 * term.min(ASPHERE_TERMS) as i32 + 4;
            0.05 / rim.powi(power - 1)
        }
        Quantity::Thickness | Quantity::SemiDiameter => 0.1 * rim,
        Quantity::Index => 0.1,
        // The same index change at the rim, or at the other face, for all coefficients.
        Quantity::Grin(k) => match &lens.surfaces[variable.parameter.surface].medium {
            Medium::Grin(gradient) => {
                let length = if k < RADIAL_TERMS { rim } else { size };
                0.02 * length.powi(gradient.power(k))
            }
            _ => 1.0,
        },
        // The same sag at the rim as for an asphere.
        Quantity::Freeform(k) => {
            let form = lens.surfaces[variable.parameter.surface].freeform.as_ref();
            form.map_or(1.0, |form| 0.05 * rim.powi(form.kind.power(k)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Parameter, blank};

    #[test]
    fn curvature_and_aspheres_have_scales_of_the_same_sag_at_the_rim() {
        let mut lens = blank();
        lens.surfaces[0].semi_diameter = Some(14.0);
        let scale = |quantity: Quantity| {
            let parameter = Parameter::new(0, quantity);
            scale(&lens, &Variable { parameter, min: None, max: None })
        };
        // c r²/2 and a r^(4 + 2 k).
        let sag = scale(Quantity::Curvature) * 14.0 * 14.0 / 2.0;
        assert!(sag > 0.0);
        for term in 0..ASPHERE_TERMS {
            let same = scale(Quantity::Asphere(term)) * 14f64.powi(4 + 2 * term as i32);
            assert!((same / sag - 1.0).abs() < 1e-12, "{term}: {same} {sag}");
        }
    }
}
