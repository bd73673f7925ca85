//! A lens resolved as a plan says: what is left out is not there.

use super::plan::EffectPlan;
use super::{Effect, EffectOverride};
use crate::lens::{
    ASPHERE_TERMS, Aperture, FieldKind, FieldPoint, Lens, LensError, Object, Shape, Surface, System,
};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel, RayModelError};

/// A lens at a zoom position with the effects that a plan computes, ready for rays.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn build_ray_model(
    lens: &Lens,
    zoom: usize,
    plan: &EffectPlan,
) -> Result<RayModel, RayModelError> {
    let primary = lens.primary();
    let one = !plan.computes(Effect::Dispersion);
    let wavelengths = if one { &lens.wavelengths[primary..=primary] } else { &lens.wavelengths };
    let resolve = |w: &crate::lens::Wavelength| {
        let mut system = lens.resolve(zoom, w.um)?;
        simplify(&mut system, plan);
        // One colour alone has all the weight, whatever its share of the light.
        Ok((w.um, if one { 1.0 } else { w.weight }, system))
    };
    let systems: Result<Vec<_>, LensError> = wavelengths.iter().map(resolve).collect();
    let primary = if one { 0 } else { primary };
    let aiming = if plan.computes(Effect::Aiming) { Aiming::Chief } else { Aiming::Paraxial };
    let beam = Beam::for_lens(lens, zoom);
    let mut bench = RayModel::from_systems(systems?, primary, beam, aiming)?;
    bench.fields.clone_from(&lens.fields_at(zoom).values);
    if lens.object != Object::Infinity
        && !plan.computes(Effect::FiniteObject)
        && let Some((beam, fields)) = collimate_fields(&bench, &beam)
    {
        let systems = bench.channels.into_iter().map(|c| (c.um, c.weight, c.system)).collect();
        bench = RayModel::from_systems(systems, primary, beam, aiming)?;
        bench.fields = fields;
    }
    Ok(bench)
}

/// Takes out of a resolved lens what a plan leaves out: figuring, rims and obstructions, gradients.
pub fn simplify(system: &mut System<f64>, plan: &EffectPlan) {
    for surface in &plan.plain {
        reduce_to_conic(&mut system.surfaces[*surface]);
    }
    for surface in &plan.open {
        system.surfaces[*surface].remove_apertures();
    }
    for surface in &plan.even {
        system.surfaces[*surface].grin = None;
    }
}

/// Makes a figured surface the conic that it is without figuring.
pub(super) fn reduce_to_conic(surface: &mut Surface<f64>) {
    let (curvature, conic, _) = surface.shape.numbers();
    surface.shape = Shape::simplest(curvature, conic, [0.0; ASPHERE_TERMS]);
}

/// The beam of the same lens whose object points are moved to infinity along their chief rays;
/// `None` where they lie in the pupil or where the pupil has no size.
pub(super) fn collimate_fields(bench: &RayModel, beam: &Beam) -> Option<(Beam, Vec<FieldPoint>)> {
    let Object::Finite(distance) = beam.object else { return None };
    let pupil = bench.first_order.entrance_pupil;
    let (reach, diameter) = (distance + pupil.position?, pupil.diameter?);
    let height = |value: f64| match beam.field {
        FieldKind::Angle => Some(value),
        FieldKind::ObjectHeight => Some(-(value / reach).atan().to_degrees()),
        FieldKind::ImageHeight => {
            Some(-(value / bench.first_order.magnification? / reach).atan().to_degrees())
        }
    };
    let turned = |field: &FieldPoint| {
        let size = field.x.hypot(field.y);
        let angle = if size == 0.0 { 0.0 } else { height(size)? / size };
        Some(FieldPoint { x: field.x * angle, y: field.y * angle, ..*field })
    };
    let fields: Option<Vec<FieldPoint>> = bench.fields.iter().map(turned).collect();
    let far = Beam {
        object: Object::Infinity,
        aperture: match beam.aperture {
            stop @ Aperture::StopSemiDiameter(_) => stop,
            _ => Aperture::EntrancePupilDiameter(diameter),
        },
        field: FieldKind::Angle,
        edge: height(beam.edge)?,
    };
    (reach != 0.0).then_some((far, fields?))
}

/// Whether an effect is computed, as chosen or else as planned.
pub(super) fn decided(choice: EffectOverride, needed: bool) -> bool {
    match choice {
        EffectOverride::Auto => needed,
        EffectOverride::On => true,
        EffectOverride::Off => false,
    }
}
