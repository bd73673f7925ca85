//! The part of the menu bar that names the lens in the panels while it is not the design. It takes
//! room that is free, so that no panel moves when a candidate appears.

use egui::{Align, Button, CornerRadius, Frame, Label, Layout, Margin, RichText, Ui};

use super::actions::Actions;
use super::menu_items::MenuContext;
use super::number;
use super::panels::{RMS_OVER_FIELDS_HINT, rms_over_fields};
use crate::lens::Lens;
use crate::session::{AnalysisResults, CandidateSource, CandidateView, Command, SessionView};

/// Shows the candidate while there is one, and the lenses that were kept, from the right to the left.
pub(super) fn candidate_bar(ui: &mut Ui, menus: &MenuContext<'_>, actions: &mut Actions) {
    let view = menus.view;
    if view.candidate.is_none() && view.kept.is_empty() {
        return;
    }
    let shown = view.candidate.as_ref().is_some_and(|candidate| candidate.shown);
    let visuals = ui.visuals();
    let fill = if shown { visuals.warn_fg_color.gamma_multiply(0.18) } else { visuals.panel_fill };
    let fill = visuals.panel_fill.blend(fill);
    let frame = Frame::new().fill(fill).corner_radius(CornerRadius::same(3));
    frame.inner_margin(Margin::symmetric(6, 0)).show(ui, |ui| {
        ui.reset_style();
        ui.spacing_mut().item_spacing.x = 4.0;
        kept_menu(ui, view, actions);
        if let Some(candidate) = &view.candidate {
            buttons(ui, candidate, menus.has_preview, actions);
            // The text takes what the buttons leave.
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                describe(ui, view, candidate, menus.has_preview);
            });
        }
    });
}

fn describe(ui: &mut Ui, view: &SessionView, candidate: &CandidateView, has_preview: bool) {
    let spot = |results: &Option<std::sync::Arc<AnalysisResults>>| {
        let analyses = results.as_ref()?.analyses.as_ref().ok()?;
        rms_over_fields(analyses).map(|mm| format!("{} µm", number::format_digits(1e3 * mm, 4)))
    };
    let own = spot(&view.results).map(|spot| format!("design {spot}"));
    let text = if candidate.shown {
        let numbers = [spot(&view.preview_results), own].into_iter().flatten();
        let numbers = numbers.collect::<Vec<_>>().join(", ");
        let what = if has_preview { "Preview of the dialog" } else { "Candidate" };
        format!("{what}: {}, {numbers}", candidate.title)
    } else {
        format!("The design; a candidate waits: {}", candidate.title)
    };
    let hint = format!(
        "{text}\n\nAll panels show the same lens. {RMS_OVER_FIELDS_HINT}. Numbers of the \
         prescription that differ from the design are marked, with the old value in the tooltip."
    );
    ui.add(Label::new(RichText::new(text).strong()).truncate()).on_hover_text(hint);
}

/// Shows the choices. What an open dialog would give is applied or left in that dialog.
fn buttons(ui: &mut Ui, candidate: &CandidateView, has_preview: bool, actions: &mut Actions) {
    let discard = match candidate.source {
        CandidateSource::Optimization => "End the optimization and discard its lens",
        CandidateSource::Chosen | CandidateSource::Search => {
            "Show the design again; the run goes on"
        }
    };
    let show = if candidate.shown { "Show design" } else { "Show candidate" };
    let choices = [
        ("Accept", Command::AcceptCandidate, "Make it the design, as one undo step"),
        (
            "Keep both",
            Command::KeepCandidate,
            "Keep it beside the design, to be shown and compared again; the design stays",
        ),
        ("Discard", Command::DiscardCandidate, discard),
        (
            show,
            Command::ShowCandidate(!candidate.shown),
            "Switch between the two; numbers can be edited while the design is shown",
        ),
    ];
    // The bar is filled from the right.
    for (text, command, hint) in choices.into_iter().rev() {
        let is_offered = !has_preview || matches!(command, Command::ShowCandidate(_));
        let button = ui.add_enabled(is_offered, Button::new(text).small());
        let button = button.on_disabled_hover_text("Apply or cancel it in its dialog");
        if button.on_hover_text(hint).clicked() {
            actions.push(command);
        }
    }
}

/// The lenses that were kept: a click shows one as a candidate.
fn kept_menu(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    if view.kept.is_empty() {
        return;
    }
    ui.menu_button(format!("Kept ({})", view.kept.len()), |ui| {
        for kept in view.kept.iter() {
            if ui.button(&kept.title).on_hover_text("Show it as a candidate").clicked() {
                actions.push(Command::Preview(Some(Box::new(Lens::clone(&kept.lens)))));
                ui.close();
            }
        }
    });
}
