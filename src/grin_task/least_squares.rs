//! Levenberg and Marquardt's method within limits, one step at a time.
//!
//! A field with few numbers and a loss that is a sum of squares: each step solves for the changes
//! that would make all residuals vanish, damped until the loss falls.

use crate::grin::ParameterBounds;
use nalgebra::{DMatrix, DVector};

/// How often the damping grows before a step is given up.
const TRIES: usize = 12;
/// A step that gains less than this part of the loss is the last one.
const SETTLED: f64 = 1e-9;
const DAMPING: [f64; 2] = [1e-12, 1e6];

/// Residuals with their derivatives by the parameters.
pub(super) type ResidualRows = Vec<(f64, Vec<f64>)>;

/// A descent on its way.
#[derive(Debug, Clone)]
pub(super) struct LevenbergMarquardt {
    damping: f64,
    at: Option<ResidualRows>,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self { damping: 1e-3, at: None }
    }
}

fn sum(rows: &ResidualRows) -> f64 {
    rows.iter().map(|(residual, _)| residual * residual).sum()
}

impl LevenbergMarquardt {
    /// Takes one step; what comes out is the loss and whether further steps would change nothing.
    pub(super) fn step<E>(
        &mut self,
        parameters: &mut [f64],
        limits: &ParameterBounds,
        mut rows: impl FnMut(&[f64]) -> Result<ResidualRows, E>,
    ) -> Result<(f64, bool), E> {
        let now = match self.at.take() {
            Some(rows) => rows,
            None => rows(parameters)?,
        };
        let loss = sum(&now);
        let (normal, slope) = equations(&now, parameters.len());
        let held = limits.active_bounds(parameters, slope.as_slice());
        for _ in 0..TRIES {
            let mut step = solve(&normal, &slope, &held, self.damping);
            limits.limit_step(&mut step);
            let mut trial: Vec<f64> = parameters.iter().zip(&step).map(|(p, s)| p + s).collect();
            limits.project(&mut trial);
            let there = rows(&trial)?;
            let new = sum(&there);
            if new < loss {
                parameters.copy_from_slice(&trial);
                self.at = Some(there);
                self.damping = (0.1 * self.damping).max(DAMPING[0]);
                return Ok((new, loss - new < SETTLED * loss));
            }
            self.damping *= 10.0;
            if self.damping > DAMPING[1] {
                break;
            }
        }
        self.damping = 1e-3;
        self.at = Some(now);
        Ok((loss, true))
    }

    /// Forgets the residuals, which have become others.
    pub(super) fn restart(&mut self) {
        self.at = None;
    }
}

/// `JᵀJ` and half the gradient, `Jᵀr`.
fn equations(rows: &ResidualRows, count: usize) -> (DMatrix<f64>, DVector<f64>) {
    let slopes: Vec<f64> = rows.iter().flat_map(|(_, row)| row.iter().copied()).collect();
    let jacobian = DMatrix::from_row_slice(rows.len(), count, &slopes);
    let residuals = DVector::from_iterator(rows.len(), rows.iter().map(|(residual, _)| *residual));
    (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residuals))
}

/// The damped step; what a limit holds stays.
fn solve(normal: &DMatrix<f64>, slope: &DVector<f64>, held: &[bool], damping: f64) -> Vec<f64> {
    let (mut matrix, mut right) = (normal.clone(), -slope);
    let scale = normal.diagonal().max().max(f64::MIN_POSITIVE);
    for (i, held) in held.iter().enumerate() {
        if *held {
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            right[i] = 0.0;
        }
        matrix[(i, i)] += damping * scale;
    }
    match matrix.cholesky() {
        Some(factors) => factors.solve(&right).as_slice().to_vec(),
        None => vec![0.0; held.len()],
    }
}
