//! The beams of a draft: for every field an ellipse with the area that is asked for.

use crate::lens::{Lens, Object};
use crate::math::Vec3;
use crate::pupil::RayModel;
use crate::search::design::LensRequirements;
use crate::trace::{Ray, Rays, TraceSink as _};

/// The beams that a draft is judged with.
#[derive(Debug, Clone)]
pub(in crate::search::design) struct BeamPlan {
    /// The share of the aperture and of the field that are asked for, at most 1.
    pub(in crate::search::design) difficulty: [f64; 2],
    /// The weight of the squared violations of limits.
    pub(in crate::search::design) limit_weight: f64,
    /// The factors by which limits are tightened: lengths and shares.
    pub(in crate::search::design) margin: f64,
    /// The addition to the least thicknesses of glass and air at rims, in mm.
    pub(in crate::search::design) edge_margin: f64,
    /// The rays of the pupils of a lens with rims, in place of ellipses.
    pub(in crate::search::design) traced: Option<Vec<FieldBeam>>,
}

/// The rays of a field, the same for every wavelength.
#[derive(Debug, Clone)]
pub(in crate::search::design) struct FieldBeam {
    /// The angle with the axis, in radians.
    pub(in crate::search::design) angle: f64,
    /// The distance of a near object in front of the first vertex, in mm; `None` for a distant one.
    pub(in crate::search::design) object: Option<f64>,
    /// The weight of the field.
    pub(in crate::search::design) weight: f64,
    /// The points relative to its centre in the plane of the first vertex, in mm, each with its part
    /// of the light. They stand for their mirror images too.
    pub(in crate::search::design) points: Vec<([f64; 2], f64)>,
    /// The half-axes of the beam across and along the field, in mm.
    pub(in crate::search::design) axes: [f64; 2],
    /// The point of the chief ray, in mm.
    pub(in crate::search::design) chief: [f64; 2],
    /// The centre in that plane without the shift by the pupil's distance, in mm.
    pub(in crate::search::design) center: f64,
}

/// Gauss nodes and weights on the unit interval.
const FINE: ([f64; 4], [f64; 4]) = (
    [0.069_431_844, 0.330_009_478, 0.669_990_522, 0.930_568_156],
    [0.173_927_423, 0.326_072_577, 0.326_072_577, 0.173_927_423],
);
const COARSE: ([f64; 3], [f64; 3]) =
    ([0.112_701_665, 0.5, 0.887_298_335], [0.277_777_778, 0.444_444_444, 0.277_777_778]);
/// The number of azimuths in half a turn.
const AZIMUTHS: usize = 4;
/// The f-number below which the beams have four rings.
const FAST: f64 = 2.0;
/// The order of quadrature of beams that get through rims.
const TRACED_ORDER: usize = 1;
/// The fields between those that are asked for, relative to the last one, and their weight.
const BETWEEN: [f64; 2] = [0.4, 0.86];
const WEIGHT_BETWEEN: f64 = 0.1;

impl BeamPlan {
    /// The full beams with these weights of the limits.
    pub(in crate::search::design) fn full(limit_weight: f64) -> Self {
        Self { difficulty: [1.0, 1.0], limit_weight, margin: 0.0, edge_margin: 0.0, traced: None }
    }

    /// The same with this share less light.
    pub(super) fn dimmed(&self, share: f64) -> Self {
        let factor = (1.0 - share).sqrt();
        let mut plan = self.clone();
        plan.difficulty[0] *= factor;
        for beam in plan.traced.iter_mut().flatten() {
            beam.axes = beam.axes.map(|axis| factor * axis);
            for (point, _) in &mut beam.points {
                let chief = beam.chief;
                *point = [0, 1].map(|i| chief[i] + factor * (point[i] - chief[i]));
            }
        }
        plan
    }

