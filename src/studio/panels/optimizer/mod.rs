//! The optimizer: its goal, its controls, its progress, and the choice to accept or discard
//! the result.
//!
//! The search works on its own copy. The design changes only when its result is accepted.

mod limits;
mod live_term;
mod merit_editor;
mod prices;
mod scope;
mod terms;

use egui::{
    Button, ComboBox, Context, Frame, Margin, Panel as Side, Response, RichText, Role, ScrollArea,
    Ui, WidgetInfo, vec2,
};
use egui_plot::PlotTransform;

use super::{
    Panel, RMS_OVER_FIELDS, RMS_OVER_FIELDS_HINT, add_variables_edit, mean_pupil_area,
    rms_over_fields,
};
use crate::lens::{Edit, Lens, ParameterKind};
use crate::optimize::DescentMethod;
use crate::session::{Command, MeritSample, OptimizationSnapshot, RunStatus, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::widgets::{
    ActionButton, action_buttons, fixed_plot, log_axis, main_button, plot_curve,
};
use crate::studio::text::{capitalize, status_text};
use crate::studio::text_input::EditBuffers;
use merit_editor::MeritEditor;
pub(in crate::studio) use merit_editor::term_edits;

/// The height of the merit history, in points; less if there is little room.
const HISTORY: f32 = 130.0;

const NO_VARIABLES: &str = "No number is variable: click the badge beside one in the prescription.";

/// The panel.
#[derive(Debug, Default)]
pub struct OptimizerPanel {
    method: DescentMethod,
    merit: MeritEditor,
    buffers: EditBuffers,
}

impl Panel for OptimizerPanel {
    fn title(&self) -> &'static str {
        "Optimizer"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        self.merit.sync(view);
        let goal = self.merit.goal();
        self.controls(ui, view, actions);
        if let Some(search) = view.optimization.snapshot.as_deref() {
            progress(ui, view, search);
            let frame = Frame::new().inner_margin(Margin { right: 10, ..Margin::ZERO });
            let plot = Side::bottom("merit history").frame(frame).show_separator_line(false);
            let height = (0.45 * ui.available_height()).min(HISTORY);
            plot.exact_size(height).show(ui, |ui| {
                if let Some(step) = history_plot(ui, search) {
                    actions.push(Command::Rewind { version: None, step });
                }
            });
        }
        if view.lens.variables.is_empty() {
            no_variables(ui, &view.lens, actions);
        }
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            self.merit.ui(ui, view, &mut self.buffers, actions);
            if let Some(search) = view.optimization.snapshot.as_deref() {
                prices::table(ui, &search.limits);
            }
        });
        self.merit.write_changes(&goal, actions);
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context)
    }
}

impl OptimizerPanel {
    fn controls(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let run = &view.optimization;
        let (paused, active) = (run.status == RunStatus::Paused, run.is_active());
        let has_result = run.snapshot.is_some();
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            self.start_button(ui, view, active, actions);
            let buttons = [
                if paused {
                    ActionButton::new("Resume", active, Command::Resume)
                        .hint("Resume the optimization")
                } else {
                    let hint = "Pause the optimization after its current step";
                    ActionButton::new("Pause", active, Command::Pause).hint(hint)
                },
                ActionButton::new("Step", paused, Command::Step)
                    .hint("Take one step of the paused optimization"),
                ActionButton::new("Stop", active, Command::Stop)
                    .hint("Stop the optimization and retain its result for inspection"),
                ActionButton::new("Accept", has_result, Command::AcceptResult)
                    .hint("Make the best lens the design, as one undo step"),
                ActionButton::new("Discard", has_result, Command::DiscardResult)
                    .hint("Stop the optimization and discard its result"),
            ];
            action_buttons(ui, buttons, actions);
        });
        if active {
            // What cannot be changed now leaves its room to the terms.
            ui.weak(format!("{}, {}", self.method.name(), self.merit.edge_text()));
        } else {
            self.method(ui);
            self.merit.edge_choice(ui);
        }
    }

    fn start_button(&self, ui: &mut Ui, view: &SessionView, active: bool, actions: &mut Actions) {
        let ready = !active && !view.lens.variables.is_empty();
        let hint = "Optimize in the background, on a copy of the design";
        let reason = if active { "An optimization is already running" } else { NO_VARIABLES };
        if main_button(ui, "Optimize", ready, hint, reason) {
            let goal = self.merit.goal();
            actions.push(Command::Optimize { method: self.method, goal, glasses: None });
        }
    }

    fn method(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.weak("Method");
            method_menu(ui, &mut self.method);
        });
    }
}

