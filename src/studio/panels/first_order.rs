//! The first-order data of a lens: focal lengths and pupils.

use egui::{Align, Color32, Frame, Label, Layout as Arrange, Margin, RichText, ScrollArea, Ui};

use super::{Panel, displayed_results, show_missing_results, total_track};
use crate::lens::{Lens, Medium};
use crate::paraxial::{FirstOrder, ParaxialPupil};
use crate::session::SessionView;
use crate::studio::actions::Actions;
use crate::studio::number;

/// The greatest width of a line in points: with more, name and value are not read together.
const WIDEST: f32 = 380.0;
/// The length in mm below which a value is not told by its digits: a nanometre.
const SHORTEST: f64 = 1e-6;

/// The panel.
#[derive(Debug)]
pub struct FirstOrderPanel;

impl Panel for FirstOrderPanel {
    fn title(&self) -> &'static str {
        "First order"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, _actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            if numbers.first_order().efl.is_none() {
                ui.weak(without_focus(&results.lens));
            }
            ui.set_max_width(ui.available_width().min(WIDEST));
            let track = total_track(&results.lens, results.settings.zoom);
            data(ui, track, numbers.first_order());
        });
    }
}

/// The reason why a lens has no focal length, and the remedy.
fn without_focus(lens: &Lens) -> &'static str {
    if lens.surfaces.iter().all(|row| row.medium == Medium::Air) {
        "There is no glass yet. Add an element from the menu Element, or a glass in the table."
    } else {
        "Parallel light stays parallel: the lens has no focal length."
    }
}

/// A name, a value with its unit, and an explanation.
struct DataLine(&'static str, String, &'static str);

fn data(ui: &mut Ui, track: Option<f64>, first: &FirstOrder<f64>) {
    ui.spacing_mut().item_spacing.y = 1.0;
    for (i, DataLine(name, value, meaning)) in lines(track, first).into_iter().enumerate() {
        let striped = if i % 2 == 0 { ui.visuals().faint_bg_color } else { Color32::TRANSPARENT };
        // The scroll bar floats over the right end.
        let margin = Margin { left: 3, right: 10, top: 1, bottom: 1 };
        Frame::new().fill(striped).inner_margin(margin).show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.label(name).on_hover_text(meaning);
                right(ui, |ui| drop(ui.add(Label::new(RichText::new(value).strong()).truncate())));
            });
        });
    }
}

fn lines(track: Option<f64>, first: &FirstOrder<f64>) -> Vec<DataLine> {
    // What lengths of this size leave by rounding is zero.
    let size = track.unwrap_or(0.0) + first.efl.unwrap_or(0.0).abs();
    let mm = |value: Option<f64>| mm(value.map(|value| number::without_rounding(value, size)));
    vec![
        DataLine("Focal length", mm(first.efl), "Equivalent focal length, one over the power"),
        DataLine(
            "Back focal length",
            mm(first.bfl),
            "From the last vertex to the back focal point",
        ),
        DataLine(
            "Front focal length",
            mm(first.ffl),
            "From the first vertex to the front focal point",
        ),
        DataLine("F-number", plain(first.f_number), "Focal length over entrance pupil diameter"),
        DataLine(
            "Working f-number",
            plain(first.working_f_number),
            "One over twice the numerical aperture in the image space",
        ),
        pupil_place("Entrance pupil at", first.entrance_pupil, size, "From the first vertex"),
        pupil_diameter("Entrance pupil diameter", first.entrance_pupil),
        pupil_place("Exit pupil at", first.exit_pupil, size, "From the last vertex"),
        pupil_diameter("Exit pupil diameter", first.exit_pupil),
        DataLine(
            "Stop semi-diameter",
            mm(Some(first.stop_semi_diameter)),
            "Height of the marginal ray at the stop",
        ),
        DataLine("Defocus", mm(first.image_defocus), "Image plane from the paraxial image"),
        DataLine("Magnification", plain(first.magnification), "None for an object at infinity"),
        DataLine("Lagrange invariant", mm(first.lagrange), "n (ū y − u ȳ), the same everywhere"),
        DataLine(
            "Petzval radius",
            mm(first.petzval_radius()),
            "Radius of the image surface without astigmatism",
        ),
        DataLine("Total track", mm(track), "From the first vertex to the image plane"),
    ]
}

/// The place of a pupil of a lens of a size.
fn pupil_place(
    name: &'static str,
    pupil: ParaxialPupil<f64>,
    size: f64,
    from: &'static str,
) -> DataLine {
    let place = pupil.position.map(|z| mm(Some(number::without_rounding(z, size))));
    let place = place.unwrap_or_else(|| "Infinity".to_owned());
    DataLine(name, place, from)
}

fn pupil_diameter(name: &'static str, pupil: ParaxialPupil<f64>) -> DataLine {
    let size = pupil.diameter.map_or_else(|| "telecentric".to_owned(), |d| mm(Some(d)));
    DataLine(name, size, "Paraxial")
}

fn plain(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| number::format_digits(value, 6))
}

/// A length with its unit: micrometres below a hundredth of a millimetre, no digits below a nanometre.
fn mm(value: Option<f64>) -> String {
    let Some(value) = value else { return "none".to_owned() };
    if value != 0.0 && value.abs() < SHORTEST {
        return "below 0.001 µm".to_owned();
    }
    let is_small = value != 0.0 && value.abs() < 0.01;
    let (value, unit) = if is_small { (1e3 * value, "µm") } else { (value, "mm") };
    format!("{} {unit}", number::format_digits(value, 6))
}

fn right(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    ui.with_layout(Arrange::right_to_left(Align::Center), show);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_lengths_are_short() {
        let texts = [6.500_74e-5, 0.5, 0.0, -0.009, -8.9e-10].map(|value| mm(Some(value)));
        assert_eq!(texts, ["0.0650074 µm", "0.5 mm", "0 mm", "-9 µm", "below 0.001 µm"]);
    }
}
