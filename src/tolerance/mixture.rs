//! Errors of making as sums of independent ones.
//!
//! An error that is correlated with others is `pᵢ = σᵢ Σ Lᵢₖ uₖ`, with the lower triangular factor `L` of
//! the correlation matrix and independent `uₖ` of mean 0 and variance 1, each distributed as its error:
//! deviations and coefficients are exact, and normal errors stay normal. Of other distributions only the
//! first error of a group keeps its own: the sum of several is nearer to the normal one, and may lie
//! outside the half range.

use super::ToleranceError;
use crate::lens::{Tolerance, ToleranceSheet};

/// The errors of lenses as sums of as many independent ones, which have a half range of 1.
#[derive(Debug, Clone)]
pub(super) struct ErrorMixture {
    /// For each error the independent ones in it, in order, and their factors.
    rows: Vec<Vec<(usize, f64)>>,
    /// For each error those that are correlated with it, itself among them, and their covariances.
    covariances: Vec<Vec<(usize, f64)>>,
    /// The standard deviation of each independent error.
    deviations: Vec<f64>,
}

impl ErrorMixture {
    /// The mixture of a list of tolerances.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub(super) fn new(sheet: &ToleranceSheet) -> Result<Self, ToleranceError> {
        let alone = |(i, tolerance): (usize, &Tolerance)| vec![(i, tolerance.half_range)];
        let own = |(i, tolerance): (usize, &Tolerance)| vec![(i, tolerance.deviation().powi(2))];
        let all = || sheet.errors.iter().enumerate();
        let deviations: Vec<f64> =
            sheet.errors.iter().map(|t| t.distribution.deviation()).collect();
        let mut rows: Vec<_> = all().map(alone).collect();
        let mut covariances: Vec<_> = all().map(own).collect();
        for group in sheet.correlated_errors()? {
            let sigma = |i: usize| sheet.errors[group.errors[i]].deviation();
            for (i, error) in group.errors.iter().enumerate() {
                let part = |k: usize| {
                    let independent = group.errors[k];
                    let factor = sigma(i) * group.factor[(i, k)];
                    (independent, factor / deviations[independent])
                };
                rows[*error] = (0..=i).map(part).filter(|(_, f)| *f != 0.0).collect();
                let with =
                    |j: usize| (group.errors[j], sigma(i) * sigma(j) * group.coefficient(i, j));
                covariances[*error] = (0..group.errors.len()).map(with).collect();
            }
        }
        Ok(Self { rows, covariances, deviations })
    }

    /// Turns independent errors into those of a lens, in place.
    pub(super) fn mix(&self, errors: &mut [f64]) {
        // A row holds no later errors than its own.
        for i in (0..errors.len()).rev() {
            errors[i] = self.rows[i].iter().map(|(k, factor)| factor * errors[*k]).sum();
        }
    }

    /// The errors that are correlated with one, itself among them, and the covariances.
    pub(super) fn covariances(&self, error: usize) -> &[(usize, f64)] {
        &self.covariances[error]
    }

    /// The derivatives by independent errors from those by the errors of a lens.
    pub(super) fn by_independent(&self, by_errors: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; by_errors.len()];
        for (row, by) in self.rows.iter().zip(by_errors) {
            row.iter().for_each(|(k, factor)| sums[*k] += by * factor);
        }
        sums
    }

    /// The independent errors in one, and their factors.
    pub(super) fn parts(&self, error: usize) -> &[(usize, f64)] {
        &self.rows[error]
    }

    /// The standard deviation of each independent error.
    pub(super) fn deviations(&self) -> &[f64] {
        &self.deviations
    }
}
