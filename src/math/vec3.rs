//! Points and directions over any number type.

use super::Real;
use std::ops::{Add, Mul, Neg, Sub};

/// A point or direction in space.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Vec3<R> {
    /// Sagittal component.
    pub x: R,
    /// Tangential component.
    pub y: R,
    /// Component along the optical axis.
    pub z: R,
}

impl<R> Vec3<R> {
    /// The vector with these components.
    #[inline(always)]
    pub const fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }
}

impl<R: Real> Vec3<R> {
    /// The vector of constants `v`.
    #[inline(always)]
    pub fn from_f64(v: Vec3<f64>) -> Self {
        Self::new(R::from_f64(v.x), R::from_f64(v.y), R::from_f64(v.z))
    }

    /// The scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The values without derivatives.
    #[inline(always)]
    pub fn value(self) -> Vec3<f64> {
        Vec3::new(self.x.value(), self.y.value(), self.z.value())
    }

    /// True if every component is finite.
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl<R: Real> Add for Vec3<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<R: Real> Sub for Vec3<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<R: Real> Mul<R> for Vec3<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: R) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

impl<R: Real> Neg for Vec3<R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}
