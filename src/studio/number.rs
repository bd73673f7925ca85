//! Numbers as a designer reads and types them: seven digits, `Infinity`, and arithmetic on the
//! value that was there (`*2`, `/2`, `+5`, `- 3`).

/// How many digits a cell shows; the value itself keeps all of them.
const DIGITS: i32 = 7;

/// A number with seven digits, without trailing zeros.
pub fn show(value: f64) -> String {
    if value.is_infinite() {
        return if value > 0.0 { "Infinity" } else { "-Infinity" }.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    #[expect(clippy::cast_possible_truncation, reason = "an exponent between -324 and 309")]
    let exponent = value.abs().log10().floor() as i32;
    if !(-5..=9).contains(&exponent) {
        return format!("{value:.6e}");
    }
    let decimals = usize::try_from(DIGITS - 1 - exponent).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The radius of a surface, as it is shown for a curvature.
pub fn radius(curvature: f64) -> f64 {
    if curvature == 0.0 { f64::INFINITY } else { curvature.recip() }
}

/// The curvature of a surface with a radius; a plane for an infinite or zero one.
pub fn curvature(radius: f64) -> f64 {
    if radius == 0.0 || radius.is_infinite() { 0.0 } else { radius.recip() }
}

/// What was typed: a number, or arithmetic on the value that was there.
///
/// A leading minus is a sign; a minus followed by a space subtracts. Infinity may be spelt `inf`
/// or `Infinity`. A comma is not a decimal point: it is refused, so that `1,500` is never 1.5.
pub fn parse(text: &str, old: f64) -> Option<f64> {
    let text = text.trim();
    let rest = |sign: char| text.strip_prefix(sign).and_then(literal);
    let value = if let Some(factor) = rest('*') {
        old * factor
    } else if let Some(divisor) = rest('/') {
        old / divisor
    } else if let Some(term) = rest('+') {
        old + term
    } else if let Some(term) = text.strip_prefix("- ").and_then(literal) {
        old - term
    } else {
        literal(text)?
    };
    (!value.is_nan()).then_some(value)
}

fn literal(text: &str) -> Option<f64> {
    text.trim().parse().ok()
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
            assert_eq!(show(value), text);
        }
    }

    #[test]
    fn a_cell_does_arithmetic() {
        let cases = [
            ("*2", 20.0),
            ("/ 4", 2.5),
            ("+5", 15.0),
            ("- 3", 7.0),
            ("-3", -3.0),
            (" 1e2 ", 100.0),
            ("Infinity", f64::INFINITY),
            ("inf", f64::INFINITY),
        ];
        for (text, value) in cases {
            assert_eq!(parse(text, 10.0), Some(value), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in ["", "abc", "1,5", "*", "+", "NaN", "--2", "*0*"] {
            assert_eq!(parse(text, f64::INFINITY), None, "{text}");
        }
        assert_eq!(parse("*0", f64::INFINITY), None, "no value comes of it");
    }

    #[test]
    fn a_plane_has_an_infinite_radius() {
        assert_eq!(radius(0.0), f64::INFINITY);
        for c in [0.0, 0.02, -0.5] {
            assert_eq!(curvature(radius(c)), c);
        }
    }
}
