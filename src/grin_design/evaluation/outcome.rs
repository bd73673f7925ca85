//! The outcome of rays: the valid ones, and the excluded ones by reason.

use crate::grin::{GrinFateCounts, RayExit};

/// A ray with a smaller cosine at its exit is excluded: the derivative of its exit grows as the
/// inverse.
pub(super) const MIN_COSINE: f64 = 0.05;
/// True if a ray contributes to the loss.
pub(in crate::grin_design) fn is_valid(exit: &RayExit<f64>) -> bool {
    exit.fate.has_arrived() && exit.cosine.abs() >= MIN_COSINE
}

/// The outcomes of rays: the excluded ones by reason, and the valid ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// The number of rays with each fate.
    pub fates: GrinFateCounts,
    /// Rays that arrived at such grazing incidence that their derivative is worthless.
    pub flat: usize,
    /// Rays that are not traced: their target could not be measured.
    pub unmeasured: usize,
}

/// The fates of rays, and the number of those that left at grazing incidence.
pub(super) fn count_rays(exits: &[RayExit<f64>]) -> RayCounts {
    let fates = exits.iter().map(|exit| exit.fate).collect();
    let is_flat = |exit: &&RayExit<f64>| exit.fate.has_arrived() && !is_valid(exit);
    RayCounts { fates, flat: exits.iter().filter(is_flat).count(), unmeasured: 0 }
}

impl RayCounts {
    /// The number of all rays.
    pub fn total(self) -> usize {
        self.fates.total() + self.unmeasured
    }

    /// The number of valid rays.
    pub fn valid(self) -> usize {
        self.fates.arrived_count() - self.flat
    }

    /// The excluded rays, by reason.
    pub fn excluded(self) -> impl Iterator<Item = (&'static str, usize)> {
        let more = [("flat", self.flat), ("unmeasured", self.unmeasured)];
        let lost = self.fates.iter().filter(|(fate, _)| !fate.has_arrived());
        let lost = lost.map(|(fate, count)| (fate.name(), count));
        lost.chain(more.into_iter().filter(|(_, count)| *count > 0))
    }

    /// The sum of two counts.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let mut both = self;
        for (fate, count) in other.fates.iter() {
            (0..count).for_each(|_| both.fates.add(fate));
        }
        both.flat += other.flat;
        both.unmeasured += other.unmeasured;
        both
    }
}
