//! Curves of error against time as a picture: two log-log charts side by side.

use crate::measure::{Precision, Pupil, Sampling, SpotCurves, SpotRow};
use crate::picture::{Align, Axis, BLACK, Canvas, Chart, Color, Stroke};
use image::ImageError;

const SIZE: [u32; 2] = [1800, 900];
const TOP: f64 = 120.0;
const BOTTOM: f64 = 800.0;
/// Left and right of each chart.
const CHARTS: [(f64, f64); 2] = [(120.0, 740.0), (860.0, 1480.0)];
const LEGEND: f64 = 1510.0;
/// Below this an error is drawn at the foot of the chart.
const SMALLEST: f64 = 1e-16;

const COLORS: [(Sampling, Color); 6] = [
    (Sampling::SquareGrid, [0x1f, 0x77, 0xb4]),
    (Sampling::Hexapolar, [0x8c, 0x56, 0x4b]),
    (Sampling::Random, [0x7f, 0x7f, 0x7f]),
    (Sampling::LowDiscrepancy, [0x2c, 0xa0, 0x2c]),
    (Sampling::Gauss, [0xff, 0x7f, 0x0e]),
    (Sampling::SplitBoundary, [0xd6, 0x27, 0x28]),
];

/// The curves as a PNG.
pub(super) fn draw(curves: &SpotCurves, title: &str) -> Result<Vec<u8>, ImageError> {
    let mut canvas = Canvas::new(SIZE);
    canvas.text([60.0, 30.0], title, BLACK, Align::Left);
    let rows = || curves.rows.iter();
    let x = Axis::logarithmic("time, ms", rows().map(|row| row.ms), SMALLEST);
    let y = Axis::logarithmic("relative error", rows().map(|row| row.error), SMALLEST);
    for (pupil, (left, right)) in [Pupil::Clear, Pupil::Clipped].into_iter().zip(CHARTS) {
        let chart = Chart::new([left, TOP], [right, BOTTOM], x.clone(), y.clone());
        let name = match pupil {
            Pupil::Clear => "clear pupil".to_owned(),
            Pupil::Clipped => format!("clipped pupil, {:.0} % lit", 100.0 * curves.lit),
        };
        chart.draw(&mut canvas, &name);
        for (method, color) in COLORS {
            for precision in [Precision::F32, Precision::F64] {
                let mine = |row: &&SpotRow| {
                    row.pupil == pupil && row.method == method && row.precision == precision
                };
                let points = rows().filter(mine).map(|row| chart.place([row.ms, row.error]));
                marked(&mut canvas, &points.collect::<Vec<_>>(), color, stroke(precision));
            }
        }
    }
    legend(&mut canvas);
    canvas.png()
}

fn marked(canvas: &mut Canvas, points: &[[f64; 2]], color: Color, stroke: Stroke) {
    canvas.curve(points, color, stroke);
    canvas.marks(points, color);
}

fn stroke(precision: Precision) -> Stroke {
    match precision {
        Precision::F32 => Stroke::Dashed,
        Precision::F64 => Stroke::Solid,
    }
}

fn legend(canvas: &mut Canvas) {
    let mut y = TOP + 20.0;
    for (method, color) in COLORS {
        marked(canvas, &[[LEGEND, y], [LEGEND + 40.0, y]], color, Stroke::Solid);
        canvas.text([LEGEND + 52.0, y - 7.0], method.name(), BLACK, Align::Left);
        y += 34.0;
    }
    for (name, precision) in [("f64", Precision::F64), ("f32", Precision::F32)] {
        marked(canvas, &[[LEGEND, y], [LEGEND + 40.0, y]], BLACK, stroke(precision));
        canvas.text([LEGEND + 52.0, y - 7.0], name, BLACK, Align::Left);
        y += 34.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_become_a_picture() {
        let row = |ms, error| SpotRow {
            pupil: Pupil::Clear,
            method: Sampling::Gauss,
            precision: Precision::F64,
            rays: 9,
            error,
            ms,
        };
        let rows = vec![row(0.01, 1e-3), row(0.1, 0.0)];
        let curves = SpotCurves { rms_clear: 1.0, rms_clipped: None, lit: 1.0, rows };
        let png = draw(&curves, "a lens").unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!([picture.width(), picture.height()], SIZE);
        assert!(picture.pixels().any(|pixel| pixel.0 == [0xff, 0x7f, 0x0e]));
        assert!(draw(&SpotCurves { rows: Vec::new(), ..curves }, "nothing").is_ok());
    }
}
