//! A lens resolved according to a plan: effects that are left out are absent from its numbers.

use super::dispersion::light_change;
use super::effect::Effect;
use super::plan::EffectPlan;
use super::simplify::{at_room_temperature, centre, collimate_fields, reduce_to_conic};
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
    // Without dispersion the other wavelengths are needed only for what that changes of the light.
    let unseen = plan.decision(Effect::Dispersion).map_or(0.0, |decision| decision.residual);
    let colors = plan.computes(Effect::Dispersion) || unseen > 0.0;
    let (systems, primary) = resolve_planned(lens, zoom, plan, colors)?;
    let beam = Beam::for_lens(lens, zoom);
    let mut built = aim_planned(systems, primary, beam, plan)?;
    built.fields = fields.to_vec();
    if lens.object != Object::Infinity
        && !plan.computes(Effect::FiniteObject)
        && let Some((beam, fields)) = collimate_fields(&built, &beam)
    {
        let systems = built.channels.into_iter().map(|c| (c.um, c.weight, c.system)).collect();
        built = aim_planned(systems, primary, beam, plan)?;
        built.fields = fields;
    }
    built.neglected = plan.neglected();
    if !plan.computes(Effect::Dispersion) {
        built.neglected.light += light_change(&built);
        built.keep_primary_wavelength();
    }
    Ok(built)
}

/// A wavelength in µm, its weight, and the lens resolved there.
type ResolvedWavelength = (f64, f64, System<f64>);

/// The lens at all wavelengths (`colors`) or at the primary one, and the position of that among them.
fn resolve_planned(
    lens: &Lens,
    zoom: usize,
    plan: &EffectPlan,
    colors: bool,
) -> Result<(Vec<ResolvedWavelength>, usize), LensError> {
    let primary = lens.primary();
    let catalogued = plan.leaves_out(Effect::Temperature).then(|| at_room_temperature(lens));
    let lens = catalogued.as_ref().unwrap_or(lens);
    let wavelengths = if colors { &lens.wavelengths } else { &lens.wavelengths[primary..=primary] };
    let resolve = |w: &Wavelength| {
        let mut system = lens.resolve(zoom, w.um)?;
        simplify(&mut system, plan);
        Ok((w.um, w.weight, system))
    };
    let systems: Result<Vec<_>, LensError> = wavelengths.iter().map(resolve).collect();
    Ok((systems?, if colors { primary } else { 0 }))
}

/// The ray model of resolved systems, with rays aimed as a plan says.
fn aim_planned(
    systems: Vec<ResolvedWavelength>,
    primary: usize,
    beam: Beam,
    plan: &EffectPlan,
) -> Result<RayModel, RayModelError> {
    if plan.computes(Effect::Aiming) {
        let model = RayModel::from_systems(systems, primary, beam, Aiming::Chief)?;
        Ok(model.limited_by_stop()?)
    } else {
        RayModel::from_systems(systems, primary, beam, Aiming::Paraxial)
    }
}

/// Removes from a resolved lens what a plan leaves out: aspheric terms, semi-diameters and
/// obstructions, index gradients, tilts and decentres.
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
    if plan.leaves_out(Effect::Poses) {
        centre(system);
    }
}
