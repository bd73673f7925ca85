//! The editor of the merit function: terms with weights and targets, and the treatment of the pupil
//! edge.

use egui::{
    Align, Button, Color32, ComboBox, Grid, Id, Layout as Arrange, RichText, TextStyle, Ui, vec2,
};
use std::sync::Arc;

use super::limits;
use super::live_term::{LiveTerm, show_total};
use super::scope;
use super::terms::{self, can_ask_for_more_light, hint, targets, title, unit, value_text};
use crate::lens::{Aperture, Edit, Lens, ParameterKind, Quantity};
use crate::math::expression::evaluate;
use crate::merit::{Goal, LimitTreatment, OperandKind, PupilEdge, Term, WeightedTerm};
use crate::session::{Command, OptimizationSnapshot, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::widgets::hint_beside;
use crate::studio::panels::{add_variables_edit, field_name};
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput};

/// The terms of the panel.
#[derive(Debug, Default)]
pub(super) struct MeritEditor {
    terms: Vec<MeritRow>,
    edge: PupilEdge,
    zoom_ratios: Vec<f64>,
    limits: LimitTreatment,
    /// The merit function of the design in the last frame; `None` before the first one.
    #[expect(clippy::option_option, reason = "nothing seen yet is not a design without a goal")]
    seen: Option<Option<Arc<Goal>>>,
    /// The merit function that was made of the terms last, until the design has it.
    written: Option<Goal>,
}

/// The room for all that is not a target in a row, in points.
const OTHER_COLUMNS: f32 = 318.0;
/// The width of a number in points: six characters such as `0.5927`.
const NUMBER: f32 = 51.0;
/// The room in a field that its text does not have, in points: the margins, and a cursor at the end.
const FIELD_MARGINS: f32 = 11.0;
/// The least and the most room for targets.
const MIN_TARGETS: f32 = 76.0;
const MAX_TARGETS: f32 = 210.0;

/// A term, and whether it counts.
#[derive(Debug, Clone, Copy)]
struct MeritRow {
    active: bool,
    weighted: WeightedTerm,
}

/// Both treatments of the pupil edge, each with its explanation.
const EDGES: [(PupilEdge, &str, &str); 2] = [
    (
        PupilEdge::Moving,
        "Moving",
        "Derivatives include the motion of the pupil edge: unbiased, and light can be optimized.",
    ),
    (
        PupilEdge::Frozen,
        "Fixed rays",
        "The present rays are reused, as in most programs: faster, but biased where the beam is \
         vignetted, and blind to changes of light.",
    ),
];

impl MeritEditor {
    /// Reads the merit function of the design where it is not the one that is shown: another lens
    /// was opened, or a change was undone. Terms that do not count stay until then.
    pub(super) fn sync(&mut self, view: &SessionView) {
        if self.seen.as_ref() == Some(&view.goal) {
            return;
        }
        let is_first = self.seen.replace(view.goal.clone()).is_none();
        let written = self.written.take();
        if !is_first && written.as_ref() == view.goal.as_deref() {
            return;
        }
        let goal = goal_of(view);
        let row = |weighted: WeightedTerm| MeritRow { active: true, weighted };
        self.terms = goal.terms.into_iter().map(row).collect();
        self.edge = goal.pupil;
        self.zoom_ratios = goal.zoom_ratios;
        self.limits = goal.limits;
    }

    /// Makes the terms the merit function of the design if they differ from what they were.
    pub(super) fn write_changes(&mut self, before: &Goal, actions: &mut Actions) {
        let goal = self.goal();
        if goal != *before {
            self.written = Some(goal.clone());
            actions.push(Edit::SetMerit(Some(goal)));
        }
    }

    /// The goal of the optimization.
    pub(super) fn goal(&self) -> Goal {
        Goal {
            terms: self.active_terms().collect(),
            pupil: self.edge,
            zoom_ratios: self.zoom_ratios.clone(),
            limits: self.limits,
        }
    }

    /// The terms that count.
    fn active_terms(&self) -> impl Iterator<Item = WeightedTerm> {
        self.terms.iter().filter(|row| row.active).map(|row| row.weighted)
    }

