//! The spot: where the rays of a field land.

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, Nodes, RayModel, Region, RegionKind, converge};
use crate::trace::{ImagePoints, Landings, Rays, TraceSink};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The spot of a field in one colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonochromaticSpot {
    /// RMS distance from its own centroid, in mm.
    pub rms: Estimate,
    /// The centroid, in mm.
    pub centroid: [Estimate; 2],
    /// The area of the pupil that is lit, in pupil coordinates: π where nothing is clipped.
    pub area: Estimate,
    /// The same in mm² of the plane through the first vertex: how much light the spot has.
    pub light: Estimate,
    /// What the spot does out of focus.
    slopes: ArrivalSlopes,
    /// Whether the tolerance was met.
    pub converged: bool,
}

/// The slopes with which the rays of a spot arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ArrivalSlopes {
    /// The mean slope.
    mean: [f64; 2],
    /// The mean square of the slope about its mean.
    variance: f64,
    /// Its covariance with the place, in mm.
    covariance: f64,
}

/// The spot of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// The field.
    pub field: FieldPoint,
    /// One entry a wavelength; a colour may be dark by itself.
    pub channels: Vec<Result<MonochromaticSpot, AnalysisError>>,
    /// RMS distance from the common centroid of all colours, in mm.
    pub rms: Estimate,
    /// The common centroid, in mm.
    pub centroid: [Estimate; 2],
    /// The largest distance of any ray from the common centroid, in mm.
    pub radius: Estimate,
    /// The lit colours with their shares in the light.
    shares: Vec<(MonochromaticSpot, f64)>,
}

impl Spot {
    /// The RMS radius with the image plane moved by `defocus` mm along the light.
    pub fn rms_at(&self, defocus: f64) -> f64 {
        let place = |color: &MonochromaticSpot, i: usize| {
            color.centroid[i].value + defocus * color.slopes.mean[i]
        };
        let colors = || self.shares.iter();
        let center: [f64; 2] = [0, 1].map(|i| colors().map(|(c, s)| s * place(c, i)).sum());
        let square = |color: &MonochromaticSpot| {
            let off = [0, 1].map(|i| place(color, i) - center[i]);
            color.rms_at(defocus).powi(2) + off[0] * off[0] + off[1] * off[1]
        };
        colors().map(|(color, share)| share * square(color)).sum::<f64>().sqrt()
    }

