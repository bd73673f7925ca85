//! Arithmetic with intervals, and the operations that it shares with numbers.
//!
//! A formula written over [`Arithmetic`] gives a value for a number, a value with derivatives for a
//! [`Dual`](super::Dual), and for an [`Interval`] bounds of all values that it takes there (Moore,
//! *Interval Analysis*, 1966). Every bound is moved outwards by more than the rounding of one
//! operation, so that what the bounds exclude is excluded. A formula that has no value anywhere in
//! an interval, such as the root of negative numbers, gives the empty interval.

use super::Real;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// The operations of a formula that is evaluated over numbers and over intervals.
pub trait Arithmetic:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number nearest to `value`.
    fn constant(value: f64) -> Self;

    /// The square.
    #[must_use]
    fn square(self) -> Self;

    /// The square root.
    #[must_use]
    fn root(self) -> Self;

    /// The length of the hypotenuse of two sides; at the origin, where it has no derivative, with the
    /// mean derivative zero.
    #[must_use]
    fn length(x: Self, y: Self) -> Self;

    /// The ratio of a side to the length of the hypotenuse; zero at the origin.
    #[must_use]
    fn cosine(side: Self, length: Self) -> Self;
}

impl<R: Real> Arithmetic for R {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        R::from_f64(value)
    }

    #[inline(always)]
    fn square(self) -> Self {
        self * self
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn length(x: Self, y: Self) -> Self {
        let square = x * x + y * y;
        if square.value() == 0.0 { R::ZERO } else { square.sqrt() }
    }

    #[inline(always)]
    fn cosine(side: Self, length: Self) -> Self {
        if length.value() == 0.0 { R::ZERO } else { side / length }
    }
}

/// All numbers between two bounds, these included; empty if the bounds are NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower bound.
    pub low: f64,
    /// The upper bound.
    pub high: f64,
}

impl Interval {
    /// All numbers.
    pub const WHOLE: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
    /// No number.
    pub const EMPTY: Self = Self { low: f64::NAN, high: f64::NAN };

    /// The numbers between `a` and `b`, in any order.
    pub fn between(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    /// True if it contains no number.
    pub fn is_empty(self) -> bool {
        !(self.low <= self.high)
    }

    /// True if it contains a number.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The largest absolute value.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// The smallest interval with all numbers of both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The interval between computed bounds, moved outwards by more than their rounding.
    #[inline]
    fn rounded(low: f64, high: f64) -> Self {
        // An overflow of a lower bound upwards leaves the largest number as a bound.
        let low = low.min(f64::MAX);
        let high = high.max(f64::MIN);
        let slack = |bound: f64| bound.abs() * f64::EPSILON + f64::MIN_POSITIVE;
        let low = if low.is_infinite() { low } else { low - slack(low) };
        let high = if high.is_infinite() { high } else { high + slack(high) };
        Self { low, high }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        Self::rounded(self.low + other.low, self.high + other.high)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        let product = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let all = [
            product(self.low, other.low),
            product(self.low, other.high),
            product(self.high, other.low),
            product(self.high, other.high),
        ];
        let low = all.into_iter().fold(f64::INFINITY, f64::min);
        let high = all.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Self::rounded(low, high)
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        if other.contains(0.0) {
            return Self::WHOLE;
        }
        self * Self::rounded(1.0 / other.high, 1.0 / other.low)
    }
}

impl Arithmetic for Interval {
    fn constant(value: f64) -> Self {
        Self { low: value, high: value }
    }

    fn square(self) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let (a, b) = (self.low * self.low, self.high * self.high);
        let least = if self.contains(0.0) { 0.0 } else { a.min(b) };
        let found = Self::rounded(least, a.max(b));
        Self { low: found.low.max(0.0), ..found }
    }

    fn root(self) -> Self {
        if self.is_empty() || self.high < 0.0 {
            return Self::EMPTY;
        }
        let found = Self::rounded(self.low.max(0.0).sqrt(), self.high.sqrt());
        Self { low: found.low.max(0.0), ..found }
    }

    fn length(x: Self, y: Self) -> Self {
        (x.square() + y.square()).root()
    }

    fn cosine(side: Self, length: Self) -> Self {
        let ratio = side / length;
        if ratio.is_empty() {
            return ratio;
        }
        Self { low: ratio.low.clamp(-1.0, 1.0), high: ratio.high.clamp(-1.0, 1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A formula with every operation.
    fn formula<N: Arithmetic>(x: N, y: N) -> N {
        let r = N::length(x, y);
        let a = x * y.square() - N::cosine(x, r) / (r + N::constant(0.5));
        (a.square() + N::constant(1.0)).root() - x / (y.square() + N::constant(0.1)) - -y
    }

    #[test]
    fn an_interval_contains_every_value() {
        let at = |i: u32, from: f64, to: f64| from + (to - from) * f64::from(i) / 17.0;
        for (x, y) in
            [([-1.0, 2.0], [-0.5, 0.25]), ([3.0, 3.5], [-9.0, -8.0]), ([0.0; 2], [0.0; 2])]
        {
            let bounds = formula(Interval::between(x[0], x[1]), Interval::between(y[0], y[1]));
            for i in 0..18 * 18 {
                let value = formula(at(i % 18, x[0], x[1]), at(i / 18, y[0], y[1]));
                assert!(bounds.contains(value), "{value} is not in {bounds:?}");
            }
        }
    }

    #[test]
    fn what_has_no_value_is_empty_and_what_may_be_anything_is_whole() {
        let of = Interval::between;
        assert!(of(-2.0, -1.0).root().is_empty());
        assert!((of(-2.0, -1.0).root() * of(0.0, 1.0) + of(1.0, 1.0)).is_empty());
        assert_eq!(of(-2.0, 4.0).root().low, 0.0);
        assert_eq!(of(1.0, 2.0) / of(-1.0, 1.0), Interval::WHOLE);
        assert!((Interval::WHOLE * of(0.0, 0.0)).contains(0.0));
        let huge = of(1e200, 1e200).square() - of(1e200, 1e200).square();
        assert!(huge.contains(0.0) && !huge.is_empty(), "{huge:?}");
    }
}