    /// The choice of how the edge of the pupil is treated.
    pub(super) fn edge_choice(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.weak("Pupil edge");
            for (edge, text, what) in EDGES {
                ui.radio_value(&mut self.edge, edge, text).on_hover_text(what);
            }
        });
        let chosen = EDGES.iter().find(|(edge, ..)| *edge == self.edge);
        ui.label(RichText::new(chosen.map_or("", |(.., what)| what)).small().weak());
    }

    /// The chosen treatment in words.
    pub(super) const fn edge_text(&self) -> &'static str {
        match self.edge {
            PupilEdge::Moving => "moving pupil edge",
            PupilEdge::Frozen => "fixed rays",
        }
    }

    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        buffers: &mut EditBuffers,
        actions: &mut Actions,
    ) {
        self.warnings(ui, &view.lens, actions);
        show_total(ui, view);
        let search = view.optimization.snapshot.as_deref();
        let mut unwanted = None;
        let repeats = self.repeats();
        let target_width = (ui.available_width() - OTHER_COLUMNS).clamp(MIN_TARGETS, MAX_TARGETS);
        Grid::new("terms").num_columns(4).spacing([6.0, 2.0]).striped(true).show(ui, |ui| {
            for (text, what) in [("Term", ""), ("Weight", ""), ("Target", "")] {
                heading(ui, text, what);
            }
            if search.is_some() {
                let what = "Its value for the design, and for the best lens of the optimization";
                heading(ui, "Value, best", what);
            } else {
                let what = "Its value for the design, and its part of the merit by magnitude";
                heading(ui, "Value, share", what);
            }
            ui.end_row();
            let mut place = 0;
            for (i, row) in self.terms.iter_mut().enumerate() {
                let live = row.active.then(|| LiveTerm::of(view, place, row.weighted)).flatten();
                let number = repeats[i];
                if row.ui(ui, view, buffers, TermPlace { number, place, live, target_width }) {
                    unwanted = Some(i);
                }
                place += usize::from(row.active);
                ui.end_row();
            }
        });
        if let Some(i) = unwanted {
            self.terms.remove(i);
        }
        self.add_menu(ui, view);
        limits::list(ui, view, actions);
    }

    /// The number of terms of the same kind before each term.
    fn repeats(&self) -> Vec<usize> {
        let names: Vec<_> = self.terms.iter().map(|row| row.weighted.term.name()).collect();
        let before = |i: usize| names[..i].iter().filter(|name| **name == names[i]).count();
        (0..names.len()).map(before).collect()
    }

    /// Warnings about what prevents the lens from gaining light, each with a button that fixes it.
    fn warnings(&mut self, ui: &mut Ui, lens: &Lens, actions: &mut Actions) {
        let more: Vec<&str> = self
            .active_terms()
            .filter(|weighted| can_ask_for_more_light(weighted.term))
            .map(|weighted| title(weighted.term))
            .collect();
        let about_light = self.active_terms().any(|weighted| weighted.term.concerns_light());
        if about_light && self.edge == PupilEdge::Frozen {
            let what = "Fixed rays carry no information about light: these terms are evaluated \
                but do not guide the optimization.";
            if warning_with_fix(ui, what, "Let the edge move", EDGES[0].2) {
                self.edge = PupilEdge::Moving;
            }
        }
        if more.is_empty() {
            return;
        }
        let asked = more.join(" and ");
        if !is_limited_by_stop(lens) {
            let what = format!(
                "{asked}: the beam is limited by the ideal entrance pupil, which no surface \
                 moves, so the light cannot grow.",
            );
            let hint = "Make the semi-diameter of the stop, at the present size of the beam, the \
                aperture of the lens, as one undo step";
            if warning_with_fix(ui, &what, "Limit the beam by the stop", hint) {
                actions.push(Command::LimitByStop);
            }
        }
        let rim = |v: &crate::lens::Variable| v.parameter.quantity == Quantity::SemiDiameter;
        if !lens.variables.iter().any(rim) {
            let what = format!(
                "{asked}: no semi-diameter is variable, so the clear apertures cannot change."
            );
            let hint = "Make every semi-diameter of the prescription variable, as one undo step";
            if warning_with_fix(ui, &what, "Vary the semi-diameters", hint) {
                actions.push(add_variables_edit(lens, &[ParameterKind::SemiDiameters]));
            }
        }
    }

    /// A menu of all terms; each may be there several times, for different parts of the lens.
    fn add_menu(&mut self, ui: &mut Ui, view: &SessionView) {
        ui.menu_button("Add a term", |ui| {
            for weighted in terms::default_terms(view) {
                self.add_item(ui, weighted);
            }
            for (title, kinds) in scope::GROUPS {
                ui.menu_button(*title, |ui| self.add_operands(ui, kinds));
            }
        });
    }
}

impl MeritEditor {
    /// Items of the menu that add operands, which have no bounds at first.
    fn add_operands(&mut self, ui: &mut Ui, kinds: &[OperandKind]) {
        for kind in kinds {
            let term = Term::Operand { kind: *kind, min: None, max: None };
            self.add_item(ui, WeightedTerm::new(term, 1.0));
        }
    }

