//! The window of an experiment: its progress, then its claims with their numbers, its pictures, and
//! a button to save them.

use egui::{
    Align, Button, ColorImage, Context, Grid, Id, Image, Layout, ProgressBar, RichText, ScrollArea,
    TextureHandle, TextureOptions, Ui, Window, vec2,
};

use super::actions::Actions;
use super::file_dialog::FileRequest;
use super::number;
use super::palette::{Palette, color32};
use super::text::capitalize;
use crate::experiments::{ALL, Claim, ClaimVerdict, Effort, Experiment, ExperimentReport};
use crate::plot::NamedPlot;
use crate::session::{Command, ExperimentRun, ExperimentStatus};

/// The pictures of the experiment that is shown, as textures.
#[derive(Default)]
pub(super) struct ExperimentWindow {
    /// The trial that they belong to.
    number: u64,
    pictures: Vec<(&'static str, TextureHandle)>,
}

impl std::fmt::Debug for ExperimentWindow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bench").field("number", &self.number).finish_non_exhaustive()
    }
}

/// The menu of all experiments.
pub(super) fn menu(ui: &mut Ui, actions: &mut Actions) {
    ui.set_min_width(380.0);
    for study in ALL {
        let button = Button::new(format!("{}  {}", study.id, study.title));
        let button = ui.add(button.shortcut_text(duration_text(study)));
        if button.on_hover_text(format!("{}.", study.claim)).clicked() {
            actions.push(run_command(study));
            ui.close();
        }
    }
}

fn run_command(study: &Experiment) -> Command {
    Command::StartExperiment { id: study.id.to_owned(), effort: Effort::Full }
}

/// About how long it takes.
fn duration_text(study: &Experiment) -> String {
    format!("about {} s", number::format_digits(study.seconds, 2))
}

impl ExperimentWindow {
    /// Shows the experiment, if there is one.
    pub(super) fn ui(
        &mut self,
        context: &Context,
        trial: Option<&ExperimentRun>,
        actions: &mut Actions,
    ) {
        let Some(trial) = trial else {
            *self = Self::default();
            return;
        };
        let study = trial.experiment;
        let mut open = true;
        let area = context.content_rect();
        let window = Window::new(format!("Experiment {}: {}", study.id, study.title))
            .id(Id::unique("experiment"))
            .open(&mut open)
            .collapsible(false)
            .default_size(vec2(780.0, 0.8 * area.height()))
            .default_pos(area.left_top() + vec2(0.18 * area.width(), 0.08 * area.height()));
        window.show(context, |ui| {
            ui.label(format!("{}.", study.claim));
            ui.weak(format!("Left out: {}.", study.omits));
            ui.separator();
            match &trial.status {
                ExperimentStatus::Running { done, doing } => {
                    running(ui, study, *done, doing, actions);
                }
                ExperimentStatus::Done(report) => self.report(ui, trial.number, report, actions),
                ExperimentStatus::Stopped => {
                    ui.label("Stopped before it had a result.");
                    run_again_button(ui, study, actions);
                }
                ExperimentStatus::Failed(why) => {
                    ui.colored_label(ui.visuals().error_fg_color, capitalize(why));
                    run_again_button(ui, study, actions);
                }
            }
        });
        if !open {
            actions.push(Command::DismissExperiment);
        }
    }

    fn report(
        &mut self,
        ui: &mut Ui,
        number: u64,
        report: &ExperimentReport,
        actions: &mut Actions,
    ) {
        if self.number != number {
            let load = |picture: &NamedPlot| (picture.name, texture(ui.ctx(), picture));
            *self = Self { number, pictures: report.outcome.pictures.iter().map(load).collect() };
        }
        verdict(ui, report, actions);
        ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
            claims(ui, &report.outcome.claims);
            for (name, texture) in &self.pictures {
                ui.add_space(8.0);
                ui.strong(capitalize(&name.replace(['_', '-'], " ")));
                let image = Image::new(texture).max_width(ui.available_width());
                ui.add(image.alt_text(format!("Picture {name} of the experiment")));
            }
        });
    }
}

