//! Which rays of a field get through.
//!
//! Sixteen rays at the rim tell whether anything clips at all. If so, a coarse grid of rays shows
//! where light is, in how many pieces, and whether one point sees all of it; then the edge is
//! followed from there.

use super::boundary::{Boundary, Search};
use super::launch::Launch;
use crate::trace::{Points, Rays, Sink};
use std::f64::consts::{PI, TAU};

/// Rays at the rim that tell whether a pupil is clear.
const RIM_RAYS: usize = 16;
/// Cells of the grid along a side, at first and where little light was found.
const GRIDS: [usize; 3] = [25, 101, 301];
/// A grid with fewer rays than this in the light is too coarse for a verdict.
const FEW: usize = 12;
/// Azimuths at which the edge is looked at first, over a half turn.
const AZIMUTHS: usize = 24;
/// How far from the axis light is looked for where no disc limits the pupil: this, doubled until
/// the light ends inside.
const REACH: f64 = 1.6;
const WIDEST: f64 = 120.0;

/// The form of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Nothing gets through.
    Dark,
    /// The whole disc gets through.
    Clear,
    /// One piece, bounded by arcs.
    Split(Boundary),
    /// No single point sees all of it, or its edge is noise: it is sampled and clipped.
    Ragged {
        /// How many separate pieces were seen.
        pieces: usize,
        /// A square that holds all of it: its centre and half of its side.
        square: ([f64; 2], f64),
    },
    /// Nothing limits it, so that no beam is defined.
    Endless,
}

/// The rays of a field at a wavelength that get through.
#[derive(Debug, Clone)]
pub struct Region<'a> {
    /// Where its rays start.
    pub launch: Launch<'a>,
    /// Its form.
    pub kind: Kind,
    /// Rays traced to find it.
    pub rays: usize,
}

impl<'a> Region<'a> {
    /// The region of a launch.
    pub fn new(launch: Launch<'a>) -> Self {
        let disc = launch.bench.ends_at_disc();
        let mut rays = 0;
        if launch.bench.stop_radius() == 0.0 {
            return Self { launch, kind: Kind::Dark, rays };
        }
        if disc {
            let rim = launch.fates(&rim(launch.is_symmetric()));
            rays += rim.len();
            if rim.iter().all(|lit| *lit) {
                return Self { launch, kind: Kind::Clear, rays };
            }
        }
        let mut reach = if disc { 1.0 } else { REACH };
        let mut kind = Kind::Dark;
        for cells in GRIDS {
            let grid = Grid::new(&launch, cells, &mut reach);
            rays += grid.rays;
            if grid.count() >= FEW || (grid.count() > 0 && cells == GRIDS[GRIDS.len() - 1]) {
                let found = grid.kind(&launch);
                if let Kind::Split(boundary) = &found {
                    rays += boundary.rays;
                }
                kind = found;
                break;
            }
        }
        Self { launch, kind, rays }
    }

    /// Whether no light gets through.
    pub fn is_dark(&self) -> bool {
        self.kind == Kind::Dark
    }
}

/// Points at the rim of the disc and its centre; a half turn of them where the pupil is its own
/// mirror image.
fn rim(symmetric: bool) -> Vec<[f64; 2]> {
    let turn = if symmetric { PI / (RIM_RAYS - 1) as f64 } else { TAU / RIM_RAYS as f64 };
    let at = |i: usize| (turn * i as f64).sin_cos().into();
    (0..RIM_RAYS).map(at).chain([[0.0, 0.0]]).collect()
}

impl Launch<'_> {
    /// Which of these pupil points get through the surfaces.
    pub(super) fn fates(&self, points: &[[f64; 2]]) -> Vec<bool> {
        let mut lit = vec![false; points.len()];
        let launched = points.iter().enumerate().filter_map(|(i, p)| Some((i, self.ray(*p)?)));
        let (places, rays): (Vec<usize>, Rays<f64>) = launched.unzip_rays();
        let mut landed = Points::default();
        self.color().tracer.batch(&rays, &mut landed);
        places.iter().enumerate().for_each(|(ray, i)| lit[*i] = landed.fate(ray).is_imaged());
        lit
    }
}

/// Splits rays from what belongs to them.
trait UnzipRays<T> {
    fn unzip_rays(self) -> (Vec<T>, Rays<f64>);
}

impl<T, I: Iterator<Item = (T, crate::trace::Ray<f64>)>> UnzipRays<T> for I {
    fn unzip_rays(self) -> (Vec<T>, Rays<f64>) {
        let mut rays = Rays::default();
        let places = self.map(|(place, ray)| {
            rays.push(ray);
            place
        });
        (places.collect(), rays)
    }
}

/// A coarse picture of the light in the pupil plane.
struct Grid {
    cells: usize,
    reach: f64,
    lit: Vec<bool>,
    rays: usize,
}

impl Grid {
    /// Rays over a square that holds all of the light; `reach` grows until it does.
    fn new(launch: &Launch<'_>, cells: usize, reach: &mut f64) -> Self {
        let mut rays = 0;
        loop {
            let grid = Self::of(launch, cells, *reach);
            rays += grid.rays;
            let limited = launch.bench.ends_at_disc() || *reach >= WIDEST;
            if limited || (grid.count() > 0 && !grid.touches_its_edge()) {
                return Self { rays, ..grid };
            }
            *reach *= 2.0;
        }
    }

