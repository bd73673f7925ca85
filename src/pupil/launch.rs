//! The rays of a field: from pupil coordinates to a point and a direction.
//!
//! Every ray of a field is identified by its coordinates `q` in a plane: for a collimated beam the
//! plane perpendicular to the beam through the first vertex, so that field angles of 90 degrees and
//! more need no special case; for an object point the plane of the entrance pupil; for a
//! telecentric beam `q` is the slope. A [`PupilMap`] leads from pupil coordinates to that plane.

use super::field_source::{FieldSource, GRAZING, PupilMap, field_source, paraxial_map};
use super::found_pupils::FoundPupils;
use super::ray_aiming::{AimedRay, aim_all_from_chief_ray, aim_at, aim_from_chief_ray};
use super::ray_model::{Aiming, Channel, Dual2, PupilMeasure, RayModel};
use crate::lens::{FieldKind, FieldPoint};
use crate::math::{Real, SimdWidth, run_vectorized};
use crate::trace::{ImagePoints, Landings, Ray, Rays, TraceSink, TracedRay};
use serde::Serialize;

/// The reason why a field has no rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LaunchError {
    /// The field point is undefined.
    #[error("the field has no object point: the lens gives the field's unit no meaning")]
    NoObjectPoint,
    /// No ray of the field through the centre of the stop was found.
    #[error("no ray of this field was found that crosses the centre of the stop")]
    NotAimed,
    /// There is no such wavelength.
    #[error("there is no such wavelength")]
    NoWavelength,
}

/// The distance inside the rim of the stop at which rays at the rim are aimed, in its radii.
const INSIDE_RIM: f64 = 1e-9;
/// A field beyond this angle, in degrees, is wide.
const WIDE: f64 = 45.0;

/// The rays of one field and wavelength, independent of the lens: an integral over a moving pupil
/// keeps them while the lens changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedLaunch {
    field: FieldPoint,
    wavelength: usize,
    aiming: Aiming,
    source: FieldSource,
    map: PupilMap,
}

impl FixedLaunch {
    /// The same rays through a model of the same wavelengths.
    pub fn launch(self, model: &RayModel) -> Launch<'_> {
        let Self { field, wavelength, aiming, source, map } = self;
        Launch { model, field, wavelength, aiming, source, map }
    }
}

/// The rays of one field at one wavelength.
#[derive(Debug, Clone)]
pub struct Launch<'a> {
    /// The model of the lens.
    pub model: &'a RayModel,
    /// The field.
    pub field: FieldPoint,
    /// The index of the wavelength.
    pub wavelength: usize,
    aiming: Aiming,
    source: FieldSource,
    map: PupilMap,
}

impl RayModel {
    /// The rays of a field at a wavelength.
    ///
    /// # Errors
    /// A field without rays: see [`LaunchError`].
    pub fn launch(&self, field: FieldPoint, wavelength: usize) -> Result<Launch<'_>, LaunchError> {
        Launch::new(self, field, wavelength, self.aiming)
    }

    /// The rays of a field at a wavelength, each aimed at its point of the real stop, whatever the
    /// aiming of the model.
    ///
    /// # Errors
    /// A field without rays: see [`LaunchError`].
    pub fn launch_at_stop(
        &self,
        field: FieldPoint,
        wavelength: usize,
    ) -> Result<Launch<'_>, LaunchError> {
        Launch::new(self, field, wavelength, Aiming::Stop)
    }
}

impl<'a> Launch<'a> {
    pub(super) fn new(
        model: &'a RayModel,
        field: FieldPoint,
        wavelength: usize,
        aiming: Aiming,
    ) -> Result<Self, LaunchError> {
        if wavelength >= model.channels.len() {
            return Err(LaunchError::NoWavelength);
        }
        let source = field_source(model, field).ok_or(LaunchError::NoObjectPoint)?;
        let map = paraxial_map(model, &source);
        let mut launch = Self { model, field, wavelength, aiming, source, map };
        if aiming != Aiming::Paraxial {
            let search = || launch.map_at_stop().ok_or(LaunchError::NotAimed);
            let own = launch.found_pupils();
            launch.map = own.map_or_else(search, |own| own.map(&launch.to_fixed(), search))?;
        }
        Ok(launch)
    }

    /// The affine map at the chief ray; `None` if that was not found.
    fn map_at_stop(&self) -> Option<PupilMap> {
        self.chief_ray()?.pupil_map(self.model.stop_radius())
    }

