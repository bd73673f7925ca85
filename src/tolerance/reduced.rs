//! A quadratic form in few combinations of its errors, for many random lenses.
//!
//! The errors are sums of independent ones, so the numbers of the lens of which they are combinations
//! have a covariance; in uncorrelated combinations of the numbers the form has few large eigenvalues, and
//! a random lens is known from as many sums over its errors.

use super::draw::draw_independent;
use super::form::{AdjustedForm, QuadraticForm};
use super::mixture::ErrorMixture;
use super::{StopTest, ToleranceError, refuse_if_stopped};
use crate::lens::Tolerance;
use crate::solve::scaled_pseudoinverse;
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen, Vector2};
use rayon::prelude::*;

/// The share of the form whose scatter, though not its mean, is left out of samples.
const NEGLECTED: f64 = 1e-4;

/// The eigenvalues of a symmetric matrix that carry nearly all of it, with their eigenvectors as columns.
///
/// A matrix of mean products has few of them: they are those of its first pivoted Cholesky factors. One
/// of which these leave too much, as it is not positive, is decomposed as a whole.
fn principal(matrix: DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    if matrix.is_empty() {
        return (Vec::new(), matrix);
    }
    let (values, vectors) = if let Some(factors) = few_factors(&matrix) {
        let small = SymmetricEigen::new(factors.tr_mul(&factors));
        let mut vectors = factors * small.eigenvectors;
        for (mut column, value) in vectors.column_iter_mut().zip(small.eigenvalues.iter()) {
            column *= 1.0 / value.max(f64::MIN_POSITIVE).sqrt();
        }
        (small.eigenvalues, vectors)
    } else {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(matrix);
        (eigenvalues, eigenvectors)
    };
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].abs().total_cmp(&values[*a].abs()));
    let total: f64 = values.iter().map(|v| v.abs()).sum();
    let (mut kept, mut sum) = (Vec::new(), 0.0);
    for m in order {
        if sum >= (1.0 - NEGLECTED) * total {
            break;
        }
        sum += values[m].abs();
        kept.push(m);
    }
    let columns = DMatrix::from_fn(vectors.nrows(), kept.len(), |i, k| vectors[(i, kept[k])]);
    (kept.iter().map(|m| values[*m]).collect(), columns)
}

/// Columns `f` of which the sum of `f fᵀ` is a matrix but for a tenth of what may be left out; `None` if
/// there are none, or as many as the matrix has.
fn few_factors(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = matrix.nrows();
    let mut rest: Vec<f64> = (0..count).map(|i| matrix[(i, i)]).collect();
    let left = |rest: &[f64]| rest.iter().map(|value| value.abs()).sum::<f64>();
    let enough = 0.1 * NEGLECTED * left(&rest);
    let mut factors: Vec<DVector<f64>> = Vec::new();
    while left(&rest) > enough {
        let (pivot, own) = rest.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if factors.len() + 1 >= count || !(own > 0.0) {
            return None;
        }
        let mut column = matrix.column(pivot).into_owned();
        for factor in &factors {
            column.axpy(-factor[pivot], factor, 1.0);
        }
        column *= 1.0 / own.sqrt();
        rest.iter_mut().zip(column.iter()).for_each(|(rest, by)| *rest -= by * by);
        factors.push(column);
    }
    (!factors.is_empty()).then(|| DMatrix::from_columns(&factors))
}

/// The numbers of a lens as sums of independent errors with the variance 1.
struct IndependentNumbers {
    /// For each independent error the numbers that it changes, and by how much.
    columns: Vec<Vec<(usize, f64)>>,
    /// The standard deviation of each number.
    units: Vec<f64>,
    /// Uncorrelated combinations of the numbers in these units with the variance 1, as columns; and the
    /// same as a sum of which the numbers are made.
    of_numbers: DMatrix<f64>,
    numbers_of: DMatrix<f64>,
    /// The standard deviation of each independent error as it is drawn.
    deviations: Vec<f64>,
}

/// A combination of numbers whose variance is below this share of the largest one is rounding.
const ROUNDING: f64 = 1e-12;

