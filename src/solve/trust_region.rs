//! A trust-region method for sums of squares, with a secant approximation of the second derivatives
//! of the residuals.
//!
//! Half the Hessian of `Σ r²` is `JᵀJ + Σ r ∇²r`. The Gauss-Newton model leaves out the second part
//! and stalls where residuals stay large. The augmented model adds a symmetric matrix `S` in its
//! place, which is corrected after every trial so that the model reproduces the change of the
//! gradient (Dennis, Gay, Welsch, *An adaptive nonlinear least-squares algorithm*, ACM TOMS 7
//! (1981) 348). The model that predicted the last trial better makes the next step, as far as the
//! trust region reaches in units of the measured effect of every parameter (Moré 1978). Limits are in the
//! model by themselves.

use super::separate::{PiecewiseModel, SeparateResidual};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A sum of squares at one point, with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresPoint {
    /// `Σ r²`.
    pub value: f64,
    /// `Jᵀr`, half the gradient.
    pub half_gradient: DVector<f64>,
    /// `JᵀJ`.
    pub normal: DMatrix<f64>,
    /// Residuals that are known by themselves. Those that count are in the sum.
    pub separate: Vec<SeparateResidual>,
}

/// The matrix that a step takes for half the Hessian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HessianModel {
    /// `JᵀJ`.
    GaussNewton,
    /// `JᵀJ + S`.
    Augmented,
}

/// A proposed step.
#[derive(Debug, Clone, PartialEq)]
pub struct TrustRegionStep {
    /// The change of every parameter.
    pub change: DVector<f64>,
    /// The decrease of the sum of squares that the model predicts.
    pub predicted: f64,
}

/// The state of the method between two trials.
#[derive(Debug, Clone, PartialEq)]
pub struct TrustRegion {
    /// The largest length of a step in scaled parameters; `None` before the first one.
    pub(super) radius: Option<f64>,
    /// The scale of every parameter: the root of the largest diagonal entry of `JᵀJ` so far.
    pub(super) scales: DVector<f64>,
    /// `S`.
    secant: DMatrix<f64>,
    pub(super) model: HessianModel,
}

/// The state of a [`TrustRegion`] in the units of the parameters themselves, whatever they are scaled
/// by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrustRegionMemory {
    radius: Option<f64>,
    /// The effect of every parameter.
    effects: Vec<f64>,
    /// The second derivatives that the normal equations leave out, row by row.
    secant: Vec<f64>,
    augmented: bool,
}

impl TrustRegionMemory {
    /// The same with a region that is smaller by a factor.
    pub fn shrink(&mut self, factor: f64) {
        self.radius.iter_mut().for_each(|radius| *radius *= factor);
    }
}

/// The decrease relative to the predicted one from which a trial is accepted.
const ACCEPTED: f64 = 1e-4;
/// Below this ratio the region shrinks, above the other one it grows.
const POOR: f64 = 0.25;
const GOOD: f64 = 0.75;
const GROWTH: f64 = 3.0;
/// The range of the factor by which a rejected step shrinks the region.
const SHRINKAGE: [f64; 2] = [0.1, 0.5];
/// A model is replaced by the other one if that was better by this factor.
const MODEL_ADVANTAGE: f64 = 1.5;
/// The smallest scale relative to the largest one.
const SMALLEST_SCALE: f64 = 1e-8;
/// The share of separate residuals in the effects of the parameters: steps along a limit are not to be as
/// short as those against it.
const SCALE_SHARE: f64 = 1e-2;
/// The squares of the differences to promised residuals, relative to the predicted decrease, that are
/// not worth a correction.
const NEGLIGIBLE: f64 = 1e-3;
/// The radius relative to the length of the first gradient below which no step is worth taking.
const SMALLEST_RADIUS: f64 = 1e-12;

impl TrustRegion {
    /// The method before its first step for `count` parameters.
    pub fn new(count: usize) -> Self {
        Self {
            radius: None,
            scales: DVector::zeros(count),
            secant: DMatrix::zeros(count, count),
            model: HessianModel::GaussNewton,
        }
    }

