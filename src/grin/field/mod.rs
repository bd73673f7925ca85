//! Fields of refractive index: value, gradient, Hessian, and the transpose onto the parameters.
//!
//! To add a kind of field, write its file; a profile in one coordinate needs only a
//! [`ProfileFunction`] of its own.

mod bspline;
mod graded;
mod grid;
mod layered;
mod luneburg;
mod maxwell;
mod parabolic;
mod plume;
mod polynomial;
mod sech;
mod tricubic;
mod trilinear;

pub use bspline::BSpline;
pub use graded::{
    AXIAL_TERMS, Force, PROFILE_TERMS, ProfileCoefficients, ProfileGradient, ProfileLaw,
    RADIAL_TERMS, RotationalProfile,
};
pub use grid::{GridError, RegularGrid};
pub use layered::{
    ProfileCoordinate, ProfileField, ProfileFunction, ProfileSample, ProfileSamples,
};
pub use luneburg::Luneburg;
pub use maxwell::Maxwell;
pub use parabolic::Parabolic;
pub use plume::Plume;
pub use polynomial::Polynomial;
pub use sech::Sech;
pub use tricubic::Tricubic;
pub use trilinear::{HessianDiagonal, Trilinear};

use super::lanes::{LANES, LaneScalars, LaneVectors, get, put};
use crate::math::{Real, SimdWidth, Vec3, run_vectorized};
use std::fmt::Debug;

/// The index at a point, and its gradient.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IndexSample<R> {
    /// Refractive index η.
    pub index: R,
    /// ∇η, per unit of length.
    pub gradient: Vec3<R>,
}

/// The second derivatives of the index: a symmetric matrix.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Hessian<R> {
    /// ∂²η/∂x², ∂²η/∂y², ∂²η/∂z².
    pub diagonal: Vec3<R>,
    /// ∂²η/∂y∂z, ∂²η/∂z∂x, ∂²η/∂x∂y.
    pub mixed: Vec3<R>,
}

impl<R: Real> Hessian<R> {
    /// The matrix times a vector.
    #[inline(always)]
    pub fn times(self, v: Vec3<R>) -> Vec3<R> {
        let (d, m) = (self.diagonal, self.mixed);
        Vec3::new(
            d.x * v.x + m.z * v.y + m.y * v.z,
            m.z * v.x + d.y * v.y + m.x * v.z,
            m.y * v.x + m.x * v.y + d.z * v.z,
        )
    }
}

/// The resolution and continuity of a field, for the choice of integrator and step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldResolution {
    /// The smallest distance over which the field changes its formula, a length; `None` for a field
    /// of one formula.
    pub voxel: Option<f64>,
    /// True if the force `η ∇η` is continuous.
    pub continuous_force: bool,
}

/// A field of refractive index with parameters.
///
/// It is defined everywhere, also outside the region in which light is traced: a step may end
/// outside. Blocks of rays are evaluated at once; the block methods must return the same bits as
/// the single ones, and do unless they are overridden.
pub trait IndexField<R: Real>: Debug + Send + Sync {
    /// The parameters that an optimizer may change, in the order of the gradient.
    fn parameters(&self) -> &[R];

    /// Mutable access to the parameters.
    fn parameters_mut(&mut self) -> &mut [R];

    /// Index and gradient at a point.
    fn sample(&self, at: Vec3<R>) -> IndexSample<R>;

    /// The second derivatives at a point.
    fn hessian(&self, at: Vec3<R>) -> Hessian<R>;

    /// Index, gradient and second derivatives at a point.
    #[inline(always)]
    fn sample_and_hessian(&self, at: Vec3<R>) -> (IndexSample<R>, Hessian<R>) {
        (self.sample(at), self.hessian(at))
    }

    /// Adds `weight ∂η/∂θ + pull · ∂∇η/∂θ` to the gradient by the parameters θ.
    fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]);

    /// The resolution and continuity of the field.
    fn resolution(&self) -> FieldResolution;

    /// Index and gradient for a block of rays.
    fn sample_block(&self, at: &LaneVectors<R>, out: &mut IndexSamples<R>) {
        run_vectorized(
            SimdWidth::Bits512,
            #[inline(always)]
            || self.sample_lanes(at, out),
        );
    }

    /// Index, gradient, and the Hessian times a vector for each ray of a block.
    fn sample_block_with_hessians(
        &self,
        at: &LaneVectors<R>,
        times: &LaneVectors<R>,
        out: &mut IndexSamples<R>,
        product: &mut LaneVectors<R>,
    ) {
        run_vectorized(
            SimdWidth::Bits512,
            #[inline(always)]
            || self.hessian_lanes(at, times, out, product),
        );
    }

    /// [`Self::accumulate`] for a block of rays, in order.
    fn accumulate_block(
        &self,
        at: &LaneVectors<R>,
        weight: &LaneScalars<R>,
        pull: &LaneVectors<R>,
        gradient: &mut [R],
    ) {
        run_vectorized(
            SimdWidth::Bits512,
            #[inline(always)]
            || self.accumulate_lanes(at, weight, pull, gradient),
        );
    }

    /// The loop of [`Self::sample_block`], to be overridden where lanes can share work.
    #[inline(always)]
    fn sample_lanes(&self, at: &LaneVectors<R>, out: &mut IndexSamples<R>) {
        for lane in 0..LANES {
            out.put(lane, self.sample(get(at, lane)));
        }
    }

    /// The loop of [`Self::sample_block_with_hessians`], to be overridden where lanes can share
    /// work.
    #[inline(always)]
    fn hessian_lanes(
        &self,
        at: &LaneVectors<R>,
        times: &LaneVectors<R>,
        out: &mut IndexSamples<R>,
        product: &mut LaneVectors<R>,
    ) {
        for lane in 0..LANES {
            let (sample, hessian) = self.sample_and_hessian(get(at, lane));
            out.put(lane, sample);
            put(product, lane, hessian.times(get(times, lane)));
        }
    }

    /// The loop of [`Self::accumulate_block`], to be overridden where lanes can share work.
    #[inline(always)]
    fn accumulate_lanes(
        &self,
        at: &LaneVectors<R>,
        weight: &LaneScalars<R>,
        pull: &LaneVectors<R>,
        gradient: &mut [R],
    ) {
        for (lane, weight) in weight.iter().enumerate() {
            self.accumulate(get(at, lane), *weight, get(pull, lane), gradient);
        }
    }
}

/// Indices and gradients for a block of rays; each column is aligned with a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct IndexSamples<R> {
    /// Refractive index η.
    pub index: LaneScalars<R>,
    /// ∇η.
    pub gradient: LaneVectors<R>,
}

impl<R: Real> Default for IndexSamples<R> {
    fn default() -> Self {
        Self { index: [R::ZERO; LANES], gradient: LaneVectors::default() }
    }
}

impl<R: Real> IndexSamples<R> {
    #[inline(always)]
    pub(super) fn put(&mut self, lane: usize, sample: IndexSample<R>) {
        self.index[lane] = sample.index;
        put(&mut self.gradient, lane, sample.gradient);
    }
}
