//! The effects of a picture as gates: the number of each, the limit that it is compared with, and the reason.
//!
//! Numbers are those of the lens, the frame and the scene. What costs time by itself is left out where its gate is
//! off: lateral colour (one wavelength for all colours), blur (one ray for all light of a point) and vignetting (one
//! set of directions for all points) as well. Rays carry distortion and depth at no cost of their own: a ray
//! through the lens ends where it ends, and every plane of the scene is met once, wherever it is. The time that
//! leaving something out saves is measured by whoever has a clock, with [`tile_change`] on both sides.

use super::diffraction::{field_at, image_wavelength};
use super::exact::{ExactRenderer, ExactSettings, MID_GREY, RINGS, outer};
use super::frame::image_scale;
use super::{ColorBand, ImageFrame, LitDirections, PictureError, Radiance, Scene, SceneLayer};
use crate::analysis::{geometric_mtf, irradiance};
use crate::lens::Object;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use serde::Serialize;

/// An effect, and whether it is in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PictureGate {
    /// The name of the effect.
    pub effect: &'static str,
    /// True if it is in the picture.
    pub on: bool,
    /// Its number; `None` if it is not known or has no meaning.
    pub number: Option<f64>,
    /// The unit of the number: `px`, or `share`.
    pub unit: &'static str,
    /// The effect may be left out below this number.
    pub limit: f64,
    /// The meaning of the number, and the reason.
    pub reason: &'static str,
    /// The time in milliseconds that leaving it out saves or would save, measured with and without; `None` for what
    /// every ray carries at no cost of its own, and for what is never simulated.
    pub saved_milliseconds: Option<f64>,
}

impl PictureGate {
    /// The gate of lateral colour among others.
    pub fn of_lateral_color(gates: &mut [Self]) -> Option<&mut Self> {
        gates.iter_mut().find(|gate| gate.effect == LATERAL_COLOR)
    }

    /// Enters that a picture has a wavelength or more for each colour, or one for all, whatever the number says.
    pub fn decide_colors(&mut self, has_one_for_each: bool) {
        self.on = has_one_for_each;
        self.reason = if has_one_for_each {
            "spread of chief rays; the picture has a wavelength for each colour"
        } else {
            "spread of chief rays; the picture has one wavelength for all colours"
        };
    }
}

/// The lens, frame and scene that gates are computed for.
#[derive(Debug, Clone, Copy)]
pub struct GateSubject<'a> {
    /// The model of the focused lens.
    pub model: &'a RayModel,
    /// The colours.
    pub bands: &'a [ColorBand],
    /// The frame.
    pub frame: &'a ImageFrame,
    /// The scene.
    pub scene: &'a Scene,
    /// The distance of the focus in mm; `None` at infinity.
    pub focus: Option<f64>,
    /// The time during which the scene moves, in seconds.
    pub seconds: f64,
    /// The limit of numbers that are shares.
    pub tolerance: f64,
}

/// The effect that takes wavelengths of each colour.
const LATERAL_COLOR: &str = "lateral colour";
/// Limits in pixels: of distortion and lateral colour, of motion, and of depth.
const SHIFTED: f64 = 0.1;
const MOVED: f64 = 0.2;
const DEFOCUSED: f64 = 0.5;
/// The parts of the way to the corner at which the lens is looked at.
const PLACES: [f64; 5] = [0.0, 0.3, 0.55, 0.8, 1.0];
/// The accuracy of numbers.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-3, max_rays: 20_000 };

