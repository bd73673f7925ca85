//! The effect of every error on the spot, from one sweep of the rays back through the lens.
//!
//! An error changes few numbers of surfaces, and the sweep gives the derivatives of each ray by all of
//! them: the cost hardly depends on the number of errors. The part of second derivatives that the
//! spot's own second derivatives by rays make is left out; the jets of [`super::sensitivities`] have
//! it.

use super::covariance::{MadeKind, MadeNumber, number_changes};
use super::folded::{ErrorParity, FoldedField, RaySymmetry, folded_fields};
use super::merits::open_tracers;
use super::{ToleranceError, ToleranceScene};
use crate::lens::Perturbation;
use crate::math::{SimdWidth, dot, run_vectorized};
use crate::trace::{ErrorNumber, ErrorRows, ImagePoints, Rays, TraceSink as _, Tracer};

/// The effect of an error on the mean square spot, without second derivatives of rays.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct SweptSensitivity {
    /// The derivative of the mean square at the image plane, in mm² per unit of the error.
    pub first: f64,
    /// The growth of the mean square by the error, in mm² per squared unit, at the image plane and with
    /// each lens refocused.
    pub growth: [f64; 2],
}

/// Means over rays of products with the effect of an error.
#[derive(Debug, Clone, Copy, Default)]
struct EffectMoments {
    /// Of the effect with itself.
    square: f64,
    /// With the offset from the centroid.
    offset: f64,
    /// With the slopes.
    slope: f64,
}

/// The effects of errors on the mean square spot.
///
/// # Errors
/// An error that is not possible, a ray that does not arrive, and a lens with GRIN media or with
/// surfaces that are decentred, tilted or irregular by design.
pub fn swept_sensitivities(
    scene: &ToleranceScene,
    errors: &[Perturbation],
) -> Result<Vec<SweptSensitivity>, ToleranceError> {
    let lens = &scene.lens;
    let none: Vec<(Perturbation, f64)> = errors.iter().map(|error| (*error, 0.0)).collect();
    super::perturb(lens, &none)?;
    let tracers = open_tracers(&lens.systems)?;
    if !tracers.iter().all(Tracer::has_error_slopes) {
        let text = "a GRIN medium, or a surface that is decentred, tilted or irregular by design";
        return Err(ToleranceError::Other(format!("found {text}; expected a plain centred lens")));
    }
    let primary = &lens.systems[lens.primary];
    let vertices = primary.vertex_positions();
    let changes = |e: &Perturbation| {
        let changes = number_changes(*e, primary, &vertices, &lens.semi_diameters).changes;
        (ErrorParity::of(e.kind), changes)
    };
    let changes: Vec<_> = errors.iter().map(changes).collect();
    let mut sums = vec![EffectMoments::default(); errors.len()];
    let mut slopes = 0.0;
    for field in folded_fields(scene) {
        let rays = SweptField::new(scene, &tracers, &field)?;
        slopes += field.weight * rays.slope_square();
        for (sum, found) in sums.iter_mut().zip(rays.all_moments(&changes)) {
            sum.square += field.weight * found.square;
            sum.offset += field.weight * found.offset;
            sum.slope += field.weight * found.slope;
        }
    }
    let of = |m: EffectMoments| SweptSensitivity {
        first: 2.0 * m.offset,
        growth: [m.square, m.square - m.slope * m.slope / slopes],
    };
    Ok(sums.into_iter().map(of).collect())
}

