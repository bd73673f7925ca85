//! Numbers and arithmetic as they are typed into a cell.
//!
//! `12.5`, `25.4/2`, `(3+4)*2`, `inf`. A leading `*`, `/` or `+` applies to the old value, and so does
//! a minus followed by a blank: `- 3` subtracts, `-3` is a negative number. A comma is no decimal
//! point: `1,500` is refused, so that it is never taken for 1.5.

use std::iter::Peekable;
use std::str::Chars;

/// The maximum depth of nested brackets.
const MAX_DEPTH: usize = 32;

/// A text is no number and no arithmetic.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is no number; expected one such as 12.5, or arithmetic such as 25.4/2, *2 or +5")]
pub struct ParseNumberError {
    /// The text.
    pub text: String,
}

/// The value of a text that was typed into a cell with the value `old`.
///
/// # Errors
/// A text that is no number, or arithmetic without a value, such as `0/0`.
pub fn evaluate(text: &str, old: f64) -> Result<f64, ParseNumberError> {
    let trimmed = text.trim();
    let continues = trimmed.starts_with(['*', '/', '+']) || trimmed.starts_with("- ");
    let mut reader = ExpressionParser { rest: trimmed.chars().peekable(), depth: 0 };
    let value = if continues { reader.tail(old) } else { reader.sum() };
    match value {
        Some(value) if reader.rest.next().is_none() && !value.is_nan() => Ok(value),
        _ => Err(ParseNumberError { text: text.to_owned() }),
    }
}

/// A recursive-descent parser; its methods return `None` at a syntax error.
struct ExpressionParser<'a> {
    rest: Peekable<Chars<'a>>,
    depth: usize,
}

impl ExpressionParser<'_> {
    fn sum(&mut self) -> Option<f64> {
        let first = self.product()?;
        self.terms(first)
    }

    /// The operators that follow a value.
    fn tail(&mut self, old: f64) -> Option<f64> {
        let first = self.factors(old)?;
        self.terms(first)
    }

    fn terms(&mut self, mut value: f64) -> Option<f64> {
        loop {
            if self.takes('+') {
                value += self.product()?;
            } else if self.takes('-') {
                value -= self.product()?;
            } else {
                return Some(value);
            }
        }
    }

    fn product(&mut self) -> Option<f64> {
        let first = self.factor()?;
        self.factors(first)
    }

    fn factors(&mut self, mut value: f64) -> Option<f64> {
        loop {
            if self.takes('*') {
                value *= self.factor()?;
            } else if self.takes('/') {
                value /= self.factor()?;
            } else {
                return Some(value);
            }
        }
    }

    fn factor(&mut self) -> Option<f64> {
        if self.takes('-') {
            return self.plain().map(|value| -value);
        }
        self.plain()
    }

    fn plain(&mut self) -> Option<f64> {
        if !self.takes('(') {
            return self.number();
        }
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return None;
        }
        let value = self.sum()?;
        self.depth -= 1;
        self.takes(')').then_some(value)
    }

    fn number(&mut self) -> Option<f64> {
        self.blanks();
        let mut text = String::new();
        while let Some(next) = self.rest.peek().copied() {
            let sign_of_exponent = matches!(next, '+' | '-')
                && text.ends_with(['e', 'E'])
                && text.starts_with(|c: char| c.is_ascii_digit() || c == '.');
            if !(next.is_ascii_alphanumeric() || next == '.' || sign_of_exponent) {
                break;
            }
            text.push(next);
            self.rest.next();
        }
        text.parse().ok()
    }

    /// Reads this sign and returns true if it comes next.
    fn takes(&mut self, sign: char) -> bool {
        self.blanks();
        self.rest.next_if_eq(&sign).is_some()
    }

    fn blanks(&mut self) {
        while self.rest.next_if(|c| c.is_whitespace()).is_some() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_takes_numbers_and_arithmetic() {
        let cases = [
            ("12.5", 12.5),
            (" 1e2 ", 100.0),
            ("1.5e-3", 1.5e-3),
            ("2-1e+1", -8.0),
            ("25.4/2", 12.7),
            ("1 + 2*3", 7.0),
            ("(1+2)*3", 9.0),
            ("-(1+2)", -3.0),
            ("2*-3", -6.0),
            ("inf", f64::INFINITY),
            ("-Infinity", f64::NEG_INFINITY),
        ];
        for (text, value) in cases {
            assert_eq!(evaluate(text, 10.0), Ok(value), "{text}");
        }
    }

    #[test]
    fn a_leading_operator_continues_from_the_old_value() {
        let cases =
            [("*2", 20.0), ("/ 4", 2.5), ("+5", 15.0), ("- 3", 7.0), ("-3", -3.0), ("*2+1", 21.0)];
        for (text, value) in cases {
            assert_eq!(evaluate(text, 10.0), Ok(value), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        let deep = "(".repeat(100_000);
        for text in ["", "abc", "1,5", "*", "+", "NaN", "1 2", "2e", "(1", "1)", "0/0", &deep] {
            assert!(evaluate(text, 1.0).is_err(), "{text}");
        }
        assert!(evaluate("*0", f64::INFINITY).is_err());
        assert!(evaluate("two", 1.0).unwrap_err().to_string().starts_with("`two` is no number"));
    }
}