    /// By how much to move the image plane for the smallest RMS radius, in mm; `None` where all
    /// rays are parallel.
    pub fn best_focus(&self) -> Option<f64> {
        // The mean square is a parabola: three of its points tell where its bottom is.
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

/// The spot of a field in all colours; errors are relative to the RMS radius.
///
/// # Errors
/// Where no colour of the field gets through: see [`AnalysisError`].
pub fn spot(
    model: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
) -> Result<Spot, AnalysisError> {
    let pairs: Vec<_> = (0..model.channels.len())
        .into_par_iter()
        .map(|w| {
            let region = lit_region(model, field, w)?;
            let spot = monochromatic_spot(&region, accuracy).ok_or(AnalysisError::NoLight)?;
            Ok((region, spot))
        })
        .collect();
    let lit: Vec<_> = pairs.iter().filter_map(|pair| pair.as_ref().ok()).collect();
    let Some(shares) = shares(model, &lit) else {
        let reason = pairs.iter().find_map(|pair| pair.as_ref().err().copied());
        return Err(reason.unwrap_or(AnalysisError::NoLight));
    };
    let pooled = combine_channels(&lit, &shares);
    let center = pooled.centroid.map(|e| e.value);
    Ok(Spot {
        field,
        rms: pooled.rms,
        centroid: pooled.centroid,
        radius: geometric_radius(&lit, center, pooled.rms.error),
        shares: lit.iter().map(|pair| pair.1).zip(shares).collect(),
        channels: pairs.iter().map(|pair| pair.as_ref().map(|p| p.1).map_err(|e| *e)).collect(),
    })
}

/// The share of each lit colour in the light: its weight times the area of its pupil.
fn shares(model: &RayModel, lit: &[&(Region<'_>, MonochromaticSpot)]) -> Option<Vec<f64>> {
    let light = |(region, spot): &(Region<'_>, MonochromaticSpot)| {
        model.channels[region.launch.wavelength].weight * spot.area.value
    };
    let sum: f64 = lit.iter().map(|pair| light(pair)).sum();
    (sum > 0.0).then(|| lit.iter().map(|pair| light(pair) / sum).collect())
}

struct PolychromaticSpot {
    rms: Estimate,
    centroid: [Estimate; 2],
}

/// All colours together: `rms² = Σ share (rms_λ² + |c_λ − c|²)`.
fn combine_channels(lit: &[&(Region<'_>, MonochromaticSpot)], shares: &[f64]) -> PolychromaticSpot {
    let rays = lit.iter().map(|(_, spot)| spot.rms.rays).sum();
    let colors = || lit.iter().map(|pair| &pair.1).zip(shares);
    let center = [0, 1].map(|i| colors().map(|(c, share)| share * c.centroid[i].value).sum());
    let center_error = [0, 1].map(|i| colors().map(|(c, share)| share * c.centroid[i].error).sum());
    let (mut square, mut error) = (0.0, 0.0);
    for (color, share) in colors() {
        let off: [f64; 2] = [0, 1].map(|i| color.centroid[i].value - center[i]);
        square += share * (color.rms.value.powi(2) + off[0] * off[0] + off[1] * off[1]);
        error += share * color.rms.value * color.rms.error;
        error += share * (0..2).map(|i| off[i].abs() * color.centroid[i].error).sum::<f64>();
    }
    let rms = square.sqrt();
    let error = if rms > 0.0 { error / rms } else { 0.0 };
    PolychromaticSpot {
        rms: Estimate::new(rms, error, rays),
        centroid: [0, 1].map(|i| Estimate::new(center[i], center_error[i], rays)),
    }
}

/// What rounding may do to the place of a ray, in mm: a few units of the last digit of the largest
/// coordinate on its way. It is the error of whatever a single ray says.
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
        |nodes| SpotMoments::of(region, nodes).map(|m| m.numbers()),
        |[rms, _, _, area, ..]| {
            // What rounding leaves of a perfect spot has no digits to ask for.
            let rms = rms.max(rounding / accuracy.tolerance);
            let any = f64::INFINITY;
            [rms, rms, rms, *area, any, any, any, any]
        },
    )?;
    let estimate = |k: usize, least: f64| {
        Estimate::new(found.values[k], found.errors[k].max(least), found.rays)
    };
    let area = estimate(3, f64::EPSILON);
    let scale = region.launch.area();
    Some(MonochromaticSpot {
        rms: estimate(0, rounding),
        centroid: [estimate(1, rounding), estimate(2, rounding)],
        area,
        light: Estimate::new(scale * area.value, scale * area.error, area.rays),
        slopes: ArrivalSlopes {
            variance: found.values[4],
            covariance: found.values[5],
            mean: [found.values[6], found.values[7]],
        },
        converged: found.converged,
    })
}

impl MonochromaticSpot {
    /// The RMS radius with the image plane moved by `defocus` mm along the light.
    pub fn rms_at(&self, defocus: f64) -> f64 {
        let ArrivalSlopes { variance: square, covariance, .. } = self.slopes;
        let mean = self.rms.value.powi(2) + defocus * (2.0 * covariance + defocus * square);
        mean.max(0.0).sqrt()
    }

    /// By how much to move the image plane for the smallest RMS radius, in mm; `None` where all
    /// rays are parallel.
    pub fn best_focus(&self) -> Option<f64> {
        let ArrivalSlopes { variance: square, covariance, .. } = self.slopes;
        (square > 0.0).then(|| -covariance / square)
    }
}

/// Weighted sums over the rays that arrive.
#[derive(Debug, Clone, Copy, Default)]
struct SpotMoments {
    area: f64,
    x: f64,
    y: f64,
    square: f64,
    slope_square: f64,
    covariance: f64,
    drift: [f64; 2],
}

impl SpotMoments {
    /// The means and central second moments over some nodes; `None` where no ray arrives.
    fn of(region: &Region<'_>, nodes: &Nodes) -> Option<Self> {
        let landed = region.trace::<Landings<f64>>(nodes);
        let hits = &landed.sink;
        let area: f64 = landed.arrivals().map(|(_, w)| w).sum();
        if !(area > 0.0) {
            return None;
        }
        let mean = |of: &dyn Fn(usize) -> f64| {
            // About the first ray, so that a small spot far from the axis keeps its digits.
            let first = landed.arrivals().next().map_or(0.0, |(i, _)| of(i));
            first + landed.arrivals().map(|(i, w)| w * (of(i) - first)).sum::<f64>() / area
        };
        let slope_x = |i: usize| hits.l[i] / hits.n[i];
        let slope_y = |i: usize| hits.m[i] / hits.n[i];
        let across = |of: &dyn Fn(usize) -> f64| if nodes.mirrored { 0.0 } else { mean(of) };
        let (x, y) = (across(&|i| hits.x[i]), mean(&|i| hits.y[i]));
        let (u, v) = (across(&slope_x), mean(&slope_y));
        let mut moments = Self { area, x, y, drift: [u, v], ..Self::default() };
        for (i, w) in landed.arrivals() {
            let (dx, dy) = (hits.x[i] - x, hits.y[i] - y);
            let (du, dv) = (slope_x(i) - u, slope_y(i) - v);
            moments.square += w * (dx * dx + dy * dy) / area;
            moments.slope_square += w * (du * du + dv * dv) / area;
            moments.covariance += w * (dx * du + dy * dv) / area;
        }
        Some(moments)
    }

    fn numbers(&self) -> [f64; 8] {
        let Self { area, x, y, square, slope_square, covariance, drift: [u, v] } = *self;
        [square.sqrt(), x, y, area, slope_square, covariance, u, v]
    }
}

/// Rays around the edge at which the largest distance is looked for.
const EDGE_RAYS: usize = 128;

/// The largest distance of a ray from a point: the rays at the edge, and those of a quadrature
/// inside it. The error is what half of the edge rays would have missed.
fn geometric_radius(
    lit: &[&(Region<'_>, MonochromaticSpot)],
    center: [f64; 2],
    rms_error: f64,
) -> Estimate {
    let (mut all, mut half, mut rays) = (0.0f64, 0.0f64, 0);
    for (region, spot) in lit {
        let inside = region.nodes(2.min(region.orders() - 1));
        let edge = edge_points(region);
        rays += spot.rms.rays + inside.points.len() + edge.len();
        let far = farthest_ray(region, &inside.points, center);
        let (even, odd): (Vec<_>, Vec<_>) =
            edge.iter().copied().enumerate().partition(|(i, _)| i % 2 == 0);
        let strip = |list: Vec<(usize, [f64; 2])>| list.into_iter().map(|(_, p)| p).collect();
        let (even, odd): (Vec<[f64; 2]>, Vec<[f64; 2]>) = (strip(even), strip(odd));
        let far_even = far.max(farthest_ray(region, &even, center));
        all = all.max(far_even).max(farthest_ray(region, &odd, center));
        half = half.max(far_even);
    }
    Estimate::new(all, (all - half).max(rms_error), rays)
}

/// Points just inside the edge of a pupil.
fn edge_points(region: &Region<'_>) -> Vec<[f64; 2]> {
    let turn = if region.launch.is_symmetric() { PI } else { TAU };
    let at = |i: usize| turn * i as f64 / EDGE_RAYS as f64;
    let inside = 1.0 - 1e-9;
    match &region.kind {
        RegionKind::Clear => (0..=EDGE_RAYS)
            .map(|i| at(i).sin_cos())
            .map(|(s, c)| [inside * s, inside * c])
            .collect(),
        RegionKind::StarShaped(boundary) => boundary.points(&region.launch, EDGE_RAYS, inside),
        RegionKind::Irregular { annulus: Some(ring), .. } => {
            ring.outer.points(&region.launch, EDGE_RAYS, inside)
        }
        RegionKind::Dark | RegionKind::Unbounded | RegionKind::Irregular { .. } => Vec::new(),
    }
}

fn farthest_ray(region: &Region<'_>, points: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let rays: Rays<f64> = points.iter().filter_map(|p| region.launch.ray(*p)).collect();
    let mut landed = ImagePoints::default();
    region.launch.channel().tracer.trace_batch(&rays, &mut landed);
    let arrived = (0..rays.len()).filter(|i| landed.fate(*i).is_imaged());
    arrived.map(|i| (landed.x[i] - x).hypot(landed.y[i] - y)).fold(0.0, f64::max)
}
