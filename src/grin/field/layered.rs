//! Fields that depend on one coordinate: spheres, fibres, plane layers.
//!
//! `η = f(s)` with `s = x² + y² + z²`, `s = x² + y²` or `s = z`. The square of the radius, not the
//! radius, is the variable, so the axis needs no special case.

use super::{FieldResolution, Hessian, IndexField, IndexSample, IndexSamples};
use crate::grin::lanes::{LANES, LaneScalars, LaneVectors, get, put};
use crate::math::{Real, Vec3};
use std::fmt::Debug;

/// The coordinate that a profile depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ProfileCoordinate {
    /// `s = x² + y² + z²`.
    Sphere,
    /// `s = x² + y²`: a fibre along z.
    Cylinder,
    /// `s = z`.
    Axial,
}

impl ProfileCoordinate {
    /// The coordinate and its gradient at a point.
    #[inline(always)]
    fn value_and_gradient<R: Real>(self, p: Vec3<R>) -> (R, Vec3<R>) {
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
    fn hessian_diagonal<R: Real>(self) -> Vec3<R> {
        match self {
            Self::Sphere => Vec3::new(R::TWO, R::TWO, R::TWO),
            Self::Cylinder => Vec3::new(R::TWO, R::TWO, R::ZERO),
            Self::Axial => Vec3::default(),
        }
    }
}

/// A profile at one value of its coordinate: `f`, `df/ds`, `d²f/ds²`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileSample<R> {
    /// `f`.
    pub value: R,
    /// `df/ds`.
    pub slope: R,
    /// `d²f/ds²`.
    pub curvature: R,
}

/// A profile for a block of rays.
#[derive(Debug, Clone, Copy)]
pub struct ProfileSamples<R> {
    /// `f`.
    pub value: LaneScalars<R>,
    /// `df/ds`.
    pub slope: LaneScalars<R>,
    /// `d²f/ds²`.
    pub curvature: LaneScalars<R>,
}

/// The index as a function of one coordinate.
pub trait ProfileFunction<R: Real>: Debug + Send + Sync {
    /// The parameters that an optimizer may change.
    fn parameters(&self) -> &[R];
    /// Mutable access to the parameters.
    fn parameters_mut(&mut self) -> &mut [R];
    /// The profile and its derivatives at one value of the coordinate.
    fn evaluate(&self, s: R) -> ProfileSample<R>;
    /// Adds `weight ∂f/∂θ + pull ∂f'/∂θ` to the gradient by the parameters θ.
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]);
    /// [`Self::evaluate`] for a block of rays: the same bits.
    #[inline(always)]
    fn evaluate_block(&self, s: &LaneScalars<R>, out: &mut ProfileSamples<R>) {
        for (lane, s) in s.iter().enumerate() {
            let f = self.evaluate(*s);
            (out.value[lane], out.slope[lane], out.curvature[lane]) =
                (f.value, f.slope, f.curvature);
        }
    }
    /// The distance in `s` between changes of the formula; `None` if one formula holds everywhere.
    fn knot_spacing(&self) -> Option<R> {
        None
    }
}

/// A scaled coordinate clamped to `cut`, from which on a profile is constant, and the factor of its
/// derivatives: 1 before the cut, 0 beyond it.
#[inline(always)]
pub(super) fn clamp_coordinate<R: Real>(q: R, cut: f64) -> (R, R) {
    let cut = R::from_f64(cut);
    let inside = q < cut;
    (R::select(inside, q, cut), R::select(inside, R::ONE, R::ZERO))
}

/// A field `η = f(s)`.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileField<P> {
    /// The coordinate `s`.
    pub coordinate: ProfileCoordinate,
    /// `f`.
    pub profile: P,
}

impl<P> ProfileField<P> {
    /// A spherical field about the origin.
    pub fn sphere(profile: P) -> Self {
        Self { coordinate: ProfileCoordinate::Sphere, profile }
    }

