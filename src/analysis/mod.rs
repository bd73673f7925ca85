//! Analyses of a lens: each number with its error estimate and its cost.
//!
//! Integrals over the pupil are computed to a tolerance, not with a number of rays: the order of
//! the quadrature is raised until two agree (see [`crate::pupil`]). Fields and wavelengths are
//! computed in parallel; the results are in the order of the lens, whatever the number of threads.
//! A field without light gives an [`AnalysisError`] with the reason, never a NaN.

mod aberration_names;
mod clear_semi_diameters;
mod coating;
mod color_error;
mod contrast_over_field;
mod diffraction;
mod distortion;
mod fan;
mod field_curves;
mod film_stack;
mod fitted_wavefront;
mod footprint;
mod geometric_radius;
mod ghosts;
mod illumination;
mod image_fold;
mod image_quality;
mod mtf;
mod path_fan;
mod path_map;
mod pupil;
mod ray_image;
mod ray_layout;
mod reference_sphere;
mod seen_from_image;
mod semi_diameters;
mod spot;
mod spot_map;
mod spot_points;
mod wavefront;
mod zernike;

pub use aberration_names::aberration_name;
pub use clear_semi_diameters::clear_semi_diameters;
pub use coating::{Coating, ThinFilm, film_reflectance};
pub use color_error::{
    LateralColor, LongitudinalAberration, ZoneFocus, lateral_color, longitudinal_aberration,
};
pub use contrast_over_field::{ContrastAtHeight, contrast_over_field};
pub use diffraction::{
    DiffractionGate, EncircledEnergy, EncircledRequest, ImageLight, PointSpread, PupilCurve,
    PupilFunction, PupilSamples, RayTransfer, RoundPupil, Strehl, TransferAtFrequency,
    TransferRays, diffraction_gate, diffraction_mtf, encircled_energy, encircled_energy_unless,
    point_spread, point_spread_unless, polychromatic_diffraction_mtf,
    polychromatic_diffraction_mtf_unless, strehl, strehl_unless, through_focus_mtf,
};
pub use distortion::{
    Distortion, FieldCurvature, GridPoint, chief_points, distortion, distortion_grid,
    field_curvature,
};
pub use fan::{Fan, FanPoint, fan};
pub use field_curves::{FieldCurvePoint, FieldCurves, field_curves};
pub use film_stack::FilmStack;
pub use fitted_wavefront::{
    FittedWavefront, ImageRay, WavefrontCost, WavefrontReference, brightest_strehl, image_rays,
    rms_without_tilt,
};
pub use footprint::{Footprint, footprint, footprints};
pub use ghosts::{
    CoatedLens, Ghost, GhostError, GhostPatch, GhostPath, GhostRanking, GhostRay, ParaxialGhost,
    PassedLight, ghost_section, ghosts, rank_ghosts,
};
pub(crate) use illumination::irradiance_beside;
pub use illumination::{
    Illumination, energy_irradiance, illumination, image_cone, irradiance, scene_irradiance,
};
pub use image_fold::ImageFold;
pub use image_quality::{ImageQuality, field_qualities, field_quality, image_quality};
pub use mtf::{
    ContrastLimit, MtfCurve, MtfPoint, TransferValue, geometric_mtf, perfect_contrast,
    polychromatic_geometric_mtf, transfer,
};
pub use path_fan::{PathFan, PathFanPoint, path_fans};
pub use path_map::{SquareGrid, grid_nodes, grid_sides, path_map};
pub use pupil::{FieldPupil, PupilExtent, PupilShape, RayLoss, pupil};
pub use ray_image::{RayImage, RayImageRequest, ray_image};
pub use ray_layout::{LayoutRay, RayLayout, ray_layout};
pub use reference_sphere::ReferenceForm;
pub use seen_from_image::{BackwardLens, lit_outline};
pub use semi_diameters::{
    RimSensitivities, RimSensitivity, mean_rim_sensitivities, rim_sensitivities,
};
pub use spot::{MonochromaticSpot, Spot, airy_radius, rounding_error, spot, spots};
pub use spot_map::{SpotMap, spot_map};
pub use spot_points::{SpotPoints, spot_points};
pub use wavefront::{
    ChiefPath, FieldPaths, PathDifference, PathError, Wavefront, field_paths, path_differences,
    wavefront,
};
pub use zernike::{ZernikeIndex, ZernikeMethod, ZernikeOrder, ZernikeSum, zernike};

use crate::lens::FieldPoint;
use crate::pupil::{LaunchError, RayModel, Region, RegionKind};
use serde::Serialize;

/// A number with its error and its cost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// An estimate of its error, in the same unit.
    pub error: f64,
    /// The number of rays traced for it, those that only searched for the edge of the pupil
    /// included.
    pub rays: usize,
    /// The time that it took, in milliseconds; the engine reads no clock, so the caller that does
    /// fills this in.
    pub milliseconds: Option<f64>,
}

