//! Errors of making that are not independent: elements of one barrel, surfaces of one mould.

use super::LensError;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The correlation of every two of some errors.
///
/// Errors that share a part, as elements of a barrel share its decentre, are correlated by the share of
/// the variance that is common to them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorCorrelation {
    /// The numbers of the errors in their list, counted from 0.
    pub errors: Vec<usize>,
    /// The coefficient of correlation, from −1 to 1.
    pub coefficient: f64,
}

/// Errors that are correlated with each other, and with no others.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedErrors {
    /// The numbers of the errors, in order.
    pub errors: Vec<usize>,
    /// The lower triangular factor of their correlation matrix.
    pub factor: DMatrix<f64>,
}

/// The largest number of errors that depend on each other.
const MOST: usize = 1000;
/// A pivot of the matrix below this is zero: rounding, for each error.
const ROUNDING: f64 = 1e-12;

/// The groups of correlated errors of a list of `count`.
///
/// # Errors
/// Errors that do not exist, coefficients beyond −1 and 1, two for one pair, and coefficients that no
/// errors can have together.
pub(super) fn correlated_errors(
    correlations: &[ErrorCorrelation],
    count: usize,
) -> Result<Vec<CorrelatedErrors>, LensError> {
    let pairs = pairs(correlations, count)?;
    let mut group: BTreeMap<usize, usize> = BTreeMap::new();
    for (i, j) in pairs.keys() {
        let of = |group: &BTreeMap<usize, usize>, i: usize| group.get(&i).copied().unwrap_or(i);
        let (own, other) = (of(&group, *i), of(&group, *j));
        group.insert(*i, own);
        group.insert(*j, own);
        group.values_mut().filter(|name| **name == other).for_each(|name| *name = own);
    }
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (error, name) in group {
        members.entry(name).or_default().push(error);
    }
    members.into_values().map(|errors| CorrelatedErrors::new(errors, &pairs)).collect()
}

/// The coefficient of each pair of different errors, the smaller number first.
fn pairs(
    correlations: &[ErrorCorrelation],
    count: usize,
) -> Result<BTreeMap<(usize, usize), f64>, LensError> {
    let refuse = |text: String| Err(LensError::Inconsistent(format!("correlations: {text}")));
    let mut pairs = BTreeMap::new();
    for ErrorCorrelation { errors, coefficient } in correlations {
        if !(-1.0..=1.0).contains(coefficient) {
            return refuse(format!("a coefficient of {coefficient}; expected -1 to 1"));
        }
        if errors.len() < 2 {
            return refuse(format!("{} errors together; expected two or more", errors.len()));
        }
        if errors.len() > MOST {
            return refuse(format!("{} errors together; expected at most {MOST}", errors.len()));
        }
        for (place, a) in errors.iter().enumerate() {
            if *a >= count {
                return refuse(format!("error {a}, counted from 0; expected less than {count}"));
            }
            for b in &errors[..place] {
                if a == b {
                    return refuse(format!("error {a} is named twice; expected different ones"));
                }
                if pairs.insert((*a.min(b), *a.max(b)), *coefficient).is_some() {
                    return refuse(format!("the errors {a} and {b} have two coefficients"));
                }
            }
        }
    }
    Ok(pairs)
}

impl CorrelatedErrors {
    fn new(errors: Vec<usize>, pairs: &BTreeMap<(usize, usize), f64>) -> Result<Self, LensError> {
        let count = errors.len();
        if count > MOST {
            let text = format!("correlations: {count} errors together; expected at most {MOST}");
            return Err(LensError::Inconsistent(text));
        }
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            if i == j {
                return 1.0;
            }
            let pair = (errors[i.min(j)], errors[i.max(j)]);
            pairs.get(&pair).copied().unwrap_or(0.0)
        });
        if let Some(factor) = lower_factor(&matrix) {
            return Ok(Self { errors, factor });
        }
        let lowest = matrix.symmetric_eigenvalues().min();
        Err(LensError::Inconsistent(format!(
            "correlations: those of the errors {errors:?} contradict each other, as their matrix has \
             the eigenvalue {lowest:.3}; expected a positive semidefinite one"
        )))
    }

    /// The coefficient of correlation of two of the errors, by their places in this group.
    pub fn coefficient(&self, i: usize, j: usize) -> f64 {
        self.factor.row(i).dot(&self.factor.row(j))
    }
}

