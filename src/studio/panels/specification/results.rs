//! The lenses of a design: the best one while it runs, and at the end three beside each other.

use egui::{RichText, Sense, Ui, vec2};

use super::text;
use crate::search::design::LensJudgement;
use crate::session::{Command, OfferedLens, SessionView, SpecifiedDesign};
use crate::studio::actions::Actions;
use crate::studio::panels::widgets::{ActionButton, action_buttons, progress_bar};
use crate::studio::text::capitalize;
use crate::studio::thumbnails::Thumbnails;

/// The height of a drawing.
const DRAWING: f32 = 96.0;
/// The least width of a lens.
const LEAST_WIDTH: f32 = 170.0;
/// The number of costs that are shown; the others are explained on hovering.
const COSTS: usize = 3;

/// Shows how far a design is, with its best lens.
pub(super) fn show_progress(
    ui: &mut Ui,
    view: &SessionView,
    design: &SpecifiedDesign,
    thumbnails: &mut Thumbnails,
) {
    let bar = progress_bar(ui, design.share_used() as f32, text::stage_text(design));
    ui.add(bar.desired_height(16.0).corner_radius(2));
    ui.horizontal_wrapped(|ui| {
        ui.strong(text::best_text(design)).on_hover_text(BEST);
        ui.weak(text::progress_text(design));
    });
    if let Some(lens) = &design.best_lens {
        let size = vec2(ui.available_width().min(420.0), DRAWING);
        let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
        thumbnails.paint(ui, lens, &view.lens, rect);
    }
}

const BEST: &str = "The root of the mean squared spot radius over the fields together with the \
    squares of what limits are broken by.";

/// Shows the lenses at the end beside each other.
pub(super) fn show_lenses(
    ui: &mut Ui,
    view: &SessionView,
    design: &SpecifiedDesign,
    thumbnails: &mut Thumbnails,
    actions: &mut Actions,
) {
    egui::ScrollArea::horizontal().id_salt("designed lenses").show(ui, |ui| {
        let count = design.lenses.len().max(1) as f32;
        let gaps = ui.spacing().item_spacing.x * (count - 1.0);
        let width = ((ui.available_width() - gaps) / count).clamp(LEAST_WIDTH, 2.0 * LEAST_WIDTH);
        ui.horizontal_top(|ui| {
            for found in &*design.lenses {
                ui.vertical(|ui| {
                    ui.set_width(width);
                    show_lens(ui, view, found, thumbnails, actions);
                });
            }
        });
    });
}

fn show_lens(
    ui: &mut Ui,
    view: &SessionView,
    found: &OfferedLens,
    thumbnails: &mut Thumbnails,
    actions: &mut Actions,
) {
    let title = text::merit_title(found.designed.merit);
    ui.strong(title).on_hover_text(format!("From {}", found.designed.origin));
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), DRAWING), Sense::hover());
    thumbnails.paint(ui, &found.lens, &view.lens, rect);
    let judgement = &found.designed.judgement;
    for (name, value) in text::facts(judgement, found.lens.total_track()) {
        ui.horizontal_wrapped(|ui| {
            ui.weak(name);
            ui.label(value);
        });
    }
    if let Some(made) = &found.designed.as_built {
        for (name, value) in text::as_built_facts(made) {
            ui.horizontal_wrapped(|ui| {
                ui.weak(name).on_hover_text(AS_BUILT);
                ui.label(value);
            });
        }
    }
    show_limits(ui, judgement);
    show_costs(ui, found);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let open = format!("Open the {} lens", title.to_lowercase());
        let shown = view.preview_lens.as_deref() == Some(&*found.lens);
        let preview = if shown { None } else { Some(Box::new(found.designed.lens.clone())) };
        let buttons = [
            ActionButton::new(&open, true, Command::New(Box::new(found.designed.lens.clone())))
                .hint("Make it the design, as a document of its own"),
            ActionButton::new(if shown { "Hide" } else { "Show" }, true, Command::Preview(preview))
                .hint("Show it in all panels in place of the design, which stays as it is"),
        ];
        action_buttons(ui, buttons, actions);
    });
}

fn show_limits(ui: &mut Ui, judgement: &LensJudgement) {
    let failures = judgement.failures();
    if failures.is_empty() {
        ui.label("Keeps every limit");
    }
    for failure in failures {
        ui.label(RichText::new(capitalize(&failure)).color(ui.visuals().warn_fg_color));
    }
}

fn show_costs(ui: &mut Ui, found: &OfferedLens) {
    let costs = &found.designed.costs;
    if costs.is_empty() {
        ui.weak("No limit costs anything");
        return;
    }
    let texts: Vec<String> = costs.iter().map(text::cost_text).collect();
    ui.weak("What limits cost").on_hover_text(format!("{COST}\n{}", texts.join("\n")));
    for line in texts.iter().take(COSTS) {
        ui.label(RichText::new(line).small());
    }
    if costs.len() > COSTS {
        ui.weak(format!("and {} more", costs.len() - COSTS)).on_hover_text(texts.join("\n"));
    }
}

const AS_BUILT: &str = "RMS spot radius over the fields of lenses with the errors of making that the \
    specification states, each refocused: the expectation, and what nine in ten do not exceed.";

const COST: &str = "The decrease of the RMS over the fields by a bound looser by 1 mm.";
