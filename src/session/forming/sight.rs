//! How a person looks at a field: which slice, which quantity, how many rays.

use crate::grin_design::{SlicePlane, SpatialAxis};
use serde::{Deserialize, Serialize};

/// Most rays of each view in a slice.
pub(super) const MAX_RAYS: usize = 60;

/// What a slice shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SliceQuantity {
    /// The refractive index.
    Index,
    /// How steep it is, in 1/mm.
    Slope,
    /// Its difference from the field at the start.
    Change,
    /// Its difference from the field that is known to be the answer.
    Error,
}

impl SliceQuantity {
    /// Every quantity.
    pub const ALL: [Self; 4] = [Self::Index, Self::Slope, Self::Change, Self::Error];

    /// What it is called, with its unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Index => "index",
            Self::Slope => "slope of the index, 1/mm",
            Self::Change => "index less that at the start",
            Self::Error => "index less the exact one",
        }
    }

    /// Whether zero lies in the middle of its scale.
    pub const fn is_difference(self) -> bool {
        matches!(self, Self::Change | Self::Error)
    }
}

/// How a person looks at a field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SliceSettings {
    /// The slice.
    pub plane: SlicePlane,
    /// What it shows.
    pub quantity: SliceQuantity,
    /// Most rays of each view.
    pub rays: usize,
}

impl Default for SliceSettings {
    fn default() -> Self {
        let plane = SlicePlane { axis: SpatialAxis::Y, depth: 0.0 };
        Self { plane, quantity: SliceQuantity::Index, rays: 11 }
    }
}
