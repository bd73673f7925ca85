//! Which physical effects a lens calls for, each decision with the number it rests on.

use serde::{Deserialize, Serialize};

/// A physical effect that costs time and may not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// The index of glass depends on the wavelength: more than one wavelength is traced.
    Dispersion,
    /// A figured surface is met by iteration.
    Asphere,
    /// Rays are lost at rims.
    Clipping,
    /// Rays are lost by total reflection.
    TotalReflection,
    /// Rays are aimed at the real stop, not at its paraxial image.
    Aiming,
    /// The object is so near that its rays are not parallel.
    FiniteObject,
}

/// Whether an effect is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// As planned from the lens.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}
