//! Diffraction in a quick picture: the picture, some pixels wider on every side, is multiplied in its Fourier
//! transform by the contrast of the spread of light.
//!
//! Where that contrast hardly changes over the picture, the one on the axis stands for all. Else the picture is
//! parted into patches that overlap, each weighted by a tent, which add up to one: every patch spreads its light as
//! the pupil of its middle does, and the spread patches are added. What this changes is in the measured error.

use crate::math::{ComplexPair, FourierSense, transform_plane};
use crate::picture::diffraction::image_wavelength;
use crate::picture::pupil_spread::PupilSpreads;
use crate::picture::{ColorBand, ImageFrame};
use crate::pupil::RayModel;
use rayon::prelude::*;

/// The most pixels by which a picture is wider on a side.
const WIDEST: f64 = 64.0;
/// The side of the plane of a patch in pixels; half of what the margins leave is the distance of patches.
const PATCH: usize = 512;

/// The blur of pictures of a frame by diffraction.
#[derive(Debug)]
pub(super) struct FrameBlur {
    /// The frame that is shown.
    pub(super) shown: ImageFrame,
    /// The pixels by which the rendered one is wider on a side.
    margin: usize,
    patches: Vec<BlurPatch>,
    /// By colour.
    lights: Vec<Vec<BlurLight>>,
    spreads: PupilSpreads,
}

/// A wavelength of a colour: its share, its place in the spreads, and its length in mm.
#[derive(Debug)]
struct BlurLight {
    share: f64,
    light: [usize; 2],
    length: f64,
}

/// A part of the rendered picture.
#[derive(Debug)]
struct BlurPatch {
    /// The column and row, of the rendered picture, at which its plane begins.
    first: [i64; 2],
    /// The columns and rows of its plane.
    sides: [usize; 2],
    /// The middle of its tent, and the distance to where that ends, along columns and rows; `None` if it is the whole
    /// picture.
    tent: Option<[[f64; 2]; 2]>,
    /// The image point whose spread it has, x and y in mm.
    at: [f64; 2],
}

impl FrameBlur {
    pub(super) fn new(
        model: &RayModel,
        bands: &[ColorBand],
        spreads: &PupilSpreads,
        shown: ImageFrame,
    ) -> Self {
        // The corner of the wider frame is as far away as light is known.
        let margin = (0.7 * spreads.margin / shown.pitch).min(WIDEST) as usize;
        let of_band = |(color, band): (usize, &ColorBand)| {
            let light = |(w, (wavelength, share)): (usize, &(usize, f64))| BlurLight {
                share: *share,
                light: [color, w],
                length: image_wavelength(model, *wavelength),
            };
            band.wavelengths.iter().enumerate().map(light).collect()
        };
        let lights = bands.iter().enumerate().map(of_band).collect();
        let mut blur =
            Self { shown, margin, patches: Vec::new(), lights, spreads: spreads.clone() };
        blur.patches = if spreads.is_even { vec![blur.whole()] } else { blur.parted() };
        blur
    }

    /// The frame to render.
    pub(super) fn rendered(&self) -> ImageFrame {
        let pixels = self.shown.pixels.map(|count| count + 2 * self.margin);
        ImageFrame { pixels, ..self.shown }
    }

    /// The whole picture as one patch.
    fn whole(&self) -> BlurPatch {
        let sides = self.rendered().pixels.map(usize::next_power_of_two);
        BlurPatch { first: [0; 2], sides, tent: None, at: [0.0; 2] }
    }

    /// Patches in steps of half of their width.
    fn parted(&self) -> Vec<BlurPatch> {
        let frame = self.rendered();
        // A side that is shorter than a patch has one in its middle and no more.
        let side = PATCH.max((4 * self.margin).next_power_of_two());
        let most = (side - 2 * self.margin) / 2;
        let along = |k: usize| {
            let parts = frame.pixels[k].div_ceil(most);
            let step = frame.pixels[k] as f64 / parts as f64;
            (0..=parts).map(move |i| (i as f64 * step, step)).collect::<Vec<_>>()
        };
        let patch = |[(x, width), (y, height)]: [(f64, f64); 2]| {
            let begin = |at: f64, step: f64| (at - step).floor() as i64 - self.margin as i64;
            BlurPatch {
                first: [begin(x, width), begin(y, height)],
                sides: [side; 2],
                tent: Some([[x, y], [width, height]]),
                at: frame.point([0, 0], [x, y]),
            }
        };
        let (across, down) = (along(0), along(1));
        down.iter().flat_map(|y| across.iter().map(move |x| [*x, *y])).map(patch).collect()
    }

