//! Light of a picture: the way that makes it, the effects that are in it, and what each uses of the tolerance.

use super::effects::ColorChoice;
use super::scene::{SceneSource, scene_error};
use super::{CameraShot, PictureArgs};
use crate::analysis::Estimate;
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::cli::output::print_note;
use crate::cli::progress::{ProgressNotes, progress_bar};
use crate::measure::time_ms;
use crate::picture::{
    DiffractionReport, ErrorMap, ExactRenderer, ExactSettings, GateSubject, GhostLight,
    GhostReport, LightLosses, LossReport, MID_GREY, Picture, PictureError, PictureGate,
    QuickPicture, QuickRenderer, Scene, SceneFileError, ToleranceSplit, tile_change,
};
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The tiles on which the quick way is compared with the exact one, and the samples of their pixels.
const CHECKED_TILES: usize = 24;
const CHECKED_SAMPLES: usize = 128;
/// The samples of a pixel for the map of the error.
const MAPPED_SAMPLES: usize = 64;
/// The tiles on which numbers of wavelengths are compared, and the samples of their pixels.
pub(super) const TILES: (usize, usize) = (3, 32);
/// The numbers of wavelengths of a colour: none of its own, one, and then each the double of the one before less
/// one.
const WAVELENGTH_COUNTS: [usize; 5] = [0, 1, 3, 5, 9];
/// The place of the number for a picture that nothing was compared for, and of the first with coatings.
const USUAL: usize = 2;
/// The number of steps of the progress bar.
const STEPS: usize = 1000;

/// The effects that share the tolerance.
const SAMPLING: &str = "sampling";
const DIFFRACTION: &str = "diffraction";
const WAVELENGTHS: &str = "wavelengths";
const BLUR: &str = "blur";
const LOSSES: &str = "losses";
const GHOSTS: &str = "ghosts";

/// A picture with its error.
pub(super) struct RenderedPicture {
    pub(super) picture: Picture,
    /// The error by sampling, or of the quick way: as a share of mid grey, or of the pixel where that is brighter;
    /// with the milliseconds of the picture without its preparation and its error where it is made the quick way.
    pub(super) sampling: Estimate,
    /// The errors of all effects.
    pub(super) split: ToleranceSplit,
    pub(super) way: &'static str,
    /// The name of the graphics card that made it; `None` for the processor.
    pub(super) device: Option<String>,
    pub(super) error_map: Option<ErrorMap>,
    pub(super) diffraction: Option<DiffractionReport>,
    pub(super) losses: Option<LossReport>,
    /// With the time in milliseconds.
    pub(super) ghosts: Option<(GhostReport, f64)>,
    /// The wavelengths of a colour; `None` in grey.
    pub(super) colors: Option<ColorChoice>,
    /// True if blur is left out.
    pub(super) is_sharp: bool,
    /// The number of rings of the image whose directions of light are told apart.
    pub(super) rings: usize,
    /// Every effect, if that is asked for.
    pub(super) gates: Option<Vec<PictureGate>>,
}

/// Light by one of both ways.
struct PictureLight {
    picture: Picture,
    sampling: Estimate,
    way: &'static str,
    device: Option<String>,
}

impl RenderedPicture {
    fn new(light: PictureLight, split: ToleranceSplit) -> Self {
        let PictureLight { picture, sampling, way, device } = light;
        Self {
            picture,
            sampling,
            split,
            way,
            device,
            error_map: None,
            diffraction: None,
            losses: None,
            ghosts: None,
            colors: None,
            is_sharp: false,
            rings: 0,
            gates: None,
        }
    }
}

impl PictureArgs {
    pub(super) fn render(
        &self,
        opened: &LoadedLens,
        source: &SceneSource,
        stop: &AtomicBool,
    ) -> Result<(RenderedPicture, CameraShot), CliError> {
        let refuse = |error: PictureError| self.refuse(opened, &error);
        let mut split = self.split();
        let shot = self.shot(opened, source, WAVELENGTH_COUNTS[USUAL]).map_err(refuse)?;
        let scene = self.scene(source, &shot).map_err(|error| match error {
            SceneFileError::Picture(error) => refuse(error),
            other => scene_error(other),
        })?;
        let scene = self.sized(scene)?;
        let chosen = self.colors(opened, (source, &scene), shot, &mut split).map_err(refuse)?;
        let (shot, colors) = chosen;
        // What moves by less than can be seen needs no samples of the time.
        let is_moving = self.is_moving(&shot, &scene);
        let seconds = self.exposed.seconds.filter(|_| is_moving).unwrap_or(0.0);
        let renderer = self.renderer(&shot, &scene, opened, &mut split).map_err(refuse)?;
        let light = self.light(&shot, (&renderer, seconds), &mut split, stop).map_err(refuse)?;
        let is_stopped = || stop.load(Ordering::Relaxed);
        let map = || {
            let samples = ((usize::MAX, MAPPED_SAMPLES), seconds);
            ErrorMap::of_exposure(&renderer, &light.picture, samples, is_stopped)
        };
        // A part is no map.
        let error_map = self.error_map.as_ref().map(|_| map()).filter(ErrorMap::is_whole);
        let mut rendered = RenderedPicture {
            error_map,
            diffraction: renderer.diffraction().cloned(),
            losses: renderer.losses().cloned(),
            colors,
            is_sharp: renderer.is_sharp(),
            rings: renderer.rings(),
            ..RenderedPicture::new(light, split)
        };
        if !is_stopped() {
            self.add_ghosts(&mut rendered, &shot, &scene).map_err(refuse)?;
        }
        if self.effects && !is_stopped() {
            let gates = self.effect_table(&rendered, (&shot, &scene, source), opened);
            rendered.gates = Some(gates.map_err(refuse)?);
        }
        if !rendered.picture.complete {
            print_note("note: stopped; what was not sampled is black");
        } else if is_stopped() {
            print_note("note: stopped; an error map, ghosts or an exact picture may be missing");
        }
        Ok((rendered, shot))
    }

