//! How a lens descends from one move to the next.

use super::NoLandscape;
use crate::math::brief;
use crate::optimize::Method;
use serde::{Deserialize, Serialize};

/// No more steps than this: nothing ends a search within a move.
const MOST_STEPS: usize = 10_000;

/// How a lens descends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Local {
    /// What takes the steps.
    pub method: Method,
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

impl Default for Local {
    fn default() -> Self {
        Self {
            method: Method::DampedLeastSquares,
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

impl Local {
    pub(super) fn check(&self) -> Result<(), NoLandscape> {
        let positive = [("the rate", self.rate), ("the tolerance", self.tolerance)];
        let positive = positive.into_iter().chain([("the coarse tolerance", self.coarse)]);
        for (what, value) in positive {
            if !(value > 0.0 && value < 1.0) {
                let expected = "more than 0 and less than 1";
                return Err(NoLandscape::Setting { what, found: brief(value), expected });
            }
        }
        if !(1..=MOST_STEPS).contains(&self.steps) {
            let what = "the number of steps of a move";
            let (found, expected) = (self.steps.to_string(), "1 or more, at most 10000");
            return Err(NoLandscape::Setting { what, found, expected });
        }
        Ok(())
    }
}
