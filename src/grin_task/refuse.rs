//! Refusals of numbers that make no sense, in the words of what the number is.

use super::check::TaskError;
pub(super) use crate::math::brief as number;
use std::fmt::Display;

/// No length is longer, in mm.
pub(super) const LONG: f64 = 1e6;

/// An error at a place.
pub(super) fn wrong<T: Display>(
    place: impl Into<String>,
    found: T,
    expected: impl Into<String>,
) -> TaskError {
    let found = format!("{found}");
    TaskError::Value { place: place.into(), found, expected: expected.into() }
}

/// Refuses a number that is not above zero.
pub(super) fn positive(place: impl Into<String>, value: f64, what: &str) -> Result<(), TaskError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(wrong(place, number(value), format!("{what} above 0")))
}

/// Refuses what is no length.
pub(super) fn extent(place: impl Into<String>, value: f64) -> Result<(), TaskError> {
    if value > 0.0 && value <= LONG {
        return Ok(());
    }
    let expected = format!("a length above 0, up to {} mm", number(LONG));
    Err(wrong(place, number(value), expected))
}

/// Refuses a place or a distance that no space of ours reaches.
pub(super) fn reached(place: impl Into<String>, value: f64, low: f64) -> Result<(), TaskError> {
    if value >= low && value <= LONG {
        return Ok(());
    }
    let expected = format!("{} to {} mm", number(low), number(LONG));
    Err(wrong(place, number(value), expected))
}

/// Refuses what is no weight.
pub(super) fn weight(place: impl Into<String>, value: f64) -> Result<(), TaskError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(wrong(place, number(value), "a weight, 0 or more"))
}

/// Refuses what is not between two numbers.
pub(super) fn within(
    place: impl Into<String>,
    value: f64,
    [low, high]: [f64; 2],
    what: &str,
) -> Result<(), TaskError> {
    if value >= low && value <= high {
        return Ok(());
    }
    let expected = format!("{what} from {} to {}", number(low), number(high));
    Err(wrong(place, number(value), expected))
}

/// Refuses what is no direction.
pub(super) fn direction(place: &str, [x, y, z]: [f64; 3]) -> Result<(), TaskError> {
    let square = x * x + y * y + z * z;
    if square > 0.0 && square.is_finite() {
        return Ok(());
    }
    let found = format!("[{}]", [x, y, z].map(number).join(", "));
    Err(wrong(place, found, "a direction: three numbers, not all 0"))
}
