//! The paths of a few rays through a field, for drawing them in a plane.

use super::slice_plane::SlicePlane;
use crate::grin::{GrinFate, GrinRay, GrinSetup, GrinTracer, RayExit, RayState};
use crate::grin_design::GrinTaskError;
use crate::grin_design::evaluation::outcome::is_valid;
use crate::grin_design::evaluation::views::plan_views;
use crate::grin_design::field::GrinField;
use crate::grin_design::task::geometry::length;
use crate::grin_design::task::source::RaySet;
use crate::grin_design::task::{Domain, GrinTask};
use crate::math::Vec3;

/// A path begins this far before the entry, as a fraction of the diameter of the domain.
const LEAD_IN: f64 = 0.12;
/// The number of points drawn between two steps of a path with few steps; the number of points
/// above which some steps are skipped.
const POINTS_BETWEEN: usize = 6;
const MAX_POINTS: usize = 300;
/// The number of candidates is this many for two drawn rays, and includes all rays that are this
/// much farther from the plane than the best, as a fraction of the domain.
const CANDIDATES: usize = 3;
const NEARLY: f64 = 0.02;

/// The path of a ray.
#[derive(Debug, Clone, PartialEq)]
pub struct RayPath {
    /// The points from before the entry to the end: on the screen, else on the boundary.
    pub points: Vec<Vec3<f64>>,
    /// The fate of the ray.
    pub fate: GrinFate,
    /// True if the ray left at such grazing incidence that it is excluded.
    pub flat: bool,
}

impl RayPath {
    /// The reason for which the ray is excluded; `None` for a valid ray.
    pub fn excluded(&self) -> Option<&'static str> {
        if self.flat { Some("flat") } else { (!self.fate.has_arrived()).then(|| self.fate.name()) }
    }
}

/// The paths of the rays of a view that are drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct RayPaths {
    /// The index of the view in the task.
    pub view: usize,
    /// The paths.
    pub paths: Vec<RayPath>,
    /// The largest distance of the straight continuation of these rays from the plane, in mm.
    pub distance: f64,
}

impl GrinTask {
    /// The paths of at most `count` scoring rays of each view: those of one beam or point that run
    /// nearest to a plane, well separated from each other.
    ///
    /// # Errors
    /// A domain without extent.
    pub fn ray_paths(
        &self,
        field: &GrinField,
        plane: SlicePlane,
        count: usize,
    ) -> Result<Vec<RayPaths>, GrinTaskError> {
        let setups = plan_views(self, field.index_field(), RaySet::Scoring)?;
        let of_view = |(view, setup): (usize, GrinSetup<f64>)| {
            let (space, rays) = self.scoring_rays(&self.views[view]);
            let (rays, off) = choose_rays(&rays, plane, space, count);
            let tracer = GrinTracer::new(field.index_field(), setup)?;
            let path = |ray: &GrinRay<f64>| {
                let (states, exit) = tracer.trace_path(ray);
                let flat = exit.fate.has_arrived() && !is_valid(&exit);
                RayPath { points: path_points(ray, &states, &exit, space), fate: exit.fate, flat }
            };
            Ok(RayPaths { view, paths: rays.iter().map(path).collect(), distance: off })
        };
        setups.into_iter().enumerate().map(of_view).collect()
    }
}