    /// The method as it was, for parameters scaled by `units`; a new one if their number differs.
    pub fn resume(memory: &TrustRegionMemory, units: &[f64]) -> Self {
        let count = units.len();
        if memory.effects.len() != count || memory.secant.len() != count * count {
            return Self::new(count);
        }
        let model =
            if memory.augmented { HessianModel::Augmented } else { HessianModel::GaussNewton };
        Self {
            radius: memory.radius,
            scales: DVector::from_fn(count, |i, _| memory.effects[i] * units[i]),
            secant: DMatrix::from_fn(count, count, |i, j| {
                memory.secant[i * count + j] * units[i] * units[j]
            }),
            model,
        }
    }

    /// The state of the method, for parameters scaled by `units`; `None` if a number of it is not
    /// finite.
    pub fn memory(&self, units: &[f64]) -> Option<TrustRegionMemory> {
        let count = units.len();
        let entry =
            |k: usize| self.secant[(k / count, k % count)] / (units[k / count] * units[k % count]);
        let memory = TrustRegionMemory {
            radius: self.radius,
            effects: self.scales.iter().zip(units).map(|(effect, unit)| effect / unit).collect(),
            secant: (0..count * count).map(entry).collect(),
            augmented: self.model == HessianModel::Augmented,
        };
        let numbers = memory.effects.iter().chain(&memory.secant).chain(&memory.radius);
        numbers.copied().all(f64::is_finite).then_some(memory)
    }

    /// True if the region is so small that no step would change anything.
    pub fn is_exhausted(&self, point: &LeastSquaresPoint) -> bool {
        self.radius.is_some_and(|radius| radius <= SMALLEST_RADIUS * point.value.max(0.0).sqrt())
    }

    /// The step from a point; every parameter may change by the range in `room`. `None` at a
    /// minimum of the model.
    pub fn propose(
        &mut self,
        point: &LeastSquaresPoint,
        room: &[[f64; 2]],
    ) -> Option<TrustRegionStep> {
        self.update_scales(&point.effects(SCALE_SHARE));
        let radius = *self.radius.get_or_insert(point.value.max(0.0).sqrt());
        let model = PiecewiseModel { point, hessian: &self.hessian(point, self.model) };
        let change = self.model_minimum(model, room, radius);
        let predicted = model.decrease(&change);
        (predicted > 0.0).then_some(TrustRegionStep { change, predicted })
    }

    /// The largest decrease that the Gauss-Newton model promises within bounds, however long the
    /// step.
    pub fn attainable_decrease(&self, point: &LeastSquaresPoint, room: &[[f64; 2]]) -> f64 {
        let model = PiecewiseModel { point, hessian: &point.normal };
        model.decrease(&self.model_minimum(model, room, f64::INFINITY))
    }

    /// The norm of half the gradient in scaled parameters, without those that their range holds.
    pub fn projected_gradient(&mut self, point: &LeastSquaresPoint, room: &[[f64; 2]]) -> f64 {
        self.update_scales(&point.effects(SCALE_SHARE));
        let held = |slope: f64, [low, high]: [f64; 2]| {
            (slope > 0.0 && low >= 0.0) || (slope < 0.0 && high <= 0.0)
        };
        let slopes = point.half_gradient.iter().zip(room).zip(self.scales.iter());
        let square = |((slope, room), scale): ((&f64, &[f64; 2]), &f64)| {
            if held(*slope, *room) { 0.0 } else { (slope / scale).powi(2) }
        };
        slopes.map(square).sum::<f64>().sqrt()
    }

    /// Takes note of a trial that could not be evaluated.
    pub fn note_failure(&mut self, step: &TrustRegionStep) {
        self.radius = Some(SHRINKAGE[1] * self.length(&step.change));
    }

    /// The change that corrects a trial of a step, whose cheap residuals are found to be `now`, until they
    /// are as the step has promised; `None` if they are, or if that would take more than the step itself.
    pub fn correction(
        &self,
        step: &TrustRegionStep,
        from: &LeastSquaresPoint,
        now: &[SeparateResidual],
    ) -> Option<DVector<f64>> {
        let negligible = NEGLIGIBLE * step.predicted;
        let change = from.correction(&step.change, now, &self.scales, negligible)?;
        (self.length(&change) <= self.length(&step.change)).then_some(change)
    }

