//! Ray aiming: the ray of a field that crosses the stop, or another surface, at a given point.
//!
//! Newton's method on the two ray coordinates with derivatives from dual numbers, or, where the
//! derivatives at the chief ray are known, Broyden's method from these, which traces plain numbers.

use super::field_source::{FieldSource, PupilMap, solve_2x2};
use super::ray_model::{Dual2, RayModel};
use crate::math::Vec3;

/// A ray that crosses a surface at a given point.
#[derive(Debug, Clone, Copy)]
pub(super) struct AimedRay {
    /// Its ray coordinates.
    pub(super) q: [f64; 2],
    /// The derivatives of the point at the surface: `slopes[i][j]` is coordinate `i` by `q[j]`.
    pub(super) slopes: [[f64; 2]; 2],
    /// The difference between `q` and the paraxial ray coordinates.
    pub(super) shift: [f64; 2],
}

impl AimedRay {
    /// The affine map that takes the unit disc to the ray coordinates near this ray which cross the
    /// stop within `radius` of it, in mm.
    pub(super) fn pupil_map(&self, radius: f64) -> Option<PupilMap> {
        let column = |x, y| solve_2x2(self.slopes, [x, y]);
        let columns = [column(radius, 0.0)?, column(0.0, radius)?];
        Some(PupilMap { origin: self.q, columns })
    }
}

/// The largest number of Newton steps, and of halvings of a step that does not reduce the offset.
const STEPS: usize = 40;
const HALVINGS: usize = 12;
/// An offset that Newton steps do not reduce counts as rounding if it is below this part of the
/// stop.
const ROUNDING: f64 = 1e-10;
/// The rounding error of a point on a ray, relative to the distance of the object point.
const PATH_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The largest number of secant steps.
const SECANT_STEPS: usize = 10;
/// An offset that is smaller than this part of the stop is rounding for certain.
const EXACT: f64 = 4.0 * f64::EPSILON;

/// The ray coordinates of a source whose ray crosses the stop at `target`, in stop radii, by Broyden's
/// method from the affine map at the chief ray (Broyden, Mathematics of Computation 19, 1965); `None`
/// if that does not converge.
pub(super) fn aim_from_chief_ray(
    model: &RayModel,
    wavelength: usize,
    source: &FieldSource,
    map: &PupilMap,
    target: [f64; 2],
) -> Option<[f64; 2]> {
    let radius = model.stop_radius();
    let [[a, b], [c, d]] = map.columns.map(|column| column.map(|v| v / radius));
    let (surface, goal) = (model.stop(), target.map(|v| v * radius));
    let search = AimSolver { model, wavelength, source, surface, target: goal };
    let (mut q, mut slopes) = (map.map(target), [[a, c], [b, d]]);
    let mut offset = search.offset(q)?;
    for _ in 0..SECANT_STEPS {
        let step = [0, 1].map(|i| -dot2(slopes[i], offset));
        let next = [q[0] + step[0], q[1] + step[1]];
        let there = search.offset(next)?;
        let (before, size) = (offset[0].hypot(offset[1]), there[0].hypot(there[1]));
        if size <= EXACT * search.scale() || (size >= 0.5 * before && size <= search.tolerance()) {
            return Some(next);
        }
        if size >= before {
            return None;
        }
        update_inverse(&mut slopes, step, [there[0] - offset[0], there[1] - offset[1]])?;
        (q, offset) = (next, there);
    }
    None
}

/// Broyden's update of the inverse of a matrix of derivatives after a step that has changed the values
/// by `change`; `None` if it has none.
fn update_inverse(inverse: &mut [[f64; 2]; 2], step: [f64; 2], change: [f64; 2]) -> Option<()> {
    let predicted = inverse.map(|row| dot2(row, change));
    let along = [0, 1].map(|j| step[0] * inverse[0][j] + step[1] * inverse[1][j]);
    let scale = dot2(step, predicted);
    for (row, (step, predicted)) in inverse.iter_mut().zip(step.into_iter().zip(predicted)) {
        row.iter_mut().zip(along).for_each(|(v, along)| *v += (step - predicted) * along / scale);
    }
    (scale != 0.0 && inverse.iter().flatten().all(|v| v.is_finite())).then_some(())
}