/// The rays of one beam or point nearest to a plane, well separated, and their largest distance
/// from it.
fn choose_rays(
    rays: &[GrinRay<f64>],
    plane: SlicePlane,
    space: Domain,
    count: usize,
) -> (Vec<GrinRay<f64>>, f64) {
    let [low, high] = space.corners();
    let (centre, reach) = ((low + high) * 0.5, 0.5 * space.diameter());
    let nearest = |ray: &GrinRay<f64>| {
        let path = ray.v * ((centre - ray.x).dot(ray.v) / ray.v.dot(ray.v));
        ray.x + path
    };
    let off = |ray: &GrinRay<f64>| {
        let slope = plane.axis.component(ray.v).abs() / length(ray.v);
        (plane.axis.component(nearest(ray)) - plane.depth).abs() + reach * slope
    };
    let candidates = group_rays(rays).into_iter().map(|bundle| {
        let mut by_off: Vec<(f64, GrinRay<f64>)> =
            bundle.into_iter().map(|n| (off(&rays[n]), rays[n])).collect();
        by_off.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = by_off.first().map_or(0.0, |(off, _)| off + 2.0 * NEARLY * reach);
        let hardly = by_off.partition_point(|(off, _)| *off <= near);
        by_off.truncate((CANDIDATES * count).div_ceil(2).max(hardly));
        by_off
    });
    let mean = |bundle: &Vec<(f64, GrinRay<f64>)>| {
        bundle.iter().map(|(off, _)| off).sum::<f64>() / bundle.len().max(1) as f64
    };
    let best = candidates.min_by(|a, b| mean(a).total_cmp(&mean(b))).unwrap_or_default();
    let place = |ray: &GrinRay<f64>| {
        let [right, up] = plane.project(nearest(ray));
        let [along, above] = plane.project(ray.v * (reach / length(ray.v)));
        [right, up, along, above]
    };
    let places: Vec<[f64; 4]> = best.iter().map(|(_, ray)| place(ray)).collect();
    let chosen = choose_spread(&places, count);
    let farthest = chosen.iter().map(|n| best[*n].0).fold(0.0, f64::max);
    (chosen.into_iter().map(|n| best[n].1).collect(), farthest)
}

/// The numbers of rays that belong together: those of one direction, else those from one point,
/// else all.
fn group_rays(rays: &[GrinRay<f64>]) -> Vec<Vec<usize>> {
    let bits = |v: Vec3<f64>| [v.x, v.y, v.z].map(f64::to_bits);
    let by = |key: &dyn Fn(&GrinRay<f64>) -> [u64; 3]| -> Vec<Vec<usize>> {
        let mut order: Vec<usize> = (0..rays.len()).collect();
        order.sort_by_key(|n| key(&rays[*n]));
        let same = |a: &usize, b: &usize| key(&rays[*a]) == key(&rays[*b]);
        order.chunk_by(same).map(<[usize]>::to_vec).collect()
    };
    let beams = by(&|ray| bits(ray.v));
    if beams.len() < rays.len() {
        return beams;
    }
    let points = by(&|ray| bits(ray.x));
    if points.len() < rays.len() { points } else { vec![(0..rays.len()).collect()] }
}

/// The numbers of at most `count` points, spread uniformly along the coordinate with the largest
/// range.
fn choose_spread(places: &[[f64; 4]], count: usize) -> Vec<usize> {
    let range = |axis: usize| {
        let values = places.iter().map(|place| place[axis]);
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        values.fold(none, |(low, high), value| (low.min(value), high.max(value)))
    };
    let width = |axis: usize| range(axis).1 - range(axis).0;
    let axis = (0..4).max_by(|a, b| width(*a).total_cmp(&width(*b))).unwrap_or(0);
    let (low, high) = range(axis);
    let mut left: Vec<usize> = (0..places.len()).collect();
    let mut chosen = Vec::new();
    for i in 0..count.min(places.len()) {
        let wanted = low + (high - low) * (i as f64 + 0.5) / count as f64;
        let off = |n: &usize| (places[*n][axis] - wanted).abs();
        let nearest = (0..left.len()).min_by(|a, b| off(&left[*a]).total_cmp(&off(&left[*b])));
        chosen.extend(nearest.map(|n| left.remove(n)));
    }
    chosen
}

/// The points of a path, from shortly before the domain on.
fn path_points(
    ray: &GrinRay<f64>,
    states: &[RayState<f64>],
    exit: &RayExit<f64>,
    space: Domain,
) -> Vec<Vec3<f64>> {
    let size = space.diameter();
    let direction = ray.v * (1.0 / length(ray.v));
    let Some(first) = states.first() else {
        let path = (-ray.x.dot(direction)).max(0.0);
        let ends = [path - 0.5 * size, path + 0.5 * size].map(|t| ray.x + direction * t.max(0.0));
        return ends.into_iter().filter(|p| p.is_finite()).collect();
    };
    let before = length(first.x - ray.x).min(LEAD_IN * size);
    let mut points = vec![first.x - direction * before];
    let stride = states.len().div_ceil(MAX_POINTS).max(1);
    let thinned: Vec<RayState<f64>> = states.iter().step_by(stride).copied().collect();
    let between = if states.len() < MAX_POINTS / POINTS_BETWEEN { POINTS_BETWEEN } else { 1 };
    points.extend(thinned.first().map(|state| state.x));
    for pair in thinned.windows(2) {
        points.extend((1..=between).map(|i| hermite(pair, i as f64 / between as f64)));
    }
    points.extend(exit_point(exit, space));
    points.push(exit.x);
    points.retain(|point| point.is_finite());
    points
}

