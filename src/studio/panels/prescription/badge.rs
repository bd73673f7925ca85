//! The badge of a number: fixed, variable, picked up from another number, or solved.

use egui::{
    Align, Button, Color32, CornerRadius, Id, Popup, PopupCloseBehavior, Response, RichText, Sense,
    Ui, Visuals, vec2,
};

use crate::lens::{Edit, Lens, Parameter, Pickup, Quantity, Variable};
use crate::math::expression::evaluate;
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput};

/// The width of a badge, in points.
pub(super) const WIDTH: f32 = 18.0;

/// The status of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ParameterStatus {
    Fixed,
    Variable(Variable),
    Pickup(Pickup),
    ImageSolve(f64),
}

impl ParameterStatus {
    /// The status of a number of a lens.
    pub(super) fn of(lens: &Lens, parameter: Parameter) -> Self {
        let last = parameter.surface + 1 == lens.surfaces.len();
        let gap = matches!(parameter.quantity, Quantity::Thickness | Quantity::ZoomThickness(_));
        if let Some(offset) = lens.image_solve.filter(|_| last && gap) {
            return Self::ImageSolve(offset);
        }
        if let Some(pickup) = lens.pickups.iter().find(|p| p.parameter == parameter) {
            return Self::Pickup(*pickup);
        }
        lens.variable(parameter).map_or(Self::Fixed, |variable| Self::Variable(*variable))
    }

    const fn letter(self) -> &'static str {
        match self {
            Self::Fixed => "·",
            Self::Variable(_) => "V",
            Self::Pickup(_) => "P",
            Self::ImageSolve(_) => "S",
        }
    }

    fn hint(self) -> String {
        match self {
            Self::Fixed => "Fixed. Click to make it variable (Ctrl+Shift+V).".into(),
            Self::Variable(_) => "Variable. Click to fix it; right-click for bounds.".into(),
            Self::Pickup(p) => format!("Pickup: it follows the {}.", p.source),
            Self::ImageSolve(_) => "Paraxial image solve. Click to change it.".into(),
        }
    }
}

/// Shows the badge beside a number. A click varies or fixes the number, or opens the menu if it is
/// picked up or solved; a right click always opens the menu.
pub(super) fn show(
    ui: &mut Ui,
    lens: &Lens,
    parameter: Parameter,
    buffers: &mut EditBuffers,
    actions: &mut Actions,
) {
    let decides = ParameterStatus::of(lens, parameter);
    let name = format!("{} variable", super::table::parameter_name(parameter));
    let button = badge(ui, decides).accessible_name(name);
    let simple = matches!(decides, ParameterStatus::Fixed | ParameterStatus::Variable(_));
    if simple && button.clicked() {
        actions.push(toggle_edit(decides, parameter));
    }
    let menu = StatusMenu { lens, parameter, status: decides };
    let popup = if simple { Popup::context_menu(&button) } else { Popup::menu(&button) };
    popup
        .close_behavior(PopupCloseBehavior::CloseOnClickOutside)
        .show(|ui| menu.ui(ui, buffers, actions));
    button.on_hover_text(decides.hint());
}

/// The edit that makes a fixed number variable, and a variable fixed.
pub(super) fn toggle_edit(decides: ParameterStatus, parameter: Parameter) -> Edit {
    match decides {
        ParameterStatus::Variable(_) => Edit::RemoveVariable(parameter),
        _ => Edit::AddVariable(Variable { parameter, min: None, max: None }),
    }
}

fn badge(ui: &mut Ui, decides: ParameterStatus) -> Response {
    let visuals = ui.visuals();
    let (fill, text) = match decides {
        ParameterStatus::Fixed => (Color32::TRANSPARENT, visuals.weak_text_color()),
        ParameterStatus::Variable(_) => (accent(visuals), Color32::WHITE),
        ParameterStatus::Pickup(_) | ParameterStatus::ImageSolve(_) => {
            (visuals.widgets.inactive.bg_fill, visuals.strong_text_color())
        }
    };
    let letter = RichText::new(decides.letter()).small().strong().color(text);
    let button = Button::new(letter)
        .small()
        .fill(fill)
        .corner_radius(CornerRadius::same(3))
        // Tab goes from number to number.
        .sense(Sense::CLICK);
    ui.spacing_mut().button_padding = vec2(0.0, 0.0);
    ui.add_sized(vec2(WIDTH - 2.0, 16.0), button)
}

/// Dark enough for white letters on dark and on light.
fn accent(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(40, 92, 160) } else { Color32::from_rgb(40, 104, 196) }
}

/// The menu of a badge.
struct StatusMenu<'a> {
    lens: &'a Lens,
    parameter: Parameter,
    status: ParameterStatus,
}

impl StatusMenu<'_> {
    fn ui(&self, ui: &mut Ui, buffers: &mut EditBuffers, actions: &mut Actions) {
        ui.set_width(210.0);
        ui.strong(super::table::parameter_name(self.parameter));
        self.choices(ui, actions);
        match self.status {
            ParameterStatus::Variable(variable) => {
                self.bounds_lines(ui, variable, buffers, actions);
            }
            ParameterStatus::Pickup(pickup) => self.pickup_lines(ui, pickup, buffers, actions),
            ParameterStatus::ImageSolve(offset) => self.offset_line(ui, offset, buffers, actions),
            ParameterStatus::Fixed => {}
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
        let mut freed = self.release_edits();
        freed.push(free);
        choice(ui, decides == ParameterStatus::Fixed, "Fixed", self.release_edits());
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
            ParameterStatus::Fixed => Vec::new(),
            ParameterStatus::Variable(_) => vec![Edit::RemoveVariable(self.parameter)],
            ParameterStatus::Pickup(_) => vec![Edit::RemovePickup(self.parameter)],
            ParameterStatus::ImageSolve(_) => vec![Edit::SetImageSolve(None)],
        }
    }

    /// A pickup from the same number of the row before, scaled so that the value is unchanged if
    /// possible.
    fn new_pickup(&self) -> Option<Pickup> {
        let Parameter { surface, quantity } = self.parameter;
        let other = if surface == 0 { 1 } else { surface - 1 };
        let source = Parameter::new(other, quantity);
        let (own, theirs) = (self.lens.get(self.parameter)?, self.lens.get(source)?);
        let scale = if theirs == 0.0 || own == 0.0 { 1.0 } else { own / theirs };
        Some(Pickup { parameter: self.parameter, source, scale, offset: 0.0 })
    }

    fn is_last_gap(&self) -> bool {
        self.parameter.quantity == Quantity::Thickness
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
        let unit = match self.parameter.quantity {
            Quantity::Curvature => "curvature, 1/mm",
            Quantity::Thickness | Quantity::ZoomThickness(_) | Quantity::SemiDiameter => "mm",
            Quantity::Conic | Quantity::Asphere(_) | Quantity::Index | Quantity::Grin(_) => {
                "number"
            }
        };
        ui.weak(format!("Bounds, {unit}; empty for none"));
        let limit = |text: &str| {
            if text.trim().is_empty() { Some(None) } else { parse_value(text).map(Some) }
        };
        if let Some(min) = self.number_line(ui, "Minimum", variable.min, buffers, limit) {
            actions.push(Edit::AddVariable(Variable { min, ..variable }));
        }
        if let Some(max) = self.number_line(ui, "Maximum", variable.max, buffers, limit) {
            actions.push(Edit::AddVariable(Variable { max, ..variable }));
        }
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

fn parse_value(text: &str) -> Option<f64> {
    evaluate(text, 0.0).ok().filter(|value| value.is_finite())
}
