//! The format of numbers in messages.

/// The text of a number; a very large or small one has an exponent instead of hundreds of digits.
pub(crate) fn format_short(value: f64) -> String {
    let plain = value == 0.0 || (1e-4..1e9).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::format_short;

    #[test]
    fn a_number_is_never_hundreds_of_digits() {
        let shown = [0.0, -1.0, 0.25, 1e308, -1e-300, f64::NAN, f64::INFINITY].map(format_short);
        assert_eq!(shown, ["0", "-1", "0.25", "1e308", "-1e-300", "NaN", "inf"]);
    }
}
