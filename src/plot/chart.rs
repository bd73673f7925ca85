//! A chart: two axes, the mapping from two quantities to pixels, and a legend.

use super::canvas::{Canvas, Stroke, TextAlign};
use super::color::{BLACK, Color, GRID};

/// The approximate number of ticks of a linear axis.
const TICKS: f64 = 5.0;
/// The largest number of tick intervals of a widened axis.
const MOST_TICKS: f64 = 8.0;
/// A tick this close beyond the end of an axis, in tick intervals, still belongs to it.
const END_TOLERANCE: f64 = 1e-6;
/// The distance of tick labels from an axis, in pixels.
const PADDING: f64 = 10.0;
/// The length of a tick outside a frame, in pixels.
const TICK: f64 = 6.0;
/// Half the height of a letter, in pixels: ticks and samples are centred on their names.
const HALF_LETTER: f64 = 7.0;

/// An axis that ends at ticks.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    name: String,
    /// The ends; for a logarithmic axis their decimal logarithms.
    low: f64,
    high: f64,
    step: f64,
    logarithmic: bool,
}

impl Axis {
    /// A linear axis that contains all values.
    pub fn linear(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = range(values).unwrap_or((0.0, 1.0));
        let width = if high > low { high - low } else { low.abs().max(1.0) };
        let step = round_step(width / TICKS);
        let (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        let high = if high > low { high } else { low + step };
        Self { name: name.to_owned(), low, high, step, logarithmic: false }
    }

    /// A linear axis with exactly these ends, at which there need not be ticks.
    pub fn spanning(name: &str, low: f64, high: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let step = round_step((high - low) / TICKS);
        Self { name: name.to_owned(), low, high, step, logarithmic: false }
    }

    /// A logarithmic axis between two powers of ten that contains all values; values below
    /// `smallest` are drawn at its lower end.
    pub fn logarithmic(name: &str, values: impl IntoIterator<Item = f64>, smallest: f64) -> Self {
        let logs = values.into_iter().map(|value| value.max(smallest).log10());
        let (low, high) = range(logs).unwrap_or((-1.0, 1.0));
        let (low, high) = (low.floor(), high.ceil().max(low.floor() + 1.0));
        Self { name: name.to_owned(), low, high, step: 1.0, logarithmic: true }
    }

    /// The name of the axis.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The position of a value along the axis, 0 at its start and 1 at its end.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        let place = if self.logarithmic { value.log10().max(self.low) } else { value };
        (place - self.low) / (self.high - self.low)
    }

    /// The positions of the ticks along the axis, with their labels.
    pub(super) fn ticks(&self) -> impl Iterator<Item = (f64, String)> + '_ {
        let [first, last] = [
            (self.low / self.step - END_TOLERANCE).ceil(),
            (self.high / self.step + END_TOLERANCE).floor(),
        ];
        (first as i32..=last as i32).map(|i| {
            let place = f64::from(i) * self.step;
            let share = (place - self.low) / (self.high - self.low);
            let label =
                if self.logarithmic { format!("1e{place:.0}") } else { label(place, self.step) };
            (share, label)
        })
    }

    /// Two axes of these lengths, widened so that both have the same scale.
    pub(super) fn equally_scaled([x, y]: [Self; 2], [width, height]: [f64; 2]) -> [Self; 2] {
        let unit = ((x.high - x.low) / width).max((y.high - y.low) / height);
        [x.widened(unit * width), y.widened(unit * height)]
    }

    /// The axis widened on both sides to this length.
    fn widened(mut self, length: f64) -> Self {
        let more = 0.5 * (length - (self.high - self.low)).max(0.0);
        self.low -= more;
        self.high += more;
        self.step = self.step.max(round_step((self.high - self.low) / MOST_TICKS));
        self
    }
}

fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((value.min(low), value.max(high))),
    })
}

/// The smallest of 1, 2 and 5 times a power of ten that is not less.
pub fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let digits = [1.0, 2.0, 5.0, 10.0];
    power * digits.into_iter().find(|digit| digit * power >= 0.999 * step).unwrap_or(10.0)
}

