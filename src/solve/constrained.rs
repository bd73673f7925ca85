//! Sums of squares under limits: sequential quadratic programming in the trust region of
//! [`TrustRegion`].
//!
//! Every step minimizes the model of the sum of squares where the linearized limits hold; if they
//! cannot all hold within the region, where they are broken as little as they can be within a part
//! of it (Byrd and Omojokun; Nocedal and Wright, *Numerical Optimization*, 18.5). The secant matrix
//! approximates the second derivatives of the Lagrangian that `JᵀJ` leaves out. A step is accepted
//! if it lowers the sum plus the violations at their prices.

use super::kink::{BranchMemory, KinkBranches, KinkTrial};
use super::limit_values::{LimitValues, LimitedPoint, LimitedStep, SLACK};
use super::quadratic_program::{QuadraticProgram, QuadraticSolution};
use super::trust_region::{
    HessianModel, LeastSquaresPoint, TrustRegion, TrustRegionMemory, TrustRegionStep, decrease,
};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// The state of the method between two trials.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitedTrustRegion {
    pub(super) region: TrustRegion,
    /// The price of a violation of each limit in the sum that has to fall.
    prices: Vec<f64>,
    /// The natural length of a step at the last point.
    pub(super) natural: f64,
    /// The branches of kinked limits beside those of the last point.
    pub(super) branches: KinkBranches,
    /// True if the last trial has met a kink.
    met_kink: bool,
}

/// The state of a [`LimitedTrustRegion`] in the units of the parameters themselves, whatever they are
/// scaled by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitedTrustRegionMemory {
    region: TrustRegionMemory,
    prices: Vec<f64>,
    branches: Vec<BranchMemory>,
}

impl LimitedTrustRegionMemory {
    /// The same with a region that is smaller by a factor.
    pub fn shrink(&mut self, factor: f64) {
        self.region.shrink(factor);
    }
}

/// The share of a limit's weight that counts for the scales of the parameters.
const SCALE_SHARE: f64 = 1e-2;
/// The price of a violation relative to the multiplier, and the part of it that remains.
const PRICE_FACTOR: f64 = 2.0;
const PRICE_MEMORY: f64 = 0.5;
/// The curvature that every scaled parameter has at least; those with an effect have about 2.
const SHORTNESS: f64 = 1e-9;
/// The change of a limit by a step of natural length below which its derivatives are rounding.
const SMALLEST_EFFECT: f64 = 1e-9;
/// The violation, in the unit of each limit, that may be an error of its evaluation.
const NOISE: f64 = 1e-7;
/// The factor of the region after a trial that could not be evaluated.
const FAILED: f64 = 0.5;
/// The decrease relative to the predicted one from which a trial is accepted.
const ACCEPTED: f64 = 1e-4;

impl LimitedTrustRegion {
    /// The method before its first step for this many parameters and limits.
    pub fn new(parameters: usize, limits: usize) -> Self {
        Self {
            region: TrustRegion::new(parameters),
            prices: vec![0.0; limits],
            natural: 0.0,
            branches: KinkBranches::default(),
            met_kink: false,
        }
    }

    /// The method as it was, for parameters scaled by `units` and this many limits; a new one if their
    /// numbers differ.
    pub fn resume(memory: &LimitedTrustRegionMemory, units: &[f64], limits: usize) -> Self {
        if memory.prices.len() != limits {
            return Self::new(units.len(), limits);
        }
        Self {
            region: TrustRegion::resume(&memory.region, units),
            prices: memory.prices.clone(),
            branches: KinkBranches::resume(&memory.branches, units, limits),
            ..Self::new(units.len(), limits)
        }
    }

    /// The state of the method, for parameters scaled by `units`; `None` if a number of it is not finite.
    pub fn memory(&self, units: &[f64]) -> Option<LimitedTrustRegionMemory> {
        let region = self.region.memory(units)?;
        let branches = self.branches.memory(units)?;
        let is_finite = self.prices.iter().all(|price| price.is_finite());
        let prices = self.prices.clone();
        is_finite.then_some(LimitedTrustRegionMemory { region, prices, branches })
    }

    /// True if the region is so small that no step would change anything.
    pub fn is_exhausted(&self, point: &LimitedPoint) -> bool {
        self.region.radius.is_some_and(|radius| radius <= 1e-10 * point.natural_radius())
    }

