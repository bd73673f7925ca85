//! A lens resolved as a plan says: what is left out is not there.

use super::plan::Plan;
use super::{Choice, Effect};
use crate::lens::{
    ASPHERE_TERMS, Aperture, Field, FieldKind, Lens, LensError, Object, Shape, Surface, System,
};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, Bench, BenchError};

/// A lens at a zoom position with the effects that a plan computes, ready for rays.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn bench(lens: &Lens, zoom: usize, plan: &Plan) -> Result<Bench, BenchError> {
    let primary = lens.primary();
    let one = !plan.computes(Effect::Dispersion);
    let wavelengths = if one { &lens.wavelengths[primary..=primary] } else { &lens.wavelengths };
    let resolve = |w: &crate::lens::Wavelength| {
        let mut system = lens.system(zoom, w.um)?;
        simplify(&mut system, plan);
        // One colour alone has all the weight, whatever its share of the light.
        Ok((w.um, if one { 1.0 } else { w.weight }, system))
    };
    let systems: Result<Vec<_>, LensError> = wavelengths.iter().map(resolve).collect();
    let primary = if one { 0 } else { primary };
    let aiming = if plan.computes(Effect::Aiming) { Aiming::Chief } else { Aiming::Paraxial };
    let beam = Beam::of(lens, zoom);
    let mut bench = Bench::new(systems?, primary, beam, aiming)?;
    bench.fields.clone_from(&lens.fields_at(zoom).values);
    if lens.object != Object::Infinity
        && !plan.computes(Effect::FiniteObject)
        && let Some((beam, fields)) = collimated(&bench, &beam)
    {
        let systems = bench.colors.into_iter().map(|c| (c.um, c.weight, c.system)).collect();
        bench = Bench::new(systems, primary, beam, aiming)?;
        bench.fields = fields;
    }
    Ok(bench)
}

/// Takes out of a resolved lens what a plan leaves out: figuring, rims and obstructions, gradients.
pub fn simplify(system: &mut System<f64>, plan: &Plan) {
    for surface in &plan.plain {
        drop_terms(&mut system.surfaces[*surface]);
    }
    for surface in &plan.open {
        system.surfaces[*surface].clear();
    }
    for surface in &plan.even {
        system.surfaces[*surface].graded = None;
    }
}

/// Makes a figured surface the conic that it is without figuring.
pub(super) fn drop_terms(surface: &mut Surface<f64>) {
    let (curvature, conic, _) = surface.shape.numbers();
    surface.shape = Shape::simplest(curvature, conic, [0.0; ASPHERE_TERMS]);
}

/// The beam of the same lens whose object points are moved to infinity along their chief rays;
/// `None` where they lie in the pupil or where the pupil has no size.
pub(super) fn collimated(bench: &Bench, beam: &Beam) -> Option<(Beam, Vec<Field>)> {
    let Object::Finite(distance) = beam.object else { return None };
    let pupil = bench.first.entrance_pupil;
    let (reach, diameter) = (distance + pupil.position?, pupil.diameter?);
    let height = |value: f64| match beam.field {
        FieldKind::Angle => Some(value),
        FieldKind::ObjectHeight => Some(-(value / reach).atan().to_degrees()),
        FieldKind::ImageHeight => {
            Some(-(value / bench.first.magnification? / reach).atan().to_degrees())
        }
    };
    let turned = |field: &Field| {
        let size = field.x.hypot(field.y);
        let angle = if size == 0.0 { 0.0 } else { height(size)? / size };
        Some(Field { x: field.x * angle, y: field.y * angle, ..*field })
    };
    let fields: Option<Vec<Field>> = bench.fields.iter().map(turned).collect();
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
pub(super) fn decided(choice: Choice, needed: bool) -> bool {
    match choice {
        Choice::Auto => needed,
        Choice::On => true,
        Choice::Off => false,
    }
}
