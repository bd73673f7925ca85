//! Diffraction in a quick picture: the picture, some pixels wider on every side, is multiplied in its Fourier
//! transform by the contrast of the unaberrated pupil on the axis.
//!
//! Pupils off the axis are taken for that one; what this changes is in the measured error of the picture.

use crate::math::{ComplexPair, FourierSense, transform_plane};
use crate::picture::diffraction::image_wavelength;
use crate::picture::pupil_spread::PupilSpreads;
use crate::picture::{ColorBand, ImageFrame};
use crate::pupil::RayModel;
use rayon::prelude::*;

/// The most pixels by which a picture is wider on a side.
const WIDEST: f64 = 64.0;

/// The blur of pictures of a frame by diffraction.
#[derive(Debug)]
pub(super) struct FrameBlur {
    /// The frame that is shown.
    pub(super) shown: ImageFrame,
    /// The pixels by which the rendered one is wider on a side.
    margin: usize,
    /// The columns and rows of the transform.
    sides: [usize; 2],
    /// By colour, the contrast at every frequency of the transform.
    transfers: Vec<Vec<f64>>,
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
        let sides = shown.pixels.map(|count| (count + 2 * margin).next_power_of_two());
        let of_band = |band: &ColorBand| {
            let frequency = |k: usize, count: usize| {
                let turns = if 2 * k > count { k as f64 - count as f64 } else { k as f64 };
                turns / (count as f64 * shown.pitch)
            };
            let at = |i: usize| {
                let nu = [frequency(i % sides[0], sides[0]), frequency(i / sides[0], sides[1])];
                let part = |(wavelength, share): &(usize, f64)| {
                    let length = image_wavelength(model, *wavelength);
                    share * spreads.transfer(0.0, nu.map(|v| v * length))
                };
                band.wavelengths.iter().map(part).sum()
            };
            (0..sides[0] * sides[1]).into_par_iter().map(at).collect()
        };
        Self { shown, margin, sides, transfers: bands.iter().map(of_band).collect() }
    }

    /// The frame to render.
    pub(super) fn rendered(&self) -> ImageFrame {
        let pixels = self.shown.pixels.map(|count| count + 2 * self.margin);
        ImageFrame { pixels, ..self.shown }
    }

    /// The shown part of a rendered picture, blurred.
    pub(super) fn apply(&self, rendered: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let [columns, rows] = self.shown.pixels;
        let blurred: Vec<_> =
            (0..self.transfers.len()).map(|color| self.color(rendered, color)).collect();
        let pixel = |i: usize| {
            let at = (i / columns + self.margin) * self.sides[0] + i % columns + self.margin;
            [0, 1, 2].map(|color: usize| blurred[color.min(blurred.len() - 1)][at][0].max(0.0))
        };
        (0..columns * rows).map(pixel).collect()
    }

    /// A colour of a picture, blurred, of the size of the transform.
    fn color(&self, rendered: &[[f64; 3]], color: usize) -> Vec<ComplexPair> {
        let [columns, rows] = self.rendered().pixels;
        let [width, height] = self.sides;
        // Beyond its ends the picture goes on as it ends, half of the way at either of them.
        let inside = |at: usize, count: usize, side: usize| {
            if at < count {
                at
            } else if at < count + (side - count) / 2 {
                count - 1
            } else {
                0
            }
        };
        let value = |i: usize| {
            let (x, y) = (inside(i % width, columns, width), inside(i / width, rows, height));
            [rendered[y * columns + x][color], 0.0]
        };
        let mut plane: Vec<ComplexPair> = (0..width * height).map(value).collect();
        transform_plane(&mut plane, width, FourierSense::Forward);
        plane
            .iter_mut()
            .zip(&self.transfers[color])
            .for_each(|(v, share)| *v = v.map(|p| p * share));
        transform_plane(&mut plane, width, FourierSense::Inverse);
        plane
    }
}
