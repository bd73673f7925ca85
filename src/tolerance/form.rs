//! The mean square spot as a quadratic function of all errors of making.
//!
//! `S(p) = S₀ + Σ Sᵢ pᵢ + ½ Σ Sᵢᵢ pᵢ² + Σ_{i<j} 2 <εᵢ·εⱼ> pᵢ pⱼ`, with the exact first and second
//! derivatives by each error and, between two of them, the mean product of what they do to the rays
//! (the derivative of the rays by two errors is left out). After refocusing the displacement that
//! an error gives each ray is reduced by the part that a displacement of the image plane undoes:
//! `εᵢ' = εᵢ − s <<s·εᵢ>>/<<s·s>>`, with the slopes `s` of the rays and means over all fields.

use super::draw::draw_errors_into;
use super::folded::{ErrorParity, FoldedField, folded_fields};
use super::{Sensitivity, ToleranceScene};
use crate::lens::Tolerance;
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// The image plane at which a spot is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FocusTreatment {
    /// The image plane of the lens as designed.
    Fixed,
    /// The best common focus of each lens.
    Refocused,
}

/// The mean square spot radius in mm² as a quadratic function of the errors.
#[derive(Debug, Clone)]
pub struct QuadraticForm {
    /// The value without errors.
    pub nominal: f64,
    /// The first derivatives.
    pub first: Vec<f64>,
    /// The matrix of second derivatives, row by row.
    pub second: DMatrix<f64>,
    /// The end of the travel of the focus, if it has one.
    pub stop: Option<FocusStop>,
}

/// The end of the travel of the focus: what is missing there remains as defocus.
#[derive(Debug, Clone)]
pub struct FocusStop {
    /// The best focus without errors, in mm from the image plane.
    pub nominal: f64,
    /// The derivatives of the best focus by the errors.
    pub first: Vec<f64>,
    /// The largest displacement of the image plane, in mm.
    pub travel: f64,
    /// The mean square of the slopes of the rays.
    pub slopes: f64,
}

impl FocusStop {
    /// The mean square spot in mm² by which a lens with this best focus is worse than there.
    fn cost(&self, focus: f64) -> f64 {
        self.slopes * (focus.abs() - self.travel).max(0.0).powi(2)
    }
}

impl QuadraticForm {
    /// The form of a lens from its sensitivities.
    pub fn new(
        scene: &ToleranceScene,
        sensitivities: &[Sensitivity],
        focus: FocusTreatment,
        travel: Option<f64>,
    ) -> Self {
        let products = RayProducts::new(scene, sensitivities, focus);
        let count = sensitivities.len();
        let mut second = DMatrix::zeros(count, count);
        let (mut first, mut nominal) = (Vec::with_capacity(count), 0.0);
        for (i, sensitivity) in sensitivities.iter().enumerate() {
            let own = match focus {
                FocusTreatment::Fixed => sensitivity.mean_square(),
                FocusTreatment::Refocused => sensitivity.mean_square_focused(),
            };
            nominal = own.value;
            first.push(own.first);
            for j in 0..i {
                let product = 2.0 * products.of(i, j, focus);
                (second[(i, j)], second[(j, i)]) = (product, product);
            }
            second[(i, i)] = own.second;
        }
        let travel = travel.filter(|_| focus == FocusTreatment::Refocused);
        let stop = travel.zip(sensitivities.first()).map(|(travel, any)| FocusStop {
            nominal: any.focus().value,
            first: sensitivities.iter().map(|s| s.focus().first).collect(),
            travel,
            slopes: any.merits.mean.c.value.value,
        });
        Self { nominal, first, second, stop }
    }

    /// The mean square spot radius of a lens with these errors, in mm²; a form knows no end at zero,
    /// so that smaller values are zero.
    pub fn at(&self, errors: &[f64]) -> f64 {
        let mut sum = self.nominal;
        for (i, error) in errors.iter().enumerate() {
            let row: f64 = errors.iter().enumerate().map(|(j, p)| self.second[(i, j)] * p).sum();
            sum += error * (self.first[i] + 0.5 * row);
        }
        let stop = self.stop.as_ref();
        let cost = |stop: &FocusStop| stop.cost(stop.nominal + dot(&stop.first, errors));
        sum.max(0.0) + stop.map_or(0.0, cost)
    }