    /// The step from a point; every parameter may change by the range in `room`. `None` if none can
    /// be computed.
    pub fn propose(&mut self, point: &LimitedPoint, room: &[[f64; 2]]) -> Option<LimitedStep> {
        self.update_scales(point);
        let radius = *self.region.radius.get_or_insert(point.natural_radius());
        let step = self.step(point, room, radius, self.region.model)?;
        self.update_prices(point, &step);
        Some(step)
    }

    /// The step of the Gauss-Newton model from a point if nothing but the limits and the ranges
    /// confined it, and the decrease of the sum of squares that it promises.
    pub fn unconfined(
        &mut self,
        point: &LimitedPoint,
        room: &[[f64; 2]],
    ) -> Option<(LimitedStep, f64)> {
        self.update_scales(point);
        let radius = UNCONFINED * point.natural_radius();
        let LeastSquaresPoint { half_gradient, normal, .. } = &point.objective;
        let step = self.step(point, room, radius, HessianModel::GaussNewton)?;
        let promised = decrease(normal, half_gradient, &step.change);
        Some((step, promised))
    }

    /// Takes note of a trial that could not be evaluated.
    pub fn note_failure(&mut self, step: &LimitedStep) {
        let length = self.region.length(&step.proposed);
        let radius = self.region.radius.map_or(length, |radius| radius.min(length));
        self.region.radius = Some(FAILED * radius);
    }

    /// Takes note that no step could be computed within the region.
    pub fn note_no_step(&mut self) {
        self.region.radius = self.region.radius.map(|radius| FAILED * radius);
    }

    /// True if a change of the parameters is no longer than a step.
    pub fn is_shorter(&self, change: &DVector<f64>, step: &LimitedStep) -> bool {
        self.region.length(change) <= self.region.length(&step.proposed)
    }

    /// Takes note of a trial; true if it is accepted.
    pub fn note_trial(
        &mut self,
        step: &LimitedStep,
        from: &LimitedPoint,
        to: &LimitedPoint,
    ) -> bool {
        let hessian = self.region.hessian(&from.objective, self.region.model);
        // The curvature of the limits is in the Hessian: the correction of the step is not counted.
        let gain = decrease(&hessian, &from.objective.half_gradient, &step.proposed);
        let relief = self.penalty(&from.limits, &from.limits.values)
            - self.penalty(&from.limits, &step.values);
        let predicted = gain + relief;
        let rise = to.objective.value - from.objective.value
            + self.penalty(&to.limits, &to.limits.values)
            - self.penalty(&from.limits, &from.limits.values);
        let noise = NOISE * self.prices.iter().sum::<f64>();
        // Where the limits cannot all hold one may yield to others, at its price.
        let is_near =
            step.is_relaxed || to.limits.violation() <= from.limits.violation().max(SLACK);
        let ratio =
            if predicted > 0.0 && is_near { (noise - rise) / (noise + predicted) } else { -1.0 };
        let accepted = ratio > ACCEPTED;
        let scales = self.region.scales.clone();
        if accepted {
            self.branches.advance(&step.change, &to.limits, &step.branch_multipliers);
        }
        let LimitedStep { proposed, change, values: promised, .. } = step;
        let trial = KinkTrial { proposed, change, promised };
        self.met_kink = self.branches.meet(trial, [&from.limits, &to.limits], accepted, &scales);
        if !self.met_kink {
            self.learn(step, from, to, accepted);
        }
        let slope = 2.0 * from.objective.half_gradient.dot(&step.change) - relief;
        self.region.resize(&step.change, ratio, slope, rise);
        accepted
    }

    /// The violations at their prices.
    fn penalty(&self, limits: &LimitValues, values: &DVector<f64>) -> f64 {
        let excesses = limits.excesses(values);
        excesses.iter().zip(&self.prices).map(|(excess, price)| price * excess.abs()).sum()
    }

    /// True if the last trial has met a kink of a limit, which no correction can follow.
    pub fn met_kink(&self) -> bool {
        self.met_kink
    }

    /// Starts again from a point with a small region, in the same scales.
    pub fn restart(&mut self, point: &LimitedPoint) {
        self.region.radius = Some(RESTART * point.natural_radius());
        self.region.model = HessianModel::GaussNewton;
        self.branches.forget();
    }