fn dot2(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The ray of a source that crosses `surface` at `target`, in mm, searched from the ray coordinates
/// `guess`.
pub(super) fn aim_at(
    model: &RayModel,
    wavelength: usize,
    source: &FieldSource,
    surface: usize,
    guess: [f64; 2],
    target: [f64; 2],
) -> Option<AimedRay> {
    let search = AimSolver { model, wavelength, source, surface, target };
    let mut here = search.evaluate(guess)?;
    for _ in 0..STEPS {
        if here.size == 0.0 {
            break;
        }
        let step = solve_2x2(here.slopes, here.offset)?;
        let Some(there) = search.line_search(&here, step) else { break };
        let done = there.size >= 0.5 * here.size && there.size <= search.tolerance();
        if there.size < here.size {
            here = there;
        }
        if done {
            break;
        }
    }
    let arrived = here.size <= search.tolerance();
    arrived.then_some(AimedRay { q: here.q, slopes: here.slopes, shift: [0.0; 2] })
}

struct AimSolver<'a> {
    model: &'a RayModel,
    wavelength: usize,
    source: &'a FieldSource,
    surface: usize,
    target: [f64; 2],
}

/// The distance between a ray's intersection with the surface and the target.
struct AimOffset {
    q: [f64; 2],
    offset: [f64; 2],
    slopes: [[f64; 2]; 2],
    size: f64,
}

impl AimSolver<'_> {
    /// The radius of the stop in mm, or of the beam if the stop has none.
    fn scale(&self) -> f64 {
        let stop = self.model.stop_radius();
        let beam =
            self.model.first_order.marginal.heights.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        if stop > 0.0 { stop } else { beam.max(f64::MIN_POSITIVE) }
    }

    /// The offset in mm below which differences are rounding: of the stop, and of the path from a
    /// far object point.
    fn tolerance(&self) -> f64 {
        ROUNDING * self.scale() + PATH_ROUNDING * self.source.distance()
    }

    /// The distance between the intersection of a ray with the surface and the target; `None` for a
    /// ray that does not get there.
    fn offset(&self, q: [f64; 2]) -> Option<[f64; 2]> {
        let channel = &self.model.channels[self.wavelength];
        let landing = channel.open.trace_to(self.source.ray(q), self.surface);
        let Vec3 { x, y, .. } = landing.ray.point;
        let offset = [x - self.target[0], y - self.target[1]];
        (landing.fate.is_imaged() && offset.iter().all(|v| v.is_finite())).then_some(offset)
    }

    fn evaluate(&self, q: [f64; 2]) -> Option<AimOffset> {
        let ray = self.source.ray([Dual2::variable(q[0], 0), Dual2::variable(q[1], 1)]);
        let landing = self.model.channels[self.wavelength].unclipped.trace_to(ray, self.surface);
        let Vec3 { x, y, .. } = landing.ray.point;
        let offset = [x.value - self.target[0], y.value - self.target[1]];
        let size = offset[0].hypot(offset[1]);
        let reached = landing.fate.is_imaged() && size.is_finite();
        reached.then_some(AimOffset { q, offset, slopes: [x.slope, y.slope], size })
    }

    /// The result of the first of ever shorter steps that reduces the offset, or of the last one
    /// tried if the offset is rounding already.
    fn line_search(&self, here: &AimOffset, step: [f64; 2]) -> Option<AimOffset> {
        let mut factor = 1.0;
        for _ in 0..HALVINGS {
            let q = [here.q[0] - factor * step[0], here.q[1] - factor * step[1]];
            if let Some(there) = self.evaluate(q)
                && (there.size < here.size || here.size <= self.tolerance())
            {
                return Some(there);
            }
            factor *= 0.5;
        }
        None
    }
}
