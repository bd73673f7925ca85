//! What decides a number: nothing (it is fixed), the optimizer, another number, or a solve.

use eframe::egui::{
    Align, Button, Color32, CornerRadius, Id, Popup, PopupCloseBehavior, Response, RichText, Sense,
    Ui, Visuals, vec2,
};

use crate::lens::{Lens, Parameter, Pickup, Quantity, Variable};
use crate::session::{Command, Edit, evaluate};
use crate::studio::field::{Drafts, Field, Place};
use crate::studio::number;
use crate::studio::wording::counted_from_one;

/// How wide a badge is, in points.
pub(super) const WIDTH: f32 = 18.0;

/// What decides a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Decides {
    Nobody,
    Optimizer(Variable),
    Another(Pickup),
    Focus(f64),
}

impl Decides {
    /// What decides a number of a lens.
    pub(super) fn of(lens: &Lens, parameter: Parameter) -> Self {
        let last = parameter.surface + 1 == lens.surfaces.len();
        let gap = matches!(parameter.quantity, Quantity::Thickness | Quantity::ZoomThickness(_));
        if let Some(offset) = lens.focus.filter(|_| last && gap) {
            return Self::Focus(offset);
        }
        if let Some(pickup) = lens.pickups.iter().find(|p| p.parameter == parameter) {
            return Self::Another(*pickup);
        }
        lens.variable(parameter).map_or(Self::Nobody, |variable| Self::Optimizer(*variable))
    }

    const fn letter(self) -> &'static str {
        match self {
            Self::Nobody => "·",
            Self::Optimizer(_) => "V",
            Self::Another(_) => "P",
            Self::Focus(_) => "S",
        }
    }

    fn hint(self) -> String {
        match self {
            Self::Nobody => "Fixed. Press to let the optimizer change it (Ctrl+Shift+V).".into(),
            Self::Optimizer(_) => "Variable: the optimizer may change it. Press to fix it; \
                                   press the right button for bounds."
                .into(),
            Self::Another(p) => counted_from_one(&format!("Pickup: it follows the {}.", p.source)),
            Self::Focus(_) => "Solved for the paraxial focus. Press to change that.".into(),
        }
    }
}

/// The badge beside a number. A press frees or fixes the number, or opens the menu where something
/// else decides it; the right button always opens the menu.
pub(super) fn show(
    ui: &mut Ui,
    lens: &Lens,
    parameter: Parameter,
    drafts: &mut Drafts,
    wishes: &mut Vec<Command>,
) {
    let decides = Decides::of(lens, parameter);
    let name = format!("{} variable", super::table::name_of(parameter));
    let button = badge(ui, decides).accessible_name(name);
    let simple = matches!(decides, Decides::Nobody | Decides::Optimizer(_));
    if simple && button.clicked() {
        wishes.push(toggled(decides, parameter).into());
    }
    let menu = Menu { lens, parameter, decides };
    let popup = if simple { Popup::context_menu(&button) } else { Popup::menu(&button) };
    popup
        .close_behavior(PopupCloseBehavior::CloseOnClickOutside)
        .show(|ui| menu.ui(ui, drafts, wishes));
    button.on_hover_text(decides.hint());
}

/// The edit that frees a fixed number and fixes a free one.
pub(super) fn toggled(decides: Decides, parameter: Parameter) -> Edit {
    match decides {
        Decides::Optimizer(_) => Edit::Fix(parameter),
        _ => Edit::Free(Variable { parameter, min: None, max: None }),
    }
}

