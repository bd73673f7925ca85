//! The Levenberg-Marquardt method for sums of squares: damped normal equations, and the damping
//! from step to step (Levenberg 1944; Marquardt 1963).

use super::ParameterBounds;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// The term that damping adds to the diagonal of the normal equations `JᵀJ δ = -Jᵀr`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damping {
    /// The same for every parameter: `λ max diag JᵀJ`. For parameters of one kind.
    Levenberg(f64),
    /// In proportion to the diagonal, `λ diag JᵀJ`, but no less than `10⁻⁹ λ max diag JᵀJ`. For
    /// parameters of different kinds.
    Marquardt(f64),
}

impl Damping {
    /// The term for a diagonal entry, where `largest` is the largest of all.
    fn term(self, diagonal: f64, largest: f64) -> f64 {
        match self {
            Self::Levenberg(damping) => damping * largest.max(f64::MIN_POSITIVE),
            Self::Marquardt(damping) => damping * diagonal.max(1e-9 * largest) + f64::MIN_POSITIVE,
        }
    }
}

/// Solves the damped normal equations for a step, which is zero for fixed parameters. `normal` is
/// `JᵀJ` and `half_gradient` is `Jᵀr`; `None` if the damped matrix is not positive definite.
pub fn damped_step(
    normal: &DMatrix<f64>,
    half_gradient: &DVector<f64>,
    fixed: &[bool],
    damping: Damping,
) -> Option<DVector<f64>> {
    let (mut matrix, mut right) = (normal.clone(), -half_gradient);
    let largest = normal.diagonal().iter().copied().fold(0.0, f64::max);
    for (i, fixed) in fixed.iter().enumerate() {
        if *fixed {
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            matrix[(i, i)] = 1.0;
            right[i] = 0.0;
        } else {
            matrix[(i, i)] += damping.term(matrix[(i, i)], largest);
        }
    }
    Some(matrix.cholesky()?.solve(&right))
}

/// The decrease of the sum of squares that its quadratic model predicts for a step.
pub fn predicted_decrease(
    normal: &DMatrix<f64>,
    half_gradient: &DVector<f64>,
    step: &DVector<f64>,
) -> f64 {
    -(2.0 * half_gradient.dot(step) + step.dot(&(normal * step)))
}

/// The damping of Nielsen (*Damping parameter in Marquardt's method*, 1999): lowered by an amount
/// that depends on how well the model predicted a step, raised ever faster by failed steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct NielsenDamping {
    /// The damping `λ`.
    pub damping: f64,
    /// The factor by which the next failed step raises the damping.
    pub growth: f64,
}

impl Default for NielsenDamping {
    fn default() -> Self {
        Self { damping: 1e-3, growth: Self::FIRST_GROWTH }
    }
}

impl From<[f64; 2]> for NielsenDamping {
    fn from([damping, growth]: [f64; 2]) -> Self {
        Self { damping, growth }
    }
}

impl From<NielsenDamping> for [f64; 2] {
    fn from(state: NielsenDamping) -> Self {
        [state.damping, state.growth]
    }
}

impl NielsenDamping {
    const FIRST_GROWTH: f64 = 2.0;
    const MIN: f64 = 1e-12;
    const MAX: f64 = 1e10;

    /// True if the damping is so large that no step is worth taking.
    pub fn is_exhausted(&self) -> bool {
        !(self.damping < Self::MAX)
    }

    /// Lowers the damping after a step; `gain` is the ratio of the real to the predicted decrease.
    pub fn lower(&mut self, gain: f64) {
        let factor = (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 5.0);
        self.damping = (self.damping * factor).max(Self::MIN);
        self.growth = Self::FIRST_GROWTH;
    }

    /// Raises the damping after a failed step.
    pub fn raise(&mut self) {
        self.damping *= self.growth;
        self.growth *= 2.0;
    }
}

/// Residuals with their derivatives by the parameters.
pub type ResidualRows = Vec<(f64, Vec<f64>)>;

/// The largest number of dampings tried in a step.
const MAX_TRIES: usize = 12;
/// A step whose relative decrease is smaller is the last one.
const SMALLEST_DECREASE: f64 = 1e-9;
/// The damping of the first step, and its range.
const FIRST_DAMPING: f64 = 1e-3;
const MIN_DAMPING: f64 = 1e-12;
const MAX_DAMPING: f64 = 1e6;

