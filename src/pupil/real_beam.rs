//! The beam of a lens: the rays that cross its stop, wherever the first-order pupil lies.

use super::field_source::from_point;
use super::ray_model::{Aiming, RayModel, RayModelError};
use crate::lens::{Aperture, Lens, Object, System};
use crate::math::{Real, Vec3};
use crate::paraxial::{Beam, FirstOrder, first_order};
use crate::trace::{Ray, Tracer};

impl RayModel {
    /// A lens at a zoom position with its real beam: the rays that fill the stop and pass every
    /// rim, with the chief ray of each field and wavelength through the centre of the stop.
    ///
    /// # Errors
    /// A lens that cannot be resolved, or an aperture without meaning for it.
    pub fn from_lens(lens: &Lens, zoom: usize) -> Result<Self, RayModelError> {
        Ok(Self::with_aiming(lens, zoom, Aiming::Chief)?.limited_by_stop()?)
    }

    /// The radius of the stop in mm that a beam of the given aperture fills: as given, or the
    /// height at which the real marginal ray of the field on the axis crosses the stop at the
    /// primary wavelength. That of the paraxial ray if the real one does not get there.
    pub fn filled_stop_radius(&self) -> f64 {
        let system = &self.channels[self.primary].system;
        filled_stop_radius(system, &self.beam).unwrap_or_else(|_| self.stop_radius())
    }
}

/// The radius of the stop in mm that a beam fills: as given, or the height at which the real
/// marginal ray of the point on the axis crosses the stop; that of the paraxial ray if the real one
/// does not get there.
///
/// # Errors
/// An aperture without meaning for the system, or numbers that cannot be traced.
pub fn filled_stop_radius<R: Real>(system: &System<R>, beam: &Beam) -> Result<R, RayModelError> {
    if let Aperture::StopSemiDiameter(radius) = beam.aperture {
        return Ok(R::from_f64(radius));
    }
    let first = first_order(system, beam)?;
    let stop = system.stop.unwrap_or(0);
    let tracer = Tracer::new(&front_part(system, stop))?.without_rims();
    let ray = marginal_ray(&first, beam.object);
    let radius = if system.has_rotational_symmetry() {
        stop_height(&tracer, stop, ray)
    } else {
        stop_radius(&tracer, stop, ray)
    };
    Ok(radius.unwrap_or(first.stop_semi_diameter))
}

/// The system up to and including a surface. A gradient behind that has nothing to end at.
fn front_part<R: Real>(system: &System<R>, surface: usize) -> System<R> {
    let mut surfaces: Vec<_> = system.surfaces.iter().take(surface + 1).cloned().collect();
    if let Some(last) = surfaces.last_mut() {
        last.grin = None;
    }
    System { surfaces, index_before: system.index_before, stop: system.stop }
}

/// The real ray from the point on the axis to the rim of the paraxial entrance pupil.
fn marginal_ray<R: Real>(first: &FirstOrder<R>, object: Object) -> Ray<R> {
    let pupil = first.entrance_pupil;
    let height = first.marginal.heights[0].abs();
    let radius = pupil.diameter.map_or(height, |diameter| R::from_f64(0.5) * diameter);
    match (object, pupil.position) {
        (Object::Infinity, _) => Ray {
            point: Vec3::new(R::ZERO, radius, R::ZERO),
            direction: Vec3::new(R::ZERO, R::ZERO, R::ONE),
        },
        (Object::Finite(distance), Some(position)) => {
            let along = position + R::from_f64(distance);
            let sense = if along > R::ZERO { R::ONE } else { -R::ONE };
            from_axial_point(distance, Vec3::new(R::ZERO, radius * sense, along * sense))
        }
        (Object::Finite(distance), None) => {
            let slope = first.marginal.start_slope.abs();
            from_axial_point(distance, Vec3::new(R::ZERO, slope, R::ONE))
        }
    }
}

/// The ray from the object's point on the axis, `distance` in front of the first vertex.
fn from_axial_point<R: Real>(distance: f64, along: Vec3<R>) -> Ray<R> {
    from_point(Vec3::new(R::ZERO, R::ZERO, R::from_f64(-distance)), along)
}

/// The height of a ray at the stop in mm; `None` if it does not get there.
fn stop_height<R: Real>(tracer: &Tracer<R>, stop: usize, ray: Ray<R>) -> Option<R> {
    let height = stop_point(tracer, stop, ray)?.y.abs();
    (height.value() > 0.0).then_some(height)
}

/// The radius in mm of what the beam of a marginal ray fills of the stop of a lens that is not symmetric
/// about its axis: the geometric mean of the half distances of opposite rays, since the middle of the
/// beam is not on the axis. `None` if one of the four rays does not get there.
fn stop_radius<R: Real>(tracer: &Tracer<R>, stop: usize, ray: Ray<R>) -> Option<R> {
    let mut turned = ray;
    let mut points = [Vec3::default(); 4];
    for point in &mut points {
        *point = stop_point(tracer, stop, turned)?;
        turned = quarter_turn(turned);
    }
    let distance2 = |i: usize| {
        let Vec3 { x, y, .. } = points[i + 2] - points[i];
        x * x + y * y
    };
    let radius = R::from_f64(0.5) * (distance2(0) * distance2(1)).sqrt().sqrt();
    (radius.value() > 0.0).then_some(radius)
}

/// The point of a ray at the stop; `None` if it does not get there.
fn stop_point<R: Real>(tracer: &Tracer<R>, stop: usize, ray: Ray<R>) -> Option<Vec3<R>> {
    let landing = tracer.trace_to(ray, stop);
    let point = landing.ray.point;
    let is_finite = [point.x, point.y].iter().all(|at| at.value().is_finite());
    (landing.fate.is_imaged() && is_finite).then_some(point)
}

/// A ray that is turned by a right angle about the axis.
fn quarter_turn<R: Real>(ray: Ray<R>) -> Ray<R> {
    let turn = |v: Vec3<R>| Vec3::new(R::ZERO - v.y, v.x, v.z);
    Ray { point: turn(ray.point), direction: turn(ray.direction) }
}
