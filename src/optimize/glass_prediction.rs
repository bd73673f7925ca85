//! Predicts the merit with other glasses, after optimization, from one evaluation of the merit.
//!
//! The index of every glass at every wavelength joins the variables, so that the partial dispersion of a
//! glass counts. With the residuals linear, the merit after an exchange is a quadratic form, and so is what
//! the variables of the lens then take back: one factorization serves all glasses at all places. Limits that
//! hold the lens are stiff springs, and steps are damped, since a lens follows its linear model only so far.

use super::limited::add_springs;
use super::state::scale;
use crate::lens::{Lens, Parameter, Quantity, Variable};
use crate::merit::{DerivativeLevel, LimitedSum, Merit, MeritError, SumOfSquares};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The damping of steps: a step that changes the residuals by their own size, or a variable by its scale,
/// costs this share of the merit.
const DAMPING: f64 = 3e-4;
/// The damping of a variable that cannot follow, in merits.
const FIXED: f64 = 1e12;

/// The quadratic model of a merit by the variables of a lens and the indices of its glasses.
#[derive(Debug)]
pub(super) struct GlassModel {
    merit: f64,
    /// Half of the gradient, and the normal matrix, by scaled variables and then by indices.
    half_gradient: DVector<f64>,
    normal: DMatrix<f64>,
    /// The damped normal matrix by the variables.
    factor: Cholesky<f64, Dyn>,
    variables: Vec<ScaledVariable>,
    /// The rows of the glasses.
    rows: Vec<usize>,
    /// The indices of each glass at each wavelength.
    indices: Vec<f64>,
}

/// A variable of the lens, its value, and the change of it that counts as one.
#[derive(Debug)]
struct ScaledVariable {
    parameter: Parameter,
    value: f64,
    scale: f64,
    /// False if it is at a bound, or an index that another glass replaces.
    is_free: bool,
}

impl GlassModel {
    /// The model of a merit of a lens, by the glasses behind some rows; `None` if it has no minimum.
    ///
    /// # Errors
    /// A lens that cannot be evaluated.
    pub(super) fn new(
        merit: Merit,
        lens: &Lens,
        rows: &[usize],
    ) -> Result<Option<Self>, MeritError> {
        let merit = merit.with_index_variables(lens, rows);
        let indices = merit.indices(rows);
        let values: Vec<f64> = merit.values(lens).into_iter().chain(indices.clone()).collect();
        let LimitedSum { mut objective, limits, .. } =
            merit.evaluate_with_limits(&values, DerivativeLevel::Normal)?;
        let variables: Vec<ScaledVariable> = merit
            .variables()
            .iter()
            .enumerate()
            .map(|(i, variable)| scaled(lens, (variable, values[i]), rows, (&objective, i)))
            .collect();
        let least = objective.value;
        let own: Vec<f64> = variables.iter().map(|variable| variable.scale).collect();
        add_springs(&mut objective, &limits, &own);
        let scales: Vec<f64> = own.into_iter().chain(indices.iter().map(|_| 1.0)).collect();
        let scales = DVector::from_vec(scales);
        let half_gradient = objective.gradient.component_mul(&scales) * 0.5;
        let normal = objective.normal.component_mul(&(&scales * scales.transpose()));
        let count = variables.len();
        let mut damped = normal.view((0, 0), (count, count)).clone_owned();
        for (i, variable) in variables.iter().enumerate() {
            damped[(i, i)] += least * if variable.is_free { DAMPING } else { FIXED };
        }
        let (merit, rows) = (objective.value, rows.to_vec());
        Ok(Cholesky::new(damped).map(|factor| Self {
            merit,
            half_gradient,
            normal,
            factor,
            variables,
            rows,
            indices,
        }))
    }

    /// The merit that is expected of a lens with a glass of these indices behind a row, one for each
    /// wavelength, after the variables have followed from the values that they have in it; `None` if the
    /// model has no glass behind that row.
    pub(super) fn predict(&self, lens: &Lens, row: usize, indices: &[f64]) -> Option<f64> {
        let first = self.rows.iter().position(|known| *known == row)? * indices.len();
        let count = self.variables.len();
        let mut change = DVector::zeros(self.normal.nrows());
        for (change, variable) in change.iter_mut().zip(&self.variables) {
            let value = lens.get(variable.parameter).unwrap_or(variable.value);
            *change = (value - variable.value) / variable.scale;
        }
        for (at, index) in (first..).zip(indices) {
            change[count + at] = index - self.indices.get(at)?;
        }
        let moved = &self.normal * &change;
        let there = self.merit + (2.0 * &self.half_gradient + &moved).dot(&change);
        let half = (&self.half_gradient + moved).rows(0, count).clone_owned();
        let predicted = there - half.dot(&self.factor.solve(&half));
        predicted.is_finite().then_some(predicted)
    }
}

/// A variable with its value, scaled by the effect that it has on a sum of squares as the variable number
/// `i` of it, and at most by its size.
fn scaled(
    lens: &Lens,
    (variable, value): (&Variable, f64),
    rows: &[usize],
    (sum, i): (&SumOfSquares, usize),
) -> ScaledVariable {
    let parameter = variable.parameter;
    let natural = scale(lens, variable);
    let measured = (sum.value / sum.normal[(i, i)]).sqrt();
    let is_replaced = parameter.quantity == Quantity::Index && rows.contains(&parameter.surface);
    let is_at_bound = variable.min.is_some_and(|min| value <= min)
        || variable.max.is_some_and(|max| value >= max);
    ScaledVariable {
        parameter,
        value,
        scale: if measured > 0.0 { measured.min(natural) } else { natural },
        is_free: !is_replaced && !is_at_bound,
    }
}
