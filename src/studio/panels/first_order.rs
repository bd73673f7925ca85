//! The first-order data of a lens: focal lengths, pupils, and the third-order sums.

use egui::{
    Align, Color32, Frame, Grid, Label, Layout as Arrange, Margin, RichText, ScrollArea, Ui,
};

use super::{Panel, displayed_results, show_missing_results};
use crate::lens::{Lens, Medium};
use crate::paraxial::{FirstOrder, ParaxialPupil, Seidel, SeidelSums};
use crate::session::SessionView;
use crate::studio::actions::Actions;
use crate::studio::number;

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
            data(ui, &results.lens, numbers.first_order());
            ui.add_space(6.0);
            ScrollArea::horizontal().show(ui, |ui| match &numbers.seidel.value {
                Some(seidel) => sums(ui, &results.lens, seidel),
                None if numbers.ray_model.value.has_grin() => drop(ui.weak(
                    "No third-order sums: those of a gradient-index medium are not implemented",
                )),
                None => drop(ui.weak("No third-order sums: the lens has no paraxial chief ray")),
            });
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

fn data(ui: &mut Ui, lens: &Lens, first: &FirstOrder<f64>) {
    ui.spacing_mut().item_spacing.y = 1.0;
    for (i, DataLine(name, value, meaning)) in lines(lens, first).into_iter().enumerate() {
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

fn lines(lens: &Lens, first: &FirstOrder<f64>) -> Vec<DataLine> {
    let track: f64 = lens.surfaces.iter().map(|row| row.thickness).sum();
    let petzval = (first.petzval_sum != 0.0).then(|| -1.0 / first.petzval_sum);
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
        pupil_place("Entrance pupil at", first.entrance_pupil, "From the first vertex"),
        pupil_size("Entrance pupil size", first.entrance_pupil),
        pupil_place("Exit pupil at", first.exit_pupil, "From the last vertex"),
        pupil_size("Exit pupil size", first.exit_pupil),
        DataLine(
            "Stop semi-diameter",
            mm(Some(first.stop_semi_diameter)),
            "Height of the marginal ray at the stop",
        ),
        DataLine(
            "Image behind focus",
            mm(first.image_defocus),
            "Image plane from the paraxial image",
        ),
        DataLine("Magnification", plain(first.magnification), "None for an object at infinity"),
        DataLine("Lagrange invariant", mm(first.lagrange), "n (ū y − u ȳ), the same everywhere"),
        DataLine("Petzval radius", mm(petzval), "Radius of the image surface without astigmatism"),
        DataLine("Total track", mm(Some(track)), "From the first vertex to the image, as written"),
    ]
}

fn pupil_place(name: &'static str, pupil: ParaxialPupil<f64>, from: &'static str) -> DataLine {
    let place = pupil.position.map_or_else(|| "Infinity".to_owned(), |z| mm(Some(z)));
    DataLine(name, place, from)
}

fn pupil_size(name: &'static str, pupil: ParaxialPupil<f64>) -> DataLine {
    let size = pupil.diameter.map_or_else(|| "telecentric".to_owned(), |d| mm(Some(d)));
    DataLine(name, size, "Its diameter")
}

fn plain(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| number::format_digits(value, 6))
}

fn mm(value: Option<f64>) -> String {
    value.map_or_else(
        || "none".to_owned(),
        |value| format!("{} mm", number::format_digits(value, 6)),
    )
}

/// The columns of the sums with their explanations.
const SUMS: [(&str, &str); 7] = [
    ("S1", "Spherical aberration"),
    ("S2", "Coma"),
    ("S3", "Astigmatism"),
    ("S4", "Petzval curvature"),
    ("S5", "Distortion"),
    ("C1", "Axial colour between the outer wavelengths"),
    ("C2", "Lateral colour between the outer wavelengths"),
];

const fn row_of(sums: &SeidelSums<f64>) -> [f64; 7] {
    [sums.s1, sums.s2, sums.s3, sums.s4, sums.s5, sums.c1, sums.c2]
}

fn sums(ui: &mut Ui, lens: &Lens, seidel: &Seidel<f64>) {
    ui.label(RichText::new("Seidel sums, µm").strong()).on_hover_text(
        "Third-order wave aberrations at the edge of pupil and field, surface by surface \
         (Welford's S1 to S5, C1, C2); the tint shows where they come from",
    );
    Grid::new("seidel").num_columns(8).spacing([4.0, 2.0]).show(ui, |ui| {
        ui.weak("Surf");
        for (name, meaning) in SUMS {
            right(ui, |ui| drop(ui.weak(name).on_hover_text(meaning)));
        }
        ui.end_row();
        for (i, sums) in seidel.surfaces.iter().enumerate() {
            let stop = lens.surfaces.get(i).is_some_and(|row| row.stop);
            ui.label(if stop { format!("{} STO", i + 1) } else { (i + 1).to_string() });
            numbers(ui, sums, &largest(seidel));
        }
        ui.strong("Sum");
        numbers(ui, &seidel.total, &[f64::INFINITY; 7]);
    });
}

/// The largest contribution to each sum.
fn largest(seidel: &Seidel<f64>) -> [f64; 7] {
    let mut most = [0.0_f64; 7];
    for sums in &seidel.surfaces {
        for (most, value) in most.iter_mut().zip(row_of(sums)) {
            *most = most.max(value.abs());
        }
    }
    most
}

fn numbers(ui: &mut Ui, sums: &SeidelSums<f64>, largest: &[f64; 7]) {
    for (value, largest) in row_of(sums).into_iter().zip(largest) {
        let share = if *largest > 0.0 { value / largest } else { 0.0 };
        right(ui, |ui| {
            let text = RichText::new(fixed(1e3 * value)).small();
            let tint = tint(ui, share);
            ui.label(text.background_color(tint));
        });
    }
    ui.end_row();
}

/// A number with at most five characters besides its sign, so that columns stay narrow.
fn fixed(value: f64) -> String {
    let size = value.abs();
    if size >= 1e5 || (size < 1e-3 && size > 0.0) {
        format!("{value:.1e}")
    } else if size >= 100.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.3}")
    }
}

/// The tint of a contribution: red for positive, blue for negative.
fn tint(ui: &Ui, share: f64) -> Color32 {
    let color =
        if share > 0.0 { ui.visuals().error_fg_color } else { ui.visuals().hyperlink_color };
    color.gamma_multiply((0.4 * share.abs()) as f32)
}

fn right(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    ui.with_layout(Arrange::right_to_left(Align::Center), show);
}
