//! The selected surface beyond the columns of the table: the form of its sag beyond a conic, the
//! rule by which it deflects light, its apertures, its decentre and tilt, those of its element, and breaks of
//! the axis.

mod apertures;
mod forms;
mod place;

use egui::{
    Align, ComboBox, Context, Frame, Grid, Layout, Margin, Panel as SidePanel, RichText,
    ScrollArea, Ui, vec2,
};

use super::badge;
use crate::lens::{Edit, Freeform, IdealElement, Lens, Parameter, Quantity, Row};
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::edit_form::EditForm;
use crate::studio::panels::valid_edit;
use crate::studio::panels::widgets::hint_beside;
use crate::studio::text::capitalize;
use crate::studio::text_input::{EditBuffers, error_color};
use apertures::ShapeChoice;
use forms::{FormChoice, NumberName, RuleChoice};

/// The width of the part of the panel, in points.
const WIDTH: f32 = 272.0;
/// The width of the word before a choice.
const TITLE: f32 = 36.0;
/// The width of a number.
const FIELD: f32 = 92.0;

/// Shape and place of the selected surface.
#[derive(Debug, Default)]
pub(super) struct SurfaceDetails {
    open: bool,
    buffers: EditBuffers,
    /// The badges of coefficients have fields of their own.
    badges: EditBuffers,
    /// The reason why the last choice was refused, and the surface that it was for.
    refused: Option<(usize, String)>,
    /// The surface and the choices whose fields were shown last.
    shown: Option<(usize, FormChoice, RuleChoice, Vec<ShapeChoice>)>,
}

impl SurfaceDetails {
    /// Opens and closes them.
    pub(super) fn toggle(&mut self, ui: &mut Ui) {
        let hint = "The form of the selected surface beyond a conic (biconic, toroid, polynomials, phase), \
                    paraxial lens and grating, apertures that are no circles, decentre and tilt, breaks of the axis";
        ui.toggle_value(&mut self.open, "Shape, apertures, tilt").on_hover_text(hint);
    }

