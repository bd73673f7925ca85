//! What begins, holds and ends a search, how far it is, and the hand on it while it goes on.

use eframe::egui::{Button, Checkbox, DragValue, Label, ProgressBar, RichText, Ui};

use super::setup::SearchSetup;
use super::{search_command, words};
use crate::search::lens_landscape::describe_violation;
use crate::search::{SteerCommand, Temperature};
use crate::session::{
    Command, RunStatus, SessionView, StructureSearchCommand, StructureSearchSnapshot,
};
use crate::studio::number;
use crate::studio::panels::design_results;

/// Start, pause, stop, open, forget.
pub(super) fn buttons(
    ui: &mut Ui,
    view: &SessionView,
    setup: &SearchSetup,
    wishes: &mut Vec<Command>,
) {
    let run = view.structure_search.run.as_deref();
    let under_way = run.is_some_and(StructureSearchSnapshot::is_active);
    let paused = run.is_some_and(|run| run.status == RunStatus::Paused);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        start_button(ui, view, under_way, setup, wishes);
        let hold = if paused {
            ("Resume", StructureSearchCommand::Resume, "Let the search go on")
        } else {
            ("Pause", StructureSearchCommand::Pause, "Hold the search after its present round")
        };
        let buttons = [
            (hold.0, under_way, hold.1, hold.2),
            ("Stop", under_way, StructureSearchCommand::Stop, "End the search; its lenses stay"),
            (
                "Open…",
                !under_way && !view.structure_search.starting,
                StructureSearchCommand::ResumeFrom(None),
                "Go on with a search that was saved",
            ),
            (
                "Save to…",
                true,
                StructureSearchCommand::SaveTo(None),
                "Where the search is saved every few seconds",
            ),
            (
                "Clear",
                run.is_some() || view.structure_search.error.is_some(),
                StructureSearchCommand::Clear,
                "Forget this search; its file stays",
            ),
        ];
        for (text, enabled, explore, hint) in buttons {
            if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hint).clicked() {
                wishes.push(search_command(explore));
            }
        }
    });
}

fn start_button(
    ui: &mut Ui,
    view: &SessionView,
    under_way: bool,
    setup: &SearchSetup,
    wishes: &mut Vec<Command>,
) {
    let broken = view.results.is_some() && design_results(view).is_none();
    let ready = !under_way && !view.structure_search.starting && !broken;
    let fill = ui.visuals().selection.bg_fill;
    let button = Button::new(RichText::new("Search").strong()).fill(fill);
    let button = ui
        .add_enabled(ready, button)
        .on_hover_text("Search over structure in the background, on a copy of the design");
    let why = if broken { "No light gets through this lens" } else { "A search is under way" };
    if button.on_disabled_hover_text(why).clicked() {
        wishes.push(search_command(StructureSearchCommand::Start(Box::new(setup.request(view)))));
    }
    if broken {
        ui.colored_label(ui.visuals().warn_fg_color, why);
    }
}

/// The offer to go on with the search that was left when the program was closed.
pub(super) fn unfinished_search(ui: &mut Ui, view: &SessionView, wishes: &mut Vec<Command>) {
    let known = &view.structure_search;
    let Some(left) = known.unfinished.as_ref().filter(|_| known.run.is_none() && !known.starting)
    else {
        return;
    };
    let name = left.file_name().map(|name| name.to_string_lossy().into_owned());
    ui.horizontal_wrapped(|ui| {
        ui.label("A search was left:").on_hover_text(left.display().to_string());
        ui.strong(name.unwrap_or_default().trim_end_matches(".search.json"));
        if ui.button("Go on").on_hover_text("Go on where it was saved").clicked() {
            wishes.push(search_command(StructureSearchCommand::ResumeFrom(Some(left.clone()))));
        }
        ui.add_space(12.0);
        let hint =
            "Put its file aside; Open… finds it as forgotten.json until another is forgotten";
        if ui.button("Forget it").on_hover_text(hint).clicked() {
            wishes.push(search_command(StructureSearchCommand::DismissUnfinished));
        }
    });
}

const GRADIENT: &str = "A move of a chain is some gradient steps; a gradient is that of all spots, \
    pupils and limits by every free number of the lens, with the rays of the best lens";

