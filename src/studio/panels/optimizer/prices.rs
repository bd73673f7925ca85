//! The active limits of the optimized lens, with their prices.

use crate::optimize::LimitPrice;
use crate::studio::number;
use egui::{Grid, Ui};

/// Shows the active limits of the best lens; nothing if there are none.
pub(super) fn table(ui: &mut Ui, limits: &[LimitPrice]) {
    if limits.is_empty() {
        return;
    }
    ui.add_space(6.0);
    ui.strong("Active limits");
    Grid::new("binding limits").num_columns(4).spacing([8.0, 2.0]).striped(true).show(ui, |ui| {
        ui.weak("Limit");
        ui.weak("Value");
        ui.weak("Bound");
        ui.weak("Price").on_hover_text(
            "Decrease of the merit, in mm², per mm or per unit of the ratio by which the bound is \
             relaxed; for a prescribed value, by which it is increased",
        );
        ui.end_row();
        limits.iter().for_each(|limit| row(ui, limit));
    });
}

fn row(ui: &mut Ui, LimitPrice { limit, bound, price }: &LimitPrice) {
    let name = limit.term.replace('_', " ");
    let place = limit.place().map_or(String::new(), |place| format!(", {place}"));
    ui.label(format!("{name}{place}"));
    ui.label(number::format_digits(limit.value, 6));
    ui.label(number::format_digits(*bound, 6));
    ui.label(format!("{price:.2e}"));
    ui.end_row();
}
