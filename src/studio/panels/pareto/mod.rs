//! The front of sharpness against light, as it is found.
//!
//! Every point is a lens: a click shows it in place of the design, a double click makes it the
//! design. The sweep works on its own copy.

mod plot;
mod setup;
mod text;

use egui::{Button, Frame, Margin, Panel as Side, Ui};

use super::Panel;
use crate::optimize::pareto::ParetoPoint;
use crate::session::{Command, ParetoRun, RunStatus, SessionView};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::panels::widgets::{ActionButton, action_buttons, main_button, progress_bar};
use crate::studio::panels::{NO_LIGHT, is_dark};
use crate::studio::text::capitalize;
use setup::ParetoSetup;

/// The introduction that is shown before the first sweep.
const INTRODUCTION: &str = "How sharp can this lens be for how much light? The sweep trades the \
    two against \
    each other over many weights, each descended from the lens before it, and plots every lens \
    that no other lens beats in both.\n\
    Click a point to show its lens, double-click to accept it. The design does not change meanwhile.";

/// The height of the bar of the selected lens: buttons and two lines.
const SELECTION_HEIGHT: f32 = 62.0;

/// The panel.
#[derive(Debug)]
pub struct ParetoPanel {
    setup: ParetoSetup,
    /// The lens that was clicked.
    selected: Option<ParetoPoint>,
    /// True while the plot shows the whole front; false once the user has moved it.
    fit: bool,
}

impl Default for ParetoPanel {
    fn default() -> Self {
        Self { setup: ParetoSetup::default(), selected: None, fit: true }
    }
}

impl Panel for ParetoPanel {
    fn title(&self) -> &'static str {
        "Pareto front"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        if view.preview_lens.is_none() {
            self.selected = None;
        }
        self.buttons(ui, view, actions);
        let active = view.pareto.run.is_active();
        ui.add_enabled_ui(!active, |ui| self.setup.ui(ui, view));
        text::variables_label(ui, view);
        if let Some(why) = &view.pareto.run.error {
            let why = capitalize(why);
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        match view.pareto.run.snapshot.as_deref() {
            Some(run) => self.show(ui, view, run, actions),
            None if view.pareto.run.is_active() => {
                ui.weak("Preparing…");
            }
            None => {
                ui.separator();
                ui.label(INTRODUCTION);
            }
        }
    }
}

impl ParetoPanel {
    fn buttons(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let run = view.pareto.run.snapshot.as_deref();
        let active = view.pareto.run.is_active();
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            self.start_button(ui, view, active, actions);
            let hint = "Write the front into a folder: a table (CSV), a plot (PNG) and every lens \
                        (JSON)";
            let buttons = [
                if view.pareto.run.status == RunStatus::Paused {
                    ActionButton::new("Resume", active, Command::ResumePareto)
                        .hint("Resume the sweep")
                } else {
                    let hint = "Pause the sweep after its current slice";
                    ActionButton::new("Pause", active, Command::PausePareto).hint(hint)
                },
                ActionButton::new("Stop", active, Command::StopPareto)
                    .hint("Stop the sweep and retain its front"),
                ActionButton::new("Export…", run.is_some(), FileRequest::ExportFront).hint(hint),
                ActionButton::new(
                    "Clear",
                    run.is_some() || view.pareto.run.error.is_some(),
                    Command::ClearPareto,
                )
                .hint("Dismiss this front and all earlier ones"),
            ];
            action_buttons(ui, buttons, actions);
            if run.is_some() && ui.button("Fit").on_hover_text("Show the whole front").clicked() {
                self.fit = true;
            }
        });
    }

    fn start_button(&self, ui: &mut Ui, view: &SessionView, active: bool, actions: &mut Actions) {
        let dark = is_dark(view);
        let ready = !active && !dark;
        let hint = "Sweep the front in the background, on a copy of the design";
        let reason = if dark { NO_LIGHT } else { "A sweep is already running" };
        if main_button(ui, "Start", ready, hint, reason) {
            actions.push(self.setup.command());
        }
        if dark {
            ui.colored_label(ui.visuals().warn_fg_color, NO_LIGHT);
        }
    }

    fn show(&mut self, ui: &mut Ui, view: &SessionView, run: &ParetoRun, actions: &mut Actions) {
        let share = run.fraction_done() as f32;
        let words = text::progress_text(run, view.pareto.run.status);
        let bar = progress_bar(ui, share, words).desired_height(16.0);
        ui.add(bar.corner_radius(2));
        text::hypervolume_label(ui, run);
        let frame = Frame::new().inner_margin(Margin { top: 4, ..Margin::ZERO });
        let side = Side::bottom("chosen lens").frame(frame).show_separator_line(false);
        side.exact_size(SELECTION_HEIGHT).show(ui, |ui| {
            self.selection_bar(ui, view, run, actions);
        });
        let clicked = plot::plot(ui, view, run, self.selected.as_ref(), &mut self.fit);
        if let Some(clicked) = clicked {
            self.select(clicked.design, actions);
            if clicked.double {
                actions.push(Command::AcceptPreview);
            }
        }
    }

    fn select(&mut self, design: ParetoPoint, actions: &mut Actions) {
        actions.push(Command::Preview(Some(Box::new(design.lens.clone()))));
        self.selected = Some(design);
    }

    /// The bar of the selected lens: its neighbours, its actions and its numbers.
    fn selection_bar(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        run: &ParetoRun,
        actions: &mut Actions,
    ) {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let [sharper, brighter] = self.neighbours(run);
            let steps = [
                ("Sharper", sharper, "Show the next lens of the front with a smaller spot"),
                ("Brighter", brighter, "Show the next lens of the front with more light"),
            ];
            for (text, next, hint) in steps {
                let button = ui.add_enabled(next.is_some(), Button::new(text)).on_hover_text(hint);
                if let (true, Some(next)) = (button.clicked(), next) {
                    self.select(next, actions);
                }
            }
            let shown = view.preview_lens.is_some() && self.selected.is_some();
            let accept = ui.add_enabled(shown, Button::new("Accept this lens"));
            if accept.on_hover_text("Make it the design, as one undo step").clicked() {
                actions.push(Command::AcceptPreview);
            }
            let back = ui.add_enabled(shown, Button::new("Show the design"));
            if back.on_hover_text("Show the design again in all panels").clicked() {
                actions.push(Command::Preview(None));
            }
        });
        text::selection_label(ui, run, self.selected.as_ref());
    }

    /// The lenses of the front on both sides of the selected one, or the ends of the front.
    fn neighbours(&self, run: &ParetoRun) -> [Option<ParetoPoint>; 2] {
        let designs = run.main.front.points();
        let Some(chosen) = &self.selected else {
            return [designs.first().cloned(), designs.last().cloned()];
        };
        let sharper = designs.iter().rev().find(|design| design.light < chosen.light);
        let brighter = designs.iter().find(|design| design.light > chosen.light);
        [sharper.cloned(), brighter.cloned()]
    }
}
