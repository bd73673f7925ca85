//! A sum of squares with its derivatives.

use crate::solve::SeparateResidual;
use nalgebra::{DMatrix, DVector};

/// The derivatives that are computed with a sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DerivativeLevel {
    /// The value alone.
    Value,
    /// The value and its derivatives.
    Gradient,
    /// The value, its derivatives and the Gauss-Newton matrix.
    Normal,
}

/// `Σ w r²` with its derivatives by the variables.
#[derive(Debug, Clone, PartialEq)]
pub struct SumOfSquares {
    /// The derivatives that are computed.
    pub level: DerivativeLevel,
    /// The sum.
    pub value: f64,
    /// `2 Σ w r ∂r`.
    pub gradient: DVector<f64>,
    /// `Σ w ∂r ∂rᵀ`; empty unless asked for.
    pub normal: DMatrix<f64>,
    /// The residuals of limits, times the roots of their weights: those that count here, and those that do
    /// not but may. Empty unless the matrix is asked for.
    pub separate: Vec<SeparateResidual>,
}

impl SumOfSquares {
    /// A sum of zero for this many variables.
    pub fn zero(variables: usize, level: DerivativeLevel) -> Self {
        let rows = if level == DerivativeLevel::Normal { variables } else { 0 };
        let gradient = DVector::zeros(variables);
        let normal = DMatrix::zeros(rows, rows);
        Self { level, value: 0.0, gradient, normal, separate: Vec::new() }
    }

    /// Adds `weight` times another one.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.value += weight * other.value;
        self.gradient.axpy(weight, &other.gradient, 1.0);
        if self.level == DerivativeLevel::Normal {
            self.normal += &other.normal * weight;
            self.separate.extend(other.separate.iter().map(|residual| residual.scaled(weight)));
        }
    }

    /// Multiplies the value and its derivatives by a factor.
    pub fn scale(&mut self, factor: f64) {
        self.value *= factor;
        self.gradient *= factor;
        self.normal *= factor;
        for residual in &mut self.separate {
            *residual = residual.scaled(factor);
        }
    }

    /// Adds `weight r²` with `slope = ∂r`.
    pub fn add_residual(&mut self, weight: f64, r: f64, slope: &DVector<f64>) {
        self.value += weight * r * r;
        if self.level > DerivativeLevel::Value {
            self.gradient.axpy(2.0 * weight * r, slope, 1.0);
        }
        if self.level == DerivativeLevel::Normal {
            self.normal.ger(weight, slope, slope, 1.0);
        }
    }

    /// Adds `weight r²` of a residual that a model of the sum is to know by itself.
    pub fn add_separate(&mut self, weight: f64, residual: &SeparateResidual) {
        if residual.counts() {
            self.add_residual(weight, residual.value, &residual.slope);
        }
        if self.level == DerivativeLevel::Normal {
            let residual = residual.scaled(weight);
            // One that nothing limits keeps its place, so that the sums of two lenses have the same.
            self.separate.push(if residual.is_finite() { residual } else { residual.unlimited() });
        }
    }

    /// Adds `weight r²` with `slope = ∂r` where `r` is positive, nothing elsewhere; `r` needs rays.
    pub fn add_one_sided(&mut self, weight: f64, r: f64, slope: DVector<f64>) {
        let (is_one_sided, is_cheap) = (true, false);
        let residual = SeparateResidual { value: r, slope, is_one_sided, is_cheap };
        self.add_separate(weight, &residual);
    }

    /// True if every number in it is finite.
    pub fn is_finite(&self) -> bool {
        self.value.is_finite()
            && self.gradient.iter().all(|v| v.is_finite())
            && self.normal.iter().all(|v| v.is_finite())
    }
}
