//! Rays of the samples of a tile, traced in batches.
//!
//! The rays of a sample are the same in all colours and differ only in the wavelength at which they are
//! traced; with diffraction each colour has its own, since displacements are proportional to the wavelength.
//! Of every sample, all pixels and replicates of a tile are done at once.

use super::aimed_light::AimedLight;
use super::diffraction::image_wavelength;
use super::exact::{REPLICATES, TILE, mean_with_error};
use super::lit_directions::LitDirections;
use super::losses::LensLosses;
use super::pupil_spread::PupilSpreads;
use super::sample_points::SamplePoints;
use super::scene::{Radiance, Scene};
use super::seen_light::SeenColor;
use super::{ColorBand, ImageFrame, PictureError};
use crate::analysis::BackwardLens;
use crate::pupil::RayModel;
use crate::trace::{Fates, Landings, Ray, Rays, TraceSink as _};
use std::ops::Range;

/// The number of rays that are traced together.
const BATCH: usize = 1024;

/// A tile of a picture: columns and rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PictureTile {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl PictureTile {
    pub(super) const fn new(columns: Range<usize>, rows: Range<usize>) -> Self {
        Self { columns, rows }
    }

    pub(super) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.rows.clone().flat_map(|row| self.columns.clone().map(move |column| [column, row]))
    }

    pub(super) fn len(&self) -> usize {
        self.columns.len() * self.rows.len()
    }
}

/// The pixels of a tile with their standard errors.
#[derive(Debug, Clone, Default)]
pub(super) struct SampledTile {
    pub(super) values: Vec<Radiance>,
    pub(super) errors: Vec<Radiance>,
    pub(super) samples: usize,
    pub(super) fates: Fates,
}

/// A tile with the light of its samples so far.
#[derive(Debug)]
pub(super) struct TileWork {
    pub(super) tile: PictureTile,
    frame: ImageFrame,
    points: SamplePoints,
    /// The upper left corners of the pixels on the image, x and y in mm.
    corners: [Vec<f64>; 2],
    /// By replicate, pixel and colour.
    sums: Vec<f64>,
    fates: Fates,
    /// The samples of each replicate of a pixel that have ended.
    pub(super) count: usize,
    /// The tile after so many samples.
    pub(super) sampled: SampledTile,
}

/// A part of the spectrum of every colour: a number from 0 to 1 up to which it reaches, and the index of the
/// wavelength of each colour.
#[derive(Debug)]
struct SpectralPart {
    end: f64,
    wavelengths: Vec<usize>,
}

/// The light that a ray stands for: that of directions of an area in cosines, or all of its point, by its irradiance.
#[derive(Debug, Clone, Copy)]
enum RayShare {
    Area(f64),
    Irradiance(f64),
}

/// The share of the irradiance that a ray stands for, the ray of the scene, and its displacement by diffraction in mm.
pub(super) type SeenRay = (f64, Ray<f64>, [f64; 2]);

/// A colour and the index of its wavelength.
type ColorLight = (usize, usize);

/// Rays of one part of the spectrum that wait to be traced, as columns.
#[derive(Debug, Default)]
struct RayQueue {
    rays: Rays<f64>,
    /// The index of the replicate and pixel of each.
    sets: Vec<usize>,
    /// The share of the irradiance that the light along each has.
    weights: Vec<f64>,
    /// The times.
    seconds: Vec<f64>,
    /// The distances of the image points from the axis, and the directions there.
    radii: Vec<f64>,
    cosines: Vec<[f64; 2]>,
    landings: Landings<f64>,
    /// The rays beyond the lens, and the light along them.
    outside: Rays<f64>,
    light: Vec<f64>,
}

impl RayQueue {
    fn clear(&mut self) {
        self.rays.clear();
        self.sets.clear();
        self.weights.clear();
        self.seconds.clear();
        self.radii.clear();
        self.cosines.clear();
    }
}

/// The scene, and the time during which it moves in seconds.
type MovingScene<'a> = (&'a Scene, f64);

