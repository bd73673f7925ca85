//! The row above the drawing: what is held while handles are dragged, and the merit.

use std::sync::Arc;

use egui::{Align, Layout, Ui};

use super::paint::{is_merit_current, merit_text};
use crate::lens::Object;
use crate::paraxial::{DragSettings, FirstOrderLock, FreeNumbers};
use crate::session::{Command, MeritReport, SessionView};
use crate::studio::actions::Actions;
use crate::studio::number;

/// Shows what can be held, and changes it.
pub(in crate::studio::panels::layout) fn locks_row(
    ui: &mut Ui,
    view: &SessionView,
    actions: &mut Actions,
) {
    ui.horizontal(|ui| {
        ui.weak("Hold").on_hover_text(
            "Held by the least change of the other numbers while a handle of the drawing is dragged, \
             and when an element is cemented, split or reversed",
        );
        let before = &view.drag.settings;
        let mut settings = before.clone();
        for lock in FirstOrderLock::ALL {
            if lock != FirstOrderLock::Magnification || view.lens.object != Object::Infinity {
                lock_chip(ui, lock, &mut settings);
            }
        }
        free_numbers(ui, &mut settings);
        if settings != *before {
            actions.push(Command::SetDragSettings(settings));
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| merit(ui, view));
    });
}

fn lock_chip(ui: &mut Ui, lock: FirstOrderLock, settings: &mut DragSettings) {
    let is_on = settings.locks.contains(&lock);
    let chip = ui.selectable_label(is_on, lock.to_string());
    let chip = chip.accessible_name(format!("Hold the {lock}"));
    if chip.on_hover_text(hint(lock)).clicked() {
        if is_on {
            settings.locks.retain(|other| *other != lock);
        } else {
            settings.locks.push(lock);
            settings.locks.sort();
        }
    }
}

const fn hint(lock: FirstOrderLock) -> &'static str {
    match lock {
        FirstOrderLock::FocalLength => "The focal length stays, at every zoom position",
        FirstOrderLock::BackFocus => {
            "The paraxial image stays at its distance from the last vertex"
        }
        FirstOrderLock::Focus => "The image plane stays at its distance from the paraxial image",
        FirstOrderLock::Track => "The length from the first vertex to the image plane stays",
        FirstOrderLock::Magnification => "The paraxial magnification stays",
    }
}

fn free_numbers(ui: &mut Ui, settings: &mut DragSettings) {
    if settings.locks.is_empty() {
        return;
    }
    let mut only = settings.free == FreeNumbers::Variables;
    let hint = "Only variables may change to hold it; otherwise every curvature and gap may";
    if ui.checkbox(&mut only, "by variables").on_hover_text(hint).changed() {
        settings.free = if only { FreeNumbers::Variables } else { FreeNumbers::All };
    }
}

/// The merit of the lens that is drawn.
fn merit(ui: &mut Ui, view: &SessionView) {
    match &view.candidate {
        Some(candidate) if candidate.shown => candidate_merit(ui, view),
        _ => design_merit(ui, view),
    }
}

/// The merit of the candidate beside that of the design.
fn candidate_merit(ui: &mut Ui, view: &SessionView) {
    let design = view.merit.as_deref().and_then(|report| total(report).ok());
    let design = design.map(|merit| format!(", design {merit}")).unwrap_or_default();
    match view.preview_merit.as_deref().map(total) {
        None => ui.weak(format!("merit …{design}")),
        Some(Ok(merit)) => ui
            .weak(format!("merit {merit}{design}"))
            .on_hover_text("The candidate and the design by the merit function of the design"),
        Some(Err(why)) => ui.weak(format!("no merit{design}")).on_hover_text(why),
    };
}

/// A merit, or the reason why there is none.
fn total(report: &MeritReport) -> Result<String, &String> {
    report.values.as_ref().map(|values| number::format_digits(values.total, 4))
}

/// The merit of the design as all panels have it; during a drag that of the slopes, beside the merit
/// before the drag by the same rays.
fn design_merit(ui: &mut Ui, view: &SessionView) {
    let Some(report) = &view.merit else { return };
    let dragged = view.drag.progress.as_ref().filter(|_| is_merit_current(view));
    let slopes =
        dragged.and(view.drag.slopes.as_ref()).and_then(|found| found.result.as_ref().ok());
    let text = match (slopes, total(report)) {
        (Some(slopes), _) => merit_text(slopes),
        _ if !Arc::ptr_eq(&report.lens, &view.lens) => "merit …".to_owned(),
        (None, Ok(total)) => format!("merit {total}"),
        (None, Err(why)) => {
            ui.weak("no merit").on_hover_text(why);
            return;
        }
    };
    ui.weak(text).on_hover_text(
        "The merit function of the lens, or the one that the program proposes. \
         The arrows at the handles show where it falls.",
    );
}
