//! A coarse grid of rays that shows the position and the form of the light in a pupil.

use super::annulus::Annulus;
use super::boundary::{Boundary, EdgePoint, PolarFrame};
use super::dark_points::{DarkPoints, bounds};
use super::edge_search::{EdgeSearch, GUESS_SPREAD, LimitFilter};
use super::kind::RegionKind;
use crate::pupil::launch::Launch;
use crate::trace::TraceSink;
use std::f64::consts::{PI, TAU};

/// The grids that search for light if no disc limits the pupil: cells along a side, and the largest
/// distance from the axis that a grid so fine is used for.
const SCANS: [(usize, f64); 3] = [(25, 120.0), (101, 13.0), (301, 1.7)];
/// A grid with fewer lit rays than this is too coarse: another one is laid around the light, at
/// most `MAX_ZOOMS` times.
const ENOUGH_LIT: usize = 12;
const MAX_ZOOMS: usize = 14;
/// The largest number of moves of a grid along with light that it cuts, and the part of a grid in
/// which light is narrow enough for a move without doubling.
const MAX_MOVES: usize = 12;
const FILLED: f64 = 0.5;
/// Light through a narrower opening, in pupil coordinates, is a single ray: a semi-diameter of zero
/// lets one through on the axis.
const NARROWEST_PUPIL: f64 = 1e-9;
/// The number of azimuths at which the edge is sampled first, over a half turn.
pub(super) const AZIMUTHS: usize = 24;
/// The distance from the axis to which light is searched for first if no disc limits the pupil.
const FIRST_REACH: f64 = 1.6;

impl Launch<'_> {
    /// For each pupil point, true if its ray gets through the surfaces.
    pub(super) fn transmission_mask(&self, points: &[[f64; 2]]) -> Vec<bool> {
        let mut lit = vec![false; points.len()];
        let (traced, landed) = self.trace_points(points);
        traced.iter().enumerate().for_each(|(ray, i)| lit[*i] = landed.fate(ray).is_imaged());
        lit
    }
}

/// The factor by which a square is larger than the points that it has to hold.
const MARGIN: f64 = 1.1;

/// A square around light, or a wider one if light gets through outside of it in an aperture that is no circle
/// about the vertex: a narrow slit may be lit far from the few cells of a grid that meet it.
fn widened_to_frames(launch: &Launch<'_>, (center, half): ([f64; 2], f64)) -> ([f64; 2], f64) {
    let is_within = |p: &[f64; 2]| (0..2).all(|k| (p[k] - center[k]).abs() <= half);
    let outside = launch.frame_points().into_iter().filter(|p| !is_within(p));
    let lit: Vec<_> = outside.filter(|p| launch.transmits(*p)).collect();
    if lit.is_empty() {
        return (center, half);
    }
    let ends = [-1.0, 1.0].map(|side| center.map(|at| at + side * half));
    let [low, high] = bounds(lit.into_iter().chain(ends));
    let size = (high[0] - low[0]).max(high[1] - low[1]);
    ([0, 1].map(|k| 0.5 * (low[k] + high[k])), 0.5 * MARGIN * size)
}

/// A coarse grid of rays over a square of the pupil plane, each lit or dark.
pub(super) struct LightGrid {
    cells: usize,
    center: [f64; 2],
    half: f64,
    lit: Vec<bool>,
    rays: usize,
}

impl LightGrid {
    /// A grid that holds all of the light with enough lit rays; `None` if there is none.
    pub(super) fn around_light(launch: &Launch<'_>, rays: &mut usize) -> Option<Self> {
        Self::around_first_light(launch, &SCANS, rays)
    }

    /// The same by the coarsest cells alone, a thirtieth of the rays of a search for the narrowest light.
    pub(super) fn around_wide_light(launch: &Launch<'_>, rays: &mut usize) -> Option<Self> {
        Self::around_first_light(launch, &SCANS[..1], rays)
    }