    /// Takes the next step as the first one, in the same scales.
    pub fn forget_radius(&mut self) {
        self.region.radius = None;
    }

    /// Takes note that the function has changed a little; `shorter` if its steps were too long.
    pub fn note_other_function(&mut self, shorter: bool) {
        if shorter {
            self.branches.forget();
        }
        self.region.note_other_function(shorter);
    }

    /// The norm of half the gradient of the Lagrangian in scaled parameters, without those that
    /// their range holds.
    pub fn projected_gradient(
        &mut self,
        point: &LimitedPoint,
        step: &LimitedStep,
        room: &[[f64; 2]],
    ) -> f64 {
        let half_gradient = step.half_lagrangian.clone();
        let lagrangian = LeastSquaresPoint { half_gradient, ..point.objective.clone() };
        self.region.projected_gradient(&lagrangian, room)
    }

    /// The derivatives of the limits by scaled parameters; zeros for limits that no step changes.
    pub(super) fn effective_rows(&self, limits: &LimitValues) -> DMatrix<f64> {
        let (slopes, scales) = (&limits.slopes, &self.region.scales);
        let mut rows =
            DMatrix::from_fn(slopes.nrows(), slopes.ncols(), |i, j| slopes[(i, j)] / scales[j]);
        for mut row in rows.row_iter_mut() {
            if row.norm() * self.natural <= SMALLEST_EFFECT {
                row.fill(0.0);
            }
        }
        rows
    }

    /// The prices at which the violations of a trial count: at least the slope of their squares by
    /// weight.
    fn update_prices(&mut self, point: &LimitedPoint, step: &LimitedStep) {
        let excesses = point.limits.excesses(&point.limits.values);
        let by_square = excesses.iter().zip(&point.limits.weights).map(|(e, w)| 2.0 * w * e.abs());
        let by_multiplier = step.multipliers.iter().map(|m| PRICE_FACTOR * m.abs());
        for ((price, square), multiplier) in
            self.prices.iter_mut().zip(by_square).zip(by_multiplier)
        {
            *price = multiplier.max(PRICE_MEMORY * *price).max(square);
        }
        self.raise_prices(point, step);
    }

    /// Raises the prices until what a step gains in violations outweighs what it loses in the sum of
    /// squares (Byrd, Nocedal, Waltz, Optim. Methods Softw. 23 (2008) 197).
    fn raise_prices(&mut self, point: &LimitedPoint, step: &LimitedStep) {
        let hessian = self.region.hessian(&point.objective, self.region.model);
        let gain = decrease(&hessian, &point.objective.half_gradient, &step.proposed);
        let relief = self.penalty(&point.limits, &point.limits.values)
            - self.penalty(&point.limits, &step.values);
        if relief > 0.0 && PRICE_FACTOR * -gain > relief {
            let factor = PRICE_FACTOR * -gain / relief;
            self.prices.iter_mut().for_each(|price| *price *= factor);
        }
    }

    /// Corrects the secant matrix and chooses the better model by the Lagrangian.
    fn learn(
        &mut self,
        step: &LimitedStep,
        from: &LimitedPoint,
        to: &LimitedPoint,
        accepted: bool,
    ) {
        let [from, to] = [from, to].map(|point| point.lagrangian(&step.own_multipliers));
        let hessian = self.region.hessian(&from, self.region.model);
        let predicted = decrease(&hessian, &from.half_gradient, &step.change);
        let plain = TrustRegionStep { change: step.change.clone(), predicted };
        self.region.choose_model(&plain, &from, from.value - to.value);
        if accepted {
            let gradient_change = &to.half_gradient - &from.half_gradient;
            let missing = &gradient_change - &to.normal * &step.change;
            self.region.update_secant(&step.change, &gradient_change, missing);
        }
    }

    /// Scales by the effects on the sum of squares and, to a small part, on the limits.
    fn update_scales(&mut self, point: &LimitedPoint) {
        let mut normal = point.objective.normal.clone();
        for (row, weight) in point.limits.weights.iter().enumerate() {
            for i in 0..normal.nrows() {
                let slope = point.limits.slopes[(row, i)];
                normal[(i, i)] += SCALE_SHARE * weight * slope * slope;
            }
        }
        self.region.update_scales(&normal.diagonal().map(|square| square.max(0.0).sqrt()));
        self.natural = point.natural_radius();
    }

