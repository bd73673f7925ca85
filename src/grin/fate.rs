//! How a ray in a gradient-index field ends.

use serde::Serialize;

/// How a ray ends. No ray is dropped silently: each has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GrinFate {
    /// It left the region.
    Left,
    /// It took the number of steps that was asked for.
    Stopped,
    /// It left the region against the direction in which it started.
    Turned,
    /// It was still inside after the largest number of steps: a closed orbit, or too small a limit.
    Trapped,
    /// It started outside the region, or on its boundary, and did not go in.
    NeverEntered,
    /// It left so flat that the straight line back from its last point misses the region.
    Grazing,
    /// It was totally reflected at the boundary.
    TotalReflection,
    /// It left, but not towards the screen.
    MissedScreen,
    /// Its retrace did not come back to its start: no digit of its gradient would be right.
    Chaotic,
    /// Its numbers overflowed.
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

    /// What it is called in files and reports.
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

    /// Whether the ray reached the end that was asked for, so that its exit can be differentiated.
    pub fn has_arrived(self) -> bool {
        matches!(self, Self::Left | Self::Stopped | Self::Turned)
    }
}

/// How many rays ended how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GrinFateCounts([usize; GrinFate::ALL.len()]);

impl GrinFateCounts {
    /// Counts one more.
    pub fn add(&mut self, fate: GrinFate) {
        self.0[fate as usize] += 1;
    }

    /// How many ended this way.
    pub fn count_of(self, fate: GrinFate) -> usize {
        self.0[fate as usize]
    }

    /// How many reached the end that was asked for.
    pub fn arrived_count(self) -> usize {
        GrinFate::ALL
            .into_iter()
            .filter(|fate| fate.has_arrived())
            .map(|fate| self.count_of(fate))
            .sum()
    }

    /// How many ended how, of the ways that occurred.
    pub fn iter(self) -> impl Iterator<Item = (GrinFate, usize)> {
        GrinFate::ALL
            .into_iter()
            .map(move |fate| (fate, self.count_of(fate)))
            .filter(|(_, count)| *count > 0)
    }

    /// How many rays there are.
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
