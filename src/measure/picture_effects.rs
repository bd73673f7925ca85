//! The effects of a picture with the time that each costs, measured with and without on some tiles.

use super::timing::time_ms;
use crate::analysis::Coating;
use crate::lens::Lens;
use crate::picture::{
    ColorBand, DiffractionReport, ExactRenderer, GateSubject, GhostReport, ImageFrame, LightLosses,
    LossReport, PictureError, PictureGate, Scene, reach_tiles, render_tiles,
};
use crate::pupil::RayModel;

/// The tiles on which effects are timed, and the samples of their pixels.
pub const EFFECT_TILES: (usize, usize) = (3, 32);

/// A picture whose effects are listed.
#[derive(Debug, Clone, Copy)]
pub struct PictureEffects<'a> {
    /// The lens.
    pub lens: &'a Lens,
    /// The model of the focused lens.
    pub model: &'a RayModel,
    /// The colours.
    pub bands: &'a [ColorBand],
    /// The frame.
    pub frame: ImageFrame,
    /// The scene.
    pub scene: &'a Scene,
    /// The distance of the focus in mm; `None` at infinity.
    pub focus: Option<f64>,
    /// The time during which the scene moves, in seconds.
    pub seconds: f64,
    /// The part of the error that each effect may use.
    pub tolerance: f64,
    /// The coating of the picture; `None` if nothing is lost.
    pub coating: Option<Coating>,
    /// The report on diffraction, if there is one.
    pub diffraction: Option<&'a DiffractionReport>,
    /// The report on losses.
    pub losses: Option<&'a LossReport>,
    /// True if the picture was taken with chief rays alone; `None` if that is not known.
    pub is_sharp: Option<bool>,
    /// The number of rings of directions of light, one without vignetting; `None` if that is not known.
    pub rings: Option<usize>,
    /// The report on ghosts, with its time in milliseconds.
    pub ghosts: Option<(&'a GhostReport, f64)>,
}

impl<'a> PictureEffects<'a> {
    fn plain(&self) -> Result<ExactRenderer<'a>, PictureError> {
        ExactRenderer::new(self.model, self.bands, self.scene, self.frame)
    }

    /// The effects of the lens and the scene, motion with its time.
    ///
    /// # Errors
    /// A lens without a picture.
    pub fn of_scene(&self) -> Result<Vec<PictureGate>, PictureError> {
        let Self { model, bands, frame, scene, focus, seconds, tolerance, .. } = *self;
        let frame = &frame;
        let subject = GateSubject { model, bands, frame, scene, focus, seconds, tolerance };
        let mut gates = subject.gates();
        let rest = tile_ms(|| self.plain(), 0.0)?;
        for gate in &mut gates {
            match gate.effect {
                "motion" => {
                    gate.saved_milliseconds = Some(tile_ms(|| self.plain(), seconds)? - rest);
                }
                "blur" => {
                    let sharp = || Ok(self.plain()?.without_blur(model, bands));
                    let saved = reach_ms(|| self.plain(), tolerance)? - reach_ms(sharp, tolerance)?;
                    gate.on = self.is_sharp.map_or(gate.on, |is_sharp| !is_sharp);
                    gate.saved_milliseconds = Some(saved);
                }
                "vignetting" => {
                    let ms = |is_even| time_ms(|| subject.tabulate_directions(is_even)).1;
                    gate.on = self.rings.map_or(gate.on, |rings| rings > 1);
                    gate.saved_milliseconds = Some(ms(false) - ms(true));
                }
                _ => {}
            }
        }
        Ok(gates)
    }

    /// Diffraction, losses with polarisation, and ghosts, each with its time.
    ///
    /// # Errors
    /// A lens without a picture.
    pub fn of_light(&self) -> Result<Vec<PictureGate>, PictureError> {
        let rest = tile_ms(|| self.plain(), 0.0)?;
        let mut gates = vec![self.diffraction_gate(rest)?];
        let taken = LightLosses {
            coating: self.coating.unwrap_or(Coating::Bare),
            glasses: Some(self.lens),
        };
        let lossy = || self.plain()?.with_losses(self.model, self.bands, taken, self.tolerance);
        let lost = tile_ms(lossy, 0.0).ok().map(|ms| ms - rest);
        gates.extend(self.losses_gates(lost));
        gates.push(self.ghosts_gate());
        Ok(gates)
    }

    fn diffraction_gate(&self, rest: f64) -> Result<PictureGate, PictureError> {
        let report = self.diffraction;
        // As if it mattered: its time with the preparation.
        let blurred = || self.plain()?.with_diffraction(self.model, self.bands, 0.0);
        let ms = tile_ms(blurred, 0.0)?;
        Ok(PictureGate {
            effect: "diffraction",
            on: report.is_some_and(|report| report.on),
            number: report.map(|report| report.change),
            unit: "share",
            limit: self.tolerance,
            reason: report.map_or("not known", |report| report.reason),
            saved_milliseconds: Some(ms - rest),
        })
    }

    /// The light that surfaces and glasses take, and its polarisation.
    fn losses_gates(&self, saved_milliseconds: Option<f64>) -> [PictureGate; 2] {
        let (losses, limit) = (self.losses, self.tolerance);
        let by_ray = losses.is_some_and(|losses| losses.by_ray);
        [
            PictureGate {
                effect: "losses",
                on: losses.is_some(),
                number: losses.map(|losses| losses.variation),
                unit: "share",
                limit,
                reason: match (losses.is_some(), by_ray) {
                    (false, _) => "no coating is chosen: white loses as much as the picture",
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
                reason: "difference of both polarisations over their sum; light is taken for unpolarised, which \
                         costs nothing",
                saved_milliseconds: None,
            },
        ]
    }

    fn ghosts_gate(&self) -> PictureGate {
        let report = self.ghosts.map(|(report, _)| report);
        PictureGate {
            effect: "ghosts",
            on: report.is_some_and(|report| report.on),
            number: report.map(|report| report.change),
            unit: "share",
            limit: self.tolerance,
            reason: match report {
                None => "no coating is chosen: surfaces reflect nothing",
                Some(_) => "light of all ghosts where it is brightest, over mid grey",
            },
            saved_milliseconds: self.ghosts.map(|(_, ms)| ms),
        }
    }
}

/// The time of some tiles of a picture and of its preparation, in milliseconds.
///
/// # Errors
/// Those of the preparation.
pub fn tile_ms<'a>(
    build: impl Fn() -> Result<ExactRenderer<'a>, PictureError>,
    seconds: f64,
) -> Result<f64, PictureError> {
    let (made, ms) =
        time_ms(|| build().map(|renderer| render_tiles(&renderer, seconds, 1, EFFECT_TILES)));
    made.map(|_| ms)
}

/// The time of some tiles of a picture at a tolerance and of its preparation, in milliseconds.
fn reach_ms<'a>(
    build: impl Fn() -> Result<ExactRenderer<'a>, PictureError>,
    tolerance: f64,
) -> Result<f64, PictureError> {
    let (made, ms) = time_ms(|| build().map(|own| reach_tiles(&own, tolerance, EFFECT_TILES.0)));
    made.map(|_| ms)
}
