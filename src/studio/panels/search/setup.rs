//! What a search is asked for: the sampler, what may become of the lens, how long.

use std::ops::RangeInclusive;

use eframe::egui::emath::Numeric;
use eframe::egui::{ComboBox, DragValue, Grid, RichText, Ui};

use super::{limits, marks};
use crate::lens::{Lens, Medium, NumberKind};
use crate::search::element::pieces;
use crate::search::{Kind, Method};
use crate::session::{Command, Quest, View};
use crate::studio::panels::freed;

/// The settings that a person sees.
#[derive(Debug)]
pub(super) struct Setup {
    quest: Quest,
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
        Self { quest: Quest::default(), own_glasses: false, gradients: 10_000, asleep }
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
        if self.own_glasses {
            quest.rules.glasses = glasses(&view.lens);
        }
        if quest.settings.method == Method::Brute {
            quest.settings.gradients = Some(self.gradients);
        }
        let last = view.lens.surfaces.len().saturating_sub(1);
        quest.rules.surfaces =
            quest.rules.surfaces.map(|[first, end]| [first.min(last), end.min(last)]);
        quest
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        free(ui, view, wishes);
        Grid::new("search setup").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
            self.sampler(ui);
            self.structure(ui, view);
            self.aims(ui);
            self.end(ui);
        });
        limits::factory(ui, &mut self.quest.rules);
        self.weights(ui);
        limits::sampler(ui, &mut self.quest);
    }

    fn sampler(&mut self, ui: &mut Ui) {
        let settings = &mut self.quest.settings;
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
        let rules = &mut self.quest.rules;
        ui.weak("Elements").on_hover_text("How many pieces of glass a lens may have");
        ui.horizontal(|ui| {
            let [min, max] = &mut rules.elements;
            drag(ui, "Fewest elements", min, 1..=*max, 0.05, "The fewest pieces of glass");
            ui.weak("to");
            drag(ui, "Most elements", max, *min..=40, 0.05, "The most pieces of glass");
            ui.weak(format!("({} now)", pieces(&view.lens)));
        });
        ui.end_row();
        ui.weak("Surfaces").on_hover_text("Which surfaces mutations may touch");
        surfaces(ui, &mut rules.surfaces, view.lens.surfaces.len());
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

    fn aims(&mut self, ui: &mut Ui) {
        let quest = &mut self.quest;
        ui.weak("Light");
        ui.horizontal(|ui| {
            let mut percent = 100.0 * quest.light;
            let hint =
                "Every field keeps at least this share of the light that it has at the start";
            let drag = DragValue::new(&mut percent).range(0.0..=1000.0).speed(0.5).suffix(" %");
            let drag = ui.add(drag.max_decimals(1)).on_hover_text(hint);
            if drag.accessible_name("Least light").changed() {
                quest.light = percent / 100.0;
            }
            ui.weak("of the light at the start");
        });
        ui.end_row();
        ui.weak("Focal length");
        let hint = "Ask for another focal length than that of the design";
        let asleep = &mut self.asleep;
        optional(
            ui,
            "Another focal length",
            &mut quest.focal_length,
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
        if quest.settings.method == Method::Brute {
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
        optional(ui, "moves", &mut quest.settings.moves, &mut asleep.moves, hint, |ui, value| {
            drag(ui, "Moves of the search", value, 1..=u64::MAX, 10.0, hint);
        });
        ui.end_row();
    }

    fn weights(&mut self, ui: &mut Ui) {
        let weights = &mut self.quest.rules.weights;
        ui.collapsing("How often each mutation is tried", |ui| {
            Grid::new("weights").num_columns(4).spacing([8.0, 3.0]).show(ui, |ui| {
                for (i, kind) in Kind::MUTATIONS.into_iter().enumerate() {
                    ui.horizontal(|ui| {
                        marks::sign(ui, kind);
                        ui.label(kind.name());
                    });
                    let listed = weights.iter().position(|(other, _)| *other == kind);
                    let mut weight = listed.map_or(1.0, |place| weights[place].1);
                    let name = format!("Weight of {} at the start", kind.name());
                    if drag(ui, &name, &mut weight, 0.0..=100.0, 0.02, "0 forbids it") {
                        weights.retain(|(other, _)| *other != kind);
                        weights.push((kind, weight));
                    }
                    if i % 2 == 1 {
                        ui.end_row();
                    }
                }
            });
        });
    }
}

/// What a search may change, and what it takes as it is.
fn free(ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
    let lens = &view.lens;
    let count = lens.variables.len();
    let text = if count == 0 {
        "Free: all curvatures, gaps and rims, and the structure.".to_owned()
    } else {
        format!(
            "Free: the {count} variables of the design, and all that is new. Curvatures and gaps \
             that are no variables are held where some are."
        )
    };
    ui.label(RichText::new(text).small().weak());
    let held = Lens { variables: Vec::new(), ..Lens::clone(lens) };
    if count > 0 {
        let hint = "Flags no number as variable: one undo step. The search then frees all of them";
        if ui.small_button("Free everything").on_hover_text(hint).clicked() {
            wishes.push(freed(&held, &[NumberKind::Curvatures, NumberKind::Thicknesses]).into());
        }
    }
    if lens.zoom_positions() > 1 {
        let text = "A zoom lens: gaps that differ between positions keep their number, and some \
            mutations do not apply.";
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

/// Which surfaces mutations may touch: all, or from one to another, counted from 1.
fn surfaces(ui: &mut Ui, range: &mut Option<[usize; 2]>, count: usize) {
    ui.horizontal(|ui| {
        let mut all = range.is_none();
        let hint = "Mutations may touch every surface";
        if ui.checkbox(&mut all, "all may change").on_hover_text(hint).changed() {
            *range = (!all).then_some([0, count.saturating_sub(1)]);
        }
        if let Some([first, last]) = range {
            let (mut from, mut to) = (*first + 1, *last + 1);
            let hint = "Mutations touch no surface outside: a front or rear group stays what it is";
            let changed = [
                drag(ui, "First surface that may change", &mut from, 1..=to, 0.05, hint),
                drag(ui, "Last surface that may change", &mut to, from..=count.max(1), 0.05, hint),
            ];
            if changed.contains(&true) {
                (*first, *last) = (from - 1, to - 1);
            }
        }
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
