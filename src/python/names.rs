//! Names of the numbers of a lens, such as `curvature[2]` or `asphere[0,1]`.
//!
//! The first number in brackets is the surface, the next one the coefficient of an asphere, a freeform
//! or a GRIN medium; one more is the zoom position. All are counted from 0.

use super::error::wrong_input;
use crate::lens::{ASPHERE_TERMS, FREEFORM_NUMBERS, Lens, PROFILE_TERMS, Parameter, Quantity};
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

/// Every parameter that a lens has: the coefficients that are written, and the numbers at a zoom
/// position where it has some of its own.
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
        let quantities = plain
            .into_iter()
            .chain((0..terms).map(Quantity::Asphere))
            .chain((0..PROFILE_TERMS).map(Quantity::Grin))
            .chain((0..FREEFORM_NUMBERS).map(Quantity::Freeform));
        let shared = quantities.map(move |quantity| Parameter::new(i, quantity));
        shared.chain(own_numbers(lens, i))
    };
    let all = (0..lens.surfaces.len()).flat_map(of_surface);
    all.filter(|parameter| lens.get(*parameter).is_some()).collect()
}

/// The numbers of a row that zoom positions have of their own.
fn own_numbers(lens: &Lens, surface: usize) -> impl Iterator<Item = Parameter> {
    let positions = lens.zoom.iter().enumerate();
    let numbers = positions.flat_map(|(zoom, at)| at.numbers.iter().map(move |own| (zoom, own)));
    let of_row = numbers.filter(move |(_, own)| own.surface == surface);
    of_row.map(|(zoom, own)| Parameter::at_zoom(own.surface, own.quantity, zoom))
}