    /// The minimum of the model under the limits within a radius.
    fn step(
        &self,
        point: &LimitedPoint,
        room: &[[f64; 2]],
        radius: f64,
        model: HessianModel,
    ) -> Option<LimitedStep> {
        let scales = self.region.scales.clone();
        let limits = self.branches.with_branches(&point.limits);
        let rows = self.effective_rows(&limits);
        let gradient = 2.0 * point.objective.half_gradient.component_div(&scales);
        let hessian = self.convex_hessian(point, model);
        let bounds = limits.room(&limits.values);
        let room = &scaled_room(room, &scales);
        let program = QuadraticProgram {
            hessian: &hessian,
            gradient: &gradient,
            rows: &rows,
            bounds: &bounds,
            room,
            radius,
            elastic: None,
        };
        let hard = program.solve();
        let is_relaxed = hard.is_none();
        let found = hard.or_else(|| program.solve_relaxed())?;
        let QuadraticSolution { x, multipliers } = found;
        let change = x.component_div(&scales);
        let count = point.limits.values.len();
        let half_lagrangian =
            &point.objective.half_gradient + limits.slopes.tr_mul(&multipliers) * 0.5;
        Some(LimitedStep {
            values: point.limits.linearized(&change),
            proposed: change.clone(),
            change,
            own_multipliers: multipliers.rows(0, count).into_owned(),
            branch_multipliers: multipliers.iter().skip(count).copied().collect(),
            multipliers: self.branches.total(&multipliers),
            half_lagrangian,
            is_relaxed,
        })
    }

    /// The Hessian of the model in scaled parameters without its negative curvatures.
    pub(super) fn convex_hessian(&self, point: &LimitedPoint, model: HessianModel) -> DMatrix<f64> {
        let scales = &self.region.scales;
        let mut hessian = self.region.hessian(&point.objective, model);
        for i in 0..scales.len() {
            for j in 0..scales.len() {
                hessian[(i, j)] *= 2.0 / (scales[i] * scales[j]);
            }
        }
        // Where nothing else decides, the shortest step is taken.
        let shift = 1e-12 * hessian.amax() + SHORTNESS;
        let shifted = &hessian + DMatrix::identity(scales.len(), scales.len()) * shift;
        if shifted.clone().cholesky().is_some() {
            return shifted;
        }
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(hessian);
        let curvatures = eigenvalues.map(|value| value.max(0.0) + shift);
        &eigenvectors * DMatrix::from_diagonal(&curvatures) * eigenvectors.transpose()
    }
}

/// The radius of the first step after a restart, relative to the natural one.
const RESTART: f64 = 1e-2;
/// The radius of an unconfined step relative to the natural one.
const UNCONFINED: f64 = 100.0;

