//! Kinks of a sum of squares.
//!
//! The light of a field on the axis is what the narrowest rim lets through; where two rims are equally
//! narrow the sum has a kink. The derivatives there are those of one side, and every step by them, however
//! short, may run up the other one. So what a rejected trial has found beyond the model is remembered as
//! a linear function that counts where it is positive (a cutting plane; Kelley, SIAM J. 8 (1960) 703),
//! and the next steps minimize the model with all that were met.

use super::separate::PiecewiseModel;
use super::trust_region::LeastSquaresPoint;
use nalgebra::{DMatrix, DVector};

/// The kinks around a point that trials have met.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SumKinks {
    cuts: Vec<CuttingPlane>,
    /// The consecutive trials that were rejected.
    rejections: usize,
}

/// A linear function that counts where it is positive.
#[derive(Debug, Clone, PartialEq)]
struct CuttingPlane {
    /// Its value at the current point; not positive.
    value: f64,
    /// Half its slope.
    half_slope: DVector<f64>,
    /// The accepted steps since it was met or has counted.
    age: usize,
}

/// The rejections in a row from which a kink is suspected: one may be too long a step.
const SUSPECT: usize = 2;
/// The change of the gradient beyond that of the model, relative to the gradient, above which a trial has met
/// a kink.
const KINKED: f64 = 0.3;
/// The difference of two cutting planes, relative to one of them, below which they are the same.
const DISTINCT: f64 = 0.05;
/// The accepted steps after which a cutting plane is forgotten unless it has counted.
const MAX_AGE: usize = 5;
/// The number of cutting planes that are remembered.
const MAX_CUTS: usize = 8;

impl SumKinks {
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// What the kinks add to the model behind a change.
    pub(super) fn rise(&self, change: &DVector<f64>) -> f64 {
        self.cuts.iter().map(|cut| cut.behind(change).max(0.0)).sum()
    }

    /// The slopes of the cutting planes by parameters of these scales, and the bounds up to which they do not
    /// count.
    pub(super) fn rows(&self, scales: &DVector<f64>) -> (DMatrix<f64>, Vec<[f64; 2]>) {
        let slope = |row: usize, i: usize| 2.0 * self.cuts[row].half_slope[i] / scales[i];
        let rows = DMatrix::from_fn(self.cuts.len(), scales.len(), slope);
        (rows, self.cuts.iter().map(|cut| [f64::NEG_INFINITY, -cut.value]).collect())
    }

    /// Follows an accepted step; true if it has crossed a kink. What was on the other side of that is on this
    /// one then.
    pub(super) fn follow(&mut self, change: &DVector<f64>) -> bool {
        self.rejections = 0;
        let mut crossed = false;
        for cut in &mut self.cuts {
            cut.value = cut.behind(change);
            cut.age += 1;
            if cut.value > 0.0 {
                crossed = true;
                *cut = CuttingPlane { value: -cut.value, half_slope: -&cut.half_slope, age: 0 };
            }
        }
        self.cuts.retain(|cut| cut.age <= MAX_AGE);
        crossed
    }

    /// Takes note of a rejected trial at a change; true if it has met a kink that was not known.
    pub(super) fn meet(
        &mut self,
        model: PiecewiseModel<'_>,
        change: &DVector<f64>,
        to: &LeastSquaresPoint,
        scales: &DVector<f64>,
    ) -> bool {
        self.rejections += 1;
        if self.rejections < SUSPECT || !(to.value > model.point.value) {
            return false;
        }
        let [(value, gradient, normal), (there, slope_there, _)] =
            [model.point, to].map(LeastSquaresPoint::without_separate);
        // The second derivatives that are added to the matrix of the residuals.
        let along = (normal + model.hessian - &model.point.normal) * change;
        let predicted = value + 2.0 * gradient.dot(change) + along.dot(change);
        let half_slope = slope_there - &gradient - along;
        let size = |slope: &DVector<f64>| slope.component_div(scales).norm();
        let is_kink = half_slope.dot(change) > 0.0
            && size(&half_slope) > KINKED * size(&model.point.half_gradient);
        if !is_kink || !half_slope.iter().all(|slope| slope.is_finite()) {
            return false;
        }
        let value = (there - predicted - 2.0 * half_slope.dot(change)).min(0.0);
        self.cuts
            .retain(|cut| size(&(&cut.half_slope - &half_slope)) > DISTINCT * size(&half_slope));
        if self.cuts.len() == MAX_CUTS {
            self.cuts.remove(0);
        }
        self.cuts.push(CuttingPlane { value, half_slope, age: 0 });
        true
    }
}

