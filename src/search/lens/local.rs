//! How a lens descends from one move to the next.

use super::LandscapeError;
use crate::math::format_short;
use crate::optimize::DescentMethod;
use serde::{Deserialize, Serialize};

/// No more steps than this: nothing ends a search within a move.
const MAX_STEPS: usize = 10_000;

/// How a lens descends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DescentSettings {
    /// What takes the steps.
    pub method: DescentMethod,
    /// Steps that a local move tries; least squares tries fewer where hardly anything is left to gain.
    pub steps: usize,
    /// The rate of Adam when a descent begins: a step of one alters the residuals by as much as
    /// they are.
    pub rate: f64,
    /// The error allowed of the radius of a spot, relatively.
    pub tolerance: f64,
    /// The same for the first steps of a descent.
    pub coarse: f64,
    /// For how many steps.
    pub coarse_steps: usize,
    /// Whether rims are free.
    pub rims: bool,
    /// Whether the indices of model glasses are free.
    pub indices: bool,
}

impl Default for DescentSettings {
    fn default() -> Self {
        Self {
            method: DescentMethod::DampedLeastSquares,
            steps: 20,
            rate: 0.015,
            tolerance: 1e-2,
            coarse: 1e-2,
            coarse_steps: 0,
            rims: true,
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
