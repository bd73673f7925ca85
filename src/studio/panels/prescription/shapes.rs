//! Features of a surface beyond a sphere and a glass: asphere terms, an obstruction, a gradient.

use egui::{Button, Ui};

use crate::lens::{ASPHERE_TERMS, Edit, GradientIndex, Lens, Medium, ProfileLaw};
use crate::studio::actions::Actions;
use crate::studio::panels::widgets::hint_beside;

/// The radius of a new obstruction, relative to the semi-diameter.
const OBSTRUCTED: f64 = 0.25;

/// The part of the menu of a row that adds what the surface does not have yet, and removes it.
pub(super) fn menu(
    ui: &mut Ui,
    lens: &Lens,
    surface: usize,
    clear: Option<f64>,
    actions: &mut Actions,
) {
    ui.separator();
    for (title, hint, edit) in choices(lens, surface, clear) {
        let item = ui.add_enabled(edit.is_some(), Button::new(title));
        if hint_beside(item, hint).clicked() {
            actions.extend(edit);
            ui.close();
        }
    }
}

type Choice = (&'static str, &'static str, Option<Edit>);

fn choices(lens: &Lens, surface: usize, clear: Option<f64>) -> [Choice; 6] {
    let row = &lens.surfaces[surface];
    let terms = row.asphere.len();
    let mut more = row.asphere.clone();
    more.push(0.0);
    let more = Edit::SetAsphere { surface, terms: more };
    let none = Edit::SetAsphere { surface, terms: Vec::new() };
    let size = row.semi_diameter.or(clear).unwrap_or(1.0);
    let block = |value| Edit::SetObstruction { surface, value };
    [
        (
            "Add an asphere term",
            "Add a column for the next coefficient of r⁴, r⁶, … r¹⁶, which begins at 0",
            (terms < ASPHERE_TERMS).then_some(more),
        ),
        ("Remove the asphere", "Make it a conic again", (terms > 0).then_some(none)),
        (
            "Add an obstruction",
            "Block the light near the axis: a central obstruction, or the hole of a mirror",
            row.obstruction.is_none().then(|| block(Some(OBSTRUCTED * size))),
        ),
        (
            "Remove the obstruction",
            "Let the light near the axis through",
            row.obstruction.map(|_| block(None)),
        ),
        (
            "Make the glass a gradient",
            "Add coefficients of r² and z, which begin at 0, to the glass behind the surface",
            gradient(&row.medium).map(|medium| Edit::SetMedium { surface, medium }),
        ),
        (
            "Remove the gradient",
            "Keep its base glass alone",
            match &row.medium {
                Medium::Grin(grin) => Some(Edit::SetMedium { surface, medium: grin.base.clone() }),
                _ => None,
            },
        ),
    ]
}

/// A gradient on a glass, still without any change of its index.
fn gradient(glass: &Medium) -> Option<Medium> {
    match glass {
        Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) => {
            let (radial, axial) = (vec![0.0], vec![0.0]);
            let base = glass.clone();
            let gradient = GradientIndex { base, law: ProfileLaw::Index, radial, axial };
            Some(Medium::Grin(Box::new(gradient)))
        }
        Medium::Air | Medium::Mirror | Medium::Grin(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{apply_edit, blank};

    /// The lens after the choice with a title.
    fn chosen(lens: &Lens, title: &str) -> Lens {
        let choice = choices(lens, 0, Some(8.0)).into_iter().find(|choice| choice.0 == title);
        apply_edit(lens, &choice.unwrap().2.unwrap()).unwrap()
    }

    #[test]
    fn a_surface_gets_terms_obstruction_and_gradient_and_loses_them_again() {
        let plain = blank();
        for (add, remove) in [
            ("Add an asphere term", "Remove the asphere"),
            ("Add an obstruction", "Remove the obstruction"),
            ("Make the glass a gradient", "Remove the gradient"),
        ] {
            let changed = chosen(&plain, add);
            assert_ne!(changed, plain, "{add}");
            assert_eq!(chosen(&changed, remove), plain, "{remove}");
        }
    }
}
