//! Terms of light: throughput, relative illumination and f-number.
//!
//! All of them are functions of the areas of the pupils; their derivatives come from the motion of
//! the edges alone.

use super::first_order::{focal_length_of, slopes};
use super::sampling::SampledPupil;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, Term, WeightedTerm};
use crate::lens::TermScope;
use crate::pupil::QuadraticIntegrand;
use nalgebra::DVector;
use std::f64::consts::PI;

/// A number with its derivatives by the variables.
pub(super) struct WithGradient {
    pub(super) value: f64,
    pub(super) slope: DVector<f64>,
}

/// Adds one of the terms of light.
pub(super) fn add_light_term(
    context: &EvaluationContext<'_>,
    weighted: WeightedTerm,
    sum: &mut SumOfSquares,
) {
    let scope = weighted.scope;
    match weighted.term {
        Term::Throughput => light_loss(&mean_area(context, scope, sum.level), 1.0, 0.0, sum),
        Term::ThroughputLoss(full) => {
            light_loss(&mean_area(context, scope, sum.level), 1.0 / full, 1.0, sum);
        }
        Term::Light(share) => light_shortfall(context, share, scope, sum),
        Term::MeanLight(share) => mean_light_shortfall(context, share, scope, sum),
        Term::RelativeIllumination { field, min } => illumination(context, field, min, sum),
        Term::FNumber(target) => f_number(context, target, sum),
        _ => {}
    }
}

/// Adds the squared shortfalls of the pupil areas from a fraction of their initial areas. On the axis every
/// rim that takes too much light by itself adds its own.
fn light_shortfall(
    context: &EvaluationContext<'_>,
    share: f64,
    scope: TermScope,
    sum: &mut SumOfSquares,
) {
    let total = total_weight(context, scope);
    for (i, (pupil, before)) in
        context.sampling.pupils.iter().zip(context.initial_areas).enumerate()
    {
        let least = share * before;
        if !pupil.is_in(scope) || (pupil.area >= least && sum.level < DerivativeLevel::Normal) {
            continue;
        }
        for area in areas_by_rim(context, sum.level, i, least) {
            // A rim that takes nothing keeps its place, so that the sums of two lenses have the same.
            let (shortfall, slope) = match area {
                Some(area) => (1.0 - area.value / least, area.slope / -least),
                None => (-1.0, DVector::zeros(context.values.len())),
            };
            sum.add_one_sided(pupil.weight / total, shortfall, slope);
        }
    }
}

/// The area up to which that of a rim is followed, relative to the area of the pupil or to that asked for.
const NEAR_RIM: f64 = 1.3;

/// The area of a pupil in mm²; on the axis at the place of the rim that ends it, among those that the rims
/// of all surfaces would leave by themselves. The first one has no rim; what is far larger is left out.
///
/// The least of these areas, which is that of the pupil, has a kink where another rim becomes the narrowest
/// one, and descents halt there.
fn areas_by_rim(
    context: &EvaluationContext<'_>,
    level: DerivativeLevel,
    pupil: usize,
    least: f64,
) -> Vec<Option<WithGradient>> {
    let area = pupil_area(context, level, pupil, 1.0);
    let sampled = &context.sampling.pupils[pupil];
    let on_axis = context.traced_pupils.get(pupil).filter(|_| context.sampling.is_axial(sampled));
    let Some(traced) = on_axis else { return vec![Some(area)] };
    let most = match level {
        DerivativeLevel::Normal => NEAR_RIM * area.value.max(least),
        DerivativeLevel::Value | DerivativeLevel::Gradient => least,
    };
    let surfaces = context.systems.clipped[sampled.wavelength].surfaces.len();
    let mut areas: Vec<Option<WithGradient>> = Vec::new();
    areas.resize_with(1 + surfaces, || None);
    areas[traced.axial_rim().map_or(0, |surface| 1 + surface)] = Some(area);
    for rim in traced.other_axial_rims(most) {
        let slope = if level == DerivativeLevel::Value {
            DVector::zeros(context.values.len())
        } else {
            let by_number = traced.axial_rim_motion(&rim);
            context.zoom.by_variables(context.systems, sampled.wavelength, &by_number)
        };
        areas[1 + rim.surface] = Some(WithGradient { value: rim.area, slope });
    }
    areas
}

/// Adds the squared shortfall of the mean area of the pupils from a fraction of the initial one,
/// relative to that fraction.
fn mean_light_shortfall(
    context: &EvaluationContext<'_>,
    share: f64,
    scope: TermScope,
    sum: &mut SumOfSquares,
) {
    let now = mean_light(context, scope, sum.level);
    sum.add_one_sided(1.0, 1.0 - now.value / share, now.slope * (-1.0 / share));
}

/// The mean area of the pupils of a scope relative to that in the starting lens.
pub(super) fn mean_light(
    context: &EvaluationContext<'_>,
    scope: TermScope,
    level: DerivativeLevel,
) -> WithGradient {
    let pupils = context.sampling.pupils.iter().zip(context.initial_areas);
    let in_scope = pupils.filter(|(pupil, _)| pupil.is_in(scope));
    let before: f64 = in_scope.map(|(pupil, before)| pupil.weight * before).sum();
    let pupils = &context.sampling.pupils;
    weighted_area(context, level, |i| pupils[i].is_in(scope), 1.0 / before)
}

