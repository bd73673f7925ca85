//! Pictures by rays backwards: the definition of a pixel, sampled.
//!
//! The value of a pixel is the irradiance of the image averaged over its area: the integral of the
//! radiance of the scene over the area, the directions from which light arrives there, the wavelengths
//! of a colour and the time. Each sample is a ray from the pixel backwards through the lens, whose rims
//! clip it, into the scene. Samples are Owen-scrambled Sobol points (Burley, JCGT 9, 2020), in
//! [`REPLICATES`] sets that are independent of each other: their spread is the error of the mean. All
//! colours of a pixel share its points, so that grey stays grey.
//!
//! Tiles are sampled in groups until the error of a group is small enough. Those whose squared error falls
//! most for a ray get more samples first, so that an edge takes what an even wall leaves over.
//!
//! The seed of a pixel is its place, and tiles and groups are of a fixed size, so that a picture does not
//! depend on the number of threads.

use super::aimed_light::AimedLight;
use super::diffraction::{DiffractionLight, DiffractionReport};
use super::lit_directions::LitDirections;
use super::losses::{LensLosses, LightLosses, LossReport};
use super::pupil_spread::PupilSpreads;
use super::sample_points::LONGEST;
use super::scene::{Radiance, Scene};
use super::tile_sampler::{PictureTile, SampledTile, TileSampler, TileWork};
use super::{ColorBand, ImageFrame, Picture, PictureError};
use crate::analysis::irradiance;
use crate::lens::{Surface, SurfaceNumber};
use crate::pupil::{Accuracy, RayModel};
use crate::trace::Fates;
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The number of independent sets of samples.
pub const REPLICATES: usize = 4;
/// The side of a tile, in pixels.
pub(super) const TILE: usize = 16;
/// The number of tiles that share an error.
const GROUP: usize = 1024;
/// The samples of the first pass: at least so many for each replicate of a tile, so that its error is not
/// taken for nothing because no sample met what there is, and at least so many for each of its pixels.
const FIRST_OF_TILE: usize = 1024;
const FIRST: usize = 4;
/// The share of the squared error of a tile that twice the samples are expected to leave: between that of
/// independent samples and that of an even integrand.
const LEFT_BY_DOUBLING: f64 = 0.35;
/// The share of the work that the first pass is taken for.
const FIRST_SHARE: f64 = 0.1;
/// The reflectance of mid grey.
pub const MID_GREY: f64 = 0.18;
/// The number of rings of the image for which directions are tabulated.
pub(super) const RINGS: usize = 12;

/// The accuracy of a picture, and what it is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactSettings {
    /// The error that is asked for: root mean square over a group of tiles, as a share of mid grey, or of
    /// the pixel where that is brighter; a negative one takes all samples.
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
    sampler: TileSampler,
    /// The irradiance of a white card on the axis, or where the image is brightest.
    white: f64,
    /// The effect of diffraction; `None` if nobody asked.
    diffraction: Option<DiffractionReport>,
}

/// A picture of which some groups of tiles are sampled.
#[derive(Debug, Clone)]
pub struct PictureRun {
    picture: Picture,
    groups: usize,
}

/// A scene in front of a lens as any way of making pictures sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureSubject<'a> {
    pub(super) scene: &'a Scene,
    pub(super) frame: ImageFrame,
    /// The directions of light at the points of the image.
    pub(super) directions: &'a LitDirections,
    /// The shares of light that pass.
    pub(super) losses: Option<&'a LensLosses>,
    /// The irradiance of a white card on the axis.
    pub(super) white: f64,
    /// The spreads of light by diffraction.
    pub(super) spreads: Option<&'a PupilSpreads>,
    /// The rays that stand for all light of a point.
    pub(super) aimed: Option<&'a AimedLight>,
}

/// Asks whether to go on, and tells the share of the work that is done.
struct RenderWatch<'a> {
    progress: PictureProgress<'a>,
    /// The bits of the share.
    share: AtomicU64,
    stopped: AtomicBool,
}

impl<'a> RenderWatch<'a> {
    fn new(progress: PictureProgress<'a>) -> Self {
        Self { progress, share: AtomicU64::new(0), stopped: AtomicBool::new(false) }
    }

