//! Numbers as a designer reads them: seven digits, `Infinity`, a radius for a curvature.

/// The digits of a number in a cell; the value itself keeps all of them.
const DIGITS: i32 = 7;
/// The largest number of digits of a number that is shown among others close to it.
const MAX_DIGITS: i32 = 10;

/// A number with seven digits, without trailing zeros.
pub fn format_number(value: f64) -> String {
    format_digits(value, DIGITS)
}

/// A number with some digits, without trailing zeros.
pub fn format_digits(value: f64, digits: i32) -> String {
    if value.is_infinite() {
        return if value > 0.0 { "Infinity" } else { "-Infinity" }.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    #[expect(clippy::cast_possible_truncation, reason = "an exponent between -324 and 309")]
    let exponent = value.abs().log10().floor() as i32;
    if !(-5..=9).contains(&exponent) {
        let decimals = usize::try_from(digits - 1).unwrap_or(0);
        return format!("{value:.decimals$e}");
    }
    let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The digits that are needed to distinguish numbers of this size that differ by this step; at
/// least `least`.
pub fn digits_between(size: f64, step: f64, least: i32) -> i32 {
    let apart = (size.abs() / step.abs()).log10();
    if !apart.is_finite() {
        return least;
    }
    #[expect(clippy::cast_possible_truncation, reason = "an exponent between -324 and 309")]
    let digits = apart.ceil() as i32 + 1;
    digits.clamp(least, least.max(MAX_DIGITS))
}

/// The radius of a surface, as it is shown for a curvature.
pub fn radius(curvature: f64) -> f64 {
    if curvature == 0.0 { f64::INFINITY } else { curvature.recip() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_seven_digits() {
        let cases = [
            (0.0, "0"),
            (12.5, "12.5"),
            (-37.123456789, "-37.12346"),
            (100.0, "100"),
            (1234567.89, "1234568"),
            (0.00123456789, "0.001234568"),
            (1e-9, "1.000000e-9"),
            (f64::INFINITY, "Infinity"),
        ];
        for (value, text) in cases {
            assert_eq!(format_number(value), text);
        }
    }

    #[test]
    fn close_numbers_are_told_apart() {
        let show = |value, step| format_digits(value, digits_between(value, step, 4));
        assert_eq!([show(1.000225, 7.5e-5), show(1.00015, 5e-5)], ["1.00022", "1.00015"]);
        assert_eq!([show(1.5, 0.1), show(1.05, 0.0)], ["1.5", "1.05"]);
        assert!(show(1.0, 1e-300).len() < 12);
    }

    #[test]
    fn a_plane_has_an_infinite_radius() {
        assert_eq!([radius(0.0), radius(0.02)], [f64::INFINITY, 50.0]);
    }
}