/// The point where a ray that ends on a screen has left the domain.
fn exit_point(exit: &RayExit<f64>, space: Domain) -> Option<Vec3<f64>> {
    let region = space.region();
    if !exit.fate.has_arrived() || region.level(exit.x) <= 1e-6 * space.diameter() {
        return None;
    }
    region.entry(exit.x, -exit.v).map(|(_, t)| exit.x - exit.v * t)
}

/// A point between two states, on the cubic with their positions and velocities.
fn hermite(pair: &[RayState<f64>], t: f64) -> Vec3<f64> {
    let [a, b] = [&pair[0], &pair[1]];
    // The ray moves by |v| times the step.
    let step = 2.0 * length(b.x - a.x) / (length(a.v) + length(b.v));
    let s = 1.0 - t;
    a.x * (s * s * (1.0 + 2.0 * t)) + a.v * (step * t * s * s) + b.x * (t * t * (1.0 + 2.0 * s))
        - b.v * (step * t * t * s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin_design::SpatialAxis;

    /// Two beams, one in the plane across y and one out of it.
    fn beams() -> Vec<GrinRay<f64>> {
        let at = |i: usize| 0.1 * (i as f64 - 5.0);
        let within = (0..11).map(|i| GrinRay {
            x: Vec3::new(at(i), 0.01 * at(i), -2.0),
            v: Vec3::new(0.0, 0.0, 1.0),
        });
        let without = (0..11)
            .map(|i| GrinRay { x: Vec3::new(at(i), -2.0, 0.0), v: Vec3::new(0.0, 1.0, 0.0) });
        within.chain(without).collect()
    }

    #[test]
    fn drawn_rays_lie_near_the_plane_and_apart() {
        let plane = SlicePlane { axis: SpatialAxis::Y, depth: 0.0 };
        let (rays, off) = choose_rays(&beams(), plane, Domain::Ball { radius: 1.0 }, 3);
        let mut heights: Vec<f64> = rays.iter().map(|ray| ray.x.x).collect();
        heights.sort_by(f64::total_cmp);
        assert!(rays.iter().all(|ray| ray.v.z == 1.0) && off < 0.01, "{rays:?}, {off}");
        assert!(heights.len() == 3 && heights[2] - heights[0] > 0.55, "{heights:?}");
        assert_eq!(choose_rays(&beams(), plane, Domain::Ball { radius: 1.0 }, 0).0.len(), 0);
        assert_eq!(choose_rays(&[], plane, Domain::Ball { radius: 1.0 }, 3).0.len(), 0);
    }

    #[test]
    fn the_curve_between_two_states_goes_through_both() {
        let state = |x: f64, v: [f64; 2]| RayState {
            x: Vec3::new(x, 0.0, 0.0),
            v: Vec3::new(v[0], v[1], 0.0),
            path: 0.0,
        };
        let pair = [state(0.0, [1.0, 1.0]), state(1.0, [1.0, -1.0])];
        assert_eq!((hermite(&pair, 0.0), hermite(&pair, 1.0)), (pair[0].x, pair[1].x));
        let middle = hermite(&pair, 0.5);
        assert!((middle.x - 0.5).abs() < 1e-12 && middle.y > 0.1, "{middle:?}");
    }

    #[test]
    fn rays_are_grouped_by_their_beam_or_by_their_source() {
        let mut sizes: Vec<usize> = group_rays(&beams()).iter().map(Vec::len).collect();
        sizes.sort_unstable();
        assert_eq!(sizes, [11, 11], "two beams");
        let from = |x: f64, to: f64| GrinRay {
            x: Vec3::new(x, 0.0, -5.0),
            v: Vec3::new(to, 0.1 * x, 1.0),
        };
        let fans: Vec<GrinRay<f64>> =
            (0..9).map(|i| from(f64::from(i % 3), 0.01 * f64::from(i))).collect();
        assert_eq!(group_rays(&fans).len(), 3, "three points");
    }
}
