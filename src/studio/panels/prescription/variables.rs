//! Freeing and fixing many numbers at once.

use eframe::egui::Ui;

use crate::lens::{Lens, Medium, Parameter, Quantity, Variable};
use crate::session::{Command, Edit};

/// How many numbers are variable, with a menu to free or fix many at once, as one undo step.
pub(super) fn menu(ui: &mut Ui, lens: &Lens, wishes: &mut Vec<Command>) {
    let count = lens.variables.len();
    let text = if count == 1 { "1 variable".to_owned() } else { format!("{count} variables") };
    let button = ui.menu_button(text, |ui| {
        let choices: [(&str, Vec<Variable>); 4] = [
            ("Free every radius", with(lens, radii(lens))),
            ("Free every thickness", with(lens, thicknesses(lens, |_| true))),
            ("Free every air gap", with(lens, thicknesses(lens, |m| *m == Medium::Air))),
            ("Fix everything", Vec::new()),
        ];
        for (title, variables) in choices {
            if ui.button(title).clicked() {
                wishes.push(Edit::SetVariables(variables).into());
                ui.close();
            }
        }
    });
    button.response.on_hover_text(
        "Numbers with the badge V are what the optimizer may change. \
         Press the badge beside a number to free or fix it alone.",
    );
}

/// The variables of a lens and some more.
fn with(lens: &Lens, more: impl Iterator<Item = Parameter>) -> Vec<Variable> {
    let mut variables = lens.variables.clone();
    for parameter in more {
        let taken = lens.pickups.iter().any(|pickup| pickup.parameter == parameter);
        if !taken && variables.iter().all(|variable| variable.parameter != parameter) {
            variables.push(Variable { parameter, min: None, max: None });
        }
    }
    variables
}

/// The curvatures that do something: those of mirrors and of surfaces between two media.
fn radii(lens: &Lens) -> impl Iterator<Item = Parameter> {
    let before =
        |i: usize| i.checked_sub(1).map_or(&lens.object_medium, |i| &lens.surfaces[i].medium);
    let acts = move |i: &usize| {
        let behind = &lens.surfaces[*i].medium;
        *behind == Medium::Mirror || before(*i) != behind
    };
    let surfaces = (0..lens.surfaces.len()).filter(acts);
    surfaces.map(|surface| Parameter::new(surface, Quantity::Curvature))
}

/// The gaps that nothing else decides.
fn thicknesses(lens: &Lens, of: impl Fn(&Medium) -> bool) -> impl Iterator<Item = Parameter> {
    let free = if lens.focus.is_some() { lens.surfaces.len() - 1 } else { lens.surfaces.len() };
    let gaps = (0..free).filter(move |i| of(&lens.surfaces[*i].medium));
    gaps.map(|surface| Parameter::new(surface, Quantity::Thickness))
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
        let variables = with(&lens, radii(&lens));
        assert_eq!(variables[0], kept);
        assert_eq!(variables.len(), lens.surfaces.len() - 1, "all but the stop in air");
        assert!(variables.iter().all(|variable| variable.parameter.surface != stop));
        let gaps = thicknesses(&lens, |_| true).count();
        assert_eq!(gaps, lens.surfaces.len());
    }
}
