//! Points of surfaces that are blocked for certain, against a pupil that is taken for lit there.
//!
//! A coarse grid of rays does not see a thin obscuration, such as the arm of a spider, and the edge of a pupil
//! that is searched for along radii may jump over it. The apertures of a lens are known, however: points along
//! the edges of each, a little on the blocked side, must lie outside the footprint of the pupil on their
//! surface. If one lies inside, the pupil has not the form that was found.

use super::annulus::Annulus;
use super::boundary::Boundary;
use super::edge_search::LimitFilter;
use crate::lens::{ApertureShape, SurfaceAperture, System};
use crate::pupil::launch::Launch;

/// The points along each straight side, and around an oval.
const ON_SIDE: usize = 12;
const ON_OVAL: usize = 48;
/// The distance of points from an edge, in sizes of the footprint; the part of an oval that they lie on.
const INSET: f64 = 1e-3;
const OVAL_PART: f64 = 0.8;

/// The largest ratio of the radii of an edge: quadrature along a longer one begins too coarse to tell its error.
const LONGEST: f64 = 30.0;

/// A closed polygon, of pupil points or of points of a surface.
pub(super) type ClosedCurve = Vec<[f64; 2]>;

/// The surfaces with apertures that may hide in a pupil, and their apertures.
pub(super) struct DarkPoints {
    apertures: Vec<(usize, Vec<SurfaceAperture>)>,
}

impl DarkPoints {
    pub(super) fn of(system: &System<f64>) -> Self {
        let hides = |own: &&SurfaceAperture| {
            own.obscures() || matches!(own.shape, ApertureShape::Polygon { .. })
        };
        let of_surface = |(i, surface): (usize, &crate::lens::Surface<f64>)| {
            let own: Vec<_> = surface.apertures.iter().filter(hides).cloned().collect();
            (!own.is_empty()).then_some((i, own))
        };
        Self { apertures: system.surfaces.iter().enumerate().filter_map(of_surface).collect() }
    }

    /// True if the lens has no such apertures.
    pub(super) fn is_empty(&self) -> bool {
        self.apertures.is_empty()
    }

    /// True if a pupil may be star-shaped with this edge.
    pub(super) fn allow(&self, launch: &Launch<'_>, edge: &Boundary) -> bool {
        let curve = edge.curve(launch, LimitFilter::All);
        is_compact(edge, &curve) && !self.are_lit(launch, &curve, None)
    }

    /// True if a pupil may be this annulus.
    pub(super) fn allow_annulus(&self, launch: &Launch<'_>, annulus: &Annulus) -> bool {
        let outer = annulus.outer.curve(launch, LimitFilter::WithoutObstructions);
        let inner = annulus.inner.curve(launch, LimitFilter::Obstructions);
        let is_within = inner.iter().all(|p| contains(&outer, *p));
        let are_compact = is_compact(&annulus.outer, &outer) && is_compact(&annulus.inner, &inner);
        is_within && are_compact && !self.are_lit(launch, &outer, Some(&inner))
    }

    /// True if a blocked point lies inside the footprint of the pupil within a curve of pupil points, and
    /// outside that of its shadow.
    pub(super) fn are_lit(
        &self,
        launch: &Launch<'_>,
        light: &ClosedCurve,
        shadow: Option<&ClosedCurve>,
    ) -> bool {
        self.apertures.iter().any(|(surface, apertures)| {
            let footprint = footprint(launch, *surface, light);
            let hole = shadow.map(|shadow| footprint_of(launch, *surface, shadow));
            let Some(footprint) = footprint else { return true };
            let tracer = &launch.channel().tracer;
            let blocked = apertures.iter().flat_map(|aperture| points(aperture, &footprint));
            blocked.filter(|p| !tracer.passes_apertures(*surface, *p)).any(|p| {
                let in_hole = hole.as_ref().is_some_and(|hole| contains(hole, p));
                contains(&footprint, p) && !in_hole
            })
        })
    }
}

/// True if an edge is not far longer in one direction than in another.
fn is_compact(edge: &Boundary, curve: &ClosedCurve) -> bool {
    let radii = || curve.iter().map(|p| edge.frame.polar(*p).1);
    radii().fold(0.0, f64::max) <= LONGEST * radii().fold(f64::INFINITY, f64::min)
}

/// The footprint of a curve on a surface; `None` if too few of its rays get there to know it.
fn footprint(launch: &Launch<'_>, surface: usize, curve: &ClosedCurve) -> Option<ClosedCurve> {
    let found = footprint_of(launch, surface, curve);
    (2 * found.len() > curve.len()).then_some(found)
}

fn footprint_of(launch: &Launch<'_>, surface: usize, curve: &ClosedCurve) -> ClosedCurve {
    let place = |p: &[f64; 2]| {
        let mut met = None;
        launch.channel().open.visit(launch.ray(*p)?, |i, point| {
            if i == surface {
                met = Some([point.x, point.y]);
            }
        });
        met
    };
    curve.iter().filter_map(place).collect()
}

