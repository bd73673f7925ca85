//! Errors of making: what each of them does to the lens, and how sharp the lenses are that are made.

mod add_error;
mod charts;
mod compensators;
mod correlations;
mod errors;
mod inverse;
mod shares;
mod sheet_editor;
mod summary;
mod text;

use std::sync::Arc;

use egui::{CollapsingHeader, ComboBox, DragValue, RichText, ScrollArea, Ui};

use self::add_error::ErrorForm;
use self::compensators::CompensatorList;
use self::correlations::CorrelationList;
use self::errors::ErrorList;
use self::inverse::LoosestForm;
use self::sheet_editor::{SheetEditor, refusal};
use super::{Panel, displayed_results, show_missing_results};
use crate::lens::{Edit, Lens, ToleranceSheet};
use crate::report::PaperKind;
use crate::session::{AsBuiltLens, Command, PanelSetting, SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::form::named_list;
use crate::tolerance::ToleranceGrade;

/// The least width of the panel at which charts stand beside numbers, and bars beside the list.
const BESIDE: f32 = 560.0;
/// The least width at which the two charts stand beside each other.
const CHARTS_BESIDE: f32 = 640.0;
/// The least width at which the bars of groups stand beside the list of errors.
const BARS_BESIDE: f32 = 860.0;

/// The lens as it is made, or the reason why nothing is known of it.
type MadeResult = Arc<Timed<Result<AsBuiltLens, String>>>;

/// The panel.
#[derive(Debug)]
pub struct TolerancesPanel {
    errors: ErrorList,
    form: ErrorForm,
    compensators: CompensatorList,
    correlations: CorrelationList,
    loosest: LoosestForm,
    /// The reason why the last change of the tolerances was refused.
    refused: Option<String>,
    /// The treatment of the focus of the histogram: 0 for the fixed image plane, 1 refocused.
    focus: usize,
    /// The lens as it is made, as last computed, and the lens as designed.
    latest: Option<(MadeResult, Arc<Lens>)>,
}

impl Default for TolerancesPanel {
    fn default() -> Self {
        Self {
            errors: ErrorList::default(),
            form: ErrorForm::default(),
            compensators: CompensatorList::default(),
            correlations: CorrelationList::default(),
            loosest: LoosestForm::default(),
            refused: None,
            focus: 1,
            latest: None,
        }
    }
}

impl Panel for TolerancesPanel {
    fn title(&self) -> &'static str {
        "Tolerances"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        if let Some(own) = &numbers.as_built {
            self.latest = Some((Arc::clone(own), Arc::clone(&results.lens)));
        }
        let Some((shown, lens)) = self.latest.clone() else {
            ui.weak("Computing …");
            return;
        };
        // Numbers of the lens before are told from its own by their colour.
        if numbers.as_built.is_none() {
            ui.visuals_mut().override_text_color = Some(ui.visuals().weak_text_color());
        }
        match &shown.value {
            Ok(made) => self.show(ui, &Shown { view, lens: &lens, made, ms: shown.ms }, actions),
            Err(why) => self.show_failure(ui, view, why, actions),
        }
    }
}

/// True while the panels show the design.
fn shows_design(view: &SessionView) -> bool {
    let candidate = view.candidate.as_ref().is_some_and(|candidate| candidate.shown);
    view.preview_results.is_none() && !candidate
}

/// The lens that the panel shows, as designed and as it is made.
struct Shown<'a> {
    view: &'a SessionView,
    /// The lens as designed.
    lens: &'a Lens,
    /// The lens as it is made.
    made: &'a AsBuiltLens,
    /// The time that this has taken, in milliseconds.
    ms: f64,
}

impl Shown<'_> {
    /// True if what is shown is of the design, not of a candidate: only its tolerances can be changed.
    fn is_design(&self) -> bool {
        shows_design(self.view)
    }

    /// The tolerances: those of the design as they are now, whose effects may still be computed.
    fn sheet(&self) -> &ToleranceSheet {
        let own = self.view.lens.tolerances.as_ref().filter(|_| self.is_design());
        own.unwrap_or(&self.made.sheet)
    }

    /// The shares of the errors of those tolerances; `None` while they are computed for other errors.
    fn shares(&self) -> Option<&[[f64; 2]]> {
        let errors = |sheet: &ToleranceSheet| -> Vec<_> {
            sheet.errors.iter().map(|own| own.error).collect()
        };
        (errors(self.sheet()) == errors(&self.made.sheet)).then_some(&self.made.shares)
    }
}

