//! The point spread of the lit set of directions at an image point: what diffraction makes of a point where
//! aberrations vanish.
//!
//! Light that arrives at a point from a set of directions, alike from all of them, has the field of their
//! Fourier transform around it, in lengths over the wavelength, and the contrast of the overlap of the set with
//! itself, shifted by the wavelength times the frequency. The set is a raster of backward rays, whatever its
//! shape and pieces. Its spread is tabulated near the middle as cells that displacements are drawn from; beyond
//! them its energy falls with one over the distance, by the length of the edge of the set, and it is cut off at a
//! margin.

use super::PictureError;
use super::aimed_light::AimedLight;
use super::lit_directions::LitDirections;
use crate::analysis::BackwardLens;
use crate::math::{ComplexPair, FourierSense, transform_plane};
use crate::trace::{Landings, Rays, TraceSink as _};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The rays along a side of the raster.
pub(super) const RAYS: usize = 64;
/// The side of the plane that it is transformed on: cells are an eighth of λF then.
const PLANE: usize = 512;
/// The cells on either side of the middle that are tabulated: light beyond half of the plane folds back, so that
/// the table ends before.
const CELLS: usize = 192;
/// The side of a table.
const SIDE: usize = 2 * CELLS + 1;
/// The distances from the axis at which sets are tabulated.
const KNOTS: usize = 5;

/// The spreads over the distance from the axis.
#[derive(Debug, Clone)]
pub(super) struct PupilSpreads {
    /// The distance of knots in mm.
    step: f64,
    /// The knots of every wavelength of every colour, or those that serve all.
    sets: Vec<Vec<PupilSpread>>,
    /// The number of wavelengths of each colour that come before it.
    offsets: Vec<usize>,
    /// The largest displacement in mm.
    pub(super) margin: f64,
    /// The rays that stand for all light of a point, if its aberrations are in the spreads.
    pub(super) aimed: Option<AimedLight>,
    /// True if that of the axis may stand for all.
    pub(super) is_even: bool,
}

/// The spread of one set of directions; lengths are over the wavelength.
#[derive(Debug, Clone)]
pub(super) struct PupilSpread {
    /// The distance of neighbouring rays of the raster, in cosines.
    ray_step: f64,
    /// The overlap with the set shifted by whole steps, as a share, row by row, no shift at the corner; of
    /// negative ones at the far ends.
    overlap: Vec<ComplexPair>,
    /// The side of a cell.
    cell: f64,
    /// The energy of the rows of cells up to each, over that of the table.
    rows: Vec<f64>,
    /// The energy of the cells of a row up to each, over that of the row.
    cells: Vec<f32>,
    /// The share of the energy beyond a distance times that distance.
    tail: f64,
}

impl PupilSpreads {
    /// The spreads at the points of an image up to `reach` mm from the axis, for a lens at one wavelength, with
    /// displacements up to `margin` mm; of their pupils alone, for all wavelengths of colours with these numbers
    /// before each.
    ///
    /// # Errors
    /// No light anywhere.
    pub(super) fn new(
        (lens, offsets): (&BackwardLens, Vec<usize>),
        directions: &LitDirections,
        reach: f64,
        margin: f64,
    ) -> Result<Self, PictureError> {
        let step = reach / (KNOTS - 1) as f64;
        let at = |i: usize| PupilSpread::new(lens, directions, step * i as f64);
        let found: Vec<_> = (0..KNOTS).into_par_iter().map(at).collect();
        // Where it is dark, the next lit set stands for none.
        let next = |i: usize| found[i..].iter().chain(found[..i].iter().rev()).flatten().next();
        let knots: Option<Vec<_>> = (0..KNOTS).map(|i| next(i).cloned()).collect();
        let sets = vec![knots.ok_or(PictureError::NoLight)?];
        Ok(Self { step, sets, offsets, margin, aimed: None, is_even: false })
    }

    /// Spreads with aberrations: by wavelength of every colour, at knots from the axis to `reach` mm, with the rays
    /// that they are about.
    pub(super) fn aberrated(
        (sets, offsets): (Vec<Vec<PupilSpread>>, Vec<usize>),
        aimed: AimedLight,
        [reach, margin]: [f64; 2],
    ) -> Option<Self> {
        let knots = sets.first()?.len();
        let step = reach / (knots.checked_sub(1)? as f64);
        let is_whole = sets.iter().all(|set| set.len() == knots) && knots > 1;
        let aimed = Some(aimed);
        is_whole.then_some(Self { step, sets, offsets, margin, aimed, is_even: false })
    }

