//! The edge of a pupil as a closed curve of points that interpolate it to rounding.

use super::boundary::{Boundary, EdgePoint, PolarFrame, PupilLimit};
use super::edge_search::{EdgeSearch, LimitFilter};
use super::kind::{Region, RegionKind};
use crate::math::quadrature::chebyshev_points;
use crate::pupil::launch::Launch;
use crate::pupil::ray_model::Dual2;
use crate::trace::{Rays, SystemGradient};
use std::f64::consts::TAU;

/// A smooth part of the edge of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeArc {
    /// Its pupil points at the Chebyshev points of its azimuth, ends included.
    pub points: Vec<[f64; 2]>,
    /// True if another limit takes over where it begins.
    pub begins_at_corner: bool,
    /// The limit that makes it.
    pub limit: PupilLimit,
    /// For each point the derivative of its place by the radius, and the area in pupil coordinates that the arc
    /// sweeps by the radius and its parameter from 0 to 1.
    sweep: Vec<([f64; 2], f64)>,
}

/// The closed curves around a pupil: the edge of the light and, of an annulus, that of its shadow.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeCurves {
    /// The arcs around the light, in order of azimuth from +y towards +x.
    pub outer: Vec<EdgeArc>,
    /// The arcs around the shadow inside, in the same order; empty if there is none.
    pub inner: Vec<EdgeArc>,
    /// The number of rays traced.
    pub rays: usize,
}

impl Region<'_> {
    /// The curves around the pupil, of `count` points an arc; `None` if its edge is not known.
    pub fn edge_curves(&self, count: usize) -> Option<EdgeCurves> {
        let launch = &self.launch;
        match &self.kind {
            RegionKind::Clear => {
                Some(EdgeCurves { outer: circle(count), inner: Vec::new(), rays: 0 })
            }
            RegionKind::StarShaped(boundary) => {
                let (outer, rays) = arcs(launch, boundary, LimitFilter::All, count)?;
                Some(EdgeCurves { outer, inner: Vec::new(), rays })
            }
            RegionKind::Irregular { annulus: Some(ring), .. } => {
                let rims = LimitFilter::WithoutObstructions;
                let (outer, rays) = arcs(launch, &ring.outer, rims, count)?;
                let (inner, more) = arcs(launch, &ring.inner, LimitFilter::Obstructions, count)?;
                Some(EdgeCurves { outer, inner, rays: rays + more })
            }
            RegionKind::Dark | RegionKind::Unbounded | RegionKind::Irregular { .. } => None,
        }
    }
}

/// The unit circle in two halves.
fn circle(count: usize) -> Vec<EdgeArc> {
    let half = |from: f64| {
        let at = |t: f64| swept(&PolarFrame::UNIT, from + 0.5 * TAU * t, 1.0, 0.5 * TAU);
        let (points, sweep) = chebyshev_points(count).map(at).unzip();
        EdgeArc { points, begins_at_corner: false, limit: PupilLimit::Disc, sweep }
    };
    vec![half(0.0), half(0.5 * TAU)]
}

impl Region<'_> {
    /// The derivative of an integral over the pupil by the motion of arcs of its edge alone, by every number of
    /// the system; `weights` are those of the integrand, times those of a quadrature from 0 to 1 along each arc,
    /// at the points of each. An arc of the disc of the pupil does not move.
    pub fn motion_of_arcs(&self, arcs: &[&EdgeArc], weights: &[Vec<f64>]) -> SystemGradient<f64> {
        let channel = self.launch.channel();
        let mut total = SystemGradient::zero(channel.tracer.surfaces());
        for (arc, weights) in arcs.iter().zip(weights) {
            let PupilLimit::Surface(surface, limit) = arc.limit else { continue };
            let start = |k: usize| {
                let p = arc.points[k];
                Some((self.launch.ray(p)?, self.launch.dual_ray(p)?, arc.sweep[k], weights[k]))
            };
            let ends: Vec<_> = (0..arc.points.len()).filter_map(start).collect();
            let dual: Rays<Dual2> = ends.iter().map(|(_, ray, ..)| *ray).collect();
            let margins = channel.unclipped.margins_at(&dual, surface, limit);
            let (mut rays, mut by_margin) = (Rays::default(), Vec::new());
            for ((ray, _, (direction, swept), weight), margin) in ends.into_iter().zip(margins) {
                let outwards = margin.slope[0] * direction[0] + margin.slope[1] * direction[1];
                let by = -weight * swept / outwards;
                if by.is_finite() {
                    rays.push(ray);
                    by_margin.push(by);
                }
            }
            let moved = channel.tracer.margin_gradient(surface, limit, &rays, &by_margin);
            total.add(&moved, 1.0);
        }
        total
    }
}

/// The point of an arc at an azimuth, with its sweep by the radius and by the parameter of an arc of this width.
fn swept(frame: &PolarFrame, azimuth: f64, radius: f64, width: f64) -> ([f64; 2], ([f64; 2], f64)) {
    let area = radius * width * frame.area();
    (frame.point(azimuth, radius), (frame.direction(azimuth), area))
}

/// The widest azimuth of an arc that is not divided.
const WIDEST: f64 = 0.3 * TAU;

fn arcs(
    launch: &Launch<'_>,
    boundary: &Boundary,
    filter: LimitFilter,
    count: usize,
) -> Option<(Vec<EdgeArc>, usize)> {
    let mut search = EdgeSearch::new(launch, boundary.frame).with_limits(filter);
    let mut found = Vec::new();
    let several = boundary.arcs.len() > 1;
    for (i, arc) in boundary.arcs.iter().enumerate() {
        // The first arc of half an edge begins on the plane of symmetry.
        let corner = several && !(launch.is_symmetric() && i == 0);
        let parts = ((arc.to - arc.from) / WIDEST).ceil().max(1.0);
        let step = (arc.to - arc.from) / parts;
        for part in 0..parts as usize {
            let from = arc.from + step * part as f64;
            let guess = |t: f64| (from + t * step, boundary.radius_guess(from + t * step));
            let guesses: Vec<_> = chebyshev_points(count).map(guess).collect();
            let edges = search.edges_along_arc(arc.limit, &guesses);
            let point = |((azimuth, _), edge): (&(f64, f64), Option<EdgePoint>)| {
                Some(swept(&boundary.frame, *azimuth, edge?.radius, step))
            };
            let points: Option<Vec<_>> = guesses.iter().zip(edges).map(point).collect();
            let (points, sweep) = points?.into_iter().unzip();
            let begins_at_corner = corner && part == 0;
            found.push(EdgeArc { points, begins_at_corner, limit: arc.limit, sweep });
        }
    }
    if launch.is_symmetric() {
        mirror(&mut found);
    }
    Some((found, search.rays))
}

/// Adds the mirror image of half an edge, whose arcs run backwards.
fn mirror(arcs: &mut Vec<EdgeArc>) {
    let count = arcs.len();
    for i in (0..count).rev() {
        let points = arcs[i].points.iter().rev().map(|p| [-p[0], p[1]]).collect();
        let turned = |(by, area): &([f64; 2], f64)| ([-by[0], by[1]], *area);
        let sweep = arcs[i].sweep.iter().rev().map(turned).collect();
        let limit = arcs[i].limit;
        // It begins where the arc that it mirrors ends.
        let begins_at_corner = arcs.get(i + 1).filter(|_| i + 1 < count);
        let begins_at_corner = begins_at_corner.is_some_and(|next| next.begins_at_corner);
        arcs.push(EdgeArc { points, begins_at_corner, limit, sweep });
    }
}