    /// The tolerance, split over what may be wrong.
    fn split(&self) -> ToleranceSplit {
        let all = [
            (SAMPLING, true),
            (DIFFRACTION, true),
            (WAVELENGTHS, !self.gray),
            (LOSSES, self.coating.is_some()),
            (GHOSTS, self.coating.is_some()),
        ];
        let effects: Vec<&str> =
            all.iter().filter(|(_, is_on)| *is_on).map(|(name, _)| *name).collect();
        ToleranceSplit::new(self.error.0, &effects)
    }

    /// The lens at as few wavelengths as are enough: about twice as many change some tiles by less than the
    /// share of the tolerance.
    fn colors(
        &self,
        opened: &LoadedLens,
        (source, scene): (&SceneSource, &Scene),
        usual: CameraShot,
        split: &mut ToleranceSplit,
    ) -> Result<(CameraShot, Option<ColorChoice>), PictureError> {
        if self.gray {
            return Ok((usual, None));
        }
        let mut chosen = None;
        // Coatings and glasses change light with the wavelength as well.
        let least = if self.coating.is_some() { USUAL } else { 0 };
        for pair in WAVELENGTH_COUNTS.windows(2).skip(least) {
            let [few, many] = [pair[0], pair[1]].map(|count| self.shot(opened, source, count));
            let (few, many) = (few?, many?);
            let renderer =
                |shot: &CameraShot| ExactRenderer::new(&shot.model, &shot.bands, scene, shot.frame);
            let change = tile_change([&renderer(&many)?, &renderer(&few)?], [0.0; 2], TILES);
            let choice = ColorChoice { count: pair[0], compared: pair[1], change };
            split.note(WAVELENGTHS, change);
            let is_enough = change <= split.allowed();
            chosen = Some((few, Some(choice)));
            if is_enough {
                break;
            }
        }
        Ok(chosen.unwrap_or((usual, None)))
    }

    /// True if something moves by as much as can be seen during the exposure.
    fn is_moving(&self, shot: &CameraShot, scene: &Scene) -> bool {
        let CameraShot { model, bands, frame, focus, .. } = shot;
        let (focus, seconds) = (*focus, self.exposed.seconds.unwrap_or(0.0));
        let tolerance = self.error.0;
        GateSubject { model, bands, frame, scene, focus, seconds, tolerance }.is_moving()
    }

