//! Pictures by rays backwards: the definition of a pixel, sampled.
//!
//! The value of a pixel is the irradiance of the image averaged over its area: the integral of the
//! radiance of the scene over the area, the directions from which light arrives there, the wavelengths
//! of a colour and the time. Each sample is a ray from the pixel backwards through the lens, whose rims
//! clip it, into the scene. Samples are Owen-scrambled Sobol points (Burley, JCGT 9, 2020), in
//! [`REPLICATES`] sets that are independent of each other: their spread is the error of the mean. A tile
//! is sampled until its error is small enough. All colours of a pixel share its points, so that grey stays
//! grey.
//!
//! The seed of a pixel is its place, and tiles are of a fixed size, so that a picture does not depend on
//! the number of threads.

use super::lit_directions::LitDirections;
use super::losses::{LensLosses, LossReport};
use super::scene::{Radiance, Scene};
use super::{ColorBand, ImageFrame, Picture, PictureError};
use crate::analysis::{BackwardLens, Coating, irradiance};
use crate::lens::{Surface, SurfaceNumber};
use crate::pupil::{Accuracy, RayModel};
use crate::trace::{Fates, Landings, Rays, TraceSink as _};
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The number of independent sets of samples.
pub const REPLICATES: usize = 4;
/// The side of a tile, in pixels.
const TILE: usize = 16;
/// The samples of the first pass: at least so many for each replicate of a tile, so that its error is not
/// taken for nothing because no sample met what there is, and at least so many for each of its pixels.
const FIRST_OF_TILE: usize = 1024;
const FIRST: usize = 4;
/// The largest number of samples of a replicate: the length of the Sobol sequence.
const LONGEST: usize = 1 << 16;
/// The number of rays that are traced together.
const BATCH: usize = 2048;
/// The reflectance of mid grey.
pub const MID_GREY: f64 = 0.18;
/// The number of rings of the image for which directions are tabulated.
const RINGS: usize = 12;

/// The accuracy of a picture, and what it is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactSettings {
    /// The error that is asked for, as a share of mid grey, or of the pixel where that is brighter; a
    /// negative one takes all samples.
    pub tolerance: f64,
    /// The largest number of samples of a pixel.
    pub max_samples: usize,
    /// The seed of the samples.
    pub seed: u32,
    /// The time during which the scene moves, in seconds.
    pub seconds: f64,
}

impl Default for ExactSettings {
    fn default() -> Self {
        Self { tolerance: 0.01, max_samples: 4096, seed: 0, seconds: 0.0 }
    }
}

/// Told the share of the work that is done; ends it early.
pub type PictureProgress<'a> = &'a (dyn Fn(f64) -> ControlFlow<()> + Sync);

/// A scene in front of a lens, ready to be sampled.
#[derive(Debug)]
pub struct ExactRenderer<'a> {
    scene: &'a Scene,
    frame: ImageFrame,
    bands: Vec<BackwardBand>,
    directions: LitDirections,
    /// The light that surfaces reflect; `None` if they let all light pass.
    losses: Option<LensLosses>,
    /// The irradiance of a white card on the axis, or where the image is brightest.
    white: f64,
}

/// A colour: lenses at its wavelengths, each with the sum of the shares up to it.
#[derive(Debug)]
struct BackwardBand {
    lenses: Vec<(f64, BackwardLens)>,
}

impl BackwardBand {
    fn new(model: &RayModel, band: &ColorBand) -> Result<Self, PictureError> {
        let mut sum = 0.0;
        let lens = |(wavelength, share): &(usize, f64)| {
            sum += share;
            Ok((sum, BackwardLens::new(model, *wavelength)?))
        };
        Ok(Self { lenses: band.wavelengths.iter().map(lens).collect::<Result<_, PictureError>>()? })
    }

    /// The index of the lens for a number from 0 to 1.
    fn choose(&self, unit: f64) -> usize {
        self.lenses.partition_point(|(sum, _)| *sum <= unit).min(self.lenses.len() - 1)
    }
}

/// Rays of one colour and wavelength that wait to be traced.
#[derive(Debug, Default)]
struct RayQueue {
    rays: Rays<f64>,
    /// The place of each ray's light in the sums, its weight, and its time in seconds.
    slots: Vec<(u32, f64, f64)>,
    landings: Landings<f64>,
}

/// The light of the samples of a tile.
#[derive(Debug)]
struct TileSums {
    /// By pixel, replicate and colour.
    sums: Vec<f64>,
    fates: Fates,
    queues: Vec<Vec<RayQueue>>,
}

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
    errors: Vec<Radiance>,
    pub(super) samples: usize,
    fates: Fates,
    reached: bool,
}