    /// Takes note of a trial of a step that has come to a change by corrections; true if it is accepted.
    pub fn note_trial(
        &mut self,
        step: &TrustRegionStep,
        change: &DVector<f64>,
        from: &LeastSquaresPoint,
        to: &LeastSquaresPoint,
    ) -> bool {
        let decrease = from.value - to.value;
        let ratio = decrease / step.predicted;
        let accepted = ratio > ACCEPTED && to.value < from.value;
        self.choose_model(step, from, decrease);
        // A rejected trial is too far away to tell the second derivatives here.
        if accepted {
            let [gradient_change, missing] = from.gradient_change(to, change);
            self.update_secant(change, &gradient_change, missing);
        }
        self.update_radius(step, from, ratio, to.value);
        accepted
    }

    /// Takes note that the function has changed a little; `shorter` if its steps were too long.
    pub fn note_other_function(&mut self, shorter: bool) {
        if let Some(radius) = self.radius.as_mut().filter(|_| shorter) {
            *radius *= SHRINKAGE[1];
        }
    }

    pub(super) fn hessian(&self, point: &LeastSquaresPoint, model: HessianModel) -> DMatrix<f64> {
        match model {
            HessianModel::GaussNewton => point.normal.clone(),
            HessianModel::Augmented => &point.normal + &self.secant,
        }
    }

    pub(super) fn length(&self, change: &DVector<f64>) -> f64 {
        change.component_mul(&self.scales).norm()
    }

    /// Takes note of the effects of the parameters on the residuals.
    pub(super) fn update_scales(&mut self, effects: &DVector<f64>) {
        let least = SMALLEST_SCALE * effects.max().max(f64::MIN_POSITIVE.sqrt());
        self.scales.zip_apply(effects, |scale, effect| *scale = scale.max(effect).max(least));
    }

    /// Changes the model if the other one would have predicted the trial better.
    pub(super) fn choose_model(
        &mut self,
        step: &TrustRegionStep,
        from: &LeastSquaresPoint,
        real: f64,
    ) {
        let other = match self.model {
            HessianModel::GaussNewton => HessianModel::Augmented,
            HessianModel::Augmented => HessianModel::GaussNewton,
        };
        let model = PiecewiseModel { point: from, hessian: &self.hessian(from, other) };
        let predicted = model.decrease(&step.change);
        if MODEL_ADVANTAGE * (real - predicted).abs() < (real - step.predicted).abs() {
            self.model = other;
        }
    }

    /// Corrects `S` so that `S change` is what the matrix does not tell of the change of half the gradient.
    /// `S` is scaled down first where it exceeds what was found.
    pub(super) fn update_secant(
        &mut self,
        change: &DVector<f64>,
        gradient_change: &DVector<f64>,
        found: DVector<f64>,
    ) {
        let curvature = change.dot(gradient_change);
        let limit = 1e-12 * change.norm() * gradient_change.norm();
        if !(curvature.abs() > limit) || !gradient_change.iter().all(|v| v.is_finite()) {
            return;
        }
        let stored = change.dot(&(&self.secant * change));
        let size = (change.dot(&found) / stored).abs();
        if size < 1.0 {
            self.secant *= size;
        }
        let missing = found - &self.secant * change;
        let y = gradient_change / curvature;
        self.secant.ger(1.0, &missing, &y, 1.0);
        self.secant.ger(1.0, &y, &missing, 1.0);
        self.secant.ger(-missing.dot(change), &y, &y, 1.0);
    }

    fn update_radius(
        &mut self,
        step: &TrustRegionStep,
        from: &LeastSquaresPoint,
        ratio: f64,
        value: f64,
    ) {
        let slope = 2.0 * from.half_gradient.dot(&step.change);
        self.resize(&step.change, ratio, slope, value - from.value);
    }

    /// Resizes the region after a trial with this ratio of the decrease to the predicted one, slope
    /// at its start and rise of the function.
    pub(super) fn resize(&mut self, change: &DVector<f64>, ratio: f64, slope: f64, rise: f64) {
        let length = self.length(change);
        let radius = self.radius.unwrap_or(length);
        let radius = if ratio >= GOOD {
            radius.max(GROWTH * length)
        } else if ratio >= POOR {
            radius
        } else if ratio > 0.0 {
            SHRINKAGE[1] * length
        } else {
            // The minimum of the parabola through the value and slope here and the value there.
            let factor = -0.5 * slope / (rise - slope);
            let [least, most] = SHRINKAGE;
            if factor.is_finite() { factor.clamp(least, most) * length } else { least * length }
        };
        self.radius = Some(radius);
    }
}

