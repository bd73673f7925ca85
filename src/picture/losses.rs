//! Losses in a picture: what the surfaces of a lens reflect and what its glasses absorb does not arrive.
//!
//! The share of light that passes changes slowly over the directions at an image point, over the distance of
//! that point from the axis and over the wavelength. It is tabulated, rays by rays with the cosines at every
//! surface, and interpolated; rays between the nodes tell the error of that. Where it is the same within the
//! tolerance over all directions and points, one number for each colour stands for it.

use super::PictureError;
use super::color_band::ColorBand;
use super::lit_directions::LitDirections;
use crate::analysis::{BackwardLens, CoatedLens, Coating, PassedLight};
use crate::lens::{Lens, SurfaceNumber};
use crate::pupil::RayModel;
use rayon::prelude::*;
use serde::Serialize;

/// The intervals over the distance from the axis, and over a side of the box of directions.
const RADII: usize = 12;
const CELLS: usize = 10;
/// The nodes along a side.
const NODES: usize = CELLS + 1;

/// The coating and the glasses that take light away on its way through a lens.
#[derive(Debug, Clone, Copy)]
pub struct LightLosses<'a> {
    /// The coating of all surfaces between air and glass.
    pub coating: Coating,
    /// The lens whose glasses absorb light, as far as that is known; `None` for clear glass.
    pub glasses: Option<&'a Lens>,
}

/// The losses of a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LossReport {
    /// The coatings.
    pub coating: String,
    /// The share of light that arrives on the axis at the middle colour, for a lit direction on average.
    pub transmission: f64,
    /// The share of the light on the axis, at the middle colour, that the glasses absorb on its way.
    pub absorbed: f64,
    /// The surfaces in front of media whose absorption is not known at all colours, and is left out there.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unknown_absorption: Vec<SurfaceNumber>,
    /// One minus the smallest share over the largest, over directions and image points of a colour: what is
    /// wrong if each colour has one share.
    pub variation: f64,
    /// True if the share varies by more than the tolerance, so that each ray has its own.
    pub by_ray: bool,
    /// The largest error of the interpolation at rays between its nodes, relatively; 0 without one.
    pub error: f64,
    /// The largest difference of the shares of both polarisations over their sum: light is taken for
    /// unpolarised, which is left out of the error.
    pub polarisation: f64,
}

/// The shares of light that pass a lens.
#[derive(Debug, Clone)]
pub(super) struct LensLosses {
    step: f64,
    /// By radius.
    rows: Vec<LossRow>,
    /// The number of wavelengths of each colour that come before it.
    offsets: Vec<usize>,
    pub(super) report: LossReport,
}

/// The shares at a distance from the axis.
#[derive(Debug, Clone)]
struct LossRow {
    /// The middle of the box of directions and half of its sides.
    bounds: [[f64; 2]; 2],
    /// By wavelength, each with its nodes row by row.
    shares: Vec<Vec<f64>>,
}

/// A lens at a wavelength, forwards for its rays and with its coatings.
struct ColorLens {
    rays: BackwardLens,
    coated: CoatedLens,
}

impl ColorLens {
    /// The light in a direction at a point of the y axis.
    fn passed(&self, radius: f64, cosines: [f64; 2]) -> Option<PassedLight> {
        let (ray, _) = self.rays.ray([0.0, radius], cosines)?;
        self.coated.passed(ray)
    }
}

/// The smallest and the largest share of a colour, and the largest difference of polarisations.
#[derive(Debug, Clone, Copy)]
struct LossRange {
    least: f64,
    most: f64,
    polarisation: f64,
}

