//! The quick way to a picture: the map from image to scene interpolated, and paintings averaged over spots.
//!
//! Nothing is traced for a pixel, and nothing is sampled: beamlets lead from it to the planes of the scene,
//! each of which is averaged over the spot of the beamlet and the pixel together. Distortion, lateral colour,
//! blur, vignetting and depth stay; what is lost is the fine structure of spots within a window of the
//! directions, and the exact order of planes within a spot. An [`ErrorMap`](super::ErrorMap) measures the
//! error against the exact way.
//!
//! The picture is made in blocks, in which beamlets change as quadratics of the place, and that of a beamlet
//! on as few points as its blur allows. A few pixels of each block tell how many beamlets it needs: few where
//! the scene is even, many where it has details as fine as the structure of spots. A graphics card does the same sums, where one is installed.

mod blocks;
mod blur;
mod packed;
mod plan;
mod sums;

use super::beamlets::{BeamletRow, BeamletSpot, BeamletTable, TableSize};
use super::device::{PictureDevice, picture_device};
use super::exact::{ExactRenderer, MID_GREY, PictureSubject};
use super::frame::filling_size;
use super::mip_texture::MipTexture;
use super::scene::SceneLayer;
use super::{ColorBand, ImageFrame, Picture, PictureError};
use crate::pupil::RayModel;
use crate::trace::Fates;
use blocks::{PictureBlock, blocks};
use blur::FrameBlur;
use plan::{BlockPlan, PlanSource, ScenePlane};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The windows along a side of the directions at an image point, from the cheapest table to the finest.
const WINDOWS: [usize; 6] = [2, 4, 6, 8, 10, 13];
/// The number of these tables for a small picture.
const SMALL: usize = 3;
/// The rays along a side of the directions, in a picture of many pixels and in a small one.
const RAYS: [usize; 2] = [52, 26];
/// The root mean square difference of a block's pixels from those with the most windows that is small enough
/// for fewer, as a share of mid grey, or of the pixel where that is brighter.
const NEAR: f64 = 0.012;
/// The share of the square of that up to which a block of the two tables with the fewest windows is even.
const EVEN: f64 = 0.1;
/// The rows of a block with the most details, on which other tables are compared.
const DETAILED: usize = 4;
/// The most and the least intervals of the table over the distance from the axis, and the pixels of one.
const RADII: [usize; 2] = [48, 12];
const INTERVAL: f64 = 8.0;
/// The smallest side of a texel over that of a pixel.
const TEXEL: f64 = 0.5;
/// The share of the light whose spots may be smaller than the finest texels.
const SHARP: f64 = 0.02;
/// The largest number of texels of a painting; a larger one has coarser texels.
const MAX_TEXELS: f64 = 3.2e7;
/// The number of beamlets' places that bound what a picture sees of a plane, along a side of the frame.
const PROBES: usize = 17;

/// A scene in front of a lens, ready for quick pictures.
#[derive(Debug)]
pub struct QuickRenderer {
    frame: ImageFrame,
    colors: usize,
    /// From the fewest windows to the most.
    levels: Vec<QuickLevel>,
    background: [f64; 3],
    white: f64,
    overshoot: f64,
    /// Diffraction, which needs a wider frame than is shown.
    blur: Option<FrameBlur>,
}

/// A table, and what it shows of the scene.
#[derive(Debug)]
struct QuickLevel {
    table: BeamletTable,
    planes: Vec<ScenePlane>,
}

/// A quick picture, and what it was made on.
#[derive(Debug, Clone)]
pub struct QuickPicture {
    /// The picture, without errors of its pixels.
    pub picture: Picture,
    /// The name of the device that made it; `None` for the processor.
    pub device: Option<String>,
    /// The reason why the installed device did not make it.
    pub refused: Option<String>,
}

