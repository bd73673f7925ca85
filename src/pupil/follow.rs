//! Following an edge while the lens moves a little: the same arcs between corners found anew.

use super::boundary::{Arc, Boundary, Limit};
use super::launch::Launch;
use super::region::{Kind, Region};
use std::f64::consts::PI;

/// A corner is where both margins vanish, to this part of the pupil's size.
const CLOSE: f64 = 1e-12;
/// Steps of Newton's method to a corner.
const STEPS: usize = 12;
/// A step longer than this part of the pupil leaves the neighbourhood.
const FAR: f64 = 0.3;
/// An arc shorter than this, in radians, is about to vanish.
const SHORTEST: f64 = 1e-6;
/// Rays along a side of the grid that looks for lost light, and how far it reaches, in sizes of the
/// pupil.
const CELLS: usize = 21;
const AROUND: f64 = 1.5;

impl<'a> Region<'a> {
    /// The region of a launch whose lens has moved little since it was `before`: its edge is
    /// followed, or searched anew where its arcs have changed.
    pub fn followed(before: &Kind, launch: Launch<'a>) -> Self {
        match before {
            Kind::Split(boundary) => match boundary.followed(&launch) {
                Some(boundary) => {
                    let rays = boundary.rays;
                    Self { launch, kind: Kind::Split(boundary), rays }
                }
                None => Self::new_near(boundary, launch),
            },
            Kind::Clear | Kind::Dark | Kind::Ragged { .. } | Kind::Endless => Self::new(launch),
        }
    }
}

impl<'a> Region<'a> {
    /// The region of a launch, searched anew unless no ray gets through around where the light was:
    /// then it is dark, and no larger search is worth its rays.
    fn new_near(before: &Boundary, launch: Launch<'a>) -> Self {
        let cover = before.cover();
        let place = |i: usize| {
            let at = |k: usize| AROUND * (2.0 * (k as f64 + 0.5) / CELLS as f64 - 1.0);
            let (u, v) = (at(i % CELLS), at(i / CELLS));
            [0, 1].map(|k| cover.center[k] + u * cover.axes[0][k] + v * cover.axes[1][k])
        };
        let points: Vec<_> = (0..CELLS * CELLS).map(place).collect();
        if launch.fates(&points).into_iter().any(|lit| lit) {
            return Self::new(launch);
        }
        Self { launch, kind: Kind::Dark, rays: points.len() }
    }
}

impl Boundary {
    /// The same arcs between corners found anew; `None` where an arc has vanished.
    fn followed(&self, launch: &Launch<'_>) -> Option<Self> {
        let mut found = self.clone();
        found.rays = 0;
        let count = self.arcs.len();
        let whole = self.samples.last().is_some_and(|s| s.0 > 1.5 * PI);
        let corners = if whole && count > 1 { count } else { count - 1 };
        for i in 0..corners {
            let next = (i + 1) % count;
            let corner = self.corner(launch, &self.arcs[i], &self.arcs[next], &mut found.rays)?;
            found.arcs[i].to = corner;
            let turn = if next == 0 { 2.0 * PI } else { 0.0 };
            found.arcs[next].from = corner - turn;
        }
        // A ray at the centre that has lost the light ends all.
        let lit = launch.is_lit(self.frame.center);
        (lit && found.arcs.iter().all(|arc| arc.to - arc.from > SHORTEST)).then_some(found)
    }

    /// The azimuth at which two limits vanish, near where one arc has ended and the next begun:
    /// Newton's method in the plane of the pupil.
    fn corner(&self, launch: &Launch<'_>, a: &Arc, b: &Arc, rays: &mut usize) -> Option<f64> {
        let before = a.to;
        let mut p = self.frame.point(before, self.near(before));
        let size = self.near(before) * self.frame.area().sqrt();
        for _ in 0..STEPS {
            *rays += 4;
            let (f, [fx, fy]) = margin(launch, p, a.limit)?;
            let (g, [gx, gy]) = margin(launch, p, b.limit)?;
            let determinant = fx * gy - fy * gx;
            let step = [(f * gy - g * fy) / determinant, (g * fx - f * gx) / determinant];
            let length = step[0].hypot(step[1]);
            if !(length < FAR * size) {
                return None;
            }
            p = [p[0] - step[0], p[1] - step[1]];
            if length <= CLOSE * size {
                let (azimuth, _) = self.frame.polar(p);
                // The azimuth nearest to the one before, whatever the number of turns.
                let turns = ((before - azimuth) / (2.0 * PI)).round();
                return Some(azimuth + 2.0 * PI * turns);
            }
        }
        None
    }
}

/// The margin at a limit and its derivatives by the pupil coordinates.
fn margin(launch: &Launch<'_>, p: [f64; 2], limit: Limit) -> Option<(f64, [f64; 2])> {
    match limit {
        Limit::Disc => Some((1.0 - p[0] * p[0] - p[1] * p[1], [-2.0 * p[0], -2.0 * p[1]])),
        Limit::Unaimed => None,
        Limit::Surface(surface, hurdle) => {
            let color = launch.color();
            let value = color.tracer.margin(launch.ray(p)?, surface, hurdle)?;
            let slope = color.open.margin(launch.dual_ray(p)?, surface, hurdle)?.slope;
            Some((value, slope))
        }
    }
}
