//! Widgets that several panels share.

use egui::{Button, Color32, ProgressBar, RectAlign, Response, RichText, Sense, Tooltip, Ui, vec2};
use egui_plot::{AxisHints, GridInput, GridMark, Line, Plot};

use crate::studio::actions::{Actions, UiAction};
use crate::studio::number;

/// The room for the numbers at the left of a plot, in points.
const AXIS_WIDTH: f32 = 40.0;
/// The least distance of two marks with their numbers in points, along an axis to the right and one
/// upwards.
const APART: [f64; 2] = [48.0, 22.0];
/// The digits of the number of a mark.
const MARK_DIGITS: i32 = 6;
/// The distance of two marks of a logarithmic axis in points, and the share of it which two have at
/// least.
const LOG_APART: f64 = 29.0;
const CROWDED: f64 = 0.6;

/// A button that asks for one action.
#[derive(Debug)]
pub(super) struct ActionButton<'a> {
    text: &'a str,
    enabled: bool,
    action: UiAction,
    hint: &'a str,
}

impl<'a> ActionButton<'a> {
    pub(super) fn new(text: &'a str, enabled: bool, action: impl Into<UiAction>) -> Self {
        Self { text, enabled, action: action.into(), hint: "" }
    }

    pub(super) fn hint(self, hint: &'a str) -> Self {
        Self { hint, ..self }
    }
}

/// Shows buttons in a row.
pub(super) fn action_buttons<'a>(
    ui: &mut Ui,
    buttons: impl IntoIterator<Item = ActionButton<'a>>,
    actions: &mut Actions,
) {
    for ActionButton { text, enabled, action, hint } in buttons {
        if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hint).clicked() {
            actions.push(action);
        }
    }
}

/// Shows the main button of a panel; true if it was pressed. `reason` says why it is disabled.
pub(super) fn main_button(
    ui: &mut Ui,
    text: &str,
    enabled: bool,
    hint: &str,
    reason: &str,
) -> bool {
    let fill = ui.visuals().selection.bg_fill;
    let button = Button::new(RichText::new(text).strong()).fill(fill);
    let button = ui.add_enabled(enabled, button).on_hover_text(hint);
    button.on_disabled_hover_text(reason).clicked()
}

/// A progress bar with a text that is legible on its filled and on its empty part.
pub(in crate::studio) fn progress_bar(ui: &Ui, share: f32, text: impl Into<String>) -> ProgressBar {
    let text = RichText::new(text).color(ui.visuals().strong_text_color());
    ProgressBar::new(share).text(text)
}

/// Explains an item of a menu beside it, where the explanation covers no other item.
pub(in crate::studio) fn hint_beside(item: Response, text: &str) -> Response {
    let right = item.rect.right();
    hint_right_of(item, right, text)
}

/// The same right of a place, for an item with others beside it.
pub(in crate::studio) fn hint_right_of(item: Response, right: f32, text: &str) -> Response {
    let beside = item.rect.with_max_x(right.max(item.rect.right()));
    let mut hint = Tooltip::for_enabled(&item);
    hint.popup = hint.popup.anchor(beside).align(RectAlign::RIGHT_START);
    hint.show(|ui| {
        ui.set_max_width(ui.spacing().tooltip_width);
        ui.label(text)
    });
    item
}

/// The distances in points from which a mark appears and from which it is seen well.
const MARKS: [f32; 2] = [8.0, 20.0];

/// A plot that can be neither moved nor zoomed. Its marks are round, and each has its number.
pub(super) fn fixed_plot(ui: &Ui, name: &str, height: f32) -> Plot<'static> {
    let plot = Plot::new(name).height(height).allow_drag(false).allow_scroll(false);
    let plot = plot.allow_zoom(false).allow_boxed_zoom(false);
    let plot = plot.grid_color(ui.visuals().widgets.noninteractive.bg_stroke.color);
    round_axes(plot, [AxisHints::new_x(), AxisHints::new_y()])
}

