//! The map from image to scene as a table: beamlets, each the mean of the rays of a small part of the
//! directions at an image point, with the variance of its rays.
//!
//! The directions at a point lie in a box that moves and shrinks smoothly over the image. Each cell of the
//! box is one beamlet per colour: its weight is the solid angle of its rays that get through, over all
//! wavelengths of the colour; where it goes is their mean. Both are smooth in the distance from the axis and
//! interpolated in it. A lens of revolution needs one radius; other points of the image are turned.

use super::PictureError;
use super::color_band::ColorBand;
use super::exact::ExactRenderer;
use crate::analysis::BackwardLens;
use crate::pupil::RayModel;
use crate::trace::{Landings, Ray, Rays, TraceSink as _};
use rayon::prelude::*;

/// The cells along a side of the box of directions.
const CELLS: usize = 6;
/// The rays along a side of a cell, for each wavelength.
const SUBRAYS: usize = 8;
/// The number of intervals of the table over the distance from the axis.
const RADII: usize = 48;

/// A narrow beam from an image point into the scene.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Beamlet {
    /// The irradiance that it brings for radiance 1.
    pub(super) weight: f64,
    /// The place at which its mean ray crosses the plane through the first vertex, x and y in mm.
    pub(super) start: [f64; 2],
    /// The tangents of the direction in which it leaves the lens.
    pub(super) slope: [f64; 2],
    /// The variances of start and slope along an axis, and their covariance.
    start_variance: f64,
    covariance: f64,
    slope_variance: f64,
}

impl Beamlet {
    /// The place in the plane at a distance in mm, or the tangents at infinity.
    pub(super) fn place(&self, distance: Option<f64>) -> [f64; 2] {
        match distance {
            None => self.slope,
            Some(distance) => [0, 1].map(|k| self.start[k] + distance * self.slope[k]),
        }
    }

    /// The variance of the places along an axis.
    pub(super) fn variance(&self, distance: Option<f64>) -> f64 {
        match distance {
            None => self.slope_variance,
            Some(d) => self.start_variance + d * (2.0 * self.covariance + d * self.slope_variance),
        }
        .max(0.0)
    }

    /// A beamlet between this one and another, which count by their weights.
    fn mixed(&self, other: &Self, part: f64) -> Self {
        let weight = self.weight + part * (other.weight - self.weight);
        if !(weight > 0.0) {
            return Self::default();
        }
        let share = part * other.weight / weight;
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            weight,
            start: [0, 1].map(|k| mix(self.start[k], other.start[k])),
            slope: [0, 1].map(|k| mix(self.slope[k], other.slope[k])),
            start_variance: mix(self.start_variance, other.start_variance),
            covariance: mix(self.covariance, other.covariance),
            slope_variance: mix(self.slope_variance, other.slope_variance),
        }
    }

    /// The same beamlet turned so that the y axis points along a unit vector.
    fn turned(&self, [ex, ey]: [f64; 2]) -> Self {
        let turn = |[x, y]: [f64; 2]| [x * ey + y * ex, y * ey - x * ex];
        Self { start: turn(self.start), slope: turn(self.slope), ..*self }
    }
}

/// The sums over the rays of a beamlet.
#[derive(Debug, Clone, Copy, Default)]
struct BeamletSums {
    weight: f64,
    start: [f64; 2],
    slope: [f64; 2],
    squares: [f64; 3],
}

impl BeamletSums {
    /// Adds a ray that leads away from the lens; none that leaves sideways or backwards.
    fn add(&mut self, ray: &Ray<f64>, weight: f64) {
        let slope = [ray.direction.x, ray.direction.y].map(|v| -v / ray.direction.z);
        let start = [ray.point.x + ray.point.z * slope[0], ray.point.y + ray.point.z * slope[1]];
        self.weight += weight;
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        for k in [0, 1] {
            self.start[k] += weight * start[k];
            self.slope[k] += weight * slope[k];
        }
        for (sum, square) in
            self.squares.iter_mut().zip([dot(start, start), dot(start, slope), dot(slope, slope)])
        {
            *sum += weight * square;
        }
    }

    /// The mean and the variances, each the mean of both axes.
    fn beamlet(&self) -> Beamlet {
        if !(self.weight > 0.0) {
            return Beamlet::default();
        }
        let [start, slope] = [self.start, self.slope].map(|sum| sum.map(|v| v / self.weight));
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let spread = |square: f64, product: f64| 0.5 * (square / self.weight - product);
        let [a, b, c] = self.squares;
        // A cell is wider than the places of its rays: each stands for a part of it.
        let wider = {
            let rays = (SUBRAYS * SUBRAYS) as f64;
            rays / (rays - 1.0)
        };
        Beamlet {
            weight: self.weight,
            start,
            slope,
            start_variance: wider * spread(a, dot(start, start)),
            covariance: wider * spread(b, dot(start, slope)),
            slope_variance: wider * spread(c, dot(slope, slope)),
        }
    }
}

/// The beamlets of all colours at a distance from the axis, and the light in each colour that comes from
/// no plane in front of the lens.
#[derive(Debug, Clone)]
struct BeamletRow {
    beamlets: Vec<Beamlet>,
    sideways: Vec<f64>,
}

/// The beamlets of a lens over the distance from the axis of the image.
#[derive(Debug, Clone)]
pub(super) struct BeamletTable {
    step: f64,
    rows: Vec<BeamletRow>,
}

/// The beamlets at an image point.
pub(super) struct PointBeamlets<'a> {
    rows: [&'a BeamletRow; 2],
    part: f64,
    turn: [f64; 2],
}

