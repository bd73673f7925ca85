//! The texts of a search: its status, its rate, and the lenses compared with the design.

use egui::{Label, Ui};

use super::{SelectedLens, ShownSearch};
use crate::optimize::pareto::ParetoPoint;
use crate::search::element::piece_count;
use crate::search::{DescentEnd, LineageNode, OfferOutcome, RunEnd};
use crate::session::{
    CheckpointStatus, EndReason, FoundLens, RunStatus, ScoredLens, StructureSearchSnapshot,
};
use crate::studio::number;
use crate::studio::panels::optimizer::changes_text;
use crate::studio::panels::{RMS_OVER_FIELDS, RMS_OVER_FIELDS_HINT};
use crate::studio::text::{self, counted};

fn short(value: f64) -> String {
    number::format_digits(value, 4)
}

/// A merit as it is read.
pub(super) fn merit_text(value: f64) -> String {
    if value.is_finite() { short(value) } else { "no merit".to_owned() }
}

/// The status of the search, and the merit of its start and of its best lens.
pub(super) fn status_text(run: &StructureSearchSnapshot, status: RunStatus) -> String {
    let why = match run.end_reason {
        Some(EndReason::TimeLimit) => ": time limit reached",
        Some(EndReason::Sampler(RunEnd::Moves | RunEnd::Gradients)) => {
            ": limit of moves or gradients reached"
        }
        Some(EndReason::Sampler(RunEnd::Done)) => ": all mutations tried",
        Some(EndReason::Sampler(RunEnd::Stuck)) => ": no mutation applies",
        Some(EndReason::Sampler(RunEnd::Stopped)) | None => "",
    };
    let status = text::status_text(status);
    let (from, to) = (merit_text(run.start.merit), merit_text(run.best.merit));
    format!("{status}{why}, merit {from} to {to}")
}

/// The work done so far, and its rate.
pub(super) fn speed_text(run: &StructureSearchSnapshot) -> String {
    let done = &run.statistics;
    let rate = run.gradients as f64 / run.seconds;
    let rate = if rate.is_finite() && rate > 0.0 {
        format!(
            ", {} gradients/s ({} ms each)",
            number::format_digits(rate, 3),
            number::format_digits(1e3 / rate, 3)
        )
    } else {
        String::new()
    };
    format!(
        "{} moves, {} gradients of {} rays{rate}, {}",
        done.moves,
        done.gradients,
        run.rays,
        duration_text(run.seconds)
    )
}