/// Adds `initial_areas − factor × weighted_area`. It is no square. For least squares it is replaced
/// by the square of a residual with the same derivative: the root of twice the current area minus
/// the area.
fn light_loss(area: &WithGradient, factor: f64, start: f64, sum: &mut SumOfSquares) {
    sum.value += start - factor * area.value;
    sum.gradient.axpy(-factor, &area.slope, 1.0);
    if sum.level == DerivativeLevel::Normal && area.value > 0.0 {
        sum.normal.ger(0.25 * factor / area.value, &area.slope, &area.slope, 1.0);
    }
}

fn illumination(context: &EvaluationContext<'_>, field: usize, min: f64, sum: &mut SumOfSquares) {
    if let Some(share) = relative_illumination(context, field, sum.level) {
        sum.add_one_sided(1.0, min - share.value, -share.slope);
    }
}

/// The relative illumination of a field; `None` without a field on the axis.
pub(super) fn relative_illumination(
    context: &EvaluationContext<'_>,
    field: usize,
    level: DerivativeLevel,
) -> Option<WithGradient> {
    let axis = context.sampling.axis()?;
    let (here, center) = (field_area(context, field, level), field_area(context, axis, level));
    let cosine = context.sampling.cosine(field).unwrap_or(1.0);
    let factor = cosine.powi(4) / center.value;
    let value = factor * here.value;
    let slope = here.slope * factor - center.slope * (value / center.value);
    Some(WithGradient { value, slope })
}

fn f_number(context: &EvaluationContext<'_>, target: f64, sum: &mut SumOfSquares) {
    if let Some(number) = axial_f_number(context, sum.level) {
        sum.add_residual(1.0, number.value - target, &number.slope);
    }
}

/// The f-number on the axis; `None` without a field there.
pub(super) fn axial_f_number(
    context: &EvaluationContext<'_>,
    level: DerivativeLevel,
) -> Option<WithGradient> {
    let area = field_area(context, context.sampling.axis()?, level);
    let focal = focal_length_of(&context.systems.clipped[context.zoom.primary]);
    let diameter = 2.0 * (area.value / PI).sqrt();
    let value = focal.abs() / diameter;
    let by_focal = slopes(context, level, focal_length_of) * (focal.signum() / diameter);
    let slope = by_focal - area.slope * (0.5 * value / area.value);
    Some(WithGradient { value, slope })
}

/// Every pupil with its area relative to that in the starting lens.
pub(super) fn light_shares<'a>(
    context: &'a EvaluationContext<'_>,
    scope: TermScope,
    level: DerivativeLevel,
) -> impl Iterator<Item = (&'a SampledPupil, WithGradient)> {
    let pupils = context.sampling.pupils.iter().zip(context.initial_areas).enumerate();
    let pupils = pupils.filter(move |(_, (pupil, _))| pupil.is_in(scope));
    pupils.map(move |(i, (pupil, before))| (pupil, pupil_area(context, level, i, 1.0 / before)))
}

/// The area of a pupil in mm² times a factor.
fn pupil_area(
    context: &EvaluationContext<'_>,
    level: DerivativeLevel,
    pupil: usize,
    factor: f64,
) -> WithGradient {
    let weight = context.sampling.pupils[pupil].weight;
    weighted_area(context, level, |i| i == pupil, factor / weight)
}

/// The weight of the pupils of a scope; exactly 1 for all of them.
pub(super) fn total_weight(context: &EvaluationContext<'_>, scope: TermScope) -> f64 {
    if scope.is_all() {
        return 1.0;
    }
    let pupils = context.sampling.pupils.iter();
    pupils.filter(|pupil| pupil.is_in(scope)).map(|pupil| pupil.weight).sum()
}

/// The weighted mean area of the pupils of a scope, in mm².
fn mean_area(
    context: &EvaluationContext<'_>,
    scope: TermScope,
    level: DerivativeLevel,
) -> WithGradient {
    let pupils = &context.sampling.pupils;
    let total = total_weight(context, scope);
    weighted_area(context, level, |i| pupils[i].is_in(scope), 1.0 / total)
}

/// The area of the pupil of a field in mm², the weighted mean over wavelengths.
fn field_area(
    context: &EvaluationContext<'_>,
    field: usize,
    level: DerivativeLevel,
) -> WithGradient {
    let pupils = &context.sampling.pupils;
    let share: f64 = pupils.iter().filter(|p| p.field == field).map(|p| p.weight).sum();
    weighted_area(context, level, |i| pupils[i].field == field, 1.0 / share)
}

/// The sum of the areas of the chosen pupils in mm², each times its weight and a factor.
fn weighted_area(
    context: &EvaluationContext<'_>,
    level: DerivativeLevel,
    chosen: impl Fn(usize) -> bool,
    factor: f64,
) -> WithGradient {
    let pupils = &context.sampling.pupils;
    let share = |(i, p): (usize, &SampledPupil)| if chosen(i) { factor * p.weight } else { 0.0 };
    let shares = pupils.iter().enumerate().map(share);
    let value = shares.clone().zip(pupils).map(|(share, pupil)| share * pupil.area).sum();
    let slope = if level == DerivativeLevel::Value {
        DVector::zeros(context.values.len())
    } else {
        let cost = |share| QuadraticIntegrand { center: [0.0; 2], square: 0.0, constant: share };
        context.edge_motion(shares.map(cost))
    };
    WithGradient { value, slope }
}
