//! The loosest tolerances for a spot or a yield: a form, their table by price class, and what applies them.

use egui::{Grid, RichText, Ui};

use super::sheet_editor::SheetEditor;
use super::text::{error_name, half_range_text};
use crate::lens::ToleranceSheet;
use crate::session::{AsBuiltLens, LoosestGoal, LoosestTolerances, PanelSetting};
use crate::studio::form::number_field;
use crate::studio::number;
use crate::studio::panels::widgets::hint_beside;
use crate::tolerance::PriceClass;

/// The form.
#[derive(Debug)]
pub(super) struct LoosestForm {
    /// True to ask for a yield, false for an expected spot.
    by_yield: bool,
    /// The yield in percent.
    percent: f64,
    /// The spot in µm; `None` until it is typed.
    um: Option<f64>,
}

impl Default for LoosestForm {
    fn default() -> Self {
        Self { by_yield: true, percent: 90.0, um: None }
    }
}

/// The spot that is proposed, relative to the mean of lenses as they are made now.
const PROPOSED: f64 = 1.2;

impl LoosestForm {
    /// Shows the form, and the tolerances that were found.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        made: &AsBuiltLens,
        asked: Option<LoosestGoal>,
        editor: &mut SheetEditor<'_>,
    ) {
        self.goal(ui, made, asked, editor);
        match &made.loosest {
            Some(Ok(found)) if asked.is_some() => {
                table(ui, (found, &made.nominal.semi_diameters), editor);
            }
            Some(Err(why)) if asked.is_some() => {
                ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
            }
            _ if asked.is_some() => drop(ui.weak("Computing …")),
            _ => {}
        }
    }

    fn goal(
        &mut self,
        ui: &mut Ui,
        made: &AsBuiltLens,
        asked: Option<LoosestGoal>,
        editor: &mut SheetEditor<'_>,
    ) {
        let proposed = 1e3 * PROPOSED * made.analysis.spots[1].form_mean_rms;
        let mut um = self.um.unwrap_or(proposed);
        ui.horizontal_wrapped(|ui| {
            ui.selectable_value(&mut self.by_yield, true, "For a yield");
            ui.selectable_value(&mut self.by_yield, false, "For an expected RMS");
            if self.by_yield {
                number_field(ui, "Yield", &mut self.percent, " %");
                ui.label("of the lenses at most");
            }
            if number_field(ui, "Refocused RMS", &mut um, " µm").changed() {
                self.um = Some(um);
            }
            let rms = 1e-3 * um;
            let goal = if self.by_yield {
                LoosestGoal::Yield { rms, share: 0.01 * self.percent }
            } else {
                LoosestGoal::Rms(rms)
            };
            let hint = "Finds the loosest tolerances that reach it, refocused: each error costs about \
                        the same. Real lenses confirm them";
            if ui.button("Find them").on_hover_text(hint).clicked() {
                editor.show(PanelSetting::Loosest(Some(goal)));
            }
            if asked.is_some() && ui.button("Dismiss").clicked() {
                editor.show(PanelSetting::Loosest(None));
            }
        });
    }
}

/// The tolerances with their prices, and buttons that make them those of the lens.
fn table(
    ui: &mut Ui,
    (found, semi_diameters): (&LoosestTolerances, &[f64]),
    editor: &mut SheetEditor<'_>,
) {
    remarks(ui, found);
    ui.horizontal_wrapped(|ui| {
        let by_class = found.by_class();
        let choices = [
            ("Apply", "Makes these the tolerances of the lens, as one undo step", &found.sheet),
            (
                "Apply the classes",
                "The same with each as wide as its price class has it",
                &by_class,
            ),
        ];
        for (text, hint, sheet) in choices {
            if ui.button(text).on_hover_text(hint).clicked() {
                let sheet: ToleranceSheet = sheet.clone();
                editor.change(|own| *own = sheet);
            }
        }
    });
    Grid::new("loosest tolerances").num_columns(5).striped(true).show(ui, |ui| {
        for (title, hint) in COLUMNS {
            hint_beside(ui.weak(title), hint);
        }
        ui.end_row();
        for (own, price) in found.sheet.errors.iter().zip(&found.prices) {
            let before = editor.sheet.errors.iter().find(|before| before.error == own.error);
            let now =
                before.map(|before| half_range_text(own.error, semi_diameters, before.half_range));
            ui.label(RichText::new(error_name(own.error)).small());
            ui.label(now.unwrap_or_default());
            ui.label(half_range_text(own.error, semi_diameters, own.half_range));
            ui.label(price.map_or("", |(class, _)| class.name()));
            ui.label(price.map_or_else(String::new, |(_, range)| {
                half_range_text(own.error, semi_diameters, range)
            }));
            ui.end_row();
        }
    });
}

/// The yield, the number of tolerances of each class, and what the rays say.
fn remarks(ui: &mut Ui, found: &LoosestTolerances) {
    let classes =
        [PriceClass::Commercial, PriceClass::Precision, PriceClass::ShopLimit, PriceClass::Beyond];
    let count =
        |class: PriceClass| found.prices.iter().flatten().filter(|(own, _)| *own == class).count();
    let counts = classes.map(|class| format!("{} {}", count(class), class.name()));
    ui.label(counts.join(", "));
    if let Some([own, by_class]) = found.good {
        let [own, by_class] = [own, by_class].map(|share| 100.0 * share);
        ui.label(format!("Yield by the quadratic form {own:.1} %; at the classes {by_class:.1} %"));
    }
    let warn = ui.visuals().warn_fg_color;
    if let Some([real, form]) = found.confirmed {
        let [a, b] = [real, form].map(|mm| number::format_digits(1e3 * mm, 3));
        let count = found.lenses;
        let text = format!("Refocused RMS of {count} lenses {a} µm by rays, {b} µm by the form");
        let agrees = found.disagreement().is_none();
        let text = if agrees { RichText::new(text) } else { RichText::new(text).color(warn) };
        ui.label(text);
    }
    if found.held > 0 {
        let text =
            format!("{} are held at ten times the commercial class or their own", found.held);
        ui.label(RichText::new(text).small().weak());
    }
}

/// The columns of the table with their explanations.
const COLUMNS: [(&str, &str); 5] = [
    ("Error", "The error of making"),
    ("± now", "Half of the permitted range so far"),
    ("± loosest", "Half of the range with which the goal is reached"),
    ("Class", "The loosest class of care that keeps it: its price"),
    ("± of the class", "Half of the range of that class"),
];