fn duration_text(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{seconds:.1} s")
    } else if seconds < 7200.0 {
        format!("{:.1} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}

/// The file of the search; true if writing it has failed.
pub(super) fn checkpoint_text(checkpoint: &CheckpointStatus) -> (String, bool) {
    let name = checkpoint.path.as_ref().and_then(|path| path.file_name());
    if let Some(why) = &checkpoint.error {
        let what = if checkpoint.is_followed { "Not read" } else { "Not saved" };
        return (format!("{what}: {why}"), true);
    }
    if let (true, Some(name), Some(moves)) = (checkpoint.is_followed, name, checkpoint.moves) {
        let name = name.to_string_lossy();
        return (format!("Followed, not run here: {name} has it up to move {moves}"), false);
    }
    match (name, checkpoint.moves) {
        (None, _) => ("Not saved: no file is chosen".to_owned(), false),
        (Some(name), None) => (format!("Will be saved to {}", name.to_string_lossy()), false),
        (Some(name), Some(moves)) => {
            (format!("Saved up to move {moves} to {}", name.to_string_lossy()), false)
        }
    }
}

/// Spot, light, elements and merit of a lens, in lines.
pub(super) fn lens_text(found: &FoundLens) -> String {
    let merit = merit_text(found.merit);
    let elements = found.elements;
    let design = found.score.as_ref().map(|scored| &scored.score);
    match design {
        Some(Ok(ParetoPoint { spot, light, .. })) => {
            let [spot, light] = [1e3 * spot, *light].map(|v| number::format_digits(v, 3));
            format!("{spot} µm, {light} mm²\n{elements} elements, {merit}")
        }
        Some(Err(why)) => format!("{elements} elements, {merit}\n{why}"),
        None => format!("{elements} elements, {merit}\ndescent not finished"),
    }
}

/// A lens beside the design: sharpness, light, elements.
pub(super) fn comparison(ui: &mut Ui, search: ShownSearch<'_>, selected: &SelectedLens) {
    let ShownSearch { view, run } = search;
    let SelectedLens { number, lens, .. } = selected;
    let mut parts = Vec::new();
    let found = run.reservoir.iter().chain([&run.best, &run.start]);
    let found = found.filter(|found| selected.is(found)).find_map(|found| found.score.as_ref());
    let pair =
        found.and_then(scored_design).zip(view.design_score.as_deref().and_then(scored_design));
    match pair {
        Some((new, own)) => {
            parts.push(change_text(RMS_OVER_FIELDS, 1e3 * own.spot, 1e3 * new.spot, "µm"));
            parts.push(change_text("light", own.light, new.light, "mm²"));
        }
        None => parts.extend(changes_text(view)),
    }
    let (new, own) = (piece_count(lens), piece_count(&view.lens));
    parts.push(format!("elements {own} to {new}"));
    let text = format!("Lens {number}: {}", parts.join(", "));
    ui.add(Label::new(text).wrap()).on_hover_text(format!(
        "The design and this lens: sharpness, mean area of the pupils, number of elements. The beam \
         of both is limited by the stop. {RMS_OVER_FIELDS_HINT}"
    ));
}

fn scored_design(scored: &ScoredLens) -> Option<&ParetoPoint> {
    scored.score.as_ref().ok()
}

fn change_text(name: &str, old: f64, new: f64, unit: &str) -> String {
    let change = number::short_change(old, new);
    let change = change.map(|change| format!(" ({change})")).unwrap_or_default();
    format!("{name} {} to {} {unit}{change}", short(old), short(new))
}

/// The mutation with which a generation began.
pub(super) fn mutation_text<P>(node: &LineageNode<P>) -> String {
    match node.kind {
        Some(kind) => format!("{}: {}", kind.name(), node.mutation),
        None => node.mutation.to_string(),
    }
}

/// The merits, the moves, the end and the place in the reservoir of a generation.
pub(super) fn outcome_text<P>(node: &LineageNode<P>) -> String {
    let before = node.loss_before.map(|before| format!("{} before, ", merit_text(before)));
    let merits = format!(
        "merit {}{} after the mutation, {} after the descent",
        before.unwrap_or_default(),
        merit_text(node.start_loss),
        merit_text(node.best_loss)
    );
    let end = match node.end {
        None => "not finished",
        Some(DescentEnd::Regeneration) => "ended at random (restart)",
        Some(DescentEnd::MaxMoves) => "ended at the maximum length",
        Some(DescentEnd::InfiniteLoss) => "ended without light",
        Some(DescentEnd::Mutation) => "ended by an accepted mutation",
        Some(DescentEnd::Budget) => "ended by its budget of gradients",
        Some(DescentEnd::Outranked) => "ended: others were better",
        Some(DescentEnd::Unpromising) => "ended: it would not overtake the best lens soon",
    };
    let offer = match node.offer {
        None => String::new(),
        Some(OfferOutcome::Entered) => "; retained".to_owned(),
        Some(OfferOutcome::Replaced(other)) => format!("; retained in place of lens {other}"),
        Some(OfferOutcome::AlreadyPresent(other)) => format!("; the same as lens {other}"),
        Some(OfferOutcome::RejectedLimits) => "; no lens near it keeps every limit".to_owned(),
        Some(OfferOutcome::RejectedSameTopology(other)) => {
            format!(
                "; not retained: lens {other} of the same pattern, or at the same minimum, is at least as \
                 good"
            )
        }
        Some(OfferOutcome::RejectedWorse) => "; not retained: all retained lenses are at least as \
            good"
            .to_owned(),
        Some(OfferOutcome::RejectedNonFinite) => "; not retained: no merit".to_owned(),
    };
    let (moves, gradients) = (counted(node.moves, "move"), counted(node.gradients, "gradient"));
    let chain = node.chain + 1;
    format!("{merits}\n{moves}, {gradients} in chain {chain}: {end}{offer}")
}
