//! Loss and gradient in the units of Langevin steps, which are fixed so that a step and its reverse
//! are measured alike.

use super::LensLandscape;
use crate::lens::{Lens, Parameter, Quantity, RADIAL_TERMS};
use crate::merit::DerivativeLevel;
use crate::search::LossGradient;

/// The unit of a parameter for a lens of a size in mm; units of all parameters deflect rays by
/// similar amounts.
pub(super) fn langevin_unit(lens: &Lens, parameter: Parameter, size: f64) -> f64 {
    match parameter.quantity {
        Quantity::Curvature => 0.5 / size,
        Quantity::Thickness | Quantity::SemiDiameter => 0.02 * size,
        Quantity::Conic => 1.0,
        Quantity::Asphere(term) => 0.05 / (0.2 * size).powi(2 * term as i32 + 3),
        Quantity::Index => 0.1,
        Quantity::Grin(k) => {
            let power = if k < RADIAL_TERMS { 2 * k + 2 } else { k - RADIAL_TERMS + 1 };
            0.02 / (0.2 * size).powi(power as i32)
        }
        Quantity::Freeform(k) => {
            let form = lens.surfaces[parameter.surface].freeform.as_ref();
            0.05 * (0.2 * size).powi(form.map_or(0, |form| form.kind.power(k)))
        }
    }
}

pub(super) fn loss_gradient(landscape: &LensLandscape, lens: &Lens) -> Option<LossGradient> {
    let merit = landscape.merit(lens, landscape.local.tolerance).ok()?;
    let values = merit.values(&landscape.with_variables(lens));
    let sum = merit.evaluate(&values, DerivativeLevel::Gradient).ok()?;
    let unit = |i: usize| {
        langevin_unit(lens, merit.variables()[i].parameter, landscape.variable_rules.size)
    };
    let units: Vec<f64> = (0..values.len()).map(unit).collect();
    let price = landscape.priced(lens, sum.value.signum()) * sum.value.signum();
    Some(LossGradient {
        loss: landscape.priced(lens, sum.value),
        values: values.iter().zip(&units).map(|(value, unit)| value / unit).collect(),
        gradient: sum
            .gradient
            .iter()
            .zip(&units)
            .map(|(slope, unit)| price * slope * unit)
            .collect(),
    })
}

pub(super) fn with_values(landscape: &LensLandscape, lens: &Lens, values: &[f64]) -> Option<Lens> {
    let free = landscape.with_variables(lens);
    if free.variables.len() != values.len() {
        return None;
    }
    let mut there = lens.clone();
    for (variable, value) in free.variables.iter().zip(values) {
        let value = value * langevin_unit(lens, variable.parameter, landscape.variable_rules.size);
        let inside = variable.min.is_none_or(|min| value >= min)
            && variable.max.is_none_or(|max| value <= max);
        if !inside || !there.set(variable.parameter, value) {
            return None;
        }
    }
    there.with_pickups().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::ASPHERE_TERMS;

    #[test]
    fn curvature_and_aspheres_have_units_of_the_same_sag() {
        let size = 70.0;
        let unit = |quantity: Quantity| {
            langevin_unit(&crate::lens::blank(), Parameter::new(0, quantity), size)
        };
        // At a fifth of the size.
        let height: f64 = 0.2 * size;
        let sag = 0.5 * unit(Quantity::Curvature) * height * height;
        for term in 0..ASPHERE_TERMS {
            let same = unit(Quantity::Asphere(term)) * height.powi(4 + 2 * term as i32);
            assert!((same / sag - 1.0).abs() < 1e-12, "{term}: {same} {sag}");
        }
    }

    /// Values in these units lead back to the lens, and a slope per unit is that of the loss.
    #[test]
    fn values_in_units_lead_back_to_the_lens() {
        let found =
            crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let landscape =
            crate::search::lens_landscape::SearchPlan::default().landscape(&lens).unwrap();
        let start = std::sync::Arc::clone(landscape.start());
        let here = loss_gradient(&landscape, &start).unwrap();
        let back = with_values(&landscape, &start, &here.values).unwrap();
        for variable in &landscape.with_variables(&start).variables {
            let [before, after] =
                [&*start, &back].map(|lens| lens.get(variable.parameter).unwrap());
            assert!((after - before).abs() <= 1e-12 * before.abs(), "{before} {after}");
        }
    }

    /// The scale of losses is that of the spots alone, and penalties only add to it.
    #[test]
    fn the_scale_of_losses_is_at_most_the_loss_of_the_start() {
        let found =
            crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let landscape =
            crate::search::lens_landscape::SearchPlan::default().landscape(&lens).unwrap();
        let (scale, loss) =
            (landscape.loss_scale(), crate::search::Landscape::loss(&landscape, landscape.start()));
        assert!(scale > 0.0 && scale <= loss * (1.0 + 1e-9), "{scale} {loss}");
    }
}
