//! The rays of a field: from pupil coordinates to a point and a direction.
//!
//! Every ray of a field is identified by its coordinates `q` in a plane: for a collimated beam the
//! plane perpendicular to the beam through the first vertex, so that field angles of 90 degrees and
//! more need no special case; for an object point the plane of the entrance pupil; for a
//! telecentric beam `q` is the slope. A [`PupilMap`] leads from pupil coordinates to that plane.

use super::aim::{AimedRay, aim_at, solve_2x2};
use super::ray_model::{Aiming, Channel, Dual2, RayModel};
use crate::lens::{FieldKind, FieldPoint, Object};
use crate::math::Real;
use crate::math::Vec3;
use crate::trace::{Ray, TracedRay};
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

/// The origin that all rays of a field share.
#[derive(Debug, Clone, Copy)]
pub(super) enum FieldSource {
    /// A direction. `across` spans the plane perpendicular to it; `ahead` is the distance in front
    /// of that plane at which a ray starts that cannot start at the first vertex plane, in mm.
    Collimated { direction: Vec3<f64>, across: [Vec3<f64>; 2], ahead: f64 },
    /// A point, and the plane `z = through` of the ray coordinates.
    Point { from: Vec3<f64>, through: f64 },
    /// A point whose ray coordinates are slopes.
    Slopes { from: Vec3<f64> },
}

/// Below this direction cosine a collimated ray starts in front of the lens, not at the vertex
/// plane, which it may meet far behind the lens or never.
const GRAZING: f64 = 0.05;

/// A field beyond this angle, in degrees, is wide.
const WIDE: f64 = 45.0;

impl FieldSource {
    #[inline(always)]
    pub(super) fn ray<R: Real>(&self, q: [R; 2]) -> Ray<R> {
        match *self {
            Self::Collimated { direction, across, ahead } => {
                let along = Vec3::from_f64(direction);
                let [e, f] = across.map(Vec3::from_f64);
                let point = e * q[0] + f * q[1];
                let slide =
                    if direction.z > GRAZING { -(point.z / along.z) } else { R::from_f64(-ahead) };
                Ray { point: point + along * slide, direction: along }
            }
            Self::Point { from, through } => {
                let forwards = if through > from.z { R::ONE } else { -R::ONE };
                let from = Vec3::from_f64(from);
                let target = Vec3::new(q[0], q[1], R::from_f64(through));
                from_point(from, (target - from) * forwards)
            }
            Self::Slopes { from } => {
                from_point(Vec3::from_f64(from), Vec3::new(q[0], q[1], R::ONE))
            }
        }
    }
}

impl FieldSource {
    /// The intersection of the ray with the plane through the first vertex, in mm.
    fn at_vertex<R: Real>(&self, q: [R; 2]) -> [R; 2] {
        let Ray { point, direction } = self.ray(q);
        let met = point - direction * (point.z / direction.z);
        [met.x, met.y]
    }
}

/// A ray from a point, or from the first vertex plane towards a point behind it.
#[inline(always)]
fn from_point<R: Real>(from: Vec3<R>, along: Vec3<R>) -> Ray<R> {
    let direction = along * (R::ONE / along.dot(along).sqrt());
    let point = if from.z > R::ZERO { from - direction * (from.z / direction.z) } else { from };
    Ray { point, direction }
}

/// An affine map from pupil coordinates to ray coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PupilMap {
    pub(super) origin: [f64; 2],
    pub(super) columns: [[f64; 2]; 2],
}

impl PupilMap {
    #[inline(always)]
    pub(super) fn map<R: Real>(&self, p: [R; 2]) -> [R; 2] {
        let [a, b] = self.columns;
        let row = |i: usize| {
            R::from_f64(self.origin[i]) + R::from_f64(a[i]) * p[0] + R::from_f64(b[i]) * p[1]
        };
        [row(0), row(1)]
    }

    fn inverse(&self, q: [f64; 2]) -> Option<[f64; 2]> {
        let [[a, b], [c, d]] = self.columns;
        solve_2x2([[a, c], [b, d]], [q[0] - self.origin[0], q[1] - self.origin[1]])
    }
}

