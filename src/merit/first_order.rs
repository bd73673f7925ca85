//! Terms of first-order optics, differentiated by dual numbers.

use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, VariableDual};
use crate::lens::System;
use crate::math::Real;
use crate::paraxial::{paraxial_ray, signed_indices};
use crate::solve::SeparateResidual;
use nalgebra::DVector;

/// Adds the squared deviation of the focal length from a target, in mm².
pub(super) fn focal_length(context: &EvaluationContext<'_>, target: f64, sum: &mut SumOfSquares) {
    let focal = focal_length_of(&context.systems.clipped[context.zoom.primary]);
    let (value, slope) = (focal - target, slopes(context, sum.level, focal_length_of));
    let residual = SeparateResidual { value, slope, is_one_sided: false, is_cheap: true };
    sum.add_separate(1.0, &residual);
}

/// The derivatives of a first-order number by the variables; zeros if only the value is asked for.
pub(super) fn slopes(
    context: &EvaluationContext<'_>,
    level: DerivativeLevel,
    number: impl Fn(&System<VariableDual>) -> VariableDual,
) -> DVector<f64> {
    let count = context.values.len();
    if level == DerivativeLevel::Value {
        return DVector::zeros(count);
    }
    let systems = context.zoom.systems_along(context.systems);
    let slopes = systems.flat_map(|(_, system)| number(&system).slope);
    DVector::from_iterator(count, slopes.take(count))
}

/// The derivatives of numbers that need no rays by the variables.
pub(super) fn slopes_of_all<N>(
    context: &EvaluationContext<'_>,
    numbers: &[N],
    of: impl Fn(&N, &System<VariableDual>) -> VariableDual,
) -> Vec<DVector<f64>> {
    let mut slopes = vec![DVector::zeros(context.values.len()); numbers.len()];
    for (first, system) in context.zoom.systems_along(context.systems) {
        for (number, slope) in numbers.iter().zip(&mut slopes) {
            let by = of(number, &system).slope;
            slope.iter_mut().skip(first).zip(by).for_each(|(to, by)| *to = by);
        }
    }
    slopes
}

/// The focal length `−n₁ y₁ / (n' u')` of the ray that arrives parallel to the axis; infinite for
/// an afocal system.
pub(super) fn focal_length_of<R: Real>(system: &System<R>) -> R {
    let ray = paraxial_ray(system, R::ONE, R::ZERO);
    let last = system.surfaces.len() - 1;
    let index = signed_indices(system)[last + 1];
    -(R::ONE / (index * ray.slopes[last]))
}

/// The paraxial image height per unit of `tan θ`, or of object height for a finite object.
pub(super) fn image_scale<R: Real>(system: &System<R>, object: crate::lens::Object) -> R {
    match object {
        crate::lens::Object::Infinity => focal_length_of(system) * system.index_before,
        crate::lens::Object::Finite(distance) => {
            let ray = paraxial_ray(system, R::from_f64(distance), R::ONE);
            let last = system.surfaces.len() - 1;
            let index = signed_indices(system)[last + 1];
            system.index_before / (index * ray.slopes[last])
        }
    }
}