    /// The knots around a distance from the axis for a wavelength of a colour, and the share of the outer one.
    fn between(&self, [color, wavelength]: [usize; 2], radius: f64) -> ([&PupilSpread; 2], f64) {
        let number = self.offsets[color] + wavelength;
        let knots = &self.sets[number.min(self.sets.len() - 1)];
        let last = knots.len() - 1;
        let place = (radius / self.step).clamp(0.0, last as f64);
        let index = (place as usize).min(last - 1);
        ([&knots[index], &knots[index + 1]], place - index as f64)
    }

    /// A displacement in mm of light that should arrive at a distance from the axis, for a wavelength of a colour,
    /// its length in mm, and two numbers from 0 to 1; for a point of the y axis.
    pub(super) fn draw(
        &self,
        light: [usize; 2],
        (radius, length): (f64, f64),
        [u, v]: [f64; 2],
    ) -> [f64; 2] {
        let ([inner, outer], part) = self.between(light, radius);
        // The first number chooses one of both spreads, and its rest is as even as before.
        let (spread, u) =
            if u < part { (outer, u / part) } else { (inner, (u - part) / (1.0 - part)) };
        spread.draw(self.margin / length, [u, v]).map(|v| v * length)
    }

    /// The contrast for a wavelength of a colour at a distance from the axis of a shift of the set in cosines: the
    /// wavelength times the frequency, for a point of the y axis.
    pub(super) fn transfer(&self, light: [usize; 2], radius: f64, shift: [f64; 2]) -> ComplexPair {
        let ([inner, outer], part) = self.between(light, radius);
        let (a, b) = (inner.transfer(shift), outer.transfer(shift));
        [0, 1].map(|k| a[k] + part * (b[k] - a[k]))
    }

    /// The largest change of contrast at these shifts from the axis to any knot.
    pub(super) fn variation(&self, shifts: &[[f64; 2]]) -> f64 {
        let change = |knots: &Vec<PupilSpread>| {
            let of_knot = |knot: &PupilSpread| {
                let apart = shifts.iter().map(|shift| {
                    let (a, b) = (knots[0].transfer(*shift), knot.transfer(*shift));
                    (a[0] - b[0]).hypot(a[1] - b[1])
                });
                apart.fold(0.0, f64::max)
            };
            knots.iter().map(of_knot).fold(0.0, f64::max)
        };
        self.sets.iter().map(change).fold(0.0, f64::max)
    }

    /// The share of the energy at a wavelength in mm that is beyond the margin, the largest of any place.
    pub(super) fn cut(&self, wavelength: f64) -> f64 {
        let knots = self.sets.iter().flatten();
        knots.map(|knot| knot.beyond(self.margin / wavelength)).fold(0.0, f64::max)
    }
}

impl PupilSpread {
    /// The spread at a distance from the axis; `None` where it is dark.
    fn new(lens: &BackwardLens, directions: &LitDirections, radius: f64) -> Option<Self> {
        let raster = DirectionRaster::new(directions, radius)?;
        let (landed, places) = raster.trace(lens, radius);
        let mut lit = vec![false; RAYS * RAYS];
        for (ray, place) in places.into_iter().enumerate() {
            lit[place] = landed.fate(ray).is_imaged();
        }
        Self::of_raster(&lit, None, raster.step)
    }