    pub(super) fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context) || self.badges.is_typing(context)
    }

    /// Shows them at the right of the panel, while they are open.
    pub(super) fn show(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        if !self.open {
            return;
        }
        let frame = Frame::new().inner_margin(Margin { left: 8, right: 4, top: 2, bottom: 2 });
        SidePanel::right("surface details").frame(frame).default_size(WIDTH).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                let surface = view.selected.filter(|i| *i < view.lens.surfaces.len());
                match surface {
                    Some(surface) => self.surface(ui, view, surface, actions),
                    None => drop(ui.weak("Select a surface: click its number in the table.")),
                }
            });
        });
    }

    fn surface(&mut self, ui: &mut Ui, view: &SessionView, surface: usize, actions: &mut Actions) {
        self.forget_other_fields(view, surface);
        ui.label(RichText::new(format!("Surface {}", surface + 1)).strong());
        let why = self.buffers.last_error().map(str::to_owned).or_else(|| {
            self.refused.as_ref().filter(|(i, _)| *i == surface).map(|(_, why)| why.clone())
        });
        if let Some(why) = why {
            ui.label(RichText::new(why).small().color(error_color(ui)));
        }
        let row = &view.lens.surfaces[surface];
        if let Some(locked) = &row.locked {
            ui.weak(format!("Locked: a surface of the kind {}, which is not traced", locked.kind));
        }
        self.choose_form(ui, view, surface, actions);
        if let Some(form) = &row.freeform {
            self.form(ui, view, (surface, form), actions);
        }
        self.choose_rule(ui, view, surface, actions);
        if let Some(rule) = row.ideal {
            self.rule(ui, view, (surface, rule), actions);
        }
        let size = row.semi_diameter.or_else(|| clear_semi_diameter(view, surface));
        let mut fields = EditForm { view, buffers: &mut self.buffers, actions };
        let asked = apertures::show(ui, &mut fields, (surface, size));
        place::show(ui, &mut fields, surface);
        if let Some(edit) = asked {
            self.try_edit(view, (surface, edit), actions);
        }
    }

    /// Forgets what was typed into fields that are no longer shown, with its errors.
    fn forget_other_fields(&mut self, view: &SessionView, surface: usize) {
        let row = &view.lens.surfaces[surface];
        let apertures = row.apertures.iter().map(|own| ShapeChoice::of(&own.shape)).collect();
        let now = Some((surface, FormChoice::of(row), RuleChoice::of(row), apertures));
        if self.shown != now {
            self.shown = now;
            self.buffers = EditBuffers::default();
            self.badges = EditBuffers::default();
        }
    }

    fn choose_form(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        surface: usize,
        actions: &mut Actions,
    ) {
        let row = &view.lens.surfaces[surface];
        let chosen = FormChoice::of(row);
        let name = format!("Form of surface {}", surface + 1);
        let picked = choose(ui, ("Form", &name), (chosen, &FormChoice::ALL), FormChoice::text);
        if let Some(choice) = picked {
            let size = row.semi_diameter.or_else(|| clear_semi_diameter(view, surface));
            let freeform = choice.form(row, size.unwrap_or(10.0));
            // Variables and pickups of the numbers of the form before do not pass to the new one.
            let plain = row_edit(&view.lens, surface, |row| row.freeform = None);
            let formed = row_edit(&view.lens, surface, |row| row.freeform = freeform);
            let title = format!("form of surface {}", surface + 1);
            let edit = Edit::Sequence { title, edits: vec![plain, formed] };
            self.try_edit(view, (surface, edit), actions);
        }
    }

    fn choose_rule(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        surface: usize,
        actions: &mut Actions,
    ) {
        let row = &view.lens.surfaces[surface];
        let chosen = RuleChoice::of(row);
        let name = format!("Deflection at surface {}", surface + 1);
        let picked = choose(ui, ("Light", &name), (chosen, &RuleChoice::ALL), RuleChoice::text);
        if let Some(choice) = picked {
            let edit = row_edit(&view.lens, surface, |row| row.ideal = choice.rule());
            self.try_edit(view, (surface, edit), actions);
        }
    }

    /// Asks for an edit of a surface as one undo step, or keeps the reason why it is refused.
    fn try_edit(
        &mut self,
        view: &SessionView,
        (surface, edit): (usize, Edit),
        actions: &mut Actions,
    ) {
        self.refused = match valid_edit(&view.lens, edit) {
            Ok(edit) => {
                actions.extend([Command::Edit(edit), Command::CommitEdit]);
                None
            }
            Err(why) => Some((surface, capitalize(&why))),
        };
    }

    /// The lengths, the order and the coefficients of a form.
    fn form(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (surface, form): (usize, &Freeform<f64>),
        actions: &mut Actions,
    ) {
        Grid::new("numbers of the form").num_columns(3).spacing([6.0, 2.0]).show(ui, |ui| {
            for (name, unit, value, set) in forms::settings(form.kind) {
                ui.label(format!("{name}{unit}"));
                let label = format!("{name} of surface {}", surface + 1);
                let mut fields = EditForm { view, buffers: &mut self.buffers, actions };
                fields.number(ui, &label, (value, FIELD), |value| {
                    let kind = set(form.kind, value);
                    let freeform = Some(Freeform { kind, ..form.clone() });
                    row_edit(&view.lens, surface, |row| row.freeform = freeform)
                });
                ui.end_row();
            }
            for number in 0..form.numbers.len() {
                self.coefficient(ui, view, (surface, form, number), actions);
                ui.end_row();
            }
        });
        self.terms(ui, view, (surface, form), actions);
    }

    fn coefficient(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (surface, form, number): (usize, &Freeform<f64>, usize),
        actions: &mut Actions,
    ) {
        let NumberName { name, hint, is_radius } = forms::number_name(form.kind, number);
        hint_beside(ui.label(&name), &hint);
        let parameter = Parameter::new(surface, Quantity::Freeform(number));
        let stored = form.numbers[number];
        let shown = if is_radius { number::radius(stored) } else { stored };
        let label = format!("{name} of surface {}", surface + 1);
        let mut fields = EditForm { view, buffers: &mut self.buffers, actions };
        fields.number(ui, &label, (shown, FIELD), |value| {
            // As in the table, 0 is a plane.
            let value = if is_radius && value != 0.0 { 1.0 / value } else { value };
            Edit::Set { parameter, value }
        });
        badge::show(ui, &view.lens, parameter, None, &mut self.badges, actions);
    }

    /// Adds a coefficient at the end, or removes the last one.
    fn terms(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (surface, form): (usize, &Freeform<f64>),
        actions: &mut Actions,
    ) {
        let ([least, most], count) = (form.kind.counts(), form.numbers.len());
        if least == most {
            return;
        }
        let mut changed = form.clone();
        ui.horizontal(|ui| {
            let add = ui.add_enabled(count < most, egui::Button::new("Add a term").small());
            let remove =
                ui.add_enabled(count > least, egui::Button::new("Remove the last").small());
            if add.clicked() {
                changed.numbers.push(0.0);
            }
            if remove.clicked() {
                changed.numbers.pop();
            }
        });
        if changed.numbers.len() != count {
            let row = Row { freeform: Some(changed), ..view.lens.surfaces[surface].clone() };
            self.try_edit(view, (surface, Edit::SetRow { surface, row }), actions);
        }
    }

    /// The numbers of a paraxial lens or a grating.
    fn rule(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        (surface, rule): (usize, IdealElement),
        actions: &mut Actions,
    ) {
        let mut fields = EditForm { view, buffers: &mut self.buffers, actions };
        Grid::new("numbers of the rule").num_columns(2).spacing([6.0, 2.0]).show(ui, |ui| {
            for (name, unit, value, set) in forms::rule_settings(rule) {
                ui.label(format!("{name}{unit}"));
                let label = format!("{name} of surface {}", surface + 1);
                fields.number(ui, &label, (value, FIELD), |value| {
                    row_edit(&view.lens, surface, |row| row.ideal = Some(set(rule, value)))
                });
                ui.end_row();
            }
        });
    }
}

