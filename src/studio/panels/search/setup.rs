//! The settings of a search: the method, the structure, the goal, the end.

use std::ops::RangeInclusive;

use egui::emath::Numeric;
use egui::{ComboBox, DragValue, Grid, Label, RichText, Ui};

use super::{limits, moves};
use crate::lens::{Lens, Medium};
use crate::search::element::piece_count;
use crate::search::lens_landscape::SearchPlan;
use crate::search::{MutationKind, SearchMethod, SearchRules, SearchSettings};
use crate::session::{SessionView, StructureSearchRequest};
use crate::studio::form::named_list;
use crate::studio::text::counted;

/// The settings of the panel.
#[derive(Debug)]
pub(super) struct SearchSetup {
    request: StructureSearchRequest,
    /// True once the user has changed the number of elements.
    element_count_edited: bool,
    /// True if new elements are made of the glasses of the design.
    design_glasses_only: bool,
    /// The gradients that brute force divides among its mutations.
    brute_force_gradients: u64,
    /// The values of inactive limits.
    disabled: DisabledValues,
}

/// Values that reappear when an inactive limit is switched on.
#[derive(Debug)]
struct DisabledValues {
    minutes: f64,
    moves: u64,
    open: f64,
    focal_length: f64,
}

impl Default for SearchSetup {
    fn default() -> Self {
        let disabled =
            DisabledValues { minutes: 10.0, moves: 1000, open: 30.0, focal_length: 50.0 };
        let mut request = StructureSearchRequest::default();
        request.plan.settings = SearchSettings { gradients: None, ..request.plan.settings };
        Self {
            request,
            element_count_edited: false,
            design_glasses_only: false,
            brute_force_gradients: 10_000,
            disabled,
        }
    }
}

const METHODS: [(SearchMethod, &str, &str); 4] = [
    (
        SearchMethod::IteratedLocalSearch,
        "Iterated local search",
        "Several mutants of the best lenses descend for a short while; the best of them goes on, and is \
         kept if it overtakes",
    ),
    (
        SearchMethod::Restore,
        "RESTORE",
        "Descents of random length, each started from a mutation of a retained lens",
    ),
    (
        SearchMethod::Metropolis,
        "Metropolis-Hastings",
        "Noisy gradient steps and reversible mutations, each accepted or rejected",
    ),
    (
        SearchMethod::BruteForce,
        "Brute force",
        "Every insertion and removal of one element, each optimized with the same budget",
    ),
];

impl SearchSetup {
    /// The request for a search from the present design.
    pub(super) fn request(&self, view: &SessionView) -> StructureSearchRequest {
        let mut request = self.request.clone();
        request.plan.light = limits::matching_fields(request.plan.light, &view.lens);
        if self.design_glasses_only {
            request.plan.rules.glasses = glasses(&view.lens);
        }
        if request.plan.settings.method == SearchMethod::BruteForce {
            request.plan.settings.gradients = Some(self.brute_force_gradients);
        }
        request
    }