    /// The spread of a raster of directions, some of them lit, that are so far from each other in cosines, with the
    /// optical paths of their light in waves if they differ; `None` if all are dark.
    pub(super) fn of_raster(lit: &[bool], waves: Option<&[f64]>, ray_step: f64) -> Option<Self> {
        let count = lit.iter().filter(|lit| **lit).count() as f64;
        if count == 0.0 {
            return None;
        }
        let mut plane: Vec<ComplexPair> = vec![[0.0; 2]; PLANE * PLANE];
        for i in (0..RAYS * RAYS).filter(|i| lit[*i]) {
            let (sin, cos) = waves.map_or((0.0, 1.0), |waves| (TAU * waves[i]).sin_cos());
            plane[i / RAYS * PLANE + i % RAYS] = [cos, sin];
        }
        transform_plane(&mut plane, PLANE, FourierSense::Forward);
        plane.iter_mut().for_each(|v| *v = [v[0] * v[0] + v[1] * v[1], 0.0]);
        let cell = 1.0 / (PLANE as f64 * ray_step);
        let tail = tail(lit, ray_step, count);
        transform_plane(&mut plane, PLANE, FourierSense::Inverse);
        let side = 2 * RAYS;
        let at = |i: usize| if i < RAYS { i } else { PLANE + i - side };
        let overlap = |i: usize| plane[at(i / side) * PLANE + at(i % side)].map(|v| v / count);
        let overlap = (0..side * side).map(overlap).collect();
        sharpen(&mut plane);
        transform_plane(&mut plane, PLANE, FourierSense::Forward);
        let (rows, cells) = cumulated(&plane);
        Some(Self { ray_step, overlap, cell, rows, cells, tail })
    }

    /// The share of the energy beyond a distance.
    fn beyond(&self, distance: f64) -> f64 {
        (self.tail / distance).min(1.0)
    }

    /// A displacement up to a largest one.
    fn draw(&self, largest: f64, [u, v]: [f64; 2]) -> [f64; 2] {
        let end = CELLS as f64 * self.cell;
        let cut = self.beyond(largest.max(end));
        let outside = (self.beyond(end) - cut) / (1.0 - cut);
        if v >= 1.0 - outside {
            // Evenly in one over the distance.
            let part = (v - 1.0 + outside) / outside;
            let distance = 1.0 / ((1.0 - part) / end + part / largest.max(end));
            let (sin, cos) = (TAU * u).sin_cos();
            return [distance * sin, distance * cos];
        }
        let (row, down) = place(&self.rows, v / (1.0 - outside));
        let cells = &self.cells[row * SIDE..][..SIDE];
        let (column, right) = place(cells, u);
        let at = |i: usize, part: f64| (i as f64 - CELLS as f64 + part - 0.5) * self.cell;
        [at(column, right), at(row, down)]
    }

    /// The contrast of a shift in cosines: the overlap of the set with itself, as a share; 0 beyond.
    fn transfer(&self, shift: [f64; 2]) -> ComplexPair {
        let side = 2 * RAYS;
        let steps = shift.map(|v| v / self.ray_step);
        if steps.iter().any(|v| !(v.abs() < (RAYS - 1) as f64)) {
            return [0.0; 2];
        }
        let low = steps.map(f64::floor);
        let at = |i: f64, j: f64| {
            let [x, y] = [i, j].map(|v| if v < 0.0 { v + side as f64 } else { v } as usize);
            self.overlap[y * side + x]
        };
        let [u, v] = [0, 1].map(|k| steps[k] - low[k]);
        let mixed =
            |a: ComplexPair, b: ComplexPair, part: f64| [0, 1].map(|k| a[k] + part * (b[k] - a[k]));
        let along = |j: f64| mixed(at(low[0], j), at(low[0] + 1.0, j), u);
        let [re, im] = mixed(along(low[1]), along(low[1] + 1.0), v);
        // Sums with the positive sign belong to the negative frequency.
        [re, -im]
    }
}

/// A raster of directions around those that are lit at a distance from the axis.
pub(super) struct DirectionRaster {
    center: [f64; 2],
    half: f64,
    /// The distance of neighbours, in cosines.
    pub(super) step: f64,
}

impl DirectionRaster {
    /// `None` where it is dark.
    pub(super) fn new(directions: &LitDirections, radius: f64) -> Option<Self> {
        let [center, half] = directions.bounds(radius)?;
        let half = half[0].max(half[1]);
        Some(Self { center, half, step: 2.0 * half / RAYS as f64 })
    }

