//! The outline of a pupil in mm, split into sides that one limit each makes.
//!
//! Sides are polylines of equal steps of azimuth, fine enough to draw. Their lengths are those of
//! the smooth curve, extrapolated (Richardson) from the chords of all points and of every other
//! one: 128 points give six digits.

use super::boundary::{Boundary, BoundaryArc, PupilLimit};
use super::edge_search::{EdgeSearch, GUESS_SPREAD};
use super::kind::{Region, RegionKind};
use super::nodes::Nodes;
use super::quadrature::{Accuracy, ConvergedValues, converge};
use crate::lens::SurfaceNumber;
use crate::pupil::launch::Launch;
use crate::pupil::ray_model::{Aiming, RayModel};
use crate::trace::RayLimit;
use std::f64::consts::{PI, TAU};

/// A side of the outline, made by one limit.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlineSide {
    /// The limit along it.
    pub limit: PupilLimit,
    /// Its points in mm in the plane of [`Launch::crossing`], ends included; the first and the last
    /// are the same if one limit makes the whole outline.
    pub points: Vec<[f64; 2]>,
    /// Its length, in mm.
    pub length: f64,
}

/// The closed outline of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct PupilOutline {
    /// Its sides, each beginning where the one before ends.
    pub sides: Vec<OutlineSide>,
    /// A point inside from which all of the outline is visible, in mm.
    pub center: [f64; 2],
    /// The number of rays traced to draw it, without those that found the pupil.
    pub rays: usize,
}

impl PupilOutline {
    /// The corners in mm, where one limit takes over from another; none if one limit makes the
    /// whole outline.
    pub fn corners(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let several = self.sides.len() > 1;
        self.sides.iter().filter_map(move |side| side.points.first().copied().filter(|_| several))
    }

    /// The share of a limit in the length of the outline, 0 to 1.
    pub fn share(&self, limit: PupilLimit) -> f64 {
        let length = |all: bool| -> f64 {
            let sides = self.sides.iter().filter(|side| all || side.limit == limit);
            sides.map(|side| side.length).sum()
        };
        length(false) / length(true)
    }

    /// The limits and their shares, the largest first.
    pub fn limits_by_share(&self) -> Vec<(PupilLimit, f64)> {
        let mut limits: Vec<(PupilLimit, f64)> = Vec::new();
        for side in &self.sides {
            if limits.iter().all(|(limit, _)| *limit != side.limit) {
                limits.push((side.limit, self.share(side.limit)));
            }
        }
        limits.sort_by(|a, b| b.1.total_cmp(&a.1));
        limits
    }

    /// True if the whole disc gets through: no surface clips.
    pub fn is_clear(&self) -> bool {
        self.sides.iter().all(|side| side.limit == PupilLimit::Disc)
    }
}

impl PupilLimit {
    /// The index of the surface of the limit.
    pub const fn surface(self) -> Option<usize> {
        match self {
            Self::Surface(surface, _) => Some(surface),
            Self::Disc | Self::Unaimed => None,
        }
    }
}

impl RayModel {
    /// The name of a limit, such as `rim of surface 4`.
    pub fn limit_name(&self, limit: PupilLimit) -> String {
        let (surface, ray_limit) = match limit {
            PupilLimit::Disc if self.aiming == Aiming::Stop => return "rim of the stop".to_owned(),
            PupilLimit::Disc => return "entrance pupil".to_owned(),
            PupilLimit::Unaimed => return "no ray to the stop".to_owned(),
            PupilLimit::Surface(surface, limit) => (surface, limit),
        };
        let name = match ray_limit {
            RayLimit::Rim if surface == self.stop() => "stop,",
            RayLimit::Rim => "rim of",
            RayLimit::Obstruction => "obstruction of",
            RayLimit::Aperture(_) => "aperture of",
            RayLimit::Obscuration(_) => "obscuration of",
            RayLimit::Miss => "missed",
            RayLimit::Equator => "equator of",
            RayLimit::TotalReflection => "critical angle at",
            RayLimit::Side => "side of the gradient before",
        };
        format!("{name} surface {}", SurfaceNumber::new(surface))
    }
}

