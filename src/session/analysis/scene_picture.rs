//! A small picture of a scene through the lens, for the window.
//!
//! It is made the quick way: coarse with every edit, and finer, with its error and with what its options ask
//! for, once the lens is still.

use super::{PictureEffect, PictureOptions, PictureScene};
use crate::analysis::Estimate;
use crate::lens::{Lens, Object};
use crate::measure::{PictureEffects, tile_ms, time_ms};
use crate::picture::{
    ColorBand, Coloring, ErrorMap, ErrorShare, ExactRenderer, ExactSettings, GateSubject,
    GhostLight, GhostReport, GroupFocus, ImageFrame, LightLosses, LossReport, MID_GREY, Picture,
    PictureError, PictureGate, PlacedPoints, PointGrid, QuickPicture, QuickRenderer, Scene,
    ToleranceSplit, field_diagonal, focused, picture_model,
};
use crate::pupil::RayModel;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

/// A picture of a scene through the lens.
#[derive(Debug, Clone)]
pub struct ScenePicture {
    /// The scene.
    pub scene: PictureScene,
    /// The options that it was taken with.
    pub options: PictureOptions,
    /// The picture.
    pub picture: Picture,
    /// The root mean square error of its pixels by their sampling, or against rays from every pixel, as a share of
    /// mid grey, with the milliseconds of the picture; `None` where it is not measured, as of a coarse picture.
    pub error: Option<Estimate>,
    /// The error tile by tile; `None` where it is not measured.
    pub error_map: Option<ErrorMap>,
    /// The images of points over the frame; `None` where nobody asked.
    pub points: Option<PlacedPoints>,
    /// The parts of the tolerance that effects use; none of a coarse picture.
    pub shares: Vec<ErrorShare>,
    /// The distance in mm to which the lens is focused; `None` at infinity.
    pub focus: Option<f64>,
    /// The change of the field of view by a focus group, as a share; `None` without one.
    pub breathing: Option<f64>,
    /// True if rays were followed from every pixel.
    pub is_exact: bool,
    /// The name of the graphics card that made the picture; `None` for the processor.
    pub device: Option<String>,
    /// The effects with their numbers; `None` if nobody asked.
    pub gates: Option<Vec<PictureGate>>,
    /// The effects that are not in the picture, with the reason.
    pub left_out: Vec<String>,
}

/// The pixels of a picture while the lens changes, and of one of a lens that is still.
const COARSE: [usize; 2] = [96, 64];
const FINE: [usize; 2] = [360, 240];
/// The distance in mm at which a scene with depth is placed before a lens that is focused at infinity.
const NEAR: f64 = 1000.0;
/// The tiles on which a fine picture is compared with rays, and the samples of their pixels.
const TILES: usize = 4;
const SAMPLES: usize = 32;
/// The samples of a pixel if all tiles are compared.
const MAP_SAMPLES: usize = 16;
/// The places of images of points, their cells and their rays.
const POINTS: PointGrid = PointGrid { places: [5, 3], cells: 33, samples: 4096 };
/// The wavelengths of a colour where a coating changes light with the wavelength.
const COATED: usize = 3;
/// The most rays of a colour of a pixel.
const MAX_SAMPLES: usize = 4096;

/// The effects that share the tolerance.
const SAMPLING: &str = "sampling";
const DIFFRACTION: &str = "diffraction";
const LOSSES: &str = "losses";
const GHOSTS: &str = "ghosts";

/// The test for a newer request.
type Interruption<'a> = &'a (dyn Fn() -> bool + Sync);

/// A coarse picture of a lens.
pub(super) fn coarse_picture(
    lens: &Lens,
    zoom: usize,
    scene: &PictureScene,
    options: &PictureOptions,
) -> Result<ScenePicture, String> {
    let make = || -> Result<ScenePicture, PictureError> {
        let camera = Camera::new((lens, zoom), scene, options, (COARSE, 1))?;
        let painted = scene.build(&camera.model, &camera.frame, camera.distance)?;
        let exact = camera.plain(&painted)?;
        let (picture, device, _) = camera.quick(&exact, options, 0.0)?;
        let left_out = vec!["all but rays: it is coarse".to_owned()];
        let taken = TakenPicture { device, left_out, ..TakenPicture::new(picture) };
        Ok(camera.finish(scene, options, taken))
    };
    make().map_err(|error| error.to_string())
}

