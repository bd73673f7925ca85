//! The bar above the panels that names the lens they show while it is not the design.

use egui::{Button, Frame, Margin, MenuBar, Panel as Side, RichText, Ui};

use super::actions::Actions;
use super::number;
use super::panels::mean_spot;
use crate::lens::Lens;
use crate::session::{AnalysisResults, CandidateSource, CandidateView, Command, SessionView};

/// Shows the bar while there is a candidate, or a lens that was kept.
pub(super) fn candidate_bar(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    if view.candidate.is_none() && view.kept.is_empty() {
        return;
    }
    let shown = view.candidate.as_ref().is_some_and(|candidate| candidate.shown);
    let visuals = ui.visuals();
    let fill = if shown { visuals.warn_fg_color.gamma_multiply(0.18) } else { visuals.panel_fill };
    let fill = visuals.panel_fill.blend(fill);
    let frame = Frame::new().fill(fill).inner_margin(Margin::symmetric(6, 3));
    Side::top("candidate").frame(frame).show_separator_line(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            if let Some(candidate) = &view.candidate {
                describe(ui, view, candidate);
                buttons(ui, candidate, actions);
            }
            kept_menu(ui, view, actions);
        });
    });
}

fn describe(ui: &mut Ui, view: &SessionView, candidate: &CandidateView) {
    let spot = |results: &Option<std::sync::Arc<AnalysisResults>>| {
        let analyses = results.as_ref()?.analyses.as_ref().ok()?;
        mean_spot(analyses).map(|mm| format!("{} µm", number::format_digits(1e3 * mm, 4)))
    };
    let own = spot(&view.results).map(|spot| format!("design {spot}"));
    let text = if candidate.shown {
        let numbers = [spot(&view.preview_results), own].into_iter().flatten();
        let numbers = numbers.collect::<Vec<_>>().join(", ");
        format!("Candidate: {}, {numbers}", candidate.title)
    } else {
        format!("The design; a candidate waits: {}", candidate.title)
    };
    ui.label(RichText::new(text).strong()).on_hover_text(
        "All panels show the same lens. Mean RMS radius of the spots. Numbers of the prescription \
         that differ from the design are marked, with the old value in the tooltip.",
    );
}

fn buttons(ui: &mut Ui, candidate: &CandidateView, actions: &mut Actions) {
    let discard = match candidate.source {
        CandidateSource::Optimization => "End the optimization and discard its lens",
        CandidateSource::Chosen | CandidateSource::Search => {
            "Show the design again; the run goes on"
        }
    };
    let show = if candidate.shown { "Show the design" } else { "Show the candidate" };
    let choices = [
        ("Accept", Command::AcceptCandidate, "Make it the design, as one undo step"),
        (
            "Keep both",
            Command::KeepCandidate,
            "Keep it beside the design, to be shown and compared again; the design stays",
        ),
        ("Discard candidate", Command::DiscardCandidate, discard),
        (
            show,
            Command::ShowCandidate(!candidate.shown),
            "Switch between the two; numbers can be edited while the design is shown",
        ),
    ];
    for (text, command, hint) in choices {
        if ui.add(Button::new(text).small()).on_hover_text(hint).clicked() {
            actions.push(command);
        }
    }
}

/// The lenses that were kept: a click shows one as a candidate.
fn kept_menu(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    if view.kept.is_empty() {
        return;
    }
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button(format!("Kept lenses ({})", view.kept.len()), |ui| {
            for kept in view.kept.iter() {
                if ui.button(&kept.title).on_hover_text("Show it as a candidate").clicked() {
                    actions.push(Command::Preview(Some(Box::new(Lens::clone(&kept.lens)))));
                    ui.close();
                }
            }
        });
    });
}