/// `-(2 gᵀd + dᵀHd)`.
pub(super) fn decrease(
    hessian: &DMatrix<f64>,
    half_gradient: &DVector<f64>,
    change: &DVector<f64>,
) -> f64 {
    -(2.0 * half_gradient.dot(change) + change.dot(&(hessian * change)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_goes_on_where_it_was_in_other_units() {
        let entry = |i, j| if i == j { 2.0 + i as f64 } else { 0.3 };
        let point = LeastSquaresPoint {
            value: 4.0,
            half_gradient: DVector::from_column_slice(&[1.0, -2.0, 0.5, 3.0]),
            normal: DMatrix::from_fn(4, 4, entry),
            separate: Vec::new(),
        };
        let mut region = TrustRegion::new(4);
        let step = region.propose(&point, &[WIDE; 4]).unwrap();
        let mut to = point.clone();
        (to.value, to.half_gradient) = (2.0, &point.half_gradient * 0.4);
        assert!(region.note_trial(&step, &step.change, &point, &to));
        let units = [2.0, 0.5, 1e-3, 7.0];
        let memory = region.memory(&units).unwrap();
        let text = serde_json::to_string(&memory).unwrap();
        let back = TrustRegion::resume(&serde_json::from_str(&text).unwrap(), &units);
        assert_eq!(back.radius, region.radius);
        assert!((back.scales - &region.scales).norm() < 1e-12 * region.scales.norm());
        assert!((back.secant - &region.secant).norm() < 1e-12 * region.secant.norm());
        assert_eq!(TrustRegion::resume(&memory, &units[..3]), TrustRegion::new(3));
    }

    const WIDE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    /// Minimizes residuals with their Jacobian; returns the last point and the number of trials.
    fn minimize(
        start: &[f64],
        room: impl Fn(&DVector<f64>) -> Vec<[f64; 2]>,
        rows: impl Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
        trials: usize,
    ) -> (DVector<f64>, f64, usize) {
        let evaluate = |x: &DVector<f64>| {
            let (residuals, jacobian) = rows(x);
            LeastSquaresPoint {
                value: residuals.norm_squared(),
                half_gradient: jacobian.tr_mul(&residuals),
                normal: jacobian.tr_mul(&jacobian),
                separate: Vec::new(),
            }
        };
        let mut x = DVector::from_column_slice(start);
        let mut point = evaluate(&x);
        let mut region = TrustRegion::new(x.len());
        for trial in 0..trials {
            let Some(step) = region.propose(&point, &room(&x)) else {
                return (x, point.value, trial);
            };
            let there = &x + &step.change;
            let to = evaluate(&there);
            if region.note_trial(&step, &step.change, &point, &to) {
                (x, point) = (there, to);
            }
            if point.half_gradient.norm() < 1e-12 {
                return (x, point.value, trial);
            }
        }
        (x, point.value, trials)
    }

    fn rosenbrock(x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let residuals = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        (residuals, DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]))
    }

    #[test]
    fn it_follows_a_curved_valley() {
        let (x, value, trials) = minimize(&[-1.2, 1.0], |_| vec![WIDE; 2], rosenbrock, 100);
        assert!(value < 1e-24 && (x[0] - 1.0).abs() < 1e-11, "{x} {value} after {trials}");
    }

    #[test]
    fn it_ends_at_a_bound() {
        let room = |x: &DVector<f64>| vec![[-5.0 - x[0], 0.5 - x[0]], WIDE];
        let (x, value, _) = minimize(&[-1.2, 1.0], room, rosenbrock, 100);
        assert!((x[0] - 0.5).abs() < 1e-12 && (x[1] - 0.25).abs() < 1e-9, "{x}");
        assert!((value - 0.25).abs() < 1e-12, "{value}");
    }

    /// Residuals that stay large: the method of Gauss and Newton alone does not converge here.
    fn brown_dennis(x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let mut residuals = DVector::zeros(20);
        let mut jacobian = DMatrix::zeros(20, 4);
        for i in 0..20 {
            let t = (i + 1) as f64 / 5.0;
            let (a, b) = (x[0] + t * x[1] - t.exp(), x[2] + x[3] * t.sin() - t.cos());
            residuals[i] = a * a + b * b;
            let row = [2.0 * a, 2.0 * a * t, 2.0 * b, 2.0 * b * t.sin()];
            row.into_iter().enumerate().for_each(|(j, slope)| jacobian[(i, j)] = slope);
        }
        (residuals, jacobian)
    }

    #[test]
    fn it_converges_where_residuals_stay_large() {
        // The minimum by Moré, Garbow, Hillstrom (ACM TOMS 7 (1981) 17), problem 16.
        let (_, value, trials) =
            minimize(&[25.0, 5.0, -5.0, -1.0], |_| vec![WIDE; 4], brown_dennis, 60);
        assert!((value - 85822.2).abs() < 0.1, "{value} after {trials}");
    }

    /// A quadratic valley whose minimum lies in a corner of three limits, by half parabolas.
    #[test]
    fn a_corner_of_limits_is_found_at_once() {
        let limits = [([1.0, 1.0, 0.0], 1.0), ([0.0, 1.0, 1.0], 0.5), ([1.0, 0.0, -1.0], 0.2)];
        let center = DVector::from_vec(vec![2.0, 3.0, -1.0]);
        let evaluate = |x: &DVector<f64>| {
            let off = (x - &center) * 1e-2;
            let mut point = LeastSquaresPoint {
                value: off.norm_squared(),
                half_gradient: &off * 1e-2,
                normal: DMatrix::identity(3, 3) * 1e-4,
                separate: Vec::new(),
            };
            for (slope, most) in limits {
                let slope = DVector::from_row_slice(&slope);
                let value = slope.dot(x) - most;
                if value > 0.0 {
                    point.value += value * value;
                    point.half_gradient.axpy(value, &slope, 1.0);
                    point.normal.ger(1.0, &slope, &slope, 1.0);
                }
                let (is_one_sided, is_cheap) = (true, true);
                point.separate.push(SeparateResidual { value, slope, is_one_sided, is_cheap });
            }
            point
        };
        let mut x = DVector::from_vec(vec![-3.0, -2.0, 0.5]);
        let mut point = evaluate(&x);
        let mut region = TrustRegion::new(3);
        region.radius = Some(10.0);
        for trial in 0..3 {
            let Some(step) = region.propose(&point, &[WIDE; 3]) else { break };
            let to = evaluate(&(&x + &step.change));
            let (found, promised) = (point.value - to.value, step.predicted);
            assert!((found / promised - 1.0).abs() < 1e-9 || promised < 1e-12, "{trial}: {found}");
            if region.note_trial(&step, &step.change, &point, &to) {
                (x, point) = (x + &step.change, to);
            }
        }
        assert!(point.half_gradient.norm() < 1e-10, "{x} {}", point.half_gradient);
        assert!(region.attainable_decrease(&point, &[WIDE; 3]) < 1e-12);
    }

    #[test]
    fn a_singular_hessian_and_a_minimum_at_the_start_do_no_harm() {
        let twins = |x: &DVector<f64>| {
            let residual = DVector::from_vec(vec![x[0] + x[1] - 1.0]);
            (residual, DMatrix::from_row_slice(1, 2, &[1.0, 1.0]))
        };
        let (x, value, _) = minimize(&[3.0, 0.0], |_| vec![WIDE; 2], twins, 20);
        assert!(value < 1e-20 && x.iter().all(|v| v.is_finite()), "{x}");
        let (_, value, trials) = minimize(&[0.5, 0.5], |_| vec![WIDE; 2], twins, 20);
        assert_eq!((value, trials), (0.0, 0));
    }

    #[test]
    fn a_trial_that_fails_shortens_the_next_step() {
        let (residuals, jacobian) = rosenbrock(&DVector::from_vec(vec![-1.2, 1.0]));
        let point = LeastSquaresPoint {
            value: residuals.norm_squared(),
            half_gradient: jacobian.tr_mul(&residuals),
            normal: jacobian.tr_mul(&jacobian),
            separate: Vec::new(),
        };
        let mut region = TrustRegion::new(2);
        let mut last = f64::INFINITY;
        for _ in 0..5 {
            let step = region.propose(&point, &[WIDE; 2]).unwrap();
            let length = region.length(&step.change);
            assert!(length <= (SHRINKAGE[1] + 1e-9) * last, "{length} after {last}");
            region.note_failure(&step);
            last = length;
        }
    }
}
