//! What a tracer needs to know besides the field: integrator, step, start and end.

use super::integrator::Integrator;
use super::region::{Face, GrinRegion};
use crate::math::Real;
use serde::{Deserialize, Serialize};

/// How a ray's speed is made to fit the index where it starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaunchMode {
    /// `v` is used as it is: right where the index at the start is `|v|`.
    #[default]
    AsGiven,
    /// `v₀ = η(x₀) d`: light that starts inside the medium in the direction `d`.
    Scaled,
    /// Light comes from air and goes back into air: it is refracted by Snell's law where it enters
    /// and where it leaves. A ray that starts inside is used as it is.
    Refracted,
}

/// How the last step meets the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastStep {
    /// Back along the straight line from the first point outside. Of first order, which on a
    /// trilinear grid loses nothing.
    BrokenLine,
    /// A last step of just the right length: keeps the order of the integrator.
    Fractional,
}

/// Where a ray ends.
#[derive(Debug, Clone, PartialEq)]
pub enum EndCondition<R> {
    /// After so many steps.
    Steps(u32),
    /// Where it leaves a region.
    Boundary {
        /// The region in which it is traced.
        region: GrinRegion<R>,
        /// How the last step meets the boundary.
        last: LastStep,
        /// After so many steps it counts as trapped.
        limit: u32,
    },
}

/// How rays are traced.
#[derive(Debug, Clone, PartialEq)]
pub struct GrinSetup<R> {
    /// The kind of step.
    pub integrator: Integrator,
    /// The length of a step in σ, a length; the ray moves by `η` times that.
    pub step: R,
    /// How the speed is made to fit the index at the start.
    pub launch: LaunchMode,
    /// Where rays end.
    pub end: EndCondition<R>,
    /// A screen in air behind the end, reached by a straight line.
    pub screen: Option<Face<R>>,
}

/// Why nothing can be traced with a setup.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GrinSetupError {
    /// The step is not a positive number.
    #[error("a step of {0}, expected a positive number")]
    Step(f64),
    /// No steps are allowed.
    #[error("rays of no steps")]
    NoSteps,
    /// The region contains nothing.
    #[error("the region is empty along {axis}")]
    EmptyRegion {
        /// `x`, `y` or `z`.
        axis: char,
    },
}

impl<R: Real> GrinSetup<R> {
    /// Refuses numbers that no ray can be traced with.
    pub(super) fn check(&self) -> Result<(), GrinSetupError> {
        if !(self.step > R::ZERO && self.step.is_finite()) {
            return Err(GrinSetupError::Step(self.step.value()));
        }
        if self.max_steps() == 0 {
            return Err(GrinSetupError::NoSteps);
        }
        let EndCondition::Boundary { region, .. } = &self.end else { return Ok(()) };
        let (low, high) = (region.low, region.high);
        let axes = [('x', low.x, high.x), ('y', low.y, high.y), ('z', low.z, high.z)];
        let empty = axes.into_iter().find(|(_, low, high)| !(low < high));
        empty.map_or(Ok(()), |(axis, ..)| Err(GrinSetupError::EmptyRegion { axis }))
    }

    /// The largest number of steps.
    pub(super) fn max_steps(&self) -> u32 {
        match self.end {
            EndCondition::Steps(limit) | EndCondition::Boundary { limit, .. } => limit,
        }
    }

    /// The region, if rays end at its boundary.
    pub(super) fn region(&self) -> Option<&GrinRegion<R>> {
        match &self.end {
            EndCondition::Steps(_) => None,
            EndCondition::Boundary { region, .. } => Some(region),
        }
    }

    /// Whether the last step is cut to length.
    pub(super) fn is_fractional(&self) -> bool {
        matches!(self.end, EndCondition::Boundary { last: LastStep::Fractional, .. })
    }
}