/// The results that are computed beside a fine picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureExtras {
    /// Its error on all tiles.
    pub(super) all_tiles: bool,
    /// The images of points over its frame.
    pub(super) points: bool,
}

/// A fine picture of a lens with its error on some tiles, or on all of them; without an error, or incomplete, once
/// `is_interrupted` is true.
pub(super) fn fine_picture(
    lens: &Lens,
    zoom: usize,
    (scene, options): (&PictureScene, &PictureOptions),
    extras: PictureExtras,
    is_interrupted: Interruption<'_>,
) -> Result<ScenePicture, String> {
    let make = || -> Result<ScenePicture, PictureError> {
        let colors = if options.coating.is_some() { COATED } else { 1 };
        let camera = Camera::new((lens, zoom), scene, options, (FINE, colors))?;
        let painted = scene.build(&camera.model, &camera.frame, camera.distance)?;
        let painted = painted.moving(options.velocity)?;
        let taken = camera.take(&painted, (lens, options), extras, is_interrupted)?;
        Ok(camera.finish(scene, options, taken))
    };
    make().map_err(|error| error.to_string())
}

/// A lens focused for a picture, with its sensor.
struct Camera {
    model: RayModel,
    bands: Vec<ColorBand>,
    frame: ImageFrame,
    focus: Option<f64>,
    distance: Option<f64>,
    breathing: Option<f64>,
}

/// A picture with what is known of it.
struct TakenPicture {
    picture: Picture,
    device: Option<String>,
    error: Option<Estimate>,
    error_map: Option<ErrorMap>,
    points: Option<PlacedPoints>,
    shares: Vec<ErrorShare>,
    is_exact: bool,
    gates: Option<Vec<PictureGate>>,
    left_out: Vec<String>,
}

impl TakenPicture {
    const fn new(picture: Picture) -> Self {
        Self {
            picture,
            device: None,
            error: None,
            error_map: None,
            points: None,
            shares: Vec::new(),
            is_exact: false,
            gates: None,
            left_out: Vec::new(),
        }
    }
}

impl Camera {
    fn new(
        (lens, zoom): (&Lens, usize),
        scene: &PictureScene,
        options: &PictureOptions,
        (pixels, wavelengths): ([usize; 2], usize),
    ) -> Result<Self, PictureError> {
        let diagonal = field_diagonal(&RayModel::from_lens(lens, zoom)?)?;
        let near = (lens.object == Object::Infinity && scene.has_depth()).then_some(NEAR);
        let asked = options.focus.distance().or(near);
        let (moved, focus, breathing) = match (asked, options.focus.group(), lens.object) {
            (Some(at), Some(group), _) => {
                let GroupFocus { lens, breathing, .. } = group.focus(lens, zoom, at)?;
                (Some(lens), Some(at), Some(breathing))
            }
            (Some(at), None, _) => (Some(focused(lens, zoom, at)?), Some(at), None),
            (None, _, Object::Finite(at)) => (None, Some(at), None),
            (None, _, Object::Infinity) => (None, None, None),
        };
        let coloring = Coloring::Rgb(wavelengths);
        let (model, bands) = picture_model(moved.as_ref().unwrap_or(lens), zoom, coloring)?;
        let frame = ImageFrame::new(&model, pixels, diagonal)?;
        let distance = options.distance.or(focus);
        Ok(Self { model, bands, frame, focus, distance, breathing })
    }

