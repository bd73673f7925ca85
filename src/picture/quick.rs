//! The quick way to a picture: the map from image to scene interpolated, and paintings averaged over spots.
//!
//! Nothing is traced for a pixel, and nothing is sampled: a few beamlets lead from it to the planes of the
//! scene, each of which is averaged over the spot of the beamlet and the pixel together. Distortion, lateral
//! colour, blur, vignetting and depth stay; what is lost is the fine structure of spots within a cell of the
//! directions, and the exact order of planes within a spot. An [`ErrorMap`](super::ErrorMap) measures the
//! error against the exact way.

use super::beamlets::{Beamlet, BeamletTable};
use super::exact::ExactRenderer;
use super::frame::filling_size;
use super::mip_texture::MipTexture;
use super::scene::{Radiance, Scene, SceneLayer};
use super::{ColorBand, ImageFrame, Picture, PictureError};
use crate::pupil::RayModel;
use crate::trace::Fates;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// The side of a texel over that of a pixel.
const TEXEL: f64 = 0.5;
/// The largest number of texels of a painting; a larger one has coarser texels.
const MAX_TEXELS: f64 = 3.2e7;
/// The number of beamlets' places that bound what a picture sees of a plane, along a side of the frame.
const PROBES: usize = 9;

/// A scene in front of a lens, ready for quick pictures.
#[derive(Debug)]
pub struct QuickRenderer<'a> {
    scene: &'a Scene,
    frame: ImageFrame,
    colors: usize,
    table: BeamletTable,
    paintings: Vec<QuickPainting>,
    white: f64,
    overshoot: f64,
}

/// A plane of the scene with its painting, and the variance of a pixel on it.
#[derive(Debug)]
struct QuickPainting {
    distance: Option<f64>,
    center: [f64; 2],
    half_size: [f64; 2],
    texture: MipTexture,
    pixel_variance: f64,
}

impl<'a> QuickRenderer<'a> {
    /// The quick way for what an exact renderer shows through a model in some colours.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn new(
        model: &RayModel,
        bands: &[ColorBand],
        exact: &ExactRenderer<'a>,
    ) -> Result<Self, PictureError> {
        let (scene, frame, colors) = exact.subject();
        let table = BeamletTable::new(model, bands, exact, frame.reach())?;
        let painting =
            |layer: &SceneLayer| QuickPainting::new(model, &frame, &table, colors, layer);
        let paintings = scene.layers().iter().map(painting).collect::<Result<_, _>>()?;
        let overshoot = exact.directions().overshoot;
        Ok(Self { scene, frame, colors, table, paintings, white: exact.white(), overshoot })
    }

    /// The picture, without errors of its pixels.
    pub fn render(&self) -> Picture {
        self.render_until(&AtomicBool::new(false))
    }

    /// The same; once `stop` is true, the rest stays black.
    pub fn render_until(&self, stop: &AtomicBool) -> Picture {
        let [columns, rows] = self.frame.pixels;
        let mut values = vec![[0.0; 3]; columns * rows];
        let is_stopped = || stop.load(Ordering::Relaxed);
        let lines = values.par_chunks_mut(columns).enumerate().filter(|_| !is_stopped());
        let seen = lines.map(|(row, line)| {
            line.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = self.pixel([i, row]));
        });
        let complete = seen.count() == rows;
        Picture {
            frame: self.frame,
            errors: vec![[0.0; 3]; values.len()],
            values,
            white: self.white,
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete,
            overshoot: self.overshoot,
        }
    }

    /// The value of a pixel.
    fn pixel(&self, pixel: [usize; 2]) -> Radiance {
        let here = self.table.at(self.frame.point(pixel, [0.5; 2]));
        let mut found = [0.0; 3];
        for (color, value) in found.iter_mut().enumerate().take(self.colors) {
            let open = here.sideways(color) * self.background(color);
            let beamlets = here.of_color(color);
            *value = open + beamlets.map(|b| b.weight * self.radiance(&b, color)).sum::<f64>();
        }
        if self.colors == 1 { [found[0]; 3] } else { found }
    }

    fn background(&self, color: usize) -> f64 {
        self.scene.seen_background(color, self.colors)
    }

    /// The mean radiance of the scene over a beamlet.
    fn radiance(&self, beamlet: &Beamlet, color: usize) -> f64 {
        let (mut sum, mut open) = (0.0, 1.0);
        for painting in &self.paintings {
            let Some([light, cover]) = painting.mean(beamlet, color, self.colors) else { continue };
            sum += open * light;
            open *= 1.0 - cover;
            if open <= 0.0 {
                return sum;
            }
        }
        sum + open * self.background(color)
    }
}