    /// The scene in front of the lens, with the effects that are not rays alone.
    fn renderer<'a>(
        &self,
        shot: &CameraShot,
        scene: &'a Scene,
        opened: &LoadedLens,
        split: &mut ToleranceSplit,
    ) -> Result<ExactRenderer<'a>, PictureError> {
        let CameraShot { model, bands, frame, .. } = shot;
        let renderer = ExactRenderer::new(model, bands, scene, *frame)?;
        let mut renderer = renderer.with_diffraction(model, bands, split.allowed())?;
        split.note(DIFFRACTION, renderer.diffraction().map_or(0.0, |found| found.error(1.0)));
        let is_spread = renderer.diffraction().is_some_and(|found| found.on);
        if !is_spread && let Some(change) = Self::blur_change(shot, scene, split.allowed())? {
            split.share_with(BLUR);
            split.note(BLUR, change);
            renderer = renderer.without_blur(model, bands);
        }
        let Some(coating) = self.coating else { return Ok(renderer) };
        let taken = LightLosses { coating, glasses: Some(&opened.lens) };
        let renderer = renderer.with_losses(model, bands, taken, split.allowed())?;
        // Where one ray stands for all light of a point, its share does.
        let is_aimed = renderer.is_sharp() || renderer.diffraction().is_some_and(|d| d.aberrated);
        let wrong = |losses: &LossReport| {
            if losses.by_ray && !is_aimed { losses.error } else { losses.variation }
        };
        split.note(LOSSES, renderer.losses().map_or(0.0, wrong));
        Ok(renderer)
    }

    /// The change of some tiles if all light of a point follows one ray, if that is small enough to leave out blur.
    fn blur_change(
        shot: &CameraShot,
        scene: &Scene,
        allowed: f64,
    ) -> Result<Option<f64>, PictureError> {
        let CameraShot { model, bands, frame, focus, .. } = shot;
        let (focus, seconds, tolerance) = (*focus, 0.0, allowed);
        let subject = GateSubject { model, bands, frame, scene, focus, seconds, tolerance };
        if subject.is_blurred() {
            return Ok(None);
        }
        let blurred = ExactRenderer::new(model, bands, scene, *frame)?;
        let sharp = ExactRenderer::new(model, bands, scene, *frame)?.without_blur(model, bands);
        let change = tile_change([&blurred, &sharp], [0.0; 2], TILES);
        // One more effect shares the tolerance then.
        Ok((sharp.is_sharp() && change <= 0.7 * allowed).then_some(change))
    }

    /// The picture by the quick way if its error allows it, else by the exact one.
    fn light(
        &self,
        shot: &CameraShot,
        (renderer, seconds): (&ExactRenderer<'_>, f64),
        split: &mut ToleranceSplit,
        stop: &AtomicBool,
    ) -> Result<PictureLight, PictureError> {
        let allowed = split.rest(SAMPLING);
        if split.without(SAMPLING) > self.error.0 {
            let [taken, asked] = [split.without(SAMPLING), self.error.0].map(|share| 100.0 * share);
            print_note(format!(
                "note: {asked:.3} % cannot be reached, the effects beside sampling alone take {taken:.3} %; sampling goes on"
            ));
        }
        let is_kept = |quick: &PictureLight| {
            self.quick || quick.sampling.value <= allowed || stop.load(Ordering::Relaxed)
        };
        let quick =
            if self.exact { None } else { Some(quick_picture(shot, (renderer, seconds), stop)) };
        let quick = quick.transpose()?.filter(is_kept);
        let light = quick.unwrap_or_else(|| self.exact_picture((renderer, seconds), allowed, stop));
        split.note(SAMPLING, light.sampling.value);
        let mean = light.picture.mean() / (MID_GREY * light.picture.white);
        split.note(DIFFRACTION, renderer.diffraction().map_or(0.0, |found| found.error(mean)));
        Ok(light)
    }

    /// Ghosts where surfaces are coated.
    fn add_ghosts(
        &self,
        rendered: &mut RenderedPicture,
        shot: &CameraShot,
        scene: &Scene,
    ) -> Result<(), PictureError> {
        let Some(coating) = self.coating else { return Ok(()) };
        let light = (coating, rendered.split.allowed());
        let lens = (&shot.model, &shot.bands[..]);
        let (ghosts, ms) = time_ms(|| GhostLight::new(lens, scene, &rendered.picture, light));
        let ghosts = ghosts?;
        ghosts.add_to(&mut rendered.picture);
        let GhostReport { on, change, error, .. } = ghosts.report;
        rendered.split.note(GHOSTS, if on { error } else { change });
        rendered.ghosts = Some((ghosts.report, ms));
        Ok(())
    }

    fn exact_picture(
        &self,
        (renderer, seconds): (&ExactRenderer<'_>, f64),
        tolerance: f64,
        stop: &AtomicBool,
    ) -> PictureLight {
        let (max_samples, seed) = (self.max_samples, self.seed);
        let settings = ExactSettings { tolerance, max_samples, seed, seconds };
        let bar = progress_bar(STEPS);
        let notes = Mutex::new(ProgressNotes::in_place_of_bar());
        let watch = |done: f64| {
            bar.set_position((STEPS as f64 * done) as u64);
            if let Ok(mut notes) = notes.try_lock() {
                let text =
                    || format!("{:.0} % of the work that the tolerance may take", 100.0 * done);
                notes.iter_mut().for_each(|notes| notes.tell(text));
            }
            if stop.load(Ordering::Relaxed) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let picture = renderer.render(&settings, &watch);
        bar.finish_and_clear();
        let sampling = Estimate::new(picture.rms_error(), 0.0, 0);
        PictureLight { picture, sampling, way: "exact", device: None }
    }
}

/// A picture by the quick way, with its error against the exact way on some of its tiles.
fn quick_picture(
    shot: &CameraShot,
    (exact, seconds): (&ExactRenderer<'_>, f64),
    stop: &AtomicBool,
) -> Result<PictureLight, PictureError> {
    let quick = QuickRenderer::exposed(&shot.model, &shot.bands, exact, seconds)?;
    let (made, ms) = time_ms(|| quick.render_fast(stop));
    let QuickPicture { mut picture, device, refused } = made;
    if let Some(why) = refused {
        print_note(format!("note: {why}; the processor made the picture"));
    }
    let checked = ((CHECKED_TILES, CHECKED_SAMPLES), seconds);
    let error = ErrorMap::of_exposure(exact, &picture, checked, || false).rms();
    picture.rays = error.rays;
    let sampling = Estimate { milliseconds: Some(ms), ..error };
    Ok(PictureLight { picture, sampling, way: "quick", device })
}
