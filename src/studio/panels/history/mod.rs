//! The versions of the design as a tree, the newest first: a version is shown beside the present
//! one, named, made the design, or followed by another branch.

mod comparison;
mod spots;
mod tree;

use std::sync::Arc;

use egui::{
    Align, Context, Frame, Id, Layout as Arrange, Margin, Panel as Side, ScrollArea, Slider, Ui,
    vec2,
};

use super::Panel;
use super::widgets::{ActionButton, action_buttons};
use crate::session::{Command, HistoryNode, SessionView};
use crate::studio::actions::Actions;
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput};
use crate::studio::thumbnails::Thumbnails;

/// The least and the first height of the part about the selected version below the tree.
const DETAILS_HEIGHT: [f32; 2] = [120.0, 230.0];
/// The same of its width beside the tree, and the width of the panel from which it is there.
const DETAILS_WIDTH: [f32; 2] = [360.0, 480.0];
const BESIDE: f32 = 820.0;
/// The height of the line in its place while no version is selected.
const HINT_HEIGHT: f32 = 22.0;
/// The largest share of the panel that it takes.
const DETAILS_SHARE: f32 = 0.75;

/// The panel.
#[derive(Debug, Default)]
pub struct HistoryPanel {
    /// The version that was clicked.
    selected: Option<u64>,
    /// The step of the selected version's optimization to go back to.
    step: usize,
    thumbnails: Thumbnails,
    buffers: EditBuffers,
}

impl Panel for HistoryPanel {
    fn title(&self) -> &'static str {
        "History"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        match self.selected.and_then(|id| node(view, id)) {
            Some(selected) => self.selection(ui, view, selected, actions),
            None => hint(ui),
        }
        let scroll = ScrollArea::vertical().id_salt("versions").auto_shrink([false, false]);
        let clicked =
            scroll.show(ui, |ui| tree::tree(ui, view, self.selected, &mut self.thumbnails)).inner;
        if let Some(id) = clicked {
            self.select(view, id, actions);
        }
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context)
    }
}

/// The line that takes the place of a selected version.
fn hint(ui: &mut Ui) {
    let line = Side::bottom("no version").frame(Frame::new()).show_separator_line(false);
    line.exact_size(HINT_HEIGHT).show(ui, |ui| {
        ui.weak("Click a version to compare it with the present one.");
    });
}

impl HistoryPanel {
    /// The part about the selected version: below the tree, or beside it where there is room.
    fn selection(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        selected: &Arc<HistoryNode>,
        actions: &mut Actions,
    ) {
        let (side, room, [least, first], margin) = if ui.available_width() < BESIDE {
            let margin = Margin { top: 4, ..Margin::ZERO };
            (Side::bottom("selected version"), ui.available_height(), DETAILS_HEIGHT, margin)
        } else {
            let margin = Margin { left: 8, ..Margin::ZERO };
            (Side::right("version beside"), ui.available_width(), DETAILS_WIDTH, margin)
        };
        let most = (DETAILS_SHARE * room).max(least);
        let side = side.frame(Frame::new().inner_margin(margin)).show_separator_line(true);
        let side = side.resizable(true).default_size(first.min(most)).size_range(least..=most);
        side.show(ui, |ui| {
            ScrollArea::vertical()
                .auto_shrink([false, false])
                .show(ui, |ui| self.details(ui, view, selected, actions));
        });
    }

    /// Shows a version in place of the design, unless it is the present one.
    fn select(&mut self, view: &SessionView, id: u64, actions: &mut Actions) {
        let Some(node) = node(view, id) else { return };
        self.selected = Some(id);
        let last = node.curve.as_ref().and_then(|curve| curve.points.last());
        self.step = last.map_or(0, |point| point.step);
        let other = (id != view.version_id).then(|| Box::new((*node.lens).clone()));
        actions.push(Command::Preview(other));
    }

    /// The buttons of the selected version, its name, and how it differs from the present one.
    fn details(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        selected: &Arc<HistoryNode>,
        actions: &mut Actions,
    ) {
        let is_other = selected.id != view.version_id;
        ui.horizontal(|ui| {
            let buttons = [
                ActionButton::new("Go to", is_other, Command::GoTo(selected.id))
                    .hint("Make this version the design; what is changed then is a new branch"),
                ActionButton::new("Back", is_other, Command::Preview(None))
                    .hint("Show the present version again in all panels"),
            ];
            action_buttons(ui, buttons, actions);
            self.name_field(ui, selected, actions);
        });
        self.curve(ui, selected, actions);
        if is_other {
            comparison::table(ui, view, selected);
        } else {
            ui.weak("This is the present version.");
        }
    }

    fn name_field(&mut self, ui: &mut Ui, selected: &HistoryNode, actions: &mut Actions) {
        let id = Id::unique(("name of version", selected.id));
        let field = TextInput {
            name: "Name of the version",
            value: selected.name.as_deref().unwrap_or_default(),
            hint: "name",
            align: Align::Min,
            placement: InputPlacement::Form,
        };
        let size = vec2(140.0, ui.spacing().interact_size.y);
        let layout = Arrange::left_to_right(Align::Center);
        let entry = ui.allocate_ui_with_layout(size, layout, |ui| self.buffers.show(ui, id, field));
        if let Some(name) = entry.inner.submitted {
            self.buffers.accept(id);
            actions.push(Command::NameVersion { id: selected.id, name });
        }
    }

    /// The course of the optimization that led to the version: any step of it can be taken.
    fn curve(&mut self, ui: &mut Ui, selected: &HistoryNode, actions: &mut Actions) {
        let Some(curve) = &selected.curve else { return };
        let last = curve.points.last().map_or(0, |point| point.step);
        let version = Some(selected.id);
        ui.horizontal(|ui| {
            ui.weak("Optimization, step");
            ui.add(Slider::new(&mut self.step, 0..=last)).accessible_name("Step");
            let text = "Rewind";
            if ui.button(text).on_hover_text("Make the lens of this step the design").clicked() {
                actions.push(Command::Rewind { version, step: self.step });
            }
        });
        if let Some(step) = tree::curve_plot(ui, curve) {
            self.step = step;
            actions.push(Command::Rewind { version, step });
        }
    }
}

/// A version.
fn node(view: &SessionView, id: u64) -> Option<&Arc<HistoryNode>> {
    let place = view.history.binary_search_by_key(&id, |node| node.id).ok()?;
    view.history.get(place)
}