    fn plain<'a>(&self, painted: &'a Scene) -> Result<ExactRenderer<'a>, PictureError> {
        ExactRenderer::new(&self.model, &self.bands, painted, self.frame)
    }

    fn finish(
        self,
        scene: &PictureScene,
        options: &PictureOptions,
        taken: TakenPicture,
    ) -> ScenePicture {
        let TakenPicture { picture, device, error, error_map, .. } = taken;
        let TakenPicture { points, shares, is_exact, gates, left_out, .. } = taken;
        ScenePicture {
            scene: scene.clone(),
            options: options.clone(),
            picture,
            error,
            error_map,
            points,
            shares,
            focus: self.focus,
            breathing: self.breathing,
            is_exact,
            device,
            gates,
            left_out,
        }
    }

    /// A picture the quick way of a scene that moves for some seconds, the device that made it, and its time in
    /// milliseconds.
    fn quick(
        &self,
        exact: &ExactRenderer<'_>,
        options: &PictureOptions,
        seconds: f64,
    ) -> Result<(Picture, Option<String>, f64), PictureError> {
        let go_on = AtomicBool::new(false);
        let (made, ms) = time_ms(|| -> Result<QuickPicture, PictureError> {
            let quick = QuickRenderer::exposed(&self.model, &self.bands, exact, seconds)?;
            if options.processor {
                let picture = quick.render_until(&go_on);
                return Ok(QuickPicture { picture, device: None, refused: None });
            }
            Ok(quick.render_fast(&go_on))
        });
        let QuickPicture { picture, device, .. } = made?;
        Ok((picture, device, ms))
    }

    /// A picture with all that the options ask for.
    fn take(
        &self,
        painted: &Scene,
        (lens, options): (&Lens, &PictureOptions),
        extras: PictureExtras,
        is_interrupted: Interruption<'_>,
    ) -> Result<TakenPicture, PictureError> {
        let mut split = split(options);
        let mut left_out = Vec::new();
        let renderer = self.renderer(painted, (lens, options), &mut split, &mut left_out)?;
        let seconds = self.moving_seconds(painted, options, &mut left_out);
        let mut taken = if options.exact {
            exact_picture(&renderer, (split.rest(SAMPLING), seconds), is_interrupted)
        } else {
            let compared =
                if extras.all_tiles { (usize::MAX, MAP_SAMPLES) } else { (TILES, SAMPLES) };
            self.compared(&renderer, (options, seconds), compared, is_interrupted)?
        };
        taken.left_out = left_out;
        if is_interrupted() {
            return Ok(taken);
        }
        split.note(SAMPLING, taken.error.map_or(0.0, |error| error.value));
        let ghosts = self.add_ghosts(&mut taken, painted, options, &mut split);
        let mean = taken.picture.mean() / (MID_GREY * taken.picture.white);
        split.note(DIFFRACTION, renderer.diffraction().map_or(0.0, |found| found.error(mean)));
        taken.shares = split.shares().to_vec();
        if extras.points {
            taken.points =
                renderer.placed_points(&self.bands, POINTS, self.distance, is_interrupted);
        }
        if options.effects && !is_interrupted() {
            let effects = PictureEffects {
                lens,
                model: &self.model,
                bands: &self.bands,
                frame: self.frame,
                scene: painted,
                focus: self.focus,
                seconds: options.seconds.unwrap_or(0.0),
                tolerance: split.allowed(),
                coating: options.coating,
                diffraction: renderer.diffraction(),
                losses: renderer.losses(),
                is_sharp: Some(renderer.is_sharp()),
                rings: Some(renderer.rings()),
                ghosts: ghosts.as_ref().map(|(report, ms)| (report, *ms)),
            };
            let mut gates = [effects.of_scene()?, effects.of_light()?].concat();
            if let Some(gate) = PictureGate::of_lateral_color(&mut gates) {
                gate.decide_colors(true);
                if !is_interrupted() {
                    gate.saved_milliseconds = Some(self.color_ms(painted)?);
                }
            }
            taken.gates = Some(gates);
        }
        Ok(taken)
    }

    /// The time in milliseconds that one wavelength for all colours saves on some tiles.
    fn color_ms(&self, painted: &Scene) -> Result<f64, PictureError> {
        let one =
            vec![ColorBand { wavelengths: vec![(self.model.primary, 1.0)] }; self.bands.len()];
        let with = |bands: &[ColorBand]| {
            tile_ms(|| ExactRenderer::new(&self.model, bands, painted, self.frame), 0.0)
        };
        Ok(with(&self.bands)? - with(&one)?)
    }

    /// Rays with diffraction and losses as far as the options and the lens allow them.
    fn renderer<'a>(
        &self,
        painted: &'a Scene,
        (lens, options): (&Lens, &PictureOptions),
        split: &mut ToleranceSplit,
        left_out: &mut Vec<String>,
    ) -> Result<ExactRenderer<'a>, PictureError> {
        let (model, bands, allowed) = (&self.model, &self.bands[..], split.allowed());
        let mut renderer = self.plain(painted)?;
        if options.includes(PictureEffect::Diffraction) {
            renderer = renderer.with_diffraction(model, bands, allowed)?;
            if renderer.diffraction().is_some_and(|found| !found.on) {
                left_out.push("diffraction: it changes too little".to_owned());
            }
        } else {
            left_out.push("diffraction: switched off".to_owned());
            split.note(DIFFRACTION, 0.0);
        }
        let Some(coating) = options.coating else {
            left_out.push("losses and ghosts: no coating is chosen".to_owned());
            return Ok(renderer);
        };
        if !options.includes(PictureEffect::Losses) {
            left_out.push("losses: switched off".to_owned());
            split.note(LOSSES, 0.0);
            return Ok(renderer);
        }
        let taken = LightLosses { coating, glasses: Some(lens) };
        let renderer = renderer.with_losses(model, bands, taken, allowed)?;
        let wrong = |losses: &LossReport| {
            if losses.by_ray { losses.error } else { losses.variation }
        };
        split.note(LOSSES, renderer.losses().map_or(0.0, wrong));
        Ok(renderer)
    }

    /// The exposure in seconds if something moves by as much as can be seen; else 0.
    fn moving_seconds(
        &self,
        scene: &Scene,
        options: &PictureOptions,
        left_out: &mut Vec<String>,
    ) -> f64 {
        let Some(seconds) = options.seconds.filter(|_| scene.is_moving()) else { return 0.0 };
        let (model, bands, frame) = (&self.model, &self.bands[..], &self.frame);
        let (focus, tolerance) = (self.focus, options.tolerance);
        let subject = GateSubject { model, bands, frame, scene, focus, seconds, tolerance };
        if !options.includes(PictureEffect::Motion) {
            left_out.push("motion: switched off".to_owned());
            return 0.0;
        }
        if subject.is_moving() {
            return seconds;
        }
        left_out.push("motion: less than can be seen".to_owned());
        0.0
    }

    /// The quick way, with its error against rays on some tiles.
    fn compared(
        &self,
        renderer: &ExactRenderer<'_>,
        (options, seconds): (&PictureOptions, f64),
        tiles: (usize, usize),
        is_interrupted: Interruption<'_>,
    ) -> Result<TakenPicture, PictureError> {
        let (picture, device, ms) = self.quick(renderer, options, seconds)?;
        let map = ErrorMap::of_exposure(renderer, &picture, (tiles, seconds), is_interrupted);
        let error_map = (!is_interrupted()).then_some(map);
        let timed = |map: &ErrorMap| Estimate { milliseconds: Some(ms), ..map.rms() };
        let error = error_map.as_ref().map(timed);
        Ok(TakenPicture { device, error, error_map, ..TakenPicture::new(picture) })
    }

    /// Adds ghosts where surfaces reflect, and tells of them with the time in milliseconds.
    fn add_ghosts(
        &self,
        taken: &mut TakenPicture,
        painted: &Scene,
        options: &PictureOptions,
        split: &mut ToleranceSplit,
    ) -> Option<(GhostReport, f64)> {
        let coating = options.coating?;
        if !options.includes(PictureEffect::Ghosts) {
            taken.left_out.push("ghosts: switched off".to_owned());
            split.note(GHOSTS, 0.0);
            return None;
        }
        let picture = &mut taken.picture;
        let lens = (&self.model, &self.bands[..]);
        let light = (coating, split.allowed());
        let (made, ms) = time_ms(|| GhostLight::new(lens, painted, picture, light));
        match made {
            Ok(ghosts) => {
                ghosts.add_to(picture);
                let GhostReport { on, change, error, .. } = ghosts.report;
                split.note(GHOSTS, if on { error } else { change });
                if !on {
                    taken.left_out.push("ghosts: they change too little".to_owned());
                }
                Some((ghosts.report, ms))
            }
            Err(why) => {
                taken.left_out.push(format!("ghosts: {why}"));
                None
            }
        }
    }
}

