//! What a search may do to a lens, and what a factory can make.

use super::Kind;
use serde::{Deserialize, Serialize};

/// The limits of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rules {
    /// The smallest and the largest number of glass elements.
    pub elements: [usize; 2],
    /// The glasses that new elements may be made of, by maker and name; none allows all of the
    /// catalogue.
    pub glasses: Vec<String>,
    /// The first and last surface, counted from 0, that mutations may touch; none allows all.
    pub surfaces: Option<[usize; 2]>,
    /// How often each kind of mutation is tried, relatively; a kind that is not listed has 1, and 0
    /// forbids it.
    pub weights: Vec<(Kind, f64)>,
    /// Whether a mutation is made paraxially equivalent: section 4.5.
    pub projection: bool,
    /// The smallest and largest thickness of glass on the axis, in mm.
    pub glass_center: [f64; 2],
    /// The smallest thickness of glass at the rim, in mm.
    pub glass_edge: f64,
    /// The smallest and largest thickness of air on the axis, in mm.
    pub air_center: [f64; 2],
    /// The smallest thickness of air at the rim, in mm.
    pub air_edge: f64,
    /// The largest `|curvature| × semi-diameter`; 1 is a hemisphere.
    pub steepness: f64,
    /// The largest semi-diameter, in mm; none allows what neighbouring surfaces leave.
    pub semi_diameter: Option<f64>,
    /// The longest track, from the first vertex to the image, in mm.
    pub track: Option<f64>,
    /// The shortest back focus, in mm.
    pub back_focus: Option<f64>,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            elements: [2, 8],
            glasses: Vec::new(),
            surfaces: None,
            weights: Vec::new(),
            projection: true,
            glass_center: [1.0, 30.0],
            glass_edge: 0.8,
            air_center: [0.1, 100.0],
            air_edge: 0.05,
            steepness: 0.9,
            semi_diameter: None,
            track: None,
            back_focus: None,
        }
    }
}

impl Rules {
    /// How often a kind of mutation is tried, relatively.
    pub fn weight(&self, kind: Kind) -> f64 {
        let listed = self.weights.iter().find(|(listed, _)| *listed == kind);
        listed.map_or(1.0, |(_, weight)| *weight)
    }
}
