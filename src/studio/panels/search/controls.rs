//! Start, pause, stop, progress and live controls of a search.

use egui::{Button, Checkbox, ComboBox, DragValue, Label, RichText, Ui};

use super::lenses::CardOrder;
use super::setup::SearchSetup;
use super::{ShownSearch, text};
use crate::search::{SteerCommand, Temperature};
use crate::session::{
    Command, RunStatus, SessionView, StructureSearchCommand, StructureSearchSnapshot,
};
use crate::studio::actions::{Actions, UiAction};
use crate::studio::file_dialog::FileRequest;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::widgets::{ActionButton, action_buttons, main_button, progress_bar};
use crate::studio::panels::{NO_LIGHT, is_dark};

/// Start, pause, stop, open, save and clear.
pub(super) fn buttons(ui: &mut Ui, view: &SessionView, setup: &SearchSetup, actions: &mut Actions) {
    let search = &view.structure_search;
    let active = search.run.is_active();
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        start_button(ui, view, active, setup, actions);
        let buttons = [
            if search.run.status == RunStatus::Paused {
                let command = StructureSearchCommand::Resume;
                ActionButton::new("Resume", active, command).hint("Resume the search")
            } else {
                let command = StructureSearchCommand::Pause;
                let hint = "Pause the search after its current round";
                ActionButton::new("Pause", active, command).hint(hint)
            },
            ActionButton::new("Stop", active, StructureSearchCommand::Stop)
                .hint("Stop the search and retain its lenses"),
            ActionButton::new("Open…", !active, FileRequest::OpenSearch)
                .hint("Resume a search from its file"),
            ActionButton::new("Save to…", true, FileRequest::SaveSearch)
                .hint("Choose the file in which the search is saved every few seconds"),
            ActionButton::new(
                "Clear",
                search.run.snapshot.is_some() || search.run.error.is_some(),
                StructureSearchCommand::Clear,
            )
            .hint("Dismiss this search; its file is retained"),
        ];
        action_buttons(ui, buttons, actions);
    });
}

fn start_button(
    ui: &mut Ui,
    view: &SessionView,
    active: bool,
    setup: &SearchSetup,
    actions: &mut Actions,
) {
    let dark = is_dark(view);
    let ready = !active && !dark;
    let hint = "Search over structure in the background, on a copy of the design";
    let reason = if dark { NO_LIGHT } else { "A search is already running" };
    if main_button(ui, "Search", ready, hint, reason) {
        actions.push(StructureSearchCommand::StartShown(Box::new(setup.request(view))));
    }
    if dark {
        ui.colored_label(ui.visuals().warn_fg_color, NO_LIGHT);
    }
}

/// Offers to resume the search that was unfinished when the program was closed.
pub(super) fn unfinished_search(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let known = &view.structure_search;
    let Some(left) = known
        .unfinished
        .as_ref()
        .filter(|_| known.run.snapshot.is_none() && !known.run.is_active())
    else {
        return;
    };
    let name = left.file_name().map(|name| name.to_string_lossy().into_owned());
    ui.horizontal_wrapped(|ui| {
        ui.label("Unfinished search:").on_hover_text(left.display().to_string());
        ui.strong(name.unwrap_or_default().trim_end_matches(".search.json"));
        if ui.button("Resume").on_hover_text("Resume it from its file").clicked() {
            actions.push(StructureSearchCommand::ResumeFrom(left.clone()));
        }
        ui.add_space(12.0);
        let hint = "Dismiss. The file is kept as forgotten.json until the next dismissal";
        if ui.button("Dismiss").on_hover_text(hint).clicked() {
            actions.push(StructureSearchCommand::DismissUnfinished);
        }
    });
}

const GRADIENT: &str = "A move of a chain consists of gradient steps; a gradient holds the \
    derivatives of all spots, pupils and limits by every variable. The number of rays is that of \
    the best lens";

/// The progress of the search.
pub(super) fn progress(ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
    let ShownSearch { view, run } = search;
    let text = text::status_text(run, view.structure_search.run.status);
    match run.fraction_done() {
        Some(done) => {
            let bar = progress_bar(ui, done as f32, text).desired_height(16.0);
            ui.add(bar.corner_radius(2));
        }
        None => {
            ui.label(text);
        }
    }
    let speed = text::speed_text(run);
    let label = Label::new(RichText::new(&speed).small().weak()).truncate();
    ui.add(label).on_hover_text(format!("{speed}\n{GRADIENT}"));
    let (text, failed) = text::checkpoint_text(&run.checkpoint);
    let visuals = ui.visuals();
    let color = if failed { visuals.error_fg_color } else { visuals.weak_text_color() };
    let path = run.checkpoint.path.as_ref().map(|path| path.display().to_string());
    let label = Label::new(RichText::new(text).small().color(color)).truncate();
    ui.add(label).on_hover_text(path.unwrap_or_default());
    resume_followed(ui, run, actions);
}