impl QuickRenderer {
    /// The quick way for what an exact renderer shows through a model in some colours.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn new(
        model: &RayModel,
        bands: &[ColorBand],
        exact: &ExactRenderer<'_>,
    ) -> Result<Self, PictureError> {
        Self::exposed(model, bands, exact, 0.0)
    }

    /// The same for a scene that moves for some seconds: each plane is painted as its mean over its way.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn exposed(
        model: &RayModel,
        bands: &[ColorBand],
        exact: &ExactRenderer<'_>,
        seconds: f64,
    ) -> Result<Self, PictureError> {
        Self::of_subject(model, bands, &exact.subject(), seconds)
    }

    fn of_subject(
        model: &RayModel,
        bands: &[ColorBand],
        subject: &PictureSubject<'_>,
        seconds: f64,
    ) -> Result<Self, PictureError> {
        let PictureSubject { scene, frame, directions, losses, white, spreads, aimed } = *subject;
        let blur = spreads.map(|spreads| FrameBlur::new(model, bands, spreads, frame));
        let frame = blur.as_ref().map_or(frame, FrameBlur::rendered);
        let reach = frame.reach();
        let radii = (reach / frame.pitch / INTERVAL) as usize;
        let radii = radii.clamp(RADII[1], RADII[0]);
        let is_small = radii < RADII[0];
        let windows = if is_small { &WINDOWS[..SMALL] } else { &WINDOWS[..] };
        let size = TableSize { windows, rays: RAYS[usize::from(is_small)], radii };
        let tables = match aimed {
            Some(aimed) => {
                vec![BeamletTable::aimed(model, bands, aimed, losses, (reach, radii))?]
            }
            None => BeamletTable::several(model, bands, (directions, losses), reach, size)?,
        };
        let Some(finest) = tables.last() else { return Err(PictureError::NoLight) };
        let colors = bands.len();
        let texture = |layer: &SceneLayer| {
            // The side of a pixel on the plane, by first-order optics.
            let [half_width, _] = filling_size(model, &frame, layer.distance)?;
            let pixel = 2.0 * half_width / frame.pixels[0] as f64;
            let seen = SeenLayer { layer, way: way(layer, seconds), pixel };
            Ok(Arc::new(seen.texture(finest, &frame, colors)))
        };
        let textures =
            scene.layers().iter().map(texture).collect::<Result<Vec<_>, PictureError>>()?;
        let level = |table: BeamletTable| {
            let plane = |(layer, texture): (&SceneLayer, &Arc<MipTexture>)| {
                let moved = (layer, way(layer, seconds));
                ScenePlane::new(&table, moved, colors, Arc::clone(texture))
            };
            let planes = scene.layers().iter().zip(&textures).map(plane).collect();
            QuickLevel { table, planes }
        };
        let levels = tables.into_iter().map(level).collect();
        let background = [0, 1, 2].map(|color| scene.seen_background(color, colors));
        let overshoot = directions.overshoot;
        Ok(Self { frame, colors, levels, background, white, overshoot, blur })
    }

    /// The picture by the processor.
    pub fn render(&self) -> Picture {
        self.render_until(&AtomicBool::new(false))
    }

    /// The same; once `stop` is true, the rest stays black.
    pub fn render_until(&self, stop: &AtomicBool) -> Picture {
        let blocks = blocks(&self.frame);
        let light = |block: &PictureBlock| {
            if stop.load(Ordering::Relaxed) {
                return Vec::new();
            }
            let (level, plan) = self.plan(block);
            sums::block_light(&self.source(level), block, &plan, self.background)
        };
        let lit: Vec<Vec<[f32; 3]>> = blocks.par_iter().map(light).collect();
        let [columns, rows] = self.frame.pixels;
        let mut values = vec![[0.0; 3]; columns * rows];
        for (block, light) in blocks.iter().zip(&lit) {
            for (row, light) in (block.at[1]..).zip(light.chunks(block.size[0])) {
                let line = &mut values[row * columns + block.at[0]..];
                line.iter_mut().zip(light).for_each(|(value, light)| *value = self.shown(*light));
            }
        }
        let complete = lit.iter().all(|light| !light.is_empty());
        Picture { complete, ..self.picture(values) }
    }

    /// The picture by the installed device, or by the processor without one or where it refuses; once `stop`
    /// is true, the rest stays black.
    pub fn render_fast(&self, stop: &AtomicBool) -> QuickPicture {
        let device = picture_device();
        let made = device.as_deref().map(|device| (device.name(), self.render_on(device)));
        match made {
            Some((name, Ok(picture))) => {
                QuickPicture { picture, device: Some(name.to_owned()), refused: None }
            }
            Some((name, Err(why))) => {
                let refused = Some(format!("{name}: {why}"));
                QuickPicture { picture: self.render_until(stop), device: None, refused }
            }
            None => QuickPicture { picture: self.render_until(stop), device: None, refused: None },
        }
    }

    /// The picture by a device.
    ///
    /// # Errors
    /// The reason why the device cannot make it.
    pub fn render_on(&self, device: &dyn PictureDevice) -> Result<Picture, String> {
        let blocks = blocks(&self.frame);
        let plans: Vec<_> = blocks.par_iter().map(|block| self.plan(block).1).collect();
        let source = self.source(&self.levels[0]);
        let work = source.pack((&blocks, &plans), self.background, device.group() as usize);
        let light = device.render(&work)?;
        let [columns, rows] = self.frame.pixels;
        if light.len() != 3 * columns * rows {
            return Err(format!("gave {} numbers for {} pixels", light.len(), columns * rows));
        }
        let pixel = |light: &[f32]| self.shown([light[0], light[1], light[2]]);
        Ok(self.picture(light.par_chunks_exact(3).map(pixel).collect()))
    }

    /// The plan of a block with as few windows as its pixels need, and their table.
    fn plan(&self, block: &PictureBlock) -> (&QuickLevel, BlockPlan) {
        let level = self.needed(block);
        (level, self.source(level).plan(block, usize::MAX))
    }

    /// The table with the fewest windows whose pixels in a block are near to those of the one with the most.
    /// The two with the fewest tell where the picture has details: the others are compared there only.
    fn needed(&self, block: &PictureBlock) -> &QuickLevel {
        let [first, second, finer @ ..] = &self.levels[..] else { return &self.levels[0] };
        let all = sums::probed_rows(block);
        let probed = |level: &QuickLevel, rows: &[f32]| {
            let source = self.source(level);
            let plan = source.plan(block, 1);
            sums::probed_light(&source, (block, rows), &plan, self.background)
        };
        let (coarse, fine) = (probed(first, &all), probed(second, &all));
        let columns = coarse.len() / all.len();
        let pairs = coarse.chunks(columns).zip(fine.chunks(columns));
        let mut details: Vec<(f64, f32)> =
            pairs.map(|(a, b)| self.squared_difference(a, b)).zip(all.iter().copied()).collect();
        let whole: f64 = details.iter().map(|(square, _)| square).sum();
        let wanted = NEAR * NEAR * (self.colors * coarse.len()) as f64;
        // The finer of both is wrong by less than they differ.
        let Some(finest) = finer.last().filter(|_| whole > wanted) else {
            return if whole <= EVEN * wanted { first } else { second };
        };
        details.sort_by(|a, b| b.0.total_cmp(&a.0));
        details.truncate(DETAILED);
        let rows: Vec<f32> = details.iter().map(|(_, row)| *row).collect();
        let share = details.iter().map(|(square, _)| square).sum::<f64>() / whole;
        let exact = probed(finest, &rows);
        let is_near = |level: &&QuickLevel| {
            self.squared_difference(&probed(level, &rows), &exact) <= share * wanted
        };
        std::iter::once(second).chain(finer).find(is_near).unwrap_or(finest)
    }

    /// The sum of the squared differences of pixels, as shares of mid grey, or of the pixel where that is
    /// brighter.
    fn squared_difference(&self, found: &[[f32; 3]], exact: &[[f32; 3]]) -> f64 {
        let grey = MID_GREY * self.white;
        let of_pixel = |(found, exact): (&[f32; 3], &[f32; 3])| -> f64 {
            let pairs = found.iter().zip(exact).take(self.colors);
            let share = |(a, b): (&f32, &f32)| f64::from(a - b) / f64::from(*b).max(grey);
            pairs.map(share).map(|share| share * share).sum()
        };
        found.iter().zip(exact).map(of_pixel).sum()
    }

    fn source<'a>(&'a self, level: &'a QuickLevel) -> PlanSource<'a> {
        let QuickLevel { table, planes } = level;
        PlanSource { table, planes, frame: &self.frame, colors: self.colors }
    }

    /// Red, green and blue of the colours of a pixel, all three alike if there is one.
    fn shown(&self, light: [f32; 3]) -> [f64; 3] {
        if self.colors == 1 { [f64::from(light[0]); 3] } else { light.map(f64::from) }
    }

    fn picture(&self, values: Vec<[f64; 3]>) -> Picture {
        let (frame, values) = match &self.blur {
            Some(blur) => (blur.shown, blur.apply(&values)),
            None => (self.frame, values),
        };
        Picture {
            frame,
            errors: vec![[0.0; 3]; values.len()],
            values,
            white: self.white,
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete: true,
            overshoot: self.overshoot,
        }
    }
}

