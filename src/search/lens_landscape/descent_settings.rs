//! Settings of the local moves of a search over lenses.

use super::LandscapeError;
use crate::math::format_short;
use crate::optimize::DescentMethod;
use serde::{Deserialize, Serialize};

/// The maximum number of steps, since a search cannot be stopped within a move.
const MAX_STEPS: usize = 10_000;

/// Settings of the local moves of a search over lenses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DescentSettings {
    /// The optimization method.
    pub method: DescentMethod,
    /// The maximum number of steps of a local move by penalties; all methods but Adam take fewer if the move
    /// converges. A move that keeps limits takes up to twelve times as many.
    pub steps: usize,
    /// The initial learning rate of Adam, in units in which a step of 1 changes the residuals by as
    /// much as they are.
    pub rate: f64,
    /// The relative tolerance of spot radii.
    pub tolerance: f64,
    /// The relative tolerance of spot radii in the first steps of a descent.
    pub coarse: f64,
    /// The number of steps with the coarse tolerance.
    pub coarse_steps: usize,
    /// True to vary semi-diameters.
    #[serde(rename = "rims")]
    pub semi_diameters: bool,
    /// True to vary the indices of model glasses.
    pub indices: bool,
}

impl Default for DescentSettings {
    fn default() -> Self {
        Self {
            method: DescentMethod::TrustRegion,
            steps: 20,
            rate: 0.015,
            tolerance: 1e-2,
            coarse: 1e-2,
            coarse_steps: 0,
            semi_diameters: true,
            indices: false,
        }
    }
}

impl DescentSettings {
    pub(super) fn check(&self) -> Result<(), LandscapeError> {
        let positive = [("the rate", self.rate), ("the tolerance", self.tolerance)];
        let positive = positive.into_iter().chain([("the coarse tolerance", self.coarse)]);
        for (what, value) in positive {
            if !(value > 0.0 && value < 1.0) {
                let expected = "more than 0 and less than 1";
                return Err(LandscapeError::Setting { what, found: format_short(value), expected });
            }
        }
        if !(1..=MAX_STEPS).contains(&self.steps) {
            let what = "the number of steps of a move";
            let (found, expected) = (self.steps.to_string(), "1 or more, at most 10000");
            return Err(LandscapeError::Setting { what, found, expected });
        }
        Ok(())
    }
}
