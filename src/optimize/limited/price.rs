//! The prices of limits.

use crate::merit::Limit;
use crate::optimize::LimitPrice;

/// The distance to a bound, relative to its size, below which a limit binds.
const BINDING: f64 = 1e-6;

impl LimitPrice {
    /// The price of a limit; `None` if it does not bind.
    pub(super) fn new(limit: &Limit, multiplier: f64) -> Option<Self> {
        let [low, high] = limit.bounds();
        let value = limit.margin.value;
        let near = |bound: f64| {
            bound.is_finite() && (value - bound).abs() <= BINDING * bound.abs().max(1.0)
        };
        let bound = if near(high) {
            high
        } else if near(low) {
            low
        } else {
            return None;
        };
        let price = if low == high { multiplier } else { multiplier.abs() };
        Some(Self { limit: limit.margin.clone(), bound, price })
    }
}