impl LightLosses<'_> {
    /// The absorbance in 1/mm behind a surface, 0 where it is not known.
    fn absorbance(&self, surface: usize, um: f64) -> f64 {
        self.glasses.and_then(|lens| lens.absorbance(surface, um)).unwrap_or(0.0)
    }

    fn color_lens(&self, model: &RayModel, wavelength: usize) -> Result<ColorLens, PictureError> {
        let um = model.channels[wavelength].um;
        let coated = CoatedLens::new(model, wavelength, self.coating)?;
        let coated = coated.with_absorption(|surface| self.absorbance(surface, um));
        Ok(ColorLens { rays: BackwardLens::for_picture(model, wavelength)?, coated })
    }

    /// The share of light on the axis that the glasses absorb at a wavelength.
    fn absorbed(&self, model: &RayModel, wavelength: usize) -> f64 {
        let channel = &model.channels[wavelength];
        let surfaces = &channel.system.surfaces;
        // As for the rays, the space in front of the image is clear.
        let gaps = surfaces.iter().enumerate().take(surfaces.len().saturating_sub(2));
        let along = gaps.map(|(i, row)| self.absorbance(i, channel.um) * row.thickness.abs());
        1.0 - (-along.sum::<f64>()).exp()
    }

    fn unknown_absorption(&self, model: &RayModel, bands: &[ColorBand]) -> Vec<SurfaceNumber> {
        let Some(lens) = self.glasses else { return Vec::new() };
        let colors = || bands.iter().flat_map(|band| &band.wavelengths);
        let is_known = |surface: usize| {
            colors().all(|(w, _)| lens.absorbance(surface, model.channels[*w].um).is_some())
        };
        let unknown =
            (0..lens.surfaces.len().saturating_sub(1)).filter(|surface| !is_known(*surface));
        unknown.map(SurfaceNumber::new).collect()
    }
}

