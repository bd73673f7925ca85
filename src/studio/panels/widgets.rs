//! Widgets that several panels share.

use egui::{Button, Color32, ProgressBar, RectAlign, Response, RichText, Sense, Tooltip, Ui, vec2};
use egui_plot::Plot;

use crate::studio::actions::{Actions, UiAction};

/// A button that asks for one action.
#[derive(Debug)]
pub(super) struct ActionButton<'a> {
    text: &'a str,
    enabled: bool,
    action: UiAction,
    hint: &'a str,
}

impl<'a> ActionButton<'a> {
    pub(super) fn new(text: &'a str, enabled: bool, action: impl Into<UiAction>) -> Self {
        Self { text, enabled, action: action.into(), hint: "" }
    }

    pub(super) fn hint(self, hint: &'a str) -> Self {
        Self { hint, ..self }
    }
}

/// Shows buttons in a row.
pub(super) fn action_buttons<'a>(
    ui: &mut Ui,
    buttons: impl IntoIterator<Item = ActionButton<'a>>,
    actions: &mut Actions,
) {
    for ActionButton { text, enabled, action, hint } in buttons {
        if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hint).clicked() {
            actions.push(action);
        }
    }
}

/// Shows the main button of a panel; true if it was pressed. `reason` says why it is disabled.
pub(super) fn main_button(
    ui: &mut Ui,
    text: &str,
    enabled: bool,
    hint: &str,
    reason: &str,
) -> bool {
    let fill = ui.visuals().selection.bg_fill;
    let button = Button::new(RichText::new(text).strong()).fill(fill);
    let button = ui.add_enabled(enabled, button).on_hover_text(hint);
    button.on_disabled_hover_text(reason).clicked()
}

/// A progress bar with a text that is legible on its filled and on its empty part.
pub(in crate::studio) fn progress_bar(ui: &Ui, share: f32, text: impl Into<String>) -> ProgressBar {
    let text = RichText::new(text).color(ui.visuals().strong_text_color());
    ProgressBar::new(share).text(text)
}

/// Explains an item of a menu beside it, where the explanation covers no other item.
pub(in crate::studio) fn hint_beside(item: Response, text: &str) -> Response {
    let mut hint = Tooltip::for_enabled(&item);
    hint.popup = hint.popup.align(RectAlign::RIGHT_START);
    hint.show(|ui| {
        ui.set_max_width(ui.spacing().tooltip_width);
        ui.label(text)
    });
    item
}

/// A plot that can be neither moved nor zoomed.
pub(super) fn fixed_plot(name: &str, height: f32) -> Plot<'static> {
    let plot = Plot::new(name).height(height).allow_drag(false).allow_scroll(false);
    plot.allow_zoom(false).allow_boxed_zoom(false)
}

/// A small square of a colour, as in a legend.
pub(super) fn swatch(ui: &mut Ui, color: Color32) {
    let (rect, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
    ui.painter().rect_filled(rect, 1.0, color);
}