/// A lens at the wavelengths of a picture, with the directions of light at its image.
#[derive(Debug)]
pub(super) struct TileSampler {
    /// By colour and wavelength.
    lenses: Vec<Vec<BackwardLens>>,
    /// Their wavelengths in the image space in mm.
    lengths: Vec<Vec<f64>>,
    /// The numbers of these in the model: colours that have one in common share its rays.
    numbers: Vec<Vec<usize>>,
    spectrum: Vec<SpectralPart>,
    pub(super) directions: LitDirections,
    /// The light that surfaces reflect; `None` if they let all light pass.
    pub(super) losses: Option<LensLosses>,
    /// The displacements of image points by diffraction; `None` if it is left out.
    pub(super) spreads: Option<PupilSpreads>,
    /// The rays that stand for all light of a point where blur is left out.
    pub(super) sharp: Option<AimedLight>,
}

impl TileSampler {
    pub(super) fn new(
        model: &RayModel,
        bands: &[ColorBand],
        directions: LitDirections,
    ) -> Result<Self, PictureError> {
        let of_band = |band: &ColorBand| {
            let lens =
                |(wavelength, _): &(usize, f64)| Ok(BackwardLens::for_picture(model, *wavelength)?);
            band.wavelengths.iter().map(lens).collect::<Result<Vec<_>, PictureError>>()
        };
        let lenses = bands.iter().map(of_band).collect::<Result<_, _>>()?;
        let length = |(wavelength, _): &(usize, f64)| image_wavelength(model, *wavelength);
        let lengths = bands.iter().map(|band| band.wavelengths.iter().map(length).collect());
        let numbers = |band: &ColorBand| band.wavelengths.iter().map(|(w, _)| *w).collect();
        Ok(Self {
            lenses,
            lengths: lengths.collect(),
            numbers: bands.iter().map(numbers).collect(),
            spectrum: spectrum(bands),
            directions,
            losses: None,
            spreads: None,
            sharp: None,
        })
    }

    /// The number of colours.
    pub(super) fn colors(&self) -> usize {
        self.lenses.len()
    }

    /// A tile without samples.
    pub(super) fn begin(&self, frame: &ImageFrame, tile: PictureTile, seed: u32) -> TileWork {
        let place = |[column, row]: [usize; 2]| (row * frame.pixels[0] + column) * REPLICATES;
        let of_replicate = |replicate: usize| {
            tile.pixels().map(move |pixel| set_seed(place(pixel) + replicate, seed))
        };
        let seeds: Vec<u32> = (0..REPLICATES).flat_map(of_replicate).collect();
        // Tiles of any size in a cell of the largest have the wavelengths of that cell.
        let cell = [tile.columns.start, tile.rows.start].map(|v| v / TILE * TILE);
        let color_seeds: Vec<u32> =
            (0..REPLICATES).map(|replicate| set_seed(place(cell) + replicate, seed)).collect();
        let corner =
            |k: usize| tile.pixels().map(|pixel| frame.point(pixel, [0.0; 2])[k]).collect();
        TileWork {
            sums: vec![0.0; seeds.len() * self.colors()],
            points: SamplePoints::new(&seeds, &color_seeds),
            corners: [corner(0), corner(1)],
            frame: *frame,
            tile,
            fates: Fates::default(),
            count: 0,
            sampled: SampledTile::default(),
        }
    }

