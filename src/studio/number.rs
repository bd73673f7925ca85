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
        return without_zeros(&format!("{value:.decimals$e}"));
    }
    let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
    without_zeros(&format!("{value:.decimals$}"))
}

/// A number without the zeros at the end of its decimals, before an exponent too.
fn without_zeros(text: &str) -> String {
    let (decimals, exponent) = text.find('e').map_or((text, ""), |at| text.split_at(at));
    if !decimals.contains('.') {
        return text.to_owned();
    }
    format!("{}{exponent}", decimals.trim_end_matches('0').trim_end_matches('.'))
}

/// The characters of a number above which it has an exponent if that is shorter.
const COMPACT: usize = 7;

/// A number with some digits, a long one with an exponent where that is shorter.
pub fn format_compact(value: f64, digits: i32) -> String {
    let plain = format_digits(value, digits);
    if plain.len() <= COMPACT || !value.is_finite() {
        return plain;
    }
    let decimals = usize::try_from(digits - 1).unwrap_or(0);
    let short = without_zeros(&format!("{value:.decimals$e}"));
    if short.len() < plain.len() { short } else { plain }
}

/// A number with as many digits, at most seven, as fit into some characters.
pub fn format_within(value: f64, characters: usize) -> String {
    let texts = (1..=DIGITS).rev().map(|digits| format_digits(value, digits));
    let shortest = format_digits(value, 1);
    texts.into_iter().find(|text| text.chars().count() <= characters).unwrap_or(shortest)
}

/// The error relative to a number below which it is nothing but rounding.
const ROUNDING: f64 = 1e-12;

/// The largest change that is told in percent.
const MAX_PERCENT: f64 = 1000.0;

/// True if an error is larger than the rounding of its number.
pub fn is_error(value: f64, error: f64) -> bool {
    error.is_finite() && error.abs() > ROUNDING * value.abs()
}