/// The lower triangular factor of a matrix with ones on its diagonal, which may be singular; `None` for
/// one that is not positive semidefinite.
fn lower_factor(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = matrix.nrows();
    let zero = ROUNDING * count as f64;
    let mut factor: DMatrix<f64> = DMatrix::zeros(count, count);
    for k in 0..count {
        let rest = |factor: &DMatrix<f64>, i: usize| {
            matrix[(i, k)] - (0..k).map(|j| factor[(i, j)] * factor[(k, j)]).sum::<f64>()
        };
        let pivot = rest(&factor, k);
        if pivot < -zero {
            return None;
        }
        if pivot > zero {
            let root = pivot.sqrt();
            for i in k..count {
                factor[(i, k)] = rest(&factor, i) / root;
            }
        } else if (k + 1..count).any(|i| rest(&factor, i).abs() > zero.sqrt()) {
            // A row that is a combination of those above it has nothing of its own to share.
            return None;
        }
    }
    Some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(all: &[(&[usize], f64)], count: usize) -> Result<Vec<CorrelatedErrors>, LensError> {
        let correlation = |(errors, coefficient): &(&[usize], f64)| ErrorCorrelation {
            errors: errors.to_vec(),
            coefficient: *coefficient,
        };
        correlated_errors(&all.iter().map(correlation).collect::<Vec<_>>(), count)
    }

    #[test]
    fn factors_give_the_coefficients_back() {
        let found = of(&[(&[1, 4, 2], 0.5), (&[5, 7], -0.3), (&[7, 9], 0.2)], 10).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!((&found[0].errors[..], &found[1].errors[..]), (&[1, 2, 4][..], &[5, 7, 9][..]));
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.5 };
                assert!((found[0].coefficient(i, j) - expected).abs() < 1e-15);
            }
        }
        assert!((found[1].coefficient(0, 1) + 0.3).abs() < 1e-15);
        assert!(found[1].coefficient(0, 2).abs() < 1e-15);
    }

    /// Errors that are the same, and three of which one is given by the others, leave singular matrices.
    #[test]
    fn a_singular_matrix_is_factored_and_a_contradictory_one_refused() {
        let same = of(&[(&[0, 1, 2], 1.0)], 3).unwrap();
        assert!((0..3).all(|i| (same[0].factor[(i, 0)] - 1.0).abs() < 1e-15));
        assert!((1..3).all(|i| same[0].factor[(i, i)] == 0.0));
        // 1 + 2 · 0.6² · (−0.28) − 2 · 0.6² − 0.28² = 0
        let plane = of(&[(&[0, 1], 0.6), (&[0, 2], 0.6), (&[1, 2], -0.28)], 3).unwrap();
        assert!(plane[0].factor[(2, 2)] < 1e-6);
        assert!((plane[0].coefficient(1, 2) + 0.28).abs() < 1e-12);
        let refused = of(&[(&[0, 1], 0.6), (&[0, 2], 0.6), (&[1, 2], -0.29)], 3).unwrap_err();
        assert!(refused.to_string().contains("positive semidefinite"), "{refused}");
        let refused = of(&[(&[0, 1, 2], -1.0)], 3).unwrap_err();
        assert!(refused.to_string().contains("eigenvalue -1.000"), "{refused}");
    }

    #[test]
    fn what_makes_no_sense_is_refused_by_name() {
        for (all, words) in [
            (&[(&[0, 3][..], 0.5)][..], "error 3, counted from 0; expected less than 3"),
            (&[(&[0, 0][..], 0.5)][..], "error 0 is named twice"),
            (&[(&[0, 1][..], 1.5)][..], "expected -1 to 1"),
            (&[(&[0, 1][..], f64::NAN)][..], "expected -1 to 1"),
            (&[(&[0, 1][..], 0.5), (&[1, 0][..], 0.4)][..], "two coefficients"),
        ] {
            let refused = of(all, 3).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }
}
