//! The controls of a field: open, save and close, its optimization, and the slice.

use egui::{
    Align, Button, ComboBox, DragValue, Label, Layout as Arrange, RichText, ScrollArea, Slider, Ui,
};

use super::picture::SlicePicture;
use super::text;
use crate::grin_design::{BUILTIN_TASKS, FieldRepresentation, SlicePlane, SpatialAxis};
use crate::session::{
    GrinCommand, GrinRun, MAX_NODES, RunStatus, SessionView, SliceQuantity, SliceSettings,
};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::form::named_list;
use crate::studio::panels::widgets::{ActionButton, action_buttons, main_button, progress_bar};

/// Nodes along a side of a written volume, where the field is a spline, unless it is changed.
pub(in crate::studio) const DEFAULT_NODES: usize = 65;

/// The tasks that come with the program, and how volumes are written.
#[derive(Debug)]
pub(super) struct TaskMenu {
    builtin: Vec<BuiltinEntry>,
    nodes: usize,
}

/// A task that comes with the program.
#[derive(Debug)]
struct BuiltinEntry {
    key: &'static str,
    title: String,
    notes: String,
}

impl TaskMenu {
    pub(super) fn new() -> Self {
        let known = BUILTIN_TASKS.iter().filter_map(|builtin| {
            let task = builtin.task().ok()?;
            Some(BuiltinEntry { key: builtin.name, title: task.name, notes: task.notes })
        });
        Self { builtin: known.collect(), nodes: DEFAULT_NODES }
    }

    /// The list of all tasks, where nothing is open.
    pub(super) fn list(&self, ui: &mut Ui, what: &str, actions: &mut Actions) {
        ui.label(what);
        ui.add_space(6.0);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            for BuiltinEntry { key, title, notes } in &self.builtin {
                if ui.add(Button::new(title).min_size([280.0, 0.0].into())).clicked() {
                    actions.push(GrinCommand::OpenBuiltin((*key).to_owned()));
                }
                ui.add(Label::new(RichText::new(notes).small().weak()).wrap());
                ui.add_space(3.0);
            }
        });
    }

    /// The buttons.
    pub(super) fn bar(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            self.open(ui, view, actions);
            let Some(run) = view.grin.run.snapshot.as_deref() else { return };
            if run.document.task.is_some() {
                run_controls(ui, view, run, actions);
            }
            self.save(ui, run, actions);
            if ui.button("Close").on_hover_text("Close; unsaved changes are lost").clicked() {
                actions.push(GrinCommand::Close);
            }
            document_name(ui, run);
        });
    }

    fn open(&self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        ui.add_enabled_ui(!view.grin.opening, |ui| {
            ui.menu_button("Open task", |ui| self.menu(ui, actions));
            let hint = "Open a task (.json), a volume of NumPy (.npz), or one of raw numbers with \
                a header (.json)";
            if ui.button("Open file…").on_hover_text(hint).clicked() {
                actions.push(FileRequest::OpenField);
            }
        });
    }

    fn menu(&self, ui: &mut Ui, actions: &mut Actions) {
        ui.set_min_width(250.0);
        for BuiltinEntry { key, title, notes } in &self.builtin {
            if ui.button(title).on_hover_text(notes).clicked() {
                actions.push(GrinCommand::OpenBuiltin((*key).to_owned()));
                ui.close();
            }
        }
    }

    fn save(&mut self, ui: &mut Ui, run: &GrinRun, actions: &mut Actions) {
        let hint = "Write the best field as a volume for a printer: .npz for Python, or .json with \
            the numbers beside it in .raw";
        if ui.button("Save volume…").on_hover_text(hint).clicked() {
            actions.push(FileRequest::SaveField(self.nodes));
        }
        let kind = run.document.task.as_ref().map(|task| task.field);
        if matches!(
            kind,
            Some(FieldRepresentation::Sphere { .. } | FieldRepresentation::Cylinder { .. })
        ) {
            let drag = DragValue::new(&mut self.nodes).range(2..=MAX_NODES).suffix("³ nodes");
            ui.add(drag.speed(0.3))
                .on_hover_text("Nodes along a side of the saved volume")
                .accessible_name("Nodes of the saved volume");
        }
    }
}

/// The name of the open document, in the room that is left.
fn document_name(ui: &mut Ui, run: &GrinRun) {
    let name = &run.document.name;
    let notes = run.document.task.as_ref().map_or("", |task| task.notes.as_str());
    let label = ui.add(Label::new(RichText::new(name).strong()).truncate());
    label.on_hover_text(if notes.is_empty() { name } else { notes });
}

