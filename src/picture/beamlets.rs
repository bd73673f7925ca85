//! The map from image to scene as a table: beamlets, each the mean of the rays of a part of the directions at
//! an image point, with the variance of its rays.
//!
//! The directions at a point lie in a box that moves and shrinks smoothly over the image. Quadratic B-splines
//! part the box into windows that overlap and add up to one everywhere; each is one beamlet per colour. Its
//! weight is the solid angle of its rays that get through, over all wavelengths of the colour; where it goes
//! is their mean. The texels over which a beamlet is averaged are added up by B-splines too, so that beamlets
//! side by side in a blur leave no ripple: windows with edges do, by a third of the light there.
//!
//! Beamlets are smooth in the distance from the axis and interpolated in it. A lens of revolution needs one
//! radius; other points of the image are turned.

use super::PictureError;
use super::aimed_light::AimedLight;
use super::color_band::ColorBand;
use super::lit_directions::LitDirections;
use super::losses::LensLosses;
use crate::analysis::BackwardLens;
use crate::pupil::RayModel;
use crate::trace::{Landings, Ray, Rays, TraceSink as _};
use rayon::prelude::*;

/// The parts of tables that are made from the same rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TableSize<'a> {
    /// The windows along a side of the box of directions, for each table.
    pub(super) windows: &'a [usize],
    /// The rays along a side of the box, for each wavelength.
    pub(super) rays: usize,
    /// The number of intervals over the distance from the axis.
    pub(super) radii: usize,
}

/// The direction cosine along the axis above which a ray meets no plane of the scene.
const SIDEWAYS: f64 = -1e-3;

/// Sums over rays: the weight, its products with the place in the plane of the first vertex and the slope
/// of a ray (x, y, p, q), and those with their ten products (xx, xy, xp, xq, yy, ...).
#[derive(Debug, Clone, Copy, Default)]
struct RayMoments([f64; 15]);

impl RayMoments {
    /// A ray of weight 1 that leads away from the lens.
    fn of_ray(ray: &Ray<f64>) -> Self {
        let [p, q] = [ray.direction.x, ray.direction.y].map(|v| -v / ray.direction.z);
        let (x, y) = (ray.point.x + ray.point.z * p, ray.point.y + ray.point.z * q);
        let mut sums = [1.0, x, y, p, q, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut next = 5;
        for a in 1..5 {
            for b in a..5 {
                sums[next] = sums[a] * sums[b];
                next += 1;
            }
        }
        Self(sums)
    }

    fn add(&mut self, other: &Self, share: f64) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum += share * value;
        }
    }

    fn beamlet(&self) -> Beamlet {
        let weight = self.0[0];
        if !(weight > 0.0) {
            return Beamlet::default();
        }
        let sums = self.0.map(|sum| sum / weight);
        let mean = [sums[1], sums[2], sums[3], sums[4]];
        let mut covariance = [0.0; 10];
        let mut next = 0;
        for a in 0..4 {
            for b in a..4 {
                covariance[next] = sums[5 + next] - mean[a] * mean[b];
                next += 1;
            }
        }
        Beamlet { weight, mean, covariance }
    }
}

/// A narrow beam from an image point into the scene.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Beamlet {
    /// The irradiance that it brings for radiance 1.
    pub(super) weight: f64,
    /// The place at which its mean ray crosses the plane through the first vertex, x and y in mm, and the
    /// tangents of the direction in which it leaves the lens, p and q.
    mean: [f64; 4],
    /// The covariances xx, xy, xp, xq, yy, yp, yq, pp, pq, qq of its rays.
    covariance: [f64; 10],
}

/// A beamlet where it meets a plane of the scene, in the unit of the plane.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct BeamletSpot {
    /// The irradiance that it brings for radiance 1.
    pub(super) weight: f64,
    /// Its middle.
    pub(super) place: [f64; 2],
    /// The variances along x, of x with y, and along y.
    pub(super) variance: [f64; 3],
}