    /// The pupils that the model remembers if the field is one of its own.
    pub(super) fn found_pupils(&self) -> Option<&'a FoundPupils> {
        self.model.fields.contains(&self.field).then_some(&self.model.found)
    }

    /// The same rays, independent of the lens.
    pub fn to_fixed(&self) -> FixedLaunch {
        let Self { field, wavelength, aiming, source, map, .. } = *self;
        FixedLaunch { field, wavelength, aiming, source, map }
    }

    /// The cosine of the angle between a collimated beam and the axis; `None` for the rays of an
    /// object point.
    pub fn axis_cosine(&self) -> Option<f64> {
        match self.source {
            FieldSource::Collimated { direction, .. } => Some(direction.z),
            FieldSource::Point { .. } | FieldSource::Slopes { .. } => None,
        }
    }

    /// The field in object space, whatever the lens behind: the angle of its beam with the axis for a distant
    /// object, else the height of the object point.
    pub fn object_field(&self) -> (FieldKind, FieldPoint) {
        let weight = self.field.weight;
        match self.source {
            FieldSource::Collimated { direction, .. } => {
                let across = direction.x.hypot(direction.y);
                let angle = across.atan2(direction.z).to_degrees();
                let scale = if across > 0.0 { angle / across } else { 0.0 };
                let (x, y) = (scale * direction.x, scale * direction.y);
                (FieldKind::Angle, FieldPoint { x, y, weight })
            }
            FieldSource::Point { from, .. } | FieldSource::Slopes { from } => {
                (FieldKind::ObjectHeight, FieldPoint { x: from.x, y: from.y, weight })
            }
        }
    }

    /// True for a field on the axis: all azimuths of its pupil are alike.
    pub(super) fn is_axial(&self) -> bool {
        let system = &self.channel().system;
        let is_round = !system.has_poses() && system.has_round_apertures();
        self.field.x == 0.0 && self.field.y == 0.0 && is_round
    }

    /// The lens at this wavelength.
    pub fn channel(&self) -> &'a Channel {
        &self.model.channels[self.wavelength]
    }

    /// True if the rays at `(−px, py)` mirror those at `(px, py)`.
    pub fn is_symmetric(&self) -> bool {
        self.field.x == 0.0 && self.channel().system.mirrors_in_x()
    }

    /// The area of one unit of pupil coordinates, in mm² of the first vertex plane: the measure of
    /// integrals over a pupil. For a collimated beam that grazes that plane (a direction cosine
    /// below 0.05), the area perpendicular to the beam.
    pub fn area(&self) -> f64 {
        self.area_of(&self.map)
    }

    /// The same for the paraxial entrance pupil, which a unit of the coordinates of an aimed beam only
    /// resembles: where a beam fills the stop, its light is π times this but for aberrations of the pupil.
    pub fn paraxial_area(&self) -> f64 {
        self.area_of(&paraxial_map(self.model, &self.source))
    }

    fn area_of(&self, map: &PupilMap) -> f64 {
        let [[a, b], [c, d]] = map.columns;
        let area = (a * d - b * c).abs();
        match self.source {
            FieldSource::Collimated { direction, .. } if direction.z > GRAZING => {
                area / direction.z
            }
            FieldSource::Collimated { .. } => area,
            FieldSource::Point { from, through } => area * (from.z / (through - from.z)).powi(2),
            FieldSource::Slopes { from } => area * from.z * from.z,
        }
    }

    /// The area of the arriving beam that a unit of pupil coordinates stands for at a point, relative
    /// to that at the chief ray: the weight of a ray in the measure of the model. It is 1 unless
    /// every ray is aimed at the stop; 0 if no ray was found that crosses the stop there.
    pub fn beam_share(&self, p: [f64; 2]) -> f64 {
        if self.aiming != Aiming::Stop || self.model.measure == PupilMeasure::Coordinates {
            return 1.0;
        }
        let Some([x, y]) = self.dual_ray_coordinates(p) else { return 0.0 };
        let [[a, b], [c, d]] = self.map.columns;
        ((x.slope[0] * y.slope[1] - x.slope[1] * y.slope[0]) / (a * d - b * c)).abs()
    }

    /// The ray at these pupil coordinates; `None` if none was found that crosses the stop there.
    pub fn ray(&self, p: [f64; 2]) -> Option<Ray<f64>> {
        Some(self.source.ray(self.ray_coordinates(p)?))
    }

    /// The rays at some pupil coordinates, as [`Launch::ray`] finds each.
    pub fn rays(&self, points: &[[f64; 2]]) -> Vec<Option<Ray<f64>>> {
        if self.aiming != Aiming::Stop {
            return points.iter().map(|p| self.ray(*p)).collect();
        }
        let found = self.aim_all_coordinates(points);
        found.into_iter().map(|q| Some(self.source.ray(q?))).collect()
    }

    /// The ray that crosses the real stop at a point of it, in stop radii, if its rim limits the
    /// beam; else, and if no such ray is found, that at these pupil coordinates.
    pub fn ray_through_stop(&self, p: [f64; 2]) -> Option<Ray<f64>> {
        if self.aiming == Aiming::Chief && !self.model.ends_at_disc() {
            // Rounding must not decide whether a ray at the rim passes.
            let inside = p.map(|v| v * (1.0 - INSIDE_RIM));
            if let Some(q) = self.aim_coordinates(inside) {
                return Some(self.source.ray(q));
            }
        }
        self.ray(p)
    }

    /// The rays that cross the real stop at some points of it, as [`Launch::ray_through_stop`] finds
    /// each.
    pub fn rays_through_stop(&self, points: &[[f64; 2]]) -> Vec<Option<Ray<f64>>> {
        if self.model.ends_at_disc() {
            return self.rays(points);
        }
        let inside: Vec<_> = points.iter().map(|p| p.map(|v| v * (1.0 - INSIDE_RIM))).collect();
        if self.aiming != Aiming::Chief {
            return self.rays(&inside);
        }
        let found = self.aim_all_coordinates(&inside);
        let ray = |(q, p): (Option<[f64; 2]>, &[f64; 2])| {
            q.map_or_else(|| self.ray(*p), |q| Some(self.source.ray(q)))
        };
        found.into_iter().zip(points).map(ray).collect()
    }

    /// The intersection of the ray at these pupil coordinates with the plane in which pupils are
    /// compared, in mm: the plane through the first vertex, or, if the field of view is wide
    /// ([`Launch::is_across_beam`]), the one perpendicular to the beam. `None` if no ray was found
    /// that crosses the stop there.
    pub fn crossing(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        self.ray_coordinates(p).map(|q| self.crossing_at(q))
    }

    fn crossing_at<R: Real>(&self, q: [R; 2]) -> [R; 2] {
        if self.is_across_beam() { q } else { self.source.at_vertex(q) }
    }

    /// The same with the area of one unit of pupil coordinates there, in mm². It varies over the
    /// pupil if every ray is aimed at the stop.
    pub(super) fn crossing_with_area(&self, p: [f64; 2]) -> Option<([f64; 2], f64)> {
        let [x, y] = self.crossing_at(self.dual_ray_coordinates(p)?);
        let area = x.slope[0] * y.slope[1] - x.slope[1] * y.slope[0];
        Some(([x.value, y.value], area.abs()))
    }

    /// True if [`Launch::crossing`] uses the plane perpendicular to the beam: for a collimated beam
    /// that grazes the plane through the first vertex, and for every beam of a lens whose field
    /// reaches beyond 45 degrees, where the vertex plane would stretch the pupils at the edge too
    /// much to compare them.
    pub fn is_across_beam(&self) -> bool {
        let FieldSource::Collimated { direction, .. } = self.source else { return false };
        let beam = &self.model.beam;
        direction.z <= GRAZING || (beam.field == FieldKind::Angle && beam.edge.abs() > WIDE)
    }

    /// The optical path from the object point to the start of a ray of this field, or from the
    /// plane wave through the first vertex, in mm.
    pub fn optical_path_to(&self, ray: Ray<f64>) -> f64 {
        let index = self.channel().system.index_before;
        let away = match self.source {
            FieldSource::Collimated { .. } => ray.point,
            FieldSource::Point { from, .. } | FieldSource::Slopes { from } => ray.point - from,
        };
        index * away.dot(ray.direction)
    }

    /// The ray at these pupil coordinates over any number type, for an aiming that needs no search
    /// for each ray.
    #[inline(always)]
    pub(super) fn mapped_ray<R: Real>(&self, p: [R; 2]) -> Ray<R> {
        self.source.ray(self.map.map(p))
    }

    /// The rays at some pupil coordinates if none of them has to be searched for; the beam then has the share 1
    /// everywhere.
    pub(super) fn mapped_rays(&self, points: &[[f64; 2]]) -> Option<Rays<f64>> {
        if self.aiming == Aiming::Stop {
            return None;
        }
        let column = || vec![0.0; points.len()];
        let mut rays =
            Rays { x: column(), y: column(), z: column(), l: column(), m: column(), n: column() };
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                let starts = rays.x.iter_mut().zip(&mut rays.y).zip(&mut rays.z);
                let directions = rays.l.iter_mut().zip(&mut rays.m).zip(&mut rays.n);
                for (p, (((x, y), z), ((l, m), n))) in points.iter().zip(starts.zip(directions)) {
                    let ray = self.mapped_ray(*p);
                    (*x, *y, *z) = (ray.point.x, ray.point.y, ray.point.z);
                    (*l, *m, *n) = (ray.direction.x, ray.direction.y, ray.direction.z);
                }
            },
        );
        Some(rays)
    }

    /// Traces the rays of some pupil points: the indices of those points from which a ray could be
    /// launched, and the ends of these rays in the same order.
    pub fn trace_points(&self, points: &[[f64; 2]]) -> (Vec<usize>, ImagePoints<f64>) {
        self.trace_points_into(points)
    }

    /// The same with the ends of the rays in another form.
    pub fn trace_points_into<S: TraceSink<f64> + Default>(
        &self,
        points: &[[f64; 2]],
    ) -> (Vec<usize>, S) {
        let mut rays = Rays::with_capacity(points.len());
        let mut launched = Vec::with_capacity(points.len());
        for (i, ray) in self.rays(points).into_iter().enumerate() {
            if let Some(ray) = ray {
                rays.push(ray);
                launched.push(i);
            }
        }
        let mut traced = S::default();
        self.channel().tracer.trace_batch(&rays, &mut traced);
        (launched, traced)
    }

    /// The ray at these pupil coordinates with its derivatives by the two pupil coordinates.
    pub fn dual_ray(&self, p: [f64; 2]) -> Option<Ray<Dual2>> {
        self.dual_ray_coordinates(p).map(|q| self.source.ray(q))
    }

    fn dual_ray_coordinates(&self, p: [f64; 2]) -> Option<[Dual2; 2]> {
        if self.aiming != Aiming::Stop {
            let variables = [Dual2::variable(p[0], 0), Dual2::variable(p[1], 1)];
            return Some(self.map.map(variables));
        }
        let found = self.aim(p)?;
        let map = found.pupil_map(self.model.stop_radius())?;
        Some(
            [0, 1].map(|i| Dual2 {
                value: found.q[i],
                slope: [map.columns[0][i], map.columns[1][i]],
            }),
        )
    }

    /// The intersection of the ray at these pupil coordinates with the stop, in mm, without
    /// clipping.
    pub fn stop_point(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        let ray = self.source.ray(self.ray_coordinates(p)?.map(Dual2::constant));
        let landing = self.channel().unclipped.trace_to(ray, self.model.stop());
        let point = landing.ray.point.value();
        landing.fate.is_imaged().then_some([point.x, point.y])
    }

    /// The ray at these pupil coordinates at the image, without clipping, with its derivatives;
    /// `None` if it does not get there.
    pub fn unclipped_landing(&self, p: [f64; 2]) -> Option<TracedRay<Dual2>> {
        let landing = self.channel().unclipped.trace(self.dual_ray(p)?);
        landing.fate.is_imaged().then_some(landing)
    }

    /// The rays at some pupil coordinates at the image, without clipping, each with its optical path and with
    /// their derivatives, traced together; `None` for those that do not get there.
    pub fn unclipped_landings(
        &self,
        points: impl Iterator<Item = [f64; 2]>,
    ) -> Vec<Option<(Ray<Dual2>, Dual2)>> {
        let started: Vec<Option<Ray<Dual2>>> = points.map(|p| self.dual_ray(p)).collect();
        let rays: Rays<Dual2> = started.iter().flatten().copied().collect();
        let mut landed = Landings::default();
        self.channel().unclipped.trace_batch(&rays, &mut landed);
        let mut traced = 0..rays.len();
        let end = |i: usize| landed.fate(i).is_imaged().then(|| (landed.ray(i), landed.opl[i]));
        started.iter().map(|ray| ray.and_then(|_| traced.next()).and_then(end)).collect()
    }

    /// The derivatives of the direction cosines `L'` and `M'` at the image by the pupil
    /// coordinates; `None` for a ray that is lost.
    pub fn direction_derivatives(&self, p: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let ray = self.ray(p)?;
        if !self.channel().tracer.trace(ray).fate.is_imaged() {
            return None;
        }
        let direction = self.unclipped_landing(p)?.ray.direction;
        Some([direction.x.slope, direction.y.slope])
    }

    fn ray_coordinates(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        match self.aiming {
            Aiming::Paraxial | Aiming::Chief => Some(self.map.map(p)),
            Aiming::Stop => self.aim_coordinates(p),
        }
    }

    /// The ray coordinates of the ray through a point of the stop, in stop radii.
    fn aim_coordinates(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        aim_from_chief_ray(self.model, self.wavelength, &self.source, &self.map, p)
            .or_else(|| Some(self.aim(p)?.q))
    }

    /// The same for several points, most of them searched for together.
    fn aim_all_coordinates(&self, points: &[[f64; 2]]) -> Vec<Option<[f64; 2]>> {
        let found =
            aim_all_from_chief_ray(self.model, self.wavelength, &self.source, &self.map, points);
        let alone = |p: &[f64; 2]| Some(self.aim(*p)?.q);
        found.into_iter().zip(points).map(|(q, p)| q.or_else(|| alone(p))).collect()
    }

    fn aim(&self, p: [f64; 2]) -> Option<AimedRay> {
        let radius = self.model.stop_radius();
        let (guess, target) = (self.map.map(p), p.map(|v| v * radius));
        aim_at(self.model, self.wavelength, &self.source, self.model.stop(), guess, target)
    }

    /// The pupil point, inside the pupil or not, whose ray goes through a point of a surface, in its own
    /// frame in mm, without clipping; `None` if none was found.
    pub(super) fn through_point(&self, surface: usize, point: [f64; 2]) -> Option<[f64; 2]> {
        let (model, source) = (self.model, &self.source);
        let search = |start: [f64; 2]| {
            let guess = self.map.map(start);
            aim_at(model, self.wavelength, source, surface, guess, point)
        };
        let starts = [[0.0, 0.0], [0.0, 0.9], [0.0, -0.9], [0.9, 0.0], [-0.9, 0.0]];
        let q = starts.into_iter().find_map(search)?.q;
        if self.aiming != Aiming::Stop {
            return self.map.inverse(q);
        }
        let landing =
            self.channel().unclipped.trace_to(source.ray(q.map(Dual2::constant)), model.stop());
        let point = landing.ray.point.value();
        let radius = model.stop_radius();
        landing.fate.is_imaged().then_some([point.x / radius, point.y / radius])
    }

    /// The real ray through the centre of the stop, found by continuation from the axis to the
    /// field.
    fn chief_ray(&self) -> Option<AimedRay> {
        let mut continuation = ChiefRayContinuation { done: 0.0, shift: [0.0; 2], slope: [0.0; 2] };
        let mut step: f64 = if self.is_wide() { 0.125 } else { 1.0 };
        let mut found = self.chief_ray_at(&continuation, 0.0)?;
        while continuation.done < 1.0 {
            let next = (continuation.done + step).min(1.0);
            if let Some(there) = self.chief_ray_at(&continuation, next) {
                continuation.advance(next, there.shift);
                found = there;
            } else {
                step *= 0.5;
                if step < SMALLEST_STEP {
                    return None;
                }
            }
        }
        Some(found)
    }

    fn is_wide(&self) -> bool {
        match self.source {
            FieldSource::Collimated { direction, .. } => direction.z < 0.9,
            FieldSource::Point { .. } | FieldSource::Slopes { .. } => false,
        }
    }

    /// The chief ray at a fraction of the field, searched from the prediction of the continuation.
    fn chief_ray_at(&self, continuation: &ChiefRayContinuation, fraction: f64) -> Option<AimedRay> {
        let field =
            FieldPoint { x: self.field.x * fraction, y: self.field.y * fraction, ..self.field };
        let source = field_source(self.model, field)?;
        let paraxial = paraxial_map(self.model, &source);
        let shift = continuation.predict(fraction);
        let guess = [paraxial.origin[0] + shift[0], paraxial.origin[1] + shift[1]];
        let mut found =
            aim_at(self.model, self.wavelength, &source, self.model.stop(), guess, [0.0; 2])?;
        found.shift = [found.q[0] - paraxial.origin[0], found.q[1] - paraxial.origin[1]];
        Some(found)
    }
}

/// The smallest step of the continuation, as a fraction of the field; below it the field counts as
/// unreachable.
const SMALLEST_STEP: f64 = 1e-3;

/// The continuation of the chief ray from the axis to a field: the shift between its coordinates
/// and the paraxial ones, and the slope of that shift.
struct ChiefRayContinuation {
    done: f64,
    shift: [f64; 2],
    slope: [f64; 2],
}

impl ChiefRayContinuation {
    fn predict(&self, fraction: f64) -> [f64; 2] {
        [0, 1].map(|i| self.shift[i] + (fraction - self.done) * self.slope[i])
    }

    fn advance(&mut self, fraction: f64, shift: [f64; 2]) {
        self.slope = [0, 1].map(|i| (shift[i] - self.shift[i]) / (fraction - self.done));
        (self.done, self.shift) = (fraction, shift);
    }
}
