//! Numbers with twice the precision of `f64`, to measure rounding errors.
//!
//! A number is the unevaluated sum of two `f64` (Dekker 1971; Joldes, Muller and Popescu, "Tight
//! and rigorous error bounds for basic building blocks of double-word arithmetic", ACM TOMS 44,
//! 2017). About 31 digits, some twenty times slower than `f64`.

use super::Real;
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number as the sum of an `f64` and a correction below its last digit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

/// The sum of two numbers and its rounding error (Knuth).
#[inline]
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let rest = high - a;
    DoubleDouble { high, low: (a - (high - rest)) + (b - rest) }
}

/// The same for `|a| ≥ |b|` (Dekker).
#[inline]
fn fast_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

/// The product of two numbers and its rounding error.
#[inline]
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    DoubleDouble { high, low: a.mul_add(b, -high) }
}

impl DoubleDouble {
    /// The correction to the nearest `f64`.
    pub fn low(self) -> f64 {
        self.low
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let high = two_sum(self.high, o.high);
        let low = two_sum(self.low, o.low);
        if !high.high.is_finite() {
            return Self::from_f64(high.high);
        }
        let sum = fast_two_sum(high.high, high.low + low.high);
        fast_two_sum(sum.high, low.low + sum.low)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let product = two_product(self.high, o.high);
        if !product.high.is_finite() {
            return Self::from_f64(product.high);
        }
        let low = self.high.mul_add(o.low, self.low * o.high);
        fast_two_sum(product.high, product.low + low)
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let first = self.high / o.high;
        if !first.is_finite() {
            return Self { high: first, low: 0.0 };
        }
        let rest = self - o * Self::from_f64(first);
        let second = rest.high / o.high;
        let rest = rest - o * Self::from_f64(second);
        fast_two_sum(first, second) + Self::from_f64(rest.high / o.high)
    }
}

impl AddAssign for DoubleDouble {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl SubAssign for DoubleDouble {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl PartialOrd for DoubleDouble {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        let high = self.high.partial_cmp(&o.high)?;
        Some(high.then(self.low.partial_cmp(&o.low).unwrap_or(Ordering::Equal)))
    }
}

impl Real for DoubleDouble {
    const ZERO: Self = Self { high: 0.0, low: 0.0 };
    const ONE: Self = Self { high: 1.0, low: 0.0 };
    const TWO: Self = Self { high: 2.0, low: 0.0 };
    const EPSILON: f64 = 4.9e-32;
    // An iteration that has settled in f64 needs one more step to settle here.
    const ORDER: usize = 1;

    fn from_f64(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
    fn value(self) -> f64 {
        self.high
    }
    fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 || !root.is_finite() {
            return Self { high: root, low: 0.0 };
        }
        let rest = self - two_product(root, root);
        fast_two_sum(root, rest.high / (2.0 * root))
    }
    fn is_finite(self) -> bool {
        self.high.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_double_keeps_thirty_digits() {
        let third = DoubleDouble::ONE / DoubleDouble::from_f64(3.0);
        let error = third + third + third - DoubleDouble::ONE;
        assert!(error.value().abs() < 1e-31);
        let two = DoubleDouble::TWO.sqrt();
        assert!((two * two - DoubleDouble::TWO).value().abs() < 1e-31);
        let tiny = DoubleDouble::ONE + DoubleDouble::from_f64(1e-25) - DoubleDouble::ONE;
        assert!((tiny.value() - 1e-25).abs() < 1e-38);
        let infinite = DoubleDouble::ONE / DoubleDouble::ZERO;
        assert!(infinite.value().is_infinite() && (infinite * infinite).value().is_infinite());
    }
}
