//! Rays of the samples of a tile, traced in batches.
//!
//! The rays of a sample are the same in all colours and differ only in the wavelength at which they are
//! traced. Of every sample, all pixels and replicates of a tile are done at once.

use super::exact::{REPLICATES, luminance, mean_with_error};
use super::lit_directions::{DrawnDirection, LitDirections};
use super::losses::LensLosses;
use super::sample_points::{SamplePoint, SamplePoints};
use super::scene::Radiance;
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
    /// By pixel, replicate and colour.
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

/// Rays of one part of the spectrum that wait to be traced.
#[derive(Debug, Default)]
struct RayQueue {
    rays: Rays<f64>,
    origins: Vec<RayOrigin>,
    landings: Landings<f64>,
}

/// The sample that a ray belongs to.
#[derive(Debug, Clone, Copy)]
struct RayOrigin {
    /// The index of its pixel and replicate.
    set: usize,
    weight: f64,
    seconds: f64,
    /// The distance of its image point from the axis, and its direction there.
    radius: f64,
    cosines: [f64; 2],
}

/// The scene that a ray meets at a time in seconds, and the time during which it moves.
type MovingScene<'a> = (&'a dyn Fn(&Ray<f64>, f64) -> Radiance, f64);

/// A lens at the wavelengths of a picture, with the directions of light at its image.
#[derive(Debug)]
pub(super) struct TileSampler {
    /// By colour and wavelength.
    lenses: Vec<Vec<BackwardLens>>,
    spectrum: Vec<SpectralPart>,
    pub(super) directions: LitDirections,
    /// The light that surfaces reflect; `None` if they let all light pass.
    pub(super) losses: Option<LensLosses>,
}

impl TileSampler {
    pub(super) fn new(
        model: &RayModel,
        bands: &[ColorBand],
        directions: LitDirections,
    ) -> Result<Self, PictureError> {
        let of_band = |band: &ColorBand| {
            let lens = |(wavelength, _): &(usize, f64)| Ok(BackwardLens::new(model, *wavelength)?);
            band.wavelengths.iter().map(lens).collect::<Result<Vec<_>, PictureError>>()
        };
        let lenses = bands.iter().map(of_band).collect::<Result<_, _>>()?;
        Ok(Self { lenses, spectrum: spectrum(bands), directions, losses: None })
    }

    /// The number of colours.
    pub(super) fn colors(&self) -> usize {
        self.lenses.len()
    }

    /// A tile without samples.
    pub(super) fn begin(&self, frame: &ImageFrame, tile: PictureTile, seed: u32) -> TileWork {
        let of_pixel = |[column, row]: [usize; 2]| {
            let place = (row * frame.pixels[0] + column) * REPLICATES;
            (0..REPLICATES).map(move |replicate| set_seed(place + replicate, seed))
        };
        let seeds: Vec<u32> = tile.pixels().flat_map(of_pixel).collect();
        TileWork {
            sums: vec![0.0; seeds.len() * self.colors()],
            points: SamplePoints::new(&seeds),
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
        let mut queues: Vec<RayQueue> = self.spectrum.iter().map(|_| RayQueue::default()).collect();
        for sample in work.count..count {
            if is_stopped() {
                return false;
            }
            work.points.go_to(sample);
            self.launch(work, &mut queues, scene);
        }
        for (queue, part) in queues.iter_mut().zip(&self.spectrum) {
            self.trace(work, queue, part, scene.0);
        }
        work.count = count;
        work.sampled = self.estimate(work);
        true
    }

    /// Queues the rays of a sample of all pixels and replicates.
    fn launch(&self, work: &mut TileWork, queues: &mut [RayQueue], scene: MovingScene<'_>) {
        let last = self.spectrum.len() - 1;
        let tile = work.tile.clone();
        for (i, pixel) in tile.pixels().enumerate() {
            for set in i * REPLICATES..(i + 1) * REPLICATES {
                let point = work.points.get(set);
                let part = self.spectrum.partition_point(|part| part.end <= point.color).min(last);
                let queue = &mut queues[part];
                let at = work.frame.point(pixel, point.place);
                let Some((ray, origin)) = self.start(at, &point, part) else { continue };
                queue.rays.push(ray);
                queue.origins.push(RayOrigin { set, seconds: scene.1 * point.time, ..origin });
                if queue.origins.len() >= BATCH {
                    self.trace(work, queue, &self.spectrum[part], scene.0);
                }
            }
        }
    }

    /// The ray of a sample from a point of the image; `None` where it is dark.
    fn start(
        &self,
        [x, y]: [f64; 2],
        point: &SamplePoint,
        part: usize,
    ) -> Option<(Ray<f64>, RayOrigin)> {
        let radius = (x * x + y * y).sqrt();
        let DrawnDirection { cosines, area } = self.directions.draw(radius, point.direction)?;
        let [ex, ey] = if radius > 0.0 { [x / radius, y / radius] } else { [0.0, 1.0] };
        let [across, outwards] = cosines;
        let turned = [across * ey + outwards * ex, outwards * ey - across * ex];
        // The rays of all wavelengths start alike.
        let lens = self.lenses.first()?.get(self.spectrum[part].wavelengths[0])?;
        let (ray, share) = lens.ray([x, y], turned)?;
        let weight = area * share;
        Some((ray, RayOrigin { set: 0, weight, seconds: 0.0, radius, cosines }))
    }

    /// Traces the rays of a queue in every colour and adds their light.
    fn trace(
        &self,
        work: &mut TileWork,
        queue: &mut RayQueue,
        part: &SpectralPart,
        scene: &dyn Fn(&Ray<f64>, f64) -> Radiance,
    ) {
        let colors = self.colors();
        for (color, wavelength) in part.wavelengths.iter().enumerate() {
            let lens = &self.lenses[color][*wavelength];
            lens.trace(&queue.rays, &mut queue.landings);
            work.fates.add(queue.landings.fates());
            for (i, origin) in queue.origins.iter().enumerate() {
                if !queue.landings.fate(i).is_imaged() {
                    continue;
                }
                let radiance = scene(&lens.scene_ray(queue.landings.ray(i)), origin.seconds);
                let passed = self.losses.as_ref().map_or(1.0, |losses| {
                    losses.passed([color, *wavelength], origin.radius, origin.cosines)
                });
                let weight = origin.weight * lens.index_ratio * passed;
                work.sums[origin.set * colors + color] += weight * self.seen(radiance, color);
            }
        }
        queue.origins.clear();
        queue.rays.clear();
    }

    /// The radiance that a colour sees.
    fn seen(&self, radiance: Radiance, color: usize) -> f64 {
        if self.colors() == 3 { radiance[color] } else { luminance(radiance) }
    }

    /// Means and standard errors of the pixels of a tile.
    fn estimate(&self, work: &TileWork) -> SampledTile {
        let colors = self.colors();
        let mut sampled = SampledTile { fates: work.fates, ..SampledTile::default() };
        sampled.samples = work.fates.total();
        for pixel in work.sums.chunks(REPLICATES * colors) {
            let statistics = |color: usize| {
                let means: [f64; REPLICATES] =
                    std::array::from_fn(|r| pixel[r * colors + color] / work.count as f64);
                mean_with_error(means)
            };
            let colors: [(f64, f64); 3] = std::array::from_fn(|c| statistics(c.min(colors - 1)));
            sampled.values.push(colors.map(|(mean, _)| mean));
            sampled.errors.push(colors.map(|(_, error)| error));
        }
        sampled
    }
}

/// The seed of a set of samples (the finalizer of `MurmurHash3`).
fn set_seed(set: usize, seed: u32) -> u32 {
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
