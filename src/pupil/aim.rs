//! The ray of a field that crosses the stop, or another surface, at a given point: Newton's iteration on the two
//! coordinates that name the ray, with the derivative from dual numbers.

use super::launch::{FieldSource, PupilMap};
use super::ray_model::{Dual2, RayModel};
use crate::math::Vec3;

/// A ray that crosses a surface where it was asked to.
#[derive(Debug, Clone, Copy)]
pub(super) struct AimedRay {
    /// What names it.
    pub(super) q: [f64; 2],
    /// Derivatives of the point at the surface: `slopes[i][j]` is coordinate `i` by `q[j]`.
    pub(super) slopes: [[f64; 2]; 2],
    /// How far `q` lies from the paraxial place.
    pub(super) shift: [f64; 2],
}

impl AimedRay {
    /// The affine map that takes the unit circle to the neighbourhood of this ray which crosses
    /// the stop within `radius` of it.
    pub(super) fn pupil_map(&self, radius: f64) -> Option<PupilMap> {
        let column = |x, y| solve_2x2(self.slopes, [x, y]);
        let columns = [column(radius, 0.0)?, column(0.0, radius)?];
        Some(PupilMap { origin: self.q, columns })
    }
}

/// The solution of a system of two linear equations.
pub(super) fn solve_2x2([[a, b], [c, d]]: [[f64; 2]; 2], [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = a * d - b * c;
    let solution = [(d * x - b * y) / determinant, (a * y - c * x) / determinant];
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

/// Steps of Newton's iteration, and halvings of a step that went wrong.
const STEPS: usize = 40;
const HALVINGS: usize = 12;
/// A miss that is no longer reduced counts as rounding if it is this small against the stop.
const ROUNDING: f64 = 1e-10;

/// The ray of a source that crosses `surface` at `target`, searched from the ray named `guess`.
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
        let done = there.size >= 0.5 * here.size && there.size <= ROUNDING * search.scale();
        if there.size < here.size {
            here = there;
        }
        if done {
            break;
        }
    }
    let arrived = here.size <= ROUNDING * search.scale();
    arrived.then_some(AimedRay { q: here.q, slopes: here.slopes, shift: [0.0; 2] })
}

struct AimSolver<'a> {
    model: &'a RayModel,
    wavelength: usize,
    source: &'a FieldSource,
    surface: usize,
    target: [f64; 2],
}

/// How far from the target a ray crosses the surface.
struct AimOffset {
    q: [f64; 2],
    offset: [f64; 2],
    slopes: [[f64; 2]; 2],
    size: f64,
}

impl AimSolver<'_> {
    /// The size of the stop, or of the beam where the stop has none.
    fn scale(&self) -> f64 {
        let stop = self.model.stop_radius();
        let beam =
            self.model.first_order.marginal.heights.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        if stop > 0.0 { stop } else { beam.max(f64::MIN_POSITIVE) }
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

    /// The first of ever shorter steps that comes nearer, or the last one tried once the miss is
    /// as small as rounding.
    fn line_search(&self, here: &AimOffset, step: [f64; 2]) -> Option<AimOffset> {
        let mut factor = 1.0;
        for _ in 0..HALVINGS {
            let q = [here.q[0] - factor * step[0], here.q[1] - factor * step[1]];
            if let Some(there) = self.evaluate(q)
                && (there.size < here.size || here.size <= ROUNDING * self.scale())
            {
                return Some(there);
            }
            factor *= 0.5;
        }
        None
    }
}