fn badge(ui: &mut Ui, decides: Decides) -> Response {
    let visuals = ui.visuals();
    let (fill, text) = match decides {
        Decides::Nobody => (Color32::TRANSPARENT, visuals.weak_text_color()),
        Decides::Optimizer(_) => (accent(visuals), Color32::WHITE),
        Decides::Another(_) | Decides::Focus(_) => {
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
struct Menu<'a> {
    lens: &'a Lens,
    parameter: Parameter,
    decides: Decides,
}

impl Menu<'_> {
    fn ui(&self, ui: &mut Ui, drafts: &mut Drafts, wishes: &mut Vec<Command>) {
        ui.set_width(210.0);
        ui.strong(super::table::name_of(self.parameter));
        self.choices(ui, wishes);
        match self.decides {
            Decides::Optimizer(variable) => self.bounds(ui, variable, drafts, wishes),
            Decides::Another(pickup) => self.pickup(ui, pickup, drafts, wishes),
            Decides::Focus(offset) => self.offset(ui, offset, drafts, wishes),
            Decides::Nobody => {}
        }
    }

    fn choices(&self, ui: &mut Ui, wishes: &mut Vec<Command>) {
        let decides = self.decides;
        let mut choice = |ui: &mut Ui, on: bool, text: &str, edits: Vec<Edit>| {
            if ui.selectable_label(on, text).clicked() && !on {
                wishes.extend(edits.into_iter().map(Command::Edit));
                ui.close();
            }
        };
        let free = Edit::Free(Variable { parameter: self.parameter, min: None, max: None });
        let mut freed = self.undone();
        freed.push(free);
        choice(ui, decides == Decides::Nobody, "Fixed", self.undone());
        choice(ui, matches!(decides, Decides::Optimizer(_)), "Variable", freed);
        if let Some(pickup) = self.new_pickup() {
            let edits = vec![Edit::SetPickup(pickup)];
            choice(ui, matches!(decides, Decides::Another(_)), "Pickup", edits);
        }
        if self.is_last_gap() {
            let edits = vec![Edit::SetFocus(Some(0.0))];
            choice(ui, matches!(decides, Decides::Focus(_)), "Solve: paraxial focus", edits);
        }
    }

    /// The edits that leave the number to nobody.
    fn undone(&self) -> Vec<Edit> {
        match self.decides {
            Decides::Nobody => Vec::new(),
            Decides::Optimizer(_) => vec![Edit::Fix(self.parameter)],
            Decides::Another(_) => vec![Edit::RemovePickup(self.parameter)],
            Decides::Focus(_) => vec![Edit::SetFocus(None)],
        }
    }

    /// A pickup from the same number of the row before that keeps the value if it can.
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

    fn bounds(
        &self,
        ui: &mut Ui,
        variable: Variable,
        drafts: &mut Drafts,
        wishes: &mut Vec<Command>,
    ) {
        ui.separator();
        let unit = match self.parameter.quantity {
            Quantity::Curvature => "curvature, 1/mm",
            Quantity::Thickness | Quantity::ZoomThickness(_) | Quantity::SemiDiameter => "mm",
            Quantity::Conic | Quantity::Asphere(_) | Quantity::Index | Quantity::Gradient(_) => {
                "number"
            }
        };
        ui.weak(format!("Bounds, {unit}; empty for none"));
        let limit =
            |text: &str| if text.trim().is_empty() { Some(None) } else { value(text).map(Some) };
        if let Some(min) = self.line(ui, "Minimum", variable.min, drafts, limit) {
            wishes.push(Edit::Free(Variable { min, ..variable }).into());
        }
        if let Some(max) = self.line(ui, "Maximum", variable.max, drafts, limit) {
            wishes.push(Edit::Free(Variable { max, ..variable }).into());
        }
    }

    fn pickup(&self, ui: &mut Ui, pickup: Pickup, drafts: &mut Drafts, wishes: &mut Vec<Command>) {
        ui.separator();
        let row = |text: &str| text.trim().parse().ok().filter(|n| (1..=1000).contains(n));
        let surface = Some((pickup.source.surface + 1) as f64);
        let mut set = |pickup: Pickup| wishes.push(Edit::SetPickup(pickup).into());
        if let Some(number) = self.line(ui, "From surface", surface, drafts, row) {
            let number: usize = number;
            set(Pickup { source: Parameter { surface: number - 1, ..pickup.source }, ..pickup });
        }
        if let Some(scale) = self.line(ui, "Scale", Some(pickup.scale), drafts, value) {
            set(Pickup { scale, ..pickup });
        }
        if let Some(offset) = self.line(ui, "Offset", Some(pickup.offset), drafts, value) {
            set(Pickup { offset, ..pickup });
        }
    }

    fn offset(&self, ui: &mut Ui, offset: f64, drafts: &mut Drafts, wishes: &mut Vec<Command>) {
        ui.separator();
        if let Some(offset) = self.line(ui, "Displaced by, mm", Some(offset), drafts, value) {
            wishes.push(Edit::SetFocus(Some(offset)).into());
        }
    }

    /// A name and a field; gives the value once one is typed that `read` understands.
    fn line<T>(
        &self,
        ui: &mut Ui,
        name: &str,
        shown: Option<f64>,
        drafts: &mut Drafts,
        read: impl Fn(&str) -> Option<T>,
    ) -> Option<T> {
        let id = Id::unique((self.parameter, name));
        let shown = shown.map(number::show).unwrap_or_default();
        let entry = ui.horizontal(|ui| {
            ui.label(name);
            let field =
                Field { name, shown: &shown, hint: "none", align: Align::Max, place: Place::Form };
            drafts.show(ui, id, field)
        });
        let text = entry.inner.typed?;
        let read = read(&text);
        match read {
            Some(_) => drafts.accept(id),
            None => drafts.refuse(id, format!("`{text}` is no number that fits here")),
        }
        read
    }
}

fn value(text: &str) -> Option<f64> {
    evaluate(text, 0.0).ok().filter(|value| value.is_finite())
}
