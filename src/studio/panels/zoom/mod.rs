//! The zoom positions: a table of what differs from one to another, and a way through them.

mod rows;

use egui::{Button, Context, DragValue, Grid, ScrollArea, Ui};
use std::time::Duration;

use super::edit_form::EditForm;
use super::{Panel, zoom_name};
use crate::lens::{Edit, Lens, ZoomPosition};
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::text_input::EditBuffers;

/// The shortest and the longest time for which a position is shown, in seconds.
const PACE: std::ops::RangeInclusive<f64> = 0.1..=5.0;

/// The panel.
#[derive(Debug)]
pub struct ZoomPanel {
    buffers: EditBuffers,
    playing: bool,
    /// The time for which each position is shown, in seconds.
    pace: f64,
    /// The time of the window at which the last position was shown.
    turned: f64,
}

impl Default for ZoomPanel {
    fn default() -> Self {
        Self { buffers: EditBuffers::default(), playing: false, pace: 0.8, turned: 0.0 }
    }
}

impl Panel for ZoomPanel {
    fn title(&self) -> &'static str {
        "Zoom positions"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        self.toolbar(ui, view, actions);
        if view.lens.zoom.is_empty() {
            ui.add_space(6.0);
            ui.label("This lens has one fixed state.");
            ui.weak(
                "Add a position to make it a zoom lens, or to design it for several object \
                 distances or apertures at once. Then choose what varies between the positions.",
            );
            return;
        }
        self.play(ui, view, actions);
        let mut form = EditForm { view, buffers: &mut self.buffers, actions };
        form.error_line(ui);
        ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
            let grid = Grid::new("zoom").num_columns(view.lens.zoom.len() + 2).striped(true);
            grid.spacing([10.0, 4.0]).show(ui, |ui| rows::ui(ui, &mut form));
        });
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context)
    }
}

impl ZoomPanel {
    fn toolbar(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let lens = &view.lens;
        let (count, shown) = (lens.zoom.len(), view.settings.zoom);
        ui.horizontal(|ui| {
            let add = ui.button("Add position");
            if add.on_hover_text("A copy of the position that is shown, behind it").clicked() {
                let at = if count == 0 { 0 } else { shown + 1 };
                actions.push(Edit::InsertZoom { at, position: copy_of(lens, shown) });
            }
            let delete = ui.add_enabled(count > 0, Button::new("Delete position"));
            if delete.on_hover_text("Delete the position that is shown").clicked() {
                actions.push(Edit::RemoveZoom(shown));
            }
            if count == 0 {
                return;
            }
            rows::vary_menu(ui, lens, actions);
            ui.separator();
            let text = if self.playing { "Stop" } else { "Play" };
            let play = ui.add_enabled(count > 1, Button::new(text));
            if play.on_hover_text("Show one position after the other").clicked() {
                self.playing = !self.playing;
                self.turned = ui.input(|input| input.time);
            }
            let pace = DragValue::new(&mut self.pace).range(PACE).speed(0.02).suffix(" s each");
            ui.add(pace).accessible_name("Seconds for each position");
        });
    }

    /// Shows the next position once its time has come.
    fn play(&mut self, ui: &Ui, view: &SessionView, actions: &mut Actions) {
        let count = view.lens.zoom.len();
        self.playing &= count > 1;
        if !self.playing {
            return;
        }
        let now = ui.input(|input| input.time);
        if now - self.turned >= self.pace {
            self.turned = now;
            actions.push(Command::ShowZoom((view.settings.zoom + 1) % count));
        }
        let left = (self.pace - (now - self.turned)).max(0.0);
        ui.ctx().request_repaint_after(Duration::from_secs_f64(left));
    }
}

/// A position like one of a lens, with a name of its own.
fn copy_of(lens: &Lens, zoom: usize) -> ZoomPosition {
    let position = lens.zoom.get(zoom).cloned().unwrap_or_default();
    let name = match position.name.as_str() {
        "" => String::new(),
        _ => format!("{} copy", zoom_name(lens, zoom)),
    };
    ZoomPosition { name, ..position }
}
