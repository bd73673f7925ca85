//! What "better" means: a sum of weighted terms, each with its derivative for every variable.

use serde::{Deserialize, Serialize};

/// What an optimization aims at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The terms that are summed.
    pub terms: Vec<Weighted>,
}

/// A term and its weight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weighted {
    /// The term.
    pub term: Term,
    /// Its factor in the sum.
    pub weight: f64,
}

/// One thing that a lens is asked for. Every term is a sum of squares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Term {
    /// The mean square radius of the spots about their centroids, over fields, wavelengths and
    /// zoom positions by weight, in mm².
    Spot,
    /// The square of the deviation of the focal length from this, in mm².
    FocalLength(f64),
    /// The mean square of the distance of the chief rays' image points from `f tan θ`, in mm².
    Distortion,
    /// Glass thinner or thicker than this on the axis, in mm².
    GlassCenter {
        /// Not thinner than this.
        min: f64,
        /// Not thicker than this.
        max: f64,
    },
    /// Glass thinner than this at the rim, in mm².
    GlassEdge(f64),
    /// Air thinner or thicker than this on the axis, in mm².
    AirCenter {
        /// Not thinner than this.
        min: f64,
        /// Not thicker than this.
        max: f64,
    },
    /// Air thinner than this at the rim, in mm².
    AirEdge(f64),
    /// From the first vertex to the image longer than this, in mm².
    TotalTrack(f64),
    /// From the last vertex to the image shorter than this, in mm².
    BackFocus(f64),
}