    /// The plan of the next search.
    pub(super) const fn plan(&mut self) -> &mut SearchPlan {
        &mut self.request.plan
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, view: &SessionView) {
        variables_choice(ui, &view.lens, &mut self.request.free);
        Grid::new("search setup").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
            self.method_rows(ui);
            self.structure_rows(ui, view);
            self.merit_rows(ui, &view.lens);
            self.limit_rows(ui);
        });
        limits::limits_section(ui, &mut self.request.plan.rules);
        if self.request.plan.settings.method != SearchMethod::BruteForce {
            self.weights_section(ui);
        }
        limits::descents_section(ui, &mut self.request.plan);
    }

    fn method_rows(&mut self, ui: &mut Ui) {
        let settings = &mut self.request.plan.settings;
        ui.weak("Method");
        let name = METHODS.iter().find(|(method, ..)| *method == settings.method);
        let combo = ComboBox::from_id_salt("search method").width(150.0);
        let combo = combo.selected_text(name.map_or("", |(_, name, _)| name)).show_ui(ui, |ui| {
            for (method, name, hint) in METHODS {
                ui.selectable_value(&mut settings.method, method, name).on_hover_text(hint);
            }
        });
        named_list(ui, combo, "Search method");
        ui.end_row();
        ui.weak("Sampling");
        ui.horizontal(|ui| {
            drag(
                ui,
                "Seed",
                &mut settings.seed,
                0..=u64::MAX,
                0.1,
                "The same seed gives the same search",
            );
            ui.weak("seed,");
            if settings.method == SearchMethod::IteratedLocalSearch {
                let hint =
                    "Mutants that descend for a short while in each round; the best one goes on";
                drag(ui, "Trials", &mut settings.trials, 1..=64, 0.05, hint);
                ui.weak("trials");
            } else {
                let hint = "The number of parallel chains";
                drag(ui, "Chains", &mut settings.chains, 1..=64, 0.05, hint);
                ui.weak("chains");
            }
        });
        ui.end_row();
    }

    fn structure_rows(&mut self, ui: &mut Ui, view: &SessionView) {
        let rules = &mut self.request.plan.rules;
        if !self.element_count_edited {
            rules.elements =
                SearchRules::default().admit_element_count(piece_count(&view.lens)).elements;
        }
        ui.weak("Elements").on_hover_text("The number of elements that a lens may have");
        ui.horizontal(|ui| {
            let [min, max] = &mut rules.elements;
            let fewest =
                drag(ui, "Fewest elements", min, 1..=*max, 0.05, "Minimum number of elements");
            ui.weak("to");
            let most =
                drag(ui, "Most elements", max, *min..=40, 0.05, "Maximum number of elements");
            self.element_count_edited |= fewest || most;
            ui.weak(format!("({} now)", piece_count(&view.lens)));
        });
        ui.end_row();
        ui.weak("Aspheres");
        let hint = "The largest number of aspheric surfaces, each of which counts as half an element; 0: none is tried";
        drag(ui, "Aspheric surfaces at most", &mut rules.aspheres, 0..=40, 0.05, hint);
        ui.end_row();
        ui.weak("Fixed ends").on_hover_text("Surfaces that mutations do not change");
        fixed_ends(ui, &mut rules.fixed_ends, view.lens.surfaces.len());
        ui.end_row();
        ui.weak("New glass");
        ui.horizontal(|ui| {
            let hint = "New elements use any glass of the catalogue";
            ui.radio_value(&mut self.design_glasses_only, false, "of the catalogue")
                .on_hover_text(hint);
            let hint = "New elements use only the glasses of the design";
            ui.radio_value(&mut self.design_glasses_only, true, "of this lens").on_hover_text(hint);
        });
        ui.end_row();
        ui.weak("Mutations");
        ui.checkbox(&mut rules.projection, "Paraxial projection").on_hover_text(
            "After a mutation the rest of the lens moves as little as possible so that it \
             focuses as before: far more mutations survive",
        );
        ui.end_row();
    }

    fn merit_rows(&mut self, ui: &mut Ui, lens: &Lens) {
        let request = &mut self.request;
        ui.weak("Light");
        limits::shares(ui, &mut request.plan.light, lens);
        ui.end_row();
        ui.weak("Focal length");
        let hint = "The target, if it is not the focal length of the design";
        let disabled = &mut self.disabled;
        optional(
            ui,
            "Another focal length",
            &mut request.plan.focal_length,
            &mut disabled.focal_length,
            hint,
            |ui, value| {
                length(ui, "Focal length of the search", value, -10_000.0..=10_000.0);
            },
        );
        ui.end_row();
        ui.weak("Semi-diameters");
        let hint = "Remove the stop and open every semi-diameter as far as the neighbouring \
            surfaces and this value allow: the search then decides what limits the beam";
        optional(
            ui,
            "Open them up to",
            &mut request.open,
            &mut disabled.open,
            hint,
            |ui, value| {
                length(ui, "Largest semi-diameter at the start", value, 0.1..=10_000.0);
            },
        );
        ui.end_row();
    }

    fn limit_rows(&mut self, ui: &mut Ui) {
        let Self { request, disabled, brute_force_gradients: gradients, .. } = self;
        if request.plan.settings.method == SearchMethod::BruteForce {
            ui.weak("Gradients");
            let hint = "The budget that is divided among all mutations";
            drag(ui, "Gradients of brute force", gradients, 1..=u64::MAX, 100.0, hint);
            ui.end_row();
        }
        ui.weak("Ends after");
        let hint = "The time limit of the search";
        optional(ui, "minutes", &mut request.minutes, &mut disabled.minutes, hint, |ui, value| {
            drag(ui, "Minutes of the search", value, 0.1..=100_000.0, 0.1, hint);
        });
        ui.end_row();
        ui.label("");
        let hint = "The limit of moves of all chains together";
        optional(
            ui,
            "moves",
            &mut request.plan.settings.moves,
            &mut disabled.moves,
            hint,
            |ui, value| {
                drag(ui, "Moves of the search", value, 1..=u64::MAX, 10.0, hint);
            },
        );
        ui.end_row();
    }

    fn weights_section(&mut self, ui: &mut Ui) {
        let weights = &mut self.request.plan.rules.weights;
        ui.collapsing("Weights of the mutations", |ui| {
            Grid::new("weights").num_columns(4).spacing([8.0, 3.0]).show(ui, |ui| {
                for (i, kind) in MutationKind::PERTURBATIONS.into_iter().enumerate() {
                    weight_field(ui, weights, kind);
                    (i % 2 == 1).then(|| ui.end_row());
                }
            });
        });
    }
}

