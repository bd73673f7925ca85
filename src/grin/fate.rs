//! The fate of a ray in a gradient-index field.

use serde::Serialize;

/// The fate of a ray in a gradient-index field. No ray is dropped silently: each has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GrinFate {
    /// The ray left the region.
    Left,
    /// The ray took the requested number of steps.
    Stopped,
    /// The ray left the region against the direction in which it started.
    Turned,
    /// The ray was still inside after the largest number of steps: a closed orbit, or a limit that
    /// is too small.
    Trapped,
    /// The ray started outside the region, or on its boundary, and did not enter it.
    NeverEntered,
    /// The ray left at such grazing incidence that the straight line back from its last point
    /// misses the region.
    Grazing,
    /// The ray was totally reflected at the boundary.
    TotalReflection,
    /// The ray left the region, but not towards the screen.
    MissedScreen,
    /// The retraced ray did not return to its start: no digit of its gradient would be correct.
    Chaotic,
    /// The state of the ray overflowed.
    Diverged,
}

impl GrinFate {
    /// Every fate.
    pub const ALL: [Self; 10] = [
        Self::Left,
        Self::Stopped,
        Self::Turned,
        Self::Trapped,
        Self::NeverEntered,
        Self::Grazing,
        Self::TotalReflection,
        Self::MissedScreen,
        Self::Chaotic,
        Self::Diverged,
    ];

    /// The name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Stopped => "stopped",
            Self::Turned => "turned",
            Self::Trapped => "trapped",
            Self::NeverEntered => "never_entered",
            Self::Grazing => "grazing",
            Self::TotalReflection => "total_reflection",
            Self::MissedScreen => "missed_screen",
            Self::Chaotic => "chaotic",
            Self::Diverged => "diverged",
        }
    }

    /// True if the ray reached the requested end, so that its exit can be differentiated.
    pub fn has_arrived(self) -> bool {
        matches!(self, Self::Left | Self::Stopped | Self::Turned)
    }
}

/// The number of rays with each fate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GrinFateCounts([usize; GrinFate::ALL.len()]);

impl GrinFateCounts {
    /// Counts one more ray with this fate.
    pub fn add(&mut self, fate: GrinFate) {
        self.0[fate as usize] += 1;
    }

    /// The number of rays with this fate.
    pub fn count_of(self, fate: GrinFate) -> usize {
        self.0[fate as usize]
    }

    /// The number of rays that reached the requested end.
    pub fn arrived_count(self) -> usize {
        GrinFate::ALL
            .into_iter()
            .filter(|fate| fate.has_arrived())
            .map(|fate| self.count_of(fate))
            .sum()
    }

    /// The fates that occurred, with the number of rays of each.
    pub fn iter(self) -> impl Iterator<Item = (GrinFate, usize)> {
        GrinFate::ALL
            .into_iter()
            .map(move |fate| (fate, self.count_of(fate)))
            .filter(|(_, count)| *count > 0)
    }

    /// The total number of rays.
    pub fn total(self) -> usize {
        self.0.iter().sum()
    }
}

impl FromIterator<GrinFate> for GrinFateCounts {
    fn from_iter<I: IntoIterator<Item = GrinFate>>(fates: I) -> Self {
        let mut counts = Self::default();
        fates.into_iter().for_each(|fate| counts.add(fate));
        counts
    }
}
