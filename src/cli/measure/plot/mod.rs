//! Curves of error against time as a picture: two log-log charts side by side.

mod canvas;
mod font;

use crate::measure::{Precision, Pupil, Sampling, SpotCurves, SpotRow};
use canvas::{Align, BLACK, Canvas, Color, GRID, Stroke};
use image::ImageError;

const SIZE: [u32; 2] = [1800, 900];
const TOP: f64 = 90.0;
const BOTTOM: f64 = 800.0;
/// Left and right of each chart.
const CHARTS: [(f64, f64); 2] = [(120.0, 740.0), (860.0, 1480.0)];
const LEGEND: f64 = 1510.0;

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
    let range = Range::of(&curves.rows);
    for (pupil, (left, right)) in [Pupil::Clear, Pupil::Clipped].into_iter().zip(CHARTS) {
        let chart = Chart { left, right, range };
        let name = match pupil {
            Pupil::Clear => "clear pupil".to_owned(),
            Pupil::Clipped => format!("clipped pupil, {:.0} % lit", 100.0 * curves.lit),
        };
        chart.axes(&mut canvas, &name);
        for (method, color) in COLORS {
            for precision in [Precision::F32, Precision::F64] {
                let mine = |row: &&SpotRow| {
                    row.pupil == pupil && row.method == method && row.precision == precision
                };
                let points = curves.rows.iter().filter(mine).map(|row| chart.place(row));
                canvas.curve(&points.collect::<Vec<_>>(), color, stroke(precision));
            }
        }
    }
    legend(&mut canvas);
    canvas.png()
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
        canvas.curve(&[[LEGEND, y], [LEGEND + 40.0, y]], color, Stroke::Solid);
        canvas.text([LEGEND + 52.0, y - 7.0], method.name(), BLACK, Align::Left);
        y += 34.0;
    }
    for (name, precision) in [("f64", Precision::F64), ("f32", Precision::F32)] {
        canvas.curve(&[[LEGEND, y], [LEGEND + 40.0, y]], BLACK, stroke(precision));
        canvas.text([LEGEND + 52.0, y - 7.0], name, BLACK, Align::Left);
        y += 34.0;
    }
}

/// Powers of ten around all points.
#[derive(Clone, Copy)]
struct Range {
    ms: [i32; 2],
    error: [i32; 2],
}

/// Below this an error is drawn at the foot of the chart.
const SMALLEST: f64 = 1e-16;

impl Range {
    fn of(rows: &[SpotRow]) -> Self {
        let powers = |number: fn(&SpotRow) -> f64| {
            let logs = rows.iter().map(|row| number(row).log10()).filter(|log| log.is_finite());
            let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), log| {
                (low.min(log), high.max(log))
            });
            if low <= high { [low.floor() as i32, high.ceil() as i32] } else { [-1, 1] }
        };
        Self { ms: powers(|row| row.ms), error: powers(|row| row.error.max(SMALLEST)) }
    }
}

/// One chart on the canvas.
struct Chart {
    left: f64,
    right: f64,
    range: Range,
}

impl Chart {
    fn place(&self, row: &SpotRow) -> [f64; 2] {
        [self.x(row.ms.log10()), self.y(row.error.max(SMALLEST).log10())]
    }

    fn x(&self, log: f64) -> f64 {
        let [low, high] = self.range.ms.map(f64::from);
        self.left + (self.right - self.left) * (log - low) / (high - low)
    }

    fn y(&self, log: f64) -> f64 {
        let [low, high] = self.range.error.map(f64::from);
        BOTTOM - (BOTTOM - TOP) * (log - low) / (high - low)
    }

    /// Grid, numbers and names of the axes.
    fn axes(&self, canvas: &mut Canvas, name: &str) {
        let Self { left, right, range } = self;
        for power in range.ms[0]..=range.ms[1] {
            let x = self.x(f64::from(power));
            canvas.line([x, TOP], [x, BOTTOM], GRID);
            canvas.text([x, BOTTOM + 12.0], &format!("1e{power}"), BLACK, Align::Middle);
        }
        for power in range.error[0]..=range.error[1] {
            let y = self.y(f64::from(power));
            canvas.line([*left, y], [*right, y], GRID);
            if (power - range.error[0]) % 2 == 0 {
                canvas.text([left - 10.0, y - 7.0], &format!("1e{power}"), BLACK, Align::Right);
            }
        }
        for [from, to] in [
            [[*left, TOP], [*left, BOTTOM]],
            [[*left, BOTTOM], [*right, BOTTOM]],
            [[*right, TOP], [*right, BOTTOM]],
            [[*left, TOP], [*right, TOP]],
        ] {
            canvas.line(from, to, BLACK);
        }
        let middle = 0.5 * (left + right);
        canvas.text([middle, TOP - 24.0], name, BLACK, Align::Middle);
        canvas.text([middle, BOTTOM + 46.0], "time, ms", BLACK, Align::Middle);
        let place = [left - 10.0, TOP - 24.0];
        canvas.text(place, "relative error", BLACK, Align::Middle);
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