/// The way of a plane in some seconds, to the right and upwards in its unit.
fn way(layer: &SceneLayer, seconds: f64) -> [f64; 2] {
    layer.velocity.map(|speed| speed * seconds)
}

impl ScenePlane {
    /// A plane for a number of colours, with its way and its painting.
    fn new(
        table: &BeamletTable,
        (layer, way): (&SceneLayer, [f64; 2]),
        colors: usize,
        texture: Arc<MipTexture>,
    ) -> Self {
        let spots = spots(table, layer);
        let scales = (0..colors).map(|color| scale(table, &spots[1], color)).collect();
        Self { spots, scales, center: layer.center, half_size: layer.half_size, way, texture }
    }
}

/// The spots of all beamlets on a plane, by row.
fn spots(table: &BeamletTable, layer: &SceneLayer) -> Vec<Vec<BeamletSpot>> {
    let of_row = |row: &BeamletRow| {
        row.beamlets.iter().map(|beamlet| beamlet.spot(layer.distance)).collect()
    };
    table.rows.iter().map(of_row).collect()
}

/// A plane as a picture sees it.
struct SeenLayer<'a> {
    layer: &'a SceneLayer,
    /// Its way during the exposure, in its unit.
    way: [f64; 2],
    /// The side of a pixel on it.
    pixel: f64,
}