    /// Samples a tile until every replicate of a pixel has `count` samples; false if that was stopped.
    pub(super) fn sample(
        &self,
        work: &mut TileWork,
        count: usize,
        scene: MovingScene<'_>,
        is_stopped: &dyn Fn() -> bool,
    ) -> bool {
        // By part of the spectrum, each with the colours that share rays.
        let bundles: Vec<Vec<Vec<ColorLight>>> =
            self.spectrum.iter().map(|part| self.bundles(part)).collect();
        let queue = |bundles: &Vec<Vec<ColorLight>>| {
            bundles.iter().map(|_| RayQueue::default()).collect::<Vec<_>>()
        };
        let mut queues: Vec<Vec<RayQueue>> = bundles.iter().map(queue).collect();
        for sample in work.count..count {
            if is_stopped() {
                return false;
            }
            work.points.go_to(sample, [scene.1 != 0.0, self.spreads.is_some()]);
            for replicate in 0..REPLICATES {
                let color = work.points.color(replicate);
                let part = self.spectrum.partition_point(|part| part.end <= color);
                let part = part.min(self.spectrum.len() - 1);
                for (queue, lights) in queues[part].iter_mut().zip(&bundles[part]) {
                    self.start(work, replicate, (lights[0], scene.1), queue);
                    self.trace_if_full(work, queue, lights, scene.0);
                }
            }
        }
        let all = queues.iter_mut().flatten().zip(bundles.iter().flatten());
        all.for_each(|(queue, lights)| self.trace(work, queue, lights, scene.0));
        work.count = count;
        work.sampled = self.estimate(work);
        true
    }

    /// The colours of a part of the spectrum that share their rays: all, but each by itself with diffraction.
    fn bundles(&self, part: &SpectralPart) -> Vec<Vec<ColorLight>> {
        let lights = part.wavelengths.iter().copied().enumerate();
        if self.spreads.is_some() {
            lights.map(|light| vec![light]).collect()
        } else {
            vec![lights.collect()]
        }
    }

    /// Queues the rays of a sample of all pixels in a replicate for a colour, but those from where it is dark.
    fn start(
        &self,
        work: &TileWork,
        replicate: usize,
        ((color, wavelength), seconds): (ColorLight, f64),
        queue: &mut RayQueue,
    ) {
        // The rays of all wavelengths start alike.
        let lens = &self.lenses[color][wavelength];
        let length = self.lengths[color][wavelength];
        let step = work.frame.point([0, 0], [1.0; 2]);
        let corner = work.frame.point([0, 0], [0.0; 2]);
        let step = [step[0] - corner[0], step[1] - corner[1]];
        let first = replicate * work.tile.len();
        let [right, down, across, along, time, near, far] =
            work.points.columns().map(|column| &column[first..]);
        for (i, (left, top)) in work.corners[0].iter().zip(&work.corners[1]).enumerate() {
            let mut point = [left + step[0] * right[i], top + step[1] * down[i]];
            if let Some(spreads) = &self.spreads {
                let (radius, axes) = polar(point);
                let light = [color, wavelength];
                let by = turned(spreads.draw(light, (radius, length), [near[i], far[i]]), axes);
                // Light that is spread that far to here comes from there.
                point = [point[0] - by[0], point[1] - by[1]];
            }
            let (radius, axes) = polar(point);
            let place = (radius, [across[i], along[i]]);
            let Some((cosines, share_of)) = self.direction([color, wavelength], place) else {
                continue;
            };
            let Some((ray, share)) = lens.ray(point, turned(cosines, axes)) else { continue };
            queue.rays.push(ray);
            queue.sets.push(first + i);
            queue.weights.push(match share_of {
                RayShare::Area(area) => area * share,
                RayShare::Irradiance(all) => all / lens.index_ratio,
            });
            queue.seconds.push(seconds * time[i]);
            if self.losses.is_some() {
                queue.radii.push(radius);
                queue.cosines.push(cosines);
            }
        }
    }

    /// The direction of a ray at a distance from the axis, for a point of the y axis, and what it stands for; `None`
    /// where it is dark.
    #[inline(always)]
    fn direction(
        &self,
        [color, wavelength]: [usize; 2],
        (radius, unit): (f64, [f64; 2]),
    ) -> Option<([f64; 2], RayShare)> {
        if let Some(aimed) = self.aimed() {
            let light = aimed.light([color, wavelength], radius);
            return Some((aimed.chief(radius), RayShare::Irradiance(light)));
        }
        let drawn = self.directions.draw(radius, unit)?;
        Some((drawn.cosines, RayShare::Area(drawn.area)))
    }

