//! A small picture of a scene through the lens, for the window.
//!
//! It is made the quick way: coarse with every edit, and finer, with its error, once the lens is still.

use super::PictureScene;
use crate::analysis::Estimate;
use crate::lens::{Lens, Object};
use crate::measure::time_ms;
use crate::picture::{
    Coloring, ErrorMap, ExactRenderer, ImageFrame, Picture, PictureError, QuickPicture,
    QuickRenderer, field_diagonal, focused, picture_model,
};
use crate::pupil::RayModel;
use std::sync::atomic::AtomicBool;

/// A picture of a scene through the lens.
#[derive(Debug, Clone)]
pub struct ScenePicture {
    /// The scene.
    pub scene: PictureScene,
    /// The picture.
    pub picture: Picture,
    /// The root mean square error against rays from every pixel, as a share of mid grey, with the
    /// milliseconds of the picture; `None` where it is not measured, as of a coarse picture.
    pub error: Option<Estimate>,
    /// The error tile by tile; `None` where it is not measured.
    pub error_map: Option<ErrorMap>,
    /// The distance in mm to which the lens is focused; `None` at infinity.
    pub focus: Option<f64>,
    /// The name of the graphics card that made the picture; `None` for the processor.
    pub device: Option<String>,
}

/// The pixels of a picture while the lens changes, and of one of a lens that is still.
const COARSE: [usize; 2] = [96, 64];
const FINE: [usize; 2] = [360, 240];
/// The distance in mm at which a scene with depth is placed before a lens that is focused at infinity.
const NEAR: f64 = 1000.0;
/// The tiles on which a fine picture is compared with rays, and the samples of their pixels.
const TILES: usize = 4;
const SAMPLES: usize = 32;
/// The samples of a pixel if all tiles are compared.
const MAP_SAMPLES: usize = 16;

/// A coarse picture of a lens.
pub(super) fn coarse_picture(
    lens: &Lens,
    zoom: usize,
    scene: &PictureScene,
) -> Result<ScenePicture, String> {
    scene_picture(lens, zoom, scene, COARSE, None).map_err(|error| error.to_string())
}

/// A fine picture of a lens, with its error on some tiles, or on all of them; without an error once
/// `is_interrupted` is true.
pub(super) fn fine_picture(
    lens: &Lens,
    zoom: usize,
    scene: &PictureScene,
    all_tiles: bool,
    is_interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<ScenePicture, String> {
    let (tiles, samples) = if all_tiles { (usize::MAX, MAP_SAMPLES) } else { (TILES, SAMPLES) };
    let compared = ComparedTiles { tiles, samples, is_interrupted };
    scene_picture(lens, zoom, scene, FINE, Some(compared)).map_err(|error| error.to_string())
}

/// The tiles on which a picture is compared with rays.
struct ComparedTiles<'a> {
    tiles: usize,
    samples: usize,
    is_interrupted: &'a (dyn Fn() -> bool + Sync),
}

fn scene_picture(
    lens: &Lens,
    zoom: usize,
    scene: &PictureScene,
    pixels: [usize; 2],
    compared: Option<ComparedTiles<'_>>,
) -> Result<ScenePicture, PictureError> {
    let diagonal = field_diagonal(&RayModel::from_lens(lens, zoom)?)?;
    let (focus, moved) = match lens.object {
        Object::Finite(distance) => (Some(distance), None),
        Object::Infinity if scene.has_depth() => (Some(NEAR), Some(focused(lens, zoom, NEAR)?)),
        Object::Infinity => (None, None),
    };
    let (model, bands) = picture_model(moved.as_ref().unwrap_or(lens), zoom, Coloring::Rgb(1))?;
    let frame = ImageFrame::new(&model, pixels, diagonal)?;
    let painted = scene.build(&model, &frame, focus)?;
    let exact = ExactRenderer::new(&model, &bands, &painted, frame)?;
    let go_on = AtomicBool::new(false);
    let (picture, ms) = time_ms(|| {
        QuickRenderer::new(&model, &bands, &exact).map(|quick| quick.render_fast(&go_on))
    });
    let QuickPicture { picture, device, .. } = picture?;
    let measure = |ComparedTiles { tiles, samples, is_interrupted }: ComparedTiles<'_>| {
        let map = ErrorMap::measure_until(&exact, &picture, (tiles, samples), is_interrupted);
        (!is_interrupted()).then_some(map)
    };
    let error_map = compared.and_then(measure);
    let timed = |map: &ErrorMap| Estimate { milliseconds: Some(ms), ..map.rms() };
    let error = error_map.as_ref().map(timed);
    Ok(ScenePicture { scene: scene.clone(), picture, error, error_map, focus, device })
}
