//! What a search is asked for: the sampler, what may become of the lens, how long.

use std::ops::RangeInclusive;

use eframe::egui::emath::Numeric;
use eframe::egui::{ComboBox, DragValue, Grid, Label, RichText, Ui};

use super::{light, limits, marks};
use crate::lens::{Lens, Medium};
use crate::search::element::pieces;
use crate::search::{Kind, Method, Rules, Settings};
use crate::session::{Quest, View};

/// The settings that a person sees.
#[derive(Debug)]
pub(super) struct Setup {
    quest: Quest,
    /// Whether a person has said how many elements there may be.
    counted: bool,
    /// Whether new glass is one of those that the design is made of.
    own_glasses: bool,
    /// The gradients that brute force divides among its mutations.
    gradients: u64,
    /// What stands in a field that is switched off.
    asleep: Asleep,
}

/// Values of limits that do not count at the moment.
#[derive(Debug)]
struct Asleep {
    minutes: f64,
    moves: u64,
    open: f64,
    focal_length: f64,
}

impl Default for Setup {
    fn default() -> Self {
        let asleep = Asleep { minutes: 10.0, moves: 1000, open: 30.0, focal_length: 50.0 };
        let mut quest = Quest::default();
        quest.plan.settings = Settings { gradients: None, ..quest.plan.settings };
        Self { quest, counted: false, own_glasses: false, gradients: 10_000, asleep }
    }
}

const METHODS: [(Method, &str, &str); 3] = [
    (
        Method::Restore,
        "RESTORE",
        "Descents that end by chance and begin again from a mutation of a lens that is kept",
    ),
    (
        Method::Metropolis,
        "Metropolis-Hastings",
        "Noisy gradient steps and reversible mutations, each accepted or not",
    ),
    (
        Method::Brute,
        "Brute force",
        "After each element one more and each element less, descended for as long",
    ),
];

impl Setup {
    /// What is asked for, for the design as it is.
    pub(super) fn quest(&self, view: &View) -> Quest {
        let mut quest = self.quest.clone();
        quest.plan.light = light::fitting(quest.plan.light, &view.lens);
        if self.own_glasses {
            quest.plan.rules.glasses = glasses(&view.lens);
        }
        if quest.plan.settings.method == Method::Brute {
            quest.plan.settings.gradients = Some(self.gradients);
        }
        quest
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, view: &View) {
        free(ui, &view.lens, &mut self.quest.free);
        Grid::new("search setup").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
            self.sampler(ui);
            self.structure(ui, view);
            self.aims(ui, &view.lens);
            self.end(ui);
        });
        limits::factory(ui, &mut self.quest.plan.rules);
        self.weights(ui);
        limits::sampler(ui, &mut self.quest.plan);
    }

    fn sampler(&mut self, ui: &mut Ui) {
        let settings = &mut self.quest.plan.settings;
        ui.weak("Method");
        let name = METHODS.iter().find(|(method, ..)| *method == settings.method);
        let combo = ComboBox::from_id_salt("search method").width(150.0);
        let combo = combo.selected_text(name.map_or("", |(_, name, _)| name)).show_ui(ui, |ui| {
            for (method, name, hint) in METHODS {
                ui.selectable_value(&mut settings.method, method, name).on_hover_text(hint);
            }
        });
        combo.response.accessible_name("Search method");
        ui.end_row();
        ui.weak("Chance");
        ui.horizontal(|ui| {
            drag(ui, "Seed", &mut settings.seed, 0..=u64::MAX, 0.1, "The same seed searches alike");
            ui.weak("seed,");
            let hint = "Descents side by side that share the lenses that are kept";
            drag(ui, "Chains", &mut settings.chains, 1..=64, 0.05, hint);
            ui.weak("chains");
        });
        ui.end_row();
    }

    fn structure(&mut self, ui: &mut Ui, view: &View) {
        let rules = &mut self.quest.plan.rules;
        if !self.counted {
            rules.elements = Rules::default().holding(pieces(&view.lens)).elements;
        }
        ui.weak("Elements").on_hover_text("How many pieces of glass a lens may have");
        ui.horizontal(|ui| {
            let [min, max] = &mut rules.elements;
            let fewest =
                drag(ui, "Fewest elements", min, 1..=*max, 0.05, "The fewest pieces of glass");
            ui.weak("to");
            let most = drag(ui, "Most elements", max, *min..=40, 0.05, "The most pieces of glass");
            self.counted |= fewest || most;
            ui.weak(format!("({} now)", pieces(&view.lens)));
        });
        ui.end_row();
        ui.weak("Untouched").on_hover_text("Surfaces that mutations leave alone");
        untouched(ui, &mut rules.kept, view.lens.surfaces.len());
        ui.end_row();
        ui.weak("New glass");
        ui.horizontal(|ui| {
            let hint = "New elements are made of any glass of the catalogue";
            ui.radio_value(&mut self.own_glasses, false, "of the catalogue").on_hover_text(hint);
            let hint = "New elements are made of the glasses that the design is made of";
            ui.radio_value(&mut self.own_glasses, true, "of this lens").on_hover_text(hint);
        });
        ui.end_row();
        ui.weak("Mutations");
        ui.checkbox(&mut rules.projection, "Paraxial projection").on_hover_text(
            "After a mutation the rest of the lens moves as little as possible so that it \
             focuses as before: far more mutations survive",
        );
        ui.end_row();
    }

    fn aims(&mut self, ui: &mut Ui, lens: &Lens) {
        let quest = &mut self.quest;
        ui.weak("Light");
        light::shares(ui, &mut quest.plan.light, lens);
        ui.end_row();
        ui.weak("Focal length");
        let hint = "Ask for another focal length than that of the design";
        let asleep = &mut self.asleep;
        optional(
            ui,
            "Another focal length",
            &mut quest.plan.focal_length,
            &mut asleep.focal_length,
            hint,
            |ui, value| {
                length(ui, "Focal length of the search", value, -10_000.0..=10_000.0);
            },
        );
        ui.end_row();
        ui.weak("Rims");
        let hint = "Remove the diaphragm and open every rim as far as its neighbours and this \
            semi-diameter allow: the search then decides what stops the light";
        optional(ui, "Open them up to", &mut quest.open, &mut asleep.open, hint, |ui, value| {
            length(ui, "Largest rim at the start", value, 0.1..=10_000.0);
        });
        ui.end_row();
    }

    fn end(&mut self, ui: &mut Ui) {
        let Self { quest, asleep, gradients, .. } = self;
        if quest.plan.settings.method == Method::Brute {
            ui.weak("Gradients");
            let hint = "They are divided among all mutations";
            drag(ui, "Gradients of brute force", gradients, 1..=u64::MAX, 100.0, hint);
            ui.end_row();
        }
        ui.weak("Ends after");
        let hint = "The search ends after so much work";
        optional(ui, "minutes", &mut quest.minutes, &mut asleep.minutes, hint, |ui, value| {
            drag(ui, "Minutes of the search", value, 0.1..=100_000.0, 0.1, hint);
        });
        ui.end_row();
        ui.label("");
        let hint = "The search ends after so many moves of all chains together";
        optional(
            ui,
            "moves",
            &mut quest.plan.settings.moves,
            &mut asleep.moves,
            hint,
            |ui, value| {
                drag(ui, "Moves of the search", value, 1..=u64::MAX, 10.0, hint);
            },
        );
        ui.end_row();
    }

    fn weights(&mut self, ui: &mut Ui) {
        let weights = &mut self.quest.plan.rules.weights;
        ui.collapsing("How often each mutation is tried", |ui| {
            Grid::new("weights").num_columns(4).spacing([8.0, 3.0]).show(ui, |ui| {
                for (i, kind) in Kind::MUTATIONS.into_iter().enumerate() {
                    weight(ui, weights, kind);
                    (i % 2 == 1).then(|| ui.end_row());
                }
            });
        });
    }
}

