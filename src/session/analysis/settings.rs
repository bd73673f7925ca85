//! The settings of the analyses.

use crate::effects::EffectOverrides;
use serde::{Deserialize, Serialize};

/// The settings of the analyses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnalysisSettings {
    /// The relative error allowed of the numbers.
    pub tolerance: f64,
    /// The index of the zoom position.
    pub zoom: usize,
    /// The number of rays of each field in the layout.
    pub rays: usize,
    /// The effects that are not left to the plan.
    pub overrides: EffectOverrides,
    /// True if the pupils are computed, because a panel shows them.
    pub pupils: bool,
    /// The index of the wavelength of the pupils; `None` for the primary one.
    pub pupil_wavelength: Option<usize>,
}

impl Default for AnalysisSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            zoom: 0,
            rays: 15,
            overrides: EffectOverrides::default(),
            pupils: false,
            pupil_wavelength: None,
        }
    }
}