/// Gives a plot axes with round numbers as their marks, two at least however short an axis is, and each with
/// its number.
pub(super) fn round_axes(plot: Plot<'static>, axes: [AxisHints<'static>; 2]) -> Plot<'static> {
    let [x, y] = axes.map(|axis| {
        let axis = axis.label_spacing(MARKS[0]..=MARKS[1]);
        axis.formatter(|mark, _| {
            // Marks that are close to each other differ in what they show.
            let digits = number::digits_between(mark.value, mark.step_size, MARK_DIGITS);
            number::format_digits(mark.value, digits)
        })
    });
    plot.custom_x_axes(vec![x])
        .custom_y_axes(vec![y])
        .grid_spacing(MARKS[0]..=MARKS[1])
        .x_grid_spacer(|input| round_marks(&input, APART[0]))
        .y_grid_spacer(|input| round_marks(&input, APART[1]))
}

/// The number of points of a curve above which those of one column of pixels are drawn together.
const MANY: usize = 4000;
/// The distance of two points below which they are one, relative to the size of their curve.
const SAME: f64 = 1e-5;

/// A curve of a plot, every point of which is drawn. The toolkit would draw those of one column of pixels
/// together as a band, which the curve beside a steep part widens to a wedge; and three points at one
/// place have no direction to draw a line in.
pub(super) fn plot_curve(
    name: impl Into<String>,
    points: impl IntoIterator<Item = [f64; 2]>,
) -> Line<'static> {
    let mut points: Vec<[f64; 2]> = points.into_iter().collect();
    let size = [0, 1].map(|axis| {
        let values = points.iter().map(|point| point[axis]).filter(|value| value.is_finite());
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    });
    let is_same = |a: f64, b: f64, axis: usize| (a - b).abs() <= SAME * size[axis];
    points.dedup_by(|a, b| is_same(a[0], b[0], 0) && is_same(a[1], b[1], 1));
    let many = points.len() > MANY;
    Line::new(name, points).allow_band(many)
}

/// The multiples of 1, 2 or 5 times a power of ten, some points apart from each other.
fn round_marks(input: &GridInput, apart: f64) -> Vec<GridMark> {
    // The base step is that of the least distance at which a mark is drawn.
    let step_size = round_above(input.base_step_size * apart / f64::from(MARKS[0]));
    let marks = multiples(input.bounds, step_size);
    marks.map(|value| GridMark { value, step_size }).collect()
}