impl GateSubject<'_> {
    /// The gates of what the lens and the scene alone decide.
    pub fn gates(&self) -> Vec<PictureGate> {
        let share = self.tolerance;
        let carried = |effect, number, unit, limit, reason| PictureGate {
            effect,
            on: true,
            number,
            unit,
            limit,
            reason,
            saved_milliseconds: None,
        };
        let (blur, variation) = self.blur();
        let (moved, depth, edges) = (self.motion(), self.depth(), self.edges());
        let mut gates = vec![
            carried(
                "distortion",
                self.distortion(),
                "px",
                SHIFTED,
                "image height against the first-order one",
            ),
            carried(LATERAL_COLOR, self.lateral_color(), "px", SHIFTED, "spread of chief rays"),
            carried("blur", blur, "share", share, "1 - contrast by rays at half a period a pixel"),
            carried(
                "field variation",
                variation,
                "share",
                share,
                "change of that contrast between neighbours",
            ),
            carried("vignetting", self.vignetting(), "share", share, "1 - darkest over axis"),
            carried(
                "depth of field",
                depth,
                "px",
                DEFOCUSED,
                "blur of the plane farthest out of focus",
            ),
            carried(
                "occlusion",
                edges,
                "px",
                DEFOCUSED,
                "difference of blur at an edge before another plane",
            ),
            carried("motion", Some(moved), "px", MOVED, "way of the image during the exposure"),
        ];
        for gate in &mut gates {
            let is_small = gate.number.is_some_and(|number| number < gate.limit);
            gate.on = !is_small;
        }
        gates
    }

    /// True if rays from all of the pupil change contrast by more than the tolerance, or if that is not known.
    pub fn is_blurred(&self) -> bool {
        self.blur().0.is_none_or(|blur| blur > self.tolerance)
    }

    /// Tabulates the directions of light in one ring or in as many as vignetting may need: to measure what these
    /// cost.
    ///
    /// # Errors
    /// As [`LitDirections::new`].
    pub fn tabulate_directions(&self, is_even: bool) -> Result<LitDirections, PictureError> {
        let rings = if is_even { 1 } else { RINGS };
        let colors = outer(self.model, self.bands);
        LitDirections::of_rings(self.model, &colors, self.frame.reach(), rings)
    }

    /// True if something moves by as much as can be seen.
    pub fn is_moving(&self) -> bool {
        self.motion() >= MOVED
    }

    fn radii(&self) -> [f64; PLACES.len()] {
        PLACES.map(|part| part * self.frame.reach())
    }

    /// The largest difference of an image height from that of first order, in pixels.
    fn distortion(&self) -> Option<f64> {
        let scale = image_scale(self.model).ok()?;
        let off = |radius: &f64| {
            let launch =
                self.model.launch(field_at(self.model, *radius)?, self.model.primary).ok()?;
            let ray = launch.ray([0.0; 2])?;
            let slope = ray.direction.y / ray.direction.z;
            let size = match self.model.beam.object {
                Object::Infinity => slope,
                Object::Finite(distance) => ray.point.y + slope * (-distance - ray.point.z),
            };
            Some(((scale * size).abs() - radius).abs() / self.frame.pitch)
        };
        self.radii().iter().filter_map(off).reduce(f64::max)
    }

    /// The largest spread of chief rays over the wavelengths, in pixels.
    fn lateral_color(&self) -> Option<f64> {
        let wavelengths = || self.bands.iter().flat_map(|band| &band.wavelengths).map(|(w, _)| *w);
        let spread = |radius: &f64| {
            let field = field_at(self.model, *radius)?;
            let height = |w: usize| {
                let launch = self.model.launch(field, w).ok()?;
                Some(launch.unclipped_landing([0.0; 2])?.ray.point.value().y)
            };
            let heights = || wavelengths().filter_map(height);
            let most = heights().reduce(f64::max)?;
            Some((most - heights().reduce(f64::min)?) / self.frame.pitch)
        };
        self.radii().iter().filter_map(spread).reduce(f64::max)
    }

    /// One minus the smallest contrast by rays, and the largest change of it from one place to the next.
    fn blur(&self) -> (Option<f64>, Option<f64>) {
        let length = image_wavelength(self.model, self.model.primary);
        let f_number = self.model.first_order.working_f_number.map_or(1.0, f64::abs);
        let frequency = [(0.5 / self.frame.pitch).min(1.0 / (length * f_number))];
        let contrast = |radius: &f64| {
            let field = field_at(self.model, *radius)?;
            let curve =
                geometric_mtf(self.model, field, self.model.primary, &frequency, ACCURACY).ok()?;
            Some([curve.points[0].tangential, curve.points[0].sagittal].map(|v| v.modulus.value))
        };
        let found: Vec<[f64; 2]> = self.radii().par_iter().filter_map(contrast).collect();
        let least = found.iter().flatten().copied().reduce(f64::min);
        let apart = found
            .windows(2)
            .map(|pair| (pair[0][0] - pair[1][0]).abs().max((pair[0][1] - pair[1][1]).abs()));
        (least.map(|least| 1.0 - least), apart.reduce(f64::max))
    }

    /// One minus the smallest irradiance of a white card over that on the axis.
    fn vignetting(&self) -> Option<f64> {
        let light = |radius: &f64| {
            irradiance(self.model, self.model.primary, [0.0, *radius], ACCURACY).ok()
        };
        let found: Vec<Option<f64>> =
            self.radii().par_iter().map(|radius| light(radius).map(|found| found.value)).collect();
        let axis = found[0].filter(|axis| *axis > 0.0)?;
        Some(1.0 - found.iter().map(|light| light.unwrap_or(0.0)).fold(axis, f64::min) / axis)
    }

    /// The blur of planes in pixels, from the nearest: `D f |1/s − 1/s₀|`, from the entrance pupil.
    fn defocus(&self) -> Option<Vec<f64>> {
        let first = &self.model.first_order;
        let (focal_length, pupil) = (first.efl?.abs(), first.entrance_pupil);
        let (width, place) = (pupil.diameter?.abs(), pupil.position?);
        let nearness = |distance: Option<f64>| distance.map_or(0.0, |mm| 1.0 / (mm + place));
        let blur = |distance: Option<f64>| {
            let off = nearness(distance) - nearness(self.focus);
            width * focal_length * off.abs() / self.frame.pitch
        };
        Some(self.scene.layers().iter().map(|layer| blur(layer.distance)).collect())
    }

    /// The largest blur of a plane, in pixels.
    fn depth(&self) -> Option<f64> {
        Some(self.defocus()?.into_iter().fold(0.0, f64::max))
    }

    /// The largest difference of blur of two planes, in pixels.
    fn edges(&self) -> Option<f64> {
        let blur = self.defocus()?;
        let most = blur.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = blur.iter().copied().fold(f64::INFINITY, f64::min);
        Some((most - least).max(0.0))
    }

    /// The largest way of a plane's image during the exposure, by first-order optics, in pixels.
    fn motion(&self) -> f64 {
        let first = &self.model.first_order;
        let focal_length = first.efl.map_or(0.0, f64::abs);
        let place = first.entrance_pupil.position.unwrap_or(0.0);
        let way = |layer: &SceneLayer| {
            let speed = layer.velocity[0].hypot(layer.velocity[1]);
            speed / layer.distance.map_or(1.0, |distance| (distance + place).abs())
        };
        let fastest = self.scene.layers().iter().map(way).fold(0.0, f64::max);
        fastest * focal_length * self.seconds / self.frame.pitch
    }
}