impl Beamlet {
    /// The spot in the plane at a distance in mm, or in that of tangents at infinity.
    pub(super) fn spot(&self, distance: Option<f64>) -> BeamletSpot {
        let [x, y, p, q] = self.mean;
        let [xx, xy, xp, xq, yy, yp, yq, pp, pq, qq] = self.covariance;
        let (place, variance) = match distance {
            None => ([p, q], [pp, pq, qq]),
            Some(d) => (
                [x + d * p, y + d * q],
                [
                    xx + d * (2.0 * xp + d * pp),
                    xy + d * (xq + yp + d * pq),
                    yy + d * (2.0 * yq + d * qq),
                ],
            ),
        };
        BeamletSpot { weight: self.weight, place, variance }
    }
}

impl BeamletSpot {
    /// A spot between this one and another, which count by their weights.
    pub(super) fn mixed(&self, other: &Self, part: f64) -> Self {
        let weight = self.weight + part * (other.weight - self.weight);
        if !(weight > 0.0) {
            return Self::default();
        }
        let share = part * other.weight / weight;
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            weight,
            place: [0, 1].map(|k| mix(self.place[k], other.place[k])),
            variance: [0, 1, 2].map(|k| mix(self.variance[k], other.variance[k])),
        }
    }

    /// The same spot turned so that the y axis points along a unit vector.
    pub(super) fn turned(&self, [ex, ey]: [f64; 2]) -> Self {
        let [x, y] = self.place;
        let [xx, xy, yy] = self.variance;
        let variance = [
            ey * ey * xx + 2.0 * ex * ey * xy + ex * ex * yy,
            ey * ey * xy + ex * ey * (yy - xx) - ex * ex * xy,
            ey * ey * yy - 2.0 * ex * ey * xy + ex * ex * xx,
        ];
        Self { weight: self.weight, place: [x * ey + y * ex, y * ey - x * ex], variance }
    }
}

/// The beamlets of all colours at a distance from the axis, and the light in each colour that comes from
/// no plane in front of the lens.
#[derive(Debug, Clone)]
pub(super) struct BeamletRow {
    /// By colour and window.
    pub(super) beamlets: Vec<Beamlet>,
    pub(super) sideways: Vec<f64>,
}

/// The beamlets of a lens over the distance from the axis of the image.
#[derive(Debug, Clone)]
pub(super) struct BeamletTable {
    /// The distance of two rows, in mm.
    pub(super) step: f64,
    /// The number of windows of a colour.
    pub(super) windows: usize,
    pub(super) rows: Vec<BeamletRow>,
}

/// A place between two rows of a table, and the direction of the image point from the axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct TablePlace {
    /// The inner one of the rows.
    pub(super) row: usize,
    /// The part of the way to the outer one.
    pub(super) part: f64,
    /// The unit vector away from the axis.
    pub(super) turn: [f64; 2],
}