/// How often a kind is tried.
fn weight(ui: &mut Ui, weights: &mut Vec<(Kind, f64)>, kind: Kind) {
    ui.horizontal(|ui| {
        marks::sign(ui, kind);
        ui.label(kind.name());
    });
    let listed = weights.iter().find(|(other, _)| *other == kind);
    let mut weight = listed.map_or(1.0, |(_, weight)| *weight);
    let name = format!("Weight of {} at the start", kind.name());
    if drag(ui, &name, &mut weight, 0.0..=100.0, 0.02, "0 forbids it") {
        weights.retain(|(other, _)| *other != kind);
        weights.push((kind, weight));
    }
}

/// What a search may change, and what it takes as it is.
fn free(ui: &mut Ui, lens: &Lens, free: &mut bool) {
    let count = lens.variables.len();
    if count > 0 {
        ui.checkbox(free, "Free every curvature and gap").on_hover_text(
            "Also those that are no variables of the design; their bounds do not count then",
        );
    }
    let text = if count == 0 || *free {
        "Free: structure, curvatures, gaps and rims. Limits: those of the factory below.".to_owned()
    } else {
        format!(
            "Free: structure, rims, the {count} variables of the design and all that is new; \
             other curvatures and gaps are held."
        )
    };
    ui.add(Label::new(RichText::new(text).small().weak()).wrap());
    if lens.zoom_positions() > 1 {
        let text = "A zoom lens: gaps that move are never joined, so some mutations do not apply.";
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

/// How many surfaces at both ends mutations leave alone.
fn untouched(ui: &mut Ui, [front, rear]: &mut [usize; 2], count: usize) {
    ui.horizontal(|ui| {
        let hint = "Mutations leave so many surfaces at this end alone: a group stays what it is";
        drag(ui, "Untouched at the front", front, 0..=count, 0.05, hint);
        ui.weak("surfaces at the front,");
        drag(ui, "Untouched at the rear", rear, 0..=count, 0.05, hint);
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
    asleep: &mut T,
    hint: &str,
    field: impl FnOnce(&mut Ui, &mut T),
) {
    ui.horizontal(|ui| {
        let mut there = value.is_some();
        if ui.checkbox(&mut there, name).on_hover_text(hint).changed() {
            if let Some(value) = *value {
                *asleep = value;
            }
            *value = there.then_some(*asleep);
        }
        if let Some(value) = value {
            field(ui, value);
        }
    });
}
