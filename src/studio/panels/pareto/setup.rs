//! The settings of a sweep: levels of light or weights, their number and range, the steps of each.

use std::ops::RangeInclusive;

use egui::{ComboBox, DragValue, Ui};

use crate::optimize::pareto::{ParetoSettings, Scalarization};
use crate::session::{Command, SessionView};
use crate::studio::form::named_list;
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
        let before = self.settings.scalarization;
        let ParetoSettings { points, steps, blur, light, method, scalarization, .. } =
            &mut self.settings;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            scalarization_menu(ui, scalarization);
            count(ui, "points", points, 1..=200, "Number of levels of light, or of weights");
            count(ui, "steps each", steps, 1..=100_000, "Maximum steps for each of them");
            if *scalarization == Scalarization::WeightedSum {
                method_menu(ui, method);
            }
        });
        if *scalarization != before {
            *steps = default_steps(*scalarization);
        }
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            match scalarization {
                Scalarization::EpsilonConstraint => lights(ui, light),
                Scalarization::WeightedSum => {
                    ui.weak("Rim blur").on_hover_text(BLUR);
                    blurs(ui, blur, focal_length(view));
                }
            }
            ui.add_space(6.0);
            ui.checkbox(&mut self.compare, "Compare with fixed rays").on_hover_text(COMPARE);
        });
    }
}

const LIGHT: &str = "For levels of light between these, in per cent of that of the lens, the sharpest \
    lens is found that has at least as much.";
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

fn scalarization_menu(ui: &mut Ui, chosen: &mut Scalarization) {
    let name = |scalarization: Scalarization| match scalarization {
        Scalarization::EpsilonConstraint => "Levels of light",
        Scalarization::WeightedSum => "Weighted sums",
    };
    let combo = ComboBox::from_id_salt("scalarization").selected_text(name(*chosen));
    let combo = combo.show_ui(ui, |ui| {
        for each in [Scalarization::EpsilonConstraint, Scalarization::WeightedSum] {
            ui.selectable_value(chosen, each, name(each));
        }
    });
    named_list(ui, combo, "Scalarization").on_hover_text(SCALARIZATION);
}

const SCALARIZATION: &str = "Levels of light: the sharpest lens with at least so much light, which \
    spans the range that is asked for. Weighted sums: the least sum of spot and weighted light.";

fn default_steps(scalarization: Scalarization) -> usize {
    match scalarization {
        Scalarization::EpsilonConstraint => ParetoSettings::default().steps,
        Scalarization::WeightedSum => ParetoSettings::weighted_sum().steps,
    }
}

/// The least and the most light that is asked for, in per cent of that of the lens.
fn lights(ui: &mut Ui, [low, high]: &mut [f64; 2]) {
    ui.weak("Light").on_hover_text(LIGHT);
    percent(ui, "Least light", low, 0.01..=*high);
    ui.weak("to");
    percent(ui, "Most light", high, *low..=100.0);
}

fn percent(ui: &mut Ui, name: &str, share: &mut f64, range: RangeInclusive<f64>) {
    let mut value = 100.0 * *share;
    let drag = DragValue::new(&mut value).range(100.0 * range.start()..=100.0 * range.end());
    let drag = ui.add(drag.max_decimals(1).suffix(" %")).on_hover_text(LIGHT);
    if drag.accessible_name(name).changed() {
        *share = value / 100.0;
    }
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
