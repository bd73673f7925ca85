//! A line to type into that loses nothing: what is typed stays until it is accepted or given up.
//!
//! Enter, Tab and a click elsewhere end the typing, Escape gives it up. A text that was refused
//! stays where it was typed, marked, with the reason beside it.

use eframe::egui::text::{CCursor, CCursorRange};
use eframe::egui::text_edit::TextEditState;
use eframe::egui::{
    Align, Align2, Color32, Context, Frame, Id, Key, Margin, Memory, Response, Stroke, TextEdit,
    Ui, WidgetText,
};

/// What was typed into the fields of a panel and is not accepted yet.
#[derive(Debug, Default)]
pub struct Drafts {
    drafts: Vec<Draft>,
    /// The field that was entered by a click that is still going on: it selects all of its text
    /// once the button is released.
    entered: Option<Id>,
}

#[derive(Debug)]
struct Draft {
    field: Id,
    /// What the field showed when the typing began.
    before: String,
    text: String,
    refused: Option<String>,
}

/// How a field looks and what it is called.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// What a screen reader calls it.
    pub name: &'a str,
    /// What it shows while nothing is typed.
    pub shown: &'a str,
    /// What it shows, faintly, where it is empty.
    pub hint: &'a str,
    /// Numbers stand at the right.
    pub align: Align,
    /// Where it stands.
    pub place: Place,
}

/// Where a field stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// In a table, whose lines are frame enough.
    Table,
    /// By itself, with a frame that says where one can type.
    Form,
}

/// What became of a field in this frame.
#[derive(Debug)]
pub struct Entry {
    /// The field.
    pub response: Response,
    /// What was typed, when typing has just ended.
    pub typed: Option<String>,
}

impl Drafts {
    /// Shows a field in all the width that is left.
    pub fn show(&mut self, ui: &mut Ui, id: Id, field: Field<'_>) -> Entry {
        self.forget_stale(ui, id, field.shown);
        let draft = self.drafts.iter().position(|draft| draft.field == id);
        let mut text = draft.map_or(field.shown, |i| self.drafts[i].text.as_str()).to_owned();
        let refused = draft.and_then(|i| self.drafts[i].refused.clone());
        let response = edit(ui, id, field, &mut text, refused.is_some());
        self.select_all(ui, &response);
        if response.changed() {
            self.keep(id, field.shown, &text);
        }
        let typed = if response.lost_focus() { self.end(ui, id) } else { None };
        let response = match refused {
            Some(why) => response.on_hover_text(WidgetText::from(why).color(error_color(ui))),
            None => response,
        };
        Entry { response, typed }
    }

    /// Says why what was typed into a field cannot be taken; it stays there.
    pub fn refuse(&mut self, field: Id, why: String) {
        if let Some(draft) = self.drafts.iter_mut().find(|draft| draft.field == field) {
            draft.refused = Some(why);
        }
    }

    /// What was typed into a field has been taken.
    pub fn accept(&mut self, field: Id) {
        self.drafts.retain(|draft| draft.field != field);
    }

    /// Gives everything up, as for another lens.
    pub fn clear(&mut self) {
        self.drafts.clear();
    }

    /// Why the last text that was refused cannot be taken.
    pub fn complaint(&self) -> Option<&str> {
        self.drafts.iter().rev().find_map(|draft| draft.refused.as_deref())
    }

    /// What is being typed into a field.
    pub fn text(&self, field: Id) -> Option<&str> {
        self.drafts.iter().find(|draft| draft.field == field).map(|draft| draft.text.as_str())
    }

    /// Whether something is being typed into the field that has the cursor.
    pub fn is_typing(&self, context: &Context) -> bool {
        let cursor = context.memory(Memory::focused);
        self.drafts.iter().any(|draft| Some(draft.field) == cursor)
    }

    fn keep(&mut self, field: Id, shown: &str, text: &str) {
        let at = self.drafts.iter().position(|draft| draft.field == field);
        let at = at.unwrap_or_else(|| {
            let before = shown.to_owned();
            self.drafts.push(Draft { field, before, text: String::new(), refused: None });
            self.drafts.len() - 1
        });
        text.clone_into(&mut self.drafts[at].text);
        self.drafts[at].refused = None;
    }

    /// Ends the typing: gives the text, or gives it up.
    fn end(&mut self, ui: &Ui, field: Id) -> Option<String> {
        if ui.input(|input| input.key_pressed(Key::Escape)) {
            self.accept(field);
            return None;
        }
        let draft = self.drafts.iter().find(|draft| draft.field == field)?;
        if draft.text == draft.before {
            self.accept(field);
            return None;
        }
        Some(draft.text.clone())
    }

    /// A refused text goes once the value below it changes, by undo for example.
    fn forget_stale(&mut self, ui: &Ui, field: Id, shown: &str) {
        if !ui.memory(|memory| memory.has_focus(field)) {
            self.drafts.retain(|draft| draft.field != field || draft.before == shown);
        }
    }

    /// Selects the whole text of a field that is entered, so that typing replaces it.
    fn select_all(&mut self, ui: &Ui, field: &Response) {
        if field.gained_focus() {
            self.entered = Some(field.id);
        }
        if self.entered != Some(field.id) {
            return;
        }
        let mut state = TextEditState::load(ui.ctx(), field.id).unwrap_or_default();
        let all = CCursorRange::two(CCursor::new(0), CCursor::new(usize::MAX >> 1));
        state.cursor.set_char_range(Some(all));
        state.store(ui.ctx(), field.id);
        if !ui.input(|input| input.pointer.any_down()) {
            self.entered = None;
        }
    }
}

/// The colour of what was refused.
pub fn error_color(ui: &Ui) -> Color32 {
    ui.visuals().error_fg_color
}

fn edit(ui: &mut Ui, id: Id, field: Field<'_>, text: &mut String, refused: bool) -> Response {
    let focused = ui.memory(|memory| memory.has_focus(id));
    let hovered = ui.ctx().read_response(id).is_some_and(|last| last.hovered());
    let visuals = ui.visuals();
    let boxed = field.place == Place::Form;
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
    let line = TextEdit::singleline(text)
        .id(id)
        .hint_text(field.hint)
        .frame(frame)
        .align(Align2([field.align, Align::Center]))
        .desired_width(f32::INFINITY);
    ui.add(line).accessible_name(field.name)
}