/// The Levenberg-Marquardt method within bounds, for few parameters of one kind. For residuals
/// that stay the same from step to step.
#[derive(Debug, Clone)]
pub struct LevenbergMarquardt {
    damping: f64,
    /// The residuals at the end of the last step.
    at: Option<ResidualRows>,
}

/// The result of a step of [`LevenbergMarquardt`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevenbergMarquardtStep {
    /// The sum of squares at the end of the step.
    pub value: f64,
    /// True if further steps would change nothing.
    pub converged: bool,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self { damping: FIRST_DAMPING, at: None }
    }
}

impl LevenbergMarquardt {
    /// Takes one step; `rows` returns the residuals at the parameters it is given.
    ///
    /// # Errors
    /// Those of `rows`.
    pub fn step<E>(
        &mut self,
        parameters: &mut [f64],
        bounds: &ParameterBounds,
        mut rows: impl FnMut(&[f64]) -> Result<ResidualRows, E>,
    ) -> Result<LevenbergMarquardtStep, E> {
        let now = match self.at.take() {
            Some(rows) => rows,
            None => rows(parameters)?,
        };
        let value = sum_of_squares(&now);
        let (normal, half_gradient) = normal_equations(&now, parameters.len());
        let active = bounds.active_bounds(parameters, half_gradient.as_slice());
        for _ in 0..MAX_TRIES {
            let damping = Damping::Levenberg(self.damping);
            let step = damped_step(&normal, &half_gradient, &active, damping);
            let mut step = step.map_or(vec![0.0; active.len()], |step| step.as_slice().to_vec());
            bounds.limit_step(&mut step);
            let mut trial: Vec<f64> = parameters.iter().zip(&step).map(|(p, s)| p + s).collect();
            bounds.project(&mut trial);
            let tried = rows(&trial)?;
            let new = sum_of_squares(&tried);
            if new < value {
                parameters.copy_from_slice(&trial);
                self.at = Some(tried);
                self.damping = (0.1 * self.damping).max(MIN_DAMPING);
                let converged = value - new < SMALLEST_DECREASE * value;
                return Ok(LevenbergMarquardtStep { value: new, converged });
            }
            self.damping *= 10.0;
            if self.damping > MAX_DAMPING {
                break;
            }
        }
        self.damping = FIRST_DAMPING;
        self.at = Some(now);
        Ok(LevenbergMarquardtStep { value, converged: true })
    }

    /// Discards the stored residuals, for use with other ones.
    pub fn restart(&mut self) {
        self.at = None;
    }
}

fn sum_of_squares(rows: &ResidualRows) -> f64 {
    rows.iter().map(|(residual, _)| residual * residual).sum()
}

/// `JᵀJ` and `Jᵀr`.
fn normal_equations(rows: &ResidualRows, count: usize) -> (DMatrix<f64>, DVector<f64>) {
    let slopes: Vec<f64> = rows.iter().flat_map(|(_, row)| row.iter().copied()).collect();
    let jacobian = DMatrix::from_row_slice(rows.len(), count, &slopes);
    let residuals = DVector::from_iterator(rows.len(), rows.iter().map(|(residual, _)| *residual));
    (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residuals))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A method that starts again with other residuals takes the steps of a fresh one.
    #[test]
    fn residuals_of_before_are_forgotten_after_a_restart() {
        let bounds = ParameterBounds::uniform(1, [-100.0, 100.0], 100.0);
        let to = |goal: f64| move |p: &[f64]| Ok::<_, ()>(vec![(p[0] - goal, vec![1.0])]);
        let mut method = LevenbergMarquardt::default();
        let mut parameters = [0.0];
        method.step(&mut parameters, &bounds, to(1.0)).unwrap();
        assert!((parameters[0] - 1.0).abs() < 2e-3, "{parameters:?}");
        method.restart();
        let there = method.step(&mut parameters, &bounds, to(-5.0)).unwrap();
        assert!((parameters[0] + 5.0).abs() < 1e-2, "{parameters:?}");
        assert!((there.value - (parameters[0] + 5.0).powi(2)).abs() < 1e-12);
    }
}
