//! What a search aims at: terms with weights and targets.

use eframe::egui::{Align, Grid, Id, Layout as Arrange, Ui, vec2};
use std::path::PathBuf;

use crate::merit::{Goal, PupilEdge, Term, Weighted};
use crate::session::{Search, View, evaluate};
use crate::studio::field::{Drafts, Field, Place};
use crate::studio::number;
use crate::studio::panels::numbers;

/// The terms of the panel.
#[derive(Debug, Default)]
pub(super) struct Aims {
    terms: Vec<Aim>,
    pupil: PupilEdge,
    zoom_ratios: Vec<f64>,
    /// The lens for which they were proposed.
    lens: Option<(String, Option<PathBuf>, usize)>,
}

/// A term, and whether it counts.
#[derive(Debug, Clone, Copy)]
struct Aim {
    counts: bool,
    weighted: Weighted,
}

impl Aims {
    /// Proposes what a designer would ask of a lens first, once for each lens.
    pub(super) fn keep_up(&mut self, view: &View) {
        let lens = Some((view.lens.name.clone(), view.path.clone(), view.lens.zoom.len()));
        if self.lens == lens {
            return;
        }
        let spot = Weighted { term: Term::Spot, weight: 1.0 };
        let goal = Goal::sensible(&view.lens);
        let goal = goal.unwrap_or_else(|_| Goal {
            terms: vec![spot],
            pupil: PupilEdge::default(),
            zoom_ratios: Vec::new(),
        });
        let aim = |weighted: Weighted| Aim { counts: true, weighted };
        *self = Self {
            terms: goal.terms.into_iter().map(aim).collect(),
            pupil: goal.pupil,
            zoom_ratios: goal.zoom_ratios,
            lens,
        };
    }

    /// What the search is to aim at.
    pub(super) fn goal(&self) -> Goal {
        let counting = self.terms.iter().filter(|aim| aim.counts);
        Goal {
            terms: counting.map(|aim| aim.weighted).collect(),
            pupil: self.pupil,
            zoom_ratios: self.zoom_ratios.clone(),
        }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, view: &View, drafts: &mut Drafts) {
        let search = view.search.as_deref();
        Grid::new("terms").num_columns(5).spacing([8.0, 2.0]).striped(true).show(ui, |ui| {
            ui.weak("Term");
            ui.weak("Weight");
            ui.weak("Target, mm");
            if search.is_some() {
                ui.weak("Before").on_hover_text("Root of the term at the design");
                ui.weak("Now").on_hover_text("Root of the term at the best lens so far");
            }
            ui.end_row();
            for aim in &mut self.terms {
                aim.ui(ui, search, drafts);
                ui.end_row();
            }
        });
        self.add(ui, view);
    }

    /// A menu of the terms that are not there yet.
    fn add(&mut self, ui: &mut Ui, view: &View) {
        let there =
            |term: Term| self.terms.iter().any(|aim| aim.weighted.term.name() == term.name());
        let missing: Vec<Term> = every(view).into_iter().filter(|term| !there(*term)).collect();
        if missing.is_empty() {
            return;
        }
        ui.menu_button("Add a term", |ui| {
            for term in missing {
                if ui.button(title(term)).clicked() {
                    self.terms.push(Aim { counts: true, weighted: Weighted { term, weight: 1.0 } });
                    ui.close();
                }
            }
        });
    }
}

impl Aim {
    fn ui(&mut self, ui: &mut Ui, search: Option<&Search>, drafts: &mut Drafts) {
        let term = self.weighted.term;
        ui.checkbox(&mut self.counts, title(term)).on_hover_text(hint(term));
        let name = format!("Weight of {}", title(term));
        number_field(ui, drafts, &name, &mut self.weighted.weight, 52.0);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            let targets = targets(&mut self.weighted.term);
            let width = if targets.len() > 1 { 50.0 } else { 70.0 };
            for (what, value) in targets {
                let name = format!("{what} of {}", title(term));
                number_field(ui, drafts, &name, value, width);
            }
        });
        let Some(search) = search else { return };
        for terms in [&search.before, &search.terms] {
            let value = terms.iter().find(|value| value.term == term.name());
            ui.label(value.map(|value| root(value.value)).unwrap_or_default());
        }
    }
}

/// The root of a term, in the unit in which it is easiest to read.
fn root(value: f64) -> String {
    let mm = value.max(0.0).sqrt();
    if mm == 0.0 {
        "met".to_owned()
    } else if mm < 0.1 {
        format!("{} µm", number::show_digits(1e3 * mm, 3))
    } else {
        format!("{} mm", number::show_digits(mm, 3))
    }
}