/// The edit that changes the row of a surface.
fn row_edit(lens: &Lens, surface: usize, change: impl FnOnce(&mut Row)) -> Edit {
    let mut row = lens.surfaces[surface].clone();
    change(&mut row);
    Edit::SetRow { surface, row }
}

/// Shows a choice with a word before it; the entry that was picked in this frame.
fn choose<T: Copy + PartialEq>(
    ui: &mut Ui,
    (title, name): (&str, &str),
    (chosen, all): (T, &[T]),
    text: impl Fn(T) -> (&'static str, &'static str),
) -> Option<T> {
    let mut picked = None;
    ui.horizontal(|ui| {
        let size = vec2(TITLE, ui.spacing().interact_size.y);
        let layout = Layout::left_to_right(Align::Center);
        ui.allocate_ui_with_layout(size, layout, |ui| ui.label(title));
        let combo = ComboBox::from_id_salt(name).selected_text(text(chosen).0);
        let combo = combo.width(176.0).height(310.0);
        let shown = combo.show_ui(ui, |ui| {
            for choice in all {
                let (title, hint) = text(*choice);
                let item = ui.selectable_label(*choice == chosen, title);
                if hint_beside(item, hint).clicked() && *choice != chosen {
                    picked = Some(*choice);
                }
            }
        });
        named_list(ui, shown, name);
    });
    picked
}

/// The semi-diameter that the rays need at a surface.
fn clear_semi_diameter(view: &SessionView, surface: usize) -> Option<f64> {
    let analyses = view.results.as_ref()?.analyses.as_ref().ok()?;
    analyses.semi_diameters.value.get(surface).copied().filter(|height| *height > 0.0)
}
