//! The limits of the merit function: the broken ones and the binding ones are named, and a click
//! shows where they are.

use egui::{CollapsingHeader, Color32, Link, RichText, Ui};

use super::terms::title;
use crate::lens::SurfaceNumber;
use crate::merit::ConstraintMargin;
use crate::session::{Command, MeritReport, MeritValues, SessionView};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::text::counted;

/// The distance from a bound, relative to the bound, below which it is binding.
const BINDING: f64 = 1e-4;

/// The position of a quantity relative to its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum LimitState {
    Broken,
    Binding,
    Kept,
}

impl LimitState {
    fn of(margin: &ConstraintMargin) -> Self {
        let bounds = [margin.min, margin.max].into_iter().flatten();
        let near = BINDING * bounds.fold(0.0, |size: f64, bound| size.max(bound.abs()));
        match margin.slack() {
            slack if slack < -near.max(f64::EPSILON) => Self::Broken,
            slack if slack <= near => Self::Binding,
            _ => Self::Kept,
        }
    }

    fn color(self, ui: &Ui) -> Color32 {
        match self {
            Self::Broken => ui.visuals().error_fg_color,
            Self::Binding => ui.visuals().warn_fg_color,
            Self::Kept => ui.visuals().text_color(),
        }
    }
}

/// Shows all limits, the broken ones first.
pub(super) fn list(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let Some(MeritReport { goal, values: Ok(MeritValues { limits, .. }), .. }) =
        view.merit.as_deref()
    else {
        return;
    };
    if limits.is_empty() {
        return;
    }
    let mut limits: Vec<_> = limits.iter().map(|limit| (LimitState::of(limit), limit)).collect();
    limits.sort_by(|(a, left), (b, right)| a.cmp(b).then(left.slack().total_cmp(&right.slack())));
    let count = |state| limits.iter().filter(|(other, _)| *other == state).count();
    let [broken, binding] = [LimitState::Broken, LimitState::Binding].map(count);
    let summary = match (broken, binding) {
        (0, 0) => "all kept".to_owned(),
        (0, binding) => format!("{binding} binding"),
        (broken, 0) => format!("{broken} broken"),
        (broken, binding) => format!("{broken} broken, {binding} binding"),
    };
    let color = limits.first().map_or(Color32::PLACEHOLDER, |(state, _)| state.color(ui));
    // The panels show the candidate, and these are the values before it.
    let of = if view.preview_results.is_some() { " of the design" } else { "" };
    let heading = format!("{}{of}: {summary}", counted(limits.len() as u64, "limit"));
    let heading = RichText::new(heading);
    let header = CollapsingHeader::new(heading.color(color)).id_salt("limits");
    header.default_open(true).show(ui, |ui| {
        for (state, limit) in limits {
            let term = goal.terms.iter().find(|weighted| weighted.term.name() == limit.term);
            let name = term.map_or(limit.term, |weighted| title(weighted.term));
            let text = RichText::new(limit_text(name, limit)).color(state.color(ui));
            let link = ui.add(Link::new(text)).on_hover_text("Show where it is");
            if link.clicked() {
                actions.push(Command::ShowZoom(limit.zoom));
                actions.push(Command::Select(limit.surface.filter(|_| limit.um.is_none())));
            }
        }
    });
}

/// A limit in words: what, where, its value, its bounds.
fn limit_text(name: &str, limit: &ConstraintMargin) -> String {
    let short = |value: f64| number::format_digits(value, 4);
    let surface = limit.surface.map(|at| format!(" at surface {}", SurfaceNumber::new(at)));
    let field = limit.field.map(|at| format!(", field {}", at + 1));
    let place = [surface, field].into_iter().flatten().collect::<String>();
    let bounds = match (limit.min, limit.max) {
        (Some(min), Some(max)) => format!("{} to {}", short(min), short(max)),
        (Some(min), None) => format!("at least {}", short(min)),
        (None, Some(max)) => format!("at most {}", short(max)),
        (None, None) => String::new(),
    };
    let of = if bounds.is_empty() { ", no bound" } else { " of " };
    let zoom = if limit.zoom > 0 { format!(", zoom {}", limit.zoom + 1) } else { String::new() };
    format!("{name}{}{zoom}: {}{of}{bounds}", place, short(limit.value))
}