    /// The same from a square about a point near the light; `None` also if the light goes on too far.
    pub(super) fn near_light(
        launch: &Launch<'_>,
        (center, half): ([f64; 2], f64),
        rays: &mut usize,
    ) -> Option<Self> {
        let (center, half) = if launch.is_symmetric() {
            ([0.0, center[1]], half + center[0].abs())
        } else {
            (center, half)
        };
        let grid = Self::sample(launch, SCANS[0].0, center, half);
        *rays += grid.rays;
        if grid.count() == 0 {
            return None;
        }
        let grid = grid.follow(launch, rays);
        if grid.touches_its_edge() { None } else { grid.narrowed(launch, rays) }
    }

    fn around_first_light(
        launch: &Launch<'_>,
        scans: &[(usize, f64)],
        rays: &mut usize,
    ) -> Option<Self> {
        let found =
            scans.iter().find_map(|(cells, widest)| Self::scan(launch, *cells, *widest, rays));
        found.or_else(|| Self::in_frame(launch, rays))?.narrowed(launch, rays)
    }

    /// A grid laid around the light until enough cells are lit.
    fn narrowed(self, launch: &Launch<'_>, rays: &mut usize) -> Option<Self> {
        let mut grid = self;
        for _ in 0..MAX_ZOOMS {
            let (center, half) = grid.bounding_square();
            if grid.count() >= ENOUGH_LIT || half > 0.9 * grid.half {
                break;
            }
            let closer = Self::sample(launch, SCANS[0].0, center, half);
            *rays += closer.rays;
            if closer.count() == 0 {
                break;
            }
            // The tips of a crescent may be too thin for the coarser cells.
            grid = closer.follow(launch, rays);
        }
        (grid.half > NARROWEST_PUPIL).then_some(grid)
    }

    /// A grid about the ray through the centre of an aperture that is no circle about the vertex, if that ray
    /// gets through: the light of a narrow slit slips between the cells of any other grid.
    fn in_frame(launch: &Launch<'_>, rays: &mut usize) -> Option<Self> {
        let reach = if launch.model.ends_at_disc() { 1.0 } else { FIRST_REACH };
        let lit = launch.frame_centers().into_iter().find(|p| launch.transmits(*p))?;
        let grid = Self::sample(launch, SCANS[0].0, lit, reach);
        *rays += grid.rays;
        (grid.count() > 0).then_some(grid)
    }

    /// Doubles a grid about the axis until it holds light, and all of it. Light at the edge of a
    /// grid that slips between the cells of a larger one is followed in its own cells.
    fn scan(launch: &Launch<'_>, cells: usize, widest: f64, rays: &mut usize) -> Option<Self> {
        let disc = launch.model.ends_at_disc();
        let mut half = if disc { 1.0 } else { FIRST_REACH };
        let mut cut: Option<Self> = None;
        loop {
            let grid = Self::sample(launch, cells, [0.0; 2], half);
            *rays += grid.rays;
            let largest = disc || 2.0 * half > widest;
            if grid.count() > 0 {
                if disc || !grid.touches_its_edge() {
                    return Some(grid);
                }
                cut = Some(grid);
            } else if cut.is_some() {
                break;
            }
            if largest {
                break;
            }
            half *= 2.0;
        }
        cut.map(|grid| grid.follow(launch, rays))
    }

    /// The grid moved along with light that goes on beyond its edge, and doubled while the light
    /// fills it; one whose light still touches the edge if it is not held in `MAX_MOVES`.
    fn follow(self, launch: &Launch<'_>, rays: &mut usize) -> Self {
        let mut grid = self;
        for _ in 0..MAX_MOVES {
            if !grid.touches_its_edge() {
                break;
            }
            let (center, reach) = grid.bounding_square();
            let half = if reach > FILLED * grid.half { 2.0 * grid.half } else { grid.half };
            let moved = Self::sample(launch, grid.cells, center, half);
            *rays += moved.rays;
            if moved.count() == 0 {
                break;
            }
            grid = moved;
        }
        grid
    }