    /// The rays backwards from a point of the y axis, and the place of each in the raster.
    pub(super) fn trace(&self, lens: &BackwardLens, radius: f64) -> (Landings<f64>, Vec<usize>) {
        let along = |k: usize, i: usize| {
            self.center[k] + self.half * ((2 * i + 1) as f64 / RAYS as f64 - 1.0)
        };
        let (mut rays, mut places) = (Rays::default(), Vec::new());
        for i in 0..RAYS * RAYS {
            let cosines = [along(0, i % RAYS), along(1, i / RAYS)];
            if let Some((ray, _)) = lens.ray([0.0, radius], cosines) {
                rays.push(ray);
                places.push(i);
            }
        }
        let mut landed = Landings::default();
        lens.trace(&rays, &mut landed);
        (landed, places)
    }
}

/// The share of the energy beyond a distance times that distance: λP/(2π²A) for a set of the area A with an edge
/// of the length P. The edge is π times the mean of its projections (Cauchy), of which there are two here.
fn tail(lit: &[bool], ray_step: f64, count: f64) -> f64 {
    let begins = |step: usize, is_first: &dyn Fn(usize) -> bool| {
        (0..lit.len()).filter(|i| lit[*i] && (is_first(*i) || !lit[i - step])).count()
    };
    let across = begins(1, &|i| i % RAYS == 0);
    let along = begins(RAYS, &|i| i < RAYS);
    let edge = PI * 0.5 * (across + along) as f64 * ray_step;
    edge / (2.0 * PI * PI * count * ray_step * ray_step)
}

/// Takes from an overlap the blur that even draws from a cell make.
fn sharpen(overlap: &mut [ComplexPair]) {
    let kept = |i: usize| {
        let turns = PI * i.min(PLANE - i) as f64 / PLANE as f64;
        if i == 0 { 1.0 } else { turns.sin() / turns }
    };
    let kept: Vec<f64> = (0..PLANE).map(kept).collect();
    for (i, value) in overlap.iter_mut().enumerate() {
        *value = value.map(|v| v / (kept[i / PLANE] * kept[i % PLANE]));
    }
}

/// The energies of rows and of the cells of each, summed up, as shares, from a plane of intensities whose middle
/// is its first corner; of the cells within a circle. A set of points spreads light in periods, as far as the plane
/// reaches; that of squares around them has an envelope, without which what lies beyond would be folded in.
fn cumulated(plane: &[ComplexPair]) -> (Vec<f64>, Vec<f32>) {
    let (mut rows, mut cells) = (Vec::with_capacity(SIDE), Vec::with_capacity(SIDE * SIDE));
    let wrapped = |i: usize| (i + PLANE - CELLS) % PLANE;
    let square = |i: usize| i.abs_diff(CELLS).pow(2);
    let envelope = |i: usize| {
        let turns = PI * i.abs_diff(CELLS) as f64 / PLANE as f64;
        if turns == 0.0 { 1.0 } else { (turns.sin() / turns).powi(2) }
    };
    let mut all = 0.0;
    for y in 0..SIDE {
        let light = |x: usize| {
            let is_inside = square(x) + square(y) <= CELLS * CELLS;
            let light = plane[wrapped(y) * PLANE + wrapped(x)][0].max(0.0);
            if is_inside { light * envelope(x) * envelope(y) } else { 0.0 }
        };
        let sums: Vec<f64> = (0..SIDE)
            .scan(0.0, |sum, x| {
                *sum += light(x);
                Some(*sum)
            })
            .collect();
        let row = sums[SIDE - 1].max(f64::MIN_POSITIVE);
        cells.extend(sums.iter().map(|sum| (sum / row) as f32));
        all += sums[SIDE - 1];
        rows.push(all);
    }
    rows.iter_mut().for_each(|row| *row /= all);
    (rows, cells)
}

