//! The menu of a badge: fixed, variable with bounds, picked up or solved.

use egui::{Align, Id, Ui};

use super::badge::ParameterStatus;
use super::columns::parameter_name;
use super::radius_bounds::{curvature_bounds, describe, radius_bounds};
use crate::lens::{Edit, Lens, Parameter, Pickup, Quantity, Variable};
use crate::math::expression::evaluate;
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput};

/// The menu of a badge.
pub(super) struct StatusMenu<'a> {
    pub(super) lens: &'a Lens,
    pub(super) parameter: Parameter,
    pub(super) status: ParameterStatus,
    /// The semi-diameter that the rays need, in mm.
    pub(super) clear: Option<f64>,
}

impl StatusMenu<'_> {
    pub(super) fn ui(&self, ui: &mut Ui, buffers: &mut EditBuffers, actions: &mut Actions) {
        ui.set_width(210.0);
        ui.strong(parameter_name(self.parameter));
        self.choices(ui, actions);
        match self.status {
            ParameterStatus::Variable(variable) => {
                self.bounds_lines(ui, variable, buffers, actions);
            }
            ParameterStatus::Pickup(pickup) => self.pickup_lines(ui, pickup, buffers, actions),
            ParameterStatus::ImageSolve(offset) => self.offset_line(ui, offset, buffers, actions),
            ParameterStatus::Fixed | ParameterStatus::Automatic | ParameterStatus::Clipping => {}
        }
    }

    fn choices(&self, ui: &mut Ui, actions: &mut Actions) {
        let decides = self.status;
        let mut choice = |ui: &mut Ui, on: bool, text: &str, edits: Vec<Edit>| {
            if ui.selectable_label(on, text).clicked() && !on {
                actions.extend(edits);
                ui.close();
            }
        };
        let free = Edit::AddVariable(Variable { parameter: self.parameter, min: None, max: None });
        let mut fixed = self.release_edits();
        if decides == ParameterStatus::Automatic {
            let surface = self.parameter.surface;
            fixed.extend(
                self.clear.map(|size| Edit::SetSemiDiameter { surface, value: Some(size) }),
            );
        }
        let mut freed = fixed.clone();
        freed.push(free);
        if self.parameter.quantity == Quantity::SemiDiameter && self.parameter.zoom.is_none() {
            let edit = Edit::SetSemiDiameter { surface: self.parameter.surface, value: None };
            let on = decides == ParameterStatus::Automatic;
            choice(ui, on, "Automatic: follows the rays, clips nothing", vec![edit]);
        }
        let on = matches!(decides, ParameterStatus::Fixed | ParameterStatus::Clipping);
        let rim = self.parameter.quantity == Quantity::SemiDiameter;
        choice(ui, on, if rim { "Fixed: clips" } else { "Fixed" }, fixed);
        if decides == ParameterStatus::Automatic && self.clear.is_none() {
            return;
        }
        choice(ui, matches!(decides, ParameterStatus::Variable(_)), "Variable", freed);
        if let Some(pickup) = self.new_pickup() {
            let edits = vec![Edit::SetPickup(pickup)];
            choice(ui, matches!(decides, ParameterStatus::Pickup(_)), "Pickup", edits);
        }
        if self.is_last_gap() {
            let edits = vec![Edit::SetImageSolve(Some(0.0))];
            choice(
                ui,
                matches!(decides, ParameterStatus::ImageSolve(_)),
                "Solve: paraxial image",
                edits,
            );
        }
    }

    /// The edits that make the number fixed.
    fn release_edits(&self) -> Vec<Edit> {
        match self.status {
            ParameterStatus::Fixed | ParameterStatus::Automatic | ParameterStatus::Clipping => {
                Vec::new()
            }
            ParameterStatus::Variable(_) => vec![Edit::RemoveVariable(self.parameter)],
            ParameterStatus::Pickup(_) => vec![Edit::RemovePickup(self.parameter)],
            ParameterStatus::ImageSolve(_) => vec![Edit::SetImageSolve(None)],
        }
    }

    /// A pickup from the same number of the row before, scaled so that the value is unchanged if
    /// possible.
    fn new_pickup(&self) -> Option<Pickup> {
        let surface = self.parameter.surface;
        let other = if surface == 0 { 1 } else { surface - 1 };
        let source = Parameter { surface: other, ..self.parameter };
        let (own, theirs) = (self.lens.get(self.parameter)?, self.lens.get(source)?);
        let scale = if theirs == 0.0 || own == 0.0 { 1.0 } else { own / theirs };
        Some(Pickup { parameter: self.parameter, source, scale, offset: 0.0 })
    }

    fn is_last_gap(&self) -> bool {
        self.parameter.quantity == Quantity::Thickness
            && self.parameter.zoom.is_none()
            && self.parameter.surface + 1 == self.lens.surfaces.len()
    }

    fn bounds_lines(
        &self,
        ui: &mut Ui,
        variable: Variable,
        buffers: &mut EditBuffers,
        actions: &mut Actions,
    ) {
        ui.separator();
        if self.parameter.quantity == Quantity::Curvature {
            return self.radius_bounds_lines(ui, variable, buffers, actions);
        }
        let unit = match self.parameter.quantity {
            Quantity::Thickness | Quantity::SemiDiameter => "mm",
            _ => "number",
        };
        ui.weak(format!("Bounds, {unit}; empty for none"));
        if let Some(min) = self.number_line(ui, "Minimum", variable.min, buffers, parse_bound) {
            actions.push(Edit::AddVariable(Variable { min, ..variable }));
        }
        if let Some(max) = self.number_line(ui, "Maximum", variable.max, buffers, parse_bound) {
            actions.push(Edit::AddVariable(Variable { max, ..variable }));
        }
    }

    /// Bounds of a curvature are asked as radii, as the cell shows it.
    fn radius_bounds_lines(
        &self,
        ui: &mut Ui,
        variable: Variable,
        buffers: &mut EditBuffers,
        actions: &mut Actions,
    ) {
        ui.weak("Bounds of the radius, mm; empty for none");
        let bounds = [variable.min, variable.max];
        let radii = radius_bounds(bounds);
        for (i, name) in ["Minimum", "Maximum"].into_iter().enumerate() {
            let read = |text: &str| parse_bound(text).filter(|radius| *radius != Some(0.0));
            if let Some(radius) = self.number_line(ui, name, radii[i], buffers, read) {
                let mut radii = radii;
                radii[i] = radius;
                // A new bound on the other side of the old one replaces it.
                if let [Some(low), Some(high)] = radii
                    && low > high
                {
                    radii[1 - i] = None;
                }
                let [min, max] = curvature_bounds(radii);
                actions.push(Edit::AddVariable(Variable { min, max, ..variable }));
            }
        }
        ui.weak(format!("Allowed: {}", describe(bounds)));
    }

    fn pickup_lines(
        &self,
        ui: &mut Ui,
        pickup: Pickup,
        buffers: &mut EditBuffers,
        actions: &mut Actions,
    ) {
        ui.separator();
        let row = |text: &str| text.trim().parse().ok().filter(|n| (1..=1000).contains(n));
        let surface = Some((pickup.source.surface + 1) as f64);
        let mut set = |pickup: Pickup| actions.push(Edit::SetPickup(pickup));
        if let Some(number) = self.number_line(ui, "From surface", surface, buffers, row) {
            let number: usize = number;
            set(Pickup { source: Parameter { surface: number - 1, ..pickup.source }, ..pickup });
        }
        if let Some(scale) = self.number_line(ui, "Scale", Some(pickup.scale), buffers, parse_value)
        {
            set(Pickup { scale, ..pickup });
        }
        if let Some(offset) =
            self.number_line(ui, "Offset", Some(pickup.offset), buffers, parse_value)
        {
            set(Pickup { offset, ..pickup });
        }
    }

    fn offset_line(
        &self,
        ui: &mut Ui,
        offset: f64,
        buffers: &mut EditBuffers,
        actions: &mut Actions,
    ) {
        ui.separator();
        if let Some(offset) =
            self.number_line(ui, "Displaced by, mm", Some(offset), buffers, parse_value)
        {
            actions.push(Edit::SetImageSolve(Some(offset)));
        }
    }

    /// A name and a field; gives the value once one is typed that `read` understands.
    fn number_line<T>(
        &self,
        ui: &mut Ui,
        name: &str,
        shown: Option<f64>,
        buffers: &mut EditBuffers,
        read: impl Fn(&str) -> Option<T>,
    ) -> Option<T> {
        let id = Id::unique((self.parameter, name));
        let shown = shown.map(number::format_number).unwrap_or_default();
        let entry = ui.horizontal(|ui| {
            ui.label(name);
            let field = TextInput {
                name,
                value: &shown,
                hint: "none",
                align: Align::Max,
                placement: InputPlacement::Form,
            };
            buffers.show(ui, id, field)
        });
        let text = entry.inner.submitted?;
        let read = read(&text);
        match read {
            Some(_) => buffers.accept(id),
            None => buffers.reject(id, format!("`{text}` is not a valid number here")),
        }
        read
    }
}

/// A bound; nothing typed is none.
#[expect(clippy::option_option, reason = "none typed is a bound that is absent, not a wrong one")]
fn parse_bound(text: &str) -> Option<Option<f64>> {
    if text.trim().is_empty() { Some(None) } else { parse_value(text).map(Some) }
}

fn parse_value(text: &str) -> Option<f64> {
    evaluate(text, 0.0).ok().filter(|value| value.is_finite())
}