/// The weight of a kind of mutation.
fn weight_field(ui: &mut Ui, weights: &mut Vec<(MutationKind, f64)>, kind: MutationKind) {
    ui.horizontal(|ui| {
        moves::symbol(ui, kind);
        ui.label(kind.name());
    });
    let listed = weights.iter().find(|(other, _)| *other == kind);
    let mut weight = listed.map_or(1.0, |(_, weight)| *weight);
    let name = format!("Weight of {} at the start", kind.name());
    if drag(ui, &name, &mut weight, 0.0..=100.0, 0.02, "0 excludes it") {
        weights.retain(|(other, _)| *other != kind);
        weights.push((kind, weight));
    }
}

/// The choice of the variables, and a summary of what is varied.
fn variables_choice(ui: &mut Ui, lens: &Lens, free: &mut bool) {
    let count = lens.variables.len();
    if count > 0 {
        ui.checkbox(free, "Vary all curvatures and gaps").on_hover_text(
            "Includes numbers that are not variables of the design; bounds of variables are \
             ignored",
        );
    }
    let text = if count == 0 || *free {
        "Variables: structure, curvatures, gaps and semi-diameters, within the manufacturing \
         limits below."
            .to_owned()
    } else {
        format!(
            "Variables: structure, semi-diameters, the {} of the design and all new elements; \
             other curvatures and gaps are fixed.",
            counted(count as u64, "variable")
        )
    };
    ui.add(Label::new(RichText::new(text).small().weak()).wrap());
    if lens.zoom_positions() > 1 {
        let text = "A zoom lens: moving gaps are never merged, so some mutations do not apply.";
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
}

/// The names of the glasses of a lens, each once.
fn glasses(lens: &Lens) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for row in &lens.surfaces {
        if let Medium::Glass(name) = &row.medium
            && !names.contains(name)
        {
            names.push(name.clone());
        }
    }
    names
}

/// The number of surfaces at both ends that mutations do not change.
fn fixed_ends(ui: &mut Ui, [front, rear]: &mut [usize; 2], count: usize) {
    ui.horizontal(|ui| {
        let hint = "The number of surfaces at this end that mutations do not change";
        drag(ui, "Fixed surfaces at the front", front, 0..=count, 0.05, hint);
        ui.weak("surfaces at the front,");
        drag(ui, "Fixed surfaces at the rear", rear, 0..=count, 0.05, hint);
        ui.weak("at the rear");
    });
}

/// A number that belongs to the panel itself; whether it was changed.
pub(super) fn drag<T: Numeric>(
    ui: &mut Ui,
    name: &str,
    value: &mut T,
    range: RangeInclusive<T>,
    speed: f64,
    hint: &str,
) -> bool {
    let drag = ui.add(DragValue::new(value).range(range).speed(speed));
    drag.on_hover_text(hint).accessible_name(name).changed()
}

/// A length in mm.
pub(super) fn length(ui: &mut Ui, name: &str, value: &mut f64, range: RangeInclusive<f64>) {
    let speed = 0.01 * value.abs().max(0.1);
    let drag = DragValue::new(value).range(range).speed(speed).max_decimals(3).suffix(" mm");
    ui.add(drag).accessible_name(name);
}

/// A value that need not be there: a check box, and a field beside it.
pub(super) fn optional<T: Copy>(
    ui: &mut Ui,
    name: &str,
    value: &mut Option<T>,
    disabled: &mut T,
    hint: &str,
    field: impl FnOnce(&mut Ui, &mut T),
) {
    ui.horizontal(|ui| {
        let mut there = value.is_some();
        if ui.checkbox(&mut there, name).on_hover_text(hint).changed() {
            if let Some(value) = *value {
                *disabled = value;
            }
            *value = there.then_some(*disabled);
        }
        if let Some(value) = value {
            field(ui, value);
        }
    });
}
