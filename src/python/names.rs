//! Names of the numbers of a lens, such as `curvature[2]` or `asphere[0,1]`.
//!
//! The first number in brackets is the surface, the second one the coefficient or the zoom position;
//! all are counted from 0.

use super::error::wrong_input;
use crate::lens::{
    ASPHERE_TERMS, FREEFORM_NUMBERS, Lens, PROFILE_TERMS, Parameter, Quantity, ZoomPosition,
};
use pyo3::PyResult;

/// The name of a parameter.
pub(super) fn parameter_name(parameter: Parameter) -> String {
    let i = parameter.surface;
    match parameter.quantity {
        Quantity::Curvature => format!("curvature[{i}]"),
        Quantity::Conic => format!("conic[{i}]"),
        Quantity::Asphere(k) => format!("asphere[{i},{k}]"),
        Quantity::Thickness => format!("thickness[{i}]"),
        Quantity::ZoomThickness(zoom) => format!("thickness[{i},{zoom}]"),
        Quantity::Index => format!("index[{i}]"),
        Quantity::Grin(k) => format!("grin[{i},{k}]"),
        Quantity::SemiDiameter => format!("semi_diameter[{i}]"),
        Quantity::Freeform(k) => format!("freeform[{i},{k}]"),
    }
}

/// The parameter of a name.
pub(super) fn parse_parameter(name: &str) -> PyResult<Parameter> {
    let expected = "expected curvature, conic, thickness, index or semi_diameter with a surface in \
                    brackets, as in `curvature[2]`, or asphere, freeform, grin or thickness with two numbers, \
                    as in `asphere[0,1]`; counted from 0";
    parameter_of(name).ok_or_else(|| wrong_input(format!("found `{name}`; {expected}")))
}

fn parameter_of(name: &str) -> Option<Parameter> {
    let (word, rest) = name.split_once('[')?;
    let inside = rest.strip_suffix(']')?;
    let numbers: Vec<usize> =
        inside.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let quantity = match (word.trim(), &numbers[1..]) {
        ("curvature", []) => Quantity::Curvature,
        ("conic", []) => Quantity::Conic,
        ("asphere", [k]) => Quantity::Asphere(*k),
        ("thickness", []) => Quantity::Thickness,
        ("thickness", [zoom]) => Quantity::ZoomThickness(*zoom),
        ("index", []) => Quantity::Index,
        ("grin", [k]) => Quantity::Grin(*k),
        ("semi_diameter", []) => Quantity::SemiDiameter,
        ("freeform", [k]) => Quantity::Freeform(*k),
        _ => return None,
    };
    Some(Parameter::new(numbers[0], quantity))
}

/// Every parameter that a lens has: the coefficients that are written, and thicknesses at a zoom
/// position where it has one of its own.
pub(super) fn parameters_of(lens: &Lens) -> Vec<Parameter> {
    let of_surface = |i: usize| {
        let terms = lens.surfaces[i].asphere.len().min(ASPHERE_TERMS);
        let plain = [
            Quantity::Curvature,
            Quantity::Conic,
            Quantity::Thickness,
            Quantity::Index,
            Quantity::SemiDiameter,
        ];
        let own = lens.zoom.iter().enumerate().filter(move |(_, position)| has_own(position, i));
        plain
            .into_iter()
            .chain((0..terms).map(Quantity::Asphere))
            .chain((0..PROFILE_TERMS).map(Quantity::Grin))
            .chain((0..FREEFORM_NUMBERS).map(Quantity::Freeform))
            .chain(own.map(|(zoom, _)| Quantity::ZoomThickness(zoom)))
            .map(move |quantity| Parameter::new(i, quantity))
    };
    let all = (0..lens.surfaces.len()).flat_map(of_surface);
    all.filter(|parameter| lens.get(*parameter).is_some()).collect()
}

fn has_own(position: &ZoomPosition, surface: usize) -> bool {
    position.thicknesses.iter().any(|gap| gap.surface == surface)
}
