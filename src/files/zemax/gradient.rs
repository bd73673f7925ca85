//! The surface type with a gradient-index gap: `GRINSUR3`, "Gradient 3".
//!
//! `n = n₀ + nr₂ r² + nr₄ r⁴ + nr₆ r⁶ + nz₁ z + nz₂ z² + nz₃ z³`, with z from the vertex and the
//! same at every wavelength. Parameter 1 is the largest integration step, which is not used here, 2 is
//! n₀, 3 to 5 are radial, 6 to 8 axial (the user guide of `OpticStudio`, "Gradient 3"). Other types are refused
//! by name, on reading and on writing.

use super::file::ZemaxSurface;
use crate::lens::{GradientIndex, Medium, ProfileLaw, Quantity, RADIAL_TERMS};

/// The name of the surface type.
pub(super) const KIND: &str = "GRINSUR3";
/// The integration step that is written; the other program bounds it itself.
const STEP: f64 = 0.1;
/// The number of radial and of axial coefficients.
const TERMS: usize = 3;

/// The medium behind a surface of this type, for lengths in units of `unit` mm; `None` for other types.
pub(super) fn medium(surface: &ZemaxSurface, unit: f64) -> Option<Medium> {
    if surface.kind.0 != KIND {
        return None;
    }
    let value = |index: usize| {
        let found = surface.parameters.iter().rfind(|(i, ..)| *i == index);
        found.map_or(0.0, |(_, value, _)| *value)
    };
    let list = |first: usize, power: fn(i32) -> i32| {
        let scaled = |j: usize| value(first + j) * unit.powi(-power(j as i32));
        let used = (0..TERMS).rposition(|j| value(first + j) != 0.0).map_or(0, |j| j + 1);
        (0..used).map(scaled).collect()
    };
    let (radial, axial) = (list(3, |j| 2 * j + 2), list(6, |j| j + 1));
    let base = Medium::Index(value(2));
    Some(Medium::Grin(Box::new(GradientIndex { base, law: ProfileLaw::Index, radial, axial })))
}

/// The quantity of parameter number `index` of a surface of type `kind`; `None` if it has none.
pub(super) fn variable_quantity(kind: &str, index: usize) -> Option<Quantity> {
    match index {
        _ if kind != KIND => None,
        2 => Some(Quantity::Index),
        3..=5 => Some(Quantity::Grin(index - 3)),
        6..=8 => Some(Quantity::Grin(RADIAL_TERMS + index - 6)),
        _ => None,
    }
}

/// The parameters of a surface with this medium behind it, by number; `None` for a medium that the
/// type cannot represent.
pub(super) fn parameters(gradient: &GradientIndex) -> Option<Vec<(usize, f64)>> {
    let Medium::Index(base) = gradient.base else { return None };
    let fits = |terms: &[f64]| terms.iter().skip(TERMS).all(|term| *term == 0.0);
    if gradient.law != ProfileLaw::Index || !fits(&gradient.radial) || !fits(&gradient.axial) {
        return None;
    }
    let list = |first: usize, terms: &[f64]| -> Vec<(usize, f64)> {
        let term = |j: usize| terms.get(j).copied().unwrap_or(0.0);
        (0..TERMS).map(|j| (first + j, term(j))).collect()
    };
    let mut all = vec![(1, STEP), (2, base)];
    all.extend(list(3, &gradient.radial));
    all.extend(list(6, &gradient.axial));
    Some(all)
}