impl BeamletTable {
    /// The beamlets at points up to `reach` mm from the axis, in one table for every number of windows.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub(super) fn several(
        model: &RayModel,
        bands: &[ColorBand],
        (directions, losses): (&LitDirections, Option<&LensLosses>),
        reach: f64,
        size: TableSize<'_>,
    ) -> Result<Vec<Self>, PictureError> {
        let lenses = |band: &ColorBand| {
            let lens = |(wavelength, share): &(usize, f64)| {
                Ok((*share, BackwardLens::for_picture(model, *wavelength)?))
            };
            band.wavelengths.iter().map(lens).collect::<Result<Vec<_>, PictureError>>()
        };
        let lenses = bands.iter().map(lenses).collect::<Result<Vec<_>, PictureError>>()?;
        let step = reach / size.radii as f64;
        let row = |i: usize| {
            let radius = step * i as f64;
            let bounds = directions.bounds(radius);
            let box_of = |(color, lenses): (usize, &Vec<(f64, BackwardLens)>)| {
                let mut traced = TracedBox::new(size, i, lenses.len());
                if let Some(bounds) = bounds {
                    traced.trace_all((color, lenses), losses, (radius, bounds));
                }
                traced
            };
            lenses.iter().enumerate().map(box_of).collect::<Vec<TracedBox<'_>>>()
        };
        let traced: Vec<Vec<TracedBox<'_>>> = (0..=size.radii).into_par_iter().map(row).collect();
        let table = |(level, count): (usize, &usize)| {
            let rows = traced.iter().map(|colors| BeamletRow::new(colors, level)).collect();
            Self { step, windows: count * count, rows }
        };
        Ok(size.windows.iter().enumerate().map(table).collect())
    }

    /// The same with one beamlet a colour, which is the ray that stands for all light of a point.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub(super) fn aimed(
        model: &RayModel,
        bands: &[ColorBand],
        aimed: &AimedLight,
        losses: Option<&LensLosses>,
        (reach, radii): (f64, usize),
    ) -> Result<Self, PictureError> {
        let lenses = |band: &ColorBand| {
            let lens = |(wavelength, share): &(usize, f64)| {
                Ok((*share, BackwardLens::for_picture(model, *wavelength)?))
            };
            band.wavelengths.iter().map(lens).collect::<Result<Vec<_>, PictureError>>()
        };
        let lenses = bands.iter().map(lenses).collect::<Result<Vec<_>, PictureError>>()?;
        let step = reach / radii as f64;
        let row = |i: usize| BeamletRow::aimed(&lenses, (aimed, losses), step * i as f64);
        Ok(Self { step, windows: 1, rows: (0..=radii).map(row).collect() })
    }

    /// The place of a point of the image in the table.
    pub(super) fn place(&self, [x, y]: [f64; 2]) -> TablePlace {
        let radius = x.hypot(y);
        let place = radius / self.step;
        let row = (place as usize).min(self.rows.len() - 2);
        let turn = if radius > 0.0 { [x / radius, y / radius] } else { [0.0, 1.0] };
        TablePlace { row, part: place - row as f64, turn }
    }
}

impl BeamletRow {
    /// The rays that stand for all light at a distance from the axis.
    fn aimed(
        lenses: &[Vec<(f64, BackwardLens)>],
        (aimed, losses): (&AimedLight, Option<&LensLosses>),
        radius: f64,
    ) -> Self {
        let cosines = aimed.chief(radius);
        let mut row = Self { beamlets: Vec::new(), sideways: vec![0.0; lenses.len()] };
        for (color, lenses) in lenses.iter().enumerate() {
            let mut moments = RayMoments::default();
            for (w, (share, lens)) in lenses.iter().enumerate() {
                let passed = losses.map_or(1.0, |own| own.passed([color, w], radius, cosines));
                let weight = share * passed * aimed.light([color, w], radius);
                match single_ray(lens, radius, cosines) {
                    Some(ray) if ray.direction.z < SIDEWAYS => {
                        moments.add(&RayMoments::of_ray(&ray), weight);
                    }
                    Some(_) => row.sideways[color] += weight,
                    None => {}
                }
            }
            row.beamlets.push(moments.beamlet());
        }
        row
    }

    fn new(colors: &[TracedBox<'_>], level: usize) -> Self {
        let windows = colors.iter().flat_map(|color| &color.windows[level]);
        Self {
            beamlets: windows.map(RayMoments::beamlet).collect(),
            sideways: colors.iter().map(|color| color.sideways).collect(),
        }
    }
}

/// The ray of the scene whose light arrives at a point of the y axis in a direction.
fn single_ray(lens: &BackwardLens, radius: f64, cosines: [f64; 2]) -> Option<Ray<f64>> {
    let (mut rays, mut landings) = (Rays::default(), Landings::default());
    rays.push(lens.ray([0.0, radius], cosines)?.0);
    lens.trace(&rays, &mut landings);
    landings.fate(0).is_imaged().then(|| lens.scene_ray(landings.ray(0)))
}

/// The rays of one colour at an image point, added up in windows.
struct TracedBox<'a> {
    size: TableSize<'a>,
    /// The places of the first ray of every wavelength in its cell, which all differ: the edge of the light
    /// is then met at other parts of cells.
    shifts: Vec<[f64; 2]>,
    /// By table.
    windows: Vec<Vec<RayMoments>>,
    /// The sums of a line of the box, by table.
    line: Vec<Vec<RayMoments>>,
    /// The irradiance of rays that leave the lens sideways.
    sideways: f64,
}

