//! The settings of a slice: its plane, its quantity and its rays.

use crate::grin_design::{SlicePlane, SpatialAxis};
use serde::{Deserialize, Serialize};

/// The maximum number of rays of each view in a slice.
pub(super) const MAX_RAYS: usize = 60;

/// The quantity that a slice shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SliceQuantity {
    /// The refractive index.
    Index,
    /// The absolute value of its gradient, in 1/mm.
    Slope,
    /// The index minus that of the initial field.
    Change,
    /// The index minus that of the reference field.
    Error,
}

impl SliceQuantity {
    /// Every quantity.
    pub const ALL: [Self; 4] = [Self::Index, Self::Slope, Self::Change, Self::Error];

    /// The name of the quantity with its unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Index => "index",
            Self::Slope => "gradient of the index, 1/mm",
            Self::Change => "index minus the initial one",
            Self::Error => "index minus the reference",
        }
    }

    /// True if zero is in the middle of the scale of the quantity.
    pub const fn is_difference(self) -> bool {
        matches!(self, Self::Change | Self::Error)
    }
}

/// The settings of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SliceSettings {
    /// The plane of the slice.
    pub plane: SlicePlane,
    /// The quantity that it shows.
    pub quantity: SliceQuantity,
    /// The maximum number of rays of each view.
    pub rays: usize,
}

impl Default for SliceSettings {
    fn default() -> Self {
        let plane = SlicePlane { axis: SpatialAxis::Y, depth: 0.0 };
        Self { plane, quantity: SliceQuantity::Index, rays: 11 }
    }
}
