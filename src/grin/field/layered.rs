//! Fields that depend on one coordinate: spheres, fibres, plane layers.
//!
//! `η = f(s)` with `s = x² + y² + z²`, `s = x² + y²` or `s = z`. The square of the radius, not the
//! radius, is the variable, so the axis needs no special case.

use super::{Field, Grain, Hessian, Sample, Samples};
use crate::grin::lanes::{Column, Columns, LANES, get, put};
use crate::math::Real;
use crate::math::Vec3;
use crate::math::Width;
use crate::math::widest;
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
    #[inline(always)]
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

/// The same for a block of rays.
#[derive(Debug, Clone, Copy)]
pub struct ProfiledColumns<R> {
    /// `f`.
    pub value: Column<R>,
    /// `df/ds`.
    pub slope: Column<R>,
    /// `d²f/ds²`.
    pub bend: Column<R>,
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
    /// [`Self::at`] for a block of rays: the same bits.
    #[inline(always)]
    fn at_all(&self, s: &Column<R>, out: &mut ProfiledColumns<R>) {
        for (lane, s) in s.iter().enumerate() {
            let f = self.at(*s);
            (out.value[lane], out.slope[lane], out.bend[lane]) = (f.value, f.slope, f.bend);
        }
    }
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

impl<P> Layered<P> {
    /// The Hessian where the coordinate has this gradient.
    #[inline(always)]
    fn curved<R: Real>(&self, ds: Vec3<R>, slope: R, bend: R) -> Hessian<R> {
        let squares = Vec3::new(ds.x * ds.x, ds.y * ds.y, ds.z * ds.z);
        let products = Vec3::new(ds.y * ds.z, ds.z * ds.x, ds.x * ds.y);
        Hessian {
            diagonal: squares * bend + self.coordinate.curvature() * slope,
            mixed: products * bend,
        }
    }

    #[inline(always)]
    fn profiled<R: Real>(&self, at: &Columns<R>) -> ProfiledColumns<R>
    where
        P: Profile<R>,
    {
        let zero = [R::ZERO; LANES];
        let (mut s, mut out) = (zero, ProfiledColumns { value: zero, slope: zero, bend: zero });
        for (lane, s) in s.iter_mut().enumerate() {
            *s = self.coordinate.at(get(at, lane)).0;
        }
        self.profile.at_all(&s, &mut out);
        out
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

    fn samples(&self, at: &Columns<R>, out: &mut Samples<R>) {
        widest(
            Width::Bits512,
            #[inline(always)]
            || {
                let profiled = self.profiled(at);
                for lane in 0..LANES {
                    let (_, ds) = self.coordinate.at(get(at, lane));
                    let gradient = ds * profiled.slope[lane];
                    out.put(lane, Sample { index: profiled.value[lane], gradient });
                }
            },
        );
    }

    fn samples_and_hessians(
        &self,
        at: &Columns<R>,
        times: &Columns<R>,
        out: &mut Samples<R>,
        product: &mut Columns<R>,
    ) {
        widest(
            Width::Bits512,
            #[inline(always)]
            || {
                let profiled = self.profiled(at);
                for lane in 0..LANES {
                    let (slope, bend) = (profiled.slope[lane], profiled.bend[lane]);
                    let (_, ds) = self.coordinate.at(get(at, lane));
                    out.put(lane, Sample { index: profiled.value[lane], gradient: ds * slope });
                    let hessian = self.curved(ds, slope, bend);
                    put(product, lane, hessian.times(get(times, lane)));
                }
            },
        );
    }

    #[inline(always)]
    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        let (s, ds) = self.coordinate.at(at);
        let f = self.profile.at(s);
        self.curved(ds, f.slope, f.bend)
    }

    #[inline(always)]
    fn deposit(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let (s, ds) = self.coordinate.at(at);
        self.profile.deposit(s, weight, pull.dot(ds), gradient);
    }

    fn grain(&self) -> Grain {
        // At the far end of a radial profile, where its knots lie closest.
        let voxel = self.profile.knots().map(|knot| {
            if self.coordinate == Coordinate::Axial {
                return knot.value();
            }
            let last = knot.value() * (self.profile.parameters().len() - 3) as f64;
            last.sqrt() - (last - knot.value()).sqrt()
        });
        Grain { voxel, continuous_force: true }
    }
}