/// Gives a plot of decimal logarithms an axis with round numbers as its marks, and a title.
pub(super) fn log_axis(plot: Plot<'static>, title: &str) -> Plot<'static> {
    let plot = plot.y_axis_label(title).y_axis_min_width(AXIS_WIDTH);
    let plot = plot.y_grid_spacer(|input| {
        let step_size = input.bounds.1 - input.bounds.0;
        let apart = LOG_APART / f64::from(MARKS[0]);
        let marks = log_marks(input.bounds, apart * input.base_step_size);
        marks.into_iter().map(|value| GridMark { value, step_size }).collect()
    });
    plot.y_axis_formatter(|mark, range| {
        let value = 10_f64.powf(mark.value);
        // A third of the range is about the distance of two marks.
        let step = value * (10_f64.powf(0.3 * (range.end() - range.start())) - 1.0);
        number::format_digits(value, number::digits_between(value, step, 2))
    })
}

/// The decimal logarithms of round numbers between two places, about `apart` from each other: of
/// decades, else of 1, 2 and 5 or of 1 and 3 in each, else of multiples of one step.
fn log_marks((low, high): (f64, f64), apart: f64) -> Vec<f64> {
    if !(low.is_finite() && high.is_finite() && low < high && apart > 0.0) {
        return Vec::new();
    }
    let mut found: Vec<f64> = multiples((low, high), apart.max(1.0).ceil()).collect();
    for (parts, closest) in [(&[1.0_f64, 2.0, 5.0][..], 2.0_f64), (&[1.0, 3.0], 3.0)] {
        if found.len() < 3 && CROWDED * apart <= closest.log10() {
            let all = multiples((low - 1.0, high), 1.0);
            let parts = all.flat_map(|decade| parts.iter().map(move |part| decade + part.log10()));
            let parts: Vec<f64> = parts.filter(|place| (low..=high).contains(place)).collect();
            found = if parts.len() > found.len() { parts } else { found };
        }
    }
    if found.len() < 3 {
        let even = even_marks((low, high), apart);
        found = if even.len() > found.len() { even } else { found };
    }
    found
}

/// The logarithms of multiples of the smallest round step whose marks have their distance; two marks
/// may be nearer to each other than that.
fn even_marks((low, high): (f64, f64), apart: f64) -> Vec<f64> {
    let [first, last] = [low, high].map(|place| 10_f64.powf(place));
    let mut step = round_above(last - first);
    let mut found = Vec::new();
    for _ in 0..12 {
        let marks = multiples((first, last), step).map(f64::log10);
        let marks: Vec<f64> = marks.filter(|place| (low..=high).contains(place)).collect();
        let least = if found.len() < 2 { CROWDED * apart } else { apart };
        if marks.windows(2).any(|two| two[1] - two[0] < least) {
            break;
        }
        found = marks;
        // From 5 to 2, and else by half.
        let is_five = (step / 10_f64.powf(step.log10().floor())).round() == 5.0;
        step *= if is_five { 0.4 } else { 0.5 };
    }
    found
}

/// The multiples of a step between two numbers, a hundred at most.
fn multiples((low, high): (f64, f64), step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step).ceil();
    (0..100).map(move |i| (first + f64::from(i)) * step).take_while(move |value| *value <= high)
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below a number.
fn round_above(value: f64) -> f64 {
    let decade = 10_f64.powf(value.log10().floor());
    let parts = [1.0, 2.0, 5.0, 10.0].map(|part| part * decade);
    parts.into_iter().find(|part| *part >= value).unwrap_or(10.0 * decade)
}

/// A small square of a colour, as in a legend.
pub(super) fn swatch(ui: &mut Ui, color: Color32) {
    let (rect, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
    ui.painter().rect_filled(rect, 1.0, color);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis_has_marks_however_short_it_is() {
        for range in [0.001, 0.03, 0.1, 0.3, 0.5, 0.9, 1.5, 3.0, 6.0, 20.0] {
            for low in [-7.3, -2.3, 0.1] {
                let apart = 0.29 * range;
                let marks = log_marks((low, low + range), apart);
                let inside = marks.iter().all(|mark| (low..=low + range).contains(mark));
                let apart = marks.windows(2).all(|two| two[1] - two[0] > 0.59 * apart);
                assert!(marks.len() >= 2 && inside && apart, "{low} {range}: {marks:?}");
            }
        }
        assert!(log_marks((1.0, f64::INFINITY), 0.1).is_empty());
    }

    #[test]
    fn the_marks_of_a_logarithmic_axis_are_round() {
        let values = |low: f64, high: f64, apart| {
            let marks = log_marks((low.log10(), high.log10()), apart);
            marks.into_iter().map(|mark| number::format_digits(10_f64.powf(mark), 4)).collect()
        };
        let near: Vec<String> = values(0.0119, 0.021, 0.07);
        assert_eq!(near, ["0.015", "0.02"]);
        let parts: Vec<String> = values(0.09, 2.2, 0.29);
        assert_eq!(parts, ["0.1", "0.2", "0.5", "1", "2"]);
        let thirds: Vec<String> = values(0.000_486, 0.00718, 0.63);
        assert_eq!(thirds, ["0.001", "0.003"]);
        let decades: Vec<String> = values(0.9e-6, 2.0, 1.8);
        assert_eq!(decades, ["1e-6", "0.0001", "0.01", "1"]);
    }
}
