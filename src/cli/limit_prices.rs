//! The limits that hold an optimized lens, with their prices.

use super::output::{ShortNumber, TextTable};
use crate::optimize::LimitPrice;
use std::fmt;

/// Writes the limits that hold the lens; nothing if there are none.
pub(super) fn write(limits: &[LimitPrice], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if limits.is_empty() {
        return Ok(());
    }
    writeln!(f, "limits that hold the lens; price: gain of the merit by a bound looser by 1")?;
    let mut table = TextTable::new(&["limit", "place", "zoom", "value", "bound", "price"]);
    for LimitPrice { limit, bound, price } in limits {
        let place = limit.place().unwrap_or_else(|| "-".to_owned());
        let numbers = [limit.value, *bound].map(|value| ShortNumber(value).to_string());
        let start = [limit.term.to_owned(), place, limit.zoom.to_string()];
        table.row(start.into_iter().chain(numbers).chain([format!("{price:.2e}")]));
    }
    writeln!(f, "{table}")
}
