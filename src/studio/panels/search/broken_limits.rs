//! The limits that the start and the best lens of a search break: which, whose they are, and what can be done.

use egui::{Button, CollapsingHeader, Label, RichText, Ui};

use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::{SearchPlan, describe_violation};
use crate::session::StructureSearchSnapshot;
use crate::studio::number::format_digits;
use crate::studio::panels::field_name;
use crate::studio::text::counted;

/// The reason why a lens that keeps the limits of its merit function can break those of a search.
const WHY: &str = "Setup has limits of its own, of manufacturing and of light, beside those of the merit \
    function; the tighter ones hold in a search, and the optimizer keeps those of the merit function \
    alone. The search moves towards all of them, and a lens that is exported has to satisfy them.";

/// Shows the broken limits of the start and of the best lens; the plan of the next search can be loosened
/// until one satisfies it.
pub(super) fn broken_limits(ui: &mut Ui, run: &StructureSearchSnapshot, next: &mut SearchPlan) {
    let lenses = [("start", &run.start_violations), ("best lens", &run.best_violations)];
    for (lens, limits) in lenses.into_iter().filter(|(_, limits)| !limits.is_empty()) {
        let count = counted(limits.len() as u64, "limit");
        let title = RichText::new(format!("The {lens} breaks {count} of this search")).small();
        let title = title.color(ui.visuals().warn_fg_color);
        let header = CollapsingHeader::new(title).id_salt(("broken limits", lens));
        header.show(ui, |ui| {
            ui.add(Label::new(RichText::new(WHY).small().weak()).wrap());
            for line in lines(run, limits) {
                ui.add(Label::new(RichText::new(line).small()).wrap());
            }
            loosen_button(ui, lens, (run, limits), next);
        });
    }
}

/// Offers to loosen the plan of the next search to what a lens has.
fn loosen_button(
    ui: &mut Ui,
    lens: &str,
    (run, limits): (&StructureSearchSnapshot, &[ConstraintMargin]),
    next: &mut SearchPlan,
) {
    let mut loosened = next.clone();
    limits.iter().for_each(|limit| loosened.rules.admit(limit));
    let kept = limits.iter().filter(|limit| is_light(limit)).filter_map(share_of_least);
    if let Some(kept) = kept.reduce(f64::min) {
        let asked = run.request.plan.light.iter();
        loosened.light = asked.map(|share| (1e3 * share * kept).floor() / 1e3).collect();
    }
    let button = Button::new(RichText::new(format!("Allow what the {lens} has")).small());
    let button = ui.add_enabled(loosened != *next, button);
    let button =
        button.on_disabled_hover_text("Setup allows it already, or none of its limits is broken");
    let hint = "Loosens the limits of Setup to the numbers of this lens, for the next search";
    if button.on_hover_text(hint).clicked() {
        *next = loosened;
    }
}

fn is_light(limit: &ConstraintMargin) -> bool {
    limit.term == "light"
}

/// The share of the least value that a lens has.
fn share_of_least(limit: &ConstraintMargin) -> Option<f64> {
    limit.min.map(|min| limit.value / min)
}

/// Each limit with its owner; the light of all fields and colours is one line with the darkest.
fn lines(run: &StructureSearchSnapshot, limits: &[ConstraintMargin]) -> Vec<String> {
    let others = limits.iter().filter(|limit| !is_light(limit));
    let line =
        |limit| format!("{} ({})", describe_violation(limit), owner(&run.request.plan, limit));
    let mut lines: Vec<String> = others.map(line).collect();
    let dark: Vec<&ConstraintMargin> = limits.iter().filter(|limit| is_light(limit)).collect();
    let darkest = dark.iter().min_by(|a, b| {
        let share = |limit: &ConstraintMargin| share_of_least(limit).unwrap_or(f64::INFINITY);
        share(a).total_cmp(&share(b))
    });
    lines.extend(darkest.map(|darkest| light_line(run, darkest, dark.len())));
    lines
}

fn light_line(run: &StructureSearchSnapshot, limit: &ConstraintMargin, count: usize) -> String {
    let fields = run.start.lens.fields_at(limit.zoom);
    let field = limit.surface.and_then(|index| fields.values.get(index));
    let field = field.map_or_else(String::new, |field| field_name(fields.kind, *field));
    let nm = limit.um.map_or_else(String::new, |um| format!(", {:.0} nm", 1e3 * um));
    let [value, least] = [limit.value, limit.min.unwrap_or(0.0)].map(|area| format_digits(area, 4));
    let more = if count > 1 { format!(", and {} more", count - 1) } else { String::new() };
    format!("light at {field}{nm}: {value} mm² instead of at least {least}{more} (Light of Setup)")
}

/// The place where a broken limit was set.
fn owner(plan: &SearchPlan, limit: &ConstraintMargin) -> &'static str {
    let is_of_setup = match plan.rules.clone().broken_rule(limit) {
        Some(bound) => Some(*bound) == limit.min || Some(*bound) == limit.max,
        None => limit.term == "elements",
    };
    if is_of_setup { "limit of Setup" } else { "limit of the merit function" }
}
