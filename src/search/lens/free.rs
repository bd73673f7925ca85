//! Which numbers of a lens a search may change, whatever its structure.
//!
//! The bounds of a variable travel with its row when rows come and go. So what a person wants held
//! is a variable too, one whose bounds coincide; what has no variable is new, or was never held, and
//! is free within the rules.

use crate::lens::{Lens, Medium, Parameter, Quantity, Variable, add_variable};
use crate::search::SearchRules;

/// The numbers that are free besides those that a person has flagged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VariableRules {
    /// What lengths are compared with: the focal length at the start, in mm.
    pub(super) size: f64,
    /// Whether rims are free.
    pub(super) rims: bool,
    /// Whether the indices of model glasses are free.
    pub(super) indices: bool,
}

/// No curvature is larger than this over the focal length.
const MAX_CURVATURE: f64 = 4.0;
/// No rim is smaller than this part of the focal length.
const MIN_SEMI_DIAMETER: f64 = 0.02;
/// What a model glass may be made of.
const MODEL_INDICES: [f64; 2] = [1.45, 1.95];

/// A lens of which a person has flagged some curvatures or gaps keeps the others: they become
/// variables whose bounds coincide.
pub(super) fn freeze_others(lens: &mut Lens) {
    let about_form = |v: &Variable| is_shape(v.parameter.quantity);
    if !lens.variables.iter().any(about_form) {
        return;
    }
    for parameter in shape_parameters(lens) {
        if lens.variable(parameter).is_none()
            && add_variable(lens, parameter)
            && let Some(value) = lens.get(parameter)
            && let Some(held) = lens.variables.last_mut()
        {
            (held.min, held.max) = (Some(value), Some(value));
        }
    }
}

fn is_shape(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Curvature | Quantity::Thickness | Quantity::ZoomThickness(_))
}

/// Every curvature that bends light and every gap, at each zoom position where it has its own.
fn shape_parameters(lens: &Lens) -> Vec<Parameter> {
    let mut all = lens.clone();
    (all.variables, all.pickups) = (Vec::new(), Vec::new());
    crate::lens::add_variables(
        &mut all,
        &[crate::lens::ParameterKind::Curvatures, crate::lens::ParameterKind::Thicknesses],
    );
    all.variables.iter().map(|v| v.parameter).collect()
}

/// The lens with every number flagged that a search may change, and none that is held. A number
/// that is outside of what it may be stays where it is, and may only come nearer.
pub(super) fn with_variables(lens: &Lens, rules: &SearchRules, freedom: VariableRules) -> Lens {
    let mut freed = lens.clone();
    let mut wanted = shape_parameters(lens);
    for i in 0..lens.surfaces.len() {
        let mut add = |quantity| wanted.push(Parameter::new(i, quantity));
        if freedom.rims {
            add(Quantity::SemiDiameter);
        }
        if freedom.indices {
            add(Quantity::Index);
        }
    }
    for parameter in wanted {
        if freed.variable(parameter).is_none() && add_variable(&mut freed, parameter) {
            let value = freed.get(parameter).unwrap_or(0.0);
            let [min, max] = bounds(lens, rules, freedom.size, parameter);
            if let Some(variable) = freed.variables.last_mut() {
                variable.min = min.map(|min| min.min(value));
                variable.max = max.map(|max| max.max(value));
            }
        }
    }
    freed.variables.retain(|v| v.min.is_none() || v.min != v.max);
    freed
}

fn bounds(lens: &Lens, rules: &SearchRules, size: f64, parameter: Parameter) -> [Option<f64>; 2] {
    let both = |[min, max]: [f64; 2]| [Some(min), Some(max)];
    match parameter.quantity {
        Quantity::Curvature => both([-MAX_CURVATURE / size, MAX_CURVATURE / size]),
        Quantity::Thickness | Quantity::ZoomThickness(_) => {
            gap_bounds(lens, rules, parameter.surface)
        }
        Quantity::SemiDiameter => [Some(MIN_SEMI_DIAMETER * size), rules.semi_diameter],
        Quantity::Index => both(MODEL_INDICES),
        Quantity::Conic | Quantity::Asphere(_) | Quantity::Gradient(_) => [None, None],
    }
}

/// Behind a mirror gaps are negative: nothing is said about them there.
fn gap_bounds(lens: &Lens, rules: &SearchRules, surface: usize) -> [Option<f64>; 2] {
    if lens.surfaces.iter().any(|row| row.medium == Medium::Mirror) {
        return [None, None];
    }
    let last = surface + 1 == lens.surfaces.len();
    match lens.surfaces[surface].medium {
        Medium::Air if last => [rules.back_focus, None],
        Medium::Air => rules.air_center.map(Some),
        Medium::Mirror => [None, None],
        Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) | Medium::Grin(_) => {
            rules.glass_center.map(Some)
        }
    }
}

/// The lens with every variable inside its bounds: what a mutation has moved out comes back.
pub(super) fn clamp_to_bounds(lens: &Lens) -> Lens {
    let mut inside = lens.clone();
    for variable in &lens.variables {
        let Some(value) = lens.get(variable.parameter) else { continue };
        let up = variable.min.map_or(value, |min| value.max(min));
        let clamped = variable.max.map_or(up, |max| up.min(max));
        if clamped != value {
            inside.set(variable.parameter, clamped);
        }
    }
    inside
}
