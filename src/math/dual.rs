//! Dual numbers: a value with its derivatives along `N` directions.
//!
//! Over `f64` it is a first derivative, over another dual a second one (a jet). After Griewank
//! and Walther, *Evaluating Derivatives* (2008), chapter 3.

use super::Real;
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number `value` with its derivatives `slope` along `N` directions.
#[derive(Debug, Clone, Copy)]
pub struct Dual<R, const N: usize> {
    /// The number itself.
    pub value: R,
    /// Its derivative along each direction.
    pub slope: [R; N],
}

impl<R: Real, const N: usize> Dual<R, N> {
    /// A constant, with derivatives zero.
    #[inline(always)]
    pub fn constant(value: R) -> Self {
        Self { value, slope: [R::ZERO; N] }
    }

    /// A variable, with derivative 1 along one direction.
    ///
    /// # Panics
    /// If `direction` is not less than `N`.
    #[inline(always)]
    pub fn variable(value: R, direction: usize) -> Self {
        let mut slope = [R::ZERO; N];
        slope[direction] = R::ONE;
        Self { value, slope }
    }

    /// A function of this number, from its value and its derivative there.
    #[inline(always)]
    fn chain(self, value: R, derivative: R) -> Self {
        Self { value, slope: self.slope.map(|s| s * derivative) }
    }
}

impl<R: Real, const N: usize> Default for Dual<R, N> {
    fn default() -> Self {
        Self::constant(R::ZERO)
    }
}

impl<R: Real, const N: usize> PartialEq for Dual<R, N> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<R: Real, const N: usize> PartialOrd for Dual<R, N> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<R: Real, const N: usize> Add for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let slope = std::array::from_fn(|i| self.slope[i] + other.slope[i]);
        Self { value: self.value + other.value, slope }
    }
}

impl<R: Real, const N: usize> Sub for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let slope = std::array::from_fn(|i| self.slope[i] - other.slope[i]);
        Self { value: self.value - other.value, slope }
    }
}

#[expect(clippy::suspicious_arithmetic_impl, reason = "the product rule has a sum")]
impl<R: Real, const N: usize> Mul for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let slope = |i: usize| self.slope[i] * other.value + self.value * other.slope[i];
        Self { value: self.value * other.value, slope: std::array::from_fn(slope) }
    }
}

#[expect(clippy::suspicious_arithmetic_impl, reason = "the quotient rule has a difference")]
impl<R: Real, const N: usize> Div for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let slope = |i: usize| (self.slope[i] - value * other.slope[i]) / other.value;
        Self { value, slope: std::array::from_fn(slope) }
    }
}

impl<R: Real, const N: usize> Neg for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: self.slope.map(Neg::neg) }
    }
}

impl<R: Real, const N: usize> AddAssign for Dual<R, N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<R: Real, const N: usize> SubAssign for Dual<R, N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<R: Real, const N: usize> Real for Dual<R, N> {
    const ZERO: Self = Self { value: R::ZERO, slope: [R::ZERO; N] };
    const ONE: Self = Self { value: R::ONE, slope: [R::ZERO; N] };
    const TWO: Self = Self { value: R::TWO, slope: [R::ZERO; N] };
    const EPSILON: f64 = R::EPSILON;
    const ORDER: usize = R::ORDER + 1;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::constant(R::from_f64(value))
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value.value()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, R::ONE / (root + root))
    }
    #[inline(always)]
    fn select(condition: bool, yes: Self, no: Self) -> Self {
        let slope = std::array::from_fn(|i| R::select(condition, yes.slope[i], no.slope[i]));
        Self { value: R::select(condition, yes.value, no.value), slope }
    }
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.slope.iter().all(|s| s.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dual_of_duals_gives_the_second_derivative() {
        type Jet = Dual<Dual<f64, 1>, 1>;
        let x = Jet::variable(Dual::variable(3.0, 0), 0);
        let y = x * x * x / x.sqrt(); // x^2.5
        assert!((y.value() - 3f64.powf(2.5)).abs() < 1e-13);
        assert!((y.slope[0].value - 2.5 * 3f64.powf(1.5)).abs() < 1e-13);
        assert!((y.slope[0].slope[0] - 3.75 * 3f64.sqrt()).abs() < 1e-13);
    }

    #[test]
    fn a_dual_is_finite_if_its_value_and_every_slope_are() {
        let dual = |value: f64, slope: [f64; 2]| Dual { value, slope };
        assert!(dual(1.0, [0.0, -2.0]).is_finite());
        for other in
            [dual(f64::NAN, [0.0; 2]), dual(1.0, [0.0, f64::INFINITY]), dual(1.0, [f64::NAN, 0.0])]
        {
            assert!(!other.is_finite(), "{other:?}");
        }
    }
}