impl BeamletTable {
    /// The beamlets at points up to `reach` mm from the axis.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub(super) fn new(
        model: &RayModel,
        bands: &[ColorBand],
        exact: &ExactRenderer<'_>,
        reach: f64,
    ) -> Result<Self, PictureError> {
        let lenses = |band: &ColorBand| {
            let lens = |(wavelength, share): &(usize, f64)| {
                Ok((*share, BackwardLens::new(model, *wavelength)?))
            };
            band.wavelengths.iter().map(lens).collect::<Result<Vec<_>, PictureError>>()
        };
        let lenses = bands.iter().map(lenses).collect::<Result<Vec<_>, PictureError>>()?;
        let step = reach / RADII as f64;
        let row = |i: usize| BeamletRow::new(&lenses, exact, step * i as f64);
        Ok(Self { step, rows: (0..=RADII).into_par_iter().map(row).collect() })
    }

    /// The beamlets at a point of the image.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> PointBeamlets<'_> {
        let radius = x.hypot(y);
        let place = radius / self.step;
        let index = (place as usize).min(RADII - 1);
        let turn = if radius > 0.0 { [x / radius, y / radius] } else { [0.0, 1.0] };
        let rows = [&self.rows[index], &self.rows[index + 1]];
        PointBeamlets { rows, part: (place - index as f64).min(1.0), turn }
    }
}

impl PointBeamlets<'_> {
    /// The beamlets of a colour that bring light.
    pub(super) fn of_color(&self, color: usize) -> impl Iterator<Item = Beamlet> + '_ {
        let cells = color * CELLS * CELLS..(color + 1) * CELLS * CELLS;
        let [inner, outer] = self.rows.map(|row| &row.beamlets[cells.clone()]);
        let mixed = inner.iter().zip(outer).map(|(a, b)| a.mixed(b, self.part));
        mixed.filter(|beamlet| beamlet.weight > 0.0).map(|beamlet| beamlet.turned(self.turn))
    }

    /// The irradiance for radiance 1 that comes from no plane in front of the lens.
    pub(super) fn sideways(&self, color: usize) -> f64 {
        let [inner, outer] = self.rows.map(|row| row.sideways[color]);
        inner + self.part * (outer - inner)
    }
}

impl BeamletRow {
    fn new(bands: &[Vec<(f64, BackwardLens)>], exact: &ExactRenderer<'_>, radius: f64) -> Self {
        let mut row = Self {
            beamlets: vec![Beamlet::default(); bands.len() * CELLS * CELLS],
            sideways: vec![0.0; bands.len()],
        };
        let Some(bounds) = exact.directions().bounds(radius) else { return row };
        for (color, lenses) in bands.iter().enumerate() {
            let mut sums = vec![BeamletSums::default(); CELLS * CELLS];
            for (w, (share, lens)) in lenses.iter().enumerate() {
                let passed = |cosines: [f64; 2]| {
                    let losses = exact.loss_table();
                    share * losses.map_or(1.0, |table| table.passed([color, w], radius, cosines))
                };
                row.sideways[color] += trace_box(lens, passed, radius, bounds, &mut sums);
            }
            for (cell, sum) in sums.iter().enumerate() {
                row.beamlets[color * CELLS * CELLS + cell] = sum.beamlet();
            }
        }
        row
    }
}

/// Traces the rays of all cells from the point `(0, radius)` and adds them to the sums, each with the share
/// of its direction; returns the
/// irradiance of those that leave the lens sideways.
fn trace_box(
    lens: &BackwardLens,
    share: impl Fn([f64; 2]) -> f64,
    radius: f64,
    [center, half]: [[f64; 2]; 2],
    sums: &mut [BeamletSums],
) -> f64 {
    let side = CELLS * SUBRAYS;
    let area = 4.0 * half[0] * half[1] / (side * side) as f64 * lens.index_ratio;
    let mut rays = Rays::with_capacity(side * side);
    let mut cells = Vec::with_capacity(side * side);
    for i in 0..side * side {
        let at = |k: usize, index: usize| {
            center[k] + half[k] * (2.0 * (index as f64 + 0.5) / side as f64 - 1.0)
        };
        let (column, row) = (i % side, i / side);
        let cosines = [at(0, column), at(1, row)];
        if let Some((ray, cosine)) = lens.ray([0.0, radius], cosines) {
            rays.push(ray);
            let weight = area * cosine * share(cosines);
            cells.push((row / SUBRAYS * CELLS + column / SUBRAYS, weight));
        }
    }
    let mut landings = Landings::default();
    lens.trace(&rays, &mut landings);
    let mut sideways = 0.0;
    for (i, (cell, weight)) in cells.into_iter().enumerate() {
        if !landings.fate(i).is_imaged() {
            continue;
        }
        let ray = lens.scene_ray(landings.ray(i));
        if ray.direction.z < -1e-3 {
            sums[cell].add(&ray, weight);
        } else {
            sideways += weight;
        }
    }
    sideways
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A beamlet at a point of the y axis, turned to another point as far from the axis: what pointed
    /// away from the axis still does, and lengths and handedness are kept.
    #[test]
    fn a_turned_beamlet_points_where_its_image_point_does() {
        let e = [0.6, -0.8];
        let beamlet = Beamlet { start: [0.0, 2.0], slope: [0.1, 0.0], ..Beamlet::default() };
        let turned = beamlet.turned(e);
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-15;
        assert!(near(turned.start, [2.0 * e[0], 2.0 * e[1]]), "{:?}", turned.start);
        // A quarter turn from the y axis to the x axis takes e to this direction.
        assert!(near(turned.slope, [0.1 * e[1], -0.1 * e[0]]), "{:?}", turned.slope);
        assert!(near(beamlet.turned([0.0, 1.0]).slope, beamlet.slope));
    }
}
