//! Fields of the dialogs: numbers that are dragged or typed, and choices from a few.

use egui::{ComboBox, Context, DragValue, Frame, InnerResponse, Key, Margin, Popup, Response, Ui};

use super::number;
use super::text_input::select_whole;
use crate::math::expression::evaluate;

/// The digits of a number in a dialog.
const DIGITS: i32 = 6;

/// The frame of a dialog.
pub(super) fn dialog_frame(context: &Context) -> Frame {
    Frame::popup(&context.global_style()).inner_margin(Margin::same(14))
}

/// Shows a number that is dragged or typed, with arithmetic as in the table: `*2`, `1/3`.
pub(super) fn number_field(ui: &mut Ui, name: &str, value: &mut f64, unit: &str) -> Response {
    let old = *value;
    let unit_of_text = unit.trim().to_owned();
    let drag = DragValue::new(value)
        .speed((0.005 * old.abs()).max(0.001))
        .suffix(unit)
        .custom_formatter(|value, _| number::format_digits(value, DIGITS))
        .custom_parser(move |text| {
            evaluate(text.trim().trim_end_matches(unit_of_text.as_str()), old).ok()
        });
    ui.add(drag).accessible_name(name)
}

/// Gives a number of a dialog the cursor, with its whole text selected so that typing replaces it.
pub(super) fn enter_number(ui: &Ui, field: &Response) {
    field.request_focus();
    select_whole(ui.ctx(), field.id);
}

/// True if Enter confirms a dialog whose fields have been shown: a number has given the cursor back at this
/// key, and no button or list has it.
pub(super) fn is_confirmed(ui: &Ui) -> bool {
    ui.input(|input| input.key_pressed(Key::Enter))
        && ui.memory(|memory| memory.focused().is_none())
}

/// True if Enter was pressed on a choice that is made already: it confirms the dialog, as on a number.
pub(super) fn confirms(ui: &Ui, choice: &Response, is_chosen: bool) -> bool {
    is_chosen && choice.has_focus() && ui.input(|input| input.key_pressed(Key::Enter))
}

/// Shows a choice from a few.
pub(super) fn choice<T: PartialEq + Copy>(
    ui: &mut Ui,
    name: &str,
    chosen: &mut T,
    all: &[(T, &str)],
) {
    let title = all.iter().find(|(value, _)| value == chosen).map_or("", |(_, title)| *title);
    let combo = ComboBox::from_id_salt(name).selected_text(title).width(190.0);
    let list = combo.show_ui(ui, |ui| {
        for (value, title) in all {
            ui.selectable_value(chosen, *value, *title);
        }
    });
    named_list(ui, list, name);
}

/// Names the button of a list, and lets keys use the list as a pointer does: Enter and Space close it when
/// they choose, and the button has the cursor afterwards, so that the next Tab goes on from there.
pub(super) fn named_list<T>(
    ui: &Ui,
    list: InnerResponse<Option<T>>,
    name: impl Into<String>,
) -> Response {
    let InnerResponse { inner, response: button } = list;
    if inner.is_some() {
        close_by_key(ui, &button);
    }
    button.accessible_name(name)
}

/// Closes the list of a button after a key that chooses, and gives the cursor back after one that closes.
fn close_by_key(ui: &Ui, button: &Response) {
    let pressed = |key| ui.input(|input| input.key_pressed(key));
    // The key that opens the list is pressed on its button.
    if (pressed(Key::Enter) || pressed(Key::Space)) && !button.clicked() {
        Popup::close_id(ui.ctx(), Popup::default_response_id(button));
        button.request_focus();
    } else if pressed(Key::Escape) {
        button.request_focus();
    }
}