    /// An item of the menu that adds a term.
    fn add_item(&mut self, ui: &mut Ui, weighted: WeightedTerm) {
        let button = ui.button(title(weighted.term));
        if hint_beside(button, hint(weighted.term)).clicked() {
            self.terms.push(MeritRow { active: true, weighted });
            ui.close();
        }
    }
}

/// Every term that can be added to the merit function, with its title and the edit that adds it.
pub(in crate::studio) fn term_edits(view: &SessionView) -> Vec<(String, Edit)> {
    let goal = goal_of(view);
    let edit = |weighted| {
        let terms = [&goal.terms[..], &[weighted]].concat();
        Edit::SetMerit(Some(Goal { terms, ..goal.clone() }))
    };
    let usual = terms::default_terms(view)
        .into_iter()
        .map(|weighted| (title(weighted.term).to_owned(), edit(weighted)));
    let operands = scope::GROUPS.iter().flat_map(|(group, kinds)| {
        kinds.iter().map(move |kind| {
            let term = Term::Operand { kind: *kind, min: None, max: None };
            (format!("{} ({group})", title(term)), edit(WeightedTerm::new(term, 1.0)))
        })
    });
    usual.chain(operands).collect()
}

/// The merit function of the design.
fn goal_of(view: &SessionView) -> Goal {
    let own = view.goal.as_ref().map(|goal| Goal::clone(goal));
    own.or_else(|| Goal::of_lens(&view.lens).ok()).unwrap_or_else(|| Goal {
        terms: vec![WeightedTerm::new(Term::Spot, 1.0)],
        pupil: PupilEdge::default(),
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    })
}

/// A row of the table: its number among those of its kind, its place in the merit function, and its
/// present value.
#[derive(Clone, Copy)]
struct TermPlace {
    number: usize,
    place: usize,
    live: Option<LiveTerm>,
    /// The room for its targets, in points.
    target_width: f32,
}

/// True if the stop alone limits the beam, at every zoom position.
fn is_limited_by_stop(lens: &Lens) -> bool {
    let by_stop = |zoom| matches!(lens.aperture_at(zoom), Aperture::StopSemiDiameter(_));
    (0..lens.zoom_positions()).all(by_stop)
}

/// A warning and the button that removes its reason.
fn warning_with_fix(ui: &mut Ui, what: &str, button: &str, hint: &str) -> bool {
    let text = RichText::new(what).small().color(ui.visuals().warn_fg_color);
    ui.horizontal_wrapped(|ui| {
        ui.label(text);
        ui.small_button(button).on_hover_text(hint).clicked()
    })
    .inner
}

/// A number in about the characters for which a field has room: a small one has a digit less.
pub(super) fn short_number(value: f64) -> String {
    let digits = if value.abs() < 0.1 { 3 } else { 4 };
    number::format_compact(value, digits)
}

/// The width of the field of a number in points: that of most, or more where the number is longer.
pub(super) fn field_width(ui: &Ui, text: &str) -> f32 {
    let font = TextStyle::Body.resolve(ui.style());
    let words = ui.painter().layout_no_wrap(text.to_owned(), font, Color32::PLACEHOLDER);
    NUMBER.max(words.size().x + FIELD_MARGINS)
}

fn heading(ui: &mut Ui, text: &str, what: &str) {
    let label = ui.weak(text);
    if !what.is_empty() {
        label.on_hover_text(what);
    }
}

impl MeritRow {
    /// Shows the row; true if it is to be removed.
    fn ui(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        buffers: &mut EditBuffers,
        at: TermPlace,
    ) -> bool {
        let term = self.weighted.term;
        let title = match at.number {
            0 => title(term).to_owned(),
            before => format!("{} {}", title(term), before + 1),
        };
        let removed = self.name_cell(ui, view, &title);
        let name = format!("Weight of {title}");
        number_field(ui, buffers, &name, &mut self.weighted.weight);
        self.target_cell(ui, view, buffers, &title, at.target_width);
        self.value_cell(ui, view, at);
        removed
    }

    /// The targets, below each other in a narrow panel. A table centres a cell by the height that is
    /// asked for: that of the frame before.
    fn target_cell(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        buffers: &mut EditBuffers,
        title: &str,
        width: f32,
    ) {
        let line = ui.spacing().interact_size.y;
        let id = Id::unique(("height of targets", title));
        let height = ui.data(|data| data.get_temp(id)).unwrap_or(line);
        let from_top = Arrange::top_down(Align::Min);
        let cell = ui.allocate_ui_with_layout(vec2(width, height), from_top, |ui| {
            let wrapping = Arrange::left_to_right(Align::Center).with_main_wrap(true);
            let targets = ui.allocate_ui_with_layout(vec2(width, line), wrapping, |ui| {
                self.targets(ui, view, buffers, title);
            });
            targets.response.rect.height()
        });
        ui.data_mut(|data| data.insert_temp(id, cell.inner));
    }

