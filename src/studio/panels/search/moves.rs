//! The outcome of each kind of mutation, and the weight with which it is tried.

use egui::{DragValue, Grid, RichText, Ui};

use super::mutation_style;
use crate::search::{MutationKind, MutationStatistics, Refusal, SteerCommand};
use crate::session::{SessionView, StructureSearchCommand, StructureSearchSnapshot};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::text::capitalize;

const HEADINGS: [(&str, &str); 7] = [
    ("Mutation", ""),
    ("Weight", "Relative frequency; 0 excludes the mutation"),
    ("Tried", "Number of attempts"),
    ("Refused", "Attempts that did not apply; hover for the most common reason"),
    ("Better", "Ended descents that gave a better lens than the one before the mutation"),
    ("Retained", "Descents whose lens was retained"),
    ("Length", "Mean length of its descents, in moves"),
];

/// The table of all kinds.
pub(super) fn table(
    ui: &mut Ui,
    view: &SessionView,
    run: &StructureSearchSnapshot,
    actions: &mut Actions,
) {
    Grid::new("moves").num_columns(HEADINGS.len()).spacing([9.0, 3.0]).striped(true).show(
        ui,
        |ui| {
            for (name, hint) in HEADINGS {
                let label = ui.weak(name);
                if !hint.is_empty() {
                    label.on_hover_text(hint);
                }
            }
            ui.end_row();
            for kind in mutation_style::kinds() {
                row(ui, view, run, kind, actions);
                ui.end_row();
            }
        },
    );
    refusal_summary(ui, run);
}

fn row(
    ui: &mut Ui,
    view: &SessionView,
    run: &StructureSearchSnapshot,
    kind: MutationKind,
    actions: &mut Actions,
) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        mutation_style::symbol(ui, kind);
        ui.label(kind.name());
    });
    let mut weight = run.weights.of(kind);
    let drag = DragValue::new(&mut weight).range(0.0..=100.0).speed(0.02).max_decimals(2);
    let name = format!("Weight of {}", kind.name());
    let drag = ui.add_enabled(view.structure_search.run.is_active(), drag).accessible_name(&name);
    if drag.changed() {
        actions.push(StructureSearchCommand::Control(SteerCommand::Weight(kind, weight)));
    }
    let tally = run.statistics.kinds.get(&kind).cloned().unwrap_or_default();
    ui.label(tally.tried.to_string());
    refusal_cell(ui, kind, &tally);
    ui.label(format!("{} of {}", tally.improved, tally.ended));
    ui.label(tally.entered.to_string());
    let life = tally.mean_moves().map(|moves| number::format_digits(moves, 3));
    ui.label(life.unwrap_or_else(|| "–".to_owned()));
}

fn refusal_cell(ui: &mut Ui, kind: MutationKind, tally: &MutationStatistics) {
    let refused: u64 = tally.refused.values().sum();
    let label = ui.label((refused + tally.rejected).to_string());
    if let Some((why, count)) = most_common_refusal(tally) {
        label
            .on_hover_text(format!("{} was refused {count} times: {why}", capitalize(kind.name())));
    }
}

fn most_common_refusal(tally: &MutationStatistics) -> Option<(Refusal, u64)> {
    let most = tally.refused.iter().max_by_key(|(_, count)| **count);
    most.map(|(refusal, count)| (*refusal, *count))
}

/// The commonest reason of each kind, in words.
fn refusal_summary(ui: &mut Ui, run: &StructureSearchSnapshot) {
    ui.add_space(6.0);
    for kind in mutation_style::kinds() {
        let tally = run.statistics.kinds.get(&kind);
        if let Some((why, count)) = tally.and_then(most_common_refusal) {
            let text = format!("{}, {count} × refused: {}", kind.name(), why);
            ui.label(RichText::new(capitalize(&text)).small().weak());
        }
    }
}