/// Rays from every pixel.
fn exact_picture(
    renderer: &ExactRenderer<'_>,
    (tolerance, seconds): (f64, f64),
    is_interrupted: Interruption<'_>,
) -> TakenPicture {
    let settings = ExactSettings { tolerance, max_samples: MAX_SAMPLES, seed: 0, seconds };
    let watch = |_: f64| {
        if is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (picture, ms) = time_ms(|| renderer.render(&settings, &watch));
    let error = Estimate::new(picture.rms_error(), 0.0, picture.rays);
    let error = Some(Estimate { milliseconds: Some(ms), ..error });
    TakenPicture { error, is_exact: true, ..TakenPicture::new(picture) }
}

/// The tolerance, split over what may be wrong.
fn split(options: &PictureOptions) -> ToleranceSplit {
    let coated = options.coating.is_some();
    let all = [(SAMPLING, true), (DIFFRACTION, true), (LOSSES, coated), (GHOSTS, coated)];
    let effects: Vec<&str> = all.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
    ToleranceSplit::new(options.tolerance, &effects)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::double_gauss;
    use crate::picture::BuiltInScene;

    /// A small picture of a star that moves to the right by some hundredths of its distance while it is exposed.
    fn taken(speed: f64, exact: bool) -> TakenPicture {
        let lens = double_gauss();
        let velocity = [speed, 0.0];
        let seconds = Some(0.5);
        let options = PictureOptions {
            velocity,
            seconds,
            exact,
            processor: true,
            effects: !exact,
            tolerance: 0.03,
            ..PictureOptions::default()
        };
        let scene = PictureScene::BuiltIn(BuiltInScene::Star);
        let camera = Camera::new((&lens, 0), &scene, &options, ([24, 16], 1)).unwrap();
        let painted = scene.build(&camera.model, &camera.frame, camera.distance).unwrap();
        let painted = painted.moving(options.velocity).unwrap();
        let extras = PictureExtras { all_tiles: true, points: false };
        camera.take(&painted, (&lens, &options), extras, &|| false).unwrap()
    }

    /// A scene that moves is smeared the quick way too, as rays from every pixel smear it; and every effect that costs time by
    /// itself has its time, lateral colour among them.
    #[test]
    fn a_scene_that_moves_is_smeared_the_quick_way() {
        let [still, moving, exact] =
            [(0.0, false), (0.1, false), (0.1, true)].map(|(v, e)| taken(v, e));
        assert!(!still.is_exact && !moving.is_exact && exact.is_exact);
        let apart = |a: &TakenPicture, b: &TakenPicture| {
            let pairs = a.picture.values.iter().flatten().zip(b.picture.values.iter().flatten());
            let count = 3.0 * a.picture.values.len() as f64;
            (pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / count).sqrt()
                / (MID_GREY * a.picture.white)
        };
        let (smeared, wrong) = (apart(&still, &moving), apart(&moving, &exact));
        assert!(smeared > 0.2 && wrong < 0.3 * smeared, "{smeared} {wrong}");
        let measured = moving.error.unwrap().value;
        assert!(measured < 2.0 * wrong + 0.03, "{measured} {wrong}");
        let gates = moving.gates.unwrap();
        let saved =
            |name: &str| gates.iter().find(|gate| gate.effect == name).unwrap().saved_milliseconds;
        let colors = gates.iter().find(|gate| gate.effect == "lateral colour").unwrap();
        assert!(colors.on && colors.reason.contains("a wavelength for each colour"), "{colors:?}");
        for name in ["lateral colour", "blur", "vignetting", "motion", "diffraction"] {
            assert!(saved(name).is_some_and(f64::is_finite), "{name}");
        }
    }
}