impl QuickPainting {
    fn new(
        model: &RayModel,
        frame: &ImageFrame,
        table: &BeamletTable,
        colors: usize,
        layer: &SceneLayer,
    ) -> Result<Self, PictureError> {
        // The side of a pixel on the plane, by first-order optics.
        let [half_width, _] = filling_size(model, frame, layer.distance)?;
        let side = 2.0 * half_width / frame.pixels[0] as f64;
        let seen = seen_part(frame, table, colors, layer, side);
        let area = (seen[1][0] - seen[0][0]) * (seen[1][1] - seen[0][1]);
        let texel = (TEXEL * side).max((area / MAX_TEXELS).sqrt());
        Ok(Self {
            distance: layer.distance,
            center: layer.center,
            half_size: layer.half_size,
            texture: MipTexture::new(layer, seen, texel),
            pixel_variance: side * side / 12.0,
        })
    }

    /// A colour times its cover and the cover, averaged over a beamlet; `None` far beside the painting.
    fn mean(&self, beamlet: &Beamlet, color: usize, colors: usize) -> Option<[f64; 2]> {
        let place = beamlet.place(self.distance);
        let variance = beamlet.variance(self.distance) + self.pixel_variance;
        let from_center = [0, 1].map(|k| place[k] - self.center[k]);
        let reach = 3.0 * variance.sqrt();
        let beside = |k: usize| from_center[k].abs() > self.half_size[k] + reach;
        if beside(0) || beside(1) {
            return None;
        }
        if colors == 3 {
            return Some(self.texture.mean(from_center, variance, color));
        }
        let [red, green, blue] =
            [0, 1, 2].map(|color| self.texture.mean(from_center, variance, color));
        let light = super::exact::luminance([red[0], green[0], blue[0]]);
        Some([light, red[1]])
    }
}

/// The part of a painting that a picture sees, with a margin, from its middle: the lower left and the upper
/// right corner. No more than a margin around the painting itself, so that its ends are in the texels.
fn seen_part(
    frame: &ImageFrame,
    table: &BeamletTable,
    colors: usize,
    layer: &SceneLayer,
    side: f64,
) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let part = |i: usize| i as f64 / (PROBES - 1) as f64;
    let last = frame.pixels.map(|count| count as f64);
    for i in 0..PROBES * PROBES {
        let (right, down) = (part(i % PROBES) * last[0], part(i / PROBES) * last[1]);
        let here = table.at(frame.point([0, 0], [right, down]));
        for beamlet in (0..colors).flat_map(|color| here.of_color(color)) {
            let (place, margin) =
                (beamlet.place(layer.distance), 4.0 * beamlet.variance(layer.distance).sqrt());
            for k in [0, 1] {
                low[k] = low[k].min(place[k] - margin - layer.center[k]);
                high[k] = high[k].max(place[k] + margin - layer.center[k]);
            }
        }
    }
    let margin = 8.0 * side;
    let inside = |k: usize, v: f64, end: f64| {
        let reach = layer.half_size[k] + margin;
        if v.is_finite() { v.clamp(-reach, reach) } else { end * margin }
    };
    [
        [0, 1].map(|k| inside(k, low[k] - margin, -1.0)),
        [0, 1].map(|k| inside(k, high[k] + margin, 1.0)),
    ]
}
