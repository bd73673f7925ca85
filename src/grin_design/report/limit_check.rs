//! The manufacturing limits of a task, compared with a field.

use super::difference::FieldExtremes;
use crate::files::Volume;
use crate::grin::field::GridError;
use crate::grin_design::field::GrinField;
use crate::grin_design::task::checks::INDEX_ROUNDING;
use crate::grin_design::task::{Domain, GrinTask};
use crate::math::Vec3;

/// A manufacturing limit, compared with a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitCheck {
    /// The limited quantity: `lowest index`, `highest index` or `slope`, the last in 1/mm.
    pub name: &'static str,
    /// The extreme value of the field.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// The distance from the limit; negative where the limit is violated.
    pub margin: f64,
    /// The position of the extreme value, in mm.
    pub at: Vec3<f64>,
}

impl LimitCheck {
    /// True if the limit is satisfied, up to rounding.
    pub fn is_satisfied(&self) -> bool {
        self.margin >= -INDEX_ROUNDING
    }
}

impl GrinTask {
    /// Every domain in which light is refracted: that of the task and those of its views.
    pub(in crate::grin_design) fn spaces(&self) -> Vec<Domain> {
        let mut spaces = vec![self.space];
        for space in self.views.iter().filter_map(|view| view.space) {
            if !spaces.contains(&space) {
                spaces.push(space);
            }
        }
        spaces
    }

    /// Every manufacturing limit of the task, compared with a field of these extremes.
    pub fn limit_checks(&self, found: &FieldExtremes) -> Vec<LimitCheck> {
        let limits = self.limits;
        let [low, high, steepest] = found.at;
        let at_least =
            |name, value, limit, at| LimitCheck { name, value, limit, margin: value - limit, at };
        let at_most =
            |name, value, limit, at| LimitCheck { name, value, limit, margin: limit - value, at };
        let slope = limits.slope.map(|slope| at_most("slope", found.slope, slope, steepest));
        let index = [
            at_least("lowest index", found.low, limits.low, low),
            at_most("highest index", found.high, limits.high, high),
        ];
        index.into_iter().chain(slope).collect()
    }

    /// The values of a field on a grid, as in [`GrinField::volume`], clamped to the limits of the
    /// index: outside the domain a spline is not limited.
    ///
    /// # Errors
    /// A domain without extent.
    pub fn volume(&self, field: &GrinField, nodes: usize) -> Result<Volume, GridError> {
        let mut volume = field.volume(self.space, nodes)?;
        let clamp = |value: &mut f64| *value = value.clamp(self.limits.low, self.limits.high);
        volume.values.iter_mut().for_each(clamp);
        Ok(volume)
    }
}
