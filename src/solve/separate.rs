//! Residuals that are known by themselves beside the sum of all others, in the quadratic model of a sum of
//! squares.
//!
//! The square of a violated limit is half a parabola. A model by the derivatives at a point knows
//! the parabolas of the limits that are broken there, and goes on with them where the limits are kept
//! again; of the others it knows nothing and runs through them, so that a descent between limits
//! advances by as little as its steps find out. With every limit by its value and its slope the model is
//! a parabola in pieces, whose minimum is found from piece to piece (a semismooth Newton method; Qi and
//! Sun, Math. Program. 58 (1993) 353), with the exact minimum on the way to the minimum of each.
//!
//! A residual that is stiff and curved, such as a focal length, makes a bent valley: along a straight
//! step it grows with the square of the length, and only short steps gain. Where it can be evaluated by
//! itself, the end of a step is corrected until the residual is what the model has promised.

use super::trust_region::{LeastSquaresPoint, decrease};
use nalgebra::{Cholesky, DMatrix, DVector};

/// A residual that is known by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct SeparateResidual {
    /// `r`.
    pub value: f64,
    /// `∂r`.
    pub slope: DVector<f64>,
    /// True if `r²` counts where `r` is positive alone.
    pub is_one_sided: bool,
    /// True if it can be evaluated without the others.
    pub is_cheap: bool,
}

impl SeparateResidual {
    /// The same with its square times a factor that is not negative.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let root = factor.sqrt();
        Self { value: root * self.value, slope: &self.slope * root, ..*self }
    }

    /// True if the residual and its slope are finite.
    pub fn is_finite(&self) -> bool {
        self.value.is_finite() && self.slope.iter().all(|slope| slope.is_finite())
    }

    /// One in its place that never counts.
    #[must_use]
    pub fn unlimited(&self) -> Self {
        let slope = DVector::zeros(self.slope.len());
        Self { value: -1.0, slope, is_one_sided: true, ..*self }
    }

    /// True if its square counts.
    pub fn counts(&self) -> bool {
        self.would_count(self.value)
    }

    fn would_count(&self, value: f64) -> bool {
        !self.is_one_sided || value > 0.0
    }

    /// The residual behind a change of the parameters, by its slope.
    fn behind(&self, change: &DVector<f64>) -> f64 {
        self.value + self.slope.dot(change)
    }
}

/// The model of a sum of squares around a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct PiecewiseModel<'a> {
    pub(super) point: &'a LeastSquaresPoint,
    /// Half the Hessian at the point.
    pub(super) hessian: &'a DMatrix<f64>,
}

/// The place on a line where a model is least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LeastAlong {
    /// The part of the line, 0 to 1.
    pub(super) part: f64,
    /// True if the way there stays in one piece of the model.
    pub(super) is_in_piece: bool,
}

impl PiecewiseModel<'_> {
    /// The residuals that count behind a change but not at the point, with a sign of 1, and those of which
    /// the opposite is true, with −1.
    fn turned<'a>(
        &'a self,
        change: &'a DVector<f64>,
    ) -> impl Iterator<Item = (f64, &'a SeparateResidual, f64)> {
        self.point.separate.iter().filter_map(|residual| {
            let there = residual.behind(change);
            match (residual.counts(), residual.would_count(there)) {
                (false, true) => Some((1.0, residual, there)),
                (true, false) => Some((-1.0, residual, there)),
                _ => None,
            }
        })
    }

    /// The decrease of the sum by a change.
    pub(super) fn decrease(&self, change: &DVector<f64>) -> f64 {
        let turned = self.turned(change).map(|(sign, _, there)| sign * there * there);
        decrease(self.hessian, &self.point.half_gradient, change) - turned.sum::<f64>()
    }

    /// Half the Hessian and half the gradient at the point of the parabola that the model is behind a change.
    pub(super) fn piece(&self, change: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (mut hessian, mut gradient) = (self.hessian.clone(), self.point.half_gradient.clone());
        for (sign, residual, _) in self.turned(change) {
            hessian.ger(sign, &residual.slope, &residual.slope, 1.0);
            gradient.axpy(sign * residual.value, &residual.slope, 1.0);
        }
        (hessian, gradient)
    }

    /// The first minimum of the model on the line from one change to another one.
    pub(super) fn least_along(&self, from: &DVector<f64>, to: &DVector<f64>) -> LeastAlong {
        let way = to - from;
        let (hessian, gradient) = self.piece(from);
        let along = &hessian * &way;
        // Half the derivative at a part t of the line is `slope + t · curvature`.
        let (mut slope, mut curvature) = (gradient.dot(&way) + along.dot(from), along.dot(&way));
        let crossing = |residual: &SeparateResidual| {
            let (here, change) = (residual.behind(from), residual.slope.dot(&way));
            let crosses = if here > 0.0 { change < 0.0 } else { change > 0.0 };
            crosses.then(|| (-here / change, here, change)).filter(|(part, ..)| *part < 1.0)
        };
        let one_sided = self.point.separate.iter().filter(|residual| residual.is_one_sided);
        let mut crossings: Vec<_> = one_sided.filter_map(crossing).collect();
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (i, (part, here, change)) in crossings.iter().enumerate() {
            if slope + part * curvature >= 0.0 {
                return LeastAlong { part: (-slope / curvature).max(0.0), is_in_piece: i == 0 };
            }
            let sign = change.signum();
            slope += sign * here * change;
            curvature += sign * change * change;
        }
        let part = if slope + curvature > 0.0 { (-slope / curvature).max(0.0) } else { 1.0 };
        LeastAlong { part, is_in_piece: crossings.is_empty() }
    }
}

