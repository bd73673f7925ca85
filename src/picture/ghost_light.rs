//! Ghosts in a picture: light that two surfaces reflect, followed forwards from the scene.
//!
//! Every pair of surfaces that reflects has a path of its own, and rays of the scene that fill the first
//! surface follow each; where they land their light is counted in coarse cells, since ghosts are wide.
//! Directions are drawn more often where the scene is bright. The sets of samples are independent: their
//! spread is the error.

use super::color_band::ColorBand;
use super::exact::{MID_GREY, REPLICATES, luminance, mean_with_error};
use super::frame::filling_size;
use super::scene::{Radiance, Scene};
use super::{ImageFrame, Picture, PictureError};
use crate::analysis::{Coating, GhostPath, rank_ghosts};
use crate::math::Vec3;
use crate::pupil::RayModel;
use crate::trace::Ray;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::PI;

/// The number of columns of cells.
const COLUMNS: usize = 32;
/// The field around the frame whose light counts, over the frame.
const AROUND: f64 = 1.5;
/// The cells of the map of brightness along a side, and the places that are looked at in each.
const MAP: usize = 64;
const LOOKS: usize = 16;
/// The share of samples that is drawn evenly.
const EVEN: f64 = 0.1;
/// The samples of a set for each path and colour: to decide, and for the picture.
const FEW: usize = 128;
const MANY: usize = 2048;
/// The standard errors that a number is surely away from another.
const SURE: f64 = 2.0;
/// The pairs are followed that carry this share of the light of all, and no more than this many.
const CARRIED: f64 = 0.999;
const MOST_PAIRS: usize = 66;

/// Ghosts in a picture, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GhostReport {
    /// The coatings.
    pub coating: String,
    /// True if ghosts are in the picture.
    pub on: bool,
    /// The light of all ghosts where it is surely brightest, or else brightest at all, as a share of mid grey.
    pub change: f64,
    /// Its standard error.
    pub error: f64,
    /// The tolerance: they are in the picture if the change may be above it.
    pub tolerance: f64,
    /// The number of pairs of surfaces that were followed, and of all.
    pub pairs: [usize; 2],
    /// The number of rays.
    pub rays: usize,
}

/// The light of the ghosts of a scene.
#[derive(Debug, Clone)]
pub struct GhostLight {
    /// The number of columns and rows of cells.
    cells: [usize; 2],
    /// The mean and the standard error of every cell.
    values: Vec<[(f64, f64); 3]>,
    /// The size of that light, its error and its rays.
    pub report: GhostReport,
}

/// The ghosts of a lens in front of a scene.
struct GhostScene<'a> {
    scene: &'a Scene,
    frame: ImageFrame,
    /// The paths at the middle wavelength of every colour.
    paths: Vec<Vec<GhostPath>>,
    /// The wavelengths of the colours, in mm.
    wavelengths: Vec<f64>,
    coating: Coating,
    /// The radius of the disc in the plane through the first vertex that rays fill, in mm.
    reach: f64,
    map: BrightnessMap,
}

impl GhostLight {
    /// The ghosts of a scene through a lens with a coating for a picture whose white is known: in few
    /// rays, and in many where they change the picture by more than a tolerance.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones, or without two that reflect.
    pub fn new(
        (model, bands): (&RayModel, &[ColorBand]),
        scene: &Scene,
        picture: &Picture,
        (coating, tolerance): (Coating, f64),
    ) -> Result<Self, PictureError> {
        let ghosts = GhostScene::new((model, bands), scene, picture.frame, coating)?;
        let all = rank_ghosts(model, model.primary, coating)?.ghosts.len();
        let decide = |samples: usize| {
            let (values, rays) = ghosts.values(samples);
            let (change, error) = brightest(&values, MID_GREY * picture.white);
            let pairs = [ghosts.paths.first().map_or(0, Vec::len), all];
            // Ghosts that may matter are shown.
            let on = change + SURE * error > tolerance;
            let coating = coating.to_string();
            let report = GhostReport { coating, on, change, error, tolerance, pairs, rays };
            Self { cells: ghosts.cells(), values, report }
        };
        let few = decide(FEW);
        // What is below the tolerance by chance may be above it.
        let highest = few.values.iter().flatten().map(|(value, error)| value + SURE * error);
        let clear = highest.fold(0.0, f64::max) < tolerance * MID_GREY * picture.white;
        Ok(if clear { few } else { decide(MANY) })
    }

