//! The active limits of an optimized lens, with their prices.

use super::output::{ShortNumber, TextTable};
use crate::optimize::LimitPrice;
use std::fmt;

/// The largest price, relative to the merit, that is rounding.
const ROUNDING: f64 = 1e-6;

/// Writes the active limits of a lens with this merit; nothing if there are none.
pub(super) fn write(limits: &[LimitPrice], merit: f64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let limits = distinct(limits, merit);
    if limits.is_empty() {
        return Ok(());
    }
    writeln!(
        f,
        "active limits; price: decrease of the merit per unit by which the bound is relaxed"
    )?;
    let mut table = TextTable::new(&["limit", "place", "zoom", "value", "bound", "price"]);
    for LimitPrice { limit, bound, price } in &limits {
        let place = limit.place().unwrap_or_else(|| "-".to_owned());
        let numbers = [limit.value, *bound].map(|value| ShortNumber(value).to_string());
        let start = [limit.term.to_owned(), place, limit.zoom.to_string()];
        table.row(start.into_iter().chain(numbers).chain([format!("{price:.2e}")]));
    }
    writeln!(f, "{table}")
}

/// The limits whose prices are more than rounding, each place once: the edge of a gap is limited at
/// the rims of both of its surfaces, and where both have one semi-diameter these are one quantity,
/// the price of which is their sum.
fn distinct(limits: &[LimitPrice], merit: f64) -> Vec<LimitPrice> {
    let mut found: Vec<LimitPrice> = Vec::new();
    for limit in limits {
        match found.iter_mut().find(|other| is_same_quantity(other, limit)) {
            Some(other) => other.price += limit.price,
            None => found.push(limit.clone()),
        }
    }
    found.retain(|limit| limit.price.abs() > ROUNDING * merit.abs());
    found
}

fn is_same_quantity(a: &LimitPrice, b: &LimitPrice) -> bool {
    let key = |of: &LimitPrice| {
        let limit = &of.limit;
        (limit.term, limit.surface, limit.field, limit.zoom, limit.um.map(f64::to_bits))
    };
    key(a) == key(b) && is_near(a.limit.value, b.limit.value) && is_near(a.bound, b.bound)
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_same_quantity_up_to_rounding() {
        assert!(is_near(3.0, 3.0) && is_near(-2.0, -2.0 * (1.0 + 1e-12)));
        assert!(!is_near(3.0, 3.001) && !is_near(2.0, -2.0) && !is_near(0.0, 1.0));
        assert!(is_near(0.0, 0.0));
    }
}