    /// The shown part of a rendered picture, blurred.
    pub(super) fn apply(&self, rendered: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let [columns, rows] = self.shown.pixels;
        let mut blurred = vec![[0.0_f64; 3]; columns * rows];
        for color in 0..self.lights.len() {
            // Sums in the order of patches, whatever the number of threads.
            for patches in self.patches.chunks(16) {
                let planes: Vec<_> =
                    patches.par_iter().map(|patch| self.spread(patch, rendered, color)).collect();
                for (patch, plane) in patches.iter().zip(&planes) {
                    self.add(patch, plane, color, &mut blurred);
                }
            }
        }
        let last = self.lights.len() - 1;
        let shown = |v: [f64; 3]| [0, 1, 2].map(|color: usize| v[color.min(last)].max(0.0));
        blurred.into_iter().map(shown).collect()
    }

    /// The light of a patch in a colour, spread.
    fn spread(&self, patch: &BlurPatch, rendered: &[[f64; 3]], color: usize) -> Vec<ComplexPair> {
        let [width, height] = patch.sides;
        let mut plane: Vec<ComplexPair> = (0..width * height)
            .map(|i| [self.source(patch, rendered, [i % width, i / width], color), 0.0])
            .collect();
        transform_plane(&mut plane, width, FourierSense::Forward);
        plane.iter_mut().enumerate().for_each(|(i, v)| {
            let [re, im] = self.transfer(patch, [i % width, i / width], color);
            *v = [v[0] * re - v[1] * im, v[0] * im + v[1] * re];
        });
        transform_plane(&mut plane, width, FourierSense::Inverse);
        plane
    }

    /// The light of a pixel of a patch.
    fn source(
        &self,
        patch: &BlurPatch,
        rendered: &[[f64; 3]],
        at: [usize; 2],
        color: usize,
    ) -> f64 {
        let frame = self.rendered().pixels;
        let Some([middle, reach]) = patch.tent else {
            // Beyond its ends the picture goes on as it ends, half of the way at either of them.
            let inside = |k: usize| match at[k] {
                i if i < frame[k] => i,
                i if i < frame[k] + (patch.sides[k] - frame[k]) / 2 => frame[k] - 1,
                _ => 0,
            };
            return rendered[inside(1) * frame[0] + inside(0)][color];
        };
        let place = [0, 1].map(|k| patch.first[k] + at[k] as i64);
        let weight =
            |k: usize| (1.0 - (place[k] as f64 + 0.5 - middle[k]).abs() / reach[k]).max(0.0);
        let is_inside = |k: usize| (0..frame[k] as i64).contains(&place[k]);
        if !(is_inside(0) && is_inside(1)) {
            return 0.0;
        }
        weight(0) * weight(1) * rendered[place[1] as usize * frame[0] + place[0] as usize][color]
    }

    /// The contrast of a colour at a frequency of the plane of a patch.
    fn transfer(&self, patch: &BlurPatch, at: [usize; 2], color: usize) -> ComplexPair {
        // Columns and rows run along x and y or against them.
        let (corner, next) =
            (self.shown.point([0, 0], [0.0; 2]), self.shown.point([0, 0], [1.0; 2]));
        let nu = [0, 1].map(|k| {
            let (i, count) = (at[k] as f64, patch.sides[k] as f64);
            let turns = if 2.0 * i > count { i - count } else { i };
            turns / (count * (next[k] - corner[k]))
        });
        let radius = patch.at[0].hypot(patch.at[1]);
        let [ex, ey] = if radius > 0.0 { patch.at.map(|v| v / radius) } else { [0.0, 1.0] };
        let turned = [nu[0] * ey - nu[1] * ex, nu[0] * ex + nu[1] * ey];
        let mut sum = [0.0; 2];
        for BlurLight { share, light, length } in &self.lights[color] {
            let found = self.spreads.transfer(*light, radius, turned.map(|v| v * length));
            sum = [0, 1].map(|k| sum[k] + share * found[k]);
        }
        sum
    }

    /// Adds the spread light of a patch to the shown picture.
    fn add(
        &self,
        patch: &BlurPatch,
        plane: &[ComplexPair],
        color: usize,
        blurred: &mut [[f64; 3]],
    ) {
        let ([columns, rows], [width, height]) = (self.shown.pixels, patch.sides);
        let margin = self.margin as i64;
        for y in 0..height {
            let row = patch.first[1] + y as i64 - margin;
            if !(0..rows as i64).contains(&row) {
                continue;
            }
            for x in 0..width {
                let column = patch.first[0] + x as i64 - margin;
                if (0..columns as i64).contains(&column) {
                    let at = row as usize * columns + column as usize;
                    blurred[at][color] += plane[y * width + x][0];
                }
            }
        }
    }
}
