//! The spot: the image points of the rays of a field.

use super::geometric_radius::geometric_radius;
use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, Nodes, PupilMoments, RayModel, Region, converge};
use crate::trace::Landings;
use rayon::prelude::*;

/// The spot of a field at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonochromaticSpot {
    /// The RMS distance of the rays from their centroid, in mm.
    pub rms: Estimate,
    /// The centroid, in mm.
    pub centroid: [Estimate; 2],
    /// The light as an area of the unit disc of the paraxial entrance pupil: π where the rays fill it.
    pub area: Estimate,
    /// The same area in mm² of the plane through the first vertex: the light of the spot.
    pub light: Estimate,
    /// The ray slopes, which give the spot out of focus.
    slopes: ArrivalSlopes,
    /// True if the tolerance was reached.
    pub converged: bool,
}

/// Moments of the slopes `L/N`, `M/N` with which the rays of a spot arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ArrivalSlopes {
    /// The mean slope.
    mean: [f64; 2],
    /// The mean square of the slope about its mean.
    variance: f64,
    /// The covariance of slope and image point, in mm.
    covariance: f64,
}

/// The spot of a field over all wavelengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// The field.
    pub field: FieldPoint,
    /// The spot at each wavelength; one may be dark by itself.
    pub channels: Vec<Result<MonochromaticSpot, AnalysisError>>,
    /// The RMS distance of the rays from the common centroid of all wavelengths, in mm.
    pub rms: Estimate,
    /// The common centroid, in mm.
    pub centroid: [Estimate; 2],
    /// The largest distance of any ray from the common centroid, in mm.
    pub radius: Estimate,
    /// The area of the pupil in mm² of the plane through the first vertex, the mean over the
    /// wavelengths by weight; a dark one counts as 0.
    pub light: Estimate,
    /// True if light gets through at every wavelength that has a weight.
    pub is_fully_lit: bool,
    /// The lit wavelengths, each with its share in the light.
    shares: Vec<(MonochromaticSpot, f64)>,
}

impl Spot {
    /// The RMS radius with the image plane moved by `defocus` mm along the light.
    pub fn rms_at(&self, defocus: f64) -> f64 {
        let place = |channel: &MonochromaticSpot, i: usize| channel.centroid_at(defocus)[i];
        let channels = || self.shares.iter();
        let center: [f64; 2] = [0, 1].map(|i| channels().map(|(c, s)| s * place(c, i)).sum());
        let square = |channel: &MonochromaticSpot| {
            let off = [0, 1].map(|i| place(channel, i) - center[i]);
            channel.rms_at(defocus).powi(2) + off[0] * off[0] + off[1] * off[1]
        };
        channels().map(|(channel, share)| share * square(channel)).sum::<f64>().sqrt()
    }

    /// The shift of the image plane that gives the smallest RMS radius, in mm along the light; `None`
    /// if all rays are parallel.
    pub fn best_focus(&self) -> Option<f64> {
        // The mean square is a parabola in the defocus: three points give its minimum.
        let at = |defocus: f64| self.rms_at(defocus).powi(2);
        let (left, middle, right) = (at(-1.0), at(0.0), at(1.0));
        let curvature = left - 2.0 * middle + right;
        (curvature > 0.0).then(|| 0.5 * (left - right) / curvature)
    }
}

/// The radius of the first dark ring of a perfect lens with this aperture, in mm.
pub fn airy_radius(model: &RayModel) -> Option<f64> {
    let um = model.channels[model.primary].um;
    model.first_order.working_f_number.map(|f| 1.22 * um * 1e-3 * f)
}

/// The spots of all fields, in order.
pub fn spots(model: &RayModel, accuracy: Accuracy) -> Vec<Result<Spot, AnalysisError>> {
    model.fields.par_iter().map(|field| spot(model, *field, accuracy)).collect()
}

/// The spot of a field over all wavelengths; errors are relative to the RMS radius.
///
/// # Errors
/// No wavelength of the field gets through: see [`AnalysisError`].
pub fn spot(
    model: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
) -> Result<Spot, AnalysisError> {
    let channels = trace_channels(model, field, accuracy);
    let pooled = combine_channels(model, &channels)?;
    let lit = || channels.iter().filter_map(|channel| channel.as_ref().ok());
    Ok(Spot {
        field,
        rms: pooled.rms,
        centroid: pooled.centroid,
        radius: radius(&pooled, lit().map(|channel| &channel.0), model, accuracy),
        light: pooled.light,
        is_fully_lit: pooled.is_fully_lit,
        shares: lit().map(|(_, spot)| *spot).zip(pooled.shares).collect(),
        channels: channels.iter().map(|c| c.as_ref().map(|c| c.1).map_err(|e| *e)).collect(),
    })
}