fn running(ui: &mut Ui, study: &Experiment, done: f64, doing: &str, actions: &mut Actions) {
    ui.horizontal(|ui| {
        #[expect(clippy::cast_possible_truncation, reason = "a part of a bar")]
        let bar = ProgressBar::new(done as f32).desired_width(0.6 * ui.available_width());
        ui.add(bar.text(format!("{:.0} %  {doing}", 100.0 * done)));
        if ui.button("Cancel").on_hover_text("Stop at the next step").clicked() {
            actions.push(Command::CancelExperiment);
        }
        ui.weak(duration_text(study)).on_hover_text("On two cores without other work");
    });
}

fn run_again_button(ui: &mut Ui, study: &Experiment, actions: &mut Actions) {
    if ui.button("Run again").clicked() {
        actions.push(run_command(study));
    }
}

/// The verdict on all claims, the cost of the run, and the buttons to save or repeat it.
fn verdict(ui: &mut Ui, report: &ExperimentReport, actions: &mut Actions) {
    let (failed, all) = (report.outcome.failed().count(), report.outcome.claims.len());
    ui.horizontal(|ui| {
        if failed == 0 {
            let better = color32(Palette::for_visuals(ui.visuals()).better);
            ui.label(RichText::new(format!("All {all} claims hold")).strong().color(better));
        } else {
            let text = format!("{failed} of {all} claims do not hold");
            ui.label(RichText::new(text).strong().color(ui.visuals().error_fg_color));
        }
        ui.weak(format!("{} rays, {:.1} s", report.outcome.rays, 1e-3 * report.ms));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if let Some(study) = ALL.iter().find(|study| study.id == report.id) {
                run_again_button(ui, study, actions);
            }
            let hint = "Writes data (CSV, JSON) and pictures (PNG) into a folder";
            if ui.button("Save…").on_hover_text(hint).clicked() {
                actions.push(FileRequest::ExperimentFolder);
            }
        });
    });
}

fn claims(ui: &mut Ui, claims: &[Claim]) {
    Grid::new("claims").num_columns(4).spacing([14.0, 3.0]).striped(true).show(ui, |ui| {
        for heading in ["", "Found", "Expected", "Claim"] {
            ui.weak(heading);
        }
        ui.end_row();
        for claim in claims {
            let verdict = claim.verdict();
            let color = match verdict {
                ClaimVerdict::Holds => color32(Palette::for_visuals(ui.visuals()).better),
                ClaimVerdict::NoEffect => ui.visuals().warn_fg_color,
                ClaimVerdict::Fails => ui.visuals().error_fg_color,
            };
            ui.label(RichText::new(verdict.to_string()).strong().color(color));
            ui.label(value_text(claim));
            ui.label(format!("{} {} {}", claim.rule, short(claim.limit), claim.unit));
            ui.label(capitalize(&claim.says));
            ui.end_row();
        }
    });
}

/// The number of a claim with its error, both in the same notation, and its unit.
fn value_text(claim: &Claim) -> String {
    let text = if number::is_error(claim.value, claim.error) {
        number::with_error(claim.value, claim.error)
    } else {
        short(claim.value)
    };
    format!("{text} {}", claim.unit)
}

/// A number with few digits, at any magnitude.
fn short(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && !(1e-3..1e6).contains(&size) {
        format!("{value:.2e}")
    } else {
        number::format_digits(value, 4)
    }
}

fn texture(context: &Context, picture: &NamedPlot) -> TextureHandle {
    let size = picture.canvas.size().map(|side| side as usize);
    let image = ColorImage::from_rgb(size, picture.canvas.pixels());
    context.load_texture(picture.name, image, TextureOptions::LINEAR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::ClaimRelation;

    #[test]
    fn a_number_and_its_error_have_one_notation() {
        let claim = |value: f64, error: f64| {
            let (says, rule) = (String::new(), ClaimRelation::AtMost);
            Claim { says, value, error, unit: "mm", rule, limit: 1.0, holds: true }
        };
        assert_eq!(value_text(&claim(0.0413, 3e-5)), "0.04130 ± 0.00003 mm");
        assert_eq!(value_text(&claim(0.0413, 2e-17)), "0.0413 mm");
        assert_eq!(value_text(&claim(3.21e-7, 0.0)), "3.21e-7 mm");
    }
}
