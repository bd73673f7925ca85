//! Light of a picture: the way that makes it, the effects that are in it, and what each uses of the tolerance.

use super::{CameraShot, PictureArgs};
use crate::analysis::Estimate;
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::cli::output::print_note;
use crate::cli::progress::progress_bar;
use crate::measure::time_ms;
use crate::picture::{
    DiffractionReport, ErrorMap, ExactRenderer, ExactSettings, GhostLight, GhostReport,
    LightLosses, LossReport, MID_GREY, Picture, PictureError, QuickPicture, QuickRenderer, Scene,
    ToleranceSplit, quick_error,
};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// The tiles on which the quick way is compared with the exact one, and the samples of their pixels.
const CHECKED_TILES: usize = 24;
const CHECKED_SAMPLES: usize = 128;
/// The samples of a pixel for the map of the error.
const MAPPED_SAMPLES: usize = 64;
/// The number of steps of the progress bar.
const STEPS: usize = 1000;

/// The effects that share the tolerance.
const SAMPLING: &str = "sampling";
const DIFFRACTION: &str = "diffraction";
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
}

/// Light by one of both ways.
struct PictureLight {
    picture: Picture,
    sampling: Estimate,
    way: &'static str,
    device: Option<String>,
}

impl PictureArgs {
    pub(super) fn render(
        &self,
        opened: &LoadedLens,
        stop: &AtomicBool,
    ) -> Result<(RenderedPicture, CameraShot), CliError> {
        let refuse = |error: PictureError| CliError::Input(format!("{}: {error}", opened.file));
        let shot = self.shot(opened).map_err(refuse)?;
        let scene = self.scene(&shot)?.map_err(refuse)?;
        let mut split = self.split();
        let renderer = self.renderer(&shot, &scene, opened, &mut split).map_err(refuse)?;
        let light = self.light(&shot, &renderer, &mut split, stop).map_err(refuse)?;
        let is_stopped = || stop.load(Ordering::Relaxed);
        let map = || {
            let samples = (usize::MAX, MAPPED_SAMPLES);
            ErrorMap::measure_until(&renderer, &light.picture, samples, is_stopped)
        };
        // A part is no map.
        let error_map = self.error_map.as_ref().map(|_| map()).filter(ErrorMap::is_whole);
        let PictureLight { picture, sampling, way, device } = light;
        let mut rendered = RenderedPicture {
            picture,
            sampling,
            split,
            way,
            device,
            error_map,
            diffraction: renderer.diffraction().cloned(),
            losses: renderer.losses().cloned(),
            ghosts: None,
        };
        if !is_stopped() {
            self.add_ghosts(&mut rendered, &shot, &scene).map_err(refuse)?;
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
        let coated: &[&str] = &[SAMPLING, DIFFRACTION, LOSSES, GHOSTS];
        let effects = if self.coating.is_some() { coated } else { &coated[..2] };
        ToleranceSplit::new(self.error.0, effects)
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
        let renderer = renderer.with_diffraction(model, bands, split.allowed())?;
        split.note(DIFFRACTION, renderer.diffraction().map_or(0.0, |found| found.error(1.0)));
        let Some(coating) = self.coating else { return Ok(renderer) };
        let taken = LightLosses { coating, glasses: Some(&opened.lens) };
        let renderer = renderer.with_losses(model, bands, taken, split.allowed())?;
        let wrong = |losses: &LossReport| {
            if losses.by_ray { losses.error } else { losses.variation }
        };
        split.note(LOSSES, renderer.losses().map_or(0.0, wrong));
        Ok(renderer)
    }

    /// The picture by the quick way if its error allows it, else by the exact one.
    fn light(
        &self,
        shot: &CameraShot,
        renderer: &ExactRenderer<'_>,
        split: &mut ToleranceSplit,
        stop: &AtomicBool,
    ) -> Result<PictureLight, PictureError> {
        let allowed = split.rest(SAMPLING);
        let is_kept = |quick: &PictureLight| {
            self.quick || quick.sampling.value <= allowed || stop.load(Ordering::Relaxed)
        };
        let quick = if self.exact { None } else { Some(quick_picture(shot, renderer, stop)) };
        let quick = quick.transpose()?.filter(is_kept);
        let light = quick.unwrap_or_else(|| self.exact_picture(renderer, allowed, stop));
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
        renderer: &ExactRenderer<'_>,
        tolerance: f64,
        stop: &AtomicBool,
    ) -> PictureLight {
        let settings = ExactSettings {
            tolerance,
            max_samples: self.max_samples,
            seed: self.seed,
            seconds: 0.0,
        };
        let bar = progress_bar(STEPS);
        let watch = |done: f64| {
            bar.set_position((STEPS as f64 * done) as u64);
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
    exact: &ExactRenderer<'_>,
    stop: &AtomicBool,
) -> Result<PictureLight, PictureError> {
    let quick = QuickRenderer::new(&shot.model, &shot.bands, exact)?;
    let (made, ms) = time_ms(|| quick.render_fast(stop));
    let QuickPicture { mut picture, device, refused } = made;
    if let Some(why) = refused {
        print_note(format!("note: {why}; the processor made the picture"));
    }
    let error = quick_error(exact, &picture, CHECKED_TILES, CHECKED_SAMPLES);
    picture.rays = error.rays;
    let sampling = Estimate { milliseconds: Some(ms), ..error };
    Ok(PictureLight { picture, sampling, way: "quick", device })
}
