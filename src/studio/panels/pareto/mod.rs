//! The front of sharpness against light, as it is found.
//!
//! Every point is a lens: a click shows it in place of the design, a double click makes it the
//! design. The sweep works on its own copy.

mod plot;
mod setup;
mod words;

use eframe::egui::{Button, Frame, Margin, Panel as Side, ProgressBar, RichText, Ui};

use super::{Panel, design_results};
use crate::optimize::pareto::ParetoPoint;
use crate::session::{Command, ParetoRun, RunStatus, SessionView};
use crate::studio::wording::{capitalize, counted_from_one};
use setup::ParetoSetup;

/// What the panel is about, before anything is swept.
const INTRODUCTION: &str = "How sharp can this lens be for how much light? The sweep trades the two against \
    each other over many weights, each descended from the lens before it, and draws every lens \
    that none beats in both.\n\
    Click a point to see its lens, double click to take it. The design stays what it is meanwhile.";

/// The height of what is said about the lens that was clicked: buttons and two lines.
const SELECTION_HEIGHT: f32 = 62.0;

/// The panel.
#[derive(Debug)]
pub struct ParetoPanel {
    setup: ParetoSetup,
    /// The lens that was clicked.
    selected: Option<ParetoPoint>,
    /// Whether the plot shows all of the front; not while a person has moved it.
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

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, wishes: &mut Vec<Command>) {
        if view.preview_lens.is_none() {
            self.selected = None;
        }
        self.buttons(ui, view, wishes);
        let under_way = view.pareto.run.as_ref().is_some_and(|run| run.is_active());
        ui.add_enabled_ui(!under_way, |ui| self.setup.ui(ui, view));
        words::variables_label(ui, view);
        if let Some(why) = &view.pareto.error {
            let why = capitalize(&counted_from_one(why));
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        match view.pareto.run.as_deref() {
            Some(run) => self.show(ui, view, run, wishes),
            None if view.pareto.starting => {
                ui.weak("Looking at the lens…");
            }
            None => {
                ui.separator();
                ui.label(INTRODUCTION);
            }
        }
    }
}

impl ParetoPanel {
    fn buttons(&mut self, ui: &mut Ui, view: &SessionView, wishes: &mut Vec<Command>) {
        let run = view.pareto.run.as_deref();
        let standing = run.map(|run| run.status);
        let paused = standing == Some(RunStatus::Paused);
        let under_way = run.is_some_and(ParetoRun::is_active);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            self.start_button(ui, view, under_way, wishes);
            let hold = if paused {
                ("Resume", Command::ResumePareto, "Let the sweep go on")
            } else {
                ("Pause", Command::PausePareto, "Hold the sweep after its current slice")
            };
            let buttons = [
                (hold.0, under_way, hold.1, hold.2),
                ("Stop", under_way, Command::StopPareto, "End the sweep; its front stays"),
                (
                    "Export…",
                    run.is_some(),
                    Command::ExportPareto(None),
                    "Write the front into a folder: a table (CSV), a picture (PNG) and every lens \
                     (JSON)",
                ),
                (
                    "Clear",
                    run.is_some() || view.pareto.error.is_some(),
                    Command::ClearPareto,
                    "Forget this front and all earlier ones",
                ),
            ];
            for (text, enabled, command, hint) in buttons {
                if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hint).clicked() {
                    wishes.push(command);
                }
            }
            if run.is_some() && ui.button("Fit").on_hover_text("Show the whole front").clicked() {
                self.fit = true;
            }
        });
    }

    fn start_button(
        &self,
        ui: &mut Ui,
        view: &SessionView,
        under_way: bool,
        wishes: &mut Vec<Command>,
    ) {
        let broken = view.results.is_some() && design_results(view).is_none();
        let ready = !under_way && !view.pareto.starting && !broken;
        let fill = ui.visuals().selection.bg_fill;
        let button = Button::new(RichText::new("Start").strong()).fill(fill);
        let button = ui
            .add_enabled(ready, button)
            .on_hover_text("Sweep the front in the background, on a copy of the design");
        let why = if broken { "No light gets through this lens" } else { "A sweep is under way" };
        if button.on_disabled_hover_text(why).clicked() {
            wishes.push(self.setup.command());
        }
        if broken {
            ui.colored_label(ui.visuals().warn_fg_color, why);
        }
    }

    fn show(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        run: &ParetoRun,
        wishes: &mut Vec<Command>,
    ) {
        let share = run.fraction_done() as f32;
        let bar = ProgressBar::new(share)
            .desired_height(16.0)
            .text(words::progress_text(run, view.pareto.pending));
        ui.add(bar.corner_radius(2));
        words::hypervolume_label(ui, run);
        let frame = Frame::new().inner_margin(Margin { top: 4, ..Margin::ZERO });
        let side = Side::bottom("chosen lens").frame(frame).show_separator_line(false);
        side.exact_size(SELECTION_HEIGHT).show(ui, |ui| {
            self.selection_bar(ui, view, run, wishes);
        });
        let clicked = plot::plot(ui, view, run, self.selected.as_ref(), &mut self.fit);
        if let Some(clicked) = clicked {
            self.select(clicked.design, wishes);
            if clicked.double {
                wishes.push(Command::AcceptPreview);
            }
        }
    }

    fn select(&mut self, design: ParetoPoint, wishes: &mut Vec<Command>) {
        wishes.push(Command::Preview(Some(Box::new(design.lens.clone()))));
        self.selected = Some(design);
    }

    /// The lens that was clicked: its numbers, its neighbours, what to do with it.
    fn selection_bar(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        run: &ParetoRun,
        wishes: &mut Vec<Command>,
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
                    self.select(next, wishes);
                }
            }
            let shown = view.preview_lens.is_some() && self.selected.is_some();
            let take = ui.add_enabled(shown, Button::new("Take this lens"));
            if take.on_hover_text("Make it the design, as one undo step").clicked() {
                wishes.push(Command::AcceptPreview);
            }
            let back = ui.add_enabled(shown, Button::new("Back to the design"));
            if back
                .on_hover_text(
                    "Show the design again in all panels; the table of surfaces never left it",
                )
                .clicked()
            {
                wishes.push(Command::Preview(None));
            }
        });
        words::selection_label(ui, run, self.selected.as_ref());
    }

    /// The lenses of the front on both sides of the one that was clicked, or the ends of the front.
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
