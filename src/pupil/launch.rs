//! Where a ray starts.
//!
//! Every ray of a field is named by its point `q` in a plane: for a collimated beam the plane
//! across the beam through the first vertex, so that 90 degrees and more are nothing special; for
//! an object point the plane of the entrance pupil; in a telecentric beam `q` is the slope. A chart
//! leads from pupil coordinates to that plane.

use super::aim::{AimedRay, aim_at, solve_2x2};
use super::ray_model::{Aiming, Channel, Dual2, RayModel};
use crate::lens::{FieldKind, FieldPoint, Object};
use crate::math::Real;
use crate::math::Vec3;
use crate::trace::{Ray, TracedRay};
use serde::Serialize;

/// Why a field has no rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LaunchError {
    /// Nothing defines the field point.
    #[error("the field has no object point: the lens gives the field's unit no meaning")]
    NoObjectPoint,
    /// No ray of the field through the centre of the stop was found.
    #[error("no ray of this field was found that crosses the centre of the stop")]
    NotAimed,
    /// There is no such wavelength.
    #[error("there is no such wavelength")]
    NoWavelength,
}

/// What all rays of a field have in common.
#[derive(Debug, Clone, Copy)]
pub(super) enum FieldSource {
    /// A direction; `across` spans the plane perpendicular to it, `ahead` is how far in front of
    /// that plane a ray starts that does not start at the first vertex plane.
    Collimated { direction: Vec3<f64>, across: [Vec3<f64>; 2], ahead: f64 },
    /// A point, and the plane `z = through` in which rays are named.
    Point { from: Vec3<f64>, through: f64 },
    /// A point whose rays are named by their slopes.
    Slopes { from: Vec3<f64> },
}

/// Below this direction cosine a collimated ray starts in front of the lens instead of at the
/// vertex plane, which it may meet far behind the lens or never.
const GRAZING: f64 = 0.05;

/// A field beyond this many degrees is a wide one.
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
    /// Where the ray meets the plane through the first vertex, in mm.
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

/// An affine map from pupil coordinates to the plane in which rays are named.
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

/// From where the rays of one field and wavelength start, whatever becomes of the lens behind: what
/// an integral over a moving pupil keeps while the lens moves.
#[derive(Debug, Clone, Copy)]
pub struct FixedLaunch {
    field: FieldPoint,
    wavelength: usize,
    aiming: Aiming,
    source: FieldSource,
    map: PupilMap,
}

impl FixedLaunch {
    /// The same rays through a lens of the same wavelengths.
    pub fn launch(self, model: &RayModel) -> Launch<'_> {
        let Self { field, wavelength, aiming, source, map: chart } = self;
        Launch { model, field, wavelength, aiming, source, map: chart }
    }
}

/// The rays of one field at one wavelength.
#[derive(Debug, Clone)]
pub struct Launch<'a> {
    /// The lens.
    pub model: &'a RayModel,
    /// The field.
    pub field: FieldPoint,
    /// Which wavelength.
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

    /// Where its rays start.
    pub fn to_fixed(&self) -> FixedLaunch {
        let Self { field, wavelength, aiming, source, map: chart, .. } = *self;
        FixedLaunch { field, wavelength, aiming, source, map: chart }
    }

    /// The cosine of the angle with the axis at which a collimated beam arrives; `None` for the
    /// rays of an object point.
    pub fn axis_cosine(&self) -> Option<f64> {
        match self.source {
            FieldSource::Collimated { direction, .. } => Some(direction.z),
            FieldSource::Point { .. } | FieldSource::Slopes { .. } => None,
        }
    }

    /// Whether the rays are those of a point on the axis, so that all azimuths are alike.
    pub(super) fn is_axial(&self) -> bool {
        self.field.x == 0.0 && self.field.y == 0.0
    }

    /// The lens at this wavelength.
    pub fn channel(&self) -> &'a Channel {
        &self.model.channels[self.wavelength]
    }

    /// Whether the rays at `(−px, py)` mirror those at `(px, py)`.
    pub fn is_symmetric(&self) -> bool {
        self.field.x == 0.0
    }

    /// The area in mm² of the first vertex plane that one unit of pupil coordinates stands for: the
    /// measure of integrals over a pupil. Where a collimated beam grazes that plane (a direction
    /// cosine below 0.05), across the beam instead.
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

    /// The ray at these pupil coordinates; `None` where none was found that crosses the stop
    /// there.
    pub fn ray(&self, p: [f64; 2]) -> Option<Ray<f64>> {
        Some(self.source.ray(self.ray_coordinates(p)?))
    }

    /// Where the ray at these pupil coordinates crosses the plane in which pupils are compared, in
    /// mm: the plane through the first vertex, or, where the field of the lens is wide
    /// ([`Launch::is_across_beam`]), the one across the beam. `None` where no ray was found that crosses
    /// the stop there.
    pub fn crossing(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        self.ray_coordinates(p).map(|q| self.crossing_at(q))
    }

    fn crossing_at<R: Real>(&self, q: [R; 2]) -> [R; 2] {
        if self.is_across_beam() { q } else { self.source.at_vertex(q) }
    }

    /// The same with the area in mm² that one unit of pupil coordinates stands for there. Where
    /// every ray is aimed at the stop, that changes over the pupil.
    pub(super) fn crossing_with_area(&self, p: [f64; 2]) -> Option<([f64; 2], f64)> {
        let [x, y] = self.crossing_at(self.dual_ray_coordinates(p)?);
        let area = x.slope[0] * y.slope[1] - x.slope[1] * y.slope[0];
        Some(([x.value, y.value], area.abs()))
    }

    /// Whether [`Launch::crossing`] looks along the beam: a collimated one that grazes the plane
    /// through the first vertex, and every one of a lens whose field reaches beyond 45 degrees,
    /// where that plane stretches the pupils at the edge out of all comparison.
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

    /// The ray at these pupil coordinates over any number type, for coordinates that need no search
    /// for the stop: an affine map to the plane in which rays are named.
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

    /// Where the ray at these pupil coordinates crosses the stop, clipped by nothing.
    pub fn stop_point(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        let ray = self.source.ray(self.ray_coordinates(p)?.map(Dual2::constant));
        let landing = self.channel().unclipped.trace_to(ray, self.model.stop());
        let point = landing.ray.point.value();
        landing.fate.is_imaged().then_some([point.x, point.y])
    }

    /// The ray at these pupil coordinates at the image, clipped by nothing, with its derivatives;
    /// `None` where it does not get there.
    pub fn unclipped_landing(&self, p: [f64; 2]) -> Option<TracedRay<Dual2>> {
        let landing = self.channel().unclipped.trace(self.dual_ray(p)?);
        landing.fate.is_imaged().then_some(landing)
    }

    /// The derivatives by the pupil coordinates of the direction cosines `L'` and `M'` with which
    /// a ray arrives; `None` for a ray that is lost.
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

    /// The pupil point whose ray, clipped by nothing, goes through the vertex of a surface, inside
    /// the pupil or not; `None` where none was found.
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

    /// The real ray through the centre of the stop, followed from the axis to the field.
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

    /// The chief ray at a fraction of the field, from where the walk so far predicts it.
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

/// A field that cannot be reached in steps this small, as a fraction of it, is not reached.
const SMALLEST_STEP: f64 = 1e-3;

/// The way from the axis to a field: how far the chief ray's place is from its paraxial one.
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

/// The unit vector in the direction of a field, `length` of it given.
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

/// The chart of the paraxial entrance pupil.
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
