//! Real rays through a resolved lens: propagation to the next surface, intersection, refraction.
//!
//! After Spencer and Murty, "General Ray-Tracing Procedure", JOSA 52 (1962), with the optical
//! direction `k = n (L, M, N)` in place of the direction cosines (Feder, JOSA 41, 1951): Snell's
//! law becomes `k' = k + Γ N`, and no index ratio is needed. A ray that does not arrive ends with
//! a [`Fate`] that names the surface and the cause.
//!
//! The sense of travel σ, which starts at +1 and changes its sign at every mirror, decides which of
//! several intersections counts: the one with `σ k·N > 0`. The sign of `N` does not: light that
//! reaches the front lens of a fisheye from behind still travels forwards.
//!
//! A gap is a propagator (`propagation`): straight lines in a homogeneous medium, steps of an
//! integrator in a GRIN medium (`grin_gap`). Derivatives are forward, by dual numbers in place of
//! plain ones, or backward, by the adjoint of a block of rays (`adjoint`).

mod adjoint;
mod aperture;
mod asphere;
mod asphere_crossing;
mod batch;
mod deflection;
mod edge;
mod fate;
mod freeform;
mod grin_gap;
mod interface;
mod limit;
mod margin;
mod margin_batch;
mod mount;
mod propagation;
mod single;
mod surface_parameter;

pub use crate::math::SimdWidth;
pub use adjoint::{
    AdjointSeed, ErrorDirections, ErrorNumber, ErrorRows, ErrorSlopes, SurfaceGradient,
    SystemGradient,
};
pub use batch::{ImagePoints, Landings, Rays, TraceSink};
pub use fate::{Fate, Fates};
pub use grin_gap::GrinStepPlan;
pub use limit::{JetBlock, LANES, WarpTracer};
pub use margin::RayLimit;
pub use single::{Ray, RayPolyline, TracedRay};
pub use surface_parameter::SurfaceParameter;

use crate::lens::{System, SystemError};
use crate::math::Real;
use aperture::LensApertures;
use grin_gap::GrinGap;
use interface::Interface;
use mount::Mount;

/// The permitted error of a ray behind a gap with a GRIN medium, as a part of the length of the gap.
const GRIN_TOLERANCE: f64 = 1e-11;

/// A system prepared for tracing: checked, with every constant of a surface computed once.
#[derive(Debug, Clone)]
pub struct Tracer<R> {
    interfaces: Vec<Interface<R>>,
    index_before: R,
    /// The GRIN media of the gaps; empty for a lens without any.
    grin_gaps: Vec<Option<GrinGap<R>>>,
    step_plans: Vec<GrinStepPlan>,
    /// The poses and irregularities of the surfaces; empty for a centred lens.
    mounts: Vec<Option<Mount<R>>>,
    /// The apertures that are no circles about the vertex.
    apertures: LensApertures<R>,
}

impl<R: Real> Tracer<R> {
    /// Prepares a system.
    ///
    /// # Errors
    /// A number that cannot be traced with (see [`System::check`]), or a GRIN medium that is too
    /// strong.
    pub fn new(system: &System<R>) -> Result<Self, SystemError> {
        Self::with_grin_tolerance(system, GRIN_TOLERANCE)
    }

    /// Prepares a system whose rays through GRIN media may be wrong by a part of the length of a gap: in their place
    /// behind it, and in their direction times that length. Fewer steps are faster.
    ///
    /// # Errors
    /// As of [`Tracer::new`].
    pub fn with_grin_tolerance(system: &System<R>, tolerance: f64) -> Result<Self, SystemError> {
        system.check()?;
        let interfaces = interface::interfaces(system);
        let index_before = system.index_before;
        let mut tracer = Self {
            interfaces,
            index_before,
            grin_gaps: Vec::new(),
            step_plans: Vec::new(),
            mounts: Vec::new(),
            apertures: LensApertures::new(&system.surfaces),
        };
        tracer.mounts = mount::mounts(system, &tracer.interfaces);
        if system.has_grin() {
            tracer.fill_grin_gaps(system, tolerance)?;
        }
        Ok(tracer)
    }

    /// Prepares the gaps with a GRIN medium.
    fn fill_grin_gaps(&mut self, system: &System<R>, tolerance: f64) -> Result<(), SystemError> {
        for (i, surface) in system.surfaces.iter().enumerate() {
            let faces = self.interfaces.get(i).zip(self.interfaces.get(i + 1));
            let gap = match (surface.grin_profile(), faces) {
                (Some(field), Some((front, back))) => {
                    let (gap, plan) = GrinGap::new(field, i, [front, back], tolerance)?;
                    self.step_plans.push(plan);
                    Some(gap)
                }
                _ => None,
            };
            self.grin_gaps.push(gap);
        }
        Ok(())
    }

    /// The steps in every gap with a GRIN medium.
    pub fn grin_step_plans(&self) -> &[GrinStepPlan] {
        &self.step_plans
    }

    /// The same surfaces without rims, obstructions and apertures that clip. The intersection with an asphere is
    /// still sought inside its semi-diameter first, since its polynomial has no meaning outside.
    #[must_use]
    pub fn without_rims(mut self) -> Self {
        for interface in &mut self.interfaces {
            (interface.rim2, interface.obstruction2) = (R::from_f64(f64::INFINITY), R::ZERO);
        }
        for gap in self.grin_gaps.iter_mut().flatten() {
            gap.side2 = R::from_f64(f64::INFINITY);
        }
        self.apertures = self.apertures.opened();
        self
    }

    /// The surfaces up to and including one. A ray that gets through ends there.
    #[must_use]
    pub fn up_to(&self, surface: usize) -> Self {
        self.first_surfaces((surface + 1).min(self.interfaces.len()))
    }

    fn first_surfaces(&self, count: usize) -> Self {
        Self {
            interfaces: self.interfaces[..count].to_vec(),
            index_before: self.index_before,
            grin_gaps: self.grin_gaps.iter().take(count).cloned().collect(),
            step_plans: Vec::new(),
            mounts: self.mounts.iter().take(count).cloned().collect(),
            apertures: self.apertures.first(count),
        }
    }

    /// The number of surfaces, including the image plane.
    pub fn surfaces(&self) -> usize {
        self.interfaces.len()
    }
}