/// Offers to continue a search that another process has saved.
fn resume_followed(ui: &mut Ui, run: &StructureSearchSnapshot, actions: &mut Actions) {
    let path = run.checkpoint.path.as_ref().filter(|_| run.checkpoint.is_followed);
    let Some(path) = path else { return };
    let hint = "Continue this search in this window, which then saves it; refused while a process of this \
                machine runs it";
    if ui.button("Resume here").on_hover_text(hint).clicked() {
        actions.push(StructureSearchCommand::ResumeFrom(path.clone()));
    }
}

/// The live controls: the temperature where there is room, the chain that is previewed, and the
/// order of the cards.
pub(super) fn live_controls(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    is_roomy: bool,
    order: &mut CardOrder,
    actions: &mut Actions,
) {
    ui.horizontal_wrapped(|ui| {
        if is_roomy {
            temperature(ui, search, actions);
        }
        preview_choice(ui, search, actions);
        let hint = "Give the search the window: the lens of a chain large, the retained lenses \
                    beside it";
        if ui.button("Watch").on_hover_text(hint).clicked() {
            let chain = search.view.structure_search.previewed_chain.unwrap_or(0);
            actions.push(UiAction::WatchSearch(chain));
        }
        order_choice(ui, order);
    });
}

/// The number by which the cards are sorted.
fn order_choice(ui: &mut Ui, order: &mut CardOrder) {
    let combo = ComboBox::from_id_salt("order of the lenses").width(92.0);
    let combo = combo.selected_text(order.text()).show_ui(ui, |ui| {
        for choice in CardOrder::ALL {
            ui.selectable_value(order, choice, choice.text());
        }
    });
    named_list(ui, combo, "Order of the lenses");
}

/// The temperature of a method that depends on one.
pub(super) fn temperature(ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
    let ShownSearch { view, run } = search;
    if !run.request.plan.settings.method.has_temperature() {
        return;
    }
    ui.weak("Temperature").on_hover_text(
        "The merit at which the density of a lens is 1/e. At a higher temperature, RESTORE descends \
         longer from worse lenses, and Metropolis-Hastings accepts more steps that lead to them",
    );
    let mut value = run.temperature.value();
    let speed = 0.01 * value.max(f64::MIN_POSITIVE);
    let drag = DragValue::new(&mut value)
        .range(0.0..=f64::MAX)
        .speed(speed)
        .custom_formatter(|value, _| number::format_digits(value, 3));
    let drag =
        ui.add_enabled(view.structure_search.run.is_active(), drag).accessible_name("Temperature");
    if let Some(temperature) = Temperature::new(value).filter(|_| drag.changed()) {
        actions.push(StructureSearchCommand::Control(SteerCommand::Temperature(temperature)));
    }
    let factor = run.request.plan.settings.reheat;
    let hint = format!("Multiply the temperature by {factor}");
    let reheat = ui
        .add_enabled(view.structure_search.run.is_active(), Button::new("Reheat"))
        .on_hover_text(hint);
    if reheat.clicked() {
        actions.push(StructureSearchCommand::Control(SteerCommand::Reheat));
    }
}

fn preview_choice(ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
    let ShownSearch { view, run } = search;
    let mut follows = view.structure_search.previewed_chain.is_some();
    let chain = view.structure_search.previewed_chain.unwrap_or(0);
    let hint = "Show the current lens of a chain in place of the design, in all panels";
    let check = Checkbox::new(&mut follows, "Preview the search");
    if ui.add(check).on_hover_text(hint).changed() {
        actions.push(Command::Preview(None));
        actions.push(StructureSearchCommand::Preview(follows.then_some(chain)));
    }
    if follows && run.chains.len() > 1 {
        let mut number = chain + 1;
        let drag = DragValue::new(&mut number).range(1..=run.chains.len()).prefix("chain ");
        if ui.add(drag).accessible_name("Previewed chain").changed() {
            actions.push(StructureSearchCommand::Preview(Some(number - 1)));
        }
    }
}
