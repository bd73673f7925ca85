//! The panel of the physical effects: which are computed, why, and the time that leaving them out
//! saves.

use egui::{Align, Color32, ComboBox, Frame, Layout, Margin, RichText, ScrollArea, Ui};

use super::{Panel, displayed_results, show_missing_results};
use crate::effects::{EffectCost, EffectDecision, EffectOverride, EffectPlan};
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::text::{capitalize, micrometres};

/// The panel.
#[derive(Debug)]
pub struct EffectsPanel;

impl Panel for EffectsPanel {
    fn title(&self) -> &'static str {
        "Effects"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((_, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            table(ui, &numbers.plan.value, view, actions);
        });
    }
}

fn table(ui: &mut Ui, plan: &EffectPlan, view: &SessionView, actions: &mut Actions) {
    ui.spacing_mut().item_spacing.y = 1.0;
    for (i, decision) in plan.decisions.iter().enumerate() {
        let striped = if i % 2 == 0 { ui.visuals().faint_bg_color } else { Color32::TRANSPARENT };
        let margin = Margin { left: 3, right: 10, top: 3, bottom: 3 };
        Frame::new().fill(striped).inner_margin(margin).show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            ui.horizontal(|ui| {
                state_label(ui, decision);
                ui.strong(capitalize(decision.effect.name()));
                let chosen = view.settings.overrides.get(decision.effect);
                override_menu(ui, decision, chosen, actions);
            });
            let reason = micrometres(&capitalize(&decision.reason));
            ui.label(RichText::new(reason).small());
            ui.label(RichText::new(reason_text(decision)).small().weak()).on_hover_text(
                "The error if the effect is left out, the limit above which it is needed, and the \
                 measured share of the time of the spots that leaving it out saves",
            );
        });
    }
}

/// Shows whether the effect is computed.
fn state_label(ui: &mut Ui, decision: &EffectDecision) {
    let visuals = ui.visuals();
    let (text, color) = if decision.computed {
        ("on", visuals.hyperlink_color)
    } else {
        ("off", visuals.weak_text_color())
    };
    ui.label(RichText::new(text).monospace().color(color));
}

fn override_menu(
    ui: &mut Ui,
    decision: &EffectDecision,
    old: EffectOverride,
    actions: &mut Actions,
) {
    let mut chosen = old;
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let combo = ComboBox::from_id_salt(decision.effect.name()).width(56.0);
        let combo = combo.selected_text(override_name(chosen)).show_ui(ui, |ui| {
            for choice in [EffectOverride::Auto, EffectOverride::On, EffectOverride::Off] {
                ui.selectable_value(&mut chosen, choice, override_name(choice));
            }
        });
        let label = format!("Choice of {}", decision.effect.name());
        named_list(ui, combo, label).on_hover_text("Auto follows the plan for this lens");
    });
    if chosen != old {
        actions.push(Command::SetEffect(decision.effect, chosen));
    }
}

const fn override_name(choice: EffectOverride) -> &'static str {
    match choice {
        EffectOverride::Auto => "Auto",
        EffectOverride::On => "On",
        EffectOverride::Off => "Off",
    }
}

/// The number that the decision rests on, its limit, and the time at stake.
fn reason_text(decision: &EffectDecision) -> String {
    let digits = |value: f64| number::format_digits(value, 3);
    let EffectDecision { error, limit, unit, cost, .. } = decision;
    let (scale, unit) = if *unit == "mm" { (1e3, "µm") } else { (1.0, *unit) };
    let rests = format!("{} {unit}, limit {} {unit}", digits(scale * error), digits(scale * limit));
    match *cost {
        Some(cost) if cost.saved_share != 0.0 => {
            format!("{rests}; {}", cost_text(cost, decision.computed))
        }
        _ => rests,
    }
}

/// The time at stake; none where the difference is not larger than its error.
fn cost_text(EffectCost { saved_share, saved_ms, error_ms }: EffectCost, computed: bool) -> String {
    let verb = if computed { "would save" } else { "saves" };
    if saved_ms <= error_ms {
        return format!("{verb} no time that can be measured");
    }
    let percent = 100.0 * saved_share;
    format!("{verb} {percent:.0} % of the spots ({saved_ms:.2} ± {error_ms:.2} ms)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saving_below_its_error_is_none() {
        let cost = |saved_ms| EffectCost { saved_share: 0.1 * saved_ms, saved_ms, error_ms: 0.5 };
        assert_eq!(cost_text(cost(-2.0), true), "would save no time that can be measured");
        assert_eq!(cost_text(cost(0.2), false), "saves no time that can be measured");
        assert_eq!(cost_text(cost(2.0), false), "saves 20 % of the spots (2.00 ± 0.50 ms)");
    }
}
