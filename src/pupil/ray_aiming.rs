//! Ray aiming: the ray of a field that crosses the stop, or another surface, at a given point, by
//! Newton's method on the two ray coordinates with derivatives from dual numbers.

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