    /// Adds the ghosts to a picture if they matter.
    pub fn add_to(&self, picture: &mut Picture) {
        if !self.report.on {
            return;
        }
        let [columns, rows] = picture.frame.pixels;
        for i in 0..columns * rows {
            let part = |at: usize, count: usize, cells: usize| {
                (at as f64 + 0.5) / count as f64 * cells as f64 - 0.5
            };
            let [x, y] =
                [part(i % columns, columns, self.cells[0]), part(i / columns, rows, self.cells[1])];
            let light = self.between(x, y);
            (0..3).for_each(|c| picture.values[i][c] += light[c]);
        }
    }

    /// The light at a place counted in cells from the middle of the first one.
    fn between(&self, x: f64, y: f64) -> Radiance {
        let [columns, rows] = self.cells;
        let split = |v: f64, count: usize| {
            let v = v.clamp(0.0, (count - 1) as f64);
            let index = (v as usize).min(count.saturating_sub(2));
            (index, (index + 1).min(count - 1), v - index as f64)
        };
        let ((left, right, u), (up, down, v)) = (split(x, columns), split(y, rows));
        let at = |column: usize, row: usize, c: usize| self.values[row * columns + column][c].0;
        [0, 1, 2].map(|c| {
            let along = |row: usize| at(left, row, c) + u * (at(right, row, c) - at(left, row, c));
            along(up) + v * (along(down) - along(up))
        })
    }
}

/// The light of the cell over mid grey that is surely brightest, and its standard error: of many cells the
/// largest value is that of the largest error. Where no cell surely has light, the largest value all the same:
/// light that few rays have found is not none.
fn brightest(values: &[[(f64, f64); 3]], grey: f64) -> (f64, f64) {
    let surely = |(value, error): (f64, f64)| value - SURE * error;
    let all = values.iter().flatten().copied();
    let sure = all.clone().max_by(|a, b| surely(*a).total_cmp(&surely(*b)));
    let best =
        sure.filter(|cell| surely(*cell) > 0.0).or_else(|| all.max_by(|a, b| a.0.total_cmp(&b.0)));
    best.map_or((0.0, 0.0), |(value, error)| (value / grey, error / grey))
}

impl<'a> GhostScene<'a> {
    fn new(
        (model, bands): (&RayModel, &[ColorBand]),
        scene: &'a Scene,
        frame: ImageFrame,
        coating: Coating,
    ) -> Result<Self, PictureError> {
        let middle = |band: &ColorBand| band.wavelengths[band.wavelengths.len() / 2].0;
        let colors: Vec<usize> = bands.iter().map(middle).collect();
        let mut ranked = rank_ghosts(model, model.primary, coating)?.ghosts;
        ranked.sort_by(|a, b| b.flux.total_cmp(&a.flux));
        let all: f64 = ranked.iter().map(|ghost| ghost.flux).sum();
        let mut sum = 0.0;
        let carried = |ghost: &crate::analysis::ParaxialGhost| {
            let before = sum;
            sum += ghost.flux;
            (before < CARRIED * all).then_some([ghost.first, ghost.second])
        };
        let pairs: Vec<[usize; 2]> = ranked.iter().filter_map(carried).take(MOST_PAIRS).collect();
        let path = |w: &usize, pair: &[usize; 2]| GhostPath::new(&model.channels[*w].system, *pair);
        let paths = |w: &usize| pairs.iter().map(|pair| path(w, pair)).collect::<Result<_, _>>();
        let first = model.channels[model.primary].system.surfaces[0].outer_radius();
        let pupil = 0.5 * model.first_order.entrance_pupil.diameter.unwrap_or(0.0).abs();
        let half = filling_size(model, &frame, None)?.map(|v| AROUND * v);
        Ok(Self {
            scene,
            frame,
            paths: colors.iter().map(paths).collect::<Result<_, _>>()?,
            wavelengths: colors.iter().map(|w| 1e-3 * model.channels[*w].um).collect(),
            coating,
            reach: if first.is_finite() { first } else { pupil },
            map: BrightnessMap::new(scene, half),
        })
    }

