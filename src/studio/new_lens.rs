//! The dialog that begins a lens: focal length, aperture, fields, wavelengths and object.

use egui::{Button, Context, DragValue, Grid, Id, Key, Modal, RichText, Ui};

use super::actions::Actions;
use super::form::{choice, confirms, dialog_frame, enter_number, is_confirmed, number_field};
use super::number;
use super::text::capitalize;
use crate::lens::{
    Aperture, ElementForm, FieldKind, Fields, Lens, Object, StartingForm, StartingLens,
    WavelengthPreset,
};
use crate::session::Command;

/// The quantity that gives the aperture of a new lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ApertureChoice {
    FNumber,
    EntrancePupil,
    ImageNa,
    ObjectNa,
}

/// The numbers of the dialog.
#[derive(Debug)]
pub(super) struct NewLensDialog {
    form: StartingForm,
    focal_length: f64,
    aperture: ApertureChoice,
    aperture_value: f64,
    field: FieldKind,
    field_max: f64,
    field_count: usize,
    wavelengths: usize,
    at_infinity: bool,
    distance: f64,
    /// True once the first field has had the cursor.
    entered: bool,
    /// True if a number had the cursor in the frame before: Escape takes it away before a frame begins.
    was_typing: bool,
}

impl Default for NewLensDialog {
    fn default() -> Self {
        Self {
            form: StartingForm::Element(ElementForm::CementedDoublet),
            focal_length: 50.0,
            aperture: ApertureChoice::FNumber,
            aperture_value: 4.0,
            field: FieldKind::Angle,
            field_max: 10.0,
            field_count: 3,
            wavelengths: 0,
            at_infinity: true,
            distance: 200.0,
            entered: false,
            was_typing: false,
        }
    }
}

impl NewLensDialog {
    /// Shows the dialog; true once it is closed.
    pub(super) fn ui(&mut self, context: &Context, actions: &mut Actions) -> bool {
        let mut done = false;
        let was_typing = self.was_typing;
        let modal = Modal::new(Id::unique("new lens")).frame(dialog_frame(context));
        let modal = modal.show(context, |ui| {
            ui.set_width(430.0);
            ui.heading("New lens");
            ui.add_space(6.0);
            let grid = Grid::new("new lens").num_columns(2).spacing([14.0, 7.0]);
            let confirmed = grid.show(ui, |ui| self.rows(ui)).inner;
            ui.add_space(6.0);
            ui.separator();
            done = self.buttons(ui, confirmed, actions);
        });
        // Escape leaves a number first, then the dialog.
        self.was_typing = context.egui_wants_keyboard_input();
        let escape = context.input(|input| input.key_pressed(Key::Escape));
        done || (modal.should_close() && !(was_typing && escape))
    }

    /// Shows the numbers and choices; true if Enter was pressed on a choice that was made before.
    fn rows(&mut self, ui: &mut Ui) -> bool {
        ui.label("Focal length");
        let first = number_field(ui, "Focal length", &mut self.focal_length, " mm");
        if !std::mem::replace(&mut self.entered, true) {
            enter_number(ui, &first);
        }
        ui.end_row();
        ui.label("Object");
        let on_object = ui.horizontal(|ui| self.object(ui)).inner;
        ui.end_row();
        ui.label("Aperture");
        ui.horizontal(|ui| self.aperture(ui));
        ui.end_row();
        ui.label("Fields");
        ui.horizontal(|ui| self.fields(ui));
        ui.end_row();
        ui.label("");
        ui.horizontal(|ui| self.field_count(ui));
        ui.end_row();
        ui.label("Wavelengths");
        let presets: Vec<(usize, &str)> =
            WavelengthPreset::ALL.iter().enumerate().map(|(i, p)| (i, p.title)).collect();
        choice(ui, "Wavelengths", &mut self.wavelengths, &presets);
        ui.end_row();
        ui.label("Begin with");
        let on_form = ui.vertical(|ui| self.forms(ui)).inner;
        ui.end_row();
        on_object || on_form
    }

