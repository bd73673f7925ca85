//! Pictures through a lens: what a camera with this lens sees of a scene.
//!
//! A [`Scene`] is painted planes at depths. An [`ExactRenderer`] follows rays backwards from every pixel
//! through the lens into it, with the rims clipping: distortion, lateral colour, blur that varies over the
//! field, vignetting and depth of field need no model of their own. Diffraction is the spread of the
//! unaberrated pupil at every place, with the error that this leaves. The error is stated; what
//! is left out (losses at surfaces and ghosts without a coating) is named in the metadata of the file. A
//! [`SensorModel`] makes noisy numbers of the light.
//!
//! A beam has one direction at each point, which no ray from a pixel has but by chance. Its image is made by
//! following it forwards: a [`LightProjection`] samples the beam as an [`ExactRenderer`] samples a pixel, and
//! states its error by the same law.

mod aimed_light;
mod bayer;
mod beamlets;
mod built_in;
mod color_band;
mod device;
mod diffraction;
mod error;
mod error_map;
mod exact;
mod focus;
mod frame;
mod gates;
mod ghost_light;
mod lit_directions;
mod losses;
mod mip_texture;
mod omitted;
mod pattern;
mod picture_data;
mod png_file;
mod point_images;
mod projected_image;
mod projected_light;
mod projected_view;
mod pupil_spread;
mod quick;
mod raster;
mod sample_points;
mod scene;
mod scene_file;
mod seen_light;
mod sensor;
mod sensor_law;
mod smear;
mod tent_line;
mod tile_sampler;
mod tolerance_split;

pub use built_in::BuiltInScene;
pub use color_band::{ColorBand, Coloring, picture_model};
pub use device::{PackedPicture, PictureDevice, install_picture_device, picture_device};
pub use diffraction::DiffractionReport;
pub use error::{PictureError, ProjectionError};
pub use error_map::{ErrorMap, quick_error};
pub use exact::{ExactRenderer, ExactSettings, MID_GREY, PictureProgress, PictureRun, REPLICATES};
pub use focus::{FocusGroup, GroupFocus, focused, thin_lens_blur};
pub use frame::{ImageFrame, field_diagonal, filling_size};
pub use gates::{GateSubject, PictureGate, reach_tiles, render_tiles, tile_change};
pub use ghost_light::{GhostLight, GhostReport};
pub use lit_directions::{DrawnDirection, LitDirections};
pub use losses::{LightLosses, LossReport};
pub use omitted::{IncludedEffects, OmittedEffect, omitted_beside, omitted_effects};
pub use pattern::{Paint, PaintedPoint, Pattern};
pub use picture_data::Picture;
pub use png_file::{BitDepth, ToneCurve, encode_colors, encode_png};
pub use point_images::{PlacedPoint, PlacedPoints, PointGrid};
pub use projected_image::ProjectedImage;
pub use projected_light::{
    LightProjection, LightScreen, ProjectionProgress, ProjectionSettings, screen_frame,
};
pub use projected_view::{ProjectedView, project_views};
pub use quick::{QuickPicture, QuickRenderer};
pub use raster::Raster;
pub use scene::{Radiance, Scene, SceneLayer};
pub use scene_file::{PlaneDistance, PlaneEntry, SceneFile, SceneFileError};
pub use sensor::{Exposure, SensorImage, SensorModel, SensorPreset, photon_count};
pub use sensor_law::{black_body_photons, photons_of_wavelength};
pub use smear::smear_contrast;
pub use tolerance_split::{ErrorShare, ToleranceSplit};