    fn sample(launch: &Launch<'_>, cells: usize, center: [f64; 2], half: f64) -> Self {
        let lit = vec![false; cells * cells];
        let mut grid = Self { cells, center, half, lit, rays: 0 };
        let disc = launch.model.ends_at_disc();
        let wanted = |p: [f64; 2]| !disc || p[0].hypot(p[1]) <= 1.0;
        let mirrored = launch.is_symmetric();
        let chosen: Vec<usize> = (0..cells * cells)
            .filter(|i| wanted(grid.point(*i)) && (!mirrored || i % cells >= cells / 2))
            .collect();
        let points: Vec<_> = chosen.iter().map(|i| grid.point(*i)).collect();
        grid.rays = points.len();
        for (i, lit) in chosen.iter().zip(launch.transmission_mask(&points)) {
            grid.lit[*i] = lit;
            if mirrored {
                let (row, column) = (i / cells, i % cells);
                grid.lit[row * cells + (cells - 1 - column)] = lit;
            }
        }
        grid
    }

    /// The centre of a cell.
    fn point(&self, cell: usize) -> [f64; 2] {
        let step = 2.0 * self.half / self.cells as f64;
        let at = |i: usize| step * (i as f64 - 0.5 * (self.cells - 1) as f64);
        [self.center[0] + at(cell % self.cells), self.center[1] + at(cell / self.cells)]
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

    pub(super) fn classify(&self, launch: &Launch<'_>, shadows: &[Option<[f64; 2]>]) -> RegionKind {
        if !launch.model.ends_at_disc() && self.touches_its_edge() {
            return RegionKind::Unbounded;
        }
        let pieces = self.count_pieces();
        let dark = DarkPoints::of(&launch.channel().system);
        let end = if launch.is_symmetric() { PI } else { TAU };
        let azimuths = if launch.is_symmetric() { AZIMUTHS } else { 2 * AZIMUTHS };
        if pieces == 1
            && let Some(boundary) =
                EdgeSearch::new(launch, self.frame(launch)).trace_boundary(end, azimuths)
            && self.agrees(launch, &boundary, shadows)
            && (dark.is_empty() || dark.allow(launch, &boundary))
        {
            return RegionKind::StarShaped(boundary);
        }
        let around = |middle: [f64; 2]| {
            let symmetric = launch.is_symmetric();
            let center = if symmetric { [0.0, middle[1]] } else { middle };
            let frame = PolarFrame { center, axes: self.axes(self.centroid(), symmetric) };
            Annulus::around(launch, frame, end, azimuths)
        };
        let annuli = shadows.iter().flatten().filter_map(|middle| around(*middle));
        let annulus = annuli.into_iter().find(|annulus| {
            let agrees = self.agrees_with_annulus(launch, annulus, shadows);
            agrees && (dark.is_empty() || dark.allow_annulus(launch, annulus))
        });
        // A grid may be too coarse to show that a narrow annulus is connected.
        let pieces = if annulus.is_some() { 1 } else { pieces };
        RegionKind::Irregular {
            pieces,
            square: widened_to_frames(launch, self.bounding_square()),
            annulus: annulus.map(Box::new),
        }
    }

    /// The centroid of the light.
    fn centroid(&self) -> [f64; 2] {
        let count = self.count() as f64;
        let points = self.lit_cells().map(|i| self.point(i));
        let sum = points.fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        [sum[0] / count, sum[1] / count]
    }

    /// The frame in which the light looks round, about its centroid, or about the lit point nearest
    /// to that.
    fn frame(&self, launch: &Launch<'_>) -> PolarFrame {
        let points = || self.lit_cells().map(|i| self.point(i));
        let middle = self.centroid();
        let mut center = if launch.is_symmetric() { [0.0, middle[1]] } else { middle };
        if !launch.transmits(center) {
            let distance = |p: &[f64; 2]| (p[0] - center[0]).hypot(p[1] - center[1]);
            let nearest = points().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            center = nearest.unwrap_or(center);
        }
        PolarFrame { center, axes: self.axes(middle, launch.is_symmetric()) }
    }

    /// The axes of an ellipse with the second moments of the light: those of a uniform ellipse are
    /// a quarter of the squares of its semi-axes.
    fn axes(&self, middle: [f64; 2], symmetric: bool) -> [[f64; 2]; 2] {
        let cell = 2.0 * self.half / self.cells as f64;
        let own = cell * cell / 12.0;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for p in self.lit_cells().map(|i| self.point(i)) {
            let (x, y) = (p[0] - middle[0], p[1] - middle[1]);
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
        }
        let count = self.count() as f64;
        let (xx, yy) = (xx / count + own, yy / count + own);
        let xy = if symmetric { 0.0 } else { xy / count };
        // Cholesky factors that keep the y axis along y.
        let y = yy.sqrt();
        let slant = xy / y;
        let x = (xx - slant * slant).max(0.01 * xx).sqrt();
        [[2.0 * x, 0.0], [2.0 * slant, 2.0 * y]]
    }

    /// A square around the light: its centre and half of its side.
    fn bounding_square(&self) -> ([f64; 2], f64) {
        let cell = 2.0 * self.half / self.cells as f64;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in self.lit_cells().map(|i| self.point(i)) {
            low = [low[0].min(p[0]), low[1].min(p[1])];
            high = [high[0].max(p[0]), high[1].max(p[1])];
        }
        let center = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        (center, 0.5 * (high[0] - low[0]).max(high[1] - low[1]) + 1.5 * cell)
    }

    /// The number of separate pieces of the light.
    fn count_pieces(&self) -> usize {
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

    /// Marks all light connected with a cell, over sides and corners.
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

    /// The grid points and the centres of shadows, each with true if it is lit.
    fn labelled_points<'b>(
        &'b self,
        shadows: &'b [Option<[f64; 2]>],
    ) -> impl Iterator<Item = ([f64; 2], bool)> + 'b {
        let cells = self.lit.iter().enumerate().map(|(i, lit)| (self.point(i), *lit));
        cells.chain(shadows.iter().flatten().map(|p| (*p, false)))
    }

