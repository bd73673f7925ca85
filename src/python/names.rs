//! Names of the numbers of a lens, such as `curvature[2]` or `asphere[0,1]`.
//!
//! The first number in brackets is the surface, the next one the coefficient of an asphere, a freeform
//! or a GRIN medium; one more is the zoom position. All are counted from 0.

use super::error::wrong_input;
use crate::lens::{Parameter, Quantity};
use pyo3::PyResult;

/// The name of a parameter.
pub(super) fn parameter_name(parameter: Parameter) -> String {
    let Parameter { surface, quantity, zoom } = parameter;
    let (word, coefficient) = match quantity {
        Quantity::Curvature => ("curvature", None),
        Quantity::Conic => ("conic", None),
        Quantity::Asphere(k) => ("asphere", Some(k)),
        Quantity::Thickness => ("thickness", None),
        Quantity::Index => ("index", None),
        Quantity::Grin(k) => ("grin", Some(k)),
        Quantity::SemiDiameter => ("semi_diameter", None),
        Quantity::Freeform(k) => ("freeform", Some(k)),
    };
    let numbers = [Some(surface), coefficient, zoom].into_iter().flatten();
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    format!("{word}[{}]", numbers.join(","))
}

/// The parameter of a name.
pub(super) fn parse_parameter(name: &str) -> PyResult<Parameter> {
    let expected = "expected curvature, conic, thickness, index or semi_diameter with a surface in \
                    brackets, as in `curvature[2]`, or asphere, freeform or grin with a coefficient \
                    beside, as in `asphere[0,1]`, and a zoom position at the end, as in \
                    `thickness[2,1]`, for the number there; counted from 0";
    parameter_of(name).ok_or_else(|| wrong_input(format!("found `{name}`; {expected}")))
}

fn parameter_of(name: &str) -> Option<Parameter> {
    let (word, rest) = name.split_once('[')?;
    let inside = rest.strip_suffix(']')?;
    let numbers: Vec<usize> =
        inside.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let (quantity, zoom) = match (word.trim(), &numbers[1..]) {
        ("curvature", zoom) => (Quantity::Curvature, zoom),
        ("conic", zoom) => (Quantity::Conic, zoom),
        ("asphere", [k, zoom @ ..]) => (Quantity::Asphere(*k), zoom),
        ("thickness", zoom) => (Quantity::Thickness, zoom),
        ("index", zoom) => (Quantity::Index, zoom),
        ("grin", [k, zoom @ ..]) => (Quantity::Grin(*k), zoom),
        ("semi_diameter", zoom) => (Quantity::SemiDiameter, zoom),
        ("freeform", [k, zoom @ ..]) => (Quantity::Freeform(*k), zoom),
        _ => return None,
    };
    let zoom = match zoom {
        [] => None,
        [zoom] => Some(*zoom),
        _ => return None,
    };
    Some(Parameter { surface: numbers[0], quantity, zoom })
}
