//! Changes of the tolerances of the design: each is one undo step, and one that would leave a lens that
//! cannot be used is refused with its reason.

use egui::{Button, DragValue, Response, RichText, Ui};

use crate::lens::{Edit, Lens, ToleranceSheet};
use crate::session::{Command, PanelSetting};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::panels::valid_edit;
use crate::studio::text::capitalize;
use crate::studio::text_input::error_color;

/// The tolerances of the design, and what becomes of their changes.
pub(super) struct SheetEditor<'a> {
    /// The design.
    pub(super) lens: &'a Lens,
    /// Its tolerances, or those that a class proposes for it.
    pub(super) sheet: &'a ToleranceSheet,
    /// The reason why the last change was refused.
    pub(super) refused: &'a mut Option<String>,
    pub(super) actions: &'a mut Actions,
}

impl SheetEditor<'_> {
    /// Asks for changed tolerances of the lens.
    pub(super) fn change(&mut self, change: impl FnOnce(&mut ToleranceSheet)) {
        let mut sheet = self.sheet.clone();
        change(&mut sheet);
        match valid_edit(self.lens, Edit::SetTolerances(Some(sheet))) {
            Ok(edit) => {
                *self.refused = None;
                self.actions.push(Command::Edit(edit));
            }
            Err(why) => self.refuse(&why),
        }
    }

    /// Shows why a change is not possible.
    pub(super) fn refuse(&mut self, why: &str) {
        *self.refused = Some(capitalize(why));
    }

    /// Asks for a setting.
    pub(super) fn show(&mut self, setting: PanelSetting) {
        self.actions.push(Command::Show(setting));
    }

    /// Highlights a surface in every panel.
    pub(super) fn select(&mut self, surface: usize) {
        self.actions.push(Command::Select(Some(surface)));
    }
}

/// Shows the reason why the last change was refused.
pub(super) fn refusal(ui: &mut Ui, refused: Option<&str>) {
    if let Some(why) = refused {
        ui.label(RichText::new(why).color(error_color(ui)));
    }
}

/// A button that removes a row; `name` is what it removes.
pub(super) fn remove_button(ui: &mut Ui, name: &str) -> bool {
    let label = format!("Remove {name}");
    let button = ui.add(Button::new(RichText::new("×").small()).frame(false));
    button.on_hover_text(&label).accessible_name(&label).clicked()
}

/// The number that is being changed in one of several fields, until the change ends.
#[derive(Debug)]
pub(super) struct DraggedNumber<K>(Option<(K, f64)>);

impl<K> Default for DraggedNumber<K> {
    fn default() -> Self {
        Self(None)
    }
}

/// A field of a number that is zero or more.
pub(super) struct NumberField<'a> {
    pub(super) name: &'a str,
    pub(super) unit: &'a str,
    /// The smallest number.
    pub(super) least: f64,
    /// The largest number.
    pub(super) most: f64,
    /// The change by a point of dragging.
    pub(super) speed: f64,
}

impl<K: PartialEq + Copy> DraggedNumber<K> {
    /// Shows a field; the number once its change has ended.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        key: K,
        stored: f64,
        field: &NumberField<'_>,
    ) -> Option<f64> {
        let changing = self.0.filter(|(own, _)| *own == key).map(|(_, value)| value);
        let mut value = changing.unwrap_or(stored);
        let drag = DragValue::new(&mut value)
            .speed(field.speed.max(f64::MIN_POSITIVE))
            .range(field.least..=field.most)
            .update_while_editing(false)
            .suffix(field.unit)
            .custom_formatter(|value, _| number::format_digits(value, 3));
        let response: Response = ui.add(drag).accessible_name(field.name);
        if response.changed() {
            self.0 = Some((key, value));
        }
        let has_ended = response.drag_stopped() || response.lost_focus() || !response.dragged();
        let (_, value) = self.0.filter(|(own, _)| *own == key && has_ended)?;
        self.0 = None;
        Some(value)
    }
}
