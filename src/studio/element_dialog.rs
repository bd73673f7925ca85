//! The dialogs that add, move, bend and scale. What they would give is shown in the drawings before it
//! is done.

use egui::{Align2, Button, Context, Grid, Id, Response, RichText, Ui, Window, vec2};

use super::actions::Actions;
use super::form::{choice, enter_number, is_confirmed, number_field};
use super::number;
use super::text::capitalize;
use crate::files::focal_length_factor;
use crate::lens::{Edit, ElementEdit, ElementForm, Lens, Medium, NewElement, apply_edit};
use crate::merit::Term;
use crate::session::{Analyses, Command, SessionView};

/// A change of an element or of the whole lens. Surfaces are indices from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementTask {
    /// Adds an element behind the selected one.
    Add,
    /// Moves the element of this surface along the axis.
    Move(usize),
    /// Bends the element of this surface.
    Bend(usize),
    /// Scales the lens to a focal length.
    Scale,
}

/// The numbers of the dialog.
#[derive(Debug)]
pub(super) struct ElementDialog {
    task: ElementTask,
    form: ElementForm,
    focal_length: f64,
    semi_diameter: f64,
    /// The index of the row in front of which an element is added.
    at: usize,
    by: f64,
    /// True once the first number has had the cursor.
    entered: bool,
    /// The edit whose result is shown in the drawings.
    shown: Option<Edit>,
}

impl ElementDialog {
    pub(super) fn new(task: ElementTask, view: &SessionView) -> Self {
        let first = view.results.as_ref().and_then(|results| results.analyses.as_ref().ok());
        let first = first.map(Analyses::first_order);
        let present = first.and_then(|first| first.efl).map(f64::abs);
        let present = present.or_else(|| asked_without_glass(&view.lens)).unwrap_or(50.0);
        // A lens is scaled to what its merit function asks for, or exactly to what it has.
        let asked = if task == ElementTask::Scale { asked_focal_length(view) } else { None };
        let focal_length = asked.unwrap_or(present);
        let pupil = first.and_then(|first| first.entrance_pupil.diameter);
        Self {
            task,
            form: ElementForm::Singlet,
            focal_length: if task == ElementTask::Scale {
                focal_length
            } else {
                rounded(focal_length)
            },
            semi_diameter: rounded(0.55 * pupil.map_or(0.2 * focal_length, f64::abs)),
            at: place_for_element(&view.lens, view.selected),
            by: 0.0,
            entered: false,
            shown: None,
        }
    }

    /// Shows the dialog; true once it is closed.
    pub(super) fn ui(
        &mut self,
        context: &Context,
        view: &SessionView,
        actions: &mut Actions,
    ) -> bool {
        let mut open = true;
        let mut done = false;
        let window = Window::new(self.title())
            .id(Id::unique("element dialog"))
            .open(&mut open)
            .collapsible(false)
            .resizable(false)
            .default_width(340.0)
            .anchor(Align2::RIGHT_TOP, vec2(-30.0, 60.0));
        window.show(context, |ui| {
            Grid::new("element").num_columns(2).spacing([14.0, 7.0]).show(ui, |ui| {
                self.rows(ui, view);
            });
            done = self.finish(ui, view, actions);
        });
        let ended = done || !open;
        if ended {
            self.end_preview(actions);
        }
        ended
    }

    /// True once what the dialog would give has been shown.
    pub(super) const fn has_preview(&self) -> bool {
        self.shown.is_some()
    }

    /// Shows the design again in place of what the dialog would give.
    pub(super) fn end_preview(&self, actions: &mut Actions) {
        if self.shown.is_some() {
            actions.push(Command::Preview(None));
        }
    }

    fn title(&self) -> String {
        match self.task {
            ElementTask::Add => "Add an element".to_owned(),
            ElementTask::Move(surface) => format!("Move the element of surface {}", surface + 1),
            ElementTask::Bend(surface) => format!("Bend the element of surface {}", surface + 1),
            ElementTask::Scale => "Scale the lens".to_owned(),
        }
    }

    fn rows(&mut self, ui: &mut Ui, view: &SessionView) {
        match self.task {
            ElementTask::Add => self.new_element(ui, &view.lens),
            ElementTask::Move(_) => {
                ui.label("Towards the image by");
                let first = number_field(ui, "Distance", &mut self.by, " mm");
                self.enter(ui, &first);
                ui.end_row();
            }
            ElementTask::Bend(_) => {
                ui.label("Change of the curvatures");
                let first = number_field(ui, "Change of the curvatures", &mut self.by, " /mm");
                self.enter(ui, &first);
                ui.end_row();
            }
            ElementTask::Scale => {
                ui.label("Focal length");
                let name = "Focal length of the lens";
                let first = number_field(ui, name, &mut self.focal_length, " mm");
                self.enter(ui, &first);
                ui.end_row();
            }
        }
    }

    /// Gives the cursor to the first number of the dialog that has just been opened.
    fn enter(&mut self, ui: &Ui, first: &Response) {
        if !std::mem::replace(&mut self.entered, true) {
            enter_number(ui, first);
        }
    }