impl CuttingPlane {
    fn behind(&self, change: &DVector<f64>) -> f64 {
        self.value + 2.0 * self.half_slope.dot(change)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `(x − 1)² + y² + |x + y|`, whose minimum is at (0.5, −0.5).
    fn kinked(x: &DVector<f64>) -> LeastSquaresPoint {
        let sum = x[0] + x[1];
        let sign = if sum > 0.0 { 0.5 } else { -0.5 };
        LeastSquaresPoint {
            value: (x[0] - 1.0).powi(2) + x[1] * x[1] + sum.abs(),
            half_gradient: DVector::from_vec(vec![x[0] - 1.0 + sign, x[1] + sign]),
            normal: DMatrix::identity(2, 2),
            separate: Vec::new(),
        }
    }

    #[test]
    fn a_plane_is_met_after_two_rejections_and_changes_its_side_where_it_is_crossed() {
        let (scales, change) = (DVector::from_element(2, 1.0), DVector::from_vec(vec![0.5, 0.5]));
        let here = kinked(&DVector::from_vec(vec![-0.1, -0.1]));
        let model = PiecewiseModel { point: &here, hessian: &here.normal };
        let to = kinked(&DVector::from_vec(vec![0.4, 0.4]));
        let mut kinks = SumKinks::default();
        let risen = LeastSquaresPoint { value: to.value + 10.0, ..to.clone() };
        assert!(!kinks.meet(model, &change, &risen, &scales) && kinks.cuts.is_empty());
        assert!(kinks.meet(model, &change, &risen, &scales));
        // The same again is no other one.
        assert!(kinks.meet(model, &change, &risen, &scales) && kinks.cuts.len() == 1);
        let promised = |kinks: &SumKinks| model.decrease(&change) - kinks.rise(&change);
        assert!(promised(&kinks) < model.decrease(&change));
        assert!(kinks.follow(&change));
        assert!(kinks.cuts[0].value <= 0.0 && kinks.cuts[0].half_slope[0] < 0.0);
        let still = DVector::zeros(2);
        assert!((0..=MAX_AGE).all(|_| !kinks.follow(&still)));
        assert!(kinks.cuts.is_empty());
    }

    /// Of exact values the plane is exact: the model with it is the function on both sides.
    #[test]
    fn a_kink_between_two_parabolas_is_known_after_one_trial() {
        let (scales, change) = (DVector::from_element(2, 1.0), DVector::from_vec(vec![-0.5, 1.4]));
        let from = DVector::from_vec(vec![0.2, -0.6]);
        let (here, there) = (kinked(&from), kinked(&(&from + &change)));
        assert!(there.value > here.value);
        let model = PiecewiseModel { point: &here, hessian: &here.normal };
        let mut kinks = SumKinks { rejections: SUSPECT, ..SumKinks::default() };
        assert!(kinks.meet(model, &change, &there, &scales));
        for point in [[0.5, -0.5], [1.0, 1.0], [-2.0, 0.5], [0.0, 0.1]] {
            let change = DVector::from_row_slice(&point) - &from;
            let found = here.value - model.decrease(&change) + kinks.rise(&change);
            let exact = kinked(&(&from + &change)).value;
            assert!((found - exact).abs() < 1e-12, "{point:?}: {found} {exact}");
        }
    }
}