/// A number that belongs to the panel itself.
fn number_field(ui: &mut Ui, drafts: &mut Drafts, name: &str, value: &mut f64, width: f32) {
    let id = Id::unique(("optimizer", name));
    let shown = number::show_digits(*value, 5);
    let field = Field { name, shown: &shown, hint: "", align: Align::Max, place: Place::Form };
    let layout = Arrange::left_to_right(Align::Center);
    let size = vec2(width, ui.spacing().interact_size.y);
    let entry = ui.allocate_ui_with_layout(size, layout, |ui| drafts.show(ui, id, field));
    let Some(text) = entry.inner.typed else { return };
    match evaluate(&text, *value) {
        Ok(new) if new.is_finite() => {
            *value = new;
            drafts.accept(id);
        }
        Ok(new) => drafts.refuse(id, format!("{name} is {new}; expected a finite number")),
        Err(why) => drafts.refuse(id, why.to_string()),
    }
}

/// The targets of a term and what they are called.
fn targets(term: &mut Term) -> Vec<(&'static str, &mut f64)> {
    match term {
        Term::Spot | Term::SpotIntegral | Term::Throughput | Term::Distortion => Vec::new(),
        Term::GlassCenter { min, max }
        | Term::AirCenter { min, max }
        | Term::SemiDiameter { min, max } => vec![("Minimum", min), ("Maximum", max)],
        Term::FocalLength(target) | Term::FNumber(target) | Term::ThroughputLoss(target) => {
            vec![("Target", target)]
        }
        Term::GlassEdge(least)
        | Term::AirEdge(least)
        | Term::BackFocus(least)
        | Term::Light(least)
        | Term::RelativeIllumination { min: least, .. } => vec![("Minimum", least)],
        Term::TotalTrack(most) | Term::Steepness(most) => vec![("Maximum", most)],
    }
}

/// Every term, with targets that the lens meets now.
fn every(view: &View) -> Vec<Term> {
    let efl = numbers(view).and_then(|numbers| numbers.first().efl).unwrap_or(100.0);
    let track: f64 = view.lens.surfaces.iter().map(|row| row.thickness.abs()).sum();
    let size = efl.abs();
    vec![
        Term::Spot,
        Term::FocalLength(efl),
        Term::Distortion,
        Term::GlassCenter { min: 0.01 * size, max: 0.5 * size },
        Term::GlassEdge(0.01 * size),
        Term::AirCenter { min: 0.002 * size, max: 3.0 * track },
        Term::AirEdge(0.001 * size),
        Term::TotalTrack(1.2 * track),
        Term::BackFocus(view.lens.surfaces.last().map_or(0.0, |row| row.thickness)),
    ]
}

const fn title(term: Term) -> &'static str {
    match term {
        Term::Spot => "Spot",
        Term::FocalLength(_) => "Focal length",
        Term::Distortion => "Distortion",
        Term::GlassCenter { .. } => "Glass thickness",
        Term::GlassEdge(_) => "Glass edge",
        Term::AirCenter { .. } => "Air gap",
        Term::AirEdge(_) => "Air edge",
        Term::TotalTrack(_) => "Total track",
        Term::BackFocus(_) => "Back focus",
        Term::SpotIntegral => "Spot integral",
        Term::Throughput => "Throughput",
        Term::ThroughputLoss(_) => "Throughput loss",
        Term::Light(_) => "Light",
        Term::RelativeIllumination { .. } => "Relative illumination",
        Term::FNumber(_) => "F-number",
        Term::Steepness(_) => "Steepness",
        Term::SemiDiameter { .. } => "Semi-diameter",
    }
}

const fn hint(term: Term) -> &'static str {
    match term {
        Term::Spot => "Mean square spot radius over fields and wavelengths, about the centroids",
        Term::FocalLength(_) => "Square of the deviation of the focal length from the target",
        Term::Distortion => "Distance of the chief rays' image points from the paraxial image",
        Term::GlassCenter { .. } => "Glass thinner or thicker than this on the axis",
        Term::GlassEdge(_) => "Glass thinner than this at the rim",
        Term::AirCenter { .. } => "Air thinner or thicker than this on the axis",
        Term::AirEdge(_) => "Air thinner than this at the rim",
        Term::TotalTrack(_) => "From the first vertex to the image longer than this",
        Term::BackFocus(_) => "From the last vertex to the image shorter than this",
        Term::SpotIntegral => "Square distance from the centroid, integrated over the pupil",
        Term::Throughput => "Minus the mean area of the pupils",
        Term::ThroughputLoss(_) => "One minus the mean area of the pupils over this one, in mm²",
        Term::Light(_) => "Light lost below this share of what the pupils let through at first",
        Term::RelativeIllumination { .. } => "A field darker than this share of the axis",
        Term::FNumber(_) => "Square of the deviation of the f-number of the light from this",
        Term::Steepness(_) => "A surface steeper at its rim: curvature times semi-diameter",
        Term::SemiDiameter { .. } => "Surfaces smaller or larger than this",
    }
}