/// The label of a tick, with the digits that the tick interval needs.
fn label(place: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    if decimals > 4 || step >= 1e6 {
        return format!("{place:.1e}");
    }
    let text = format!("{place:.decimals$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { "0".to_owned() } else { text }
}

/// A rectangle of a canvas with two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x: Axis,
    y: Axis,
}

impl Chart {
    /// A chart between two corners of the canvas, the upper left one first, in pixels.
    pub fn new([left, top]: [f64; 2], [right, bottom]: [f64; 2], x: Axis, y: Axis) -> Self {
        Self { left, right, top, bottom, x, y }
    }

    /// The chart with the same scale, in pixels per unit, on both axes, as for a map.
    #[must_use]
    pub fn with_equal_scales(mut self) -> Self {
        let size = [self.right - self.left, self.bottom - self.top];
        [self.x, self.y] = Axis::equally_scaled([self.x, self.y], size);
        self
    }

    /// The position of two quantities on the canvas, in pixels.
    pub fn to_pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.left + (self.right - self.left) * self.x.fraction(x),
            self.bottom - (self.bottom - self.top) * self.y.fraction(y),
        ]
    }

    /// True if two quantities are within the axes.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let within = |share: f64| (0.0..=1.0).contains(&share);
        within(self.x.fraction(x)) && within(self.y.fraction(y))
    }

    /// The positions of several pairs of quantities on the canvas, in pixels.
    pub fn to_pixels(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|point| self.to_pixel(*point)).collect()
    }

    /// Draws the grid, the tick labels, the names of the axes, and a title above.
    pub fn draw(&self, canvas: &mut Canvas, title: &str) {
        self.draw_grid(canvas);
        self.draw_frame(canvas);
        let middle = 0.5 * (self.left + self.right);
        canvas.text([middle, self.top - 48.0], title, BLACK, TextAlign::Middle);
        canvas.text([middle, self.bottom + 46.0], &self.x.name, BLACK, TextAlign::Middle);
        let above = [self.left - PADDING, self.top - 24.0];
        canvas.text(above, &self.y.name, BLACK, TextAlign::Left);
    }

    /// Draws a frame with ticks outside, their labels and the names of the axes around a picture.
    pub fn draw_ticks(&self, canvas: &mut Canvas) {
        self.draw_frame(canvas);
        for (share, label) in self.x.ticks() {
            let x = self.left + (self.right - self.left) * share;
            canvas.line([x, self.bottom], [x, self.bottom + TICK], BLACK);
            canvas.text([x, self.bottom + PADDING], &label, BLACK, TextAlign::Middle);
        }
        for (share, label) in self.y.ticks() {
            let y = self.bottom - (self.bottom - self.top) * share;
            canvas.line([self.left - TICK, y], [self.left, y], BLACK);
            canvas.text([self.left - PADDING, y - HALF_LETTER], &label, BLACK, TextAlign::Right);
        }
        let middle = 0.5 * (self.left + self.right);
        canvas.text([middle, self.bottom + 46.0], &self.x.name, BLACK, TextAlign::Middle);
        let above = [self.left - PADDING, self.top - 24.0];
        canvas.text(above, &self.y.name, BLACK, TextAlign::Left);
    }

    fn draw_grid(&self, canvas: &mut Canvas) {
        for (share, label) in self.x.ticks() {
            let x = self.left + (self.right - self.left) * share;
            canvas.line([x, self.top], [x, self.bottom], GRID);
            canvas.text([x, self.bottom + PADDING], &label, BLACK, TextAlign::Middle);
        }
        for (share, label) in self.y.ticks() {
            let y = self.bottom - (self.bottom - self.top) * share;
            canvas.line([self.left, y], [self.right, y], GRID);
            canvas.text([self.left - PADDING, y - HALF_LETTER], &label, BLACK, TextAlign::Right);
        }
    }

    fn draw_frame(&self, canvas: &mut Canvas) {
        let Self { left, right, top, bottom, .. } = *self;
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        for side in corners.windows(2) {
            canvas.line(side[0], side[1], BLACK);
        }
    }
}

/// The distance between two entries, in pixels.
const ENTRY_HEIGHT: f64 = 28.0;
/// The length of the sample of a curve, and the distance of a name from its sample, in pixels.
const SAMPLE_LENGTH: f64 = 50.0;
const SAMPLE_GAP: f64 = 12.0;

