//! A scene of filled triangles and lines, drawn twice from one description: slowly and clearly on
//! the processor ([`software`]), and fast on the graphics card ([`gpu`]).
//!
//! The slow drawing is the specification of the fast one and the picture where no graphics card
//! can be had. Function names and formulas in `scene.wgsl` equal those of [`software`]. A drawn
//! scene is kept in a texture of its own ([`SceneCanvas`]), and while scene, camera and size stay the
//! same, only that texture is shown.
//!
//! Lengths are millimetres, widths are pixels; x points right and y up.

mod camera;
mod canvas;
pub mod gpu;
mod picture_pass;
mod scene;
mod scene_view;
pub mod software;

pub use camera::{BoundingBox, Camera, round_length_below};
pub use canvas::{RenderBackend, SceneCanvas, install_gpu_cache};
pub use picture_pass::PicturePass;
pub use scene::{Rgba, Scene, Segment, TriangleVertex};
pub(super) use scene_view::zoom_factor;
pub use scene_view::{SceneResponse, SceneView, length_text};

/// A drawn scene: rows from the top, four bytes a pixel, colour multiplied by alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbaImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Red, green, blue, alpha of each pixel.
    pub rgba: Vec<u8>,
}