/// What the start and the best lens do not keep, which only what is exported has to.
fn violations(ui: &mut Ui, run: &StructureSearchSnapshot) {
    for (lens, limits) in [("start", &run.start_violations), ("best lens", &run.best_violations)] {
        if !limits.is_empty() {
            let text = words::violations_text(lens, limits.len());
            let all: Vec<String> = limits.iter().map(describe_violation).collect();
            let label = Label::new(RichText::new(text).small().color(ui.visuals().warn_fg_color));
            ui.add(label).on_hover_text(all.join("\n"));
        }
    }
}

/// How far the search is, in numbers.
pub(super) fn progress(ui: &mut Ui, view: &SessionView, run: &StructureSearchSnapshot) {
    let text = words::status_text(run, view.structure_search.pending);
    match run.fraction_done() {
        Some(done) => {
            let bar = ProgressBar::new(done as f32).desired_height(16.0).text(text);
            ui.add(bar.corner_radius(2));
        }
        None => {
            ui.label(text);
        }
    }
    let speed = words::speed_text(run);
    let label = Label::new(RichText::new(&speed).small().weak()).truncate();
    ui.add(label).on_hover_text(format!("{speed}\n{GRADIENT}"));
    let (text, failed) = words::checkpoint_text(&run.checkpoint);
    let visuals = ui.visuals();
    let color = if failed { visuals.error_fg_color } else { visuals.weak_text_color() };
    let path = run.checkpoint.path.as_ref().map(|path| path.display().to_string());
    let label = Label::new(RichText::new(text).small().color(color)).truncate();
    ui.add(label).on_hover_text(path.unwrap_or_default());
    violations(ui, run);
}

/// What can be changed while it goes on: the temperature, and the chain that is followed.
pub(super) fn live_controls(
    ui: &mut Ui,
    view: &SessionView,
    run: &StructureSearchSnapshot,
    wishes: &mut Vec<Command>,
) {
    ui.horizontal_wrapped(|ui| {
        temperature(ui, run, wishes);
        preview_choice(ui, view, run, wishes);
    });
}

fn temperature(ui: &mut Ui, run: &StructureSearchSnapshot, wishes: &mut Vec<Command>) {
    ui.weak("Temperature").on_hover_text(
        "How much worse a lens may become before a descent is given up for a new mutation: at this \
         merit its density is 1/e. Hotter is more patient with bad lenses",
    );
    let mut value = run.temperature.value();
    let speed = 0.01 * value.max(f64::MIN_POSITIVE);
    let drag = DragValue::new(&mut value)
        .range(0.0..=f64::MAX)
        .speed(speed)
        .custom_formatter(|value, _| number::format_digits(value, 3));
    let drag = ui.add_enabled(run.is_active(), drag).accessible_name("Temperature");
    if let Some(temperature) = Temperature::new(value).filter(|_| drag.changed()) {
        wishes.push(search_command(StructureSearchCommand::Control(SteerCommand::Temperature(
            temperature,
        ))));
    }
    let factor = run.request.plan.settings.reheat;
    let hint = format!("Multiply the temperature by {factor}");
    let reheat = ui.add_enabled(run.is_active(), Button::new("Reheat")).on_hover_text(hint);
    if reheat.clicked() {
        wishes.push(search_command(StructureSearchCommand::Control(SteerCommand::Reheat)));
    }
}

fn preview_choice(
    ui: &mut Ui,
    view: &SessionView,
    run: &StructureSearchSnapshot,
    wishes: &mut Vec<Command>,
) {
    let mut follows = view.structure_search.previewed_chain.is_some();
    let chain = view.structure_search.previewed_chain.unwrap_or(0);
    let hint = "Show the lens of a chain in place of the design as it changes, in all panels";
    let check = Checkbox::new(&mut follows, "Follow the search");
    if ui.add(check).on_hover_text(hint).changed() {
        wishes.push(Command::Preview(None));
        wishes.push(search_command(StructureSearchCommand::Preview(follows.then_some(chain))));
    }
    if follows && run.chains.len() > 1 {
        let mut number = chain + 1;
        let drag = DragValue::new(&mut number).range(1..=run.chains.len()).prefix("chain ");
        if ui.add(drag).accessible_name("Chain that is followed").changed() {
            wishes.push(search_command(StructureSearchCommand::Preview(Some(number - 1))));
        }
    }
}
