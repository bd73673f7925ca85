//! Images of points of light at places of a picture, by the rays of the picture itself.
//!
//! Light arrives at an image point q along a direction c from the scene point `s(q, c)`, which a backward ray
//! finds. The light of one scene point S arrives wherever `s(q, c) = S`: to first order about an image point P, at
//!
//! ```text
//! q = P + A⁻¹ (S − s(P, c)),   A = ∂s/∂q
//! ```
//!
//! The backward rays from P alone thus show the image of the point S that P lies in the middle of, with the rims that
//! clip it, its focus, and the spread that diffraction adds. What first order leaves out is the change of A over the
//! beam and that of the beam over the width of the image.

use super::exact::ExactRenderer;
use super::scene::Radiance;
use super::tile_sampler::TileSampler;
use super::{ColorBand, ImageFrame};
use rayon::prelude::*;

/// The places of images of points, and how well they are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointGrid {
    /// The columns and rows of places, evenly over the frame.
    pub places: [usize; 2],
    /// The cells along a side of an image.
    pub cells: usize,
    /// The rays of a wavelength.
    pub samples: usize,
}

/// The images of points of light over the frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPoints {
    /// The columns and rows of places.
    pub places: [usize; 2],
    /// The cells along a side of an image.
    pub cells: usize,
    /// The side of an image in mm, the same for all.
    pub side: f64,
    /// The distance of the points in front of the first surface in mm; `None` at infinity.
    pub distance: Option<f64>,
    /// The images row by row from the upper left place; `None` where it is dark.
    pub images: Vec<Option<PlacedPoint>>,
    /// The largest root mean square error of an image by its sampling, as a share of its peak.
    pub error: f64,
    /// The rays traced.
    pub rays: usize,
}

/// The image of a point of light.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedPoint {
    /// Its light in red, green and blue over the largest of them, row by row from the upper left cell as the picture
    /// shows it.
    pub values: Vec<Radiance>,
    /// The share of the light that arrives within the image.
    pub inside: f64,
    /// The radius in mm of the circle about the centroid that has half of the light.
    pub half_light: f64,
    /// The error by sampling, as a share of the peak.
    error: f64,
}

/// Light that arrives beside a place: to the right and upwards of it on the image, in mm.
struct ArrivedSpot {
    /// By colour.
    color: usize,
    off: [f64; 2],
    light: f64,
    /// One of two halves of the rays, each with a seed of its own.
    half: usize,
}

/// The share of the light of the widest image that its square has to hold, and the room around it.
const HELD: f64 = 0.9;
const ROOM: f64 = 1.15;
/// The seeds of the two halves of the rays, whose difference is the error.
const SEEDS: [u32; 2] = [0x50_1A7, 0x7A_105];
/// The shift of the image point over which `A` is measured, as a share of the frame's reach.
const SHIFT: f64 = 1e-4;

impl ExactRenderer<'_> {
    /// The images of points of light at a distance in mm in front of the first surface, or at infinity, for the
    /// colours of this renderer; `None` once `is_stopped` says so.
    pub fn placed_points(
        &self,
        bands: &[ColorBand],
        grid: PointGrid,
        distance: Option<f64>,
        is_stopped: &(dyn Fn() -> bool + Sync),
    ) -> Option<PlacedPoints> {
        let frame = self.frame();
        let subject = PointSubject { sampler: self.sampler(), bands, frame, distance };
        let [columns, rows] = grid.places;
        let middle = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
        let place = |i: usize| {
            let shares = [middle(i % columns, columns), middle(i / columns, rows)];
            if is_stopped() { None } else { subject.arrived(frame.at_share(shares), grid.samples) }
        };
        let found: Vec<_> = (0..columns * rows).into_par_iter().map(place).collect();
        if is_stopped() {
            return None;
        }
        let reach = found.iter().flatten().map(|(spots, _)| radius_of_share(spots, HELD));
        let side = (2.0 * ROOM * reach.fold(0.0, f64::max)).max(frame.pitch);
        let rays = found.iter().flatten().map(|(_, rays)| rays).sum();
        let image = |spots: &(Vec<ArrivedSpot>, usize)| {
            PlacedPoint::of((&spots.0, bands.len()), (grid.cells, side), frame.inverted)
        };
        let images: Vec<_> = found.iter().map(|found| found.as_ref().and_then(image)).collect();
        let error = images.iter().flatten().map(|image| image.error).fold(0.0, f64::max);
        Some(PlacedPoints {
            places: grid.places,
            cells: grid.cells,
            side,
            distance,
            images,
            error,
            rays,
        })
    }
}