impl LensLosses {
    /// The losses of a model in some colours, for image points up to `reach` mm from the axis.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones, or numbers that cannot be traced.
    pub(super) fn new(
        model: &RayModel,
        bands: &[ColorBand],
        (directions, reach): (&LitDirections, f64),
        (taken, tolerance): (LightLosses<'_>, f64),
    ) -> Result<Self, PictureError> {
        let lens = |(wavelength, _): &(usize, f64)| taken.color_lens(model, *wavelength);
        let all = bands.iter().flat_map(|band| &band.wavelengths);
        let lenses = all.map(lens).collect::<Result<Vec<_>, PictureError>>()?;
        let counts = bands.iter().map(|band| band.wavelengths.len());
        let offsets: Vec<usize> = counts
            .scan(0, |sum, count| {
                *sum += count;
                Some(*sum - count)
            })
            .collect();
        let step = reach / RADII as f64;
        let row = |i: usize| LossRow::new(&lenses, directions, step * i as f64);
        let found: Vec<_> = (0..=RADII).into_par_iter().map(row).collect();
        let ranges = found.iter().filter_map(|row| row.as_ref().map(|(_, range)| range));
        let range_of = |w: usize| {
            let mine = ranges.clone().map(|all| all[w]);
            mine.reduce(|a, b| LossRange {
                least: a.least.min(b.least),
                most: a.most.max(b.most),
                polarisation: a.polarisation.max(b.polarisation),
            })
        };
        let all: Vec<LossRange> = (0..lenses.len()).filter_map(range_of).collect();
        let variation = all.iter().map(|range| 1.0 - range.least / range.most).fold(0.0, f64::max);
        let report = LossReport {
            coating: taken.coating.to_string(),
            transmission: 0.0,
            absorbed: taken.absorbed(model, bands[bands.len() / 2].wavelengths[0].0),
            unknown_absorption: taken.unknown_absorption(model, bands),
            variation,
            by_ray: variation > tolerance,
            error: 0.0,
            polarisation: all.iter().map(|range| range.polarisation).fold(0.0, f64::max),
        };
        let dark = || LossRow {
            bounds: [[0.0; 2], [1.0; 2]],
            shares: vec![vec![1.0; NODES * NODES]; lenses.len()],
        };
        let rows = found.into_iter().map(|row| row.map_or_else(dark, |(row, _)| row)).collect();
        let mut losses = Self { step, rows, offsets, report };
        losses.finish(&lenses, directions);
        Ok(losses)
    }

    /// The transmission, and either the error of the interpolation or one share for each wavelength.
    fn finish(&mut self, lenses: &[ColorLens], directions: &LitDirections) {
        let middle = self.offsets[self.offsets.len() / 2];
        let axis = self.rows[0].bounds;
        let lit = |w: usize, [center, half]: [[f64; 2]; 2]| {
            let shares = nodes([center, half]).filter_map(|cosines| lenses[w].passed(0.0, cosines));
            let lit: Vec<f64> =
                shares.filter(|light| light.is_lit).map(|light| light.mean()).collect();
            lit.iter().sum::<f64>() / lit.len().max(1) as f64
        };
        self.report.transmission = lit(middle, axis);
        if !self.report.by_ray {
            for w in 0..lenses.len() {
                let share = lit(w, axis);
                self.rows.iter_mut().for_each(|row| row.shares[w].fill(share));
            }
            return;
        }
        let mut worst: f64 = 0.0;
        for i in 0..RADII {
            let radius = (i as f64 + 0.5) * self.step;
            let Some([center, half]) = directions.bounds(radius) else { continue };
            for (w, lens) in lenses.iter().enumerate() {
                let off = [0.37, -0.61].map(|part| part * (1.0 - 0.5 * (i % 2) as f64));
                let cosines = [0, 1].map(|k| center[k] + off[k] * half[k]);
                let Some(exact) = lens.passed(radius, cosines).filter(|light| light.is_lit) else {
                    continue;
                };
                let found = self.share(w, radius, cosines);
                worst = worst.max((found / exact.mean() - 1.0).abs());
            }
        }
        self.report.error = worst;
    }

    /// The share of light of a colour and the number of its wavelength that passes in a direction at a
    /// distance from the axis, for a point of the y axis.
    pub(super) fn passed(
        &self,
        [color, wavelength]: [usize; 2],
        radius: f64,
        cosines: [f64; 2],
    ) -> f64 {
        self.share(self.offsets[color] + wavelength, radius, cosines)
    }

    fn share(&self, wavelength: usize, radius: f64, cosines: [f64; 2]) -> f64 {
        let place = (radius / self.step).clamp(0.0, RADII as f64);
        let index = (place as usize).min(RADII - 1);
        let [inner, outer] = [index, index + 1].map(|i| self.rows[i].share(wavelength, cosines));
        inner + (place - index as f64) * (outer - inner)
    }
}

/// The nodes over a box of directions, row by row.
fn nodes([center, half]: [[f64; 2]; 2]) -> impl Iterator<Item = [f64; 2]> {
    let at = move |k: usize, i: usize| center[k] + half[k] * (2.0 * i as f64 / CELLS as f64 - 1.0);
    (0..NODES * NODES).map(move |i| [at(0, i % NODES), at(1, i / NODES)])
}

impl LossRow {
    /// The shares at a distance from the axis with their ranges; `None` where it is dark.
    fn new(
        lenses: &[ColorLens],
        directions: &LitDirections,
        radius: f64,
    ) -> Option<(Self, Vec<LossRange>)> {
        let bounds = directions.bounds(radius)?;
        let mut ranges = Vec::new();
        let mut shares = Vec::new();
        for lens in lenses {
            let found: Vec<_> = nodes(bounds).map(|cosines| lens.passed(radius, cosines)).collect();
            let lit = || found.iter().flatten().filter(|light| light.is_lit);
            let range = LossRange {
                least: lit().map(PassedLight::mean).fold(f64::INFINITY, f64::min),
                most: lit().map(PassedLight::mean).fold(0.0, f64::max),
                polarisation: lit().map(polarisation).fold(0.0, f64::max),
            };
            if range.most <= 0.0 {
                return None;
            }
            // Where there is no ray at all no light is looked up, but its neighbours are mixed with it.
            let share = |light: &Option<PassedLight>| {
                light.map_or(range.least, |light| light.mean().max(0.5 * range.least))
            };
            shares.push(found.iter().map(share).collect());
            ranges.push(range);
        }
        Some((Self { bounds, shares }, ranges))
    }

    /// The share in a direction, between the four nodes around it.
    fn share(&self, wavelength: usize, cosines: [f64; 2]) -> f64 {
        let [center, half] = self.bounds;
        let place = [0, 1].map(|k| {
            let part = 0.5 * (1.0 + (cosines[k] - center[k]) / half[k]);
            (part * CELLS as f64).clamp(0.0, CELLS as f64)
        });
        let [i, j] = place.map(|v| (v as usize).min(CELLS - 1));
        let [u, v] = [place[0] - i as f64, place[1] - j as f64];
        let node = |i: usize, j: usize| self.shares[wavelength][j * NODES + i];
        let along = |j: usize| node(i, j) + u * (node(i + 1, j) - node(i, j));
        along(j) + v * (along(j + 1) - along(j))
    }
}

/// The difference of the shares of both polarisations over their sum.
fn polarisation(light: &PassedLight) -> f64 {
    let [s, p] = light.shares;
    ((s - p) / (s + p)).abs()
}
