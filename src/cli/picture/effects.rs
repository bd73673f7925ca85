//! The effects of a picture as a table, with the time that each costs: measured with and without on some tiles.

use super::render::{RenderedPicture, TILES};
use super::scene::SceneSource;
use super::{CameraShot, PictureArgs};
use crate::analysis::Coating;
use crate::cli::input::LoadedLens;
use crate::measure::time_ms;
use crate::picture::{
    ColorBand, ExactRenderer, GateSubject, GhostReport, LightLosses, MID_GREY, PictureError,
    PictureGate, Scene, photon_count, render_tiles,
};
use crate::pupil::RayModel;

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
        let seconds = self.exposed.seconds.unwrap_or(0.0);
        let subject = GateSubject { model, bands, frame, scene, focus: *focus, seconds, tolerance };
        let mut gates = subject.gates();
        let plain = || ExactRenderer::new(model, bands, scene, *frame);
        let rest = tile_ms(plain, 0.0)?;
        for gate in gates.iter_mut().filter(|gate| gate.effect == "motion") {
            gate.saved_milliseconds = Some(tile_ms(plain, seconds)? - rest);
        }
        gates.extend(self.colors_gate(rendered, shot, (scene, source), opened, tolerance)?);
        gates.push(diffraction_gate(rendered, (model, bands), plain, (rest, tolerance))?);
        let taken = LightLosses {
            coating: self.coating.unwrap_or(Coating::Bare),
            glasses: Some(&opened.lens),
        };
        let lossy = || plain()?.with_losses(model, bands, taken, tolerance);
        let lost = tile_ms(lossy, 0.0).ok().map(|ms| ms - rest);
        gates.extend(losses_gates(rendered, lost, tolerance));
        gates.push(ghosts_gate(rendered, tolerance));
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
        let [few, many] = [colors.count.min(colors.compared), colors.count.max(colors.compared)];
        Ok(Some(PictureGate {
            effect: "number of wavelengths",
            on: colors.count > 1,
            number: Some(colors.change),
            unit: "share",
            limit,
            reason: if colors.count == 1 {
                "one for each colour: change of some tiles with three"
            } else {
                "several for each colour: change of some tiles with about twice as many"
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
        let noise = 1.0 / model.signal_to_noise(photons, model.dark_current * seconds);
        let (_, ms) = time_ms(|| self.expose(sensor, source, picture));
        Some(PictureGate {
            effect: "noise",
            on: true,
            number: Some(noise).filter(|noise| noise.is_finite()),
            unit: "share",
            limit: HIDDEN_NOISE,
            reason: "noise of electrons over their number at mid grey; a quarter of a step of 8 bits",
            saved_milliseconds: Some(ms),
        })
    }
}

/// The time of some tiles of a picture and of its preparation, in milliseconds.
fn tile_ms<'a>(
    build: impl Fn() -> Result<ExactRenderer<'a>, PictureError>,
    seconds: f64,
) -> Result<f64, PictureError> {
    let (made, ms) = time_ms(|| build().map(|renderer| render_tiles(&renderer, seconds, 1, TILES)));
    made.map(|_| ms)
}

fn diffraction_gate<'a>(
    rendered: &RenderedPicture,
    (model, bands): (&RayModel, &[ColorBand]),
    plain: impl Fn() -> Result<ExactRenderer<'a>, PictureError>,
    (rest, limit): (f64, f64),
) -> Result<PictureGate, PictureError> {
    let report = rendered.diffraction.as_ref();
    // As if it mattered: its time with the preparation.
    let ms = tile_ms(|| plain()?.with_diffraction(model, bands, 0.0), 0.0)?;
    Ok(PictureGate {
        effect: "diffraction",
        on: report.is_some_and(|report| report.on),
        number: report.map(|report| report.change),
        unit: "share",
        limit,
        reason: report.map_or("not known", |report| report.reason),
        saved_milliseconds: Some(ms - rest),
    })
}

/// The light that surfaces and glasses take, and its polarisation.
fn losses_gates(
    rendered: &RenderedPicture,
    saved_milliseconds: Option<f64>,
    limit: f64,
) -> [PictureGate; 2] {
    let losses = rendered.losses.as_ref();
    let by_ray = losses.is_some_and(|losses| losses.by_ray);
    [
        PictureGate {
            effect: "losses",
            on: losses.is_some(),
            number: losses.map(|losses| losses.variation),
            unit: "share",
            limit,
            reason: match (losses.is_some(), by_ray) {
                (false, _) => "no --coating: white loses as much as the picture",
                (true, true) => "variation over pupil and picture: each ray has its share",
                (true, false) => "variation over pupil and picture: one share for each colour",
            },
            saved_milliseconds,
        },
        PictureGate {
            effect: "polarisation",
            on: false,
            number: losses.map(|losses| losses.polarisation),
            unit: "share",
            limit,
            reason: "difference of both polarisations over their sum; light is taken for unpolarised",
            saved_milliseconds: None,
        },
    ]
}

fn ghosts_gate(rendered: &RenderedPicture, limit: f64) -> PictureGate {
    let found = rendered.ghosts.as_ref();
    let report: Option<&GhostReport> = found.map(|(report, _)| report);
    PictureGate {
        effect: "ghosts",
        on: report.is_some_and(|report| report.on),
        number: report.map(|report| report.change),
        unit: "share",
        limit,
        reason: match report {
            None => "no --coating: surfaces reflect nothing",
            Some(_) => "light of all ghosts where it is brightest, over mid grey",
        },
        saved_milliseconds: found.map(|(_, ms)| *ms),
    }
}