/// True if a polygon contains a point.
fn contains(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let crosses = (a[1] > y) != (b[1] > y);
        if crosses && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]) {
            inside = !inside;
        }
    }
    inside
}

/// The smallest rectangle around points, as its lowest and highest corner.
pub(super) fn bounds(points: impl IntoIterator<Item = [f64; 2]>) -> [[f64; 2]; 2] {
    let start = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    points.into_iter().fold(start, |[low, high], p| {
        [[0, 1].map(|k| low[k].min(p[k])), [0, 1].map(|k| high[k].max(p[k]))]
    })
}

/// Points near the edge of a aperture, on both sides of it, as far as the footprint reaches.
fn points(aperture: &SurfaceAperture, footprint: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let [low, high] = bounds(footprint.iter().copied());
    let size = (high[0] - low[0]).max(high[1] - low[1]);
    let oval = |a: f64, b: f64| {
        let place = |part: f64, i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / ON_OVAL as f64).sin_cos();
            aperture.place([part * a * cos, part * b * sin])
        };
        // Just inside the edge, where it first reaches into the light, and deeper.
        let near = 1.0 - (INSET * size / a.min(b)).min(1.0 - OVAL_PART);
        let rings = [OVAL_PART, near].into_iter();
        let points = rings.flat_map(|part| (0..ON_OVAL).map(move |i| place(part, i)));
        points.chain([aperture.center]).collect()
    };
    match &aperture.shape {
        ApertureShape::Circle { radius } => oval(*radius, *radius),
        ApertureShape::Ellipse { half_width, half_height } => oval(*half_width, *half_height),
        ApertureShape::Rectangle { half_width, half_height } => {
            along_sides(&aperture.corners(), half_width.min(*half_height), [low, high], size)
        }
        ApertureShape::Polygon { .. } => along_sides(&aperture.corners(), size, [low, high], size),
        ApertureShape::Spider { arms, width } => {
            let [x, y] = aperture.center;
            let away = (low[0] - x).abs().max((high[0] - x).abs());
            let length = size + away + (low[1] - y).abs().max((high[1] - y).abs());
            let arm = |k: usize| {
                let angle = aperture.angle + 360.0 * k as f64 / *arms as f64;
                let turned = SurfaceAperture { angle, ..aperture.clone() };
                let half = 0.5 * width;
                let corners = [[0.0, half], [0.0, -half], [length, -half], [length, half]];
                let corners = corners.map(|p| turned.place(p));
                along_sides(&corners, half, [low, high], size)
            };
            (0..*arms).flat_map(arm).collect()
        }
    }
}

/// Points on both sides of the sides of a polygon and of its corners, within a rectangle. `half` is half of
/// the least width of the polygon, or more if that is unknown.
fn along_sides(corners: &[[f64; 2]], half: f64, within: [[f64; 2]; 2], size: f64) -> Vec<[f64; 2]> {
    let inset = (INSET * size).min(0.5 * half);
    let mut found = Vec::new();
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % corners.len()];
        let edge = [b[0] - a[0], b[1] - a[1]];
        let length = edge[0].hypot(edge[1]);
        if length == 0.0 {
            continue;
        }
        let along = edge.map(|v| v / length);
        let Some([from, to]) = inside_share(*a, edge, within) else { continue };
        let shares = (0..ON_SIDE).map(|k| from + (to - from) * (k as f64 + 0.5) / ON_SIDE as f64);
        // Close to the corners too, where a aperture reaches into the light first.
        let corner = (inset / length).min(0.5);
        for share in shares.chain([corner, 1.0 - corner]) {
            for side in [inset, -inset] {
                let at = [0, 1].map(|k| a[k] + share * edge[k]);
                found.push([at[0] - side * along[1], at[1] + side * along[0]]);
            }
        }
    }
    found
}

/// The part of a segment inside a rectangle (Liang and Barsky, ACM Trans. Graph. 3, 1984).
fn inside_share(a: [f64; 2], edge: [f64; 2], [low, high]: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        if edge[k] == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
            continue;
        }
        let ends = [(low[k] - a[k]) / edge[k], (high[k] - a[k]) / edge[k]];
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    (from < to).then_some([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_cut_to_a_rectangle() {
        let square = [[-1.0, -1.0], [1.0, 1.0]];
        assert_eq!(inside_share([-2.0, 0.0], [4.0, 0.0], square), Some([0.25, 0.75]));
        assert_eq!(inside_share([-2.0, 2.0], [4.0, 0.0], square), None);
        assert_eq!(inside_share([0.0, 0.0], [8.0, 4.0], square), Some([0.0, 0.125]));
    }

    #[test]
    fn a_thin_arm_has_points_inside_of_it() {
        let shape = ApertureShape::Spider { arms: 3, width: 1e-3 };
        let spider = SurfaceAperture::obscuration(shape);
        let footprint = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let found = points(&spider, &footprint);
        let along_x = found.iter().filter(|[x, y]| *x > 0.0 && *x < 1.0 && y.abs() < 5e-4);
        assert!(along_x.count() >= ON_SIDE);
    }
}