    fn targets(&mut self, ui: &mut Ui, view: &SessionView, buffers: &mut EditBuffers, title: &str) {
        ui.spacing_mut().item_spacing = vec2(2.0, 2.0);
        for (what, value) in targets(&mut self.weighted.term) {
            let name = format!("{what} of {title}");
            number_field(ui, buffers, &name, value);
        }
        scope::bounds(ui, buffers, title, &mut self.weighted.term);
        ui.weak(unit(self.weighted.term));
        self.field_choice(ui, view, title);
        scope::button(ui, buffers, &view.lens, title, &mut self.weighted);
    }

    /// The button that removes the term, and its title, by which it counts or not.
    fn name_cell(&mut self, ui: &mut Ui, view: &SessionView, title: &str) -> bool {
        let term = self.weighted.term;
        let possible = !view.optimization.is_active();
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let remove = ui.add_enabled(possible, Button::new("×").small());
            let remove = remove.accessible_name(format!("Remove {title}"));
            let removed = remove.on_hover_text("Remove the term").clicked();
            ui.checkbox(&mut self.active, title).on_hover_text(hint(term));
            removed
        })
        .inner
    }

    /// The value for the design, and below it the share or the value for the best lens.
    fn value_cell(&self, ui: &mut Ui, view: &SessionView, at: TermPlace) {
        let term = self.weighted.term;
        let Some(search) = view.optimization.snapshot.as_deref() else {
            return match at.live {
                Some(live) => live.cell(ui, term),
                None => drop(ui.label("")),
            };
        };
        // The value for the best lens takes the place of the share.
        ui.vertical(|ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            if let Some(live) = at.live {
                live.value(ui, term);
            }
            self.best_cell(ui, search, at.place);
        });
    }

    /// The choice of the field where the term is about one.
    fn field_choice(&mut self, ui: &mut Ui, view: &SessionView, title: &str) {
        let Term::RelativeIllumination { field, .. } = &mut self.weighted.term else { return };
        let fields = view.lens.fields_at(view.settings.zoom);
        let name = |i: usize| {
            let point = fields.values.get(i);
            point.map_or_else(|| "no field".to_owned(), |point| field_name(fields.kind, *point))
        };
        ui.weak("at");
        let combo = ComboBox::from_id_salt(("field", title)).width(60.0);
        let combo = combo.selected_text(name(*field)).show_ui(ui, |ui| {
            for i in 0..fields.values.len() {
                ui.selectable_value(field, i, name(i));
            }
        });
        named_list(ui, combo, format!("Field of {title}"));
    }

    /// The value of the term for the best lens of the optimization, if that has the term.
    fn best_cell(&self, ui: &mut Ui, search: &OptimizationSnapshot, place: usize) {
        let term = self.weighted.term;
        let scope = self.weighted.scope;
        let is_asked =
            |asked: &&WeightedTerm| self.active && (asked.term, asked.scope) == (term, scope);
        let asked = search.request.goal.terms.get(place).filter(is_asked);
        let value = asked.and_then(|_| search.best_terms.get(place));
        if let Some(value) = value {
            let text = format!("best {}", value_text(term, value.value));
            ui.label(RichText::new(text).small());
        }
    }
}

/// A number that belongs to the panel itself.
fn number_field(ui: &mut Ui, buffers: &mut EditBuffers, name: &str, value: &mut f64) {
    let id = Id::unique(("optimizer", name));
    let shown = short_number(*value);
    let field = TextInput {
        name,
        value: &shown,
        hint: "",
        align: Align::Max,
        placement: InputPlacement::Form,
    };
    let layout = Arrange::left_to_right(Align::Center);
    let size = vec2(field_width(ui, &shown), ui.spacing().interact_size.y);
    let entry = ui.allocate_ui_with_layout(size, layout, |ui| buffers.show(ui, id, field));
    let Some(text) = entry.inner.submitted else { return };
    match evaluate(&text, *value) {
        Ok(new) if new.is_finite() => {
            *value = new;
            buffers.accept(id);
        }
        Ok(new) => buffers.reject(id, format!("{name} is {new}; expected a finite number")),
        Err(why) => buffers.reject(id, why.to_string()),
    }
}
