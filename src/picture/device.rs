//! A device that makes pictures the quick way in place of the processor, such as a graphics card.
//!
//! Pictures know no graphics: the tables of a picture are packed into numbers here, and whoever knows a
//! card installs it. Without one, and where it refuses, the processor does the same work.

use std::fmt::Debug;
use std::sync::{Arc, PoisonError, RwLock};

/// The tables of a picture as words of 32 bits, in the layout of the shader that reads them.
#[derive(Debug)]
pub struct PackedPicture<'a> {
    /// The columns and rows of the picture.
    pub pixels: [usize; 2],
    /// The texels of all paintings, one part after the other: light times cover, and cover.
    pub texels: Vec<&'a [[f32; 2]]>,
    /// The beams, eight words each.
    pub beams: Vec<u32>,
    /// Their views of paintings, 24 words each.
    pub looks: Vec<u32>,
    /// The lattices, ten words each.
    pub lattices: Vec<u32>,
    /// The number of points of all lattices.
    pub values: usize,
    /// The blocks, nine words each.
    pub blocks: Vec<u32>,
    /// Lattices with the first of the points that a group of the shader works on, two words each.
    pub lattice_shares: Vec<u32>,
    /// Blocks with the first of such pixels, two words each.
    pub block_shares: Vec<u32>,
}

/// A device that sums the light of packed tables.
pub trait PictureDevice: Debug + Send + Sync {
    /// The name of the device.
    fn name(&self) -> &str;
    /// The number of points that a group of its shader works on.
    fn group(&self) -> u32;
    /// Red, green and blue of every pixel, row by row.
    ///
    /// # Errors
    /// The reason why the device cannot make this picture.
    fn render(&self, work: &PackedPicture<'_>) -> Result<Vec<f32>, String>;
}

static INSTALLED: RwLock<Option<Arc<dyn PictureDevice>>> = RwLock::new(None);

/// Lets pictures that are made wherever it is fastest use a device from now on, or the processor alone.
pub fn install_picture_device(device: Option<Arc<dyn PictureDevice>>) {
    *INSTALLED.write().unwrap_or_else(PoisonError::into_inner) = device;
}

/// The device that pictures use; `None` for the processor.
pub fn picture_device() -> Option<Arc<dyn PictureDevice>> {
    INSTALLED.read().unwrap_or_else(PoisonError::into_inner).clone()
}