/// The pixels of some tiles of a picture of a scene that moves for some seconds, with this many samples each.
pub fn render_tiles(
    renderer: &ExactRenderer<'_>,
    seconds: f64,
    seed: u32,
    (count, samples): (usize, usize),
) -> Vec<Radiance> {
    let tiles = renderer.tiles();
    let step = (tiles.len() / count.clamp(1, tiles.len().max(1))).max(1);
    let chosen = tiles.iter().skip(step / 2).step_by(step).take(count);
    let settings = ExactSettings { tolerance: -1.0, max_samples: samples, seed, seconds };
    chosen.flat_map(|tile| renderer.sample_tile(tile, &settings).values).collect()
}

/// The pixels of some tiles of a picture at rest, sampled until a tolerance is reached.
pub fn reach_tiles(renderer: &ExactRenderer<'_>, tolerance: f64, count: usize) -> Vec<Radiance> {
    let tiles = renderer.tiles();
    let step = (tiles.len() / count.clamp(1, tiles.len().max(1))).max(1);
    let chosen = tiles.iter().skip(step / 2).step_by(step).take(count);
    let settings = ExactSettings { tolerance, ..ExactSettings::default() };
    chosen.flat_map(|tile| renderer.sample_tile(tile, &settings).values).collect()
}

/// The root mean square change of some tiles from one way of rendering to another, as a share of mid grey, or of
/// the pixel where that is brighter: samples start alike, and the product over two independent sets of them leaves
/// no noise.
pub fn tile_change(
    [with, without]: [&ExactRenderer<'_>; 2],
    [seconds_with, seconds_without]: [f64; 2],
    size: (usize, usize),
) -> f64 {
    let grey = MID_GREY * with.white();
    let change = |seed: u32| -> Vec<f64> {
        let pair = (
            render_tiles(with, seconds_with, seed, size),
            render_tiles(without, seconds_without, seed, size),
        );
        let values = pair.0.iter().flatten().zip(pair.1.iter().flatten());
        values.map(|(a, b)| (a - b) / a.max(grey)).collect()
    };
    let (first, second) = (change(1), change(2));
    let sum: f64 = first.iter().zip(&second).map(|(a, b)| a * b).sum();
    (sum / first.len().max(1) as f64).max(0.0).sqrt()
}
