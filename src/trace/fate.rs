//! How a ray ends.

use serde::Serialize;

/// How a ray ends, and at which surface (counted from 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Fate {
    /// It reaches the last surface.
    Imaged,
    /// It does not meet the surface.
    Missed(u32),
    /// It meets the surface outside the semi-diameter or inside the obstruction, or it leaves the
    /// gradient in front of it through its side.
    Clipped(u32),
    /// It is totally reflected.
    TotalReflection(u32),
    /// The gradient in front of the surface turns it back to where it came from.
    Turned(u32),
    /// It is still in the gradient in front of the surface after the largest number of steps, or
    /// where that has no index.
    Trapped(u32),
}

impl Fate {
    /// What this kind of end is called in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Imaged => "imaged",
            Self::Missed(_) => "missed",
            Self::Clipped(_) => "clipped",
            Self::TotalReflection(_) => "total_reflection",
            Self::Turned(_) => "turned",
            Self::Trapped(_) => "trapped",
        }
    }

    /// The surface at which the ray was lost; `None` for one that arrived.
    pub fn surface(self) -> Option<usize> {
        match self {
            Self::Imaged => None,
            Self::Missed(i)
            | Self::Clipped(i)
            | Self::TotalReflection(i)
            | Self::Turned(i)
            | Self::Trapped(i) => Some(i as usize),
        }
    }

    /// Whether the ray arrived.
    pub fn is_imaged(self) -> bool {
        self == Self::Imaged
    }

    /// The number that stands for a cause at a surface inside the kernels: 0 for a ray on its way,
    /// else `CAUSES_PER_SURFACE surface + cause`.
    pub(super) fn from_code(code: u32) -> Self {
        let surface = code / CAUSES_PER_SURFACE;
        match code % CAUSES_PER_SURFACE {
            MISSED => Self::Missed(surface),
            CLIPPED => Self::Clipped(surface),
            TOTAL_REFLECTION => Self::TotalReflection(surface),
            TURNED => Self::Turned(surface),
            TRAPPED => Self::Trapped(surface),
            _ => Self::Imaged,
        }
    }
}

pub(super) const MISSED: u32 = 1;
pub(super) const CLIPPED: u32 = 2;
pub(super) const TOTAL_REFLECTION: u32 = 3;
pub(super) const TURNED: u32 = 4;
pub(super) const TRAPPED: u32 = 5;
/// Room for causes at each surface.
const CAUSES_PER_SURFACE: u32 = 8;

/// The number that stands for a cause at a surface.
pub(super) fn encode(surface: u32, cause: u32) -> u32 {
    CAUSES_PER_SURFACE * surface + cause
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_none(count: &usize) -> bool {
    *count == 0
}

/// How many rays ended how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Fates {
    /// Arrived.
    pub imaged: usize,
    /// Missed a surface.
    pub missed: usize,
    /// Clipped by a semi-diameter or an obstruction.
    pub clipped: usize,
    /// Totally reflected.
    pub total_reflection: usize,
    /// Turned back by a gradient.
    #[serde(skip_serializing_if = "is_none")]
    pub turned: usize,
    /// Kept by a gradient.
    #[serde(skip_serializing_if = "is_none")]
    pub trapped: usize,
}

impl Fates {
    /// Counts one more.
    pub fn count(&mut self, fate: Fate) {
        match fate {
            Fate::Imaged => self.imaged += 1,
            Fate::Missed(_) => self.missed += 1,
            Fate::Clipped(_) => self.clipped += 1,
            Fate::TotalReflection(_) => self.total_reflection += 1,
            Fate::Turned(_) => self.turned += 1,
            Fate::Trapped(_) => self.trapped += 1,
        }
    }

    /// How many rays there are.
    pub fn total(self) -> usize {
        let lost = self.missed + self.clipped + self.total_reflection;
        self.imaged + lost + self.turned + self.trapped
    }
}
