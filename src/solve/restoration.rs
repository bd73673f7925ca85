//! Restoration of limits: short steps after which they hold by their derivatives.

use super::constrained::{LimitedTrustRegion, scaled_room};
use super::kink::KinkTrial;
use super::limit_values::{LimitValues, LimitedPoint};
use super::quadratic_program::QuadraticProgram;
use super::shortest_change::shortest_change;
use super::trust_region::HessianModel;
use nalgebra::{DMatrix, DVector};

/// The lengths up to which corrections are tried, relative to the distance to the bounds: limits
/// with nearly the same derivatives need long ones.
const CORRECTION_REACH: [f64; 2] = [10.0, 1e3];
/// The length of a step that may be spent on a margin, relative to the natural one.
const MARGIN_REACH: f64 = 1e-3;
/// The violation relative to the margin above which a limit gets one.
const MARGIN_SHARE: f64 = 0.1;

/// Limits of which some are broken, by their derivatives in scaled parameters.
struct BrokenLimits {
    rows: DMatrix<f64>,
    /// The range by which each may change.
    bounds: Vec<[f64; 2]>,
    /// The range of each parameter.
    room: Vec<[f64; 2]>,
    /// The distance to the bounds.
    distance: f64,
}

impl BrokenLimits {
    /// The lengths up to which corrections are tried where a step has this natural length.
    fn reaches(&self, natural: f64) -> [f64; 2] {
        let [near, far] = CORRECTION_REACH.map(|reach| reach * self.distance);
        [near, far.min(natural.max(near))]
    }
}

impl LimitedTrustRegion {
    /// The smallest change, in the scales of the parameters, after which limits hold by their
    /// derivatives as far as they can.
    pub fn correction(&self, limits: &LimitValues, room: &[[f64; 2]]) -> Option<DVector<f64>> {
        let broken = self.broken_limits(limits, room)?;
        let [_, far] = broken.reaches(self.natural);
        let is_near = |change: &DVector<f64>| change.norm() <= far;
        let BrokenLimits { rows, bounds, room, .. } = &broken;
        if let Some(change) = shortest_change(rows, bounds, room).filter(is_near) {
            return Some(change.component_div(&self.region.scales));
        }
        let count = rows.ncols();
        self.nearest(&broken, &DMatrix::identity(count, count), &DVector::zeros(count))
    }

    /// The change after which limits of the current point, whose bounds may be others, hold by their
    /// derivatives on all branches, at the lowest sum of squares.
    pub fn restoration(
        &self,
        point: &LimitedPoint,
        limits: &LimitValues,
        room: &[[f64; 2]],
    ) -> Option<DVector<f64>> {
        let hessian = self.convex_hessian(point, HessianModel::GaussNewton);
        let gradient = 2.0 * point.objective.half_gradient.component_div(&self.region.scales);
        let broken = self.broken_limits(&self.branches.with_branches(limits), room)?;
        self.nearest(&broken, &hessian, &gradient)
    }

    /// The limits by their derivatives in scaled parameters; `None` if they hold already.
    fn broken_limits(&self, limits: &LimitValues, room: &[[f64; 2]]) -> Option<BrokenLimits> {
        let rows = self.effective_rows(limits);
        let distance = distance(limits, &rows);
        let (bounds, room) = (limits.room(&limits.values), scaled_room(room, &self.region.scales));
        let is_broken = distance > 0.0 && distance.is_finite();
        is_broken.then_some(BrokenLimits { rows, bounds, room, distance })
    }

    /// The minimum of a quadratic function in scaled parameters near the current point where limits
    /// hold by their derivatives as far as they can.
    fn nearest(
        &self,
        broken: &BrokenLimits,
        hessian: &DMatrix<f64>,
        gradient: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let BrokenLimits { rows, bounds, room, .. } = broken;
        let program = |radius| QuadraticProgram {
            hessian,
            gradient,
            rows,
            bounds,
            room,
            radius,
            elastic: None,
        };
        let [near, far] = broken.reaches(self.natural);
        let found = program(near).solve();
        let found = found.or_else(|| program(far).solve());
        let found = found.or_else(|| program(near).solve_relaxed())?;
        Some(found.x.component_div(&self.region.scales))
    }

    /// Limits of which the broken ones have bounds that are closer by a margin, as far as a short
    /// step can reach it. Those that are kept may depend on others, so that none can be had.
    #[must_use]
    pub fn with_margin(&self, limits: &LimitValues, margin: f64) -> LimitValues {
        let rows = self.effective_rows(limits);
        let excesses = limits.excesses(&limits.values);
        let closer = |(row, [low, high]): (usize, &[f64; 2])| {
            let is_kept = excesses[row].abs() <= MARGIN_SHARE * margin;
            let margin = margin.min(MARGIN_REACH * self.natural * rows.row(row).norm());
            if is_kept || low == high { [*low, *high] } else { [low + margin, high - margin] }
        };
        limits.with_bounds(&(0..).zip(&limits.bounds).map(closer).collect::<Vec<_>>())
    }

    /// Takes note of a restoration from the current point: true if it has brought the limits closer
    /// and is accepted, or if it has met a kink, so that another one from the same point may.
    pub fn note_restoration(
        &mut self,
        change: &DVector<f64>,
        [from, to]: [&LimitValues; 2],
    ) -> [bool; 2] {
        let [before, after] =
            [from, to].map(|limits| distance(limits, &self.effective_rows(limits)));
        let accepted = after < before;
        if accepted {
            self.branches.follow(change, to);
        }
        let trial = KinkTrial { proposed: change, change, promised: &from.linearized(change) };
        let met = self.branches.meet(trial, [from, to], accepted, &self.region.scales);
        [accepted, met]
    }
}

/// The distance to the bounds of all limits by their derivatives by scaled parameters.
fn distance(limits: &LimitValues, rows: &DMatrix<f64>) -> f64 {
    let square = |(excess, row): (&f64, usize)| {
        let length = rows.row(row).norm();
        if length > 0.0 { (excess / length).powi(2) } else { 0.0 }
    };
    let excesses = limits.excesses(&limits.values);
    excesses.iter().zip(0..).map(square).sum::<f64>().sqrt()
}