impl LeastSquaresPoint {
    /// The change of half the gradient on the way to another point, and the part of it that the matrix there
    /// does not tell: of separate residuals by their own slopes, `r ∂r` at the end less `r` there times `∂r`
    /// here. Those that count at one of both points alone are left out: what remains has the same form all
    /// the way.
    pub(super) fn gradient_change(&self, to: &Self, change: &DVector<f64>) -> [DVector<f64>; 2] {
        let mut gradient = &to.half_gradient - &self.half_gradient;
        let mut missing = &gradient - &to.normal * change;
        for (here, there) in self.separate.iter().zip(&to.separate) {
            match (here.counts(), there.counts()) {
                (true, true) => {
                    missing.axpy(here.value - there.value, &here.slope, 1.0);
                    missing.axpy(there.slope.dot(change), &there.slope, 1.0);
                }
                (true, false) => {
                    gradient.axpy(here.value, &here.slope, 1.0);
                    missing.axpy(here.value, &here.slope, 1.0);
                }
                (false, true) => {
                    gradient.axpy(-there.value, &there.slope, 1.0);
                    let by_matrix = there.slope.dot(change);
                    missing.axpy(by_matrix - there.value, &there.slope, 1.0);
                }
                (false, false) => {}
            }
        }
        [gradient, missing]
    }

    /// The effects of the parameters on the residuals, of which separate ones have a share whether they
    /// count or not.
    pub(super) fn effects(&self, share: f64) -> DVector<f64> {
        let mut squares = self.normal.diagonal();
        for residual in &self.separate {
            let missing = if residual.counts() { share - 1.0 } else { share };
            squares.zip_apply(&residual.slope, |square, slope| *square += missing * slope * slope);
        }
        squares.map(|square| square.max(0.0).sqrt())
    }

    /// The shortest change, in parameters of these scales, after a step whose cheap residuals are found to
    /// be `now`, that makes them what their slopes at this point have promised. `None` where they are
    /// nearly that: where the sum of the squares of the differences is at most `negligible`.
    pub(super) fn correction(
        &self,
        step: &DVector<f64>,
        now: &[SeparateResidual],
        scales: &DVector<f64>,
        negligible: f64,
    ) -> Option<DVector<f64>> {
        let cheap = self.separate.iter().filter(|residual| residual.is_cheap);
        let missing = |(from, now): (&SeparateResidual, &SeparateResidual)| {
            let promised = from.behind(step);
            if from.would_count(promised) {
                promised - now.value
            } else if now.counts() {
                -now.value
            } else {
                0.0
            }
        };
        let missing: Vec<f64> = cheap.zip(now).map(missing).collect();
        if !(missing.iter().map(|r| r * r).sum::<f64>() > negligible) {
            return None;
        }
        let count = scales.len();
        let (mut matrix, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for (residual, missing) in now.iter().zip(missing) {
            if missing != 0.0 || residual.counts() {
                let slope = residual.slope.component_div(scales);
                matrix.ger(1.0, &slope, &slope, 1.0);
                right.axpy(missing, &slope, 1.0);
            }
        }
        let damping = SHORTNESS * matrix.diagonal().max();
        matrix += DMatrix::identity(count, count) * damping;
        Some(Cholesky::new(matrix)?.solve(&right).component_div(scales))
    }
}

/// The weight of the length of a correction against what it corrects.
const SHORTNESS: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of `Σ (x − c)ᵀ diag(d) (x − c)` and one-sided residuals, all linear.
    struct Sum {
        center: DVector<f64>,
        weights: DVector<f64>,
        one_sided: Vec<SeparateResidual>,
    }

    impl Sum {
        fn at(&self, x: &DVector<f64>) -> LeastSquaresPoint {
            let off = x - &self.center;
            let weighted = off.component_mul(&self.weights);
            let mut point = LeastSquaresPoint {
                value: off.dot(&weighted),
                half_gradient: weighted,
                normal: DMatrix::from_diagonal(&self.weights),
                separate: Vec::new(),
            };
            for residual in &self.one_sided {
                let (value, slope) = (residual.behind(x), residual.slope.clone());
                if residual.would_count(value) {
                    point.value += value * value;
                    point.half_gradient.axpy(value, &slope, 1.0);
                    point.normal.ger(1.0, &slope, &slope, 1.0);
                }
                point.separate.push(SeparateResidual { value, slope, ..*residual });
            }
            point
        }
    }