    /// The rays that stand for all light of a point, if spreads have its aberrations, or if it has none.
    pub(super) fn aimed(&self) -> Option<&AimedLight> {
        let of_spreads = self.spreads.as_ref().map(|spreads| spreads.aimed.as_ref());
        of_spreads.unwrap_or(self.sharp.as_ref())
    }

    /// The light that arrives at a point of the image at a wavelength of a colour, a ray for each set of numbers from
    /// 0 to 1 that draw a direction and a displacement by diffraction: its share of the irradiance, the ray of the
    /// scene, and the displacement in mm; `None` for one that is lost. The rays begin at a point beside it, along the
    /// directions of the first.
    pub(super) fn seen_from(
        &self,
        light: [usize; 2],
        [point, beside]: [[f64; 2]; 2],
        numbers: impl Iterator<Item = [f64; 4]>,
    ) -> Vec<Option<SeenRay>> {
        let [color, wavelength] = light;
        let (lens, length) = (&self.lenses[color][wavelength], self.lengths[color][wavelength]);
        let (radius, axes) = polar(point);
        let start = |[across, along, near, far]: [f64; 4]| {
            let by = self.spreads.as_ref().map_or([0.0; 2], |spreads| {
                turned(spreads.draw(light, (radius, length), [near, far]), axes)
            });
            let (cosines, share_of) = self.direction(light, (radius, [across, along]))?;
            let (ray, share) = lens.ray(beside, turned(cosines, axes))?;
            let weight = match share_of {
                RayShare::Area(area) => area * share * lens.index_ratio,
                RayShare::Irradiance(all) => all,
            };
            let passed = |losses: &LensLosses| losses.passed(light, radius, cosines);
            Some((ray, weight * self.losses.as_ref().map_or(1.0, passed), by))
        };
        let started: Vec<_> = numbers.map(start).collect();
        let rays: Rays<f64> = started.iter().flatten().map(|(ray, ..)| *ray).collect();
        let (mut landings, mut outside) = (Landings::default(), Rays::default());
        lens.trace(&rays, &mut landings);
        lens.scene_rays(&landings, &mut outside);
        let mut traced = 0..rays.len();
        let mut end = |(_, weight, by): &(Ray<f64>, f64, [f64; 2])| {
            let i = traced.next()?;
            landings.fate(i).is_imaged().then(|| (*weight, outside.get(i), *by))
        };
        started.iter().map(|started| end(started.as_ref()?)).collect()
    }

    /// Traces the rays of a queue that is full.
    fn trace_if_full(
        &self,
        work: &mut TileWork,
        queue: &mut RayQueue,
        lights: &[ColorLight],
        scene: &Scene,
    ) {
        if queue.sets.len() >= BATCH {
            self.trace(work, queue, lights, scene);
        }
    }

    /// Traces the rays of a queue in some colours and adds their light.
    fn trace(
        &self,
        work: &mut TileWork,
        queue: &mut RayQueue,
        lights: &[ColorLight],
        scene: &Scene,
    ) {
        let (colors, mut traced) = (self.colors(), None);
        for (color, wavelength) in lights {
            let (color, wavelength) = (*color, *wavelength);
            let lens = &self.lenses[color][wavelength];
            let number = Some(self.numbers[color][wavelength]);
            if traced != number {
                lens.trace(&queue.rays, &mut queue.landings);
                work.fates.add(queue.landings.fates());
                lens.scene_rays(&queue.landings, &mut queue.outside);
                traced = number;
            }
            let seen = SeenColor { color, colors };
            scene.light_along(&queue.outside, &queue.seconds, seen, &mut queue.light);
            if let Some(losses) = &self.losses {
                let ways = queue.radii.iter().zip(&queue.cosines);
                for (light, (radius, cosines)) in queue.light.iter_mut().zip(ways) {
                    *light *= losses.passed([color, wavelength], *radius, *cosines);
                }
            }
            let rays = queue.sets.iter().zip(&queue.weights).zip(&queue.light);
            for (i, ((set, weight), light)) in rays.enumerate() {
                if queue.landings.fate(i).is_imaged() {
                    work.sums[set * colors + color] += weight * lens.index_ratio * light;
                }
            }
        }
        queue.clear();
    }