impl<'a> TracedBox<'a> {
    fn new(size: TableSize<'a>, row: usize, wavelengths: usize) -> Self {
        // The sequence of the plastic number, which fills a square evenly.
        let shift = |w: usize| {
            let n = (row * wavelengths + w) as f64;
            [0.754_877_666_246_693, 0.569_840_290_998_053].map(|part| (0.5 + part * n).fract())
        };
        Self {
            shifts: (0..wavelengths).map(shift).collect(),
            windows: size.windows.iter().map(|n| vec![RayMoments::default(); n * n]).collect(),
            line: size.windows.iter().map(|n| vec![RayMoments::default(); *n]).collect(),
            size,
            sideways: 0.0,
        }
    }

    /// Adds the rays of all wavelengths of a colour from the point `(0, radius)` within a box of directions,
    /// its middle and half of its sides.
    fn trace_all(
        &mut self,
        (color, lenses): (usize, &[(f64, BackwardLens)]),
        losses: Option<&LensLosses>,
        (radius, bounds): (f64, [[f64; 2]; 2]),
    ) {
        for (w, (share, lens)) in lenses.iter().enumerate() {
            let passed = |cosines: [f64; 2]| {
                share * losses.map_or(1.0, |losses| losses.passed([color, w], radius, cosines))
            };
            self.trace(lens, passed, (radius, bounds), w);
        }
    }

    /// Adds the rays of a wavelength from the point `(0, radius)` within a box of directions, its middle and
    /// half of its sides, each with the share of its direction.
    fn trace(
        &mut self,
        lens: &BackwardLens,
        share: impl Fn([f64; 2]) -> f64,
        (radius, [center, half]): (f64, [[f64; 2]; 2]),
        wavelength: usize,
    ) {
        let (side, shift) = (self.size.rays, self.shifts[wavelength]);
        let area = 4.0 * half[0] * half[1] / (side * side) as f64 * lens.index_ratio;
        let mut rays = Rays::with_capacity(side * side);
        let mut origins = Vec::with_capacity(side * side);
        for i in 0..side * side {
            let cell = [i % side, i / side];
            let place = [0, 1].map(|k| (cell[k] as f64 + shift[k]) / side as f64);
            let cosines = [0, 1].map(|k| center[k] + half[k] * (2.0 * place[k] - 1.0));
            if let Some((ray, cosine)) = lens.ray([0.0, radius], cosines) {
                rays.push(ray);
                origins.push((place, area * cosine * share(cosines)));
            }
        }
        let mut landings = Landings::default();
        lens.trace(&rays, &mut landings);
        for (i, (place, weight)) in origins.iter().enumerate() {
            if landings.fate(i).is_imaged() {
                let ray = lens.scene_ray(landings.ray(i));
                if ray.direction.z < SIDEWAYS {
                    self.add_ray(&ray, *weight, place[0]);
                } else {
                    self.sideways += weight;
                }
            }
            if origins.get(i + 1).is_none_or(|(next, _)| next[1] != place[1]) {
                self.add_line(place[1]);
            }
        }
    }

    /// Adds a ray to the sums of the line of the box that it belongs to.
    fn add_ray(&mut self, ray: &Ray<f64>, weight: f64, place: f64) {
        let moments = RayMoments::of_ray(ray);
        for line in &mut self.line {
            for (window, part) in windows_at(place, line.len()) {
                line[window].add(&moments, part * weight);
            }
        }
    }