impl<'a> ExactRenderer<'a> {
    /// A scene seen through the lens of a model in some colours.
    ///
    /// # Errors
    /// A lens that is not centred or cannot be traced backwards, or no light.
    pub fn new(
        model: &RayModel,
        bands: &[ColorBand],
        scene: &'a Scene,
        frame: ImageFrame,
    ) -> Result<Self, PictureError> {
        let system = &model.channels[model.primary].system;
        if let Some(surface) = system.surfaces.iter().position(Surface::is_mounted) {
            return Err(PictureError::NotCentred(SurfaceNumber::new(surface)));
        }
        let backward = bands.iter().map(|band| BackwardBand::new(model, band));
        let bands_of = backward.collect::<Result<_, _>>()?;
        let directions = LitDirections::new(model, &outer(model, bands), frame.reach(), RINGS)?;
        let white = brightest(model, frame.reach())?;
        Ok(Self { scene, frame, bands: bands_of, directions, losses: None, white })
    }

    /// The same with what the surfaces of the lens reflect taken away, for the model and the colours of
    /// this renderer; one share for each colour where it varies by less than a tolerance.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones.
    pub fn with_losses(
        mut self,
        model: &RayModel,
        bands: &[ColorBand],
        coating: Coating,
        tolerance: f64,
    ) -> Result<Self, PictureError> {
        let light = (&self.directions, self.frame.reach());
        let losses = LensLosses::new(model, bands, light, (coating, tolerance))?;
        self.white *= losses.report.transmission;
        self.losses = Some(losses);
        Ok(self)
    }

    /// The losses at the surfaces of the lens, if they are in the picture.
    pub fn losses(&self) -> Option<&LossReport> {
        self.losses.as_ref().map(|losses| &losses.report)
    }

    /// The shares of light that pass.
    pub(super) fn loss_table(&self) -> Option<&LensLosses> {
        self.losses.as_ref()
    }

    /// The irradiance of a white card on the axis, or where the image is brightest if that is dark.
    pub fn white(&self) -> f64 {
        self.white * self.scene.white
    }

    /// The directions of light at the points of the image.
    pub(super) fn directions(&self) -> &LitDirections {
        &self.directions
    }

    /// The scene, the frame and the number of colours.
    pub(super) fn subject(&self) -> (&'a Scene, ImageFrame, usize) {
        (self.scene, self.frame, self.bands.len())
    }

    /// The tiles of the picture, row by row.
    pub(super) fn tiles(&self) -> Vec<PictureTile> {
        let [columns, rows] = self.frame.pixels;
        let cut =
            |count: usize| (0..count).step_by(TILE).map(move |from| from..(from + TILE).min(count));
        let tile = |(rows, columns)| PictureTile::new(columns, rows);
        let of_rows = |rows: Range<usize>| cut(columns).map(move |columns| (rows.clone(), columns));
        cut(rows).flat_map(of_rows).map(tile).collect()
    }

