//! Loss and gradient in the units in which Langevin steps are taken: fixed ones, so that a step and
//! its way back are measured alike.

use super::LensLandscape;
use crate::lens::{Lens, Parameter, Quantity, RADIAL_TERMS};
use crate::merit::Detail;
use crate::search::Slope;

/// What a change of one means for a number of a lens of some size in mm: they bend rays about alike.
fn unit(parameter: Parameter, size: f64) -> f64 {
    match parameter.quantity {
        Quantity::Curvature => 0.5 / size,
        Quantity::Thickness | Quantity::ZoomThickness(_) | Quantity::SemiDiameter => 0.02 * size,
        Quantity::Conic => 1.0,
        Quantity::Asphere(term) => 0.05 / (0.2 * size).powi(2 * term as i32 + 3),
        Quantity::Index => 0.1,
        Quantity::Gradient(k) => {
            let power = if k < RADIAL_TERMS { 2 * k + 2 } else { k - RADIAL_TERMS + 1 };
            0.02 / (0.2 * size).powi(power as i32)
        }
    }
}

pub(super) fn slope(landscape: &LensLandscape, lens: &Lens) -> Option<Slope> {
    let merit = landscape.merit(lens, landscape.local.tolerance).ok()?;
    let values = merit.values(&landscape.freed(lens));
    let sum = merit.sum(&values, Detail::Gradient).ok()?;
    let unit = |i: usize| unit(merit.variables()[i].parameter, landscape.freedom.size);
    let units: Vec<f64> = (0..values.len()).map(unit).collect();
    Some(Slope {
        loss: sum.value,
        values: values.iter().zip(&units).map(|(value, unit)| value / unit).collect(),
        gradient: sum.gradient.iter().zip(&units).map(|(slope, unit)| slope * unit).collect(),
    })
}

pub(super) fn with_values(landscape: &LensLandscape, lens: &Lens, values: &[f64]) -> Option<Lens> {
    let free = landscape.freed(lens);
    if free.variables.len() != values.len() {
        return None;
    }
    let mut there = lens.clone();
    for (variable, value) in free.variables.iter().zip(values) {
        let value = value * unit(variable.parameter, landscape.freedom.size);
        let inside = variable.min.is_none_or(|min| value >= min)
            && variable.max.is_none_or(|max| value <= max);
        if !inside || !there.set(variable.parameter, value) {
            return None;
        }
    }
    there.with_pickups().ok()
}
