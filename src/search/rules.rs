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
    /// How many surfaces at the front and at the rear mutations leave alone. They are counted from
    /// the ends, so that they stay the same ones while elements come and go between them.
    pub kept: [usize; 2],
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
            kept: [0, 0],
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

    /// The same rules for mutations that touch only the surfaces `first` to `last` of a lens of so
    /// many rows.
    #[must_use]
    pub fn touching(mut self, first: usize, last: usize, rows: usize) -> Self {
        self.kept = [first, rows.saturating_sub(last + 1)];
        self
    }

    /// Whether mutations may touch a surface of a lens of so many rows.
    pub fn allow(&self, surface: usize, rows: usize) -> bool {
        surface >= self.kept[0] && surface + self.kept[1] < rows
    }
}