    /// The beams of all fields.
    pub(super) fn beams(&self, asked: &LensRequirements) -> Vec<FieldBeam> {
        if let Some(traced) = &self.traced {
            return traced.clone();
        }
        let radius = self.difficulty[0] * asked.beam_radius();
        let mut fields: Vec<(f64, f64, f64)> = Vec::new();
        let axis = asked.clear_area.first().copied().unwrap_or(1.0);
        for (field, area) in asked.fields.iter().zip(&asked.clear_area) {
            fields.push((*field, 1.0, area / axis));
        }
        let between = BETWEEN.map(|part| part * asked.half_field());
        for field in between.into_iter().filter(|_| asked.half_field() > 0.0) {
            fields.push((field, WEIGHT_BETWEEN, share_at(asked, field)));
        }
        let beam = |&(field, weight, share): &(f64, f64, f64)| {
            let angle = (self.difficulty[1] * field).to_radians();
            let [x, y] = [radius * share.max(1.0).sqrt(), radius * share.min(share.sqrt())];
            let points = ellipse(field, [x, y], asked.f_number);
            let object = asked.object.map(|object| object.distance);
            let (axes, chief, center) = ([x, y], [0.0; 2], 0.0);
            FieldBeam { angle, object, weight, points, axes, chief, center }
        };
        fields.iter().map(beam).collect()
    }
}

/// The area of the beam of a field over that on the axis, by interpolation.
fn share_at(asked: &LensRequirements, field: f64) -> f64 {
    let axis = asked.clear_area.first().copied().unwrap_or(1.0);
    let after = asked.fields.iter().position(|f| *f >= field).unwrap_or(0).max(1);
    let (low, high) = (asked.fields[after - 1], asked.fields[after]);
    let part = (field - low) / (high - low);
    ((1.0 - part) * asked.clear_area[after - 1] + part * asked.clear_area[after]) / axis
}

/// The nodes of an ellipse with these semi-axes; on the axis those of one radius suffice.
fn ellipse(field: f64, [a, b]: [f64; 2], f_number: f64) -> Vec<([f64; 2], f64)> {
    let on_axis = field == 0.0;
    let rings: Vec<(f64, f64)> = if f_number < FAST || on_axis {
        FINE.0.into_iter().zip(FINE.1).collect()
    } else {
        COARSE.0.into_iter().zip(COARSE.1).collect()
    };
    let azimuths = if on_axis { 1 } else { AZIMUTHS };
    let mut points = Vec::new();
    for (square, weight) in rings {
        for j in 0..azimuths {
            let turn = if on_axis {
                0.0
            } else {
                std::f64::consts::PI * (j as f64 + 0.5) / azimuths as f64
            };
            let radius = square.sqrt();
            let point = [a * radius * turn.sin(), b * radius * turn.cos()];
            points.push((point, weight / azimuths as f64));
        }
    }
    points
}

impl FieldBeam {
    /// The ray through a point of the beam, for an entrance pupil at this distance behind the first
    /// vertex; it starts well in front of the lens, or at a near object.
    pub(super) fn ray(&self, [x, y]: [f64; 2], pupil: f64, back: f64) -> Ray<f64> {
        let slope = self.angle.tan();
        if let Some(distance) = self.object {
            let object = Vec3::new(0.0, -distance * slope, -distance);
            // The line from the object point to the middle of the pupil crosses the first vertex plane here.
            let chief = -pupil * slope * distance / (distance + pupil);
            let to = Vec3::new(x, y + self.center + chief, 0.0) - object;
            return Ray { point: object, direction: to * (1.0 / to.dot(to).sqrt()) };
        }
        let y = y + self.center - (pupil + back) * slope;
        let direction = Vec3::new(0.0, self.angle.sin(), self.angle.cos());
        Ray { point: Vec3::new(x, y, -back), direction }
    }

    /// The rays of all points.
    pub(super) fn push_rays(&self, pupil: f64, back: f64, rays: &mut Rays<f64>) {
        self.points.iter().for_each(|(point, _)| rays.push(self.ray(*point, pupil, back)));
    }

