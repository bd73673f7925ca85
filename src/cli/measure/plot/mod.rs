//! Curves of error against time as a picture: two log-log charts side by side.

mod canvas;
mod font;

use canvas::{Align, BLACK, Canvas, GRID};
use image::ImageError;

pub(super) use canvas::{Color, Stroke};

const SIZE: [u32; 2] = [1800, 900];
const TOP: f64 = 90.0;
const BOTTOM: f64 = 800.0;
/// Left and right of each chart.
const PLACES: [(f64, f64); 2] = [(120.0, 740.0), (860.0, 1480.0)];
const LEGEND: f64 = 1510.0;

/// Milliseconds and relative errors.
pub(super) struct Curve {
    pub(super) color: Color,
    pub(super) stroke: Stroke,
    pub(super) points: Vec<[f64; 2]>,
}

/// Curves over the same axes.
pub(super) struct Chart {
    pub(super) name: String,
    pub(super) curves: Vec<Curve>,
}

/// What a kind of curve is called.
pub(super) struct Label {
    pub(super) name: &'static str,
    pub(super) color: Color,
    pub(super) stroke: Stroke,
}

impl Label {
    /// The name of a color.
    pub(super) fn of(name: &'static str, color: Color) -> Self {
        Self { name, color, stroke: Stroke::Solid }
    }

    /// The name of a stroke.
    pub(super) fn drawn(name: &'static str, stroke: Stroke) -> Self {
        Self { name, color: BLACK, stroke }
    }
}

/// One chart or two as a PNG.
pub(super) fn draw(charts: &[Chart], labels: &[Label], title: &str) -> Result<Vec<u8>, ImageError> {
    let mut canvas = Canvas::new(SIZE);
    canvas.text([60.0, 30.0], title, BLACK, Align::Left);
    let range = Range::of(charts);
    for (chart, (left, right)) in charts.iter().zip(PLACES) {
        let axes = Axes { left, right, range };
        axes.draw(&mut canvas, &chart.name);
        for curve in &chart.curves {
            let places: Vec<_> = curve.points.iter().map(|point| axes.place(*point)).collect();
            canvas.curve(&places, curve.color, curve.stroke);
        }
    }
    for (i, label) in labels.iter().enumerate() {
        let y = TOP + 20.0 + 34.0 * i as f64;
        canvas.curve(&[[LEGEND, y], [LEGEND + 40.0, y]], label.color, label.stroke);
        canvas.text([LEGEND + 52.0, y - 7.0], label.name, BLACK, Align::Left);
    }
    canvas.png()
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
    fn of(charts: &[Chart]) -> Self {
        let curves = || charts.iter().flat_map(|chart| &chart.curves);
        let powers = |number: fn(&[f64; 2]) -> f64| {
            let points = curves().flat_map(|curve| &curve.points);
            let logs = points.map(|point| number(point).log10()).filter(|log| log.is_finite());
            let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), log| {
                (low.min(log), high.max(log))
            });
            if low <= high { [low.floor() as i32, high.ceil() as i32] } else { [-1, 1] }
        };
        Self { ms: powers(|point| point[0]), error: powers(|point| point[1].max(SMALLEST)) }
    }
}

/// Where a chart stands on the canvas.
struct Axes {
    left: f64,
    right: f64,
    range: Range,
}

impl Axes {
    fn place(&self, [ms, error]: [f64; 2]) -> [f64; 2] {
        [self.x(ms.log10()), self.y(error.max(SMALLEST).log10())]
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
    fn draw(&self, canvas: &mut Canvas, name: &str) {
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
        let color = [0x1f, 0x77, 0xb4];
        let points = vec![[0.01, 1e-3], [0.1, 0.0]];
        let curve = Curve { color, stroke: Stroke::Solid, points };
        let chart = Chart { name: "a chart".to_owned(), curves: vec![curve] };
        let png = draw(&[chart], &[Label::of("a curve", color)], "a lens").unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!([picture.width(), picture.height()], SIZE);
        assert!(picture.pixels().any(|pixel| pixel.0 == color));
        assert!(draw(&[], &[], "nothing").is_ok());
    }
}
