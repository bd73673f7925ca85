//! Whether a field keeps what a maker can make: every limit with the value that stands against it.

use super::check::INDEX_ROUNDING;
use super::compare::FieldExtremes;
use super::medium::GrinField;
use super::task::{Domain, GrinTask};
use crate::files::Volume;
use crate::grin::field::GridError;
use crate::math::Vec3;

/// A limit of a maker, and what the field makes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitCheck {
    /// What is limited: `lowest index`, `highest index` or `slope`, the last in 1/mm.
    pub name: &'static str,
    /// The worst that the field has.
    pub value: f64,
    /// What it may be.
    pub limit: f64,
    /// What is left; below 0 where the limit is broken.
    pub margin: f64,
    /// Where that is, in mm.
    pub at: Vec3<f64>,
}

impl LimitCheck {
    /// Whether the limit is kept, but for rounding.
    pub fn is_satisfied(&self) -> bool {
        self.margin >= -INDEX_ROUNDING
    }
}

impl GrinTask {
    /// Every place where light bends: the space of the task and those of its views.
    pub(super) fn spaces(&self) -> Vec<Domain> {
        let mut spaces = vec![self.space];
        for space in self.views.iter().filter_map(|view| view.space) {
            if !spaces.contains(&space) {
                spaces.push(space);
            }
        }
        spaces
    }

    /// Every limit of a maker that the task sets, and how a field with these extremes keeps it.
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

    /// The values of a field on a grid, as [`GrinField::volume`] has them, put within the limits
    /// of the index: outside the space a spline may be anything.
    ///
    /// # Errors
    /// A space without extent.
    pub fn volume(&self, medium: &GrinField, nodes: usize) -> Result<Volume, GridError> {
        let mut volume = medium.volume(self.space, nodes)?;
        let clamp = |value: &mut f64| *value = value.clamp(self.limits.low, self.limits.high);
        volume.values.iter_mut().for_each(clamp);
        Ok(volume)
    }
}
