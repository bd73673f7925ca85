//! The badge of a number: fixed, variable, picked up from another number, or solved.

use egui::{
    Button, Color32, CornerRadius, Popup, PopupCloseBehavior, Response, RichText, Role, Sense, Ui,
    Visuals, WidgetInfo, vec2,
};

use super::badge_menu::StatusMenu;
use super::columns::parameter_name;
use crate::lens::{Edit, Lens, Parameter, Pickup, Quantity, Variable};
use crate::studio::actions::Actions;
use crate::studio::text_input::EditBuffers;

/// The width of a badge, in points.
pub(super) const WIDTH: f32 = 18.0;
/// The part of it at the right that stays free.
pub(super) const GAP: f32 = 2.0;

/// The status of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ParameterStatus {
    Fixed,
    /// A semi-diameter that follows the rays and clips nothing.
    Automatic,
    /// A semi-diameter that a person has fixed; it clips.
    Clipping,
    Variable(Variable),
    Pickup(Pickup),
    ImageSolve(f64),
}

impl ParameterStatus {
    /// The status of a number of a lens.
    pub(super) fn of(lens: &Lens, parameter: Parameter) -> Self {
        let last = parameter.surface + 1 == lens.surfaces.len();
        let is_gap = parameter.quantity == Quantity::Thickness;
        if let Some(offset) = lens.image_solve.filter(|_| last && is_gap) {
            return Self::ImageSolve(offset);
        }
        if let Some(pickup) = lens.pickups.iter().find(|p| p.parameter == parameter) {
            return Self::Pickup(*pickup);
        }
        if let Some(variable) = lens.variable(parameter) {
            return Self::Variable(*variable);
        }
        match parameter.quantity {
            Quantity::SemiDiameter if lens.get(parameter).is_none() => Self::Automatic,
            Quantity::SemiDiameter => Self::Clipping,
            _ => Self::Fixed,
        }
    }

    const fn letter(self) -> &'static str {
        match self {
            Self::Fixed | Self::Automatic => "·",
            Self::Clipping => "U",
            Self::Variable(_) => "V",
            Self::Pickup(_) => "P",
            Self::ImageSolve(_) => "S",
        }
    }

    /// The status in a word, for a reader of the screen.
    const fn word(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Automatic => "automatic",
            Self::Clipping => "fixed, clips",
            Self::Variable(_) => "variable",
            Self::Pickup(_) => "picked up",
            Self::ImageSolve(_) => "solved",
        }
    }

    fn hint(self) -> String {
        match self {
            Self::Fixed => "Fixed. Click to make it variable (Ctrl+Shift+V).".into(),
            Self::Automatic => {
                "Automatic: it follows the rays of all fields and zoom positions, and \
                                clips nothing. Click for the choices."
                    .into()
            }
            Self::Clipping => "Fixed: rays beyond it are clipped. Click to make it variable, \
                               right-click to make it automatic."
                .into(),
            Self::Variable(_) => "Variable. Click to fix it; right-click for bounds.".into(),
            Self::Pickup(p) => format!("Pickup: it follows the {}.", p.source),
            Self::ImageSolve(_) => "Paraxial image solve. Click to change it.".into(),
        }
    }
}

/// Shows the badge beside a number. A click varies or fixes the number, or opens the menu if it is
/// picked up, solved or automatic; a right click always opens the menu. `clear` is the
/// semi-diameter that the rays need.
pub(super) fn show(
    ui: &mut Ui,
    lens: &Lens,
    parameter: Parameter,
    clear: Option<f64>,
    buffers: &mut EditBuffers,
    actions: &mut Actions,
) {
    let decides = ParameterStatus::of(lens, parameter);
    let name = format!("{} variable", parameter_name(parameter));
    let button = badge(ui, decides, Sense::CLICK).accessible_name(name);
    let simple = matches!(
        decides,
        ParameterStatus::Fixed | ParameterStatus::Clipping | ParameterStatus::Variable(_)
    );
    if simple && button.clicked() {
        actions.push(toggle_edit(decides, parameter));
    }
    let menu = StatusMenu { lens, parameter, status: decides, clear };
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

/// Shows the badge of a number that cannot be edited now; `name` is that of its cell.
pub(super) fn show_fixed(ui: &mut Ui, lens: &Lens, parameter: Parameter, name: &str) {
    let status = ParameterStatus::of(lens, parameter);
    let shown = badge(ui, status, Sense::hover());
    let name = format!("Badge of {name}: {}", status.word());
    shown.widget_info(|| WidgetInfo::labeled(Role::Label, true, &name));
}

fn badge(ui: &mut Ui, decides: ParameterStatus, sense: Sense) -> Response {
    let visuals = ui.visuals();
    let (fill, text) = match decides {
        ParameterStatus::Fixed | ParameterStatus::Automatic => {
            (Color32::TRANSPARENT, visuals.weak_text_color())
        }
        ParameterStatus::Variable(_) => (accent(visuals), Color32::WHITE),
        ParameterStatus::Clipping | ParameterStatus::Pickup(_) | ParameterStatus::ImageSolve(_) => {
            (visuals.widgets.inactive.bg_fill, visuals.strong_text_color())
        }
    };
    let letter = RichText::new(decides.letter()).small().strong().color(text);
    let button = Button::new(letter)
        .small()
        .fill(fill)
        .corner_radius(CornerRadius::same(3))
        // Tab goes from number to number.
        .sense(sense);
    ui.spacing_mut().button_padding = vec2(0.0, 0.0);
    ui.add_sized(vec2(WIDTH - GAP, 16.0), button)
}

/// Dark enough for white letters on dark and on light.
fn accent(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(40, 92, 160) } else { Color32::from_rgb(40, 104, 196) }
}