    /// The expected mean square spot radius in mm², with a focus whose travel has no end.
    pub fn expectation(&self, tolerances: &[Tolerance]) -> f64 {
        let part = |(i, t): (usize, &Tolerance)| 0.5 * t.deviation().powi(2) * self.second[(i, i)];
        self.nominal + tolerances.iter().enumerate().map(part).sum::<f64>()
    }

    /// The form in few combinations of the errors that carry nearly all of it.
    pub(super) fn reduced(&self, tolerances: &[Tolerance]) -> ReducedForm {
        let deviations: Vec<f64> = tolerances.iter().map(Tolerance::deviation).collect();
        let scale = |i: usize, j: usize| self.second[(i, j)] * deviations[i] * deviations[j];
        let count = deviations.len();
        let scaled = DMatrix::from_fn(count, count, scale);
        let trace: f64 = (0..count).map(|i| scaled[(i, i)]).sum();
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(scaled);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| eigenvalues[*b].abs().total_cmp(&eigenvalues[*a].abs()));
        let total: f64 = eigenvalues.iter().map(|v| v.abs()).sum();
        let (mut kept, mut sum) = (Vec::new(), 0.0);
        for m in order {
            if sum >= (1.0 - NEGLECTED) * total {
                break;
            }
            sum += eigenvalues[m].abs();
            kept.push(m);
        }
        let direction = |row: usize, i: usize| match row {
            LINEAR => self.first[i],
            FOCUS => self.stop.as_ref().map_or(0.0, |stop| stop.first[i]),
            _ if deviations[i] > 0.0 => eigenvectors[(i, kept[row - OWN])] / deviations[i],
            _ => 0.0,
        };
        let directions = DMatrix::from_fn(OWN + kept.len(), count, direction);
        let values: Vec<f64> = kept.iter().map(|m| eigenvalues[*m]).collect();
        let neglected = 0.5 * (trace - values.iter().sum::<f64>());
        let (nominal, stop) = (self.nominal, self.stop.clone());
        ReducedForm { nominal, neglected, values, directions, stop }
    }
}

/// The share of the form whose scatter, though not its mean, is left out of samples.
const NEGLECTED: f64 = 1e-4;

/// The rows of [`ReducedForm::directions`] for the first derivatives and for the best focus, and the
/// first one of the combinations.
const LINEAR: usize = 0;
const FOCUS: usize = 1;
const OWN: usize = 2;

/// The number of lenses whose errors are combined at once.
const LENSES: u64 = 256;

/// A quadratic form in few combinations of its variables.
pub(super) struct ReducedForm {
    nominal: f64,
    /// The mean of the part that is left out, for the tolerances themselves.
    neglected: f64,
    /// The eigenvalue of each combination.
    values: Vec<f64>,
    /// The first derivatives of the form, those of the best focus, and the combinations.
    directions: DMatrix<f64>,
    stop: Option<FocusStop>,
}