/// The first of shares that are summed up above a number from 0 to 1, and the part of it that the number
/// takes.
fn place<T: Copy + Into<f64>>(sums: &[T], number: f64) -> (usize, f64) {
    let index = sums.partition_point(|sum| (*sum).into() <= number).min(sums.len() - 1);
    let before = if index == 0 { 0.0 } else { sums[index - 1].into() };
    let share: f64 = sums[index].into() - before;
    let part = if share > 0.0 { ((number - before) / share).clamp(0.0, 1.0) } else { 0.5 };
    (index, part)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of directions with a dark one inside it, by the ratio of their radii, as large as the raster.
    fn annulus(ratio: f64) -> PupilSpread {
        let radius = 0.5 * RAYS as f64;
        let lit = |i: usize| {
            let [x, y] = [i % RAYS, i / RAYS].map(|v| v as f64 + 0.5 - radius);
            let distance = x.hypot(y);
            distance < radius && distance >= ratio * radius
        };
        let lit: Vec<bool> = (0..RAYS * RAYS).map(lit).collect();
        PupilSpread::of_raster(&lit, None, 0.2 / RAYS as f64).unwrap()
    }

    /// The contrast of a disc of radius 0.1, in closed form.
    fn disc(shift: f64) -> f64 {
        let f = (shift / 0.2).min(1.0);
        2.0 / PI * (f.acos() - f * (1.0 - f * f).sqrt())
    }

    /// The share of draws within a distance.
    fn drawn_within(spread: &PupilSpread, distance: f64) -> f64 {
        let count = 1 << 14;
        let point = |i: u32| [0, 1].map(|d| f64::from(sobol_burley::sample(i, d, 5)));
        let draw = |i: u32| spread.draw(1e9, point(i));
        (0..count).map(draw).filter(|[x, y]| x.hypot(*y) <= distance).count() as f64
            / f64::from(count)
    }

    #[test]
    fn a_disc_has_the_contrast_and_the_energy_of_airy() {
        let spread = annulus(0.0);
        for shift in [0.0, 0.03, 0.1, 0.17, 0.2] {
            for turned in [[shift, 0.0], [0.0, -shift], [0.6 * shift, 0.8 * shift]] {
                let ([found, phase], exact) = (spread.transfer(turned), disc(shift));
                assert!(phase.abs() < 1e-9, "{turned:?}: {phase}");
                assert!((found - exact).abs() < 2e-3, "{turned:?}: {found} {exact}");
            }
        }
        // 83.78 % within the first dark ring at 1.2197 λF, 91.0 % within the second, and 2/(π² r) beyond far ones.
        let f_number = 5.0;
        for (distance, within) in
            [(1.2197, 0.8378), (2.2331, 0.9099), (10.0, 1.0 - 0.0203), (100.0, 1.0 - 0.002_026)]
        {
            let found = drawn_within(&spread, distance * f_number);
            assert!((found - within).abs() < 2e-3, "{distance}: {found} {within}");
        }
    }

    /// Of a ring with half of the radius dark, by the closed form of its field: two Airy discs.
    #[test]
    fn a_ring_has_its_energy() {
        let spread = annulus(0.5);
        let (f_number, ratio) = (5.0, 0.5_f64);
        // E(r) = 2/(1 − ε²) ∫ (J1(x) − ε J1(εx))² /x dx up to x = π r/(λF).
        let bessel = |x: f64| {
            let steps = 400;
            let at = |i: u32| {
                let t = PI * (f64::from(i) + 0.5) / f64::from(steps);
                (t - x * t.sin()).cos()
            };
            (0..steps).map(at).sum::<f64>() / f64::from(steps)
        };
        for distance in [0.5, 1.0, 2.0, 4.0] {
            let steps = 400;
            let end = PI * distance;
            let part = |i: u32| {
                let x = end * (f64::from(i) + 0.5) / f64::from(steps);
                (bessel(x) - ratio * bessel(ratio * x)).powi(2) / x
            };
            let sum = (0..steps).map(part).sum::<f64>() * end / f64::from(steps);
            let exact = 2.0 / (1.0 - ratio * ratio) * sum;
            let found = drawn_within(&spread, distance * f_number);
            assert!((found - exact).abs() < 4e-3, "{distance}: {found} {exact}");
        }
    }

    #[test]
    fn what_is_cut_off_is_not_drawn() {
        let spread = annulus(0.0);
        let largest = 300.0;
        let point = |i: u32| [0, 1].map(|d| f64::from(sobol_burley::sample(i, d, 3)));
        let farthest = (0..1 << 14).map(|i| spread.draw(largest, point(i)));
        let farthest = farthest.map(|[x, y]| x.hypot(y)).fold(0.0, f64::max);
        assert!(farthest <= largest * (1.0 + 1e-9) && farthest > 0.8 * largest, "{farthest}");
        let exact = 2.0 * 5.0 / (PI * PI * largest);
        assert!((spread.beyond(largest) / exact - 1.0).abs() < 0.02);
    }
}
