//! The part of the lens to which a term applies, and the bounds of an operand.

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Align, Grid, Id, Layout as Arrange, PopupCloseBehavior, Ui, vec2};

use super::merit_editor::{field_width, short_number};
use crate::lens::{IndexRange, Lens, last_index};
use crate::math::expression::evaluate;
use crate::merit::{OperandKind, Term, TermScope, TermSelection, WeightedTerm};
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput};

/// The operands in the groups of a menu.
pub(super) const GROUPS: &[(&str, &[OperandKind])] = &[
    ("Gaps and sags", &[OperandKind::Gap, OperandKind::Track, OperandKind::Sag]),
    (
        "Chief rays",
        &[
            OperandKind::ChiefRayHeight,
            OperandKind::Distortion,
            OperandKind::ChiefRayAngle,
            OperandKind::IncidenceAngle,
            OperandKind::Telecentricity,
        ],
    ),
    (
        "Seidel sums",
        &[
            OperandKind::SphericalAberration,
            OperandKind::Coma,
            OperandKind::Astigmatism,
            OperandKind::PetzvalCurvature,
            OperandKind::ThirdOrderDistortion,
        ],
    ),
    (
        "Colour",
        &[OperandKind::AxialColor, OperandKind::SecondarySpectrum, OperandKind::LateralColor],
    ),
    ("Temperature", &[OperandKind::ThermalFocus]),
];

/// The title of an operand.
pub(super) const fn title(kind: OperandKind) -> &'static str {
    match kind {
        OperandKind::Gap => "Gap",
        OperandKind::Track => "Length",
        OperandKind::Sag => "Sag",
        OperandKind::ChiefRayHeight => "Chief-ray height",
        OperandKind::Distortion => "Limited distortion",
        OperandKind::ChiefRayAngle => "Chief-ray angle",
        OperandKind::IncidenceAngle => "Angle of incidence",
        OperandKind::Telecentricity => "Telecentricity",
        OperandKind::SphericalAberration => "Seidel: spherical",
        OperandKind::Coma => "Seidel: coma",
        OperandKind::Astigmatism => "Seidel: astigmatism",
        OperandKind::PetzvalCurvature => "Seidel: Petzval",
        OperandKind::ThirdOrderDistortion => "Seidel: distortion",
        OperandKind::AxialColor => "Axial colour",
        OperandKind::SecondarySpectrum => "Secondary spectrum",
        OperandKind::ThermalFocus => "Thermal focus",
        OperandKind::LateralColor => "Lateral colour",
    }
}

/// The explanation of an operand.
pub(super) const fn hint(kind: OperandKind) -> &'static str {
    match kind {
        OperandKind::Gap => "The thickness of gaps on the axis, of glass and of air",
        OperandKind::Track => {
            "From the first of the chosen surfaces to the vertex behind the last one; from the first \
             surface to the image if none are chosen"
        }
        OperandKind::Sag => "The sag of surfaces at their rims",
        OperandKind::ChiefRayHeight => {
            "The height of the chief rays at the chosen surfaces, or at the image"
        }
        OperandKind::Distortion => {
            "The height of chief rays in the image relative to that without distortion, minus 1, in percent"
        }
        OperandKind::ChiefRayAngle => {
            "The angle between chief rays and the axis behind the chosen surfaces, or in image space"
        }
        OperandKind::IncidenceAngle => "The angle of incidence of the chief rays at surfaces",
        OperandKind::Telecentricity => {
            "The angle between chief rays and the axis in image space: zero for a telecentric lens"
        }
        OperandKind::AxialColor => {
            "From the paraxial image at the longest wavelength to that at the shortest"
        }
        OperandKind::SecondarySpectrum => {
            "From the middle between the paraxial images at the shortest and the longest wavelength to \
             that at the primary one"
        }
        OperandKind::ThermalFocus => {
            "The motion of the paraxial image against the image plane from 0 to 40 °C: glass expands and \
             changes its index, and the mount expands"
        }
        OperandKind::LateralColor => {
            "From the image of a chief ray at the longest wavelength to that at the shortest"
        }
        _ => "The third-order sum of the chosen surfaces, or of the lens",
    }
}

/// Shows the bounds of an operand: an empty field stands for none.
pub(super) fn bounds(ui: &mut Ui, buffers: &mut EditBuffers, title: &str, term: &mut Term) {
    let Term::Operand { min, max, .. } = term else { return };
    for (what, bound) in [("Minimum", min), ("Maximum", max)] {
        let name = format!("{what} of {title}");
        let id = Id::unique(("optimizer", &name));
        let value = bound.map(short_number).unwrap_or_default();
        let hint = if what == "Minimum" { "min" } else { "max" };
        let width = field_width(ui, &value);
        let Some(text) = field(ui, buffers, id, (&name, &value, hint), width) else { continue };
        if text.trim().is_empty() {
            *bound = None;
            buffers.accept(id);
            continue;
        }
        match evaluate(&text, bound.unwrap_or(0.0)) {
            Ok(new) if new.is_finite() => {
                *bound = Some(new);
                buffers.accept(id);
            }
            Ok(new) => buffers.reject(id, format!("{name} is {new}; expected a finite number")),
            Err(why) => buffers.reject(id, why.to_string()),
        }
    }
}

