//! The specification of a lens as a customer writes it: everything but focal length, aperture and
//! field may be missing.

use crate::lens::ToleranceGrade;
use serde::{Deserialize, Serialize};

/// The specification of a lens. Missing keys are filled by
/// [`LensRequirements::complete`](super::LensRequirements::complete).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSpecification {
    /// The object: `infinity`, or `finite` with a magnification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// The focal length, in mm; may be missing beside a magnification and the distance of the object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_length_mm: Option<f64>,
    /// The magnification of a near object, whose real image is inverted: its sign does not matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub magnification: Option<f64>,
    /// The distance of a near object from the first vertex, in mm; from the focal length and the
    /// magnification of a thin lens if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_distance_mm: Option<f64>,
    /// The f-number: the focal length over the diameter of the beam on the axis; of a near object the
    /// working f-number, the reciprocal of twice the numerical aperture of the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// The numerical aperture on the side of the image, in place of the f-number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub numerical_aperture: Option<f64>,
    /// The largest field, in degrees from the axis; of a near object as the first vertex sees it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_field_deg: Option<f64>,
    /// The fields at which the lens is judged, in degrees from the axis, ascending from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fields_deg: Option<Vec<f64>>,
    /// The image height of the last field, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_height_mm: Option<f64>,
    /// The wavelengths, in micrometres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths_um: Option<Vec<f64>>,
    /// Their weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelength_weights: Option<Vec<f64>>,
    /// The smallest distance from the last vertex to the image, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_back_focus_mm: Option<f64>,
    /// The largest distance from the first vertex to the image, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_track_mm: Option<f64>,
    /// The largest number of pieces of glass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_elements: Option<usize>,
    /// The largest number of surfaces that are neither spheres nor planes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_aspheric_surfaces: Option<usize>,
    /// The permitted glasses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glasses: Option<GlassList>,
    /// The largest distortion of the chief ray against `f tan θ`, as a fraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_abs_distortion: Option<f64>,
    /// The smallest relative illumination of every field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_relative_illumination: Option<Vec<f64>>,
    /// The smallest area of every field's beam in the plane of the first vertex, in mm².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_clear_area_mm2: Option<Vec<f64>>,
    /// The largest semi-diameter of a surface, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_semi_diameter_mm: Option<f64>,
    /// The smallest thickness of glass on the axis, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_glass_center_mm: Option<f64>,
    /// The smallest thickness of glass at the smaller rim of its two surfaces, in mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_edge_mm: Option<f64>,
    /// The smallest air space on the axis, in mm; surfaces may touch at their rims.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_air_mm: Option<f64>,
    /// The quality that the lens is to excel in; by default small spots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wish: Option<LensWish>,
    /// The class of care in making for which the lenses are refined at the end, one of
    /// [`AS_BUILT_GRADES`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub as_built: Option<String>,
}

/// The classes of care in making by their keys, each with its grade; `none` for lenses that are not
/// refined as they are made.
pub const AS_BUILT_GRADES: [(&str, Option<ToleranceGrade>); 5] = [
    ("none", None),
    ("commercial", Some(ToleranceGrade::Commercial)),
    ("precision", Some(ToleranceGrade::Precision)),
    ("shop_limit", Some(ToleranceGrade::ShopLimit)),
    ("moulded_plastic", Some(ToleranceGrade::MouldedPlastic)),
];

/// The quality that a lens is to excel in.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LensWish {
    /// The smallest RMS spot radii.
    #[default]
    Rms,
    /// The largest contrast, tangential and sagittal, over the fields, at a frequency in cycles/mm.
    Mtf(f64),
}

/// The permitted glasses: in words, or by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum GlassList {
    /// `any glass of the catalogue`, perhaps with `or model plastics nd 1.53-1.67, vd 20-56`.
    Words(String),
    /// Glasses of the catalogue by manufacturer and name.
    Names(Vec<String>),
}