impl ReducedForm {
    /// The terms of the form for this many lenses with random errors, and for all multiples of these.
    pub(super) fn random_lenses(
        &self,
        tolerances: &[Tolerance],
        seed: u64,
        count: u64,
    ) -> Vec<ErrorMultiples> {
        let part = |part: u64| {
            let lenses = part * LENSES..count.min((part + 1) * LENSES);
            let mut errors = DMatrix::zeros(tolerances.len(), (lenses.end - lenses.start) as usize);
            for (number, mut column) in lenses.zip(errors.column_iter_mut()) {
                draw_errors_into(tolerances, seed, number, column.as_mut_slice());
            }
            let along = &self.directions * errors;
            along.column_iter().map(|along| self.multiples(along.as_slice())).collect::<Vec<_>>()
        };
        let parts = (0..count.div_ceil(LENSES)).into_par_iter().map(part);
        parts.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    fn multiples(&self, along: &[f64]) -> ErrorMultiples {
        let kept = self.values.iter().zip(&along[OWN..]);
        let square: f64 = kept.map(|(value, along)| 0.5 * value * along * along).sum();
        ErrorMultiples {
            linear: along[LINEAR],
            square: self.neglected + square,
            focus: along[FOCUS],
        }
    }

    /// The mean square spot radius of a lens with a multiple of some errors, in mm².
    pub(super) fn at_multiple(&self, errors: &ErrorMultiples, factor: f64) -> f64 {
        let ErrorMultiples { linear, square, focus } = errors;
        let sum = self.nominal + factor * (linear + factor * square);
        let stop = self.stop.as_ref();
        sum.max(0.0) + stop.map_or(0.0, |stop| stop.cost(stop.nominal + factor * focus))
    }
}

/// The additions of errors to the form: to first order, to second order, and to the best focus.
pub(super) struct ErrorMultiples {
    linear: f64,
    square: f64,
    focus: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Mean products over the rays of all fields of what errors do to them.
struct RayProducts {
    /// Of the displacements by two errors from the centroids.
    effects: DMatrix<f64>,
    /// Of the displacements and the slopes.
    with_slopes: Vec<f64>,
    /// Of the slopes with themselves.
    slopes: f64,
}

impl RayProducts {
    fn new(scene: &ToleranceScene, sensitivities: &[Sensitivity], focus: FocusTreatment) -> Self {
        let count = sensitivities.len();
        let (effects, with_slopes) = (DMatrix::zeros(count, count), vec![0.0; count]);
        let mut sums = Self { effects, with_slopes, slopes: 0.0 };
        let Some(any) = sensitivities.first() else { return sums };
        // The derivative of the slopes counts where the best focus is not the image plane.
        let shift = match focus {
            FocusTreatment::Fixed => 0.0,
            FocusTreatment::Refocused => any.focus().value,
        };
        let mut starts = vec![0];
        for field in &scene.beam.fields {
            let rays: usize = field.colours.iter().map(|colour| colour.rays.len()).sum();
            starts.push(starts[starts.len() - 1] + rays);
        }
        for field in folded_fields(scene) {
            sums.add_field(&field, sensitivities, (starts[field.number], shift));
        }
        sums
    }

    /// Adds the products over the rays of a field, of which the first one is at `start`, at an image
    /// plane that is displaced by `shift`.
    fn add_field(
        &mut self,
        field: &FoldedField<'_>,
        sensitivities: &[Sensitivity],
        (start, shift): (usize, f64),
    ) {
        let (mut places, mut from) = (Vec::new(), start);
        for colour in &field.field.colours {
            places.extend(field.rays(colour).map(|(i, weight)| (from + i, weight)));
            from += colour.rays.len();
        }
        let count = sensitivities.len();
        let column = |k: usize, i: usize| {
            let (place, weight) = places[i / 2];
            let ray = &sensitivities[k.min(count - 1)].rays[place];
            let value = match k {
                _ if k == count => ray.slope[i % 2],
                _ => ray.displacement[i % 2] + shift * ray.bend[i % 2],
            };
            (weight * field.weight).sqrt() * value
        };
        let rows = DMatrix::from_fn(count + 1, 2 * places.len(), column);
        let products = &rows * rows.transpose();
        let parity = |k: usize| match sensitivities.get(k) {
            Some(sensitivity) => ErrorParity::of(sensitivity.error.kind),
            None => ErrorParity::EVEN,
        };
        for i in 0..count {
            for j in 0..count {
                if !field.symmetry.cancels_product(parity(i), parity(j)) {
                    self.effects[(i, j)] += products[(i, j)];
                }
            }
            if !field.symmetry.cancels_product(parity(i), ErrorParity::EVEN) {
                self.with_slopes[i] += products[(i, count)];
            }
        }
        self.slopes += products[(count, count)];
    }

    /// The mean product of what two errors do to the rays.
    fn of(&self, i: usize, j: usize, focus: FocusTreatment) -> f64 {
        let refocused = match focus {
            FocusTreatment::Fixed => 0.0,
            FocusTreatment::Refocused => self.with_slopes[i] * self.with_slopes[j] / self.slopes,
        };
        self.effects[(i, j)] - refocused
    }
}
