//! The effects of a picture as a table, with the time that each costs: measured with and without on some tiles.

use super::render::RenderedPicture;
use super::scene::SceneSource;
use super::{CameraShot, PictureArgs};
use crate::cli::input::LoadedLens;
use crate::measure::{PictureEffects, tile_ms, time_ms};
use crate::picture::{ExactRenderer, MID_GREY, PictureError, PictureGate, Scene, photon_count};

/// The number of wavelengths of a colour of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct ColorChoice {
    pub(super) count: usize,
    /// The number that it was compared with.
    pub(super) compared: usize,
    /// The change of some tiles from it to that one.
    pub(super) change: f64,
}

/// The share of a step of 8 bits at mid grey below which noise cannot be seen.
const HIDDEN_NOISE: f64 = 0.25 / 255.0 / MID_GREY;

impl PictureArgs {
    /// Every effect, with what it would save.
    pub(super) fn effect_table(
        &self,
        rendered: &RenderedPicture,
        (shot, scene, source): (&CameraShot, &Scene, &SceneSource),
        opened: &LoadedLens,
    ) -> Result<Vec<PictureGate>, PictureError> {
        let tolerance = rendered.split.allowed();
        let CameraShot { model, bands, frame, focus, .. } = shot;
        let effects = PictureEffects {
            lens: &opened.lens,
            model,
            bands,
            frame: *frame,
            scene,
            focus: *focus,
            seconds: self.exposed.seconds.unwrap_or(0.0),
            tolerance,
            coating: self.coating,
            diffraction: rendered.diffraction.as_ref(),
            losses: rendered.losses.as_ref(),
            is_sharp: Some(rendered.is_sharp),
            rings: Some(rendered.rings),
            ghosts: rendered.ghosts.as_ref().map(|(report, ms)| (report, *ms)),
        };
        let mut gates = effects.of_scene()?;
        if let (Some(colors), Some(gate)) =
            (rendered.colors, PictureGate::of_lateral_color(&mut gates))
        {
            let all = || ExactRenderer::new(model, bands, scene, *frame);
            let primary = self.shot(opened, source, 0)?;
            let one = || ExactRenderer::new(&primary.model, &primary.bands, scene, *frame);
            gate.decide_colors(colors.count > 0);
            gate.saved_milliseconds = Some(tile_ms(all, 0.0)? - tile_ms(one, 0.0)?);
        }
        gates.extend(self.colors_gate(rendered, shot, (scene, source), opened, tolerance)?);
        gates.extend(effects.of_light()?);
        gates.extend(self.noise_gate(rendered, source));
        Ok(gates)
    }

    /// The number of wavelengths.
    fn colors_gate(
        &self,
        rendered: &RenderedPicture,
        shot: &CameraShot,
        (scene, source): (&Scene, &SceneSource),
        opened: &LoadedLens,
        limit: f64,
    ) -> Result<Option<PictureGate>, PictureError> {
        let Some(colors) = rendered.colors else { return Ok(None) };
        let ms = |count: usize| {
            let other = self.shot(opened, source, count)?;
            let build = || ExactRenderer::new(&other.model, &other.bands, scene, shot.frame);
            tile_ms(build, 0.0)
        };
        let [few, many] = [colors.count, colors.compared];
        Ok(Some(PictureGate {
            effect: "number of wavelengths",
            on: colors.count > 1,
            number: Some(colors.change),
            unit: "share",
            limit,
            reason: match colors.count {
                0 => "one for all colours: change of some tiles with one for each",
                1 => "one for each colour: change of some tiles with three",
                _ => "several for each colour: change of some tiles with about twice as many",
            },
            saved_milliseconds: Some(ms(many)? - ms(few)?),
        }))
    }

    /// The noise at mid grey; `None` without a sensor.
    fn noise_gate(&self, rendered: &RenderedPicture, source: &SceneSource) -> Option<PictureGate> {
        let sensor = self.exposed.sensor().ok()??;
        let (model, picture) = (sensor.model, &rendered.picture);
        let luminance = self.luminance(source);
        let seconds =
            self.exposed.seconds.unwrap_or_else(|| model.normal_exposure(picture, luminance));
        let grey = MID_GREY * luminance * picture.white;
        let photons = photon_count(grey, picture.frame.pitch, seconds);
        let dark = model.dark_current * seconds;
        let is_full = model.is_saturated(photons, dark);
        let noise = 1.0 / model.signal_to_noise(photons, dark);
        let (_, ms) = time_ms(|| self.expose(sensor, source, picture));
        Some(PictureGate {
            effect: "noise",
            on: true,
            number: Some(noise).filter(|noise| noise.is_finite() && !is_full),
            unit: "share",
            limit: HIDDEN_NOISE,
            reason: "noise of electrons over their number at mid grey; a quarter of a step of 8 bits",
            saved_milliseconds: Some(ms),
        })
    }
}
