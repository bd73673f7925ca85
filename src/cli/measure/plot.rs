//! Curves of error against time: one log-log chart, or two side by side.

use crate::cli::error::CliError;
use crate::cli::output_paths::OutputPaths;
use crate::files;
use crate::plot::{Axis, BLACK, Canvas, Chart as Axes, Legend, TextAlign};
use image::ImageError;
use std::path::{Path, PathBuf};

pub(super) use crate::plot::{Color, Stroke};

/// The option of a picture of the curves.
#[derive(Debug, clap::Args)]
pub(super) struct PlotArgs {
    /// Draws the curves
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
}

impl PlotArgs {
    /// Refuses a file that cannot be written, or is one of those that are read.
    pub(super) fn check<'a>(
        &self,
        read: impl IntoIterator<Item = (&'static str, &'a Path)>,
    ) -> Result<(), CliError> {
        OutputPaths::reading(read).file("--plot", self.plot.as_deref(), &["png"])
    }

    /// Writes the picture, if it is wanted.
    pub(super) fn write(
        &self,
        picture: impl FnOnce() -> Result<Vec<u8>, ImageError>,
    ) -> Result<(), CliError> {
        let Some(path) = &self.plot else { return Ok(()) };
        let png = picture().map_err(|error| CliError::Failed(error.to_string()))?;
        Ok(files::write_atomic(path, &png)?)
    }
}

const SIZE: [u32; 2] = [1800, 900];
const TOP: f64 = 120.0;
const BOTTOM: f64 = 800.0;
/// The left and right side of each chart, in pixels.
const CHART_SPANS: [(f64, f64); 2] = [(120.0, 740.0), (860.0, 1480.0)];
const LEGEND: f64 = 1510.0;
/// The smallest error of the axis; smaller ones are drawn at its foot.
const SMALLEST: f64 = 1e-16;

/// A curve of relative errors against milliseconds.
pub(super) struct ErrorCurve {
    pub(super) color: Color,
    pub(super) stroke: Stroke,
    pub(super) points: Vec<[f64; 2]>,
}

/// Curves over the same axes.
pub(super) struct ErrorChart {
    pub(super) name: String,
    pub(super) curves: Vec<ErrorCurve>,
}

/// An entry of the legend.
pub(super) struct LegendEntry {
    pub(super) name: &'static str,
    pub(super) color: Color,
    pub(super) stroke: Stroke,
}

impl LegendEntry {
    /// The entry of a colour.
    pub(super) fn colored(name: &'static str, color: Color) -> Self {
        Self { name, color, stroke: Stroke::Solid }
    }

    /// The entry of a stroke.
    pub(super) fn stroked(name: &'static str, stroke: Stroke) -> Self {
        Self { name, color: BLACK, stroke }
    }
}

/// Draws one or two charts as a PNG.
pub(super) fn draw(
    charts: &[ErrorChart],
    labels: &[LegendEntry],
    title: &str,
) -> Result<Vec<u8>, ImageError> {
    let mut canvas = Canvas::new(SIZE);
    canvas.text([60.0, 30.0], title, BLACK, TextAlign::Left);
    let points = || charts.iter().flat_map(|c| &c.curves).flat_map(|curve| &curve.points);
    let x = Axis::logarithmic("time, ms", points().map(|p| p[0]), SMALLEST);
    let y = Axis::logarithmic("relative error", points().map(|p| p[1]), SMALLEST);
    for (chart, (left, right)) in charts.iter().zip(CHART_SPANS) {
        let axes = Axes::new([left, TOP], [right, BOTTOM], x.clone(), y.clone());
        axes.draw(&mut canvas, &chart.name);
        for curve in &chart.curves {
            canvas.marked_curve(&axes.to_pixels(&curve.points), curve.color, curve.stroke);
        }
    }
    let mut legend = Legend::new([LEGEND, TOP + 13.0]);
    for label in labels {
        legend.curve(&mut canvas, label.name, label.color, label.stroke);
    }
    canvas.png()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_become_a_picture() {
        let color = [0xff, 0x7f, 0x0e];
        let points = vec![[0.01, 1e-3], [0.1, 0.0]];
        let chart = |points| {
            let curves = vec![ErrorCurve { color, stroke: Stroke::Solid, points }];
            ErrorChart { name: "clear pupil".to_owned(), curves }
        };
        let png =
            draw(&[chart(points)], &[LegendEntry::colored("Gauss", color)], "a lens").unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!([picture.width(), picture.height()], SIZE);
        assert!(picture.pixels().any(|pixel| pixel.0 == color));
        assert!(draw(&[chart(Vec::new())], &[], "nothing").is_ok());
    }
}