/// A column of entries, drawn one by one from the top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Legend {
    corner: [f64; 2],
}

impl Legend {
    /// An empty legend with its upper left corner at a position in pixels.
    pub fn new(corner: [f64; 2]) -> Self {
        Self { corner }
    }

    /// Draws the next entry: a curve and its name.
    pub fn curve(&mut self, canvas: &mut Canvas, name: &str, color: Color, stroke: Stroke) {
        let [x, y] = [self.corner[0], self.corner[1] + HALF_LETTER];
        canvas.curve(&[[x, y], [x + SAMPLE_LENGTH, y]], color, stroke);
        self.name(canvas, name, SAMPLE_LENGTH);
    }

    /// Draws the next entry: a marker and its name.
    pub fn marker(&mut self, canvas: &mut Canvas, name: &str, color: Color) {
        canvas.markers(&[[self.corner[0], self.corner[1] + HALF_LETTER]], color);
        self.name(canvas, name, 0.0);
    }

    fn name(&mut self, canvas: &mut Canvas, name: &str, sample: f64) {
        let [x, y] = self.corner;
        canvas.text([x + sample + SAMPLE_GAP, y], name, BLACK, TextAlign::Left);
        self.corner[1] += ENTRY_HEIGHT;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_at_whole_steps_around_all_values() {
        let axis = Axis::linear("mm", [0.13, 9.2]);
        assert_eq!((axis.low, axis.high, axis.step), (0.0, 10.0, 2.0));
        let axis = Axis::logarithmic("ms", [0.02, 700.0, 0.0], 1e-3);
        assert_eq!((axis.low, axis.high), (-3.0, 3.0));
        assert_eq!(axis.fraction(1.0), 0.5);
        assert_eq!(axis.fraction(0.0), 0.0);
        let labels: Vec<String> = axis.ticks().map(|line| line.1).collect();
        assert_eq!([&labels[0], &labels[3]], ["1e-3", "1e0"]);
    }

    #[test]
    fn an_axis_that_spans_a_picture_has_its_ends_and_round_ticks() {
        let axis = Axis::spanning("mm", -1.1, 1.1);
        assert_eq!((axis.low, axis.high), (-1.1, 1.1));
        let ticks: Vec<(f64, String)> = axis.ticks().collect();
        assert!(ticks.len() >= 3 && ticks.iter().all(|(share, _)| (0.0..=1.0).contains(share)));
        assert_eq!(ticks[ticks.len() / 2].1, "0");
    }

    #[test]
    fn an_axis_is_widened_on_both_sides_alike() {
        let axis = Axis::linear("mm", [2.0, 12.0]);
        let (low, high) = (axis.low, axis.high);
        let wide = axis.widened(high - low + 6.0);
        assert_eq!((wide.low, wide.high), (low - 3.0, high + 3.0));
        let same = wide.clone().widened(1.0);
        assert_eq!((same.low, same.high), (wide.low, wide.high));
    }

    #[test]
    fn an_axis_of_one_value_or_none_has_a_length() {
        for axis in [Axis::linear("", [3.0]), Axis::linear("", []), Axis::linear("", [f64::NAN])] {
            assert!(axis.high > axis.low, "{axis:?}");
        }
        let axis = Axis::logarithmic("", [10.0], 1e-9);
        assert!(axis.high > axis.low, "{axis:?}");
    }

    #[test]
    fn a_chart_to_scale_has_square_units() {
        let (x, y) = (Axis::linear("x", [0.0, 1.0]), Axis::linear("y", [0.0, 1.0]));
        let chart = Chart::new([0.0, 0.0], [400.0, 100.0], x, y).with_equal_scales();
        let [a, b] = [chart.to_pixel([0.0, 0.0]), chart.to_pixel([0.5, 0.5])];
        assert!(((b[0] - a[0]) - (a[1] - b[1])).abs() < 1e-9);
        assert_eq!(chart.to_pixel([0.5, 0.5]), [200.0, 50.0]);
    }

    #[test]
    fn a_chart_contains_what_both_axes_contain() {
        let (x, y) = (Axis::linear("x", [0.0, 1.0]), Axis::linear("y", [0.0, 10.0]));
        let chart = Chart::new([10.0, 20.0], [110.0, 220.0], x, y);
        let inside = [[0.0, 0.0], [1.0, 10.0], [0.5, 3.0]];
        let outside = [[-0.1, 5.0], [1.1, 5.0], [0.5, -1.0], [0.5, 11.0]];
        assert!(inside.into_iter().all(|point| chart.contains(point)));
        assert!(!outside.into_iter().any(|point| chart.contains(point)));
        assert_eq!(chart.to_pixel([0.0, 10.0]), [10.0, 20.0]);
    }

    #[test]
    fn equal_scales_show_a_circle_as_a_circle() {
        for (x, y) in
            [([0.0, 10.0], [0.0, 2.0]), ([0.0, 1.0], [0.0, 90.0]), ([-3.0, 3.0], [-1.0, 1.0])]
        {
            let axes = (Axis::linear("x", x), Axis::linear("y", y));
            let chart =
                Chart::new([100.0, 50.0], [500.0, 250.0], axes.0, axes.1).with_equal_scales();
            let [a, b] = [[0.0, 0.0], [0.3, 0.7]].map(|point| chart.to_pixel(point));
            let scales = [(b[0] - a[0]) / 0.3, (a[1] - b[1]) / 0.7];
            assert!((scales[0] / scales[1] - 1.0).abs() < 1e-12, "{scales:?}");
            // What was asked for is still inside.
            assert!(chart.contains([x[0], y[0]]) && chart.contains([x[1], y[1]]), "{x:?} {y:?}");
        }
    }

    /// True if a part of an image is not white everywhere.
    fn is_inked(canvas: &Canvas, [left, right]: [u32; 2], [top, bottom]: [u32; 2]) -> bool {
        let place = |x: u32, y: u32| 3 * (y * canvas.size()[0] + x) as usize;
        let colors = (top..bottom).flat_map(|y| (left..right).map(move |x| place(x, y)));
        colors.into_iter().any(|at| canvas.pixels()[at..at + 3] != [0xff; 3])
    }

    #[test]
    fn a_chart_has_a_frame_and_a_label_beside_every_tick() {
        let (x, y) = (Axis::linear("", [0.0, 1.0]), Axis::linear("", [0.0, 10.0]));
        let chart = Chart::new([100.0, 80.0], [300.0, 240.0], x, y);
        let mut canvas = Canvas::new([400, 300]);
        chart.draw(&mut canvas, "");
        let black = |x: usize, y: usize| {
            let at = 3 * (y * 400 + x);
            canvas.pixels()[at..at + 3] == BLACK
        };
        assert!((100..=300).all(|x| black(x, 80) && black(x, 240)));
        assert!((80..=240).all(|y| black(100, y) && black(300, y)));
        // Values from 0 to 10 in steps of 2 over 160 pixels, the labels left of the frame.
        for tick in 0..=5 {
            let y = 240 - 32 * tick;
            assert!(is_inked(&canvas, [40, 100], [y - 8, y + 8]), "{tick}");
        }
        assert!(!is_inked(&canvas, [0, 40], [0, 300]));
        assert_eq!(chart.to_pixels(&[[0.0, 0.0], [1.0, 10.0]]), [[100.0, 240.0], [300.0, 80.0]]);
    }

    #[test]
    fn the_name_of_an_entry_stands_behind_its_sample_and_the_next_one_below() {
        let mut canvas = Canvas::new([200, 100]);
        let mut legend = Legend::new([20.0, 20.0]);
        legend.curve(&mut canvas, "H", BLACK, Stroke::Solid);
        // The sample, a gap, the name.
        assert!((20..70).all(|x| is_inked(&canvas, [x, x + 1], [20, 40])));
        assert!(!is_inked(&canvas, [72, 80], [0, 100]) && is_inked(&canvas, [80, 120], [20, 40]));
        assert!(!is_inked(&canvas, [0, 200], [44, 100]));
        legend.marker(&mut canvas, "H", BLACK);
        assert!(is_inked(&canvas, [30, 60], [44, 100]));
    }
}
