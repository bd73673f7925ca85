//! The settings of a sweep: the number of weights, the steps of each, the range of blur.

use std::ops::RangeInclusive;

use egui::{DragValue, Ui};

use crate::optimize::pareto::ParetoSettings;
use crate::session::{Command, SessionView};
use crate::studio::panels::design_results;
use crate::studio::panels::optimizer::method_menu;

/// The settings of the panel.
#[derive(Debug, Default)]
pub(super) struct ParetoSetup {
    settings: ParetoSettings,
    compare: bool,
}

impl ParetoSetup {
    /// The command that starts a sweep.
    pub(super) fn command(&self) -> Command {
        Command::StartPareto { settings: self.settings.clone(), compare: self.compare }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, view: &SessionView) {
        let ParetoSettings { points, steps, blur, method, .. } = &mut self.settings;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            count(ui, "points", points, 1..=200, "Number of weights between sharpness and light");
            count(ui, "steps each", steps, 1..=100_000, "Maximum steps for each weight");
            method_menu(ui, method);
        });
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.weak("Rim blur").on_hover_text(BLUR);
            blurs(ui, blur, focal_length(view));
            ui.add_space(6.0);
            ui.checkbox(&mut self.compare, "Compare with fixed rays").on_hover_text(COMPARE);
        });
    }
}

const BLUR: &str = "The transverse error of a ray at the rim of the pupil at which light and \
    sharpness are worth the same: the root of the weight. A small blur gives sharp lenses, a \
    large one bright lenses.";
const COMPARE: &str = "Repeats the sweep with derivatives at fixed rays, as most programs compute \
    them: they ignore how the semi-diameters change the light. Its front is drawn in grey.";

fn count(ui: &mut Ui, name: &str, value: &mut usize, range: RangeInclusive<usize>, hint: &str) {
    let drag = DragValue::new(value).range(range).speed(0.5);
    ui.add(drag).on_hover_text(hint).accessible_name(name);
    ui.weak(name);
}

/// The smallest and the largest blur, in µm of this focal length in mm.
fn blurs(ui: &mut Ui, [low, high]: &mut [f64; 2], focal_length: f64) {
    let um = 1e3 * focal_length;
    blur(ui, "Smallest blur", low, um, 1e-6..=*high);
    ui.weak("to");
    blur(ui, "Largest blur", high, um, *low..=0.1);
}

fn blur(ui: &mut Ui, name: &str, share: &mut f64, um: f64, range: RangeInclusive<f64>) {
    let mut value = *share * um;
    let range = range.start() * um..=range.end() * um;
    let drag = DragValue::new(&mut value).range(range).speed(0.01 * *share * um);
    let drag = ui.add(drag.max_decimals(1).suffix(" µm")).on_hover_text(BLUR);
    if drag.accessible_name(name).changed() {
        *share = value / um;
    }
}

/// The focal length in mm; for a lens without one its length, as the sweep takes it.
fn focal_length(view: &SessionView) -> f64 {
    let efl = design_results(view).and_then(|numbers| numbers.first_order().efl).map(f64::abs);
    let length = || view.lens.total_track();
    efl.filter(|efl| efl.is_finite() && *efl > 0.0).unwrap_or_else(length)
}
