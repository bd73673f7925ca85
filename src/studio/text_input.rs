//! A text field whose text is kept until it is accepted or discarded.
//!
//! Enter, Tab and a click elsewhere end the editing of a line, Escape discards it. A rejected text remains in
//! its field, marked, with the reason as a tooltip.

use std::ops::Range;

use egui::text::{CCursor, CCursorRange};
use egui::text_edit::TextEditState;
use egui::{
    Align, Align2, Color32, Context, Frame, Id, Key, Margin, Memory, Response, Stroke, TextEdit,
    Ui, WidgetText,
};

/// Texts of the fields of a panel that are being edited or were rejected.
#[derive(Debug, Default)]
pub struct EditBuffers {
    buffers: Vec<EditBuffer>,
    /// The field that was entered by a click that is still going on: it selects all of its text
    /// once the button is released.
    selecting: Option<Id>,
    /// The field with the cursor and its text that is selected as a whole, as long as nothing is typed.
    entered: Option<(Id, String)>,
}

#[derive(Debug)]
struct EditBuffer {
    input: Id,
    /// The text of the field when the editing began.
    original: String,
    text: String,
    error: Option<String>,
}

/// Text, name and look of a field.
#[derive(Debug, Clone, Copy)]
pub struct TextInput<'a> {
    /// The accessible name.
    pub name: &'a str,
    /// The text while the field is not edited.
    pub value: &'a str,
    /// The hint in an empty field.
    pub hint: &'a str,
    /// The alignment: numbers to the right.
    pub align: Align,
    /// The frame of the field.
    pub placement: InputPlacement,
}

impl<'a> TextInput<'a> {
    /// A cell of a table, without a hint.
    pub fn in_table(name: &'a str, value: &'a str, align: Align) -> Self {
        Self { name, value, hint: "", align, placement: InputPlacement::Table }
    }
}

/// The surroundings of a field, which decide its frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputPlacement {
    /// In a table, whose lines are frame enough.
    Table,
    /// A form, in which every field has a frame of its own.
    Form,
    /// The same for text of several lines, in which Enter begins another one.
    Paragraph,
}

/// The result of showing a field.
#[derive(Debug)]
pub struct InputResponse {
    /// The field.
    pub response: Response,
    /// The new text, if the editing has just ended and has changed it.
    pub submitted: Option<String>,
}

impl EditBuffers {
    /// Shows a field in all the width that is left.
    pub fn show(&mut self, ui: &mut Ui, id: Id, field: TextInput<'_>) -> InputResponse {
        self.discard_stale(ui, id, field.value);
        self.follow_value(ui, id, field.value);
        let draft = self.buffers.iter().position(|draft| draft.input == id);
        let mut text = draft.map_or(field.value, |i| self.buffers[i].text.as_str()).to_owned();
        let refused = draft.and_then(|i| self.buffers[i].error.clone());
        let response = edit(ui, id, field, &mut text, refused.is_some());
        self.select_all(ui, &response);
        if response.changed() {
            self.store(id, field.value, &text);
        }
        let typed = if response.lost_focus() { self.finish(ui, id) } else { None };
        let response = match refused {
            Some(why) => response.on_hover_text(WidgetText::from(why).color(error_color(ui))),
            None => response,
        };
        InputResponse { response, submitted: typed }
    }

    /// Marks the text of a field as rejected, for a reason.
    pub fn reject(&mut self, field: Id, why: String) {
        if let Some(draft) = self.buffers.iter_mut().find(|draft| draft.input == field) {
            draft.error = Some(why);
        }
    }

    /// Accepts the text of a field: its buffer is removed.
    pub fn accept(&mut self, field: Id) {
        self.buffers.retain(|draft| draft.input != field);
    }

    /// The reason why the last rejected text cannot be accepted.
    pub fn last_error(&self) -> Option<&str> {
        self.buffers.iter().rev().find_map(|draft| draft.error.as_deref())
    }

    /// The text that is being typed into a field.
    pub fn text(&self, field: Id) -> Option<&str> {
        self.buffers.iter().find(|draft| draft.input == field).map(|draft| draft.text.as_str())
    }

    /// True if the field with the cursor has been edited.
    pub fn is_typing(&self, context: &Context) -> bool {
        let cursor = context.memory(Memory::focused);
        self.buffers.iter().any(|draft| Some(draft.input) == cursor)
    }

    /// Replaces the text that is being typed into a field.
    pub fn replace(&mut self, field: Id, text: String) {
        if let Some(draft) = self.buffers.iter_mut().find(|draft| draft.input == field) {
            draft.text = text;
        }
    }

