//! The pages of panels that show one of several results: only that one is computed.

use serde::{Deserialize, Serialize};

/// A page of the panel of results over the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldPage {
    /// Distortion, field curvature, lateral colour and illumination over the field.
    #[default]
    Curves,
    /// Crossings with the axis over the pupil, and axial colour.
    Longitudinal,
    /// The image of a square grid.
    Grid,
}

/// A page of the panel of contrast.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContrastPage {
    /// Against spatial frequency.
    #[default]
    Frequency,
    /// Against the height of the field.
    Field,
    /// Against the shift of the image plane.
    Focus,
}