    /// A cylindrical field about the z axis, as in a fibre.
    pub fn cylinder(profile: P) -> Self {
        Self { coordinate: ProfileCoordinate::Cylinder, profile }
    }

    /// A field that depends on z alone.
    pub fn axial(profile: P) -> Self {
        Self { coordinate: ProfileCoordinate::Axial, profile }
    }
}

impl<P> ProfileField<P> {
    /// The Hessian where the coordinate has the gradient `ds`.
    #[inline(always)]
    fn hessian_from<R: Real>(&self, ds: Vec3<R>, slope: R, curvature: R) -> Hessian<R> {
        let squares = Vec3::new(ds.x * ds.x, ds.y * ds.y, ds.z * ds.z);
        let products = Vec3::new(ds.y * ds.z, ds.z * ds.x, ds.x * ds.y);
        Hessian {
            diagonal: squares * curvature + self.coordinate.hessian_diagonal() * slope,
            mixed: products * curvature,
        }
    }

    #[inline(always)]
    fn profile_block<R: Real>(&self, at: &LaneVectors<R>) -> ProfileSamples<R>
    where
        P: ProfileFunction<R>,
    {
        let zero = [R::ZERO; LANES];
        let (mut s, mut out) = (zero, ProfileSamples { value: zero, slope: zero, curvature: zero });
        for (lane, s) in s.iter_mut().enumerate() {
            *s = self.coordinate.value_and_gradient(get(at, lane)).0;
        }
        self.profile.evaluate_block(&s, &mut out);
        out
    }
}

impl<R: Real, P: ProfileFunction<R>> IndexField<R> for ProfileField<P> {
    fn parameters(&self) -> &[R] {
        self.profile.parameters()
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        self.profile.parameters_mut()
    }

    #[inline(always)]
    fn sample(&self, at: Vec3<R>) -> IndexSample<R> {
        let (s, ds) = self.coordinate.value_and_gradient(at);
        let f = self.profile.evaluate(s);
        IndexSample { index: f.value, gradient: ds * f.slope }
    }

    #[inline(always)]
    fn sample_lanes(&self, at: &LaneVectors<R>, out: &mut IndexSamples<R>) {
        let profile = self.profile_block(at);
        for lane in 0..LANES {
            let (_, ds) = self.coordinate.value_and_gradient(get(at, lane));
            let gradient = ds * profile.slope[lane];
            out.put(lane, IndexSample { index: profile.value[lane], gradient });
        }
    }

    #[inline(always)]
    fn hessian_lanes(
        &self,
        at: &LaneVectors<R>,
        times: &LaneVectors<R>,
        out: &mut IndexSamples<R>,
        product: &mut LaneVectors<R>,
    ) {
        let profile = self.profile_block(at);
        for lane in 0..LANES {
            let (slope, curvature) = (profile.slope[lane], profile.curvature[lane]);
            let (_, ds) = self.coordinate.value_and_gradient(get(at, lane));
            out.put(lane, IndexSample { index: profile.value[lane], gradient: ds * slope });
            let hessian = self.hessian_from(ds, slope, curvature);
            put(product, lane, hessian.times(get(times, lane)));
        }
    }

    #[inline(always)]
    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        let (s, ds) = self.coordinate.value_and_gradient(at);
        let f = self.profile.evaluate(s);
        self.hessian_from(ds, f.slope, f.curvature)
    }

    #[inline(always)]
    fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let (s, ds) = self.coordinate.value_and_gradient(at);
        self.profile.accumulate(s, weight, pull.dot(ds), gradient);
    }

    fn resolution(&self) -> FieldResolution {
        // The knots of a radial profile lie closest at its far end.
        let voxel = self.profile.knot_spacing().map(|knot| {
            if self.coordinate == ProfileCoordinate::Axial {
                return knot.value();
            }
            let last = knot.value() * (self.profile.parameters().len() - 3) as f64;
            last.sqrt() - (last - knot.value()).sqrt()
        });
        FieldResolution { voxel, continuous_force: true }
    }
}
