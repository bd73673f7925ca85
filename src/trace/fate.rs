//! The fate of a ray: it arrives, or it is lost for a cause at a surface.

use serde::Serialize;

/// The fate of a ray, with the index of the surface at which it ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Fate {
    /// The ray reaches the last surface.
    Imaged,
    /// The ray misses the surface, or an asphere is so wild that no intersection is found.
    Missed(u32),
    /// The ray meets the surface outside the semi-diameter or another aperture, or inside the obstruction or
    /// another obscuration, or it leaves the GRIN medium in front through its side.
    Clipped(u32),
    /// The ray is totally reflected at the surface, or no light is in the order of a grating, which is
    /// evanescent.
    TotalReflection(u32),
    /// The GRIN medium in front of the surface turns the ray back.
    Turned(u32),
    /// The ray is still in the GRIN medium in front of the surface after the largest number of steps,
    /// or reaches a point where that has no index.
    Trapped(u32),
}

impl Fate {
    /// The name of the kind of fate in files and reports.
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

    /// The index of the surface at which the ray is lost; `None` for a ray that arrives.
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

    /// True if the ray arrives.
    pub fn is_imaged(self) -> bool {
        self == Self::Imaged
    }

    /// The fate of a code of the kernels: 0 for a ray on its way, else
    /// `CAUSES_PER_SURFACE surface + cause`.
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
/// The number of codes for each surface.
const CAUSES_PER_SURFACE: u32 = 8;

/// The code of a cause at a surface.
pub(super) fn encode(surface: u32, cause: u32) -> u32 {
    CAUSES_PER_SURFACE * surface + cause
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The number of rays of each fate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Fates {
    /// Rays that arrive.
    pub imaged: usize,
    /// Rays that miss a surface.
    pub missed: usize,
    /// Rays that are clipped.
    pub clipped: usize,
    /// Rays that are totally reflected.
    pub total_reflection: usize,
    /// Rays that a GRIN medium turns back.
    #[serde(skip_serializing_if = "is_zero")]
    pub turned: usize,
    /// Rays that a GRIN medium traps.
    #[serde(skip_serializing_if = "is_zero")]
    pub trapped: usize,
}

impl Fates {
    /// Counts one more ray.
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

    /// Counts the rays of another set too.
    pub fn add(&mut self, other: Self) {
        self.imaged += other.imaged;
        self.missed += other.missed;
        self.clipped += other.clipped;
        self.total_reflection += other.total_reflection;
        self.turned += other.turned;
        self.trapped += other.trapped;
    }

    /// The number of all rays.
    pub fn total(self) -> usize {
        let lost = self.missed + self.clipped + self.total_reflection;
        self.imaged + lost + self.turned + self.trapped
    }
}