    /// Adds the sums of a line of the box to the windows, and clears them.
    fn add_line(&mut self, place: f64) {
        for (line, windows) in self.line.iter_mut().zip(&mut self.windows) {
            let count = line.len();
            for (window, part) in windows_at(place, count) {
                for (sum, moments) in windows[window * count..].iter_mut().zip(&*line) {
                    sum.add(moments, part);
                }
            }
            line.fill(RayMoments::default());
        }
    }
}

/// The windows that count at a place from 0 to 1, with their values, which add up to one: quadratic
/// B-splines about the middles of equal parts, the outermost of which take what lies beyond them.
fn windows_at(place: f64, count: usize) -> [(usize, f64); 3] {
    let at = place * count as f64 - 0.5;
    let middle = at.round();
    let off = at - middle;
    let index = |k: f64| (middle + k).clamp(0.0, (count - 1) as f64) as usize;
    [
        (index(-1.0), 0.5 * (0.5 - off) * (0.5 - off)),
        (index(0.0), 0.75 - off * off),
        (index(1.0), 0.5 * (0.5 + off) * (0.5 + off)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spot at a point of the y axis, turned to another point as far from the axis: what pointed away
    /// from the axis still does, and lengths and handedness are kept.
    #[test]
    fn a_turned_spot_points_where_its_image_point_does() {
        let e = [0.6, -0.8];
        let spot = BeamletSpot { weight: 1.0, place: [0.0, 2.0], variance: [1.0, 0.0, 4.0] };
        let turned = spot.turned(e);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-15;
        assert!(near(turned.place[0], 2.0 * e[0]) && near(turned.place[1], 2.0 * e[1]));
        // The long axis follows: the variance along e is 4, across it 1.
        let [xx, xy, yy] = turned.variance;
        let along = |[a, b]: [f64; 2]| a * a * xx + 2.0 * a * b * xy + b * b * yy;
        assert!((along(e) - 4.0).abs() < 1e-14 && (along([e[1], -e[0]]) - 1.0).abs() < 1e-14);
        // A quarter turn from the y axis to the x axis takes e to this direction.
        let right = BeamletSpot { place: [0.1, 0.0], ..spot }.turned(e);
        assert!(near(right.place[0], 0.1 * e[1]) && near(right.place[1], -0.1 * e[0]));
    }

    #[test]
    fn windows_add_up_to_one_with_the_variance_of_a_quarter_of_their_distance_squared() {
        for count in [1, 2, 5, 8] {
            let mut sums = vec![[0.0; 3]; count];
            for i in 0..4000 {
                let place = (f64::from(i) + 0.5) / 4000.0;
                let found = windows_at(place, count);
                assert!((found.iter().map(|(_, part)| part).sum::<f64>() - 1.0).abs() < 1e-15);
                for (window, part) in found {
                    let x = place * count as f64;
                    sums[window] = [0, 1, 2].map(|k| sums[window][k] + part * x.powi(k as i32));
                }
            }
            if count >= 5 {
                let [weight, mean, square] = sums[2];
                let variance = square / weight - (mean / weight).powi(2);
                assert!((mean / weight - 2.5).abs() < 1e-3 && (variance - 0.25).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_spot_in_depth_has_the_variance_of_its_rays_there() {
        let ray = |x: f64, p: f64| {
            let direction = crate::math::Vec3::new(p, 0.0, -1.0);
            Ray { point: crate::math::Vec3::new(x, 0.0, 0.0), direction }
        };
        let mut sums = RayMoments::default();
        for (x, p) in [(1.0, 0.1), (-1.0, 0.2), (0.5, -0.1)] {
            sums.add(&RayMoments::of_ray(&ray(x, p)), 2.0);
        }
        let spot = sums.beamlet().spot(Some(10.0));
        let places = [2.0, 1.0, -0.5];
        let mean = places.iter().sum::<f64>() / 3.0;
        let variance = places.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 3.0;
        assert!((spot.place[0] - mean).abs() < 1e-14 && (spot.weight - 6.0).abs() < 1e-14);
        assert!((spot.variance[0] - variance).abs() < 1e-13, "{spot:?}");
    }
}