/// Says that nothing is variable, with a button for what is varied first.
fn no_variables(ui: &mut Ui, lens: &Lens, actions: &mut Actions) {
    ui.colored_label(ui.visuals().warn_fg_color, NO_VARIABLES);
    let edit = add_variables_edit(lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let button = Button::new("Vary all radii and thicknesses");
    if ui.add_enabled(edit != Edit::SetVariables(Vec::new()), button).clicked() {
        actions.push(edit);
    }
}

pub(super) fn method_menu(ui: &mut Ui, chosen: &mut DescentMethod) {
    let combo = ComboBox::from_id_salt("method").selected_text(chosen.name()).width(160.0);
    let combo = combo.show_ui(ui, |ui| {
        for method in DescentMethod::ALL {
            ui.selectable_value(chosen, method, method.name());
        }
    });
    named_list(ui, combo, "Method");
}

/// The status of the optimization, and spot, focal length and light before and after it.
fn progress(ui: &mut Ui, view: &SessionView, search: &OptimizationSnapshot) {
    let status = status_text(view.optimization.status);
    let step = search.progress.as_ref().map_or(0, |progress| progress.step);
    ui.horizontal_wrapped(|ui| {
        ui.strong(status);
        ui.label(format!("after step {step}"));
        if let (Some(first), Some(last)) = (search.history.first(), search.progress.as_ref()) {
            ui.separator();
            let [first, best] = [first.current, last.best].map(|v| number::format_digits(v, 4));
            ui.label(format!("merit {first} to {best}"));
        }
    });
    if let Some(end) = search.progress.as_ref().and_then(|progress| progress.end) {
        ui.weak(format!("Ended: {}.", end.text()));
    }
    let changes = changes_text(view);
    if !changes.is_empty() {
        ui.label(changes.join(", ")).on_hover_text(format!(
            "Focal length, mean area of the pupils and sharpness, of the design and of the optimized \
             lens. {RMS_OVER_FIELDS_HINT}"
        ));
    }
    let refused = search.progress.as_ref().and_then(|progress| progress.refused.as_ref());
    if let Some(why) = refused {
        let text = RichText::new(capitalize(why)).small();
        ui.label(text.color(ui.visuals().warn_fg_color))
            .on_hover_text("Steps that would make the lens invalid are rejected and shortened");
    }
}

/// Spots and focal length of the design and of the lens that the search shows.
pub(super) fn changes_text(view: &SessionView) -> Vec<String> {
    let short = |value: f64| number::format_digits(value, 4);
    let mut texts = Vec::new();
    let before = view.results.as_ref().and_then(|results| results.analyses.as_ref().ok());
    let after = view.preview_results.as_ref().and_then(|results| results.analyses.as_ref().ok());
    let (Some(before), Some(after)) = (before, after) else { return texts };
    if let (Some(old), Some(new)) = (rms_over_fields(before), rms_over_fields(after)) {
        texts.push(format!("{RMS_OVER_FIELDS} {} to {} µm", short(1e3 * old), short(1e3 * new)));
    }
    if let (Some(old), Some(new)) = (before.first_order().efl, after.first_order().efl) {
        texts.push(format!("f {} to {} mm", short(old), short(new)));
    }
    // A search that does not ask for light may buy sharpness with it: it is told beside the spots.
    let (old, new) = (mean_pupil_area(before), mean_pupil_area(after));
    if old > 0.0 {
        let change = number::short_change(old, new).unwrap_or_default();
        texts.push(format!("light {} to {} mm² ({change})", short(old), short(new)));
    }
    texts
}

/// Plots the merit of the current and of the best lens, decades up and steps across; the step that
/// was clicked, if one was.
fn history_plot(ui: &mut Ui, search: &OptimizationSnapshot) -> Option<usize> {
    let decade = |value: f64| if value > 0.0 { value.log10() } else { f64::NAN };
    let of_history = |name: &str, merit: fn(&MeritSample) -> f64| {
        let points = search.history.iter().map(|point| [point.step as f64, decade(merit(point))]);
        plot_curve(name, points.filter(|[_, y]| y.is_finite()))
    };
    let current = of_history("current", |point| point.current);
    let best = of_history("best", |point| point.best);
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.hyperlink_color);
    let plot = log_axis(fixed_plot(ui, "merit history", ui.available_height()), "merit")
        .x_axis_label("step")
        .set_margin_fraction(vec2(0.01, 0.08));
    let shown = plot.show(ui, |plot| {
        plot.line(current.color(weak).width(1.0));
        plot.line(best.color(strong).width(2.0));
    });
    let text = "Merit against steps";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, text));
    let hint = "Click a place to make the lens of that step the design";
    clicked_step(&shown.response.clone().on_hover_text(hint), &shown.transform)
}

/// The step of a merit curve that was clicked.
pub(super) fn clicked_step(response: &Response, transform: &PlotTransform) -> Option<usize> {
    let place = response.clicked().then(|| response.interact_pointer_pos()).flatten()?;
    let step = transform.value_from_position(place).x.round().max(0.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a step, 0 or more"
    )]
    Some(step as usize)
}