/// Starts, pauses and stops the optimization.
fn run_controls(ui: &mut Ui, view: &SessionView, run: &GrinRun, actions: &mut Actions) {
    let (text, hint) = if view.grin.run.is_active() {
        ("Optimize", "Optimize the field in the background; the slice shows its progress")
    } else {
        ("Start over", "Optimize again from the start; unsaved changes of this field are lost")
    };
    let ready = run.is_ready() || !view.grin.run.is_active();
    let ready = ready && view.grin.run.status != RunStatus::Starting && !view.grin.opening;
    if main_button(ui, text, ready, hint, "The optimization is already running") {
        actions.push(GrinCommand::Start);
    }
    let active = view.grin.run.is_active() && !run.is_ready();
    let buttons = [
        if view.grin.run.status == RunStatus::Paused && !run.is_ready() {
            ActionButton::new("Resume", active, GrinCommand::Resume).hint("Resume the optimization")
        } else {
            let hint = "Pause the optimization after its current step";
            ActionButton::new("Pause", active, GrinCommand::Pause).hint(hint)
        },
        ActionButton::new("Stop", active, GrinCommand::Stop)
            .hint("Stop the optimization and show its best field"),
    ];
    action_buttons(ui, buttons, actions);
}

/// The progress of the optimization.
pub(super) fn progress(ui: &mut Ui, view: &SessionView, run: &GrinRun) {
    let text = text::status_text(run, view.grin.run.status);
    match &run.progress {
        Some(progress) => {
            let share = if progress.finished {
                1.0
            } else {
                progress.step as f32 / progress.max_steps.max(1) as f32
            };
            let bar = progress_bar(ui, share, text).desired_height(16.0);
            ui.add(bar.corner_radius(2));
        }
        None => {
            ui.add(Label::new(RichText::new(text).weak()).truncate());
        }
    }
}

/// The plane of the slice, its quantity, and the number of rays.
pub(super) fn slice_controls(
    ui: &mut Ui,
    view: &SessionView,
    run: &GrinRun,
    picture: &mut SlicePicture,
    actions: &mut Actions,
) {
    let old = view.grin.slice_settings;
    let mut settings = old;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        plane_choice(ui, run, &mut settings);
        quantity_choice(ui, run, &mut settings);
        if run.document.task.is_some() {
            let drag = DragValue::new(&mut settings.rays).range(0..=60).speed(0.1).suffix(" rays");
            ui.add(drag)
                .on_hover_text(
                    "Rays of each view in the drawing: those nearest to the slice, projected onto \
                     it",
                )
                .accessible_name("Rays of each view in the slice");
        }
        ui.with_layout(Arrange::right_to_left(Align::Center), |ui| {
            if ui.button("Fit").on_hover_text("Show the whole slice (double click)").clicked() {
                picture.fit();
            }
        });
    });
    if settings != old {
        actions.push(GrinCommand::SetSlice(settings));
    }
}

fn plane_choice(ui: &mut Ui, run: &GrinRun, settings: &mut SliceSettings) {
    ui.weak("Slice across");
    for axis in SpatialAxis::ALL {
        let [right, up] = axis.across();
        let hint =
            format!("Across {}: {} points right, {} up", axis.name(), right.name(), up.name());
        let button = Button::selectable(settings.plane.axis == axis, axis.name());
        let button = ui.add(button).on_hover_text(hint);
        if button.clicked() && settings.plane.axis != axis {
            settings.plane = SlicePlane { axis, depth: run.document.middle(axis) };
        }
    }
    let [low, high] = run.document.depth_range(settings.plane.axis);
    ui.spacing_mut().slider_width = 120.0;
    let name = format!("{} =", settings.plane.axis.name());
    ui.weak(name);
    let slider = Slider::new(&mut settings.plane.depth, low..=high).suffix(" mm");
    let slider = ui.add(slider.step_by((high - low) / 200.0).max_decimals(4));
    slider.on_hover_text("Position of the slice").accessible_name("Depth of the slice");
}

fn quantity_choice(ui: &mut Ui, run: &GrinRun, settings: &mut SliceSettings) {
    let combo = ComboBox::from_id_salt("quantity of the slice").width(180.0);
    let combo = combo.selected_text(settings.quantity.name()).show_ui(ui, |ui| {
        for quantity in SliceQuantity::ALL.into_iter().filter(|of| run.document.supports(*of)) {
            ui.selectable_value(&mut settings.quantity, quantity, quantity.name());
        }
    });
    named_list(ui, combo, "Quantity of the slice").on_hover_text("Quantity of the colours");
}