/// A number with its error, both in the same notation and to the same decimal; the number alone with
/// five digits if the error is only rounding.
pub fn with_error(value: f64, error: f64) -> String {
    if !is_error(value, error) {
        return format_digits(value, 5);
    }
    #[expect(clippy::cast_possible_truncation, reason = "an exponent between -324 and 309")]
    let [size, last] = [value.abs().max(error), error].map(|v| v.log10().floor() as i32);
    if (-5..=9).contains(&size) && last >= -9 {
        let decimals = usize::try_from(-last).unwrap_or(0);
        return format!("{value:.decimals$} ± {error:.decimals$}");
    }
    let scale = 10_f64.powi(size);
    let decimals = usize::try_from(size - last).unwrap_or(0).min(15);
    format!("({:.decimals$} ± {:.decimals$})e{size}", value / scale, error / scale)
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

/// A number, or zero where it is nothing but the rounding of numbers of a size; zero has no sign.
pub fn without_rounding(value: f64, size: f64) -> f64 {
    if value == 0.0 || value.abs() <= ROUNDING * size.abs() { 0.0 } else { value }
}

/// The change of a number in percent with some decimals: `0 %` where nothing but rounding has
/// changed, and a factor beyond 1000 %. `None` for a number that was zero, or for an infinite one.
pub fn format_change(before: f64, after: f64, decimals: usize) -> Option<String> {
    change_with(before, after, |percent| {
        let text = format!("{percent:.decimals$}");
        let is_zero = text.chars().all(|digit| matches!(digit, '0' | '.'));
        // A change that is small is not none.
        if is_zero { format_digits(percent, 1) } else { text }
    })
}

/// The same with three digits, without trailing zeros.
pub fn short_change(before: f64, after: f64) -> Option<String> {
    change_with(before, after, |percent| format_digits(percent, 3))
}

fn change_with(before: f64, after: f64, show: impl Fn(f64) -> String) -> Option<String> {
    let ratio = after / before;
    if !ratio.is_finite() || before.is_infinite() {
        return None;
    }
    let percent = 100.0 * without_rounding(ratio - 1.0, ratio.abs().max(1.0));
    if percent == 0.0 {
        return Some("0 %".to_owned());
    }
    if percent.abs() > MAX_PERCENT {
        return Some(format!("{} times", format_digits(ratio, 4)));
    }
    let sign = if percent > 0.0 { "+" } else { "-" };
    Some(format!("{sign}{} %", show(percent.abs())))
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
            (1e-9, "1e-9"),
            (1e300, "1e300"),
            (-1.25e-12, "-1.25e-12"),
            (f64::INFINITY, "Infinity"),
        ];
        for (value, text) in cases {
            assert_eq!(format_number(value), text);
        }
    }

    #[test]
    fn a_number_is_shortened_until_it_fits() {
        assert_eq!(format_within(-1.234567e-12, 8), "-1.2e-12");
        assert_eq!(format_within(-37.123456789, 20), "-37.12346");
        assert_eq!(format_within(-37.123456789, 6), "-37.12");
    }

    #[test]
    fn a_long_number_has_an_exponent_where_that_is_shorter() {
        let cases = [
            (1.234e-5, "1.23e-5"),
            (0.00123, "0.00123"),
            (1000.0, "1000"),
            (1e-9, "1e-9"),
            (-2e7, "-2e7"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(format_compact(value, 3), text);
        }
    }

    #[test]
    fn a_number_and_its_error_have_one_notation_and_rounding_is_no_error() {
        assert_eq!(with_error(0.041, 3e-5), "0.04100 ± 0.00003");
        assert_eq!(with_error(94.61, 0.4), "94.6 ± 0.4");
        assert_eq!(with_error(100.0, 2e-13), "100");
        assert_eq!(with_error(2.5e-8, 3e-10), "(2.50 ± 0.03)e-8");
    }

    #[test]
    fn close_numbers_are_told_apart() {
        let show = |value, step| format_digits(value, digits_between(value, step, 4));
        assert_eq!([show(1.000225, 7.5e-5), show(1.00015, 5e-5)], ["1.00022", "1.00015"]);
        assert_eq!([show(1.5, 0.1), show(1.05, 0.0)], ["1.5", "1.05"]);
        assert!(show(1.0, 1e-300).len() < 12);
    }

    #[test]
    fn rounding_is_shown_as_zero_without_a_sign() {
        let thin = without_rounding(-3.552_71e-15, 57.0);
        assert_eq!(format_number(thin), "0");
        assert!(without_rounding(-0.0, 1.0).is_sign_positive());
        assert_eq!(without_rounding(1e-6, 57.0), 1e-6, "a picometre is no rounding");
    }

    #[test]
    fn changes_are_told_in_percent_or_as_a_factor() {
        let cases = [
            (2.0, 2.0 * (1.0 - 3.33e-16), "0 %"),
            (0.02, 0.01, "-50.0 %"),
            (0.02, 0.021, "+5.0 %"),
            (1.0, 1.0 - 2e-6, "-0.0002 %"),
            (1e-3, 1.775_519, "1776 times"),
            (1.0, 11.0, "+1000.0 %"),
            (1.0, -15.0, "-15 times"),
            (5.0, 0.0, "-100.0 %"),
        ];
        for (before, after, text) in cases {
            assert_eq!(format_change(before, after, 1).as_deref(), Some(text), "{before} {after}");
        }
        assert_eq!(short_change(50.0, 10.0).as_deref(), Some("-80 %"));
        let none = [(0.0, 1.0), (0.0, 0.0), (f64::INFINITY, 50.0), (50.0, f64::INFINITY)];
        assert!(none.iter().all(|(before, after)| format_change(*before, *after, 1).is_none()));
    }

    #[test]
    fn a_plane_has_an_infinite_radius() {
        assert_eq!([radius(0.0), radius(0.02)], [f64::INFINITY, 50.0]);
    }
}
