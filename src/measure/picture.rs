//! Error against time of pictures, the quick way and the exact one, from a lens to the pixels.
//!
//! A picture begins with a lens that was just edited: its model, the directions of light at the points of
//! the image and the maps are part of the first coarse picture, as in the window. The exact way is timed on
//! fewer pixels of the same frame and its time is scaled by their number; the pixels are then larger, and a
//! little noisier.

use super::timing::time_ms;
use crate::lens::Lens;
use crate::picture::{
    BuiltInScene, ColorBand, Coloring, ExactRenderer, ExactSettings, ImageFrame, PictureError,
    QuickPicture, QuickRenderer, field_diagonal, picture_model, quick_error,
};
use crate::pupil::RayModel;
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

/// The way of making a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureWay {
    /// The first coarse picture after an edit: all preparations, and fewer pixels.
    First,
    /// The quick way.
    Quick,
    /// Rays from every pixel.
    Exact,
}

/// A picture with its error and its time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PictureRow {
    /// The way.
    pub way: PictureWay,
    /// The number of columns and rows.
    pub pixels: [usize; 2],
    /// The tolerance asked for; `None` for the quick way, which has one error.
    pub tolerance: Option<f64>,
    /// The root mean square error as a share of mid grey, or of the pixel where that is brighter; `None`
    /// where it was not measured.
    pub error: Option<f64>,
    /// True if the tolerance was reached everywhere.
    pub reached: bool,
    /// The time of these pixels, in milliseconds.
    pub ms: f64,
    /// The time scaled to the pixels of the whole picture, preparations included.
    pub whole_ms: f64,
}

/// The measurement of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PictureCurves {
    /// The name of the scene.
    pub scene: &'static str,
    /// The columns and rows of the whole picture.
    pub pixels: [usize; 2],
    /// The time of what both ways need before their first pixel, in milliseconds.
    pub prepare_ms: f64,
    /// The name of the graphics card that made the quick picture; `None` for the processor.
    pub device: Option<String>,
    /// The pictures.
    pub rows: Vec<PictureRow>,
}

/// The tolerances of the exact way.
const TOLERANCES: [f64; 4] = [0.08, 0.04, 0.02, 0.01];
/// The columns of the first coarse picture, as in the window.
const COARSE: usize = 96;
/// The tiles and the samples of the error of the quick way.
const TILES: usize = 24;
const SAMPLES: usize = 128;

/// Measures pictures of a scene through a lens; the exact way on `exact` pixels. `report` is told how many of
/// all parts are done, and may break.
///
/// # Errors
/// A lens without a picture.
pub fn measure_picture(
    lens: &Lens,
    scene: BuiltInScene,
    [pixels, exact]: [[usize; 2]; 2],
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<PictureCurves, PictureError> {
    let parts = 2 + TOLERANCES.len();
    let one = Coloring::Rgb(1);
    let (coarse_row, first) =
        time_ms(|| camera(lens, scene, coarse(pixels), one, |c| c.quick(None)));
    coarse_row?;
    let three = Coloring::Rgb(3);
    let (prepared, prepare_ms) = time_ms(|| camera(lens, scene, pixels, three, |_| Ok(())));
    prepared?;
    let row = PictureRow {
        way: PictureWay::First,
        pixels: coarse(pixels),
        tolerance: None,
        error: None,
        reached: true,
        ms: first,
        whole_ms: first,
    };
    let mut curves =
        PictureCurves { scene: scene.name(), pixels, prepare_ms, device: None, rows: vec![row] };
    if report(1, parts).is_break() {
        return Ok(curves);
    }
    let (quick, device) = camera(lens, scene, pixels, three, |c| c.quick(Some(TILES)))?;
    curves.device = device;
    curves.rows.push(PictureRow { whole_ms: quick.ms + prepare_ms, ..quick });
    let factor = (pixels[0] * pixels[1]) as f64 / (exact[0] * exact[1]) as f64;
    for (done, tolerance) in TOLERANCES.into_iter().enumerate() {
        if report(2 + done, parts).is_break() {
            break;
        }
        let row = camera(lens, scene, exact, three, |c| Ok(c.exact(tolerance)))?;
        curves.rows.push(PictureRow { whole_ms: factor * row.ms + prepare_ms, ..row });
    }
    Ok(curves)
}

/// The pixels of the first coarse picture.
fn coarse([columns, rows]: [usize; 2]) -> [usize; 2] {
    let width = COARSE.min(columns);
    [width, (rows * width / columns.max(1)).max(1)]
}

/// A scene in front of a lens, with what its pictures need.
struct PreparedCamera<'a> {
    renderer: &'a ExactRenderer<'a>,
    model: &'a RayModel,
    bands: &'a [ColorBand],
    pixels: [usize; 2],
}

/// Prepares pictures of a lens, and makes some.
fn camera<T>(
    lens: &Lens,
    scene: BuiltInScene,
    pixels: [usize; 2],
    coloring: Coloring,
    work: impl FnOnce(&PreparedCamera<'_>) -> Result<T, PictureError>,
) -> Result<T, PictureError> {
    let (model, bands) = picture_model(lens, 0, coloring)?;
    let frame = ImageFrame::new(&model, pixels, field_diagonal(&model)?)?;
    let scene = scene.build(&model, &frame, None)?;
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame)?;
    work(&PreparedCamera { renderer: &renderer, model: &model, bands: &bands, pixels })
}

impl PreparedCamera<'_> {
    /// A picture the quick way, with its error on some tiles, and the device that made it.
    fn quick(&self, tiles: Option<usize>) -> Result<(PictureRow, Option<String>), PictureError> {
        let (made, ms) = time_ms(|| {
            let quick = QuickRenderer::new(self.model, self.bands, self.renderer)?;
            Ok::<_, PictureError>(quick.render_fast(&AtomicBool::new(false)))
        });
        let QuickPicture { picture, device, .. } = made?;
        let error = tiles.map(|tiles| quick_error(self.renderer, &picture, tiles, SAMPLES).value);
        let row = PictureRow {
            way: PictureWay::Quick,
            pixels: self.pixels,
            tolerance: None,
            error,
            reached: true,
            ms,
            whole_ms: ms,
        };
        Ok((row, device))
    }

    fn exact(&self, tolerance: f64) -> PictureRow {
        let settings = ExactSettings { tolerance, ..ExactSettings::default() };
        let go_on = |_| ControlFlow::Continue(());
        let (picture, ms) = time_ms(|| self.renderer.render(&settings, &go_on));
        PictureRow {
            way: PictureWay::Exact,
            pixels: self.pixels,
            tolerance: Some(tolerance),
            error: Some(picture.rms_error()),
            reached: picture.reached,
            ms,
            whole_ms: ms,
        }
    }
}
