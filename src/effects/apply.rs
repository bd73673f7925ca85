//! A lens resolved according to a plan: effects that are left out are absent from its numbers.

use super::effect::Effect;
use super::plan::EffectPlan;
use super::simplify::{collimate_fields, reduce_to_conic};
use crate::lens::{FieldPoint, Lens, LensError, Object, System, Wavelength};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel, RayModelError};

/// The ray model of a lens at a zoom position, with the effects that a plan computes.
///
/// # Errors
/// A lens or an aperture through which no ray can be traced.
pub fn build_ray_model(
    lens: &Lens,
    zoom: usize,
    plan: &EffectPlan,
) -> Result<RayModel, RayModelError> {
    build_ray_model_at(lens, zoom, &lens.fields_at(zoom).values, plan)
}

/// The ray model of a lens for some fields, in the unit of its own, with the effects that a plan
/// computes. The fields of the model are angles where a finite object is moved to infinity.
///
/// # Errors
/// A lens or an aperture through which no ray can be traced.
pub fn build_ray_model_at(
    lens: &Lens,
    zoom: usize,
    fields: &[FieldPoint],
    plan: &EffectPlan,
) -> Result<RayModel, RayModelError> {
    let primary = lens.primary();
    let one = !plan.computes(Effect::Dispersion);
    let wavelengths = if one { &lens.wavelengths[primary..=primary] } else { &lens.wavelengths };
    let resolve = |w: &Wavelength| {
        let mut system = lens.resolve(zoom, w.um)?;
        simplify(&mut system, plan);
        // A single wavelength has all the weight, whatever its share of the light.
        Ok((w.um, if one { 1.0 } else { w.weight }, system))
    };
    let systems: Result<Vec<_>, LensError> = wavelengths.iter().map(resolve).collect();
    let primary = if one { 0 } else { primary };
    let aimed = plan.computes(Effect::Aiming);
    let model = |systems, beam| -> Result<RayModel, RayModelError> {
        let aiming = if aimed { Aiming::Chief } else { Aiming::Paraxial };
        let model = RayModel::from_systems(systems, primary, beam, aiming)?;
        Ok(if aimed { model.limited_by_stop()? } else { model })
    };
    let beam = Beam::for_lens(lens, zoom);
    let mut built = model(systems?, beam)?;
    built.fields = fields.to_vec();
    if lens.object != Object::Infinity
        && !plan.computes(Effect::FiniteObject)
        && let Some((beam, fields)) = collimate_fields(&built, &beam)
    {
        let systems = built.channels.into_iter().map(|c| (c.um, c.weight, c.system)).collect();
        built = model(systems, beam)?;
        built.fields = fields;
    }
    built.neglected = plan.neglected();
    Ok(built)
}

/// Removes from a resolved lens what a plan leaves out: aspheric terms, semi-diameters and
/// obstructions, index gradients.
pub fn simplify(system: &mut System<f64>, plan: &EffectPlan) {
    for surface in &plan.as_conic {
        reduce_to_conic(&mut system.surfaces[*surface]);
    }
    for surface in &plan.unclipped {
        system.surfaces[*surface].remove_apertures();
    }
    for surface in &plan.homogeneous {
        system.surfaces[*surface].grin = None;
    }
}