    fn object(&mut self, ui: &mut Ui) -> bool {
        let before = self.at_infinity;
        let mut confirmed = false;
        for (choice, title) in [(true, "at infinity"), (false, "at")] {
            let radio = ui.radio_value(&mut self.at_infinity, choice, title);
            confirmed |= confirms(ui, &radio, before == choice);
        }
        ui.add_enabled_ui(!self.at_infinity, |ui| {
            number_field(ui, "Object distance of the new lens", &mut self.distance, " mm")
                .on_hover_text("In front of the lens");
        });
        if before && !self.at_infinity {
            self.distance = self.distance.max(4.0 * self.focal_length);
        }
        if self.at_infinity && self.aperture == ApertureChoice::ObjectNa {
            (self.aperture, self.aperture_value) = (ApertureChoice::FNumber, 4.0);
        }
        if self.at_infinity && self.field == FieldKind::ObjectHeight {
            (self.field, self.field_max) = (FieldKind::Angle, 10.0);
        }
        confirmed
    }

    fn aperture(&mut self, ui: &mut Ui) {
        let mut kinds = vec![
            (ApertureChoice::FNumber, "f-number"),
            (ApertureChoice::EntrancePupil, "entrance pupil diameter"),
            (ApertureChoice::ImageNa, "numerical aperture, image"),
        ];
        if !self.at_infinity {
            kinds.push((ApertureChoice::ObjectNa, "numerical aperture, object"));
        }
        let before = self.aperture;
        choice(ui, "Aperture of the new lens", &mut self.aperture, &kinds);
        if self.aperture != before {
            self.aperture_value = self.equivalent_aperture(before);
        }
        let unit = if self.aperture == ApertureChoice::EntrancePupil { " mm" } else { "" };
        number_field(ui, "Aperture value", &mut self.aperture_value, unit);
    }

    /// The value of the chosen quantity for about the same beam as that of another one.
    fn equivalent_aperture(&self, before: ApertureChoice) -> f64 {
        let (value, f) = (self.aperture_value, self.focal_length);
        let magnification = f / (self.distance - f);
        let f_number = match before {
            ApertureChoice::FNumber => value,
            ApertureChoice::EntrancePupil => f / value,
            ApertureChoice::ImageNa => 0.5 / value,
            ApertureChoice::ObjectNa => 0.5 * magnification / value,
        };
        let value = match self.aperture {
            ApertureChoice::FNumber => f_number,
            ApertureChoice::EntrancePupil => f / f_number,
            ApertureChoice::ImageNa => 0.5 / f_number,
            ApertureChoice::ObjectNa => 0.5 * magnification / f_number,
        };
        number::format_digits(value, 4).parse().unwrap_or(value)
    }

    fn fields(&mut self, ui: &mut Ui) {
        let mut kinds =
            vec![(FieldKind::Angle, "half field angle"), (FieldKind::ImageHeight, "image height")];
        if !self.at_infinity {
            kinds.push((FieldKind::ObjectHeight, "object height"));
        }
        let before = self.field;
        choice(ui, "Fields of the new lens", &mut self.field, &kinds);
        if self.field != before {
            self.field_max = self.equivalent_field(before);
        }
        ui.label("up to");
        let unit = if self.field == FieldKind::Angle { "°" } else { " mm" };
        number_field(ui, "Largest field", &mut self.field_max, unit);
    }

    /// The largest field in the chosen quantity for about the same field of view as in another one.
    fn equivalent_field(&self, before: FieldKind) -> f64 {
        let (value, f) = (self.field_max, self.focal_length);
        let object = if self.at_infinity { f } else { self.distance };
        // The image of a thin lens lies f d / (d - f) behind it.
        let image = if self.at_infinity { f } else { f * object / (object - f).abs() };
        let slope = match before {
            FieldKind::Angle => value.to_radians().tan(),
            FieldKind::ImageHeight => value / image,
            FieldKind::ObjectHeight => value / object,
        };
        let value = match self.field {
            FieldKind::Angle => slope.atan().to_degrees(),
            FieldKind::ImageHeight => slope * image,
            FieldKind::ObjectHeight => slope * object,
        };
        number::format_digits(value, 4).parse().unwrap_or(value)
    }

