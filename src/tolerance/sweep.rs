//! The effect of every number of the lens on each ray, from one sweep of the rays back through it.
//!
//! An error changes few numbers of surfaces, so that the cost hardly depends on the number of errors.

use super::covariance::{MadeKind, MadeNumber};
use super::folded::{ErrorParity, FoldedField};
use super::{ColourRays, ToleranceError, ToleranceScene};
use crate::math::dot;
use crate::trace::{ErrorNumber, ErrorRows, Fate, ImagePoints, Rays, TraceSink as _, Tracer};

/// The rays of one field with their derivatives by the numbers of surfaces, all wavelengths one after
/// the other.
pub(super) struct SweptField {
    colours: Vec<SweptColour>,
    /// The weight of each ray.
    weights: Vec<f64>,
    /// The distances from the centroid in mm, along x and y.
    offsets: [Vec<f64>; 2],
    /// The slopes relative to their means.
    slopes: [Vec<f64>; 2],
}

/// The derivatives of the rays of one wavelength.
struct SweptColour {
    rows: ErrorRows,
    /// The place of its first ray.
    start: usize,
    /// The index less that at the primary wavelength, behind each surface.
    dispersion: Vec<f64>,
}

impl SweptField {
    pub(super) fn new(
        scene: &ToleranceScene,
        tracers: &[Tracer<f64>],
        folded: &FoldedField<'_>,
    ) -> Result<Self, ToleranceError> {
        let rays = |colour: &ColourRays| {
            let rays: Rays<f64> = folded.rays(colour).map(|(i, _)| colour.rays[i]).collect();
            (colour.wavelength, rays)
        };
        let colours: Vec<_> = folded.field.colours.iter().map(rays).collect();
        let lost = |(colour, lost, fate): (usize, usize, Fate)| {
            let ray = folded.rays(&folded.field.colours[colour]).nth(lost);
            let ray = ray.map_or(lost, |(ray, _)| ray);
            ToleranceError::RayLost { field: folded.number, ray, fate }
        };
        let mut field = Self::of_rays(scene, tracers, &colours).map_err(lost)?;
        let weights = folded.field.colours.iter().flat_map(|colour| folded.rays(colour));
        field.weights = weights.map(|(_, weight)| weight).collect();
        for columns in [&mut field.offsets, &mut field.slopes] {
            for (axis, column) in columns.iter_mut().enumerate() {
                let cancels = folded.symmetry.cancels_mean(axis, ErrorParity::EVEN);
                let mean = if cancels { 0.0 } else { dot(&field.weights, column) };
                column.iter_mut().for_each(|value| *value -= mean);
            }
        }
        Ok(field)
    }

    /// The rays of some wavelengths without weights, with their points and slopes as they are.
    ///
    /// # Errors
    /// The first ray that does not arrive, by the place of its wavelength and its own, with its fate.
    pub(super) fn of_rays(
        scene: &ToleranceScene,
        tracers: &[Tracer<f64>],
        rays_of: &[(usize, Rays<f64>)],
    ) -> Result<Self, (usize, usize, Fate)> {
        let primary = &scene.lens.systems[scene.lens.primary];
        let (mut colours, mut count) = (Vec::new(), 0);
        let (mut offsets, mut slopes) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
        for (place, (wavelength, rays)) in rays_of.iter().enumerate() {
            let tracer = &tracers[*wavelength];
            let mut landed = ImagePoints::default();
            tracer.trace_batch(rays, &mut landed);
            if let Some(lost) = (0..rays.len()).find(|i| !landed.fate(*i).is_imaged()) {
                return Err((place, lost, landed.fate(lost)));
            }
            let own = &scene.lens.systems[*wavelength].surfaces;
            let pairs = own.iter().zip(&primary.surfaces);
            let dispersion = pairs.map(|(own, primary)| own.index - primary.index).collect();
            let found = tracer.error_slopes(rays);
            for (axis, points) in [landed.x, landed.y].into_iter().enumerate() {
                offsets[axis].extend(points);
                slopes[axis].extend_from_slice(&found.slopes[axis]);
            }
            colours.push(SweptColour { rows: found.rows, start: count, dispersion });
            count += rays.len();
        }
        Ok(Self { colours, weights: vec![0.0; count], offsets, slopes })
    }

    /// The points of the rays along x and along y: relative to the centroid but for rays without weights.
    pub(super) fn offsets(&self) -> [&[f64]; 2] {
        self.offsets.each_ref().map(Vec::as_slice)
    }

    /// Their slopes, likewise.
    pub(super) fn slopes(&self) -> [&[f64]; 2] {
        self.slopes.each_ref().map(Vec::as_slice)
    }

    /// The weight of each ray.
    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The derivative of x or y of each ray by a number.
    pub(super) fn number_effect(
        &self,
        axis: usize,
        MadeNumber { surface, kind }: MadeNumber,
        effect: &mut [f64],
    ) {
        for colour in &self.colours {
            let (number, factor) = match kind {
                MadeKind::Number(number) => (number, 1.0),
                MadeKind::Abbe => (ErrorNumber::Index, -colour.dispersion[surface]),
            };
            let row = colour.rows.row(axis, surface, number);
            let to = &mut effect[colour.start..colour.start + row.len()];
            to.iter_mut().zip(row).for_each(|(to, by)| *to = factor * by);
        }
    }
}