/// The largest distance from the common centroid; its error is that of the search, of the centroid,
/// and the shift of a ray by what is left out.
fn radius<'a>(
    pooled: &PolychromaticSpot,
    regions: impl Iterator<Item = &'a Region<'a>>,
    model: &RayModel,
    accuracy: Accuracy,
) -> Estimate {
    let [x, y] = pooled.centroid;
    let found = geometric_radius(regions, [x.value, y.value], accuracy.tolerance);
    let error = found.error + x.error.hypot(y.error) + model.neglected.ray_shift;
    Estimate::new(found.value, error, pooled.rms.rays + found.rays)
}

/// The pupil and the spot at one wavelength.
pub(super) type TransmittedChannel<'a> = (Region<'a>, MonochromaticSpot);

/// The pupil and the spot of a field at every wavelength, or why there is none.
pub(super) fn trace_channels(
    model: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
) -> Vec<Result<TransmittedChannel<'_>, AnalysisError>> {
    let trace = |wavelength| {
        let region = lit_region(model, field, wavelength)?;
        let spot = monochromatic_spot(&region, accuracy).ok_or(AnalysisError::NoLight)?;
        Ok((region, spot))
    };
    (0..model.channels.len()).into_par_iter().map(trace).collect()
}

/// The spot over all wavelengths.
pub(super) struct PolychromaticSpot {
    pub(super) rms: Estimate,
    centroid: [Estimate; 2],
    pub(super) light: Estimate,
    pub(super) is_fully_lit: bool,
    /// The share of each lit wavelength in the light.
    shares: Vec<f64>,
}

