//! Checks of the numbers in a task, with error messages that name the quantity.

use crate::grin_design::GrinTaskError;
use crate::math::format_short;
use std::fmt::Display;

/// The largest length, in mm.
pub(super) const MAX_LENGTH: f64 = 1e6;

/// The difference of two numbers may be below an index of 1 by this much.
pub(in crate::grin_design) const INDEX_ROUNDING: f64 = 1e-9;

/// The error for an invalid value.
pub(in crate::grin_design) fn invalid<T: Display>(
    place: impl Into<String>,
    found: T,
    expected: impl Into<String>,
) -> GrinTaskError {
    let found = format!("{found}");
    GrinTaskError::Value { place: place.into(), found, expected: expected.into() }
}

/// Checks that a number is positive.
pub(super) fn check_positive(
    place: impl Into<String>,
    value: f64,
    what: &str,
) -> Result<(), GrinTaskError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(invalid(place, format_short(value), format!("{what} above 0")))
}

/// Checks that a number is a length.
pub(super) fn check_length(place: impl Into<String>, value: f64) -> Result<(), GrinTaskError> {
    if value > 0.0 && value <= MAX_LENGTH {
        return Ok(());
    }
    let expected = format!("a length above 0, up to {} mm", format_short(MAX_LENGTH));
    Err(invalid(place, format_short(value), expected))
}

/// Checks that a coordinate or distance is finite and not below `low`.
pub(super) fn check_position(
    place: impl Into<String>,
    value: f64,
    low: f64,
) -> Result<(), GrinTaskError> {
    if value >= low && value <= MAX_LENGTH {
        return Ok(());
    }
    let expected = format!("{} to {} mm", format_short(low), format_short(MAX_LENGTH));
    Err(invalid(place, format_short(value), expected))
}

/// Checks that a number is a weight.
pub(super) fn check_weight(place: impl Into<String>, value: f64) -> Result<(), GrinTaskError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(invalid(place, format_short(value), "a weight, 0 or more"))
}

/// Checks that a number is within a range.
pub(super) fn check_range(
    place: impl Into<String>,
    value: f64,
    [low, high]: [f64; 2],
    what: &str,
) -> Result<(), GrinTaskError> {
    if value >= low && value <= high {
        return Ok(());
    }
    let expected = format!("{what} from {} to {}", format_short(low), format_short(high));
    Err(invalid(place, format_short(value), expected))
}

/// Checks that a vector has a direction.
pub(super) fn check_direction(place: &str, [x, y, z]: [f64; 3]) -> Result<(), GrinTaskError> {
    let square = x * x + y * y + z * z;
    if square > 0.0 && square.is_finite() {
        return Ok(());
    }
    let found = format!("[{}]", [x, y, z].map(format_short).join(", "));
    Err(invalid(place, found, "a direction: three numbers, not all 0"))
}
