//! The settings of a tracer besides the field: integrator, step, start and end.

use super::integrator::Integrator;
use super::region::{Face, GrinRegion};
use crate::math::Real;
use serde::{Deserialize, Serialize};

/// The relation of a ray's initial speed to the index at its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaunchMode {
    /// `v` is used unchanged: correct where the index at the start is `|v|`.
    #[default]
    AsGiven,
    /// `v₀ = η(x₀) d`: light that starts inside the medium in the direction `d`.
    Scaled,
    /// Light comes from air and returns to air: it is refracted by Snell's law at its entry and
    /// exit. A ray that starts inside is used unchanged.
    Refracted,
}

/// The treatment of the last step at the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastStep {
    /// Back along the straight line from the first point outside. Of first order, which loses
    /// nothing on a trilinear grid.
    BrokenLine,
    /// The last step is shortened to end on the boundary, which preserves the order of the
    /// integrator.
    Fractional,
}

/// The condition that ends a ray.
#[derive(Debug, Clone, PartialEq)]
pub enum EndCondition<R> {
    /// After this number of steps.
    Steps(u32),
    /// At the boundary of a region.
    Boundary {
        /// The region in which the ray is traced.
        region: GrinRegion<R>,
        /// The treatment of the last step.
        last: LastStep,
        /// The number of steps after which the ray counts as trapped.
        limit: u32,
    },
}

/// The settings of a tracer.
#[derive(Debug, Clone, PartialEq)]
pub struct GrinSetup<R> {
    /// The splitting method.
    pub integrator: Integrator,
    /// The length of a step in σ; the ray moves by `η` times that.
    pub step: R,
    /// The relation of the initial speed to the index.
    pub launch: LaunchMode,
    /// The condition that ends a ray.
    pub end: EndCondition<R>,
    /// A screen in air behind the end, reached by a straight line.
    pub screen: Option<Face<R>>,
}

/// A setup that no ray can be traced with.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GrinSetupError {
    /// The step is not a positive number.
    #[error("a step of {0}, expected a positive number")]
    Step(f64),
    /// The largest number of steps is zero.
    #[error("rays of no steps")]
    NoSteps,
    /// The region is empty.
    #[error("the region is empty along {axis}")]
    EmptyRegion {
        /// `x`, `y` or `z`.
        axis: char,
    },
}

impl<R: Real> GrinSetup<R> {
    /// Checks that rays can be traced with these settings.
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

    /// True if the last step is shortened to end on the boundary.
    pub(super) fn is_fractional(&self) -> bool {
        matches!(self.end, EndCondition::Boundary { last: LastStep::Fractional, .. })
    }
}