impl IndependentNumbers {
    fn new(form: &QuadraticForm, mixture: &ErrorMixture) -> Self {
        let combinations = form.second.combinations();
        let deviations = mixture.deviations().to_vec();
        let mut columns = vec![Vec::new(); combinations.len()];
        for (i, combination) in combinations.iter().enumerate() {
            for (k, factor) in mixture.parts(i) {
                let by = factor * deviations[*k];
                columns[*k].extend(combination.iter().map(|(m, change)| (*m, change * by)));
            }
        }
        let count = form.second.among().nrows();
        let mut covariance = DMatrix::zeros(count, count);
        for column in &columns {
            for (m, by) in column {
                column.iter().for_each(|(n, other)| covariance[(*m, *n)] += by * other);
            }
        }
        let units: Vec<f64> = covariance.diagonal().iter().map(|v: &f64| v.sqrt()).collect();
        let inverse = |m: usize| if units[m] > 0.0 { 1.0 / units[m] } else { 0.0 };
        let scaled =
            DMatrix::from_fn(count, count, |m, n| inverse(m) * covariance[(m, n)] * inverse(n));
        let (variances, vectors) = decomposed(scaled);
        let largest = variances.iter().fold(0.0_f64, |most, v| most.max(*v));
        let kept: Vec<usize> = (0..count).filter(|k| variances[*k] > ROUNDING * largest).collect();
        let of = |power: i32| {
            DMatrix::from_fn(count, kept.len(), |m, k| {
                vectors[(m, kept[k])] * variances[kept[k]].sqrt().powi(power)
            })
        };
        let (of_numbers, numbers_of) = (of(-1), of(1));
        Self { columns, units, of_numbers, numbers_of, deviations }
    }

    /// A matrix of second derivatives by numbers as one by the uncorrelated combinations.
    fn whitened(&self, among: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = DMatrix::from_fn(among.nrows(), among.ncols(), |m, n| {
            self.units[m] * among[(m, n)] * self.units[n]
        });
        let half = scaled * &self.numbers_of;
        self.numbers_of.transpose() * half
    }

    /// Combinations of the uncorrelated ones, the columns of a matrix, by independent errors as they are
    /// drawn.
    fn directions(&self, vectors: &DMatrix<f64>) -> Vec<Vec<f64>> {
        let by_numbers = &self.of_numbers * vectors;
        let direction = |k: usize| {
            let factor = |(m, by): &(usize, f64)| {
                if self.units[*m] > 0.0 { by * by_numbers[(*m, k)] / self.units[*m] } else { 0.0 }
            };
            let columns = self.columns.iter().zip(&self.deviations);
            columns.map(|(own, dev)| own.iter().map(factor).sum::<f64>() / dev).collect()
        };
        (0..vectors.ncols()).map(direction).collect()
    }
}

/// The eigenvalues of a symmetric matrix with their eigenvectors as columns; a diagonal matrix has them
/// already.
fn decomposed(matrix: DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let count = matrix.nrows();
    let is_diagonal = (0..count).all(|i| (0..i).all(|j| matrix[(i, j)] == 0.0));
    if is_diagonal {
        return (matrix.diagonal(), DMatrix::identity(count, count));
    }
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(matrix);
    (eigenvalues, eigenvectors)
}

/// The row of [`ReducedForm::directions`] for the first derivatives; those of the best adjustments come
/// next.
const LINEAR: usize = 0;

/// The number of lenses whose errors are combined at once.
const LENSES: u64 = 256;

/// The number of lenses that tell how often compensators are at their stops, and their seed.
const AT_STOPS: u64 = 8_000;
const SEED: u64 = 0x57_0950;
/// The shares of the variances of errors, and their weights in a mean over all of them (Gauss and Legendre).
const VARIANCES: [[f64; 2]; 3] = [
    [0.112_701_665_379_258_3, 5.0 / 18.0],
    [0.5, 8.0 / 18.0],
    [0.887_298_334_620_741_7, 5.0 / 18.0],
];