/// The rays of one field and wavelength, independent of the lens: an integral over a moving pupil
/// keeps them while the lens changes.
#[derive(Debug, Clone, Copy)]
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
        let Self { field, wavelength, aiming, source, map: chart } = self;
        Launch { model, field, wavelength, aiming, source, map: chart }
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
        let chart = paraxial_map(model, &source);
        let mut launch = Self { model, field, wavelength, aiming, source, map: chart };
        match aiming {
            Aiming::Paraxial => {}
            Aiming::Chief | Aiming::Stop => {
                let chief = launch.chief_ray().ok_or(LaunchError::NotAimed)?;
                launch.map = chief.pupil_map(model.stop_radius()).ok_or(LaunchError::NotAimed)?;
            }
        }
        Ok(launch)
    }

    /// The same rays, independent of the lens.
    pub fn to_fixed(&self) -> FixedLaunch {
        let Self { field, wavelength, aiming, source, map: chart, .. } = *self;
        FixedLaunch { field, wavelength, aiming, source, map: chart }
    }

    /// The cosine of the angle between a collimated beam and the axis; `None` for the rays of an
    /// object point.
    pub fn axis_cosine(&self) -> Option<f64> {
        match self.source {
            FieldSource::Collimated { direction, .. } => Some(direction.z),
            FieldSource::Point { .. } | FieldSource::Slopes { .. } => None,
        }
    }

    /// True for a field on the axis: all azimuths of its pupil are alike.
    pub(super) fn is_axial(&self) -> bool {
        self.field.x == 0.0 && self.field.y == 0.0
    }

    /// The lens at this wavelength.
    pub fn channel(&self) -> &'a Channel {
        &self.model.channels[self.wavelength]
    }

    /// True if the rays at `(−px, py)` mirror those at `(px, py)`.
    pub fn is_symmetric(&self) -> bool {
        self.field.x == 0.0
    }

    /// The area of one unit of pupil coordinates, in mm² of the first vertex plane: the measure of
    /// integrals over a pupil. For a collimated beam that grazes that plane (a direction cosine
    /// below 0.05), the area perpendicular to the beam.
    pub fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.map.columns;
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

    /// The ray at these pupil coordinates; `None` if none was found that crosses the stop there.
    pub fn ray(&self, p: [f64; 2]) -> Option<Ray<f64>> {
        Some(self.source.ray(self.ray_coordinates(p)?))
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
        let chart = found.pupil_map(self.model.stop_radius())?;
        Some([0, 1].map(|i| Dual2 {
            value: found.q[i],
            slope: [chart.columns[0][i], chart.columns[1][i]],
        }))
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
            Aiming::Stop => self.aim(p).map(|found| found.q),
        }
    }

    fn aim(&self, p: [f64; 2]) -> Option<AimedRay> {
        let radius = self.model.stop_radius();
        let (guess, target) = (self.map.map(p), p.map(|v| v * radius));
        aim_at(self.model, self.wavelength, &self.source, self.model.stop(), guess, target)
    }

    /// The pupil point, inside the pupil or not, whose ray goes through the vertex of a surface
    /// without clipping; `None` if none was found.
    pub(super) fn through_vertex(&self, surface: usize) -> Option<[f64; 2]> {
        let (model, source) = (self.model, &self.source);
        let search = |start: [f64; 2]| {
            let guess = self.map.map(start);
            aim_at(model, self.wavelength, source, surface, guess, [0.0; 2])
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
        let mut walk = ChiefRayContinuation { done: 0.0, shift: [0.0; 2], slope: [0.0; 2] };
        let mut step: f64 = if self.is_wide() { 0.125 } else { 1.0 };
        let mut found = self.chief_ray_at(&walk, 0.0)?;
        while walk.done < 1.0 {
            let next = (walk.done + step).min(1.0);
            if let Some(there) = self.chief_ray_at(&walk, next) {
                walk.advance(next, there.shift);
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
    fn chief_ray_at(&self, walk: &ChiefRayContinuation, fraction: f64) -> Option<AimedRay> {
        let field =
            FieldPoint { x: self.field.x * fraction, y: self.field.y * fraction, ..self.field };
        let source = field_source(self.model, field)?;
        let paraxial = paraxial_map(self.model, &source);
        let shift = walk.predict(fraction);
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

fn field_source(model: &RayModel, field: FieldPoint) -> Option<FieldSource> {
    match (model.beam.field, model.beam.object) {
        (FieldKind::Angle, Object::Infinity) => {
            let angle = field.x.hypot(field.y).to_radians();
            collimated_source(model, field, angle)
        }
        (FieldKind::ImageHeight, Object::Infinity) => {
            let index = model.channels[model.primary].system.index_before;
            let slope = field.x.hypot(field.y) * model.first_order.power / index;
            let turned =
                FieldPoint { x: field.x * slope.signum(), y: field.y * slope.signum(), ..field };
            (slope != 0.0 || field.x.hypot(field.y) == 0.0)
                .then(|| collimated_source(model, turned, slope.abs().atan()))?
        }
        (FieldKind::ObjectHeight, Object::Finite(distance)) => {
            Some(point_source(model, field.x, field.y, distance))
        }
        (FieldKind::ImageHeight, Object::Finite(distance)) => {
            let scale = model.first_order.magnification?;
            Some(point_source(model, field.x / scale, field.y / scale, distance))
        }
        (FieldKind::Angle, Object::Finite(distance)) => {
            let reach = distance + model.first_order.entrance_pupil.position?;
            let angle = field.x.hypot(field.y);
            let height = -reach * angle.to_radians().tan();
            let [x, y] = field_direction(field, angle).map(|part| part * height);
            (angle < 90.0).then(|| point_source(model, x, y, distance))
        }
        (FieldKind::ObjectHeight, Object::Infinity) => None,
    }
}

/// The unit vector in the direction of a field of a given length.
fn field_direction(field: FieldPoint, length: f64) -> [f64; 2] {
    if length == 0.0 { [0.0, 1.0] } else { [field.x / length, field.y / length] }
}

fn collimated_source(model: &RayModel, field: FieldPoint, angle: f64) -> Option<FieldSource> {
    let (sin, cos) = angle.sin_cos();
    let [tx, ty] = field_direction(field, field.x.hypot(field.y));
    let direction = Vec3::new(sin * tx, sin * ty, cos);
    // Perpendicular to the beam, turned out of the x-y plane by the field angle about the axis
    // that is perpendicular to both: the projections of x and y for small angles.
    let turn = 1.0 - cos;
    let e = Vec3::new(1.0 - turn * tx * tx, -turn * tx * ty, -sin * tx);
    let f = Vec3::new(-turn * tx * ty, 1.0 - turn * ty * ty, -sin * ty);
    let system = &model.channels[model.primary].system;
    let first = &system.surfaces[0];
    let sizes = [first.semi_diameter, 1.0 / first.shape.curvature().abs()];
    let size = sizes.into_iter().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let pupil = model.first_order.entrance_pupil.position.unwrap_or(0.0).abs();
    let ahead = 4.0 * (size + pupil + model.first_order.marginal.heights[0].abs());
    angle.is_finite().then_some(FieldSource::Collimated { direction, across: [e, f], ahead })
}

fn point_source(model: &RayModel, x: f64, y: f64, distance: f64) -> FieldSource {
    let from = Vec3::new(x, y, -distance);
    match model.first_order.entrance_pupil.position {
        Some(through) => FieldSource::Point { from, through },
        None => FieldSource::Slopes { from },
    }
}

/// The map to the paraxial entrance pupil.
fn paraxial_map(model: &RayModel, source: &FieldSource) -> PupilMap {
    let pupil = model.first_order.entrance_pupil;
    let marginal = &model.first_order.marginal;
    let radius = pupil.diameter.map_or(marginal.heights[0].abs(), |d| 0.5 * d);
    match source {
        FieldSource::Collimated { across: [e, f], .. } => {
            let z = pupil.position.unwrap_or(0.0);
            PupilMap {
                origin: [e.z * z, f.z * z],
                columns: [[e.x * radius, f.x * radius], [e.y * radius, f.y * radius]],
            }
        }
        FieldSource::Point { .. } => scaled_map(radius),
        FieldSource::Slopes { .. } => scaled_map(marginal.start_slope.abs()),
    }
}

fn scaled_map(scale: f64) -> PupilMap {
    PupilMap { origin: [0.0; 2], columns: [[scale, 0.0], [0.0, scale]] }
}
