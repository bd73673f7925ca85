//! Which physics is computed for this lens, on which number that rests, and what it saves.

use eframe::egui::{Align, Color32, ComboBox, Frame, Layout, Margin, RichText, ScrollArea, Ui};

use super::{Panel, no_numbers, shown};
use crate::effects::{Choice, Decision, Plan};
use crate::session::{Command, View};
use crate::studio::number;
use crate::studio::wording::{capital, counted_from_one};

/// The panel.
#[derive(Debug)]
pub struct Effects;

impl Panel for Effects {
    fn title(&self) -> &'static str {
        "Effects"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        let Some((_, numbers)) = shown(view) else { return no_numbers(ui, view) };
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            table(ui, &numbers.plan.value, view, wishes);
        });
    }
}

fn table(ui: &mut Ui, plan: &Plan, view: &View, wishes: &mut Vec<Command>) {
    ui.spacing_mut().item_spacing.y = 1.0;
    for (i, decision) in plan.decisions.iter().enumerate() {
        let striped = if i % 2 == 0 { ui.visuals().faint_bg_color } else { Color32::TRANSPARENT };
        let margin = Margin { left: 3, right: 10, top: 3, bottom: 3 };
        Frame::new().fill(striped).inner_margin(margin).show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            ui.horizontal(|ui| {
                state(ui, decision);
                ui.strong(capital(decision.effect.name()));
                let chosen = view.settings.choices.of(decision.effect);
                choice(ui, decision, chosen, wishes);
            });
            let reason = capital(&counted_from_one(&decision.reason));
            ui.label(RichText::new(reason).small());
            ui.label(RichText::new(numbers(decision)).small().weak()).on_hover_text(
                "What changes if the effect is left out, above what that is needed, and the share \
                 of the time of tracing that leaving it out saves",
            );
        });
    }
}

/// Whether the effect is computed.
fn state(ui: &mut Ui, decision: &Decision) {
    let visuals = ui.visuals();
    let (text, color) = if decision.computed {
        ("on", visuals.hyperlink_color)
    } else {
        ("off", visuals.weak_text_color())
    };
    ui.label(RichText::new(text).monospace().color(color));
}

fn choice(ui: &mut Ui, decision: &Decision, old: Choice, wishes: &mut Vec<Command>) {
    let mut chosen = old;
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let combo = ComboBox::from_id_salt(decision.effect.name()).width(56.0);
        let combo = combo.selected_text(name(chosen)).show_ui(ui, |ui| {
            for choice in [Choice::Auto, Choice::On, Choice::Off] {
                ui.selectable_value(&mut chosen, choice, name(choice));
            }
        });
        let label = format!("Choice of {}", decision.effect.name());
        combo.response.accessible_name(label).on_hover_text("Auto follows the plan for this lens");
    });
    if chosen != old {
        wishes.push(Command::Choose(decision.effect, chosen));
    }
}

const fn name(choice: Choice) -> &'static str {
    match choice {
        Choice::Auto => "Auto",
        Choice::On => "On",
        Choice::Off => "Off",
    }
}

/// The number that the decision rests on, its limit, and the time at stake.
fn numbers(decision: &Decision) -> String {
    let digits = |value: f64| number::show_digits(value, 3);
    let Decision { error, limit, unit, saves, .. } = decision;
    let rests = format!("{} {unit}, limit {} {unit}", digits(*error), digits(*limit));
    if *saves <= 0.0 {
        return rests;
    }
    let verb = if decision.computed { "would save" } else { "saves" };
    let time = decision.saved_ms.map(|ms| format!(" ({ms:.2} ms)")).unwrap_or_default();
    format!("{rests}; {verb} {:.0} % of tracing{time}", 100.0 * saves)
}
