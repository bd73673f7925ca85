//! How a ray in a gradient-index field ends.

use serde::Serialize;

/// How a ray ends. No ray is dropped silently: each has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
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

impl Fate {
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
    pub fn arrived(self) -> bool {
        matches!(self, Self::Left | Self::Stopped | Self::Turned)
    }
}

/// How many rays ended how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Fates([usize; Fate::ALL.len()]);

impl Fates {
    /// Counts one more.
    pub fn count(&mut self, fate: Fate) {
        self.0[fate as usize] += 1;
    }

    /// How many ended this way.
    pub fn of(self, fate: Fate) -> usize {
        self.0[fate as usize]
    }

    /// How many reached the end that was asked for.
    pub fn arrived(self) -> usize {
        Fate::ALL.into_iter().filter(|fate| fate.arrived()).map(|fate| self.of(fate)).sum()
    }

    /// How many ended how, of the ways that occurred.
    pub fn iter(self) -> impl Iterator<Item = (Fate, usize)> {
        Fate::ALL.into_iter().map(move |fate| (fate, self.of(fate))).filter(|(_, count)| *count > 0)
    }

    /// How many rays there are.
    pub fn total(self) -> usize {
        self.0.iter().sum()
    }
}

impl FromIterator<Fate> for Fates {
    fn from_iter<I: IntoIterator<Item = Fate>>(fates: I) -> Self {
        let mut counts = Self::default();
        fates.into_iter().for_each(|fate| counts.count(fate));
        counts
    }
}