/// The rays of one field with their derivatives by the numbers of surfaces, all wavelengths one after
/// the other.
pub(super) struct SweptField {
    symmetry: RaySymmetry,
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
        let primary = &scene.lens.systems[scene.lens.primary];
        let (mut colours, mut weights) = (Vec::new(), Vec::new());
        let (mut offsets, mut slopes) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
        for colour in &folded.field.colours {
            let start = weights.len();
            let rays: Rays<f64> = folded.rays(colour).map(|(i, _)| colour.rays[i]).collect();
            weights.extend(folded.rays(colour).map(|(_, weight)| weight));
            let tracer = &tracers[colour.wavelength];
            let mut landed = ImagePoints::default();
            tracer.trace_batch(&rays, &mut landed);
            if let Some(lost) = (0..rays.len()).find(|i| !landed.fate(*i).is_imaged()) {
                let fate = landed.fate(lost);
                let ray = folded.rays(colour).nth(lost).map_or(lost, |(ray, _)| ray);
                return Err(ToleranceError::RayLost { field: folded.number, ray, fate });
            }
            let own = &scene.lens.systems[colour.wavelength].surfaces;
            let pairs = own.iter().zip(&primary.surfaces);
            let dispersion = pairs.map(|(own, primary)| own.index - primary.index).collect();
            let found = tracer.error_slopes(&rays);
            for (axis, points) in [landed.x, landed.y].into_iter().enumerate() {
                offsets[axis].extend(points);
                slopes[axis].extend_from_slice(&found.slopes[axis]);
            }
            colours.push(SweptColour { rows: found.rows, start, dispersion });
        }
        let symmetry = folded.symmetry;
        for columns in [&mut offsets, &mut slopes] {
            for (axis, column) in columns.iter_mut().enumerate() {
                let cancels = symmetry.cancels_mean(axis, ErrorParity::EVEN);
                let mean = if cancels { 0.0 } else { dot(&weights, column) };
                column.iter_mut().for_each(|value| *value -= mean);
            }
        }
        Ok(Self { symmetry, colours, weights, offsets, slopes })
    }

    /// The weight of each ray.
    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The derivative of x or y of each ray by a number.
    pub(super) fn number_effect(&self, axis: usize, number: MadeNumber, effect: &mut [f64]) {
        self.fill_effect(axis, &[(number, 1.0)], effect);
    }

    fn slope_square(&self) -> f64 {
        let along = |axis: usize| {
            let pairs = self.weights.iter().zip(&self.slopes[axis]);
            pairs.map(|(weight, slope)| weight * slope * slope).sum::<f64>()
        };
        along(0) + along(1)
    }

    /// The moments of errors that change these numbers.
    fn all_moments(&self, errors: &[ErrorChanges]) -> Vec<EffectMoments> {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                let mut buffers = EffectBuffers {
                    effect: vec![0.0; self.weights.len()],
                    weighted: vec![0.0; self.weights.len()],
                };
                errors.iter().map(|changes| self.moments(changes, &mut buffers)).collect()
            },
        )
    }

    #[inline(always)]
    fn moments(
        &self,
        (parity, changes): &ErrorChanges,
        EffectBuffers { effect, weighted }: &mut EffectBuffers,
    ) -> EffectMoments {
        let mut sum = EffectMoments::default();
        for axis in 0..2 {
            self.fill_effect(axis, changes, effect);
            let cancels = self.symmetry.cancels_mean(axis, *parity);
            let mean = if cancels { 0.0 } else { dot(&self.weights, effect) };
            for i in 0..effect.len() {
                effect[i] -= mean;
                weighted[i] = self.weights[i] * effect[i];
            }
            sum.square += dot(weighted, effect);
            if !self.symmetry.cancels_product(*parity, ErrorParity::EVEN) {
                sum.offset += dot(weighted, &self.offsets[axis]);
                sum.slope += dot(weighted, &self.slopes[axis]);
            }
        }
        sum
    }

    /// The derivative of x or y of each ray by an error that changes these numbers.
    #[inline(always)]
    fn fill_effect(&self, axis: usize, changes: &[(MadeNumber, f64)], effect: &mut [f64]) {
        effect.fill(0.0);
        for colour in &self.colours {
            for (MadeNumber { surface, kind }, factor) in changes {
                let (number, factor) = match kind {
                    MadeKind::Number(number) => (*number, *factor),
                    MadeKind::Abbe => (ErrorNumber::Index, -factor * colour.dispersion[*surface]),
                };
                let row = colour.rows.row(axis, *surface, number);
                let to = &mut effect[colour.start..colour.start + row.len()];
                for i in 0..row.len() {
                    to[i] += factor * row[i];
                }
            }
        }
    }
}

/// The numbers that an error changes, and its parity.
type ErrorChanges = (ErrorParity, Vec<(MadeNumber, f64)>);

/// Numbers of each ray that are overwritten for each error.
struct EffectBuffers {
    effect: Vec<f64>,
    weighted: Vec<f64>,
}
