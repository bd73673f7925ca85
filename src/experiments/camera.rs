//! Shared parts of figures 3.7 to 3.9: pictures through designs of a front, and their drawing.

use super::pareto_front::ANGLES;
use super::sharpness_vs_light::with_field_angles;
use super::{Effort, ExperimentError, ExperimentResult, ProgressFn, lens, report_progress};
use crate::analysis::irradiance;
use crate::lens::Lens;
use crate::optimize::pareto::{ParetoPoint, ParetoSettings, ParetoSweep};
use crate::picture::{
    Coloring, ExactRenderer, ExactSettings, ImageFrame, Picture, PictureError, Scene,
    field_diagonal, picture_model,
};
use crate::plot::{BLACK, Canvas, Color, GREY, TextAlign, gray_level};
use crate::pupil::{Accuracy, RayModel};
use std::ops::ControlFlow;

/// The lens of the front.
const LENS: &str = "double_gauss_rudolph_50";

/// The darkest and the brightest design of the front of sharpness against light that are as sharp as the lens
/// at the start, as the first part of an experiment up to a completed fraction.
pub(super) fn darkest_and_brightest(
    effort: Effort,
    to: f64,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<[ParetoPoint; 2]> {
    let start = with_field_angles(lens(LENS)?, &ANGLES);
    let settings = ParetoSettings { points: effort.select(14, 6), ..ParetoSettings::default() };
    let mut sweep = ParetoSweep::new(&start, &settings)?;
    let mut done = 0.0;
    loop {
        report_progress(progress, to * done, "front of sharpness and light")?;
        let slice = sweep.step();
        done = slice.done as f64 / slice.total as f64;
        if slice.finished {
            break;
        }
    }
    // Beyond the light that can be had a front goes on with lenses that form no image any more.
    let is_sharp = |design: &&ParetoPoint| design.spot <= sweep.start.spot;
    let designs = || sweep.front().points().iter().filter(is_sharp);
    match [designs().next(), designs().next_back()] {
        [Some(dark), Some(bright)] if dark != bright => Ok([dark.clone(), bright.clone()]),
        _ => Err(ExperimentError::Failed("no design was found".to_owned())),
    }
}

/// A picture with the rays of its lens.
pub(super) struct CameraPicture {
    pub(super) picture: Picture,
    pub(super) model: RayModel,
}

/// The place and size of a picture.
pub(super) struct CameraFrame {
    /// The number of columns and rows.
    pub(super) pixels: [usize; 2],
    /// The diagonal in mm; `None` for that of the fields.
    pub(super) diagonal: Option<f64>,
}

/// Takes a grey picture through a lens by rays from every pixel.
pub(super) fn take(
    lens: &Lens,
    frame: &CameraFrame,
    settings: &ExactSettings,
    build: impl Fn(&RayModel, &ImageFrame) -> Result<Scene, PictureError>,
) -> ExperimentResult<CameraPicture> {
    let (model, bands) = picture_model(lens, 0, Coloring::Gray)?;
    let diagonal = frame.diagonal.map_or_else(|| field_diagonal(&model), Ok)?;
    let image = ImageFrame::new(&model, frame.pixels, diagonal)?;
    let scene = build(&model, &image)?;
    let renderer = ExactRenderer::new(&model, &bands, &scene, image)?;
    let picture = renderer.render(settings, &|_| ControlFlow::Continue(()));
    Ok(CameraPicture { picture, model })
}

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-6, max_rays: 100_000 };

impl CameraPicture {
    /// The projected solid angle of the light at a distance from the axis in mm, and its error.
    pub(super) fn solid_angle(&self, height: f64) -> ExperimentResult<[f64; 2]> {
        let found = irradiance(&self.model, self.model.primary, [0.0, height], ACCURACY);
        let found = found.map_err(|error| ExperimentError::Failed(error.to_string()))?;
        Ok([found.value, found.error])
    }

    /// The distance of a pixel's middle from the axis, in mm.
    pub(super) fn height(&self, pixel: [usize; 2]) -> f64 {
        let [x, y] = self.picture.frame.point(pixel, [0.5; 2]);
        x.hypot(y)
    }
}

/// The side of a drawn picture, about, in pixels.
const SIDE: usize = 560;
/// The place of the pictures on their canvas, and the gap between them.
const TOP: f64 = 110.0;
const MARGIN: f64 = 40.0;

/// Draws pictures of the same size side by side, each under its name, above a strip of a height for charts;
/// values from 0 to 1 are raised to a power, as the thesis does to lift the shadows. Returns the canvas and
/// the top of the strip.
pub(super) fn draw_pictures(
    title: &str,
    pictures: &[(&str, Vec<f64>)],
    columns: usize,
    (power, strip): (f64, f64),
) -> (Canvas, f64) {
    let cell = (SIDE / columns.max(1)).max(1);
    let rows = pictures.first().map_or(0, |(_, values)| values.len()) / columns.max(1);
    let [width, height] = [cell * columns, cell * rows].map(|side| side as f64);
    let whole = MARGIN + pictures.len() as f64 * (width + MARGIN);
    let bottom = TOP + height + MARGIN;
    let mut canvas = Canvas::new([whole as u32, (bottom + strip) as u32]);
    canvas.text([MARGIN, 30.0], title, BLACK, TextAlign::Left);
    for (i, (name, values)) in pictures.iter().enumerate() {
        let left = MARGIN + i as f64 * (width + MARGIN);
        canvas.text([left + 0.5 * width, TOP - 36.0], name, GREY, TextAlign::Middle);
        let level = |value: &f64| gray_level(value.clamp(0.0, 1.0).powf(power));
        let colors: Vec<Color> = values.iter().map(level).collect();
        canvas.raster([left, TOP], columns, cell, &colors);
    }
    (canvas, bottom)
}
