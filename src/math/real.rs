//! The trait of the number types over which the physics is written.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A real number, with or without derivatives.
///
/// Comparisons regard the value alone, so that a [`Dual`](super::Dual) takes the same path as the plain
/// number.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Send
    + Sync
    + 'static
{
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Two.
    const TWO: Self;
    /// The distance from one to the next larger number.
    const EPSILON: f64;

    /// The order of the derivatives: 0 for a plain number.
    const ORDER: usize;

    /// The number nearest to `value`, with no derivative.
    fn from_f64(value: f64) -> Self;

    /// The value alone, without derivatives.
    fn value(self) -> f64;

    /// The square root; NaN for a negative argument.
    #[must_use]
    fn sqrt(self) -> Self;

    /// The absolute value.
    #[inline(always)]
    #[must_use]
    fn abs(self) -> Self {
        Self::select(self < Self::ZERO, -self, self)
    }

    /// `yes` if the condition is true, else `no`: a choice that vector instructions can make too.
    #[inline(always)]
    #[must_use]
    fn select(condition: bool, yes: Self, no: Self) -> Self {
        if condition { yes } else { no }
    }

    /// True if the value and every derivative are finite.
    fn is_finite(self) -> bool;
}

macro_rules! real_for_float {
    ($float:ident, $epsilon:literal, $round:expr) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const TWO: Self = 2.0;
            const EPSILON: f64 = $epsilon;
            const ORDER: usize = 0;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                $round(value)
            }
            #[inline(always)]
            fn value(self) -> f64 {
                self.into()
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
        }
    };
}
real_for_float!(f64, 2.220446049250313e-16, std::convert::identity);
real_for_float!(f32, 1.1920928955078125e-7, |value: f64| value as f32);