/// A quadratic form in few combinations of its variables.
pub(super) struct ReducedForm {
    nominal: f64,
    /// The mean of the part that is left out, for the tolerances themselves.
    neglected: f64,
    /// The eigenvalue of each combination.
    values: Vec<f64>,
    /// The number of rows of `directions` in front of the combinations.
    own: usize,
    /// The first derivatives of the form, those of the best adjustments, and the combinations, all by
    /// independent errors.
    directions: DMatrix<f64>,
    adjusted: Option<AdjustedForm>,
}

impl ReducedForm {
    /// A form of errors that are sums of independent ones.
    pub(super) fn new(form: &QuadraticForm, mixture: &ErrorMixture) -> Self {
        let numbers = IndependentNumbers::new(form, mixture);
        let whitened = numbers.whitened(form.second.among());
        let trace = whitened.trace();
        let (values, vectors) = principal(whitened);
        let count = form.first.len();
        let mut rows = vec![mixture.by_independent(&form.first)];
        let adjusted = form.adjusted.clone();
        for row in adjusted.iter().flat_map(|adjusted| adjusted.first.row_iter()) {
            rows.push(mixture.by_independent(&row.iter().copied().collect::<Vec<_>>()));
        }
        let own = rows.len();
        rows.extend(numbers.directions(&vectors));
        let directions = DMatrix::from_fn(rows.len(), count, |row, i| rows[row][i]);
        let variance = |i: usize| {
            let of_itself = mixture.covariances(i).iter().find(|(j, _)| *j == i);
            of_itself.map_or(0.0, |(_, variance)| *variance)
        };
        let diagonal: f64 = (0..count).map(|i| form.second.own(i) * variance(i)).sum();
        let neglected = 0.5 * (diagonal + trace - values.iter().sum::<f64>());
        Self { nominal: form.nominal, neglected, values, own, directions, adjusted }
    }

    /// The terms of the form for this many lenses with random errors, and for all multiples of these,
    /// until `stop` says so.
    ///
    /// # Errors
    /// [`ToleranceError::Stopped`].
    pub(super) fn random_lenses(
        &self,
        tolerances: &[Tolerance],
        seed: u64,
        count: u64,
        stop: StopTest<'_>,
    ) -> Result<Vec<ErrorMultiples>, ToleranceError> {
        let part = |part: u64| {
            refuse_if_stopped(stop)?;
            let lenses = part * LENSES..count.min((part + 1) * LENSES);
            let mut errors = DMatrix::zeros(tolerances.len(), (lenses.end - lenses.start) as usize);
            for (number, mut column) in lenses.zip(errors.column_iter_mut()) {
                draw_independent(tolerances, seed, number, column.as_mut_slice());
            }
            let along = &self.directions * errors;
            Ok(along.column_iter().map(|along| self.multiples(along.as_slice())).collect())
        };
        let parts = (0..count.div_ceil(LENSES)).into_par_iter().map(part);
        let parts: Vec<Vec<ErrorMultiples>> = parts.collect::<Result<_, ToleranceError>>()?;
        Ok(parts.into_iter().flatten().collect())
    }

    fn multiples(&self, along: &[f64]) -> ErrorMultiples {
        let kept = self.values.iter().zip(&along[self.own..]);
        let square: f64 = kept.map(|(value, along)| 0.5 * value * along * along).sum();
        ErrorMultiples {
            linear: along[LINEAR],
            square: self.neglected + square,
            adjustments: along[LINEAR + 1..self.own].to_vec(),
        }
    }