    /// The picture; what is missing when the work is ended early stays black, and the picture says so.
    pub fn render(&self, settings: &ExactSettings, progress: PictureProgress<'_>) -> Picture {
        let tiles = self.tiles();
        let (done, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        let is_stopped = || {
            let share = done.load(Ordering::Relaxed) as f64 / tiles.len() as f64;
            stopped.fetch_or(progress(share).is_break(), Ordering::Relaxed);
            stopped.load(Ordering::Relaxed)
        };
        let work = |tile: &PictureTile| {
            let sampled = self.sample_tile_until(tile, settings, &is_stopped);
            done.fetch_add(1, Ordering::Relaxed);
            sampled
        };
        let sampled: Vec<_> = tiles.par_iter().map(work).collect();
        self.assemble(&tiles, sampled)
    }

    fn assemble(&self, tiles: &[PictureTile], sampled: Vec<Option<SampledTile>>) -> Picture {
        let [columns, rows] = self.frame.pixels;
        let mut picture = Picture {
            frame: self.frame,
            values: vec![[0.0; 3]; columns * rows],
            errors: vec![[0.0; 3]; columns * rows],
            white: self.white(),
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete: true,
            overshoot: self.directions.overshoot,
        };
        for (tile, sampled) in tiles.iter().zip(sampled) {
            let Some(sampled) = sampled else {
                picture.complete = false;
                continue;
            };
            picture.reached &= sampled.reached;
            picture.fates.add(sampled.fates);
            picture.rays += sampled.samples;
            for (i, [column, row]) in tile.pixels().enumerate() {
                picture.values[row * columns + column] = sampled.values[i];
                picture.errors[row * columns + column] = sampled.errors[i];
            }
        }
        picture.reached &= picture.complete;
        picture
    }

    /// Samples a tile until its error is small enough.
    pub(super) fn sample_tile(&self, tile: &PictureTile, settings: &ExactSettings) -> SampledTile {
        self.sample_tile_until(tile, settings, &|| false).unwrap_or_default()
    }

    /// The same, each pass doubles the samples. Once `is_stopped` is true, that of the
    /// passes that have ended; `None` if there is none.
    fn sample_tile_until(
        &self,
        tile: &PictureTile,
        settings: &ExactSettings,
        is_stopped: &dyn Fn() -> bool,
    ) -> Option<SampledTile> {
        let most = (settings.max_samples / REPLICATES).clamp(1, LONGEST);
        let first = FIRST.max(FIRST_OF_TILE / tile.len().max(1));
        let queues =
            |band: &BackwardBand| band.lenses.iter().map(|_| RayQueue::default()).collect();
        let mut sums = TileSums {
            sums: vec![0.0; tile.len() * REPLICATES * self.bands.len()],
            fates: Fates::default(),
            queues: self.bands.iter().map(queues).collect(),
        };
        let (mut from, mut to) = (0, first.min(most));
        let mut ended = None;
        while self.sample(tile, from..to, settings, &mut sums, is_stopped) {
            let mut sampled = self.estimate(&sums, to);
            sampled.reached = self.rms_error(&sampled) <= settings.tolerance;
            if sampled.reached || to >= most {
                return Some(sampled);
            }
            ended = Some(sampled);
            (from, to) = (to, (2 * to).min(most));
        }
        ended
    }

    /// Samples the pixels of a tile; false if that was stopped.
    fn sample(
        &self,
        tile: &PictureTile,
        samples: Range<usize>,
        settings: &ExactSettings,
        sums: &mut TileSums,
        is_stopped: &dyn Fn() -> bool,
    ) -> bool {
        for (i, pixel) in tile.pixels().enumerate() {
            if is_stopped() {
                return false;
            }
            for replicate in 0..REPLICATES {
                let seed = self.seed(pixel, replicate, settings.seed);
                let slot = (i * REPLICATES + replicate) * self.bands.len();
                for sample in samples.clone() {
                    self.launch(pixel, (sample as u32, seed), slot, settings.seconds, sums);
                }
            }
        }
        for band in 0..self.bands.len() {
            (0..self.bands[band].lenses.len()).for_each(|lens| self.flush(sums, band, lens));
        }
        true
    }

    /// The seed of a replicate of a pixel (the finalizer of `MurmurHash3`).
    fn seed(&self, [column, row]: [usize; 2], replicate: usize, seed: u32) -> u32 {
        let place = (row * self.frame.pixels[0] + column) * REPLICATES + replicate;
        let mut hash = (place as u32) ^ seed.wrapping_mul(0x9E37_79B9);
        hash = (hash ^ (hash >> 16)).wrapping_mul(0x85EB_CA6B);
        hash = (hash ^ (hash >> 13)).wrapping_mul(0xC2B2_AE35);
        hash ^ (hash >> 16)
    }

    /// Queues the rays of a sample, one for each colour.
    fn launch(
        &self,
        pixel: [usize; 2],
        (index, seed): (u32, u32),
        slot: usize,
        seconds: f64,
        sums: &mut TileSums,
    ) {
        let [right, down, u, v] = sobol_burley::sample_4d(index, 0, seed).map(f64::from);
        let [x, y] = self.frame.point(pixel, [right, down]);
        let radius = x.hypot(y);
        let Some(drawn) = self.directions.draw(radius, [u, v]) else { return };
        let [across, outwards] = drawn.cosines;
        let [ex, ey] = if radius > 0.0 { [x / radius, y / radius] } else { [0.0, 1.0] };
        let cosines = [across * ey + outwards * ex, outwards * ey - across * ex];
        let [color, time, ..] = sobol_burley::sample_4d(index, 1, seed).map(f64::from);
        for (band, color_band) in self.bands.iter().enumerate() {
            let chosen = color_band.choose(color);
            let lens = &color_band.lenses[chosen].1;
            let Some((ray, share)) = lens.ray([x, y], cosines) else { continue };
            let queue = &mut sums.queues[band][chosen];
            queue.rays.push(ray);
            let passed = self
                .losses
                .as_ref()
                .map_or(1.0, |losses| losses.passed([band, chosen], radius, drawn.cosines));
            let weight = drawn.area * share * lens.index_ratio * passed;
            queue.slots.push(((slot + band) as u32, weight, time * seconds));
            if queue.slots.len() >= BATCH {
                self.flush(sums, band, chosen);
            }
        }
    }

    /// Traces the rays of a queue and adds their light.
    fn flush(&self, sums: &mut TileSums, band: usize, lens: usize) {
        let backward = &self.bands[band].lenses[lens].1;
        let queue = &mut sums.queues[band][lens];
        backward.trace(&queue.rays, &mut queue.landings);
        sums.fates.add(queue.landings.fates());
        for (i, (slot, weight, seconds)) in queue.slots.iter().enumerate() {
            if queue.landings.fate(i).is_imaged() {
                let ray = backward.scene_ray(queue.landings.ray(i));
                let radiance = self.scene.radiance(&ray, *seconds);
                sums.sums[*slot as usize] += weight * self.seen(radiance, band);
            }
        }
        queue.slots.clear();
        queue.rays.clear();
    }

    /// The radiance that a colour sees.
    fn seen(&self, radiance: Radiance, band: usize) -> f64 {
        if self.bands.len() == 3 { radiance[band] } else { luminance(radiance) }
    }

    /// Means and standard errors of the pixels of a tile after `count` samples of each replicate.
    fn estimate(&self, tile: &TileSums, count: usize) -> SampledTile {
        let bands = self.bands.len();
        let mut sampled = SampledTile { fates: tile.fates, ..SampledTile::default() };
        sampled.samples = tile.fates.total();
        for pixel in tile.sums.chunks(REPLICATES * bands) {
            let statistics = |band: usize| {
                let means: [f64; REPLICATES] =
                    std::array::from_fn(|r| pixel[r * bands + band] / count as f64);
                mean_with_error(means)
            };
            let colors: [(f64, f64); 3] = std::array::from_fn(|c| statistics(c.min(bands - 1)));
            sampled.values.push(colors.map(|(mean, _)| mean));
            sampled.errors.push(colors.map(|(_, error)| error));
        }
        sampled
    }

    fn rms_error(&self, tile: &SampledTile) -> f64 {
        relative_rms(&tile.values, &tile.errors, MID_GREY * self.white())
    }
}

/// The mean of replicates and its standard error.
pub(super) fn mean_with_error(values: [f64; REPLICATES]) -> (f64, f64) {
    let count = REPLICATES as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (square / (count * (count - 1.0))).sqrt())
}