    /// True if the lit points lie inside the boundary and the dark ones outside.
    fn agrees(
        &self,
        launch: &Launch<'_>,
        boundary: &Boundary,
        shadows: &[Option<[f64; 2]>],
    ) -> bool {
        let mut search = EdgeSearch::new(launch, boundary.frame);
        self.labelled_points(shadows)
            .all(|(point, lit)| lies_on_side(&mut search, boundary, point, lit))
    }

    /// True if the lit points, and only those, lie between the two edges of an annulus.
    fn agrees_with_annulus(
        &self,
        launch: &Launch<'_>,
        annulus: &Annulus,
        shadows: &[Option<[f64; 2]>],
    ) -> bool {
        let Annulus { outer, inner } = annulus;
        let mut rims =
            EdgeSearch::new(launch, outer.frame).with_limits(LimitFilter::WithoutObstructions);
        let mut shadow =
            EdgeSearch::new(launch, inner.frame).with_limits(LimitFilter::Obstructions);
        self.labelled_points(shadows).all(|(point, lit)| {
            let (light, dark) = (
                lies_on_side(&mut rims, outer, point, lit),
                lies_on_side(&mut shadow, inner, point, !lit),
            );
            if lit { light && dark } else { light || dark }
        })
    }
}

/// True if a point lies inside a boundary (or outside, if not `inside`); close to it, the edge is
/// searched for at its azimuth.
fn lies_on_side(
    search: &mut EdgeSearch<'_>,
    boundary: &Boundary,
    point: [f64; 2],
    inside: bool,
) -> bool {
    let end = boundary.samples.last().map_or(TAU, |s| s.0);
    let (mut azimuth, r) = boundary.frame.polar(point);
    if azimuth > end {
        azimuth = TAU - azimuth;
    }
    let near = boundary.radius_guess(azimuth);
    let fits = |radius: f64, slack: f64| {
        if inside { r <= radius + slack } else { r >= radius - slack }
    };
    let exact = |edge: EdgePoint| fits(edge.radius, 1e-6 * edge.radius);
    fits(near, 0.0) || search.edge(azimuth, near, GUESS_SPREAD).is_some_and(exact)
}