    fn new_element(&mut self, ui: &mut Ui, lens: &Lens) {
        let forms =
            [(ElementForm::Singlet, "Singlet"), (ElementForm::CementedDoublet, "Cemented doublet")];
        ui.label("Element");
        choice(ui, "Element form", &mut self.form, &forms);
        ui.end_row();
        ui.label("Focal length");
        let name = "Focal length of the element";
        let first = number_field(ui, name, &mut self.focal_length, " mm");
        self.enter(ui, &first);
        first.on_hover_text("Negative for a diverging element");
        ui.end_row();
        ui.label("Thick enough up to the height");
        number_field(ui, "Semi-diameter of the element", &mut self.semi_diameter, " mm");
        ui.end_row();
        let places: Vec<(usize, String)> =
            air_gaps(lens).map(|at| (at, place_name(lens, at))).collect();
        let places: Vec<(usize, &str)> =
            places.iter().map(|(at, name)| (*at, name.as_str())).collect();
        ui.label("Place");
        choice(ui, "Place of the element", &mut self.at, &places);
        ui.end_row();
    }

    /// The edit that the numbers stand for.
    fn edit(&self, view: &SessionView) -> Result<Edit, String> {
        let lens = &view.lens;
        let edit = match self.task {
            ElementTask::Scale => {
                let factor = focal_length_factor(lens, view.settings.zoom, self.focal_length);
                return factor.map(Edit::Scale).map_err(|why| why.to_string());
            }
            ElementTask::Move(surface) => ElementEdit::Move { surface, by: self.by },
            ElementTask::Bend(surface) => ElementEdit::Bend { surface, by: self.by },
            ElementTask::Add => {
                let Self { form, focal_length, semi_diameter, .. } = *self;
                let element = NewElement { form, focal_length, semi_diameter, shape_factor: 0.0 };
                let um = lens.wavelengths[lens.primary()].um;
                let rows = element.rows(um).map_err(|why| why.to_string())?;
                ElementEdit::Insert { at: self.at, rows }
            }
        };
        Ok(Edit::Element(edit))
    }

    /// The command that carries the edit out; scaling is one that names the focal length.
    fn command(&self, edit: Edit) -> Command {
        match self.task {
            ElementTask::Scale => Command::ScaleToFocalLength(self.focal_length),
            _ => edit.into(),
        }
    }

    /// Shows the result in the drawings, and the buttons; true if one of them was pressed.
    fn finish(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) -> bool {
        let tried = self.edit(view).and_then(|edit| {
            let lens = apply_edit(&view.lens, &edit).map_err(|why| why.to_string())?;
            Ok((edit, lens))
        });
        match &tried {
            Err(why) => {
                ui.label(RichText::new(capitalize(why)).color(ui.visuals().warn_fg_color));
            }
            Ok((edit, lens)) if self.shown.as_ref() != Some(edit) => {
                actions.push(Command::Preview(Some(Box::new(lens.clone()))));
                self.shown = Some(edit.clone());
            }
            Ok(_) => {}
        }
        let mut pressed = false;
        ui.horizontal(|ui| {
            let apply = ui.add_enabled(tried.is_ok(), Button::new("Apply")).clicked();
            let is_asked = apply || is_confirmed(ui);
            if let Some((edit, _)) = tried.ok().filter(|_| is_asked) {
                pressed = true;
                actions.push(self.command(edit));
            }
            pressed |= ui.button("Cancel").clicked();
        });
        pressed
    }
}

/// The focal length that the merit function has as its target, in mm.
fn asked_focal_length(view: &SessionView) -> Option<f64> {
    view.goal.iter().flat_map(|goal| &goal.terms).find_map(|weighted| match weighted.term {
        Term::FocalLength(target) => Some(target.abs()),
        _ => None,
    })
}

/// The focal length that a lens without glass was begun for: its image plane lies there.
fn asked_without_glass(lens: &Lens) -> Option<f64> {
    let is_empty = lens.surfaces.iter().all(|row| row.medium == Medium::Air);
    Some(lens.total_track()).filter(|track| is_empty && *track > 0.0)
}

fn rounded(value: f64) -> f64 {
    number::format_digits(value, 4).parse().unwrap_or(value)
}

/// The rows in front of which there is air.
fn air_gaps(lens: &Lens) -> impl Iterator<Item = usize> {
    let is_air = |at: &usize| match at.checked_sub(1) {
        Some(front) => lens.surfaces[front].medium == Medium::Air,
        None => lens.object_medium == Medium::Air,
    };
    (0..=lens.surfaces.len()).filter(is_air)
}

fn place_name(lens: &Lens, at: usize) -> String {
    let count = lens.surfaces.len();
    match at {
        0 => "in front of the first surface".to_owned(),
        at if at == count => format!("behind surface {count}, in front of the image"),
        at => format!("between surfaces {at} and {}", at + 1),
    }
}

/// The row in front of which an element goes: behind the element of a surface, or the last place.
pub(super) fn place_for_element(lens: &Lens, selected: Option<usize>) -> usize {
    let behind = selected.map(|surface| match lens.element_around(surface) {
        Some((_, last)) => last + 1,
        None => surface + 1,
    });
    let at = behind.unwrap_or(lens.surfaces.len());
    air_gaps(lens).find(|gap| *gap >= at).or_else(|| air_gaps(lens).last()).unwrap_or(at)
}
