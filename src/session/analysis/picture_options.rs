//! The options of the picture of the window: focus, exposure, light, what takes light away, and how well.

use crate::analysis::Coating;
use crate::picture::{BuiltInScene, FocusGroup, SensorPreset};
use serde::{Deserialize, Serialize};

/// The way in which the lens is focused for a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureFocus {
    /// As the lens is written; a scene with depth is focused at 1 m where that is infinity.
    #[default]
    Design,
    /// At a distance in mm in front of the first surface, by moving the image plane.
    ImagePlane(f64),
    /// At a distance in mm, by moving the surfaces from the first to the last of these indices.
    Group {
        /// The distance in front of the first surface, in mm.
        distance: f64,
        /// The index of the first surface of the group.
        first: usize,
        /// The index of the last surface of the group.
        last: usize,
    },
}

impl PictureFocus {
    /// The distance in mm; `None` for the one of the design.
    pub const fn distance(self) -> Option<f64> {
        match self {
            Self::Design => None,
            Self::ImagePlane(distance) | Self::Group { distance, .. } => Some(distance),
        }
    }

    /// The surfaces that move.
    pub(super) const fn group(self) -> Option<FocusGroup> {
        match self {
            Self::Group { first, last, .. } => Some(FocusGroup { first, last }),
            Self::Design | Self::ImagePlane(_) => None,
        }
    }
}

/// An effect that a picture can leave out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureEffect {
    /// Diffraction.
    Diffraction,
    /// The light that surfaces reflect and glasses absorb.
    Losses,
    /// The light that two surfaces reflect.
    Ghosts,
    /// The motion of the scene during the exposure.
    Motion,
}

impl PictureEffect {
    /// All of them, with the names that the table of effects has.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Diffraction, "diffraction"),
        (Self::Losses, "losses"),
        (Self::Ghosts, "ghosts"),
        (Self::Motion, "motion"),
    ];
}

/// The options of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the panel")]
pub struct PictureOptions {
    /// The distance of the scene in front of the first surface in mm; `None` for that of the focus.
    pub distance: Option<f64>,
    /// The focus.
    pub focus: PictureFocus,
    /// The exposure in seconds; `None` for one at which white fills most of the range of the sensor.
    pub seconds: Option<f64>,
    /// The luminance of white in the scene in cd/m²; `None` for that of the scene.
    pub luminance: Option<f64>,
    /// The velocity of the scene to the right and upwards: in mm per second, or in tangents of directions for a
    /// scene at infinity.
    pub velocity: [f64; 2],
    /// The coating of all surfaces between air and glass; `None` if nothing is lost.
    pub coating: Option<Coating>,
    /// The error that is allowed, as a share of mid grey.
    pub tolerance: f64,
    /// True for rays from every pixel whatever the error of the quick way is.
    pub exact: bool,
    /// True for the processor, though there may be a graphics card.
    pub processor: bool,
    /// The name of the sensor.
    pub sensor: String,
    /// True for the numbers of the sensor with their noise in place of light.
    pub noise: bool,
    /// True if the effects are measured.
    pub effects: bool,
    /// The effects that are left out whatever their numbers are.
    pub left_out: Vec<PictureEffect>,
}

impl Default for PictureOptions {
    fn default() -> Self {
        Self {
            distance: None,
            focus: PictureFocus::default(),
            seconds: None,
            luminance: None,
            velocity: [0.0; 2],
            coating: None,
            tolerance: 0.01,
            exact: false,
            processor: false,
            sensor: SensorPreset::ALL[0].name.to_owned(),
            noise: false,
            effects: false,
            left_out: Vec::new(),
        }
    }
}

/// The luminance of white in a scene that does not say another, in cd/m²: a room by day, and candle light.
const DAYLIGHT: f64 = 100.0;
const CANDLE_LIGHT: f64 = 1.0;

impl PictureOptions {
    /// True if the picture has an effect where its number asks for it.
    pub fn includes(&self, effect: PictureEffect) -> bool {
        !self.left_out.contains(&effect)
    }

    /// The sensor.
    pub fn sensor(&self) -> &'static SensorPreset {
        SensorPreset::find(&self.sensor).unwrap_or(&SensorPreset::ALL[0])
    }

    /// The luminance of white in cd/m², of a scene that is made by code or not.
    pub fn luminance_of(&self, built_in: Option<BuiltInScene>) -> f64 {
        let of_scene =
            if built_in == Some(BuiltInScene::StillLife) { CANDLE_LIGHT } else { DAYLIGHT };
        self.luminance.unwrap_or(of_scene)
    }
}