impl TolerancesPanel {
    fn show(&mut self, ui: &mut Ui, shown: &Shown<'_>, actions: &mut Actions) {
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.add_enabled_ui(shown.is_design(), |ui| {
                ui.horizontal_wrapped(|ui| {
                    choose_grade(ui, shown.view, Some(shown.made), actions);
                    choose_limit(ui, shown.view, shown.made, actions);
                    choose_frequency(ui, shown.view, actions);
                    export_buttons(ui, actions);
                });
            });
            summary::facts(ui, shown.made, shown.ms);
            self.results(ui, shown, actions);
            self.adjustments(ui, shown, actions);
            self.error_list(ui, shown, actions);
        });
    }

    /// Tolerances that lead to no result, so that they can be changed or removed.
    fn show_failure(&mut self, ui: &mut Ui, view: &SessionView, why: &str, actions: &mut Actions) {
        choose_grade(ui, view, None, actions);
        ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
        let Some(sheet) = view.lens.tolerances.as_ref() else { return };
        let refused = &mut self.refused;
        let mut editor = SheetEditor { lens: &view.lens, sheet, refused, actions };
        let editable = shows_design(view);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let rims: Vec<f64> =
                view.lens.surfaces.iter().map(|row| row.semi_diameter.unwrap_or(0.0)).collect();
            self.errors.show(ui, (None, &rims), editable, &mut editor);
        });
    }

    /// The compensators, the correlations of errors, and the loosest tolerances.
    fn adjustments(&mut self, ui: &mut Ui, shown: &Shown<'_>, actions: &mut Actions) {
        let (refused, editable) = (&mut self.refused, shown.is_design());
        let sheet = shown.sheet();
        let mut editor = SheetEditor { lens: &shown.view.lens, sheet, refused, actions };
        self.compensators.show(ui, shown.made, editable, &mut editor);
        let title = format!("Correlations ({})", sheet.correlations.len());
        CollapsingHeader::new(title).id_salt("correlations").show(ui, |ui| {
            self.correlations.show(ui, editable, &mut editor);
        });
        let asked = shown.view.settings.loosest;
        let header = CollapsingHeader::new("Loosest tolerances").id_salt("loosest");
        header.show(ui, |ui| {
            ui.add_enabled_ui(editable, |ui| {
                self.loosest.show(ui, shown.made, asked, &mut editor);
            });
        });
        refusal(ui, self.refused.as_deref());
    }

    fn results(&mut self, ui: &mut Ui, shown: &Shown<'_>, actions: &mut Actions) {
        let made = shown.made;
        let numbers = |ui: &mut Ui| {
            summary::summary(ui, made);
            summary::worst_lens(ui, made, actions);
        };
        if ui.available_width() > BESIDE {
            ui.horizontal_top(|ui| {
                ui.vertical(numbers);
                self.charts(ui, shown);
            });
        } else {
            ui.vertical(numbers);
            self.charts(ui, shown);
        }
    }

    /// The charts, beside each other where there is room.
    fn charts(&mut self, ui: &mut Ui, shown: &Shown<'_>) {
        let (made, limit) = (shown.made, shown.view.settings.good_rms);
        if ui.available_width() > CHARTS_BESIDE {
            ui.columns(2, |columns| {
                charts::histogram(&mut columns[0], made, &mut self.focus);
                charts::yield_curve(&mut columns[1], made, limit);
            });
        } else {
            ui.vertical(|ui| {
                charts::histogram(ui, made, &mut self.focus);
                charts::yield_curve(ui, made, limit);
            });
        }
    }

    /// The errors, with the sums of their shares beside them or above.
    fn error_list(&mut self, ui: &mut Ui, shown: &Shown<'_>, actions: &mut Actions) {
        let Shown { view, made, lens, .. } = shown;
        let editable = shown.is_design();
        let rims = &made.nominal.semi_diameters[..];
        let (shares, refused) = ((shown.shares(), rims), &mut self.refused);
        let mut editor = SheetEditor { lens: &view.lens, sheet: shown.sheet(), refused, actions };
        if editable {
            self.form.show(ui, &made.nominal, view.settings.grade, &mut editor);
        }
        if ui.available_width() > BARS_BESIDE {
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| self.errors.show(ui, shares, editable, &mut editor));
                ui.vertical(|ui| shares::show(ui, made, lens));
            });
        } else {
            shares::show(ui, made, lens);
            self.errors.show(ui, shares, editable, &mut editor);
        }
    }
}

