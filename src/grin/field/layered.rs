//! Fields that depend on one coordinate: spheres, fibres, plane layers.
//!
//! `η = f(s)` with `s = x² + y² + z²`, `s = x² + y²` or `s = z`. The square of the radius, not the
//! radius, is the variable, so the axis needs no special case.

use super::{Field, Grain, Hessian, Sample};
use crate::math::Real;
use crate::math::Vec3;
use std::fmt::Debug;

/// The coordinate that a profile depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coordinate {
    /// `s = x² + y² + z²`.
    Sphere,
    /// `s = x² + y²`: a fibre along z.
    Cylinder,
    /// `s = z`.
    Axial,
}

impl Coordinate {
    /// The coordinate and its gradient at a point.
    #[inline(always)]
    fn at<R: Real>(self, p: Vec3<R>) -> (R, Vec3<R>) {
        match self {
            Self::Sphere => (p.dot(p), p * R::TWO),
            Self::Cylinder => {
                (p.x * p.x + p.y * p.y, Vec3::new(R::TWO * p.x, R::TWO * p.y, R::ZERO))
            }
            Self::Axial => (p.z, Vec3::new(R::ZERO, R::ZERO, R::ONE)),
        }
    }

    /// The diagonal of its Hessian, which has no mixed terms.
    fn curvature<R: Real>(self) -> Vec3<R> {
        match self {
            Self::Sphere => Vec3::new(R::TWO, R::TWO, R::TWO),
            Self::Cylinder => Vec3::new(R::TWO, R::TWO, R::ZERO),
            Self::Axial => Vec3::default(),
        }
    }
}

/// A profile at one value of its coordinate: `f`, `df/ds`, `d²f/ds²`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profiled<R> {
    /// `f`.
    pub value: R,
    /// `df/ds`.
    pub slope: R,
    /// `d²f/ds²`.
    pub bend: R,
}

/// The index as a function of one coordinate.
pub trait Profile<R: Real>: Debug + Send + Sync {
    /// What an optimiser may change.
    fn parameters(&self) -> &[R];
    /// The same, to be changed.
    fn parameters_mut(&mut self) -> &mut [R];
    /// The profile and its derivatives.
    fn at(&self, s: R) -> Profiled<R>;
    /// Adds `weight ∂f/∂θ + pull ∂f'/∂θ` to the gradient by the parameters.
    fn deposit(&self, s: R, weight: R, pull: R, gradient: &mut [R]);
    /// Whether one formula holds everywhere; else the distance in `s` between the changes.
    fn knots(&self) -> Option<R> {
        None
    }
}

/// A field `η = f(s)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Layered<P> {
    /// What `s` is.
    pub coordinate: Coordinate,
    /// `f`.
    pub profile: P,
}

impl<P> Layered<P> {
    /// A ball about the origin.
    pub fn sphere(profile: P) -> Self {
        Self { coordinate: Coordinate::Sphere, profile }
    }

    /// A fibre along z.
    pub fn cylinder(profile: P) -> Self {
        Self { coordinate: Coordinate::Cylinder, profile }
    }

    /// Layers across z.
    pub fn axial(profile: P) -> Self {
        Self { coordinate: Coordinate::Axial, profile }
    }
}

impl<R: Real, P: Profile<R>> Field<R> for Layered<P> {
    fn parameters(&self) -> &[R] {
        self.profile.parameters()
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        self.profile.parameters_mut()
    }

    #[inline(always)]
    fn sample(&self, at: Vec3<R>) -> Sample<R> {
        let (s, ds) = self.coordinate.at(at);
        let f = self.profile.at(s);
        Sample { index: f.value, gradient: ds * f.slope }
    }

    #[inline(always)]
    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        let (s, ds) = self.coordinate.at(at);
        let f = self.profile.at(s);
        let squares = Vec3::new(ds.x * ds.x, ds.y * ds.y, ds.z * ds.z);
        let products = Vec3::new(ds.y * ds.z, ds.z * ds.x, ds.x * ds.y);
        Hessian {
            diagonal: squares * f.bend + self.coordinate.curvature() * f.slope,
            mixed: products * f.bend,
        }
    }

    #[inline(always)]
    fn deposit(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let (s, ds) = self.coordinate.at(at);
        self.profile.deposit(s, weight, pull.dot(ds), gradient);
    }

    fn grain(&self) -> Grain {
        // At the far end of a radial profile, where its knots lie closest.
        let voxel = self.profile.knots().map(|knot| match self.coordinate {
            Coordinate::Axial => knot.value(),
            _ => {
                let last = knot.value() * (self.profile.parameters().len() - 3) as f64;
                last.sqrt() - (last - knot.value()).sqrt()
            }
        });
        Grain { voxel, continuous_force: true }
    }
}