    fn cells(&self) -> [usize; 2] {
        let [columns, rows] = self.frame.pixels;
        let across = COLUMNS.min(columns);
        [across, (rows * across).div_ceil(columns).clamp(1, rows)]
    }

    /// The light of the cells by so many samples of a set for each path and colour, and the rays of all.
    fn values(&self, samples: usize) -> (Vec<[(f64, f64); 3]>, usize) {
        let [columns, rows] = self.cells();
        let work: Vec<[usize; 3]> = (0..self.paths.len())
            .flat_map(|color| (0..self.paths[color].len()).map(move |path| [color, path]))
            .flat_map(|[color, path]| (0..REPLICATES).map(move |set| [color, path, set]))
            .collect();
        let sums: Vec<Vec<f64>> = work
            .par_iter()
            .map(|[color, path, set]| self.follow(*color, *path, *set, samples))
            .collect();
        let mut totals = vec![[[0.0; REPLICATES]; 3]; columns * rows];
        for ([color, _, set], sum) in work.iter().zip(&sums) {
            for (total, light) in totals.iter_mut().zip(sum) {
                total[*color][*set] += light;
            }
        }
        let last = self.paths.len() - 1;
        let cell =
            |sets: &[[f64; REPLICATES]; 3]| [0, 1, 2].map(|c| mean_with_error(sets[c.min(last)]));
        (totals.iter().map(cell).collect(), work.len() * samples)
    }

    /// The irradiance of the cells by the rays of a set along a path.
    fn follow(&self, color: usize, path: usize, set: usize, samples: usize) -> Vec<f64> {
        let [columns, rows] = self.cells();
        let mut light = vec![0.0; columns * rows];
        let [width, height] = self.frame.size();
        let cell = width / columns as f64 * (height / rows as f64);
        let disc = PI * self.reach * self.reach;
        let seed = ((path * REPLICATES + set) as u32).wrapping_mul(0x9E37_79B9) ^ 0x6057;
        for index in 0..samples {
            let [a, b, u, v] = sobol_burley::sample_4d(index as u32, 0, seed).map(f64::from);
            let (tangents, share) = self.map.draw([a, b]);
            let (sin, cos) = (2.0 * PI * v).sin_cos();
            let radius = self.reach * u.sqrt();
            let cosine = (1.0 + tangents[0].powi(2) + tangents[1].powi(2)).sqrt().recip();
            let direction = Vec3::new(-tangents[0] * cosine, -tangents[1] * cosine, cosine);
            let point = Vec3::new(radius * cos, radius * sin, 0.0);
            let radiance = self.scene.radiance(&Ray { point, direction: -direction }, 0.0);
            let seen = if self.paths.len() == 3 { radiance[color] } else { luminance(radiance) };
            if !(seen > 0.0) {
                continue;
            }
            let ray = Ray { point, direction };
            let found = self.paths[color][path].trace(ray, self.wavelengths[color], self.coating);
            if !found.traced.fate.is_imaged() {
                continue;
            }
            let end = found.traced.ray.point;
            let [across, down] = self.frame.place([end.x, end.y]);
            let [column, row] = [across * columns as f64, down * rows as f64];
            if column >= 0.0 && row >= 0.0 && column < columns as f64 && row < rows as f64 {
                let passed = 0.5 * (found.intensity[0] + found.intensity[1]);
                let flux = seen * cosine.powi(4) * disc * share / samples as f64 * passed;
                light[row as usize * columns + column as usize] += flux / cell;
            }
        }
        light
    }
}