/// Shows a field in a width; the text that was submitted.
fn field(
    ui: &mut Ui,
    buffers: &mut EditBuffers,
    id: Id,
    (name, value, hint): (&str, &str, &str),
    width: f32,
) -> Option<String> {
    let placement = InputPlacement::Form;
    let input = TextInput { name, value, hint, align: Align::Max, placement };
    let layout = Arrange::left_to_right(Align::Center);
    let size = vec2(width, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, layout, |ui| buffers.show(ui, id, input)).inner.submitted
}

/// Shows the part of the lens to which a term applies, as a button with a menu that changes it.
pub(super) fn button(
    ui: &mut Ui,
    buffers: &mut EditBuffers,
    lens: &Lens,
    title: &str,
    weighted: &mut WeightedTerm,
) {
    let image = weighted.term.may_be_at_image();
    let many = |selection: &TermSelection| last_index(lens, *selection, image) > 0;
    let possible: Vec<_> = weighted.term.selections().iter().copied().filter(many).collect();
    if possible.is_empty() && weighted.scope.is_all() {
        return;
    }
    let stay = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let text = text(weighted.scope);
    let (response, _) = MenuButton::new(text).config(stay).ui(ui, |ui| {
        ui.weak("Applies to: 3, or 2-5, or nothing for all");
        Grid::new(("scope", title)).num_columns(2).show(ui, |ui| {
            for selection in possible {
                let last = last_index(lens, selection, image) + 1;
                ui.label(capitalized(selection)).on_hover_text(format!("1 to {last}"));
                range_field(ui, buffers, (title, last), selection, &mut weighted.scope);
                ui.end_row();
            }
        });
    });
    let response = response.accessible_name(format!("Scope of {title}"));
    response.on_hover_text("The surfaces, fields, wavelengths or zoom positions that count");
}

fn range_field(
    ui: &mut Ui,
    buffers: &mut EditBuffers,
    (title, last): (&str, usize),
    selection: TermSelection,
    scope: &mut TermScope,
) {
    let name = format!("{} of {title}", capitalized(selection));
    let id = Id::unique(("scope", &name));
    let value = scope.range(selection).map(range_text).unwrap_or_default();
    let Some(text) = field(ui, buffers, id, (&name, &value, "all"), 80.0) else { return };
    match parse_range(&text, last) {
        Ok(range) => {
            *scope.range_mut(selection) = range;
            buffers.accept(id);
        }
        Err(why) => buffers.reject(id, why),
    }
}

/// The range of a text that counts from 1; `None` for an empty text.
fn parse_range(text: &str, last: usize) -> Result<Option<IndexRange>, String> {
    let refuse =
        || format!("{text} was typed; expected a number from 1 to {last}, or two as 1-{last}");
    if text.trim().is_empty() {
        return Ok(None);
    }
    let (first, end) = text.split_once(['-', '–']).unwrap_or((text, text));
    let number = |part: &str| part.trim().parse::<usize>().ok();
    let ends = number(first).zip(number(end));
    let found = ends.filter(|(first, end)| 1 <= *first && first <= end && *end <= last);
    found.map(|(first, end)| Some([first - 1, end - 1])).ok_or_else(refuse)
}

/// A range as it is displayed, counted from 1.
fn range_text([first, last]: IndexRange) -> String {
    if first == last { (first + 1).to_string() } else { format!("{}-{}", first + 1, last + 1) }
}

/// A scope in few characters: S for surfaces, F for fields, λ for wavelengths, Z for zoom positions.
pub(super) fn text(scope: TermScope) -> String {
    let letter = |selection| match selection {
        TermSelection::Surfaces => "S",
        TermSelection::Fields => "F",
        TermSelection::Wavelengths => "λ",
        TermSelection::Zooms => "Z",
    };
    let part = |selection: TermSelection| {
        scope.range(selection).map(|range| format!("{}{}", letter(selection), range_text(range)))
    };
    let parts: Vec<String> = TermSelection::ALL.into_iter().filter_map(part).collect();
    if parts.is_empty() { "all".to_owned() } else { parts.join(" ") }
}

fn capitalized(selection: TermSelection) -> String {
    crate::studio::text::capitalize(&selection.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operand_is_in_one_group() {
        let grouped = GROUPS.iter().flat_map(|(_, kinds)| kinds.iter().copied());
        assert_eq!(grouped.collect::<Vec<_>>(), OperandKind::ALL);
    }

    #[test]
    fn ranges_are_read_as_they_are_shown() {
        for (typed, range) in [("3", Some([2, 2])), (" 2 - 5", Some([1, 4])), ("", None)] {
            let found = parse_range(typed, 9);
            assert_eq!(found, Ok(range), "{typed}");
            let again = range.map(range_text).unwrap_or_default();
            assert_eq!(parse_range(&again, 9), found);
        }
        for wrong in ["0", "10", "5-2", "a", "1-2-3", "-1"] {
            assert!(parse_range(wrong, 9).is_err(), "{wrong}");
        }
        let scope = TermScope { surfaces: Some([2, 4]), fields: Some([0, 0]), ..TermScope::ALL };
        assert_eq!(text(scope), "S3-5 F1");
    }
}