/// A lens with the distance of points in front of it.
#[derive(Clone, Copy)]
struct PointSubject<'a> {
    sampler: &'a TileSampler,
    bands: &'a [ColorBand],
    frame: ImageFrame,
    distance: Option<f64>,
}

/// The light that a backward ray stands for, the scene point that it meets, and the displacement by diffraction.
type SeenPoint = (f64, [f64; 2], [f64; 2]);

impl PointSubject<'_> {
    /// The light about an image point of the scene point that it shows in the middle colour, with the number of rays;
    /// `None` where it is dark or where the image has no scale.
    fn arrived(&self, place: [f64; 2], samples: usize) -> Option<(Vec<ArrivedSpot>, usize)> {
        let (middle, to_image) = self.middle(place, samples)?;
        let lights = self.bands.iter().enumerate().flat_map(|(color, band)| {
            let of_band = band.wavelengths.iter().enumerate();
            of_band.map(move |(wavelength, (_, share))| ([color, wavelength], *share))
        });
        let mut spots = Vec::new();
        // The middle colour is traced from three points.
        let mut rays = 3 * samples * self.bands[self.middle_color()].wavelengths.len();
        for (light, share) in lights {
            let seen = self.seen(light, [place; 2], samples);
            rays += seen.len();
            let spot = |(i, seen): (usize, Option<SeenPoint>)| {
                let (light_along, [x, y], by) = seen?;
                let [dx, dy] = [middle[0] - x, middle[1] - y];
                let off = to_image.map(|row| row[0] * dx + row[1] * dy);
                let off = [off[0] + by[0], off[1] + by[1]];
                let half = i % 2;
                Some(ArrivedSpot { color: light[0], off, light: share * light_along, half })
            };
            spots.extend(seen.into_iter().enumerate().filter_map(spot));
        }
        (!spots.is_empty()).then_some((spots, rays))
    }

    /// The colour about whose light images are centred.
    fn middle_color(&self) -> usize {
        self.bands.len() / 2
    }

    /// The scene point in the middle of the light of an image point, and the inverse of `A`.
    fn middle(&self, place: [f64; 2], samples: usize) -> Option<([f64; 2], [[f64; 2]; 2])> {
        let color = self.middle_color();
        let shift = SHIFT * self.frame.reach();
        let (mut all, mut sum) = (0.0, [0.0; 2]);
        let (mut both, mut slopes) = (0.0, [[0.0; 2]; 2]);
        for (wavelength, (_, share)) in self.bands[color].wavelengths.iter().enumerate() {
            let from = |beside| self.seen([color, wavelength], [place, beside], samples);
            let (here, right, up) = (
                from(place),
                from([place[0] + shift, place[1]]),
                from([place[0], place[1] + shift]),
            );
            for ((here, right), up) in here.iter().zip(&right).zip(&up) {
                let Some((light, at, _)) = here else { continue };
                all += share * light;
                (0..2).for_each(|k| sum[k] += share * light * at[k]);
                let (Some((_, right, _)), Some((_, up, _))) = (right, up) else { continue };
                both += share * light;
                for k in 0..2 {
                    slopes[k][0] += share * light * (right[k] - at[k]) / shift;
                    slopes[k][1] += share * light * (up[k] - at[k]) / shift;
                }
            }
        }
        let [[a, b], [c, d]] = slopes.map(|row| row.map(|v| v / both));
        let det = a * d - b * c;
        let inverse = [[d / det, -b / det], [-c / det, a / det]];
        let is_known = all > 0.0 && inverse.iter().flatten().all(|v| v.is_finite());
        is_known.then(|| (sum.map(|v| v / all), inverse))
    }

    /// The scene points that rays meet from beside an image point along the directions of its light; `None` for those that are lost.
    fn seen(
        &self,
        light: [usize; 2],
        places: [[f64; 2]; 2],
        samples: usize,
    ) -> Vec<Option<SeenPoint>> {
        let numbers = |i: usize| {
            [0, 1, 2, 3].map(|d| f64::from(sobol_burley::sample(i as u32 / 2, d, SEEDS[i % 2])))
        };
        let seen = self.sampler.seen_from(light, places, (0..samples).map(numbers));
        seen.into_iter()
            .map(|ray| {
                let (light, ray, by) = ray?;
                let (from, towards) = (ray.point, ray.direction);
                let slope = [towards.x / towards.z, towards.y / towards.z];
                let at = self.distance.map_or(slope, |distance| {
                    let way = -distance - from.z;
                    [from.x + way * slope[0], from.y + way * slope[1]]
                });
                (light > 0.0 && at.iter().all(|v| v.is_finite())).then_some((light, at, by))
            })
            .collect()
    }
}

