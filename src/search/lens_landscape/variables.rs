//! The variables of a lens of any structure in a search.
//!
//! The bounds of a variable move with its row when rows are added or removed. So a parameter that
//! the user keeps fixed is a variable with equal bounds; a parameter without a variable is new, or
//! was never fixed, and is free within the rules.

use crate::lens::{Lens, Medium, Parameter, Quantity, Variable, add_variable};
use crate::search::SearchRules;

/// The parameters that are variable besides those that the user has marked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VariableRules {
    /// The reference length: the focal length of the start, in mm.
    pub(super) size: f64,
    /// True to vary semi-diameters.
    pub(super) semi_diameters: bool,
    /// True to vary the indices of model glasses.
    pub(super) indices: bool,
}

/// The maximum curvature, times the focal length.
pub(super) const MAX_CURVATURE: f64 = 4.0;
/// The minimum semi-diameter, relative to the focal length.
const MIN_SEMI_DIAMETER: f64 = 0.02;
/// The permitted range of the index of a model glass.
const MODEL_INDICES: [f64; 2] = [1.45, 1.95];

/// If the user has marked some curvatures or gaps as variables, fixes the others: they become
/// variables with equal bounds.
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
    matches!(quantity, Quantity::Curvature | Quantity::Thickness)
}

/// All curvatures of refracting surfaces and all gaps, including gaps of single zoom positions.
fn shape_parameters(lens: &Lens) -> Vec<Parameter> {
    let mut all = lens.clone();
    (all.variables, all.pickups) = (Vec::new(), Vec::new());
    crate::lens::add_variables(
        &mut all,
        &[crate::lens::ParameterKind::Curvatures, crate::lens::ParameterKind::Thicknesses],
    );
    all.variables.iter().map(|v| v.parameter).collect()
}

/// The lens with every parameter marked as a variable that a search may change. A parameter that
/// lies outside its range may stay or move towards it.
pub(super) fn with_variables(lens: &Lens, rules: &SearchRules, freedom: VariableRules) -> Lens {
    let mut freed = lens.clone();
    let mut wanted = shape_parameters(lens);
    for i in 0..lens.surfaces.len() {
        let mut add = |quantity| wanted.push(Parameter::new(i, quantity));
        if freedom.semi_diameters {
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
        Quantity::Thickness => gap_bounds(lens, rules, parameter.surface),
        Quantity::SemiDiameter => [Some(MIN_SEMI_DIAMETER * size), rules.semi_diameter],
        Quantity::Index => both(MODEL_INDICES),
        Quantity::Conic | Quantity::Asphere(_) | Quantity::Grin(_) | Quantity::Freeform(_) => {
            [None, None]
        }
    }
}

/// Behind a mirror gaps are negative: the rules do not apply to them.
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

/// The lens with every variable clamped to its bounds, which a mutation may have left.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    #[test]
    fn gaps_of_glass_and_air_have_the_limits_of_the_rules_unless_there_is_a_mirror() {
        let mut lens = blank();
        let rules = SearchRules {
            glass_center: [1.0, 9.0],
            air_center: [0.1, 30.0],
            back_focus: Some(12.0),
            ..SearchRules::default()
        };
        let last = lens.surfaces.len() - 1;
        assert_eq!(gap_bounds(&lens, &rules, 0), [Some(1.0), Some(9.0)]);
        assert_eq!(gap_bounds(&lens, &rules, last), [Some(12.0), None]);
        lens.surfaces[0].medium = Medium::Air;
        assert_eq!(gap_bounds(&lens, &rules, 0), [Some(0.1), Some(30.0)]);
        lens.surfaces[last].medium = Medium::Mirror;
        assert_eq!(gap_bounds(&lens, &rules, 0), [None, None]);
    }
}
