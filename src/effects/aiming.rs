//! The difference that a beam aimed at the paraxial entrance pupil makes.
//!
//! A beam through the disc of the paraxial entrance pupil ends near the rim of the stop, not at it.
//! The distance by which the rays at the rim of the disc miss that of the stop bounds the part of the
//! pupil that the two beams do not share, and with it the changes of light and of the spot. A beam that the rim
//! of the stop limits is the same either way; only the chief ray, from which image heights are
//! measured, goes elsewhere.

use crate::math::Vec3;
use crate::pupil::{Launch, RayModel};
use std::f64::consts::TAU;

/// The changes of a lens's results if rays are aimed at the paraxial entrance pupil; infinite where
/// a ray that is needed to tell is not found.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AimingDifference {
    /// The shift of the chief ray in the image plane or the change of the RMS radius of a spot, the
    /// largest of any field and wavelength, in mm.
    pub shift: f64,
    /// The largest relative change of the light of a field at a wavelength.
    pub light: f64,
    /// The largest distance in the image plane of two rays with the same place in the stop, in mm; infinite
    /// if one of them alone arrives.
    pub rays: f64,
}

impl AimingDifference {
    pub(super) const UNKNOWN: Self =
        Self { shift: f64::INFINITY, light: f64::INFINITY, rays: f64::INFINITY };

    pub(super) fn worst(self, other: Self) -> Self {
        Self {
            shift: self.shift.max(other.shift),
            light: self.light.max(other.light),
            rays: self.rays.max(other.rays),
        }
    }
}

/// The rays at the rim of the paraxial entrance pupil.
const RIM_RAYS: usize = 24;
/// The rays at the rim of which the shift is measured.
const SHIFTED_RAYS: usize = 8;

/// The spot of a few rays of the real beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CoarseSpot {
    /// The RMS distance from the mean, in mm.
    rms: f64,
    /// The largest distance from the mean, in mm.
    radius: f64,
    /// The part of the rays that arrive.
    lit: f64,
}

impl CoarseSpot {
    /// The spot of the image points of some rays, `None` for a lost one; `None` if all are lost.
    pub(super) fn new(landed: &[Option<Vec3<f64>>]) -> Option<Self> {
        let count = landed.iter().flatten().count() as f64;
        let mean = landed.iter().flatten().fold(Vec3::default(), |sum, p| sum + *p) * (1.0 / count);
        let squares =
            || landed.iter().flatten().map(|p| (p.x - mean.x).powi(2) + (p.y - mean.y).powi(2));
        (count > 0.0).then(|| Self {
            rms: (squares().sum::<f64>() / count).sqrt(),
            radius: squares().fold(0.0, f64::max).sqrt(),
            lit: count / landed.len() as f64,
        })
    }

    /// The differences if a part of the pupil, relative to the whole disc, is exchanged.
    fn difference(self, part: f64) -> AimingDifference {
        let light = part / self.lit;
        // The exchanged rays lie at the edge, at most `radius` from the mean.
        let square = self.rms * self.rms + light * self.radius * self.radius;
        AimingDifference { shift: square.sqrt() - self.rms + light * self.rms, light, rays: 0.0 }
    }
}

/// The difference for the field and wavelength of a real beam, whose spot is given, if it is aimed
/// at the paraxial entrance pupil of `paraxial`.
pub(super) fn aiming_difference(
    real: &Launch<'_>,
    paraxial: &RayModel,
    spot: CoarseSpot,
) -> AimingDifference {
    let Ok(disc) = paraxial.launch(real.field, real.wavelength) else {
        return AimingDifference::UNKNOWN;
    };
    let Some(chief) = chief_shift(real, &disc) else { return AimingDifference::UNKNOWN };
    let edge = if paraxial.ends_at_disc() {
        rim_miss(real, &disc)
            .map_or(AimingDifference::UNKNOWN, |miss| spot.difference(miss * (2.0 + miss)))
    } else {
        AimingDifference::default()
    };
    edge.worst(AimingDifference { shift: chief, light: 0.0, rays: ray_shift(real, &disc) })
}

/// The largest distance between the image points of rays with the same places in the stop, in mm: those at
/// its rim, where the beams differ most. A ray that arrives in one of both alone counts as infinitely far.
fn ray_shift(a: &Launch<'_>, b: &Launch<'_>) -> f64 {
    let turn = TAU / SHIFTED_RAYS as f64;
    let places: Vec<[f64; 2]> =
        (0..SHIFTED_RAYS).map(|i| (turn * i as f64).sin_cos().into()).collect();
    let landed = |launch: &Launch<'_>| {
        let tracer = launch.channel().tracer.clone().without_rims();
        let land = |ray| {
            let landing = tracer.trace(ray);
            landing.fate.is_imaged().then_some(landing.ray.point)
        };
        let rays = launch.rays_through_stop(&places).into_iter();
        rays.map(|ray| ray.and_then(land)).collect::<Vec<_>>()
    };
    let apart = |(a, b): (Option<Vec3<f64>>, Option<Vec3<f64>>)| match (a, b) {
        (Some(a), Some(b)) => (a.x - b.x).hypot(a.y - b.y),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    };
    landed(a).into_iter().zip(landed(b)).map(apart).fold(0.0, f64::max)
}

/// The distance between the image points of two chief rays, in mm.
fn chief_shift(a: &Launch<'_>, b: &Launch<'_>) -> Option<f64> {
    let point = |launch: &Launch<'_>| Some(launch.unclipped_landing([0.0, 0.0])?.ray.point.value());
    let (a, b) = (point(a)?, point(b)?);
    Some((a.x - b.x).hypot(a.y - b.y))
}

/// The largest distance of the rays at the rim of a disc from the rim of the stop, in its radii.
fn rim_miss(real: &Launch<'_>, disc: &Launch<'_>) -> Option<f64> {
    let radius = real.channel().system.surfaces[real.model.stop()].semi_diameter;
    let turn = TAU / RIM_RAYS as f64;
    let miss = |i: usize| {
        let [x, y] = disc.stop_point((turn * i as f64).sin_cos().into())?;
        Some((x.hypot(y) / radius - 1.0).abs())
    };
    (0..RIM_RAYS).map(miss).try_fold(0.0, |most: f64, miss| Some(most.max(miss?)))
}