/// Chooses a class for a lens without tolerances, or removes those of the lens.
fn choose_grade(
    ui: &mut Ui,
    view: &SessionView,
    made: Option<&AsBuiltLens>,
    actions: &mut Actions,
) {
    if made.is_some_and(|made| made.from_lens) || made.is_none() && view.lens.tolerances.is_some() {
        ui.label("Tolerances of this lens");
        let hint = "Removes them from the lens, so that a class of care in making proposes some";
        if ui.button("Remove").on_hover_text(hint).clicked() {
            actions.push(Command::Edit(Edit::SetTolerances(None)));
        }
        return;
    }
    let chosen = view.settings.grade;
    let name = ToleranceGrade::ALL.iter().find(|(grade, _)| *grade == chosen);
    let combo = ComboBox::from_id_salt("grade").selected_text(name.map_or("", |(_, name)| name));
    let shown = combo.show_ui(ui, |ui| {
        for (grade, name) in ToleranceGrade::ALL {
            if ui.selectable_label(chosen == grade, name).clicked() {
                actions.push(Command::Show(PanelSetting::ToleranceGrade(grade)));
            }
        }
    });
    let hint = "The class of care in making that proposes tolerances";
    named_list(ui, shown, "Care in making").on_hover_text(hint);
    let Some(made) = made else { return };
    let hint = "Keeps these tolerances in the lens, so that they are saved and can be changed";
    if ui.button("Keep in the lens").on_hover_text(hint).clicked() {
        actions.push(Command::Edit(Edit::SetTolerances(Some(made.sheet.clone()))));
    }
}

/// Asks for the files that hold what the panel shows.
fn export_buttons(ui: &mut Ui, actions: &mut Actions) {
    for (text, kind, hint) in [
        ("CSV…", PaperKind::ToleranceTable, "Writes the table of errors with their effects"),
        ("PNG…", PaperKind::ToleranceCharts, "Writes the histograms, the yield and the shares"),
    ] {
        if ui.button(text).on_hover_text(hint).clicked() {
            actions.push(FileRequest::ExportPaper(kind));
        }
    }
}

/// Chooses the largest RMS of a good lens.
fn choose_limit(ui: &mut Ui, view: &SessionView, made: &AsBuiltLens, actions: &mut Actions) {
    let mut asks = view.settings.good_rms.is_some();
    let hint = "Adds the share of lenses whose rms spot radius is at most this";
    if ui.checkbox(&mut asks, "Good up to").on_hover_text(hint).changed() {
        let proposed = 1.2 * made.analysis.spots[1].form_mean_rms;
        actions.push(Command::Show(PanelSetting::GoodRms(asks.then_some(proposed))));
    }
    if let Some(limit) = view.settings.good_rms {
        let mut um = 1e3 * limit;
        let speed = 0.01 * um;
        let drag = DragValue::new(&mut um).speed(speed).range(1e-6..=1e6).suffix(" µm");
        if ui.add(drag).changed() {
            actions.push(Command::Show(PanelSetting::GoodRms(Some(1e-3 * um))));
        }
    }
}

/// The frequency that is proposed, in cycles/mm.
const PROPOSED_FREQUENCY: f64 = 20.0;

/// Chooses the frequency of the contrast.
fn choose_frequency(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let chosen = view.settings.tolerance_frequency;
    let mut asks = chosen.is_some();
    let hint = "Adds the contrast by rays at this frequency, the mean over fields and over tangential and \
                sagittal: as designed and of real lenses";
    if ui.checkbox(&mut asks, "MTF at").on_hover_text(hint).changed() {
        let asked = asks.then_some(PROPOSED_FREQUENCY);
        actions.push(Command::Show(PanelSetting::ToleranceFrequency(asked)));
    }
    if let Some(mut nu) = chosen {
        let speed = 0.01 * nu;
        let drag = DragValue::new(&mut nu).speed(speed).range(1e-3..=1e6).suffix(" cycles/mm");
        if ui.add(drag).changed() {
            actions.push(Command::Show(PanelSetting::ToleranceFrequency(Some(nu))));
        }
    }
}
