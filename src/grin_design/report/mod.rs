//! Reports on a field: its images, its difference from a reference, its limits, ray paths.

mod difference;
mod image_light;
mod limit_check;
mod ray_paths;
mod slice_plane;
mod view_report;

pub use difference::{FieldDifference, FieldExtremes};
pub use image_light::ImageLight;
pub use limit_check::LimitCheck;
pub use ray_paths::{RayPath, RayPaths};
pub use slice_plane::{SlicePlane, SpatialAxis};
pub use view_report::{ViewImage, ViewReport};
