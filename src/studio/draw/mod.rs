//! A scene of filled triangles and lines, drawn twice from one description: slowly and clearly on
//! the processor ([`software`]), and fast on the graphics card ([`gpu`]).
//!
//! The slow drawing is the specification of the fast one and the picture where no graphics card
//! can be had. Function names and formulas in `scene.wgsl` equal those of [`software`]. A drawn
//! scene is kept in a texture of its own ([`Canvas`]), and while scene, camera and size stay the
//! same, only that texture is shown.
//!
//! Lengths are millimetres, widths are pixels; x points right and y up.

mod camera;
mod canvas;
pub mod gpu;
mod scene;
pub mod software;
mod stage;

pub use camera::{Bounds, Camera, round_length};
pub use canvas::{Backing, Canvas, install};
pub use scene::{Colour, Corner, Scene, Segment};
pub use stage::{Shown, Stage, length_text};

/// A drawn scene: rows from the top, four bytes a pixel, colour multiplied by alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Red, green, blue, alpha of each pixel.
    pub rgba: Vec<u8>,
}