pub(super) fn scaled_room(room: &[[f64; 2]], scales: &DVector<f64>) -> Vec<[f64; 2]> {
    room.iter().zip(scales.iter()).map(|([low, high], s)| [low * s, high * s]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Minimizes residuals under limits, both given with their derivatives.
    fn minimize(
        start: &[f64],
        bounds: &[[f64; 2]],
        functions: impl Fn(&DVector<f64>) -> [(DVector<f64>, DMatrix<f64>); 2],
    ) -> (DVector<f64>, LimitedPoint, DVector<f64>) {
        let evaluate = |x: &DVector<f64>| {
            let [(residuals, jacobian), (values, slopes)] = functions(x);
            let objective = LeastSquaresPoint {
                value: residuals.norm_squared(),
                half_gradient: jacobian.tr_mul(&residuals),
                normal: jacobian.tr_mul(&jacobian),
                separate: Vec::new(),
            };
            let weights = vec![1.0; bounds.len()];
            LimitedPoint {
                objective,
                limits: LimitValues { values, slopes, bounds: bounds.to_vec(), weights },
            }
        };
        let mut x = DVector::from_column_slice(start);
        let mut point = evaluate(&x);
        let mut method = LimitedTrustRegion::new(x.len(), bounds.len());
        let room = vec![[-10.0, 10.0]; x.len()];
        let mut multipliers = DVector::zeros(bounds.len());
        for _ in 0..60 {
            let Some(step) = method.propose(&point, &room) else { break };
            if method.is_exhausted(&point) {
                break;
            }
            let mut trial = &x + &step.change;
            let mut to = evaluate(&trial);
            // The caller corrects a trial until the limits are as the derivatives promised.
            for _ in 0..4 {
                let promised = bounds.iter().zip(step.values.iter());
                let aims: Vec<_> = promised.map(|([l, h], v)| [l.min(*v), h.max(*v)]).collect();
                let aimed = to.limits.with_bounds(&aims);
                let Some(change) = method.correction(&aimed, &room) else { break };
                trial += change;
                to = evaluate(&trial);
            }
            multipliers.clone_from(&step.multipliers);
            if method.note_trial(&step, &point, &to) {
                (x, point) = (trial, to);
            }
        }
        (x, point, multipliers)
    }

    /// The point of a circle that is nearest to another point, from outside and inside.
    #[test]
    fn it_finds_the_nearest_point_of_a_curve_and_its_price() {
        for start in [[3.0, 1.0], [0.1, -0.2], [-2.0, 0.5]] {
            let (x, point, multipliers) = minimize(&start, &[[1.0, 1.0]], |x| {
                let residuals = DVector::from_vec(vec![x[0] - 2.0, x[1] - 2.0]);
                let circle = DVector::from_vec(vec![x.norm_squared()]);
                let slope = DMatrix::from_row_slice(1, 2, &[2.0 * x[0], 2.0 * x[1]]);
                [(residuals, DMatrix::identity(2, 2)), (circle, slope)]
            });
            let half = 0.5_f64.sqrt();
            assert!((x[0] - half).abs() < 1e-8 && (x[1] - half).abs() < 1e-8, "{x}");
            assert!(point.limits.violation() < 1e-9, "{}", point.limits.violation());
            // d/dr² (2√2 - r)² at r = 1.
            let price = 2.0 * 2.0_f64.sqrt() - 1.0;
            assert!((multipliers[0] - price).abs() < 1e-6, "{multipliers}");
        }
    }

    #[test]
    fn a_limit_that_does_not_bind_costs_nothing() {
        let (x, _, multipliers) = minimize(&[-1.2, 1.0], &[[f64::NEG_INFINITY, 5.0]], |x| {
            let residuals = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
            let jacobian = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
            let limit = DVector::from_vec(vec![x[0] + x[1]]);
            [(residuals, jacobian), (limit, DMatrix::from_row_slice(1, 2, &[1.0, 1.0]))]
        });
        assert!((x[0] - 1.0).abs() < 1e-6, "{x}");
        assert!(multipliers[0].abs() < 1e-9, "{multipliers}");
    }

    /// The limited function is the larger of two, whose kink the minimum lies on; the derivatives
    /// tell of one of them at a time.
    #[test]
    fn it_finds_a_minimum_on_a_kink_of_a_limit() {
        for start in [[-1.0, 0.7], [0.2, -0.4]] {
            let (x, point, multipliers) = minimize(&start, &[[f64::NEG_INFINITY, 1.0]], |x| {
                let residuals = DVector::from_vec(vec![x[0] - 2.0, 0.1 * (x[1] - 0.3)]);
                let jacobian = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.1]);
                let limit = DVector::from_vec(vec![x[0] + x[1].abs() + 0.1 * x[1] * x[1]]);
                let slope = [1.0, x[1].signum() + 0.2 * x[1]];
                [(residuals, jacobian), (limit, DMatrix::from_row_slice(1, 2, &slope))]
            });
            assert!((x[0] - 1.0).abs() < 1e-6 && x[1].abs() < 1e-6, "{start:?}: {x}");
            assert!(point.limits.violation() < 1e-6, "{}", point.limits.violation());
            assert!((multipliers[0] - 2.0).abs() < 1e-3, "{multipliers}");
        }
    }

    #[test]
    fn contradictions_are_broken_as_little_as_possible() {
        let bounds = [[1.0, f64::INFINITY], [f64::NEG_INFINITY, 0.0]];
        let (x, point, _) = minimize(&[5.0], &bounds, |x| {
            let value = DVector::from_vec(vec![x[0], x[0]]);
            let slope = DMatrix::from_row_slice(2, 1, &[1.0, 1.0]);
            [(x.clone(), DMatrix::identity(1, 1)), (value, slope)]
        });
        assert!((point.limits.violation() - 1.0).abs() < 1e-6 || (0.0..=1.0).contains(&x[0]));
    }
}
