//! Temperature: from a loss to a probability density (4.7), and from densities to the probability
//! that a descent ends.
//!
//! Everything is computed from logarithms, so that densities that underflow can still be compared.
//! At temperature 0 only the order of two losses matters, at infinite temperature nothing.

use crate::math::format_short;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt::{self, Display};

/// The temperature of (4.7), from 0 to infinity inclusive; serialized as a number or `"infinite"`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Temperature(f64);

impl Temperature {
    /// A temperature of at least 0; `None` for negative numbers and NaN.
    pub fn new(value: f64) -> Option<Self> {
        (value >= 0.0).then_some(Self(value))
    }

    /// The temperature at which a loss has a density of one half, `|L| / ln 2`; 1 if the loss is 0,
    /// whose density is 1 at every temperature.
    pub fn at_half_density(loss: f64) -> Self {
        let value = loss.abs() / std::f64::consts::LN_2;
        Self(if value > 0.0 && value.is_finite() { value } else { 1.0 })
    }

    /// The value.
    pub fn value(self) -> f64 {
        self.0
    }

    /// The temperature multiplied by a factor; unchanged if the product is not a number.
    pub(in crate::search) fn scale_by(self, factor: f64) -> Self {
        Self::new(self.0 * factor).unwrap_or(self)
    }

    /// The density (4.7) of a loss; 0 if the loss is not finite.
    pub fn density(self, loss: f64) -> f64 {
        self.log_density(loss).exp()
    }

    /// The logarithm of the density. At temperature 0 it is minus infinity for any loss above 0.
    pub fn log_density(self, loss: f64) -> f64 {
        if !loss.is_finite() {
            f64::NEG_INFINITY
        } else if loss == 0.0 || self.0.is_infinite() {
            0.0
        } else {
            -loss / self.0
        }
    }

    /// The logarithm of the ratio of the densities of two losses, `after` over `before`; at
    /// temperature 0 it is infinite unless they are the same.
    pub fn log_ratio(self, before: f64, after: f64) -> f64 {
        if !after.is_finite() {
            f64::NEG_INFINITY
        } else if !before.is_finite() {
            f64::INFINITY
        } else if before == after || self.0.is_infinite() {
            0.0
        } else {
            (before - after) / self.0
        }
    }
}

impl Display for Temperature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_finite() {
            f.write_str(&format_short(self.0))
        } else {
            f.write_str("infinite")
        }
    }
}

impl Serialize for Temperature {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            serializer.serialize_f64(self.0)
        } else {
            serializer.serialize_str("infinite")
        }
    }
}

impl<'de> Deserialize<'de> for Temperature {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum NumberOrWord {
            Number(f64),
            Word(String),
        }
        let found = match NumberOrWord::deserialize(deserializer)? {
            NumberOrWord::Number(value) => Self::new(value).ok_or_else(|| format_short(value)),
            NumberOrWord::Word(word) if word == "infinite" => Ok(Self(f64::INFINITY)),
            NumberOrWord::Word(word) => Err(format!("`{word}`")),
        };
        let expected = "a temperature, 0 or more, or \"infinite\"";
        found.map_err(|found| {
            serde::de::Error::invalid_value(serde::de::Unexpected::Other(&found), &expected)
        })
    }
}

/// The rule that ends descents: three readings of the thesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// Algorithm 1, (4.17): after each move with probability `max(0, (π(θ) − π(θ') + C) / (π(θ) +
    /// C)) = max(0, 1 − π(θ') / (π(θ) + C))`. A descent whose density is far below `C` ends unless
    /// a move multiplies it: bad starts are abandoned early.
    Ratio,
    /// The same with `C π(θ)` in place of `C`: `max(0, 1 − π(θ') / π(θ) / (1 + C))`. The length of
    /// a descent depends on how fast it improves, not on where it began.
    Relative,
    /// The competing clocks of section 4.4.1 with rates 1 and `κ = max(0, 1 − π(θ') / π(θ) + C)`
    /// (4.16): probability `κ / (1 + κ)`. Even a move to density 0 ends a descent only half of the
    /// time.
    Clocks,
}

impl Termination {
    /// The probability that a descent ends after a move from one loss to another.
    ///
    /// At temperature 0, where densities vanish, all rules depend only on whether the move
    /// improved.
    pub fn chance(self, temperature: Temperature, c: f64, before: f64, after: f64) -> f64 {
        let ratio = temperature.log_ratio(before, after).exp();
        match self {
            Self::Ratio if temperature.value() > 0.0 => {
                let old = temperature.log_density(before);
                let survival = temperature.log_density(after) - log_sum(old, c.ln());
                // Both vanish only if `C` is 0: then nothing was lost.
                let survival = if survival.is_nan() { 1.0 } else { survival.exp() };
                (1.0 - survival).max(0.0)
            }
            Self::Ratio | Self::Relative => (1.0 - ratio / (1.0 + c)).max(0.0),
            Self::Clocks => {
                let rate = (1.0 - ratio + c).max(0.0);
                rate / (1.0 + rate)
            }
        }
    }
}

/// The logarithm of the sum of two numbers that are given as logarithms.
fn log_sum(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    if high == f64::NEG_INFINITY { high } else { high + (low - high).exp().ln_1p() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_of_a_sum_is_that_of_the_sum() {
        for (a, b) in [(0.3_f64, 2.0_f64), (2.0, 0.3), (-1.0, -1.0)] {
            assert!((log_sum(a, b) - (a.exp() + b.exp()).ln()).abs() < 1e-14, "{a} {b}");
        }
        // Beyond the range of the exponential the larger one is all, in either order.
        for (a, b) in [(800.0, -800.0), (5.0, f64::NEG_INFINITY)] {
            assert_eq!((log_sum(a, b), log_sum(b, a)), (a, a));
        }
        assert_eq!(log_sum(f64::NEG_INFINITY, f64::NEG_INFINITY), f64::NEG_INFINITY);
    }
}
