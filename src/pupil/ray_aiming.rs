//! Ray aiming: the ray of a field that crosses the stop, or another surface, at a given point.
//!
//! Newton's method on the two ray coordinates with derivatives from dual numbers, or, where the
//! derivatives at the chief ray are known, Broyden's method from these, which traces plain numbers.

use super::field_source::{FieldSource, PupilMap, solve_2x2};
use super::ray_model::{Dual2, RayModel};
use crate::math::Vec3;
use crate::trace::{ImagePoints, Rays, TraceSink as _};

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
    let (surface, goal) = (model.stop(), target.map(|v| v * model.stop_radius()));
    let solver = AimSolver { model, wavelength, source, surface, target: goal };
    let start = map.map(target);
    let mut search = SecantSearch::new(map, model.stop_radius(), start, solver.offset(start)?);
    for _ in 0..SECANT_STEPS {
        let next = search.next();
        match search.advance(next, solver.offset(next)?, &solver) {
            SecantStep::Closer => {}
            SecantStep::Found => return Some(next),
            SecantStep::Failed => return None,
        }
    }
    None
}

/// The same for many targets together, whose rays are traced in batches; bit for bit what
/// [`aim_from_chief_ray`] finds for each.
pub(super) fn aim_all_from_chief_ray(
    model: &RayModel,
    wavelength: usize,
    source: &FieldSource,
    map: &PupilMap,
    targets: &[[f64; 2]],
) -> Vec<Option<[f64; 2]>> {
    let radius = model.stop_radius();
    let goal = |i: usize| targets[i].map(|v| v * radius);
    let solver =
        |i: usize| AimSolver { model, wavelength, source, surface: model.stop(), target: goal(i) };
    let starts: Vec<[f64; 2]> = targets.iter().map(|target| map.map(*target)).collect();
    let crossed = stop_points(model, wavelength, source, &starts);
    let begin = |(i, (start, point)): (usize, (&[f64; 2], Option<[f64; 2]>))| {
        let offset = solver(i).offset_of(point?)?;
        Some((i, SecantSearch::new(map, radius, *start, offset)))
    };
    let mut active: Vec<(usize, SecantSearch)> =
        starts.iter().zip(crossed).enumerate().filter_map(begin).collect();
    let mut found = vec![None; targets.len()];
    for _ in 0..SECANT_STEPS {
        let next: Vec<[f64; 2]> = active.iter().map(|(_, search)| search.next()).collect();
        let mut crossed = stop_points(model, wavelength, source, &next).into_iter().zip(next);
        active.retain_mut(|(i, search)| {
            let Some((Some(point), next)) = crossed.next() else { return false };
            let solver = solver(*i);
            let Some(there) = solver.offset_of(point) else { return false };
            let step = search.advance(next, there, &solver);
            if step == SecantStep::Found {
                found[*i] = Some(next);
            }
            step == SecantStep::Closer
        });
    }
    found
}

/// The points at which rays of a source cross the stop, in mm; `None` for a ray that does not get there.
fn stop_points(
    model: &RayModel,
    wavelength: usize,
    source: &FieldSource,
    coordinates: &[[f64; 2]],
) -> Vec<Option<[f64; 2]>> {
    let rays: Rays<f64> = coordinates.iter().map(|q| source.ray(*q)).collect();
    let mut crossed = ImagePoints::default();
    model.channels[wavelength].to_stop.trace_batch(&rays, &mut crossed);
    let point = |i: usize| crossed.fate(i).is_imaged().then(|| [crossed.x[i], crossed.y[i]]);
    (0..rays.len()).map(point).collect()
}

/// Broyden's search for the ray coordinates of one ray.
struct SecantSearch {
    q: [f64; 2],
    /// The inverse of the derivatives of the point at the stop by the ray coordinates.
    inverse: [[f64; 2]; 2],
    offset: [f64; 2],
}

/// The outcome of a step of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SecantStep {
    Closer,
    Found,
    Failed,
}

impl SecantSearch {
    /// The search from the affine map at the chief ray.
    fn new(map: &PupilMap, radius: f64, q: [f64; 2], offset: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = map.columns.map(|column| column.map(|v| v / radius));
        Self { q, inverse: [[a, c], [b, d]], offset }
    }

    fn step(&self) -> [f64; 2] {
        self.inverse.map(|row| -dot2(row, self.offset))
    }

    /// The ray coordinates to try next.
    fn next(&self) -> [f64; 2] {
        let step = self.step();
        [0, 1].map(|i| self.q[i] + step[i])
    }

    /// Goes on to ray coordinates whose ray misses the target by `there`.
    fn advance(&mut self, next: [f64; 2], there: [f64; 2], solver: &AimSolver<'_>) -> SecantStep {
        let before = self.offset[0].hypot(self.offset[1]);
        let size = there[0].hypot(there[1]);
        if size <= EXACT * solver.scale() || (size >= 0.5 * before && size <= solver.tolerance()) {
            return SecantStep::Found;
        }
        let step = self.step();
        let change = [0, 1].map(|i| there[i] - self.offset[i]);
        if size >= before || update_inverse(&mut self.inverse, step, change).is_none() {
            return SecantStep::Failed;
        }
        (self.q, self.offset) = (next, there);
        SecantStep::Closer
    }
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
        landing.fate.is_imaged().then(|| self.offset_of([x, y]))?
    }

    /// The distance between a point of the surface and the target; `None` if it is not finite.
    fn offset_of(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        let offset = [0, 1].map(|i| point[i] - self.target[i]);
        offset.iter().all(|v| v.is_finite()).then_some(offset)
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
