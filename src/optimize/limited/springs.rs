//! Limits that hold a lens as stiff springs: a quadratic model then keeps them without knowing them.

use crate::merit::{Limit, SumOfSquares};

/// The cost, in merits, of a step of all variables by their scales that leaves a limit.
const STIFFNESS: f64 = 1e4;
/// The distance from a bound within which a limit holds a lens, relative to the bound, and the least one in
/// mm.
const NEAR: f64 = 1e-6;
const LEAST_BOUND: f64 = 1e-3;

/// Adds the springs of the limits that hold a lens to a sum of squares, by variables with these scales.
pub(in crate::optimize) fn add_springs(sum: &mut SumOfSquares, limits: &[Limit], scales: &[f64]) {
    let least = sum.value;
    for limit in limits.iter().filter(|limit| holds(limit)) {
        stiffen(sum, limit, scales, least);
    }
}

/// Adds the spring of a limit to a sum of squares whose least value is `least`.
fn stiffen(sum: &mut SumOfSquares, limit: &Limit, scales: &[f64], least: f64) {
    let slopes = limit.slope.iter().zip(scales);
    let size: f64 = slopes.map(|(slope, scale)| (slope * scale).powi(2)).sum();
    if size > 0.0 {
        sum.add_residual(STIFFNESS * least / size, excess(limit), &limit.slope);
    }
}

/// True if a limit is broken or holds the lens.
fn holds(limit: &Limit) -> bool {
    let bound = limit.margin.min.or(limit.margin.max).unwrap_or(0.0);
    limit.margin.slack() <= NEAR * bound.abs().max(LEAST_BOUND)
}

/// The distance of a limited number from its nearest bound, negative below a lower one.
fn excess(limit: &Limit) -> f64 {
    let value = limit.margin.value;
    let distances = [limit.margin.min, limit.margin.max].into_iter().flatten().map(|b| value - b);
    distances.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}