    /// The mean square spot radius of a lens with a multiple of some errors, in mm².
    pub(super) fn at_multiple(&self, errors: &ErrorMultiples, factor: f64) -> f64 {
        let ErrorMultiples { linear, square, adjustments } = errors;
        let sum = self.nominal + factor * (linear + factor * square);
        let cost = |own: &AdjustedForm| own.cost(&own.best_of(adjustments, factor));
        sum.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The second derivatives by the best adjustments of what the ends of their travels cost, as the mean over random
    /// lenses and over the variances of their errors from none to those of the tolerances; times a factor with which
    /// they cost what the lenses do, since the mean is exact for normal errors alone. `None` at the fixed image
    /// plane.
    pub(super) fn stop_curvature(
        &self,
        tolerances: &[Tolerance],
    ) -> Result<Option<DMatrix<f64>>, ToleranceError> {
        let Some(adjusted) = &self.adjusted else { return Ok(None) };
        let lenses = self.random_lenses(tolerances, SEED, AT_STOPS, &|| false)?;
        let count = adjusted.nominal.len();
        let of_lens = |errors: &ErrorMultiples| {
            VARIANCES.iter().fold(DMatrix::zeros(count, count), |sum, [variance, weight]| {
                let best = adjusted.best_of(&errors.adjustments, variance.sqrt());
                sum + *weight * adjusted.travel.derivatives_of_least(&best).1
            })
        };
        let sum = lenses.iter().fold(DMatrix::zeros(count, count), |sum, own| sum + of_lens(own));
        let curvature = sum / lenses.len() as f64;
        let by_curvature = 0.5 * (&curvature * self.covariance_of_adjustments(tolerances)).trace();
        let cost = growth_of_cost(adjusted, &lenses, (&curvature, by_curvature));
        let factor = if by_curvature > 0.0 { (cost / by_curvature).max(0.0) } else { 1.0 };
        Ok(Some(curvature * factor))
    }

    /// The covariance of the best adjustments, whatever their travel.
    fn covariance_of_adjustments(&self, tolerances: &[Tolerance]) -> DMatrix<f64> {
        let rows = self.directions.rows(LINEAR + 1, self.own - LINEAR - 1);
        let scaled = DMatrix::from_fn(rows.nrows(), rows.ncols(), |row, k| {
            rows[(row, k)] * tolerances[k].distribution.deviation()
        });
        &scaled * scaled.transpose()
    }

    /// The adjustments of a lens with some errors within their travel, focus first; none at the fixed
    /// image plane.
    pub(super) fn adjustments(&self, errors: &ErrorMultiples) -> Vec<f64> {
        let within =
            |own: &AdjustedForm| own.travel.minimum(&own.best_of(&errors.adjustments, 1.0));
        self.adjusted.as_ref().map_or_else(Vec::new, within)
    }
}

impl AdjustedForm {
    /// The best adjustments with changes by errors times a factor.
    fn best_of(&self, changes: &[f64], factor: f64) -> Vec<f64> {
        self.nominal.iter().zip(changes).map(|(nominal, by)| nominal + factor * by).collect()
    }
}

/// The growth of what the ends of travels cost by the errors of random lenses, in mm². Its scatter is mostly that of
/// its first and second derivatives there, of which the means are known.
fn growth_of_cost(
    adjusted: &AdjustedForm,
    lenses: &[ErrorMultiples],
    (curvature, by_curvature): (&DMatrix<f64>, f64),
) -> f64 {
    let (slope, _) = adjusted.travel.derivatives_of_least(&adjusted.nominal);
    let nominal = adjusted.cost(&adjusted.nominal);
    let number = |errors: &ErrorMultiples| {
        let change = DVector::from_column_slice(&errors.adjustments);
        let square = 0.5 * change.dot(&(curvature * &change)) - by_curvature;
        let cost = adjusted.cost(&adjusted.best_of(&errors.adjustments, 1.0)) - nominal;
        (Vector2::new(slope.dot(&change), square), cost)
    };
    let numbers: Vec<(Vector2<f64>, f64)> = lenses.iter().map(number).collect();
    let count = numbers.len() as f64;
    let known = numbers.iter().map(|own| own.0).sum::<Vector2<f64>>() / count;
    let mean = numbers.iter().map(|own| own.1).sum::<f64>() / count;
    let products = numbers.iter().map(|(own, _)| (own - known) * (own - known).transpose());
    let with_cost = numbers.iter().map(|(own, cost)| (own - known) * (cost - mean));
    let (products, with_cost): (Matrix2<f64>, Vector2<f64>) = (products.sum(), with_cost.sum());
    let products = DMatrix::from_column_slice(2, 2, products.as_slice());
    let factors = scaled_pseudoinverse(&products) * with_cost;
    mean - factors.dot(&known)
}

/// The additions of errors to the form: to first order, to second order, and to the best adjustments.
pub(super) struct ErrorMultiples {
    linear: f64,
    square: f64,
    adjustments: Vec<f64>,
}
