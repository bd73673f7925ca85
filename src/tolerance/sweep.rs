//! The effect of every error on the spot, from one sweep of the rays back through the lens.
//!
//! An error changes few numbers of surfaces, and the sweep gives the derivatives of each ray by all of
//! them: the cost hardly depends on the number of errors. The part of second derivatives that the
//! spot's own second derivatives by rays make is left out; the jets of [`super::sensitivities`] have
//! it.

use super::covariance::{MadeKind, MadeNumber, number_changes};
use super::merits::open_tracers;
use super::{FieldBeam, ToleranceError, ToleranceScene};
use crate::lens::Perturbation;
use crate::trace::{ErrorNumber, ErrorSlopes, ImagePoints, Rays, TraceSink as _, Tracer};

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
    let changes: Vec<_> = errors
        .iter()
        .map(|e| number_changes(*e, primary, &vertices, &lens.semi_diameters).changes)
        .collect();
    let mut sums = vec![EffectMoments::default(); errors.len()];
    let mut slopes = 0.0;
    for (number, field) in scene.beam.fields.iter().enumerate() {
        let rays = SweptField::new(scene, &tracers, (number, field))?;
        slopes += field.weight * rays.slope_square();
        for (sum, changes) in sums.iter_mut().zip(&changes) {
            let found = rays.moments(changes);
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

/// The rays of one field with their derivatives by the numbers of surfaces.
struct SweptField<'a> {
    field: &'a FieldBeam,
    colours: Vec<SweptColour>,
    /// The means of the slopes.
    slopes: [f64; 2],
    /// The centroid, in mm.
    center: [f64; 2],
}

/// The rays of one field and wavelength.
struct SweptColour {
    points: [Vec<f64>; 2],
    found: ErrorSlopes,
    /// The index less that at the primary wavelength, behind each surface.
    dispersion: Vec<f64>,
}

impl<'a> SweptField<'a> {
    fn new(
        scene: &ToleranceScene,
        tracers: &[Tracer<f64>],
        (number, field): (usize, &'a FieldBeam),
    ) -> Result<Self, ToleranceError> {
        let primary = &scene.lens.systems[scene.lens.primary];
        let mut colours = Vec::new();
        for colour in &field.colours {
            let rays: Rays<f64> = colour.rays.iter().copied().collect();
            let tracer = &tracers[colour.wavelength];
            let mut landed = ImagePoints::default();
            tracer.trace_batch(&rays, &mut landed);
            if let Some(ray) = (0..rays.len()).find(|i| !landed.fate(*i).is_imaged()) {
                let fate = landed.fate(ray);
                return Err(ToleranceError::RayLost { field: number, ray, fate });
            }
            let own = &scene.lens.systems[colour.wavelength].surfaces;
            let pairs = own.iter().zip(&primary.surfaces);
            let dispersion = pairs.map(|(own, primary)| own.index - primary.index).collect();
            let found = tracer.error_slopes(&rays);
            colours.push(SweptColour { points: [landed.x, landed.y], found, dispersion });
        }
        let mut swept = Self { field, colours, slopes: [0.0; 2], center: [0.0; 2] };
        for axis in 0..2 {
            swept.slopes[axis] = swept.mean(|colour, i| colour.found.slopes[axis][i]);
            swept.center[axis] = swept.mean(|colour, i| colour.points[axis][i]);
        }
        Ok(swept)
    }

    /// The mean of a number of each ray.
    fn mean(&self, of: impl Fn(&SweptColour, usize) -> f64) -> f64 {
        let colours = self.colours.iter().zip(&self.field.colours);
        let sum = |(swept, colour): (&SweptColour, &super::ColourRays)| {
            colour.weights.iter().enumerate().map(|(i, w)| w * of(swept, i)).sum::<f64>()
        };
        colours.map(sum).sum()
    }

    fn slope_square(&self) -> f64 {
        let along = |axis: usize| {
            let mean = self.slopes[axis];
            self.mean(|colour, i| (colour.found.slopes[axis][i] - mean).powi(2))
        };
        along(0) + along(1)
    }

    /// The moments of an error that changes these numbers.
    fn moments(&self, changes: &[(MadeNumber, f64)]) -> EffectMoments {
        let mut sum = EffectMoments::default();
        for axis in 0..2 {
            let effects: Vec<Vec<f64>> =
                self.colours.iter().map(|colour| colour.effect(axis, changes)).collect();
            let pairs = || effects.iter().zip(&self.colours).zip(&self.field.colours);
            let mean: f64 = pairs()
                .map(|((effect, _), rays)| {
                    effect.iter().zip(&rays.weights).map(|(e, w)| e * w).sum::<f64>()
                })
                .sum();
            for ((effect, colour), rays) in pairs() {
                for (i, weight) in rays.weights.iter().enumerate() {
                    let weighted = weight * (effect[i] - mean);
                    sum.square += weighted * (effect[i] - mean);
                    sum.offset += weighted * (colour.points[axis][i] - self.center[axis]);
                    sum.slope += weighted * (colour.found.slopes[axis][i] - self.slopes[axis]);
                }
            }
        }
        sum
    }
}

impl SweptColour {
    /// The derivative of x or y of each ray by an error that changes these numbers.
    fn effect(&self, axis: usize, changes: &[(MadeNumber, f64)]) -> Vec<f64> {
        let mut effect = vec![0.0; self.points[axis].len()];
        for (MadeNumber { surface, kind }, factor) in changes {
            let (number, factor) = match kind {
                MadeKind::Number(number) => (*number, *factor),
                MadeKind::Abbe => (ErrorNumber::Index, -factor * self.dispersion[*surface]),
            };
            let row = self.found.rows.row(axis, *surface, number);
            effect.iter_mut().zip(row).for_each(|(to, by)| *to += factor * by);
        }
        effect
    }
}