    /// Means and standard errors of the pixels of a tile.
    fn estimate(&self, work: &TileWork) -> SampledTile {
        let colors = self.colors();
        let mut sampled = SampledTile { fates: work.fates, ..SampledTile::default() };
        sampled.samples = work.fates.total();
        let pixels = work.tile.len();
        for pixel in 0..pixels {
            let statistics = |color: usize| {
                let sum = |replicate: usize| (replicate * pixels + pixel) * colors + color;
                mean_with_error(std::array::from_fn(|r| work.sums[sum(r)] / work.count as f64))
            };
            let colors: [(f64, f64); 3] = std::array::from_fn(|c| statistics(c.min(colors - 1)));
            sampled.values.push(colors.map(|(mean, _)| mean));
            sampled.errors.push(colors.map(|(_, error)| error));
        }
        sampled
    }
}

/// The distance of a point from the axis, and the direction to it.
#[inline(always)]
fn polar([x, y]: [f64; 2]) -> (f64, [f64; 2]) {
    let radius = (x * x + y * y).sqrt();
    let inverse = 1.0 / radius;
    (radius, if radius > 0.0 { [x * inverse, y * inverse] } else { [0.0, 1.0] })
}

/// A vector at a point of the y axis, turned to a point in a direction from the axis.
#[inline(always)]
fn turned([right, outwards]: [f64; 2], [ex, ey]: [f64; 2]) -> [f64; 2] {
    [right * ey + outwards * ex, outwards * ey - right * ex]
}

/// The seed of a set of samples (the finalizer of `MurmurHash3`).
pub(super) fn set_seed(set: usize, seed: u32) -> u32 {
    let mut hash = (set as u32) ^ seed.wrapping_mul(0x9E37_79B9);
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85EB_CA6B);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xC2B2_AE35);
    hash ^ (hash >> 16)
}

/// The parts of the spectrum within which no colour changes its wavelength.
fn spectrum(bands: &[ColorBand]) -> Vec<SpectralPart> {
    let ends_of = |band: &ColorBand| {
        let add = |sum: &mut f64, (_, share): &(usize, f64)| {
            *sum += share;
            Some(*sum)
        };
        band.wavelengths.iter().scan(0.0, add).collect::<Vec<f64>>()
    };
    let bands: Vec<Vec<f64>> = bands.iter().map(ends_of).collect();
    let mut ends: Vec<f64> = bands.iter().flatten().copied().collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let mut from = 0.0;
    let mut part = |end: f64| {
        let middle = 0.5 * (from + end);
        from = end;
        let chosen = |ends: &Vec<f64>| ends.partition_point(|e| *e <= middle).min(ends.len() - 1);
        SpectralPart { end, wavelengths: bands.iter().map(chosen).collect() }
    };
    ends.into_iter().map(&mut part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of a third each and of two halves meet in four parts.
    #[test]
    fn parts_of_the_spectrum_have_one_wavelength_of_each_colour() {
        let band = |count: usize| ColorBand {
            wavelengths: (0..count).map(|i| (i, 1.0 / count as f64)).collect(),
        };
        let parts = spectrum(&[band(3), band(2), band(3)]);
        let ends: Vec<f64> = parts.iter().map(|part| part.end).collect();
        let exact = [1.0 / 3.0, 0.5, 2.0 / 3.0, 1.0];
        assert!(ends.len() == 4 && ends.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-12));
        let chosen: Vec<_> = parts.iter().map(|part| part.wavelengths.clone()).collect();
        assert_eq!(chosen, [[0, 0, 0], [1, 0, 1], [1, 1, 1], [2, 1, 2]]);
    }
}