    fn of(launch: &Launch<'_>, cells: usize, reach: f64) -> Self {
        let mut grid = Self { cells, reach, lit: vec![false; cells * cells], rays: 0 };
        let disc = launch.bench.ends_at_disc();
        let wanted = |p: [f64; 2]| !disc || p[0].hypot(p[1]) <= 1.0;
        let half = launch.is_symmetric();
        let chosen: Vec<usize> = (0..cells * cells)
            .filter(|i| wanted(grid.point(*i)) && (!half || i % cells >= cells / 2))
            .collect();
        let points: Vec<_> = chosen.iter().map(|i| grid.point(*i)).collect();
        grid.rays = points.len();
        for (i, lit) in chosen.iter().zip(launch.fates(&points)) {
            grid.lit[*i] = lit;
            if half {
                let (row, column) = (i / cells, i % cells);
                grid.lit[row * cells + (cells - 1 - column)] = lit;
            }
        }
        grid
    }

    /// The middle of a cell.
    fn point(&self, cell: usize) -> [f64; 2] {
        let at =
            |i: usize| self.reach * (2.0 * i as f64 - (self.cells - 1) as f64) / self.cells as f64;
        [at(cell % self.cells), at(cell / self.cells)]
    }

    fn count(&self) -> usize {
        self.lit.iter().filter(|lit| **lit).count()
    }

    fn lit_cells(&self) -> impl Iterator<Item = usize> + '_ {
        self.lit.iter().enumerate().filter(|(_, lit)| **lit).map(|(i, _)| i)
    }

    fn touches_its_edge(&self) -> bool {
        let last = self.cells - 1;
        let at_edge = |i: usize| i == 0 || i == last;
        self.lit_cells().any(|i| at_edge(i % self.cells) || at_edge(i / self.cells))
    }

    fn kind(&self, launch: &Launch<'_>) -> Kind {
        if !launch.bench.ends_at_disc() && self.touches_its_edge() {
            return Kind::Endless;
        }
        let pieces = self.pieces();
        let ragged = Kind::Ragged { pieces, square: self.square() };
        if pieces != 1 {
            return ragged;
        }
        let center = self.center(launch);
        let end = if launch.is_symmetric() { PI } else { TAU };
        let azimuths = if launch.is_symmetric() { AZIMUTHS } else { 2 * AZIMUTHS };
        match Search::new(launch, center).boundary(end, azimuths) {
            Some(boundary) if self.agrees(&boundary) => Kind::Split(boundary),
            Some(_) | None => ragged,
        }
    }

    /// The centroid of the light, or the lit point nearest to it.
    fn center(&self, launch: &Launch<'_>) -> [f64; 2] {
        let count = self.count() as f64;
        let points = || self.lit_cells().map(|i| self.point(i));
        let sum = points().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        let x = if launch.is_symmetric() { 0.0 } else { sum[0] / count };
        let center = [x, sum[1] / count];
        if launch.is_lit(center) {
            return center;
        }
        let distance = |p: &[f64; 2]| (p[0] - center[0]).hypot(p[1] - center[1]);
        points().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(center)
    }

    /// A square around the light.
    fn square(&self) -> ([f64; 2], f64) {
        let cell = 2.0 * self.reach / self.cells as f64;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in self.lit_cells().map(|i| self.point(i)) {
            low = [low[0].min(p[0]), low[1].min(p[1])];
            high = [high[0].max(p[0]), high[1].max(p[1])];
        }
        let center = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        (center, 0.5 * (high[0] - low[0]).max(high[1] - low[1]) + 1.5 * cell)
    }

    /// How many separate pieces the light has.
    fn pieces(&self) -> usize {
        let mut seen = vec![false; self.lit.len()];
        let mut pieces = 0;
        for start in self.lit_cells() {
            if !seen[start] {
                pieces += 1;
                self.flood(start, &mut seen);
            }
        }
        pieces
    }

    /// Marks all light that hangs together with a cell, over sides and corners.
    fn flood(&self, start: usize, seen: &mut [bool]) {
        let mut waiting = vec![start];
        seen[start] = true;
        while let Some(cell) = waiting.pop() {
            for next in self.neighbours(cell) {
                if self.lit[next] && !seen[next] {
                    seen[next] = true;
                    waiting.push(next);
                }
            }
        }
    }

    fn neighbours(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let cells = self.cells;
        let (row, column) = (cell / cells, cell % cells);
        let near = move |i: usize| i.saturating_sub(1)..(i + 2).min(cells);
        near(row).flat_map(move |r| near(column).map(move |c| r * cells + c))
    }

    /// Whether light and dark lie on their sides of the edge, but for the width of a cell.
    fn agrees(&self, boundary: &Boundary) -> bool {
        let cell = 2.0 * self.reach / self.cells as f64;
        let [x, y] = boundary.center;
        let end = boundary.samples.last().map_or(TAU, |s| s.0);
        (0..self.lit.len()).all(|i| {
            let p = self.point(i);
            let (dx, dy) = (p[0] - x, p[1] - y);
            let mut azimuth = dx.atan2(dy).rem_euclid(TAU);
            if azimuth > end {
                azimuth = TAU - azimuth;
            }
            let radius = boundary.near(azimuth);
            let slack = 1.5 * cell + 0.03 * radius;
            let r = dx.hypot(dy);
            if self.lit[i] { r <= radius + slack } else { r >= radius - slack }
        })
    }
}
