//! The shortfall of the geometric modulation transfer of each field.
//!
//! With `x` the place of a ray's image point along an axis and `k = 2πν`, the transfer of a field is the
//! mean `O = |O| exp(iθ)` of `exp(−ikx)` over its light, each wavelength with its weight, and
//! `d|O| = Re(exp(−iθ) dO)`: a sum over rays of `−k sin(kx + θ) dx`, and over the edges of the pupils of
//! the excess of `cos(kx + θ)` over its mean.

use super::scoped_part::ScopedPart;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError};
use crate::lens::{LensError, TermScope};
use crate::math::Vec3;
use crate::pupil::TracedPupil;
use crate::trace::{AdjointSeed, ImagePoints, Rays, SystemGradient, TraceSink as _, Tracer};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// The transfer of one field along one axis.
struct FieldTransfer {
    field: usize,
    /// The axis: 0 for x, the sagittal one of a field along y, 1 for y.
    axis: usize,
    /// The angular frequency, in 1/mm.
    k: f64,
    /// The origin of phases, in mm.
    origin: f64,
    /// The phase of the mean, in rad.
    phase: f64,
    modulation: f64,
    /// The weight of the field in the term.
    share: f64,
}

/// The rays of one wavelength: their tracer, the image coordinates and the weights.
struct ChannelPoints {
    tracer: Tracer<f64>,
    points: [Vec<f64>; 2],
    weights: Vec<f64>,
}

/// Adds the mean squared shortfalls, tangential and sagittal, of the modulation at a frequency from a
/// minimum.
pub(super) fn add_contrast_shortfall(
    context: &EvaluationContext<'_>,
    [frequency, min]: [f64; 2],
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let part = ScopedPart::new(context, scope)?;
    let wavelengths = 0..context.sampling.channels.len();
    let channels: Result<Vec<_>, _> =
        wavelengths.map(|wavelength| ChannelPoints::new(context, wavelength, part)).collect();
    let channels = channels?;
    for field in 0..context.sampling.fields.len() {
        for axis in [0, 1] {
            let Some(transfer) = FieldTransfer::new(context, &channels, field, axis, frequency)
            else {
                continue;
            };
            let shortfall = min - transfer.modulation;
            if shortfall > 0.0 {
                let slope = transfer.slope(context, &channels, sum.level)?;
                sum.add_residual(0.5 * transfer.share, shortfall, &-slope);
            }
        }
    }
    Ok(())
}

impl ChannelPoints {
    fn new(
        context: &EvaluationContext<'_>,
        wavelength: usize,
        part: ScopedPart,
    ) -> Result<Self, MeritError> {
        let channel = &context.sampling.channels[wavelength];
        let tracer =
            Tracer::new(&context.systems.unclipped[wavelength]).map_err(LensError::from)?;
        let mut landed = ImagePoints::default();
        tracer.trace_batch(&channel.rays, &mut landed);
        if let Some(i) = (0..channel.rays.len()).find(|i| !landed.fate(*i).is_imaged()) {
            return Err(super::spot::lost_ray_error(context, wavelength, i, landed.fate(i)));
        }
        let mut weights = channel.weights.clone();
        for field in 0..context.sampling.fields.len() {
            let factor = part.factor(field, wavelength);
            weights[channel.range(field)].iter_mut().for_each(|weight| *weight *= factor);
        }
        Ok(Self { tracer, points: [landed.x, landed.y], weights })
    }
}

impl FieldTransfer {
    /// The transfer of a field; `None` for one without light or outside the term.
    fn new(
        context: &EvaluationContext<'_>,
        channels: &[ChannelPoints],
        field: usize,
        axis: usize,
        frequency: f64,
    ) -> Option<Self> {
        let rays = || {
            let sampled = context.sampling.channels.iter().zip(channels);
            sampled.flat_map(move |(sampled, channel)| {
                sampled.range(field).map(move |i| (channel.points[axis][i], channel.weights[i]))
            })
        };
        let share: f64 = rays().map(|(_, weight)| weight).sum();
        if !(share > 0.0) {
            return None;
        }
        let halved = axis == 0 && context.sampling.channels.iter().all(|c| c.mirrored[field]);
        let mean = rays().map(|(x, weight)| weight * x).sum::<f64>() / share;
        // The mirror image of a half pupil cancels the sine.
        let origin = if halved { 0.0 } else { mean };
        let k = TAU * frequency;
        let (mut re, mut im) = (0.0, 0.0);
        for (x, weight) in rays() {
            let (sin, cos) = (k * (x - origin)).sin_cos();
            re += weight * cos;
            im -= if halved { 0.0 } else { weight * sin };
        }
        let (modulation, phase) = (re.hypot(im) / share, im.atan2(re));
        Some(Self { field, axis, k, origin, phase, modulation, share })
    }

    /// The phase of a ray with this coordinate against that of the mean.
    fn phase_of(&self, x: f64) -> f64 {
        self.k * (x - self.origin) + self.phase
    }

    /// The derivatives of the modulation by the variables; zeros if only the value is asked for.
    fn slope(
        &self,
        context: &EvaluationContext<'_>,
        channels: &[ChannelPoints],
        level: DerivativeLevel,
    ) -> Result<DVector<f64>, MeritError> {
        let mut slope = DVector::zeros(context.values.len());
        if level == DerivativeLevel::Value {
            return Ok(slope);
        }
        for (wavelength, channel) in channels.iter().enumerate() {
            let sampled = &context.sampling.channels[wavelength];
            let range = sampled.range(self.field);
            let rays: Rays<f64> = range.clone().map(|i| sampled.rays.get(i)).collect();
            let by_number = channel.tracer.gradient(&rays, |i| {
                let ray = range.start + i;
                let x = channel.points[self.axis][ray];
                let by = -self.k * self.phase_of(x).sin() * channel.weights[ray] / self.share;
                let point = if self.axis == 0 { [by, 0.0] } else { [0.0, by] };
                let point = Vec3::new(point[0], point[1], 0.0);
                AdjointSeed { point, ..AdjointSeed::default() }
            });
            slope += context.zoom.by_variables(context.systems, wavelength, &by_number);
        }
        slope += context.sum_over_pupils(|sampled, traced| {
            let range = context.sampling.channels[sampled.wavelength].range(self.field);
            let channel = &channels[sampled.wavelength];
            let weight: f64 = channel.weights[range].iter().sum();
            if sampled.field != self.field || !(weight > 0.0) {
                return Ok(None);
            }
            self.edge_motion(context, channel, traced, sampled).map(Some)
        })?;
        Ok(slope)
    }

    /// The part of the motion of the edge of one pupil.
    fn edge_motion(
        &self,
        context: &EvaluationContext<'_>,
        channel: &ChannelPoints,
        traced: &TracedPupil<'_>,
        pupil: &super::SampledPupil,
    ) -> Result<SystemGradient<f64>, MeritError> {
        let range = context.sampling.channels[pupil.wavelength].range(self.field);
        let weight: f64 = channel.weights[range.clone()].iter().sum();
        let cosine = |x: f64| self.phase_of(x).cos();
        let cosines = range.map(|i| channel.weights[i] * cosine(channel.points[self.axis][i]));
        let mean = cosines.sum::<f64>() / weight;
        let factor = weight / (self.share * pupil.moments.area);
        let motion = traced.edge_motion_of_points(|p| factor * (cosine(p[self.axis]) - mean));
        let why = "the pupil is disconnected or not star-shaped, and the motion of its edge is \
                   unknown; expected a goal with frozen pupils";
        motion.ok_or(MeritError::DoesNotApply { term: "geometric_mtf", why })
    }
}