impl Estimate {
    /// A number without a time.
    pub const fn new(value: f64, error: f64, rays: usize) -> Self {
        Self { value, error, rays, milliseconds: None }
    }
}

/// The reason why a field has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AnalysisError {
    /// No ray of the field gets through the lens.
    #[error("no light: no ray of this field gets through the lens")]
    NoLight,
    /// No ray of the field can be launched.
    #[error("no rays: {0}")]
    NoRays(LaunchError),
    /// Nothing limits the beam.
    #[error("no beam: no surface limits it; give the stop a semi-diameter")]
    #[serde(rename = "endless")]
    Unbounded,
    /// The chief ray does not reach the image.
    #[error("no chief ray: the ray through the middle of the pupil does not reach the image")]
    NoChief,
    /// The lens has no focal length: its light meets in no point.
    #[error("the lens is afocal: its light meets in no point, of which diffraction could be told")]
    Afocal,
    /// All positions of a displaced image plane lie at the exit pupil, or beyond it.
    #[error(
        "every position of the image plane lies at the exit pupil or beyond it; expected smaller shifts"
    )]
    BeyondPupil,
    /// Two rays of the pupil have the same direction cosines on the reference sphere.
    #[error(
        "the pupil folds: two rays have the same direction from the reference sphere, and \
         diffraction cannot be told from one exit pupil"
    )]
    FoldedPupil,
    /// The edge of the pupil is not known, or it cannot be divided into parts about one point each.
    #[error("the pupil is irregular: diffraction needs an edge that is known and star-shaped")]
    IrregularPupil,
    /// Light of two fields arrives at a point of the image.
    #[error(
        "the image folds: its height decreases again with the field, and light of two fields arrives at this point, \
         of which one alone would be counted"
    )]
    FoldedImage,
    /// The lens is not symmetric about an axis.
    #[error("the lens is not symmetric about its axis, as this number needs")]
    NotSymmetric,
    /// No field lies beside the axis.
    #[error("all fields are on the axis; expected one beside it")]
    OnlyAxis,
    /// A paraxial lens meets light that is no plane wave.
    #[error(
        "the optical path through a paraxial lens is known for a plane wave alone; expected an object at \
         infinity, and one paraxial lens without power in front of it"
    )]
    IdealPath,
    /// The computation was interrupted.
    #[error("interrupted")]
    Interrupted,
}

impl AnalysisError {
    /// True if the lens has an image by rays, but none by diffraction from one exit pupil.
    pub fn is_of_diffraction(&self) -> bool {
        matches!(self, Self::Afocal | Self::FoldedPupil | Self::IrregularPupil)
    }

    /// True if rays are lost or not limited; false if the lens has light, but not this number.
    pub fn is_loss_of_light(&self) -> bool {
        match self {
            Self::NoLight | Self::NoRays(_) | Self::Unbounded | Self::NoChief => true,
            Self::Afocal
            | Self::BeyondPupil
            | Self::FoldedPupil
            | Self::FoldedImage
            | Self::IrregularPupil
            | Self::NotSymmetric
            | Self::OnlyAxis
            | Self::IdealPath
            | Self::Interrupted => false,
        }
    }
}

/// The pupil of a field at a wavelength, if rays get through.
pub fn lit_region(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
) -> Result<Region<'_>, AnalysisError> {
    let launch = model.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
    let region = Region::new(launch);
    match region.kind {
        RegionKind::Dark => Err(AnalysisError::NoLight),
        RegionKind::Unbounded => Err(AnalysisError::Unbounded),
        RegionKind::Clear | RegionKind::StarShaped(_) | RegionKind::Irregular { .. } => Ok(region),
    }
}

/// Refuses a field of which no ray gets through at any wavelength, for results that a single ray gives.
///
/// # Errors
/// The reason why there is no light at the primary wavelength. A beam that nothing limits has light.
pub fn check_light(model: &RayModel, field: FieldPoint) -> Result<(), AnalysisError> {
    let dark = |wavelength: usize| match lit_region(model, field, wavelength) {
        Ok(_) | Err(AnalysisError::Unbounded) => None,
        Err(reason) => Some(reason),
    };
    let Some(reason) = dark(model.primary) else { return Ok(()) };
    let mut others = (0..model.channels.len()).filter(|wavelength| *wavelength != model.primary);
    if others.any(|wavelength| dark(wavelength).is_none()) { Ok(()) } else { Err(reason) }
}

/// Refuses fields of models all of which are dark, with the reason of the first one.
///
/// # Errors
/// As those of [`check_light`].
pub fn check_some_light<'a>(
    mut fields: impl Iterator<Item = (&'a RayModel, FieldPoint)>,
) -> Result<(), AnalysisError> {
    let Some((model, field)) = fields.next() else { return Ok(()) };
    let Err(reason) = check_light(model, field) else { return Ok(()) };
    let is_lit = fields.any(|(model, field)| check_light(model, field).is_ok());
    if is_lit { Ok(()) } else { Err(reason) }
}