/// The root mean square of errors, each over mid grey, or over its value where that is brighter.
pub(super) fn relative_rms(values: &[Radiance], errors: &[Radiance], grey: f64) -> f64 {
    let pairs = values.iter().flatten().zip(errors.iter().flatten());
    let squares: f64 = pairs.map(|(value, error)| (error / value.max(grey)).powi(2)).sum();
    (squares / (3 * values.len().max(1)) as f64).sqrt()
}

/// The luminance of a colour of sRGB's primaries (IEC 61966-2-1).
pub(super) fn luminance([red, green, blue]: Radiance) -> f64 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The wavelengths whose light the others lie between: the shortest, the longest and a middle one.
fn outer(model: &RayModel, bands: &[ColorBand]) -> Vec<usize> {
    let all = bands.iter().flat_map(|band| &band.wavelengths).map(|(wavelength, _)| *wavelength);
    let mut all: Vec<usize> = all.collect();
    all.sort_by(|a, b| model.channels[*a].um.total_cmp(&model.channels[*b].um));
    all.dedup();
    let mut chosen = vec![0, all.len() / 2, all.len() - 1];
    chosen.dedup();
    chosen.into_iter().map(|i| all[i]).collect()
}

/// The irradiance for radiance 1 on the axis, or else at the brightest of some other points.
fn brightest(model: &RayModel, reach: f64) -> Result<f64, PictureError> {
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let at = |part: f64| irradiance(model, model.primary, [0.0, part * reach], accuracy).ok();
    let axis = at(0.0).map(|found| found.value);
    let found = axis.or_else(|| {
        let others = (1..=8).filter_map(|i| at(f64::from(i) / 8.0));
        others.map(|found| found.value).reduce(f64::max)
    });
    found.filter(|value| *value > 0.0).ok_or(PictureError::NoLight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_mean_is_its_standard_error() {
        assert_eq!(mean_with_error([2.0; 4]), (2.0, 0.0));
        let (mean, error) = mean_with_error([1.0, 2.0, 3.0, 4.0]);
        assert!((mean - 2.5).abs() < 1e-15 && (error - (5.0_f64 / 12.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn errors_count_against_mid_grey_or_the_brighter_pixel() {
        let rms = relative_rms(&[[0.0; 3], [2.0; 3]], &[[0.1; 3], [0.2; 3]], 1.0);
        assert!((rms - 0.1).abs() < 1e-15, "{rms}");
    }
}