    /// A beam of given points.
    fn of_points(
        (angle, object): (f64, Option<f64>),
        weight: f64,
        points: Vec<([f64; 2], f64)>,
        chief: [f64; 2],
    ) -> Self {
        let reach = |i: usize| points.iter().map(|(p, _)| p[i].abs()).fold(0.0, f64::max);
        // The outermost nodes lie inside the edge.
        let axes = [1.04 * reach(0), 1.04 * reach(1)];
        Self { angle, object, weight, points, axes, chief, center: 0.0 }
    }
}

/// The beams that get through the rims of a lens at its primary wavelength; `None` if a field is
/// dark.
pub(in crate::search::design) fn traced_beams(lens: &Lens) -> Option<Vec<FieldBeam>> {
    let model = RayModel::from_lens(lens, 0).ok()?;
    let beam = |field: &crate::lens::FieldPoint| {
        let region = crate::analysis::lit_region(&model, *field, model.primary).ok()?;
        let traced = region.trace_pupil(TRACED_ORDER);
        // The angle at which the first vertex sees the point of a near object.
        let (angle, object) = match lens.object {
            Object::Infinity => (field.y.to_radians(), None),
            Object::Finite(distance) => ((-field.y / distance).atan(), Some(distance)),
        };
        let total: f64 = traced.landed.arrivals().map(|(_, w)| w).sum();
        let all_imaged = (0..traced.rays.len()).all(|i| traced.landed.sink.fate(i).is_imaged());
        let crossing = |ray: &Ray<f64>| {
            let slope = ray.direction.y / ray.direction.z;
            let cross = ray.direction.x / ray.direction.z;
            let at = |p: f64, s: f64| p - ray.point.z * s;
            [at(ray.point.x, cross).abs(), at(ray.point.y, slope)]
        };
        let point = |(i, w): (usize, f64)| (crossing(&traced.rays.get(i)), w / total);
        let chief = crossing(&region.launch.ray([0.0; 2])?);
        let points: Vec<_> = traced.landed.arrivals().map(point).collect();
        (total > 0.0 && all_imaged)
            .then(|| FieldBeam::of_points((angle, object), field.weight, points, chief))
    };
    model.fields.iter().map(beam).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use std::f64::consts::PI;

    #[test]
    fn the_beam_of_a_field_is_an_ellipse_with_the_area_that_is_asked_for() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 80.0, "f_number": 4.0, "half_field_deg": 12.0}"#,
        )
        .unwrap();
        let mut asked = LensRequirements::complete(&spec).unwrap().0;
        let axis = PI * 10.0 * 10.0;
        // One field with less and one with more light than the axis.
        asked.fields = vec![0.0, 8.0, 12.0];
        asked.clear_area = vec![axis, 0.5 * axis, 1.3 * axis];
        assert!((asked.beam_radius() - 10.0).abs() < 1e-12);
        for difficulty in [1.0, 0.4] {
            let plan = BeamPlan { difficulty: [difficulty, 1.0], ..BeamPlan::full(1.0) };
            let beams = plan.beams(&asked);
            for (beam, area) in beams.iter().zip(&asked.clear_area) {
                let [x, y] = beam.axes;
                let exact = difficulty * difficulty * area;
                assert!((PI * x * y / exact - 1.0).abs() < 1e-9, "{x} {y} {exact}");
                // The mean squares over an ellipse are a quarter of those of its axes.
                let mean = |of: &dyn Fn([f64; 2]) -> f64| -> f64 {
                    beam.points.iter().map(|(point, weight)| weight * of(*point)).sum()
                };
                let square = mean(&|[a, b]| a * a + b * b);
                assert!((square / (0.25 * (x * x + y * y)) - 1.0).abs() < 1e-6, "{square}");
                assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_axes_of_a_beam_of_points_hold_them_with_little_room() {
        let points = vec![([3.0, -1.0], 0.5), ([-1.0, 7.0], 0.5)];
        let beam = FieldBeam::of_points((0.0, None), 1.0, points, [0.0; 2]);
        let [x, y] = beam.axes;
        assert!((3.0..3.3).contains(&x) && (7.0..7.7).contains(&y), "{x} {y}");
    }
}
