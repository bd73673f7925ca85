//! The aperture, the object and the image plane.

use egui::{ComboBox, Ui};

use crate::lens::{Aperture, Edit, FieldKind, Lens, Object};
use crate::paraxial::FirstOrder;
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::panels::design_results;
use crate::studio::panels::edit_form::{EditForm, heading};

/// The kinds of aperture with their titles and units.
const KINDS: [(Aperture, &str, &str); 4] = [
    (Aperture::FNumber(1.0), "f-number", ""),
    (Aperture::EntrancePupilDiameter(1.0), "Entrance pupil diameter", "mm"),
    (Aperture::ObjectNa(1.0), "Numerical aperture, object", ""),
    (Aperture::StopSemiDiameter(1.0), "Semi-diameter of the stop", "mm"),
];

/// Shows the groups of fields.
pub(super) fn ui(ui: &mut Ui, form: &mut EditForm<'_>) {
    aperture(ui, form);
    object(ui, form);
    image(ui, form);
}

/// The number of an aperture.
pub(in crate::studio::panels) const fn value(aperture: Aperture) -> f64 {
    match aperture {
        Aperture::EntrancePupilDiameter(value)
        | Aperture::FNumber(value)
        | Aperture::ObjectNa(value)
        | Aperture::StopSemiDiameter(value) => value,
    }
}

/// The same kind of aperture with another number.
pub(in crate::studio::panels) const fn with_value(aperture: Aperture, value: f64) -> Aperture {
    match aperture {
        Aperture::EntrancePupilDiameter(_) => Aperture::EntrancePupilDiameter(value),
        Aperture::FNumber(_) => Aperture::FNumber(value),
        Aperture::ObjectNa(_) => Aperture::ObjectNa(value),
        Aperture::StopSemiDiameter(_) => Aperture::StopSemiDiameter(value),
    }
}

/// The title and the unit of a kind of aperture.
pub(in crate::studio::panels) fn kind_of(aperture: Aperture) -> (&'static str, &'static str) {
    let same =
        |other: &Aperture| std::mem::discriminant(other) == std::mem::discriminant(&aperture);
    let found = KINDS.iter().find(|(kind, ..)| same(kind));
    found.map_or(("", ""), |(_, title, unit)| (title, unit))
}

fn aperture(ui: &mut Ui, form: &mut EditForm<'_>) {
    heading(ui, "Aperture");
    let lens = &form.view.lens;
    let aperture = lens.aperture;
    let (title, unit) = kind_of(aperture);
    ui.horizontal(|ui| {
        let combo = ComboBox::from_id_salt("aperture kind").selected_text(title).width(150.0);
        let shown = combo.show_ui(ui, |ui| {
            for (kind, title, _) in KINDS {
                let possible =
                    !matches!(kind, Aperture::ObjectNa(_)) || lens.object != Object::Infinity;
                let chosen = kind_of(aperture).0 == title;
                let item = ui.add_enabled_ui(possible, |ui| ui.selectable_label(chosen, title));
                let item = item.inner.on_disabled_hover_text("The object is at infinity.");
                if item.clicked() && !chosen {
                    let value = design_results(form.view)
                        .and_then(|r| same_beam(kind, r.first_order(), lens))
                        .unwrap_or_else(|| value(aperture));
                    form.actions.push(Edit::SetAperture(with_value(kind, value)));
                }
            }
        });
        named_list(ui, shown, "Aperture kind");
        form.number(ui, "Aperture value", (value(aperture), 66.0), |value| {
            Edit::SetAperture(with_value(aperture, value))
        });
        ui.weak(unit);
    });
    let own = own_positions(lens, |position| position.aperture.is_some());
    if !own.is_empty() {
        ui.weak(format!("{own} of its own, see Zoom positions"));
    }
}

/// The zoom positions that have something of their own, in words.
pub(super) fn own_positions(
    lens: &Lens,
    has: impl Fn(&crate::lens::ZoomPosition) -> bool,
) -> String {
    match lens.zoom.iter().filter(|position| has(position)).count() {
        0 => String::new(),
        1 => "One zoom position has one".to_owned(),
        count => format!("{count} zoom positions have one"),
    }
}

/// The number with which a kind of aperture gives the present beam.
fn same_beam(kind: Aperture, first: &FirstOrder<f64>, lens: &Lens) -> Option<f64> {
    let value = match kind {
        Aperture::EntrancePupilDiameter(_) => first.entrance_pupil.diameter,
        Aperture::FNumber(_) if lens.object == Object::Infinity => first.f_number,
        Aperture::FNumber(_) => first.working_f_number,
        Aperture::ObjectNa(_) => first.marginal.slopes.first().copied(),
        Aperture::StopSemiDiameter(_) => Some(first.stop_semi_diameter),
    };
    value.map(f64::abs).filter(|value| *value > 0.0 && value.is_finite())
}

fn object(ui: &mut Ui, form: &mut EditForm<'_>) {
    heading(ui, "Object");
    let lens = &form.view.lens;
    ui.horizontal(|ui| {
        let far = lens.object == Object::Infinity;
        if ui.radio(far, "At infinity").clicked() && !far {
            form.actions.push(far_edit(lens));
        }
        if ui.radio(!far, "At").clicked() && far {
            let first = design_results(form.view).and_then(|results| results.first_order().efl);
            let distance = 10.0 * first.map_or(100.0, f64::abs);
            let distance = number::format_digits(distance, 3).parse().unwrap_or(distance);
            form.actions.push(Edit::SetObject(Object::Finite(distance)));
        }
        if let Object::Finite(distance) = lens.object {
            form.number(ui, "Distance of the object", (distance, 66.0), |distance| {
                Edit::SetObject(Object::Finite(distance))
            });
            ui.weak("mm").on_hover_text("In front of surface 1");
        }
    });
}

/// Moves the object to infinity; an aperture or fields that have no meaning there change with it.
fn far_edit(lens: &Lens) -> Edit {
    let mut far = lens.clone();
    far.object = Object::Infinity;
    if let (Aperture::ObjectNa(na), Object::Finite(distance)) = (lens.aperture, lens.object) {
        far.aperture = Aperture::EntrancePupilDiameter(2.0 * (na * distance).abs());
    }
    if let (FieldKind::ObjectHeight, Object::Finite(distance)) = (lens.fields.kind, lens.object) {
        far.fields.kind = FieldKind::Angle;
        for field in &mut far.fields.values {
            field.x = (field.x / distance).atan().to_degrees();
            field.y = (field.y / distance).atan().to_degrees();
        }
    }
    let title = "object at infinity".to_owned();
    Edit::Sequence { title, edits: vec![Edit::Replace(Box::new(far))] }
}

fn image(ui: &mut Ui, form: &mut EditForm<'_>) {
    heading(ui, "Image plane");
    let lens = &form.view.lens;
    ui.horizontal(|ui| {
        let mut follows = lens.image_solve.is_some();
        let check = ui.checkbox(&mut follows, "At the paraxial image");
        if check.on_hover_text("The last thickness is solved instead of written").changed() {
            form.actions.push(Edit::SetImageSolve(follows.then_some(0.0)));
        }
        if let Some(offset) = lens.image_solve {
            ui.label("plus");
            form.number(ui, "Defocus of the image plane", (offset, 56.0), |offset| {
                Edit::SetImageSolve(Some(offset))
            });
            ui.weak("mm");
        }
    });
}
