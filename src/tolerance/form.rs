//! The mean square spot as a quadratic function of all errors of making.
//!
//! `S(p) = S₀ + Σ Sᵢ pᵢ + ½ Σ Sᵢᵢ pᵢ² + Σ_{i<j} 2 <εᵢ·εⱼ> pᵢ pⱼ`, with the exact first and second
//! derivatives by each error and, between two of them, the mean product of what they do to the rays
//! (the derivative of the rays by two errors is left out). After refocusing the displacement that
//! an error gives each ray is reduced by the part that a displacement of the image plane undoes:
//! `εᵢ' = εᵢ − s <<s·εᵢ>>/<<s·s>>`, with the slopes `s` of the rays and means over all fields.

use super::{Sensitivity, ToleranceScene};
use crate::lens::Tolerance;
use nalgebra::{DMatrix, SymmetricEigen};

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
        let rows = ray_rows(scene, sensitivities, focus);
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
                let product = 2.0 * dot(&rows[i], &rows[j]);
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
            let direction =
                (0..count)
                    .map(|i| {
                        if deviations[i] > 0.0 { eigenvectors[(i, m)] / deviations[i] } else { 0.0 }
                    })
                    .collect();
            kept.push((eigenvalues[m], direction));
        }
        let carried: f64 = kept.iter().map(|(value, _)| value).sum();
        let (nominal, neglected) = (self.nominal, 0.5 * (trace - carried));
        let (first, stop) = (self.first.clone(), self.stop.clone());
        ReducedForm { nominal, neglected, first, kept, stop }
    }
}

/// The share of the form whose scatter, though not its mean, is left out of samples.
const NEGLECTED: f64 = 1e-4;

/// A quadratic form in few combinations of its variables.
pub(super) struct ReducedForm {
    nominal: f64,
    /// The mean of the part that is left out, for the tolerances themselves.
    neglected: f64,
    first: Vec<f64>,
    /// Eigenvalues, and the combinations of errors that they belong to.
    kept: Vec<(f64, Vec<f64>)>,
    stop: Option<FocusStop>,
}

impl ReducedForm {
    /// The mean square spot radius of a lens with these errors, in mm².
    pub(super) fn at(&self, errors: &[f64]) -> f64 {
        self.at_multiple(&self.along(errors), 1.0)
    }

    /// The terms of the form for all multiples of some errors.
    pub(super) fn along(&self, errors: &[f64]) -> ErrorMultiples {
        let kept = self.kept.iter().map(|(value, v)| 0.5 * value * dot(v, errors).powi(2));
        ErrorMultiples {
            linear: dot(&self.first, errors),
            square: self.neglected + kept.sum::<f64>(),
            focus: self.stop.as_ref().map_or(0.0, |stop| dot(&stop.first, errors)),
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

/// The effect of each error on the rays: for each, the displacements of all rays from the centroids of
/// their fields, multiplied by the roots of their weights.
fn ray_rows(
    scene: &ToleranceScene,
    sensitivities: &[Sensitivity],
    focus: FocusTreatment,
) -> Vec<Vec<f64>> {
    let roots: Vec<f64> = scene
        .beam
        .fields
        .iter()
        .flat_map(|field| {
            let weights = field.colours.iter().flat_map(|colour| &colour.weights);
            weights.map(|w| (w * field.weight).sqrt())
        })
        .collect();
    let Some(any) = sensitivities.first() else { return Vec::new() };
    let slopes = weighted(any.rays.iter().map(|ray| ray.slope), &roots);
    let square = dot(&slopes, &slopes);
    let row = |sensitivity: &Sensitivity| {
        let mut row = weighted(sensitivity.rays.iter().map(|ray| ray.displacement), &roots);
        if focus == FocusTreatment::Refocused {
            // The derivative of the slopes counts where the best focus is not the image plane.
            let shift = sensitivity.focus().value;
            let bend = weighted(sensitivity.rays.iter().map(|ray| ray.bend), &roots);
            row.iter_mut().zip(&bend).for_each(|(x, bend)| *x += shift * bend);
            let along = dot(&row, &slopes) / square;
            row.iter_mut().zip(&slopes).for_each(|(x, slope)| *x -= along * slope);
        }
        row
    };
    sensitivities.iter().map(row).collect()
}

/// Pairs of numbers of each ray, multiplied by the roots of their weights.
fn weighted(rays: impl Iterator<Item = [f64; 2]>, roots: &[f64]) -> Vec<f64> {
    rays.zip(roots).flat_map(|([x, y], root)| [x * root, y * root]).collect()
}