/// The brightness of a scene over the tangents of directions, to draw directions by.
struct BrightnessMap {
    half: [f64; 2],
    /// The sums of the weights of the rows, and of the cells of each row.
    rows: Vec<f64>,
    cells: Vec<Vec<f64>>,
}

impl BrightnessMap {
    fn new(scene: &Scene, half: [f64; 2]) -> Self {
        let side = MAP * LOOKS;
        let look = |column: usize, row: usize| {
            let at = |i: usize, half: f64| half * (2.0 * (i as f64 + 0.5) / side as f64 - 1.0);
            let direction = Vec3::new(at(column, half[0]), at(row, half[1]), -1.0);
            let direction = direction * direction.dot(direction).sqrt().recip();
            luminance(scene.radiance(&Ray { point: Vec3::new(0.0, 0.0, 0.0), direction }, 0.0))
        };
        let cell = |column: usize, row: usize| {
            let looks = (0..LOOKS * LOOKS)
                .map(|i| look(LOOKS * column + i % LOOKS, LOOKS * row + i / LOOKS));
            looks.fold(0.0, f64::max)
        };
        let mut weights: Vec<Vec<f64>> =
            (0..MAP).into_par_iter().map(|row| (0..MAP).map(|c| cell(c, row)).collect()).collect();
        let mean = weights.iter().flatten().sum::<f64>() / (MAP * MAP) as f64;
        let even = if mean > 0.0 { EVEN * mean } else { 1.0 };
        weights.iter_mut().flatten().for_each(|weight| *weight += even);
        let sums = |weights: &[f64]| {
            let add = |sum: &mut f64, weight: &f64| {
                *sum += weight;
                Some(*sum)
            };
            weights.iter().scan(0.0, add).collect::<Vec<f64>>()
        };
        let cells: Vec<Vec<f64>> = weights.iter().map(|row| sums(row)).collect();
        let totals: Vec<f64> = cells.iter().map(|row| row[MAP - 1]).collect();
        Self { half, rows: sums(&totals), cells }
    }

    /// The tangents of a direction for two numbers from 0 to 1, and the area of tangents that it stands
    /// for.
    fn draw(&self, [a, b]: [f64; 2]) -> ([f64; 2], f64) {
        let (row, down, part_of_row) = pick(&self.rows, a);
        let (column, right, part_of_cell) = pick(&self.cells[row], b);
        let at = |index: usize, part: f64, half: f64| {
            half * (2.0 * (index as f64 + part) / MAP as f64 - 1.0)
        };
        let cell = 4.0 * self.half[0] * self.half[1] / (MAP * MAP) as f64;
        let tangents = [at(column, right, self.half[0]), at(row, down, self.half[1])];
        (tangents, cell / (part_of_row * part_of_cell))
    }
}

/// The part of a list of summed weights in which a number from 0 to 1 falls, where in it, and its share of
/// all.
fn pick(sums: &[f64], unit: f64) -> (usize, f64, f64) {
    let all = sums[sums.len() - 1];
    let index = sums.partition_point(|sum| *sum <= unit * all).min(sums.len() - 1);
    let before = index.checked_sub(1).map_or(0.0, |i| sums[i]);
    let weight = sums[index] - before;
    (index, ((unit * all - before) / weight).clamp(0.0, 1.0), weight / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number of the middle of the second part, and the area that all draws stand for.
    #[test]
    fn bright_parts_are_drawn_more_often_and_stand_for_less() {
        assert_eq!(pick(&[1.0, 4.0], 0.625), (1, 0.5, 0.75));
        let map = BrightnessMap::new(&Scene::uniform(1.0), [0.2, 0.1]);
        let (tangents, area) = map.draw([0.25, 0.75]);
        assert!((area - 0.08).abs() < 1e-12, "{area}");
        assert!(
            (tangents[0] - 0.1).abs() < 1e-9 && (tangents[1] + 0.05).abs() < 1e-9,
            "{tangents:?}"
        );
    }
}
