//! Tracking of a boundary while the lens changes a little: the same arcs between corners found
//! anew.

use super::boundary::{Boundary, BoundaryArc, PupilLimit};
use super::kind::{Region, RegionKind};
use super::light_grid::LightGrid;
use crate::pupil::launch::Launch;
use std::f64::consts::PI;

/// The last Newton step to a corner, where both margins vanish, relative to the size of the pupil: the
/// error behind it is of the order of its square.
const LAST_STEP: f64 = 3e-8;
/// The largest number of Newton steps to a corner.
const STEPS: usize = 12;
/// The longest Newton step, relative to the size of the pupil: a longer one leaves the
/// neighbourhood.
const MAX_STEP: f64 = 0.3;
/// The shortest arc, in radians: a shorter one is about to vanish.
const SHORTEST_ARC: f64 = 1e-6;
/// The grid that looks for lost light: rays along a side, and half of its side in sizes of the
/// pupil.
const CELLS: usize = 21;
const GRID_REACH: f64 = 1.5;

impl<'a> Region<'a> {
    /// The region of a launch whose lens has changed little since its region was `before`: the
    /// boundary is tracked, or searched for again around the former light if its arcs have changed; in a
    /// dark pupil light is looked for by a coarse grid.
    pub fn track(before: &RegionKind, launch: Launch<'a>) -> Self {
        match before {
            RegionKind::StarShaped(boundary) => match boundary.track(&launch) {
                Some(boundary) => {
                    let rays = boundary.rays;
                    Self { launch, kind: RegionKind::StarShaped(boundary), rays }
                }
                None => Self::search_near(boundary, launch),
            },
            // The narrowest light is not worth the rays at every step: a search that is not for a
            // small change finds it.
            RegionKind::Dark => Self::around(launch, LightGrid::around_wide_light),
            RegionKind::Clear | RegionKind::Irregular { .. } | RegionKind::Unbounded => {
                Self::new(launch)
            }
        }
    }
}

impl<'a> Region<'a> {
    /// The region of a launch, searched for again around the former light, unless no ray gets through
    /// there: then it is dark, and a larger search would waste rays.
    fn search_near(before: &Boundary, launch: Launch<'a>) -> Self {
        let cover = before.enclosing_disc();
        let place = |i: usize| {
            let at = |k: usize| GRID_REACH * (2.0 * (k as f64 + 0.5) / CELLS as f64 - 1.0);
            let (u, v) = (at(i % CELLS), at(i / CELLS));
            [0, 1].map(|k| cover.center[k] + u * cover.axes[0][k] + v * cover.axes[1][k])
        };
        let points: Vec<_> = (0..CELLS * CELLS).map(place).collect();
        if !launch.transmission_mask(&points).into_iter().any(|lit| lit) {
            return Self { launch, kind: RegionKind::Dark, rays: points.len() };
        }
        let [a, b] = cover.axes;
        let half = GRID_REACH * (a[0].abs() + b[0].abs()).max(a[1].abs() + b[1].abs());
        let around = |launch: &Launch<'_>, rays: &mut usize| {
            let near = LightGrid::near_light(launch, (cover.center, half), rays);
            near.or_else(|| LightGrid::around_light(launch, rays))
        };
        let found = Self::around(launch, around);
        Self { rays: found.rays + points.len(), ..found }
    }
}

impl Boundary {
    /// The same arcs between tracked corners; `None` if an arc has vanished.
    fn track(&self, launch: &Launch<'_>) -> Option<Self> {
        let mut found = self.clone();
        found.rays = 0;
        let count = self.arcs.len();
        let whole = self.samples.last().is_some_and(|s| s.0 > 1.5 * PI);
        let corners = if whole && count > 1 { count } else { count - 1 };
        for i in 0..corners {
            let next = (i + 1) % count;
            let corner =
                self.track_corner(launch, &self.arcs[i], &self.arcs[next], &mut found.rays)?;
            found.arcs[i].to = corner;
            let turn = if next == 0 { 2.0 * PI } else { 0.0 };
            found.arcs[next].from = corner - turn;
        }
        // Without light at the centre there is no star-shaped pupil.
        let lit = launch.transmits(self.frame.center);
        (lit && found.arcs.iter().all(|arc| arc.to - arc.from > SHORTEST_ARC)).then_some(found)
    }

    /// The azimuth at which two limits meet, near the end of one arc and the start of the next, by
    /// Newton's method in the plane of the pupil.
    fn track_corner(
        &self,
        launch: &Launch<'_>,
        a: &BoundaryArc,
        b: &BoundaryArc,
        rays: &mut usize,
    ) -> Option<f64> {
        let before = a.to;
        let mut p = self.frame.point(before, self.radius_guess(before));
        let size = self.radius_guess(before) * self.frame.area().sqrt();
        for _ in 0..STEPS {
            *rays += 2;
            let (f, [fx, fy]) = margin_with_slope(launch, p, a.limit)?;
            let (g, [gx, gy]) = margin_with_slope(launch, p, b.limit)?;
            let determinant = fx * gy - fy * gx;
            let step = [(f * gy - g * fy) / determinant, (g * fx - f * gx) / determinant];
            let length = step[0].hypot(step[1]);
            if !(length < MAX_STEP * size) {
                return None;
            }
            p = [p[0] - step[0], p[1] - step[1]];
            if length <= LAST_STEP * size {
                let (azimuth, _) = self.frame.polar(p);
                // The azimuth nearest to the former one, up to full turns.
                let turns = ((before - azimuth) / (2.0 * PI)).round();
                return Some(azimuth + 2.0 * PI * turns);
            }
        }
        None
    }
}

/// The margin at a limit and its derivatives by the pupil coordinates.
fn margin_with_slope(
    launch: &Launch<'_>,
    p: [f64; 2],
    limit: PupilLimit,
) -> Option<(f64, [f64; 2])> {
    match limit {
        PupilLimit::Disc => Some((1.0 - p[0] * p[0] - p[1] * p[1], [-2.0 * p[0], -2.0 * p[1]])),
        PupilLimit::Unaimed => None,
        PupilLimit::Surface(surface, ray_limit) => {
            let (channel, ray) = (launch.channel(), launch.dual_ray(p)?);
            let (open, tracer) = (&channel.unclipped, &channel.tracer);
            if let Some(margin) = open.margin_with_rims(tracer, ray, surface, ray_limit) {
                return Some((margin.value, margin.slope));
            }
            let value = tracer.margin(launch.ray(p)?, surface, ray_limit)?;
            Some((value, open.margin(ray, surface, ray_limit)?.slope))
        }
    }
}
