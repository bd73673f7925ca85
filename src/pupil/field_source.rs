//! The origin of the rays of a field: a direction or a point, and the ray coordinates in a plane.

use super::ray_model::RayModel;
use crate::lens::{FieldKind, FieldPoint, Object};
use crate::math::{Real, Vec3};
use crate::trace::Ray;

/// The origin that all rays of a field share.
#[derive(Debug, Clone, Copy, PartialEq)]
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
pub(super) const GRAZING: f64 = 0.05;

impl FieldSource {
    /// The ray with these ray coordinates.
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

    /// The distance along the axis from the first vertex at which rays start, in mm.
    pub(super) fn distance(&self) -> f64 {
        match self {
            Self::Collimated { .. } => 0.0,
            Self::Point { from, .. } | Self::Slopes { from } => from.z.abs(),
        }
    }

    /// The intersection of the ray with the plane through the first vertex, in mm.
    pub(super) fn at_vertex<R: Real>(&self, q: [R; 2]) -> [R; 2] {
        let Ray { point, direction } = self.ray(q);
        let met = point - direction * (point.z / direction.z);
        [met.x, met.y]
    }
}

/// A ray from a point, or from the first vertex plane towards a point behind it.
#[inline(always)]
pub(super) fn from_point<R: Real>(from: Vec3<R>, along: Vec3<R>) -> Ray<R> {
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
    /// The ray coordinates at these pupil coordinates.
    #[inline(always)]
    pub(super) fn map<R: Real>(&self, p: [R; 2]) -> [R; 2] {
        let [a, b] = self.columns;
        let row = |i: usize| {
            R::from_f64(self.origin[i]) + R::from_f64(a[i]) * p[0] + R::from_f64(b[i]) * p[1]
        };
        [row(0), row(1)]
    }

    /// The pupil coordinates at these ray coordinates; `None` if the map has no inverse.
    pub(super) fn inverse(&self, q: [f64; 2]) -> Option<[f64; 2]> {
        let [[a, b], [c, d]] = self.columns;
        solve_2x2([[a, c], [b, d]], [q[0] - self.origin[0], q[1] - self.origin[1]])
    }
}

/// The source of a field; `None` if the lens gives the field's unit no meaning.
pub(super) fn field_source(model: &RayModel, field: FieldPoint) -> Option<FieldSource> {
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
pub(super) fn paraxial_map(model: &RayModel, source: &FieldSource) -> PupilMap {
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

/// The solution of a system of two linear equations.
pub(super) fn solve_2x2([[a, b], [c, d]]: [[f64; 2]; 2], [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = a * d - b * c;
    let solution = [(d * x - b * y) / determinant, (a * y - c * x) / determinant];
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}
