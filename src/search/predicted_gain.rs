//! The gain of further variables in a sum of squares, predicted from its normal equations.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The damping of scaled variables, each of which has an effect of 1.
const DAMPING: f64 = 1e-3;

/// The quadratic model of a sum of squares whose variables have an effect of 1 each; some of them are new.
///
/// Half of the gradient by a new variable that remains after the others have followed, squared and divided by
/// its curvature after the same, is what it takes from the sum: the Schur complement of the damped normal
/// matrix, one factorization for all of them.
pub(super) struct QuadraticModel {
    half_gradient: DVector<f64>,
    normal: DMatrix<f64>,
    /// The variables that are not new, and their damped normal matrix.
    base: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
    /// Their step.
    solved: DVector<f64>,
}

impl QuadraticModel {
    /// The model of a sum with half of this gradient and this normal matrix; `None` if it has no minimum.
    pub(super) fn new(
        half_gradient: &DVector<f64>,
        normal: &DMatrix<f64>,
        is_new: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let unit = |i: usize| {
            let effect = normal[(i, i)].sqrt();
            if effect > 0.0 && effect.is_finite() { 1.0 / effect } else { 0.0 }
        };
        let units = DVector::from_fn(half_gradient.len(), |i, _| unit(i));
        let half_gradient = half_gradient.component_mul(&units);
        let normal = normal.component_mul(&(&units * units.transpose()));
        let is_base = |i: &usize| units[*i] > 0.0 && !is_new(*i);
        let base: Vec<usize> = (0..units.len()).filter(is_base).collect();
        let mut damped = normal.select_rows(&base).select_columns(&base);
        (0..base.len()).for_each(|i| damped[(i, i)] += DAMPING);
        let factor = Cholesky::new(damped)?;
        let solved = factor.solve(&half_gradient.select_rows(&base));
        Some(Self { half_gradient, normal, base, factor, solved })
    }

    /// The part of the sum that a new variable takes after the others have followed; `None` if it has no effect.
    pub(super) fn gain(&self, number: usize) -> Option<f64> {
        let column = self.normal.column(number).into_owned().select_rows(&self.base);
        let own = self.normal[(number, number)];
        let curvature = own + DAMPING - column.dot(&self.factor.solve(&column));
        let slope = self.half_gradient[number] - column.dot(&self.solved);
        let gain = slope * slope / curvature;
        (own > 0.0 && gain.is_finite()).then_some(gain)
    }
}

/// One of several things, drawn in proportion to its weight by a number from 0 to 1; `None` if there is none.
pub(super) fn drawn_by_weight<T: Copy>(all: &[(T, f64)], share: f64) -> Option<T> {
    let mut left = share * all.iter().map(|(_, weight)| weight).sum::<f64>();
    let drawn = all.iter().find(|(_, weight)| {
        left -= weight;
        left < 0.0
    });
    drawn.or(all.last()).map(|(thing, _)| *thing)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals that are linear in two old variables and a new one: the gain is the difference of the two
    /// minima.
    #[test]
    fn the_gain_is_that_of_the_minimum_with_the_new_variable() {
        let jacobian = DMatrix::from_row_slice(
            4,
            3,
            &[1.0, 0.2, 0.5, 0.0, 1.0, -0.3, 0.4, 0.1, 2.0, 1.0, -1.0, 0.7],
        );
        let residuals = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0]);
        let least = |columns: &[usize]| {
            let chosen = jacobian.select_columns(columns);
            let step = (chosen.transpose() * &chosen)
                .cholesky()
                .unwrap()
                .solve(&(chosen.transpose() * &residuals));
            (&residuals - chosen * step).norm_squared()
        };
        let exact = least(&[0, 1]) - least(&[0, 1, 2]);
        let half_gradient = jacobian.tr_mul(&residuals);
        let model =
            QuadraticModel::new(&half_gradient, &jacobian.tr_mul(&jacobian), |i| i == 2).unwrap();
        let gain = model.gain(2).unwrap();
        assert!((gain / exact - 1.0).abs() < 0.02, "{gain} {exact}");
    }

    #[test]
    fn things_are_drawn_in_proportion_to_their_weights() {
        let all = [('a', 1.0), ('b', 3.0)];
        let drawn = [0.0, 0.24, 0.26, 0.999, 1.0].map(|share| drawn_by_weight(&all, share));
        assert_eq!(drawn, [Some('a'), Some('a'), Some('b'), Some('b'), Some('b')]);
        assert_eq!(drawn_by_weight::<char>(&[], 0.5), None);
    }
}