impl Region<'_> {
    /// The outline, drawn with about `points` points; `None` if there is no light, if nothing
    /// limits it or if it is irregular.
    pub fn outline(&self, points: usize) -> Option<PupilOutline> {
        let launch = &self.launch;
        match &self.kind {
            RegionKind::Clear => {
                let points = launch.rim(points);
                let side = OutlineSide { limit: PupilLimit::Disc, length: length(&points), points };
                let center = launch.crossing([0.0; 2])?;
                Some(PupilOutline { sides: vec![side], center, rays: 0 })
            }
            RegionKind::StarShaped(boundary) => boundary_outline(launch, boundary, points),
            RegionKind::Dark | RegionKind::Irregular { .. } | RegionKind::Unbounded => None,
        }
    }

    /// The area of the light in mm² and the x and y of its centroid in mm, in the plane of
    /// [`Launch::crossing`]; the centroid is accurate to the tolerance times the square root of the
    /// area.
    pub fn extent(&self, accuracy: Accuracy) -> Option<ConvergedValues<3>> {
        let scales = |[area, ..]: &[f64; 3]| [*area, area.sqrt(), area.sqrt()];
        converge(self, accuracy, |nodes| self.area_and_centroid(nodes), scales)
    }

    fn area_and_centroid(&self, nodes: &Nodes) -> Option<[f64; 3]> {
        let lit = self.launch.transmission_mask(&nodes.points);
        let (mut area, mut sum) = (0.0, [0.0; 2]);
        for ((p, weight), _) in nodes.points.iter().zip(&nodes.weights).zip(lit).filter(|n| n.1) {
            let Some((at, unit)) = self.launch.crossing_with_area(*p) else { continue };
            area += weight * unit;
            sum = [0, 1].map(|i| sum[i] + weight * unit * at[i]);
        }
        let x = if nodes.mirrored { 0.0 } else { sum[0] / area };
        (area > 0.0).then_some([area, x, sum[1] / area])
    }
}

impl Launch<'_> {
    /// The rim of the unit disc in mm: a closed curve of about `points` points from +y towards +x.
    pub fn rim(&self, points: usize) -> Vec<[f64; 2]> {
        let steps = even_steps(points);
        let azimuths = (0..=steps).map(|i| TAU * i as f64 / steps as f64);
        azimuths.filter_map(|azimuth| self.crossing(azimuth.sin_cos().into())).collect()
    }
}

/// The number of steps rounded up to an even one, and to one that gives a length.
fn even_steps(steps: usize) -> usize {
    2 * steps.div_ceil(2).max(4)
}

fn boundary_outline(
    launch: &Launch<'_>,
    boundary: &Boundary,
    points: usize,
) -> Option<PupilOutline> {
    let mut search = EdgeSearch::new(launch, boundary.frame);
    let sides = boundary.arcs.iter().map(|arc| outline_side(&mut search, boundary, arc, points));
    let mut sides = sides.collect::<Option<Vec<OutlineSide>>>()?;
    let reach = boundary.arcs.iter().map(|arc| arc.to - arc.from).sum::<f64>();
    if reach < 1.5 * PI {
        let mirrored: Vec<OutlineSide> =
            sides.iter().rev().map(OutlineSide::mirror_image).collect();
        sides.extend(mirrored);
    }
    let center = launch.crossing(boundary.frame.center)?;
    Some(PupilOutline { sides: merge_adjacent(sides), center, rays: search.rays })
}

fn outline_side(
    search: &mut EdgeSearch<'_>,
    boundary: &Boundary,
    arc: &BoundaryArc,
    points: usize,
) -> Option<OutlineSide> {
    let turn = arc.to - arc.from;
    let steps = even_steps((points as f64 * turn / TAU).ceil() as usize);
    let point = |i: usize| {
        let azimuth = arc.from + turn * i as f64 / steps as f64;
        let edge = search.edge(azimuth, boundary.radius_guess(azimuth), GUESS_SPREAD)?;
        search.launch.crossing(boundary.frame.point(azimuth, edge.radius))
    };
    let points = (0..=steps).map(point).collect::<Option<Vec<_>>>()?;
    Some(OutlineSide { limit: arc.limit, length: length(&points), points })
}

/// The length of a smooth curve through points at an even number of equal steps.
fn length(points: &[[f64; 2]]) -> f64 {
    let chords = |step: usize| -> f64 {
        let ends = points.iter().step_by(step).zip(points.iter().step_by(step).skip(1));
        ends.map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum()
    };
    (4.0 * chords(1) - chords(2)) / 3.0
}

impl OutlineSide {
    /// The mirror image across the y axis, from its end to its beginning.
    fn mirror_image(&self) -> Self {
        let points = self.points.iter().rev().map(|[x, y]| [-x, *y]).collect();
        Self { points, ..self.clone() }
    }

    /// Appends a side of the same limit that begins where this one ends.
    fn append(&mut self, next: Self) {
        self.points.extend(next.points.into_iter().skip(1));
        self.length += next.length;
    }
}

/// Merges neighbours of the same limit.
fn merge_adjacent(sides: Vec<OutlineSide>) -> Vec<OutlineSide> {
    let mut whole: Vec<OutlineSide> = Vec::with_capacity(sides.len());
    for side in sides {
        match whole.last_mut() {
            Some(last) if last.limit == side.limit => last.append(side),
            _ => whole.push(side),
        }
    }
    if whole.len() > 1 && whole.first().map(|side| side.limit) == whole.last().map(|s| s.limit) {
        let first = whole.remove(0);
        whole.iter_mut().last().into_iter().for_each(|last| last.append(first.clone()));
    }
    whole
}
