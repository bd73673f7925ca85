//! Freeing and fixing many numbers at once.

use eframe::egui::{Button, Ui};

use crate::lens::{Lens, Medium, NumberKind, Parameter, Quantity, Variable};
use crate::session::{Command, Edit};
use crate::studio::panels::freed;

/// What can be freed at once.
const KINDS: [(&str, NumberKind); 7] = [
    ("Free every radius", NumberKind::Curvatures),
    ("Free every thickness", NumberKind::Thicknesses),
    ("Free every semi-diameter", NumberKind::SemiDiameters),
    ("Free every conic constant that is not 0", NumberKind::Conics),
    ("Free every asphere coefficient", NumberKind::Aspheres),
    ("Free every index that is no catalogue glass's", NumberKind::Indices),
    ("Free every gradient coefficient", NumberKind::Gradients),
];

/// How many numbers are variable, with a menu to free or fix many at once, as one undo step.
pub(super) fn menu(ui: &mut Ui, lens: &Lens, wishes: &mut Vec<Command>) {
    let count = lens.variables.len();
    let text = if count == 1 { "1 variable".to_owned() } else { format!("{count} variables") };
    let button = ui.menu_button(text, |ui| {
        let freeing = KINDS.iter().map(|(title, kind)| (*title, freed(lens, &[*kind])));
        let mut choices: Vec<(&str, Edit)> = freeing.collect();
        choices.insert(2, ("Free every air gap", air_gaps(lens)));
        choices.push(("Fix every semi-diameter", fixed(lens, Quantity::SemiDiameter)));
        choices.push(("Fix everything", Edit::SetVariables(Vec::new())));
        let now = Edit::SetVariables(lens.variables.clone());
        for (title, edit) in choices {
            if ui.add_enabled(edit != now, Button::new(title)).clicked() {
                wishes.push(edit.into());
                ui.close();
            }
        }
    });
    button.response.on_hover_text(
        "Numbers with the badge V are what the optimizer may change. \
         Press the badge beside a number to free or fix it alone.",
    );
}

/// Frees the gaps without glass and leaves the others as they are.
fn air_gaps(lens: &Lens) -> Edit {
    let mut edit = freed(lens, &[NumberKind::Thicknesses]);
    if let Edit::SetVariables(variables) = &mut edit {
        let in_air = |parameter: Parameter| lens.surfaces[parameter.surface].medium == Medium::Air;
        let before = |parameter: Parameter| lens.variable(parameter).is_some();
        variables.retain(|v| before(v.parameter) || in_air(v.parameter));
    }
    edit
}

/// Fixes every number of a kind.
fn fixed(lens: &Lens, quantity: Quantity) -> Edit {
    let other = |v: &&Variable| v.parameter.quantity != quantity;
    Edit::SetVariables(lens.variables.iter().filter(other).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;

    #[test]
    fn freeing_leaves_what_is_free_and_adds_what_acts() {
        let bundled = &files::library()[0];
        let mut lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let stop = lens.stop().unwrap();
        lens.variables.truncate(1);
        let kept = lens.variables[0];
        let variables = |edit| if let Edit::SetVariables(all) = edit { all } else { Vec::new() };
        let radii = variables(freed(&lens, &[NumberKind::Curvatures]));
        assert_eq!(radii[0], kept);
        assert_eq!(radii.len(), lens.surfaces.len() - 1, "all but the stop in air");
        assert!(radii.iter().all(|variable| variable.parameter.surface != stop));
        let air = lens.surfaces.iter().filter(|row| row.medium == Medium::Air).count();
        assert_eq!(variables(air_gaps(&lens)).len(), 1 + air);
        let rims = freed(&lens, &[NumberKind::SemiDiameters]);
        assert_eq!(variables(rims).len(), 1 + lens.surfaces.len());
        assert_eq!(variables(fixed(&lens, Quantity::Curvature)).len(), 0);
    }
}