    fn residual(value: f64, slope: &[f64]) -> SeparateResidual {
        let slope = DVector::from_column_slice(slope);
        SeparateResidual { value, slope, is_one_sided: true, is_cheap: true }
    }

    /// A wedge of two steep limits, one more that is broken at the start, and one that is never reached.
    fn wedge() -> Sum {
        Sum {
            center: DVector::from_vec(vec![3.0, -1.0]),
            weights: DVector::from_vec(vec![1e-3, 4e-3]),
            one_sided: vec![
                residual(-1.0, &[1.0, 1.0]),
                residual(-0.5, &[0.8, -2.0]),
                residual(0.7, &[-1.0, 0.3]),
                residual(-50.0, &[0.1, 0.1]),
            ],
        }
    }

    #[test]
    fn a_model_of_linear_residuals_is_their_sum_wherever_limits_begin_to_count() {
        let sum = wedge();
        let points = [[0.0, 0.0], [2.0, 0.5], [-1.0, 3.0], [0.5, -4.0]];
        for from in points.map(|point| DVector::from_row_slice(&point)) {
            let here = sum.at(&from);
            let model = PiecewiseModel { point: &here, hessian: &here.normal };
            for to in points.map(|point| DVector::from_row_slice(&point)) {
                let (there, change) = (sum.at(&to), &to - &from);
                let found = model.decrease(&change);
                assert!((found - (here.value - there.value)).abs() < 1e-12, "{from} {to}: {found}");
                let (hessian, gradient) = model.piece(&change);
                let slope = gradient + &hessian * &change;
                assert!((slope - there.half_gradient).amax() < 1e-12, "{from} {to}");
                assert!((hessian - there.normal).amax() < 1e-12, "{from} {to}");
            }
        }
    }

    #[test]
    fn the_least_value_on_a_line_is_not_above_any_other_of_it() {
        let sum = wedge();
        let zero = DVector::zeros(2);
        let here = sum.at(&zero);
        let model = PiecewiseModel { point: &here, hessian: &here.normal };
        for (from, to) in
            [([0.0, 0.0], [4.0, -3.0]), ([1.0, 1.0], [-6.0, -2.0]), ([0.0; 2], [0.1, 0.0])]
        {
            let [from, to] = [from, to].map(|point: [f64; 2]| DVector::from_row_slice(&point));
            let at = |part: f64| model.decrease(&(&from + (&to - &from) * part));
            let found = model.least_along(&from, &to);
            let best =
                (0..=1000).map(|i| at(f64::from(i) / 1000.0)).fold(f64::NEG_INFINITY, f64::max);
            assert!(at(found.part) >= best, "{from} {to}: {found:?}");
        }
    }

    #[test]
    fn of_linear_residuals_nothing_is_left_that_the_matrix_does_not_tell() {
        let mut sum = wedge();
        sum.one_sided[2].is_one_sided = false;
        let [from, to] = [[0.0, 0.0], [2.0, 0.5]].map(|point| DVector::from_row_slice(&point));
        let change = &to - &from;
        let [gradient, missing] = sum.at(&from).gradient_change(&sum.at(&to), &change);
        assert!(missing.amax() < 1e-12, "{missing}");
        // The first limit begins to count and is not in it, the third does all the way.
        let third = &sum.one_sided[2].slope;
        let expected = sum.weights.component_mul(&change) + third * third.dot(&change);
        assert!((gradient - expected).amax() < 1e-12);
    }

    /// A residual that bends: `x² + y² − 1`, of which the squares of the radius are to stay.
    #[test]
    fn a_correction_leads_back_into_a_bent_valley() {
        let at = |x: &DVector<f64>| SeparateResidual {
            value: 1e3 * (x.norm_squared() - 1.0),
            slope: x * 2e3,
            is_one_sided: false,
            is_cheap: true,
        };
        let from = DVector::from_vec(vec![1.0, 0.0]);
        let mut point = wedge().at(&from);
        point.separate = vec![at(&from)];
        let step = DVector::from_vec(vec![0.0, 0.3]);
        let scales = DVector::from_element(2, 1.0);
        let mut there = &from + &step;
        for _ in 0..4 {
            let now = [at(&there)];
            let Some(change) = point.correction(&step, &now, &scales, 1e-12) else { break };
            there += change;
        }
        assert!(at(&there).value.abs() < 1e-6, "{there}");
        assert!((there[1] - 0.3).abs() < 0.05, "{there}");
    }

    #[test]
    fn an_effect_is_the_same_on_both_sides_of_a_limit() {
        let one = |value: f64| Sum {
            center: DVector::zeros(2),
            weights: DVector::from_vec(vec![1.0, 0.0]),
            one_sided: vec![residual(value, &[0.0, 3.0])],
        };
        for value in [-0.1, 0.1] {
            let effects = one(value).at(&DVector::zeros(2)).effects(0.25);
            assert!((effects - DVector::from_vec(vec![1.0, 1.5])).amax() < 1e-12, "{value}");
        }
        let none = residual(f64::NEG_INFINITY, &[f64::NAN, 1.0]);
        assert!(!none.is_finite() && none.unlimited().is_finite());
    }
}