    fn field_count(&mut self, ui: &mut Ui) {
        let count = DragValue::new(&mut self.field_count).range(1..=12).speed(0.05);
        ui.add(count).accessible_name("Number of fields");
        ui.label("fields from the axis, in rings of equal area");
    }

    fn forms(&mut self, ui: &mut Ui) -> bool {
        let mut confirmed = false;
        let forms = [
            (
                StartingForm::Element(ElementForm::CementedDoublet),
                "Achromat",
                "a stop and a cemented doublet",
            ),
            (StartingForm::Element(ElementForm::Singlet), "Singlet", "a stop and one lens"),
            (StartingForm::Empty, "Nothing", "a stop and an image plane; add elements to it"),
        ];
        for (form, title, meaning) in forms {
            ui.horizontal(|ui| {
                let is_chosen = self.form == form;
                let radio = ui.radio_value(&mut self.form, form, title);
                confirmed |= confirms(ui, &radio, is_chosen);
                ui.weak(meaning);
            });
        }
        confirmed
    }

    /// The lens that the numbers stand for.
    fn lens(&self) -> Result<Lens, String> {
        self.starting_lens().lens().map_err(|why| capitalize(&why.to_string()))
    }

    /// The numbers.
    fn starting_lens(&self) -> StartingLens {
        let value = self.aperture_value;
        let aperture = match self.aperture {
            ApertureChoice::FNumber => Aperture::FNumber(value),
            ApertureChoice::EntrancePupil => Aperture::EntrancePupilDiameter(value),
            ApertureChoice::ImageNa => Aperture::FNumber(0.5 / value),
            ApertureChoice::ObjectNa => Aperture::ObjectNa(value),
        };
        let object =
            if self.at_infinity { Object::Infinity } else { Object::Finite(self.distance) };
        let presets = &WavelengthPreset::ALL;
        StartingLens {
            form: self.form,
            focal_length: self.focal_length,
            aperture,
            fields: Fields::equal_area(self.field, self.field_max, self.field_count),
            wavelengths: presets[self.wavelengths.min(presets.len() - 1)].wavelengths(),
            object,
        }
    }

    /// Shows the buttons, and above them why the lens cannot be made; true if it was.
    fn buttons(&self, ui: &mut Ui, confirmed: bool, actions: &mut Actions) -> bool {
        let lens = self.lens();
        if let Err(why) = &lens {
            ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
        }
        let mut done = false;
        ui.horizontal(|ui| {
            let fill = ui.visuals().selection.bg_fill;
            let create = Button::new(RichText::new("Create").strong()).fill(fill);
            let pressed = ui.add_enabled(lens.is_ok(), create).clicked();
            let pressed = pressed || confirmed || is_confirmed(ui);
            if pressed && lens.is_ok() {
                actions.push(Command::Begin(Box::new(self.starting_lens())));
                done = true;
            }
            if ui.button("Cancel").clicked() {
                ui.close();
            }
        });
        done
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_of_view_stays_when_its_quantity_is_changed() {
        let mut dialog =
            NewLensDialog { field: FieldKind::ImageHeight, ..NewLensDialog::default() };
        let height = dialog.equivalent_field(FieldKind::Angle);
        assert!((height - 50.0 * 10f64.to_radians().tan()).abs() < 1e-3, "{height}");
        (dialog.field_max, dialog.field) = (height, FieldKind::Angle);
        assert!((dialog.equivalent_field(FieldKind::ImageHeight) - 10.0).abs() < 1e-3);
        // An object 200 mm in front of a lens of 50 mm is imaged at a third of its size.
        let near = NewLensDialog {
            at_infinity: false,
            field_max: 6.0,
            field: FieldKind::ImageHeight,
            ..NewLensDialog::default()
        };
        assert!((near.equivalent_field(FieldKind::ObjectHeight) - 2.0).abs() < 1e-9);
    }
}
