//! A fixed set of rays through the paraxial entrance pupil, for each field point and zoom position.

use crate::lens::{FieldKind, FieldPoint, Lens, LensError, Object};
use crate::math::Vec3;
use crate::paraxial::{Beam, FirstOrder, first_order};
use crate::trace::Ray;

/// Rays for each field point and zoom position.
pub(super) const RAYS: usize = 200;

/// The start of the rays of a zoom position.
pub(super) struct ProbeLaunch {
    object: Object,
    kind: FieldKind,
    pub(super) data: Option<FirstOrder<f64>>,
    /// The position of the pupil from the first vertex and its semi-diameter, in mm.
    pupil: (f64, f64),
}

impl ProbeLaunch {
    pub(super) fn new(lens: &Lens, zoom: usize) -> Result<Self, LensError> {
        let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?;
        let data = first_order(&system, &Beam::for_lens(lens, zoom)).ok();
        let pupil = data.as_ref().and_then(|data| {
            let pupil = data.entrance_pupil;
            Some((pupil.position?, 0.5 * pupil.diameter?.abs()))
        });
        // Without a paraxial pupil the first surface takes its place.
        let first = system.surfaces[0].semi_diameter;
        let open = (0.0, if first.is_finite() { first } else { 1.0 });
        let kind = lens.fields_at(zoom).kind;
        Ok(Self { object: lens.object, kind, data, pupil: pupil.unwrap_or(open) })
    }

    /// The rays of one field point, distributed evenly over the pupil.
    pub(super) fn rays(&self, field: FieldPoint) -> impl Iterator<Item = Ray<f64>> {
        self.many_rays(field, RAYS)
    }

    /// A number of rays of one field point, distributed evenly over the pupil.
    pub(super) fn many_rays(
        &self,
        field: FieldPoint,
        count: usize,
    ) -> impl Iterator<Item = Ray<f64>> {
        self.rays_through(field, sunflower(count))
    }

    /// The same rays, each with its point of the unit disc.
    pub(super) fn points_and_rays(
        &self,
        field: FieldPoint,
        count: usize,
    ) -> impl Iterator<Item = ([f64; 2], Ray<f64>)> {
        sunflower(count).zip(self.many_rays(field, count))
    }

    /// The rays of one field point through points of the pupil, whose edge is the unit circle.
    pub(super) fn rays_through(
        &self,
        field: FieldPoint,
        points: impl Iterator<Item = [f64; 2]>,
    ) -> impl Iterator<Item = Ray<f64>> {
        let origin = self.origin(field);
        points.map(move |[x, y]| {
            let (z, radius) = self.pupil;
            let target = Vec3::new(x * radius, y * radius, z);
            match origin {
                ProbeOrigin::Far(direction) => {
                    Ray { point: launch_point(target, direction), direction }
                }
                ProbeOrigin::Near(point) => {
                    let way = target - point;
                    let sense = if way.z < 0.0 { -1.0 } else { 1.0 };
                    let direction = way * (sense / way.dot(way).sqrt());
                    Ray { point, direction }
                }
            }
        })
    }

    fn origin(&self, field: FieldPoint) -> ProbeOrigin {
        let focal = self.data.as_ref().and_then(|data| data.efl).unwrap_or(1.0);
        let scale = self.data.as_ref().and_then(|data| data.magnification).unwrap_or(1.0);
        let degrees = std::f64::consts::PI / 180.0;
        let (to_angle, to_height) = match self.kind {
            FieldKind::Angle => (degrees, None),
            FieldKind::ObjectHeight => (0.0, Some(1.0)),
            FieldKind::ImageHeight => (1.0 / focal, Some(1.0 / scale)),
        };
        match (self.object, to_height) {
            (Object::Infinity, _) => ProbeOrigin::Far(direction(field, to_angle)),
            (Object::Finite(distance), Some(to_height)) => {
                ProbeOrigin::Near(Vec3::new(field.x * to_height, field.y * to_height, -distance))
            }
            (Object::Finite(distance), None) => {
                let (z, _) = self.pupil;
                let height = |angle: f64| -(angle * degrees).tan() * (distance + z);
                ProbeOrigin::Near(Vec3::new(height(field.x), height(field.y), -distance))
            }
        }
    }
}

/// The source of a field point: a direction of propagation, or a point.
#[derive(Clone, Copy)]
enum ProbeOrigin {
    Far(Vec3<f64>),
    Near(Vec3<f64>),
}

fn direction(field: FieldPoint, to_angle: f64) -> Vec3<f64> {
    let angle = field.x.hypot(field.y) * to_angle;
    let share = if angle == 0.0 { 0.0 } else { angle.sin() / field.x.hypot(field.y) };
    Vec3::new(field.x * share, field.y * share, angle.cos())
}

/// The point of the ray at the first vertex plane; `target` if the ray is nearly parallel to it.
fn launch_point(target: Vec3<f64>, direction: Vec3<f64>) -> Vec3<f64> {
    if direction.z < 0.01 { target } else { target - direction * (target.z / direction.z) }
}

/// Points distributed evenly over the unit disc, on a golden-angle spiral.
fn sunflower(count: usize) -> impl Iterator<Item = [f64; 2]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let radius = ((i as f64 + 0.5) / count as f64).sqrt();
        let (sin, cos) = (golden * i as f64).sin_cos();
        [radius * cos, radius * sin]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Fields, blank};

    #[test]
    fn rays_of_an_angle_come_from_the_point_that_the_pupil_sees_under_it() {
        // The stop is the first surface, so that the entrance pupil is there.
        let mut lens = blank();
        lens.surfaces[0].curvature = 0.02;
        let degrees = [[0.0, 0.0], [0.0, 12.0], [-7.0, 3.0]];
        let point = |[x, y]: [f64; 2]| FieldPoint { x, y, weight: 1.0 };
        let values = degrees.map(point).to_vec();
        lens.fields = Fields { kind: FieldKind::Angle, values: values.clone() };
        lens.object = Object::Finite(300.0);
        let launch = ProbeLaunch::new(&lens, 0).unwrap();
        for field in values {
            for ray in launch.rays(field) {
                let Vec3 { x, y, z } = ray.point;
                assert_eq!(z, -300.0);
                let seen = [x, y].map(|height| -(height / z.abs()).atan().to_degrees());
                let off = (seen[0] - field.x).hypot(seen[1] - field.y);
                assert!(off < 1e-9, "{seen:?} {field:?}");
            }
        }
    }
}
