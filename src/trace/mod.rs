//! Real rays through a resolved lens: move to the surface, meet it, refract.
//!
//! After Spencer and Murty, "General Ray-Tracing Procedure", JOSA 52 (1962), with the optical
//! direction `k = n (L, M, N)` in place of the direction cosines (Feder, JOSA 41, 1951): Snell's
//! law becomes `k' = k + Γ N`, and no index ratio is needed. A ray that does not arrive ends with
//! a [`Fate`] that names the surface and the cause.
//!
//! Which crossing of a surface counts is decided by the sense of travel σ, which starts at +1 and
//! turns at every mirror: the one with `σ k·N > 0`. It is not the sign of `N`: light that comes
//! from behind the front lens of a fisheye still travels forwards.

mod asphere;
mod backward;
mod batch;
mod edge;
mod fate;
mod gap;
mod graded;
mod graded_back;
mod graded_edge;
mod interface;
mod limit;
mod margin;
mod single;
mod slot;
mod step;

pub use crate::math::SimdWidth;
pub use backward::{AdjointSeed, SurfaceGradient, SystemGradient};
pub use batch::{ImagePoints, Landings, Rays, TraceSink};
pub use fate::{Fate, Fates};
pub use limit::{JetBlock, LANES, WarpTracer};
pub use margin::RayLimit;
pub use single::{Ray, RayPolyline, TracedRay};
pub use slot::SurfaceParameter;
pub use step::GrinStepPlan;

use crate::lens::System;
use crate::lens::SystemError;
use crate::math::Real;
use gap::GrinGap;
use interface::Interface;

/// A system made ready for tracing: checked, with every constant of a surface worked out once.
#[derive(Debug, Clone)]
pub struct Tracer<R> {
    interfaces: Vec<Interface<R>>,
    index_before: R,
    /// The gradients of the gaps; empty for a lens of glass.
    grin_gaps: Vec<Option<GrinGap<R>>>,
    step_plans: Vec<GrinStepPlan>,
}

impl<R: Real> Tracer<R> {
    /// Prepares a system.
    ///
    /// # Errors
    /// Numbers that no ray can be traced with: see [`System::check`].
    pub fn new(system: &System<R>) -> Result<Self, SystemError> {
        system.check()?;
        let interfaces = interface::interfaces(system);
        let index_before = system.index_before;
        let mut tracer =
            Self { interfaces, index_before, grin_gaps: Vec::new(), step_plans: Vec::new() };
        if system.has_grin() {
            tracer.fill_grin_gaps(system)?;
        }
        Ok(tracer)
    }

    /// Fills the gaps of a system that have a gradient.
    fn fill_grin_gaps(&mut self, system: &System<R>) -> Result<(), SystemError> {
        for (i, surface) in system.surfaces.iter().enumerate() {
            let faces = self.interfaces.get(i).zip(self.interfaces.get(i + 1));
            let gap = match (surface.grin_profile(), faces) {
                (Some(field), Some((front, back))) => {
                    let (gap, plan) = GrinGap::new(field, i, [front, back])?;
                    self.step_plans.push(plan);
                    Some(gap)
                }
                _ => None,
            };
            self.grin_gaps.push(gap);
        }
        Ok(())
    }

    /// The steps in every gap with a gradient.
    pub fn grin_step_plans(&self) -> &[GrinStepPlan] {
        &self.step_plans
    }

    /// The same surfaces with no rim that clips. An asphere still ends where it was said to end:
    /// behind that its polynomial means nothing.
    #[must_use]
    pub fn without_rims(mut self) -> Self {
        for interface in &mut self.interfaces {
            (interface.rim2, interface.obstruction2) = (R::from_f64(f64::INFINITY), R::ZERO);
        }
        for gap in self.grin_gaps.iter_mut().flatten() {
            gap.side2 = R::from_f64(f64::INFINITY);
        }
        self
    }

    /// How many surfaces a ray crosses, the image plane included.
    pub fn surfaces(&self) -> usize {
        self.interfaces.len()
    }
}
