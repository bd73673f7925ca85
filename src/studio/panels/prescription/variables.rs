//! Adding and removing many variables at once.

use egui::{Button, Ui};

use crate::lens::{Edit, Lens, Medium, Parameter, ParameterKind, Quantity, Variable};
use crate::studio::actions::Actions;
use crate::studio::panels::add_variables_edit;

/// The kinds of numbers that can be made variable at once.
const KINDS: [(&str, ParameterKind); 7] = [
    ("Vary all radii", ParameterKind::Curvatures),
    ("Vary all thicknesses", ParameterKind::Thicknesses),
    ("Vary all semi-diameters", ParameterKind::SemiDiameters),
    ("Vary all nonzero conic constants", ParameterKind::Conics),
    ("Vary all asphere coefficients", ParameterKind::Aspheres),
    ("Vary all indices except those of catalogue glasses", ParameterKind::Indices),
    ("Vary all GRIN coefficients", ParameterKind::GrinCoefficients),
];

/// The number of variables, with a menu to add or remove many at once, as one undo step.
pub(super) fn menu(ui: &mut Ui, lens: &Lens, actions: &mut Actions) {
    let count = lens.variables.len();
    let text = if count == 1 { "1 variable".to_owned() } else { format!("{count} variables") };
    let button = ui.menu_button(text, |ui| {
        let freeing =
            KINDS.iter().map(|(title, kind)| (*title, add_variables_edit(lens, &[*kind])));
        let mut choices: Vec<(&str, Edit)> = freeing.collect();
        choices.insert(2, ("Vary all air gaps", add_air_gaps_edit(lens)));
        choices
            .push(("Fix all semi-diameters", remove_variables_edit(lens, Quantity::SemiDiameter)));
        choices.push(("Fix all", Edit::SetVariables(Vec::new())));
        let now = Edit::SetVariables(lens.variables.clone());
        for (title, edit) in choices {
            if ui.add_enabled(edit != now, Button::new(title)).clicked() {
                actions.push(edit);
                ui.close();
            }
        }
    });
    button.response.on_hover_text(
        "Variables have the badge V. Click the badge beside a number to vary or fix it alone.",
    );
}

/// Adds the air gaps to the variables.
fn add_air_gaps_edit(lens: &Lens) -> Edit {
    let mut edit = add_variables_edit(lens, &[ParameterKind::Thicknesses]);
    if let Edit::SetVariables(variables) = &mut edit {
        let in_air = |parameter: Parameter| lens.surfaces[parameter.surface].medium == Medium::Air;
        let before = |parameter: Parameter| lens.variable(parameter).is_some();
        variables.retain(|v| before(v.parameter) || in_air(v.parameter));
    }
    edit
}

/// Fixes every number of a kind.
fn remove_variables_edit(lens: &Lens, quantity: Quantity) -> Edit {
    let other = |v: &&Variable| v.parameter.quantity != quantity;
    Edit::SetVariables(lens.variables.iter().filter(other).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;

    #[test]
    fn freeing_leaves_what_is_free_and_adds_what_acts() {
        let bundled = &files::bundled_lenses()[0];
        let mut lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let stop = lens.stop().unwrap();
        lens.variables.truncate(1);
        let first = lens.variables[0];
        let variables = |edit| if let Edit::SetVariables(all) = edit { all } else { Vec::new() };
        let radii = variables(add_variables_edit(&lens, &[ParameterKind::Curvatures]));
        assert_eq!(radii[0], first);
        assert_eq!(radii.len(), lens.surfaces.len() - 1, "all but the stop in air");
        assert!(radii.iter().all(|variable| variable.parameter.surface != stop));
        let air = lens.surfaces.iter().filter(|row| row.medium == Medium::Air).count();
        assert_eq!(variables(add_air_gaps_edit(&lens)).len(), 1 + air);
        let semi_diameters = add_variables_edit(&lens, &[ParameterKind::SemiDiameters]);
        assert_eq!(variables(semi_diameters).len(), 1 + lens.surfaces.len());
        assert_eq!(variables(remove_variables_edit(&lens, Quantity::Curvature)).len(), 0);
    }
}
