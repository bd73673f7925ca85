//! The format of numbers in messages and tables.

use std::fmt::{self, Display};

/// The text of a number; a very large or small one has an exponent instead of hundreds of digits.
pub(crate) fn format_short(value: f64) -> String {
    let plain = value == 0.0 || (1e-4..1e9).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

/// A number with seven significant digits and without trailing zeros.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShortNumber(pub(crate) f64);

impl Display for ShortNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        let size = value.abs();
        if size == 0.0 || !value.is_finite() {
            return f.pad(&value.to_string());
        }
        if !(1e-4..1e9).contains(&size) {
            return f.pad(&format!("{value:.4e}"));
        }
        let decimals = (6 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.decimals$}");
        let shorter = if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        f.pad(shorter)
    }
}

#[cfg(test)]
mod tests {
    use super::{ShortNumber, format_short};

    #[test]
    fn a_number_is_never_hundreds_of_digits() {
        let shown = [0.0, -1.0, 0.25, 1e308, -1e-300, f64::NAN, f64::INFINITY].map(format_short);
        assert_eq!(shown, ["0", "-1", "0.25", "1e308", "-1e-300", "NaN", "inf"]);
    }

    #[test]
    fn numbers_have_seven_digits_and_no_idle_zeros() {
        let shown = |value: f64| ShortNumber(value).to_string();
        assert_eq!(shown(50.0), "50");
        assert_eq!(shown(-99.499_874_37), "-99.49987");
        assert_eq!(shown(0.036_437_850_765), "0.03643785");
        assert_eq!(shown(1e-9), "1.0000e-9");
        assert_eq!(shown(0.0), "0");
        assert_eq!(shown(123_456_789.1), "123456789");
    }
}