impl SeenLayer<'_> {
    /// The painting for a number of colours, as far as beamlets reach, and as fine as they see it.
    fn texture(&self, table: &BeamletTable, frame: &ImageFrame, colors: usize) -> MipTexture {
        let spots = spots(table, self.layer);
        let seen = self.seen_part(frame, table, &spots);
        let side = |k: usize| seen[1][k] - seen[0][k] + self.way[k].abs();
        let area = side(0) * side(1);
        let wanted = (2.0 * sharpest(&spots, self.pixel).sqrt()).max(TEXEL * self.pixel);
        // A power of two in pixels: neighbouring points then have neighbouring texels.
        let mut texel = self.pixel * (wanted / self.pixel).log2().floor().exp2();
        while texel * texel * MAX_TEXELS < area {
            texel *= 2.0;
        }
        MipTexture::new(self.layer, seen, (texel, self.way), colors)
    }

    /// The part of a painting that a picture sees, with a margin, from its middle: the lower left and the upper
    /// right corner. No more than a margin around the painting itself, so that its ends are in the texels.
    fn seen_part(
        &self,
        frame: &ImageFrame,
        table: &BeamletTable,
        spots: &[Vec<BeamletSpot>],
    ) -> [[f64; 2]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let part = |i: usize| i as f64 / (PROBES - 1) as f64;
        let last = frame.pixels.map(|count| count as f64);
        for i in 0..PROBES * PROBES {
            let (right, down) = (part(i % PROBES) * last[0], part(i / PROBES) * last[1]);
            let place = table.place(frame.point([0, 0], [right, down]));
            for (inner, outer) in spots[place.row].iter().zip(&spots[place.row + 1]) {
                let spot = inner.mixed(outer, place.part).turned(place.turn);
                if !(spot.weight > 0.0) {
                    continue;
                }
                for k in [0, 1] {
                    let margin = 4.0 * spot.variance[2 * k].max(0.0).sqrt();
                    low[k] = low[k].min(spot.place[k] - margin - self.layer.center[k]);
                    high[k] = high[k].max(spot.place[k] + margin - self.layer.center[k]);
                }
            }
        }
        let margin = 8.0 * self.pixel;
        let inside = |k: usize, v: f64, end: f64| {
            let reach = self.layer.half_size[k] + self.way[k].abs() + margin;
            if v.is_finite() { v.clamp(-reach, reach) } else { end * margin }
        };
        [
            [0, 1].map(|k| inside(k, low[k] - margin, -1.0)),
            [0, 1].map(|k| inside(k, high[k] + margin, 1.0)),
        ]
    }
}

/// The mean place of the rays of a colour in the first row off the axis over the distance of that row.
fn scale(table: &BeamletTable, spots: &[BeamletSpot], color: usize) -> f64 {
    let spots = &spots[color * table.windows..][..table.windows];
    let weight: f64 = spots.iter().map(|spot| spot.weight).sum();
    let place: f64 = spots.iter().map(|spot| spot.weight * spot.place[1]).sum();
    if weight > 0.0 { place / weight / table.step } else { 0.0 }
}

/// The smaller variance of spots, pixels included and splines taken off, than which a share of the light of
/// [`SHARP`] has a smaller one.
fn sharpest(spots: &[Vec<BeamletSpot>], pixel: f64) -> f64 {
    let mut found: Vec<(f64, f64)> = Vec::new();
    for (row, spots) in spots.iter().enumerate() {
        for spot in spots.iter().filter(|spot| spot.weight > 0.0) {
            // Rows farther out stand for more of the picture.
            let weight = spot.weight * (row as f64 + 0.5);
            found.push((plan::least_variance(spot.variance, pixel), weight));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut rest = SHARP * found.iter().map(|(_, weight)| weight).sum::<f64>();
    for (variance, weight) in &found {
        rest -= weight;
        if rest <= 0.0 {
            return *variance;
        }
    }
    0.0
}