/// All wavelengths together: `rms² = Σ share (rms_λ² + |c_λ − c|²)`, with shares in the light that
/// are proportional to the weight of the wavelength times the area of its pupil.
pub(super) fn combine_channels(
    model: &RayModel,
    channels: &[Result<TransmittedChannel<'_>, AnalysisError>],
) -> Result<PolychromaticSpot, AnalysisError> {
    let weighted = || model.channels.iter().map(|channel| channel.weight).zip(channels);
    let lit: Vec<(f64, &MonochromaticSpot)> =
        weighted().filter_map(|(w, channel)| Some((w, &channel.as_ref().ok()?.1))).collect();
    let sum: f64 = lit.iter().map(|(weight, spot)| weight * spot.light.value).sum();
    if !(sum > 0.0) {
        let reason = channels.iter().find_map(|channel| channel.as_ref().err().copied());
        return Err(reason.unwrap_or(AnalysisError::NoLight));
    }
    let shares: Vec<f64> = lit.iter().map(|(w, spot)| w * spot.light.value / sum).collect();
    let rays = lit.iter().map(|(_, spot)| spot.rms.rays).sum();
    let shared = || lit.iter().map(|(_, spot)| spot).zip(&shares);
    let center: [f64; 2] =
        [0, 1].map(|i| shared().map(|(c, share)| share * c.centroid[i].value).sum());
    let center_error = [0, 1].map(|i| shared().map(|(c, share)| share * c.centroid[i].error).sum());
    let (mut square, mut change) = (0.0_f64, 0.0);
    for (spot, share) in shared().filter(|(_, share)| **share > 0.0) {
        let off = |i: usize| (spot.centroid[i].value - center[i]).abs();
        let parts = [(spot.rms.value, spot.rms.error)].into_iter();
        for (value, error) in parts.chain([0, 1].map(|i| (off(i), spot.centroid[i].error))) {
            square += share * value * value;
            change += share * error * (2.0 * value + error);
        }
    }
    Ok(PolychromaticSpot {
        rms: Estimate::new(square.sqrt(), change_of_root(square, change), rays),
        centroid: [0, 1].map(|i| Estimate::new(center[i], center_error[i], rays)),
        light: mean_light(model, &lit),
        is_fully_lit: weighted().all(|(weight, channel)| weight == 0.0 || channel.is_ok()),
        shares,
    })
}

/// The change of the root of a square that grows by `change`, which may be infinite.
fn change_of_root(square: f64, change: f64) -> f64 {
    match square.sqrt() + (square + change).sqrt() {
        sum if sum.is_finite() && sum > 0.0 => change / sum,
        _ => change,
    }
}

/// The mean area of the pupils over the wavelengths by weight; a dark one counts as 0.
fn mean_light(model: &RayModel, lit: &[(f64, &MonochromaticSpot)]) -> Estimate {
    let total: f64 = model.channels.iter().map(|channel| channel.weight).sum();
    let mut light = Estimate::new(0.0, 0.0, 0);
    for (weight, spot) in lit {
        light.value += weight / total * spot.light.value;
        light.error += weight / total * spot.light.error;
        light.rays += spot.light.rays;
    }
    light
}

/// The rounding error of the image point of a ray, in mm: a few units of the last digit of the largest
/// coordinate on its path. It bounds the accuracy of any result from a single ray.
pub fn rounding_error(model: &RayModel) -> f64 {
    let gaps =
        model.channels[model.primary].system.surfaces.iter().map(|surface| surface.thickness);
    let heights = model.first_order.marginal.heights.iter().copied();
    8.0 * f64::EPSILON * gaps.chain(heights).fold(0.0, |largest: f64, v| largest.max(v.abs()))
}

fn monochromatic_spot(region: &Region<'_>, accuracy: Accuracy) -> Option<MonochromaticSpot> {
    let rounding = rounding_error(region.launch.model);
    let found = converge(
        region,
        accuracy,
        |nodes| spot_moments(region, nodes),
        |[rms, _, _, area, ..]| {
            // The RMS radius of a perfect spot is rounding: no digit of it can converge.
            let rms = rms.max(rounding / accuracy.tolerance);
            let any = f64::INFINITY;
            [rms, rms, rms, *area, any, any, any, any]
        },
    )?;
    let neglected = region.launch.model.neglected;
    let estimate = |k: usize, least: f64, neglected: f64| {
        Estimate::new(found.values[k], found.errors[k].max(least) + neglected, found.rays)
    };
    let rms = estimate(0, rounding, neglected.shift);
    let lit = estimate(3, f64::EPSILON, neglected.light * found.values[3]);
    let scaled = |scale: f64| Estimate::new(scale * lit.value, scale * lit.error, lit.rays);
    let (unit, paraxial_unit) = (region.launch.area(), region.launch.paraxial_area());
    let reached = neglected.light <= accuracy.tolerance
        && neglected.shift <= (accuracy.tolerance * rms.value).max(rounding);
    Some(MonochromaticSpot {
        rms,
        centroid: [1, 2].map(|k| estimate(k, rounding, neglected.shift)),
        area: scaled(unit / paraxial_unit),
        light: scaled(unit),
        slopes: ArrivalSlopes {
            variance: found.values[4],
            covariance: found.values[5],
            mean: [found.values[6], found.values[7]],
        },
        converged: found.converged && reached,
    })
}

impl MonochromaticSpot {
    /// The RMS radius with the image plane moved by `defocus` mm along the light.
    pub fn rms_at(&self, defocus: f64) -> f64 {
        let ArrivalSlopes { variance: square, covariance, .. } = self.slopes;
        let mean = self.rms.value.powi(2) + defocus * (2.0 * covariance + defocus * square);
        mean.max(0.0).sqrt()
    }

    /// The centroid with the image plane moved by `defocus` mm along the light, x and y in mm.
    pub fn centroid_at(&self, defocus: f64) -> [f64; 2] {
        [0, 1].map(|i| self.centroid[i].value + defocus * self.slopes.mean[i])
    }

    /// The shift of the image plane that gives the smallest RMS radius, in mm along the light; `None`
    /// if all rays are parallel.
    pub fn best_focus(&self) -> Option<f64> {
        let ArrivalSlopes { variance: square, covariance, .. } = self.slopes;
        (square > 0.0).then(|| -covariance / square)
    }
}

/// RMS radius, centroid, area, variance of the slopes, covariance of slopes and image points, and
/// mean slope over some nodes; `None` if no ray arrives.
fn spot_moments(region: &Region<'_>, nodes: &Nodes) -> Option<[f64; 8]> {
    let traced = region.trace::<Landings<f64>>(nodes);
    let hits = &traced.sink;
    let point = |i: usize| [hits.x[i], hits.y[i]];
    let slope = |i: usize| [hits.l[i] / hits.n[i], hits.m[i] / hits.n[i]];
    let points = PupilMoments::new(&traced, 1.0, point);
    let slopes = PupilMoments::new(&traced, 1.0, slope);
    let ([x, y], [u, v], area) = (points.centroid, slopes.centroid, points.area);
    let product = |i: usize| {
        let ([px, py], [su, sv]) = (point(i), slope(i));
        (px - x) * (su - u) + (py - y) * (sv - v)
    };
    let covariance = traced.arrivals().map(|(i, w)| w * product(i)).sum::<f64>() / area;
    (area > 0.0).then(|| [points.rms_radius(), x, y, area, slopes.spread / area, covariance, u, v])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_root_is_exact_and_known_at_zero() {
        assert_eq!(change_of_root(9.0, 2.0 * 3.0 + 1.0), 1.0);
        assert_eq!(change_of_root(0.0, 4.0), 2.0);
        assert_eq!(change_of_root(0.0, 0.0), 0.0);
        assert_eq!(change_of_root(1.0, f64::INFINITY), f64::INFINITY);
        assert!((change_of_root(4.0, 4e-18) / 1e-18 - 1.0).abs() < 1e-15);
    }
}