/// The radius about the place that has a share of the light.
fn radius_of_share(spots: &[ArrivedSpot], share: f64) -> f64 {
    radius_about(spots, [0.0; 2], share)
}

fn radius_about(spots: &[ArrivedSpot], [x, y]: [f64; 2], share: f64) -> f64 {
    let radius = |spot: &ArrivedSpot| ((spot.off[0] - x).hypot(spot.off[1] - y), spot.light);
    let mut sorted: Vec<(f64, f64)> = spots.iter().map(radius).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = share * sorted.iter().map(|(_, light)| light).sum::<f64>();
    let mut sum = 0.0;
    let end = sorted.iter().find(|(_, light)| {
        sum += light;
        sum >= wanted
    });
    end.or(sorted.last()).map_or(0.0, |(radius, _)| *radius)
}

fn centroid(spots: &[ArrivedSpot]) -> [f64; 2] {
    let all: f64 = spots.iter().map(|spot| spot.light).sum();
    [0, 1].map(|k| spots.iter().map(|spot| spot.light * spot.off[k]).sum::<f64>() / all)
}

impl PlacedPoint {
    /// The image of light of so many colours, one for grey, in a square of cells with a side in mm; `None` if none of
    /// it arrives there.
    fn of(
        (spots, colors): (&[ArrivedSpot], usize),
        (cells, side): (usize, f64),
        inverted: bool,
    ) -> Option<Self> {
        let facing = if inverted { -1.0 } else { 1.0 };
        let mut halves = [0, 1].map(|_| vec![[0.0; 3]; cells * cells]);
        let (mut all, mut inside) = (0.0, 0.0);
        for spot in spots {
            all += spot.light;
            let at = [facing * spot.off[0], -facing * spot.off[1]];
            let at = at.map(|off| (off / side + 0.5) * cells as f64 - 0.5);
            let low = at.map(f64::floor);
            for [i, j] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                let cell = [low[0] + i, low[1] + j];
                if cell.iter().any(|v| !(*v >= 0.0 && *v < cells as f64)) {
                    continue;
                }
                let part = [0, 1].map(|k| 1.0 - (at[k] - cell[k]).abs());
                let light = spot.light * part[0] * part[1];
                inside += light;
                halves[spot.half][cell[1] as usize * cells + cell[0] as usize][spot.color] += light;
            }
        }
        let (first, second) = (&halves[0], &halves[1]);
        let mut values: Vec<Radiance> =
            first.iter().zip(second).map(|(a, b)| [0, 1, 2].map(|k| a[k] + b[k])).collect();
        if colors == 1 {
            values.iter_mut().for_each(|value| *value = [value[0]; 3]);
        }
        let peak = values.iter().flatten().copied().fold(0.0, f64::max);
        if !(peak > 0.0) {
            return None;
        }
        values.iter_mut().flatten().for_each(|value| *value /= peak);
        let apart = first.iter().flatten().zip(second.iter().flatten());
        let square: f64 = apart.map(|(a, b)| (a - b).powi(2)).sum();
        let error = (square / (colors * cells * cells) as f64).sqrt() / peak;
        let half_light = radius_about(spots, centroid(spots), 0.5);
        Some(Self { values, inside: inside / all, half_light, error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The only light of an RGB picture may be red; in grey the same light is white, and its error is a mean over one
    /// colour in place of three.
    #[test]
    fn red_light_alone_is_not_grey() {
        let spot = |half: usize, light: f64| ArrivedSpot { color: 0, off: [0.0; 2], light, half };
        let spots = [spot(0, 3.0), spot(1, 1.0)];
        let [red, grey] =
            [3, 1].map(|colors| PlacedPoint::of((&spots, colors), (3, 1.0), false).unwrap());
        assert_eq!((red.values[4], grey.values[4]), ([1.0, 0.0, 0.0], [1.0; 3]));
        assert!((grey.error - 0.5 / 3.0).abs() < 1e-12, "{}", grey.error);
        assert!((red.error * 3.0_f64.sqrt() - grey.error).abs() < 1e-12, "{}", red.error);
        assert_eq!((grey.inside, grey.half_light), (1.0, 0.0));
    }
}