    fn store(&mut self, field: Id, shown: &str, text: &str) {
        let at = self.buffers.iter().position(|draft| draft.input == field);
        let at = at.unwrap_or_else(|| {
            let before = shown.to_owned();
            self.buffers.push(EditBuffer {
                input: field,
                original: before,
                text: String::new(),
                error: None,
            });
            self.buffers.len() - 1
        });
        text.clone_into(&mut self.buffers[at].text);
        self.buffers[at].error = None;
    }

    /// Ends the typing: gives the text, or gives it up.
    fn finish(&mut self, ui: &Ui, field: Id) -> Option<String> {
        if ui.input(|input| input.key_pressed(Key::Escape)) {
            self.accept(field);
            return None;
        }
        let draft = self.buffers.iter().find(|draft| draft.input == field)?;
        if draft.text == draft.original {
            self.accept(field);
            return None;
        }
        Some(draft.text.clone())
    }

    /// Discards a rejected text once the value below it changes, by undo for example.
    fn discard_stale(&mut self, ui: &Ui, field: Id, shown: &str) {
        if !ui.memory(|memory| memory.has_focus(field)) {
            self.buffers.retain(|draft| draft.input != field || draft.original == shown);
        }
    }

    /// Selects the whole text of the field with the cursor anew once its value changes without being
    /// typed, by undo for example: what is typed replaces all of the new text too.
    fn follow_value(&mut self, ui: &Ui, field: Id, shown: &str) {
        if !ui.memory(|memory| memory.has_focus(field)) {
            return;
        }
        if self.buffers.iter().any(|draft| draft.input == field) {
            self.entered = None;
            return;
        }
        let known = self.entered.as_ref().filter(|(entered, _)| *entered == field);
        if known.is_some_and(|(_, text)| text != shown) {
            // Before the field takes what is typed in this very frame.
            select_whole(ui.ctx(), field);
        }
        if known.is_none_or(|(_, text)| text != shown) {
            self.entered = Some((field, shown.to_owned()));
        }
    }

    /// Selects the whole text of a field that is entered, so that typing replaces it.
    fn select_all(&mut self, ui: &Ui, field: &Response) {
        if field.gained_focus() {
            self.selecting = Some(field.id);
        }
        if self.selecting != Some(field.id) {
            return;
        }
        select_whole(ui.ctx(), field.id);
        if !ui.input(|input| input.pointer.any_down()) {
            self.selecting = None;
        }
    }
}

/// Selects the whole text of a field.
pub(in crate::studio) fn select_whole(context: &Context, field: Id) {
    select_range(context, field, CCursorRange::two(CCursor::new(0), CCursor::new(usize::MAX >> 1)));
}

/// Moves the cursor of a field behind its text.
pub(in crate::studio) fn place_cursor_at_end(context: &Context, field: Id) {
    select_range(context, field, CCursorRange::one(CCursor::new(usize::MAX >> 1)));
}

/// Selects some characters of a field, so that typing replaces them.
pub(in crate::studio) fn select_characters(context: &Context, field: Id, chosen: Range<usize>) {
    let range = CCursorRange::two(CCursor::new(chosen.start), CCursor::new(chosen.end));
    select_range(context, field, range);
}

/// Selects a part of the text of a field.
fn select_range(context: &Context, field: Id, range: CCursorRange) {
    let mut state = TextEditState::load(context, field).unwrap_or_default();
    state.cursor.set_char_range(Some(range));
    state.store(context, field);
}

/// The colour of rejected texts and errors.
pub fn error_color(ui: &Ui) -> Color32 {
    ui.visuals().error_fg_color
}

fn edit(ui: &mut Ui, id: Id, field: TextInput<'_>, text: &mut String, refused: bool) -> Response {
    let focused = ui.memory(|memory| memory.has_focus(id));
    let hovered = ui.ctx().read_response(id).is_some_and(|last| last.hovered());
    let visuals = ui.visuals();
    let boxed = field.placement != InputPlacement::Table;
    let line = if refused {
        visuals.error_fg_color
    } else if focused {
        visuals.selection.stroke.color
    } else if boxed || hovered {
        visuals.widgets.noninteractive.bg_stroke.color
    } else {
        Color32::TRANSPARENT
    };
    let fill = if focused || boxed { visuals.extreme_bg_color } else { Color32::TRANSPARENT };
    let frame = Frame::new()
        .inner_margin(Margin::symmetric(4, 1))
        .corner_radius(2)
        .fill(fill)
        .stroke(Stroke::new(1.0, line));
    let line = match field.placement {
        InputPlacement::Paragraph => TextEdit::multiline(text).desired_rows(2),
        InputPlacement::Form | InputPlacement::Table => TextEdit::singleline(text),
    };
    let line = line
        .id(id)
        .hint_text(field.hint)
        .frame(frame)
        .align(Align2([field.align, Align::Center]))
        .desired_width(f32::INFINITY);
    ui.add(line).accessible_name(field.name)
}