    /// Raises the share that is done.
    fn reach(&self, share: f64) {
        // Positive numbers are in the order of their bits.
        self.share.fetch_max(share.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    fn is_stopped(&self) -> bool {
        let share = f64::from_bits(self.share.load(Ordering::Relaxed));
        if !self.stopped.load(Ordering::Relaxed) && (self.progress)(share).is_break() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        self.has_stopped()
    }

    fn has_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

impl<'a> ExactRenderer<'a> {
    /// A scene seen through the lens of a model in some colours.
    ///
    /// # Errors
    /// A lens that is not centred, has apertures that are no circles, or cannot be traced backwards, or no light.
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
        if let Some(surface) = system.surfaces.iter().position(|own| !own.has_round_apertures()) {
            return Err(PictureError::NotRound(SurfaceNumber::new(surface)));
        }
        let directions = LitDirections::new(model, &outer(model, bands), frame.reach(), RINGS)?;
        let sampler = TileSampler::new(model, bands, directions)?;
        let white = brightest(model, frame.reach())?;
        Ok(Self { scene, frame, sampler, white, diffraction: None })
    }

    /// The same with what the surfaces of the lens reflect and its glasses absorb taken away, for the model and
    /// the colours of this renderer; one share for each colour where it varies by less than a tolerance.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones.
    pub fn with_losses(
        mut self,
        model: &RayModel,
        bands: &[ColorBand],
        taken: LightLosses<'_>,
        tolerance: f64,
    ) -> Result<Self, PictureError> {
        let light = (&self.sampler.directions, self.frame.reach());
        let losses = LensLosses::new(model, bands, light, (taken, tolerance))?;
        self.white *= losses.report.transmission;
        self.sampler.losses = Some(losses);
        Ok(self)
    }

    /// The same with diffraction put in where it changes contrast by more than a tolerance, for the model and the
    /// colours of this renderer; the report says what is left out.
    ///
    /// # Errors
    /// A lens that cannot be traced backwards.
    pub fn with_diffraction(
        mut self,
        model: &RayModel,
        bands: &[ColorBand],
        tolerance: f64,
    ) -> Result<Self, PictureError> {
        let light = (self.directions(), &outer(model, bands)[..]);
        let found =
            DiffractionLight::new((model, bands), &self.frame, light, (tolerance, self.scene))?;
        if let Some((directions, spreads)) = found.parts {
            self.sampler.directions = directions;
            self.sampler.spreads = Some(spreads);
        }
        self.diffraction = Some(found.report);
        Ok(self)
    }

    /// The same without blur: all light of a point follows its chief ray, for the model and the colours of this
    /// renderer. Unchanged where a chief ray is not known.
    #[must_use]
    pub fn without_blur(mut self, model: &RayModel, bands: &[ColorBand]) -> Self {
        self.sampler.sharp = AimedLight::new(model, bands, self.frame.reach());
        self
    }

    /// The number of rings of the image whose directions of light are told apart: one where vignetting and obliquity
    /// hardly change them.
    pub fn rings(&self) -> usize {
        self.directions().rings()
    }

    /// True if all light of a point follows one ray.
    pub fn is_sharp(&self) -> bool {
        self.sampler.sharp.is_some()
    }

    /// The effect of diffraction on the picture, if that was asked for.
    pub fn diffraction(&self) -> Option<&DiffractionReport> {
        self.diffraction.as_ref()
    }

    /// The losses at the surfaces and in the glasses of the lens, if they are in the picture.
    pub fn losses(&self) -> Option<&LossReport> {
        self.loss_table().map(|losses| &losses.report)
    }

    /// The shares of light that pass.
    fn loss_table(&self) -> Option<&LensLosses> {
        self.sampler.losses.as_ref()
    }

    /// The irradiance of a white card on the axis, or where the image is brightest if that is dark.
    pub fn white(&self) -> f64 {
        self.white * self.scene.white
    }

    /// The directions of light at the points of the image.
    fn directions(&self) -> &LitDirections {
        &self.sampler.directions
    }

    pub(super) const fn frame(&self) -> ImageFrame {
        self.frame
    }

    pub(super) const fn sampler(&self) -> &TileSampler {
        &self.sampler
    }

    /// The scene and the light of the pictures.
    pub(super) fn subject(&self) -> PictureSubject<'_> {
        PictureSubject {
            scene: self.scene,
            frame: self.frame,
            directions: self.directions(),
            losses: self.loss_table(),
            white: self.white(),
            spreads: self.sampler.spreads.as_ref(),
            aimed: self.sampler.aimed(),
        }
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
        self.resume(&mut self.begin(), settings, progress)
    }

    /// A picture of which nothing is sampled.
    pub fn begin(&self) -> PictureRun {
        PictureRun { picture: self.black(), groups: 0 }
    }

    /// The picture from where a run of it was ended early, with the same settings: to the bit as if it never was.
    pub fn resume(
        &self,
        run: &mut PictureRun,
        settings: &ExactSettings,
        progress: PictureProgress<'_>,
    ) -> Picture {
        let tiles = self.tiles();
        let watch = RenderWatch::new(progress);
        for group in tiles.chunks(GROUP).skip(run.groups) {
            let part = |share: f64| {
                ((run.groups * GROUP) as f64 + share * group.len() as f64) / tiles.len() as f64
            };
            let sampled = self.sample_group(group, settings, &watch, &part);
            if watch.has_stopped() {
                // Shown as far as it is, and sampled anew when the run goes on.
                let mut shown = run.picture.clone();
                self.add(&mut shown, group, sampled, settings.tolerance);
                return Picture { complete: false, reached: false, ..shown };
            }
            self.add(&mut run.picture, group, sampled, settings.tolerance);
            run.groups += 1;
        }
        run.picture.clone()
    }

    fn black(&self) -> Picture {
        let [columns, rows] = self.frame.pixels;
        Picture {
            frame: self.frame,
            values: vec![[0.0; 3]; columns * rows],
            errors: vec![[0.0; 3]; columns * rows],
            white: self.white(),
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete: true,
            overshoot: self.directions().overshoot,
        }
    }

    /// Adds the tiles of a group to a picture.
    fn add(
        &self,
        picture: &mut Picture,
        tiles: &[PictureTile],
        sampled: Vec<Option<SampledTile>>,
        tolerance: f64,
    ) {
        let columns = self.frame.pixels[0];
        let (mut square, mut pixels) = (0.0, 0);
        for (tile, sampled) in tiles.iter().zip(sampled) {
            let Some(sampled) = sampled else {
                picture.complete = false;
                continue;
            };
            square += self.squared_error(&sampled);
            pixels += tile.len();
            picture.fates.add(sampled.fates);
            picture.rays += sampled.samples;
            for (i, [column, row]) in tile.pixels().enumerate() {
                picture.values[row * columns + column] = sampled.values[i];
                picture.errors[row * columns + column] = sampled.errors[i];
            }
        }
        picture.reached &= square <= pixels as f64 * tolerance * tolerance.abs();
    }

    /// Samples a tile until its error is small enough.
    pub(super) fn sample_tile(&self, tile: &PictureTile, settings: &ExactSettings) -> SampledTile {
        let watch = RenderWatch::new(&|_| ControlFlow::Continue(()));
        let found = self.sample_group(std::slice::from_ref(tile), settings, &watch, &|share| share);
        found.into_iter().flatten().next().unwrap_or_default()
    }

    /// Samples the tiles of a group until their common error is small enough. Once that is stopped, each as
    /// it was after the last of its passes that ended; `None` if there is none.
    fn sample_group(
        &self,
        tiles: &[PictureTile],
        settings: &ExactSettings,
        watch: &RenderWatch<'_>,
        part: &(dyn Fn(f64) -> f64 + Sync),
    ) -> Vec<Option<SampledTile>> {
        let most = (settings.max_samples / REPLICATES).clamp(1, LONGEST);
        let start =
            |tile: &PictureTile| self.sampler.begin(&self.frame, tile.clone(), settings.seed);
        let mut works: Vec<TileWork> = tiles.par_iter().map(start).collect();
        let wanted = {
            let pixels: usize = tiles.iter().map(PictureTile::len).sum();
            pixels as f64 * settings.tolerance * settings.tolerance.abs()
        };
        let mut chosen = vec![true; works.len()];
        while chosen.contains(&true) {
            let pass = |(work, _): (&mut TileWork, &bool)| {
                let first = FIRST.max(FIRST_OF_TILE / work.tile.len().max(1));
                let count = if work.count == 0 { first } else { 2 * work.count };
                let scene = (self.scene, settings.seconds);
                self.sampler.sample(work, count.min(most), scene, &|| watch.is_stopped())
            };
            let some = works.par_iter_mut().zip(&chosen).filter(|(_, is_chosen)| **is_chosen);
            if !some.map(pass).all(|ended| ended) {
                break;
            }
            let squares: Vec<f64> =
                works.iter().map(|work| self.squared_error(&work.sampled)).collect();
            let share = (wanted / squares.iter().sum::<f64>()).max(0.0).powf(2.0 / 3.0).min(1.0);
            watch.reach(part(FIRST_SHARE + (1.0 - FIRST_SHARE) * share));
            chosen = worst(&works, &squares, wanted, most);
        }
        works.into_iter().map(|work| (work.count > 0).then_some(work.sampled)).collect()
    }

    /// The sum over the pixels of a tile of the squared errors as a share of mid grey, or of the pixel where
    /// that is brighter; the mean over its colours.
    fn squared_error(&self, tile: &SampledTile) -> f64 {
        let rms = relative_rms(&tile.values, &tile.errors, MID_GREY * self.white());
        tile.values.len() as f64 * rms * rms
    }
}

/// The tiles that need twice the samples for a sum of squared errors, those first whose error falls most for
/// a ray; none if the sum is reached, or if no tile can have more.
fn worst(works: &[TileWork], squares: &[f64], wanted: f64, most: usize) -> Vec<bool> {
    let mut chosen = vec![false; works.len()];
    let mut rest: f64 = squares.iter().sum();
    if rest <= wanted {
        return chosen;
    }
    let gain = |i: &usize| squares[*i] / (works[*i].count * works[*i].tile.len().max(1)) as f64;
    let mut order: Vec<usize> = (0..works.len()).filter(|i| works[*i].count < most).collect();
    order.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    for i in order {
        chosen[i] = true;
        rest -= (1.0 - LEFT_BY_DOUBLING) * squares[i];
        if rest <= wanted {
            break;
        }
    }
    chosen
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
    gray_rms(values.as_flattened(), errors.as_flattened(), grey)
}

/// The same of values without colours.
pub(super) fn gray_rms(values: &[f64], errors: &[f64], grey: f64) -> f64 {
    let pairs = values.iter().zip(errors);
    let squares: f64 = pairs.map(|(value, error)| (error / value.max(grey)).powi(2)).sum();
    (squares / values.len().max(1) as f64).sqrt()
}

/// The luminance of a colour of sRGB's primaries (IEC 61966-2-1).
pub(super) fn luminance([red, green, blue]: Radiance) -> f64 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The wavelengths whose light the others lie between: the shortest, the longest and a middle one.
pub(super) fn outer(model: &RayModel, bands: &[ColorBand]) -> Vec<usize> {
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

    /// Tiles of other sizes have the same values but for rounding: other rays share the lanes of a processor.
    #[test]
    fn a_pixel_depends_on_its_tile_by_rounding_alone() {
        let lens = crate::files::open(std::path::Path::new("lenses/double_gauss_rudolph_50.json"));
        let coloring = crate::picture::Coloring::Rgb(3);
        let (model, bands) =
            crate::picture::picture_model(&lens.unwrap().lens, 0, coloring).unwrap();
        let frame = ImageFrame::new(&model, [40, 16], 30.0).unwrap();
        let scene = crate::picture::BuiltInScene::Star.build(&model, &frame, None).unwrap();
        let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let settings =
            ExactSettings { tolerance: -1.0, max_samples: 32, ..ExactSettings::default() };
        let sampled = |columns: Range<usize>, rows: Range<usize>| {
            let tile = PictureTile::new(columns, rows);
            let found = renderer.sample_tile(&tile, &settings);
            // As many samples for every size: a small tile begins with more.
            assert_eq!(found.samples, tile.len() * 32 * 3);
            tile.pixels().zip(found.values).collect::<Vec<_>>()
        };
        let whole = sampled(16..32, 0..16);
        for side in [4, 8] {
            for i in 0..(16 / side) * (16 / side) {
                let [x, y] = [i % (16 / side), i / (16 / side)].map(|v| v * side);
                for part in sampled(16 + x..16 + x + side, y..y + side) {
                    let (_, same) = whole.iter().find(|(pixel, _)| *pixel == part.0).unwrap();
                    let mut pairs = part.1.iter().zip(same);
                    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 4.0 * f64::EPSILON * b;
                    assert!(pairs.all(is_near), "{part:?}");
                }
            }
        }
    }

    #[test]
    fn errors_count_against_mid_grey_or_the_brighter_pixel() {
        let rms = relative_rms(&[[0.0; 3], [2.0; 3]], &[[0.1; 3], [0.2; 3]], 1.0);
        assert!((rms - 0.1).abs() < 1e-15, "{rms}");
    }
}
