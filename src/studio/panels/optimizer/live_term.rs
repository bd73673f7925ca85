//! The merit of the design as it is now: the value of every term, its error and its share.

use std::sync::Arc;

use egui::{Response, RichText, Ui};

use super::terms::value_text;
use crate::merit::{Term, TermValue, WeightedTerm};
use crate::session::SessionView;
use crate::studio::number;
use crate::studio::text::capitalize;

/// The smallest share that is shown.
const SMALLEST_SHARE: f64 = 5e-4;

/// The value of a term for the design.
#[derive(Clone, Copy)]
pub(super) struct LiveTerm {
    value: f64,
    error: f64,
    share: Option<f64>,
    is_current: bool,
}

impl LiveTerm {
    /// The value of the term at a place of the merit function, if it has been computed for it.
    pub(super) fn of(view: &SessionView, place: usize, weighted: WeightedTerm) -> Option<Self> {
        let report = view.merit.as_ref()?;
        let values = report.values.as_ref().ok()?;
        let TermValue { value, error, .. } = *values.terms.get(place)?;
        let known = report.goal.terms.get(place)?;
        ((known.term, known.scope) == (weighted.term, weighted.scope)).then_some(())?;
        let is_current = Arc::ptr_eq(&report.lens, &view.lens);
        Some(Self { value, error, share: values.share(place), is_current })
    }

    /// Shows the value.
    pub(super) fn value(self, ui: &mut Ui, term: Term) -> Response {
        let color = if self.is_current {
            ui.visuals().text_color()
        } else {
            ui.visuals().weak_text_color()
        };
        let text = value_text(term, self.value);
        let error = match self.error {
            0.0 => "exact to rounding".to_owned(),
            error => number::with_error(self.value, error),
        };
        ui.colored_label(color, text).on_hover_text(error)
    }

    /// Shows the value, and below it the share if there is one: a value alone is in the middle of its row.
    pub(super) fn cell(self, ui: &mut Ui, term: Term) {
        let share = self.share.filter(|share| *share >= SMALLEST_SHARE);
        let Some(share) = share else {
            return drop(self.value(ui, term));
        };
        ui.vertical(|ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            self.value(ui, term);
            ui.label(RichText::new(share_text(share)).small().weak());
        });
    }
}

/// A share in percent, with a decimal only where it is small: the column is narrow.
fn share_text(share: f64) -> String {
    if share < 0.0995 {
        return format!("{:.1} %", 100.0 * share);
    }
    format!("{:.0} %", 100.0 * share)
}

/// The merit of the design, or why it has none.
pub(super) fn show_total(ui: &mut Ui, view: &SessionView) {
    let Some(report) = &view.merit else { return };
    match &report.values {
        Ok(values) => {
            let of = if view.preview_results.is_some() { " of the design" } else { "" };
            let text = format!("Merit{of} {}", number::format_digits(values.total, 5));
            ui.strong(text).on_hover_text("The weighted sum of all terms for the design");
        }
        Err(why) => drop(ui.colored_label(ui.visuals().error_fg_color, capitalize(why))),
    }
}
