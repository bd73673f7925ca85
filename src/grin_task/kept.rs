//! Whether a field keeps what a maker can make: every limit with the value that stands against it.

use super::check::ROUNDING;
use super::medium::Medium;
use super::range::Bound;
use super::task::{Space, Task};
use crate::files::Volume;
use crate::grin::field::GridError;
use crate::math::Vec3;

/// A limit of a maker, and what the field makes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kept {
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

impl Kept {
    /// Whether the limit is kept, but for rounding.
    pub fn is_kept(&self) -> bool {
        self.margin >= -ROUNDING
    }
}

impl Task {
    /// Every place where light bends: the space of the task and those of its views.
    pub(super) fn spaces(&self) -> Vec<Space> {
        let mut spaces = vec![self.space];
        for space in self.views.iter().filter_map(|view| view.space) {
            if !spaces.contains(&space) {
                spaces.push(space);
            }
        }
        spaces
    }

    /// Every limit of a maker that the task sets, and how a field keeps it.
    pub fn kept(&self, medium: &Medium) -> Vec<Kept> {
        let spaces = self.spaces();
        let [low, high] = [Bound::Low, Bound::High].map(|bound| medium.extreme(&spaces, bound));
        let limits = self.limits;
        let index =
            [("lowest index", low, limits.low, 1.0), ("highest index", high, limits.high, -1.0)];
        let kept =
            |(name, (value, at), limit, sign): (&'static str, (f64, Vec3<f64>), f64, f64)| Kept {
                name,
                value,
                limit,
                margin: sign * (value - limit),
                at,
            };
        let slope = limits.slope.map(|slope| {
            let steepest = medium.steepest_at(self.space);
            kept(("slope", steepest, slope, -1.0))
        });
        index.into_iter().map(kept).chain(slope).collect()
    }

    /// The values of a field on a grid, as [`Medium::volume`] has them, put within the limits
    /// of the index: outside the space a spline may be anything.
    ///
    /// # Errors
    /// A space without extent.
    pub fn volume(&self, medium: &Medium, nodes: usize) -> Result<Volume, GridError> {
        let mut volume = medium.volume(self.space, nodes)?;
        let clamp = |value: &mut f64| *value = value.clamp(self.limits.low, self.limits.high);
        volume.values.iter_mut().for_each(clamp);
        Ok(volume)
    }
}
