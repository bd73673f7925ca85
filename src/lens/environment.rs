//! The surroundings of a lens: its temperature, and the mount that holds it.

use super::LensError;
use super::check::check_number;
use super::glass::THERMAL_RANGE;
use serde::{Deserialize, Serialize};

/// The temperature in °C at which a lens is made, and about which catalogues give their indices.
pub const ROOM_CELSIUS: f64 = 20.0;
/// The expansion of aluminium, in 1e-6/K.
const ALUMINIUM: f64 = 23.6;

/// The temperature of a lens and the expansion of its mount.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// The temperature in °C for which the prescription holds, at which glasses have their indices;
    /// `None` for that of their catalogues.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub celsius: Option<f64>,
    /// The linear expansion of the mount, in 1e-6/K.
    pub mount_expansion: f64,
}

impl Default for Environment {
    fn default() -> Self {
        Self { celsius: None, mount_expansion: ALUMINIUM }
    }
}

impl Environment {
    /// True for the surroundings of a lens that says nothing of them.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The temperature in °C.
    pub fn temperature(&self) -> f64 {
        self.celsius.unwrap_or(ROOM_CELSIUS)
    }

    /// Checks both numbers.
    pub(super) fn check(&self) -> Result<(), LensError> {
        check_celsius(self.temperature())?;
        let found = self.mount_expansion;
        let is_valid = (-10.0..=1000.0).contains(&found);
        check_number("expansion of the mount", found, is_valid, "1e-6/K, from -10 to 1000")
    }
}

/// Checks a temperature in °C, for which the indices of glasses are known.
pub(super) fn check_celsius(celsius: f64) -> Result<(), LensError> {
    let [low, high] = THERMAL_RANGE;
    let is_valid = (low..=high).contains(&celsius);
    check_number("temperature", celsius, is_valid, "from -100 to 140 °C")
}
