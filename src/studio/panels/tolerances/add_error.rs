//! A form that adds an error of any kind to the tolerances of a lens.

use egui::{DragValue, Ui};

use super::sheet_editor::SheetEditor;
use super::text::{title, travel_name};
use crate::lens::{
    AdjustedPart, ErrorDistribution, Lens, Perturbation, PerturbationKind, Tolerance,
    ToleranceGrade,
};
use crate::studio::form::choice;
use crate::tolerance::{NominalLens, graded_sheet, perturb};

/// Surfaces counted from 0 that a form names, the first and the last.
pub(super) type SurfaceRange = (usize, usize);

/// The form.
#[derive(Debug)]
pub(super) struct ErrorForm {
    kind: PerturbationKind,
    surfaces: SurfaceRange,
}

impl Default for ErrorForm {
    fn default() -> Self {
        Self { kind: PerturbationKind::Thickness, surfaces: (0, 0) }
    }
}

/// The half range of a displacement in mm, of a conic constant and of a relative sag where classes say
/// nothing.
const DISPLACEMENT: f64 = 0.02;
const CONIC: f64 = 1e-3;
/// The change of the sag at the rim in mm by which the half range of an asphere is proposed.
const SAG: f64 = 1e-4;

impl ErrorForm {
    /// Shows the form; `nominal` is the resolved lens, by which an error that is not possible is refused.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        nominal: &NominalLens,
        grade: ToleranceGrade,
        editor: &mut SheetEditor<'_>,
    ) {
        ui.horizontal_wrapped(|ui| {
            ui.label("Add an error:");
            let kinds = PerturbationKind::ALL.map(|kind| (kind, title(kind)));
            choice(ui, "Kind of the added error", &mut self.kind, &kinds);
            let one = !self.kind.moves_a_body();
            surface_fields(ui, "added error", &mut self.surfaces, (one, editor.lens));
            let hint = "Adds it with the half range of the class of care, or a small one";
            if ui.button("Add the error").on_hover_text(hint).clicked() {
                self.add(nominal, grade, editor);
            }
        });
    }

    fn add(&self, nominal: &NominalLens, grade: ToleranceGrade, editor: &mut SheetEditor<'_>) {
        let (first, last) = self.surfaces;
        let error = Perturbation { kind: self.kind, first, last };
        if editor.sheet.errors.iter().any(|own| own.error == error) {
            return editor.refuse("this error is in the list already; change its half range");
        }
        if let Err(why) = perturb(nominal, &[(error, 0.0)]) {
            return editor.refuse(&why.to_string());
        }
        let half_range = proposed(editor.lens, nominal, grade, error);
        let distribution = ErrorDistribution::default();
        editor.change(|sheet| sheet.errors.push(Tolerance { error, half_range, distribution }));
    }
}

/// The half range that a class has for an error, or for the same kind elsewhere, or a small one.
fn proposed(lens: &Lens, nominal: &NominalLens, grade: ToleranceGrade, error: Perturbation) -> f64 {
    let sheet = graded_sheet(lens, nominal, grade);
    let kind = match error.kind {
        PerturbationKind::ThicknessAdjusted => PerturbationKind::Thickness,
        PerturbationKind::SurfaceDecenterX | PerturbationKind::SurfaceDecenterY => {
            PerturbationKind::ElementDecenterX
        }
        PerturbationKind::ElementRollX | PerturbationKind::ElementRollY => {
            PerturbationKind::ElementTiltX
        }
        other => other,
    };
    let same = sheet.errors.iter().find(|own| own.error == error);
    let like = same.or_else(|| sheet.errors.iter().find(|own| own.error.kind == kind));
    let radius = nominal.semi_diameters.get(error.first).copied().filter(|r| *r > 0.0);
    like.map_or_else(
        || match error.kind {
            PerturbationKind::Conic | PerturbationKind::Index | PerturbationKind::Abbe => CONIC,
            PerturbationKind::Asphere => SAG / radius.unwrap_or(1.0).powi(4),
            PerturbationKind::Curvature => SAG / radius.unwrap_or(1.0).powi(2),
            PerturbationKind::Irregularity => SAG,
            kind if kind.is_angle() => DISPLACEMENT / 60.0,
            _ => DISPLACEMENT,
        },
        |own| own.half_range,
    )
}

/// Shows fields for the first and the last surface, counted from 1, or for one.
pub(super) fn surface_fields(
    ui: &mut Ui,
    what: &str,
    (first, last): &mut SurfaceRange,
    (one, lens): (bool, &Lens),
) {
    let count = lens.surfaces.len();
    let number = |ui: &mut Ui, name: String, value: &mut usize| {
        let mut shown = *value + 1;
        let drag = DragValue::new(&mut shown).range(1..=count.max(1)).speed(0.05);
        ui.add(drag).accessible_name(name);
        *value = shown.saturating_sub(1);
    };
    ui.label(if one { "surface" } else { "surfaces" });
    number(ui, format!("First surface of the {what}"), first);
    if one {
        *last = *first;
        return;
    }
    *last = (*last).max(*first);
    ui.label("to");
    number(ui, format!("Last surface of the {what}"), last);
    *last = (*last).max(*first);
}

/// The parts that can be adjusted, those of the lens at surfaces.
pub(super) const ADJUSTED: [AdjustedPart; 10] = {
    use PerturbationKind as Kind;
    const fn at(kind: Kind) -> AdjustedPart {
        AdjustedPart::Lens(Perturbation { kind, first: 0, last: 0 })
    }
    [
        AdjustedPart::SensorTiltX,
        AdjustedPart::SensorTiltY,
        at(Kind::Thickness),
        at(Kind::ThicknessAdjusted),
        at(Kind::SurfaceDecenterX),
        at(Kind::SurfaceDecenterY),
        at(Kind::ElementDecenterX),
        at(Kind::ElementDecenterY),
        at(Kind::ElementTiltX),
        at(Kind::ElementTiltY),
    ]
};

/// The choices of parts that can be adjusted, by their places in [`ADJUSTED`].
pub(super) fn adjusted_choices() -> [(usize, &'static str); 10] {
    std::array::from_fn(|i| (i, travel_name(ADJUSTED[i])))
}
