//! The sensitivity of light and sharpness to the semi-diameters: the derivatives by each of them.
//!
//! With `A` the area of the pupil and `L` the integral of the squared distance from the centroid
//! over it, the RMS radius of the spot is `r = √(L/A)`, so that
//!
//! ```text
//! dr = (dL − r² dA) / (2 A r)
//! ```
//!
//! Both derivatives are those of a moving edge (Teh, *Computational Lens Design*, eq. 3.16): a
//! semi-diameter changes no ray, only the set of rays that get through.

use super::Estimate;
use crate::lens::FieldPoint;
use crate::pupil::{
    Accuracy, Aiming, DerivativeError, DerivativeEstimator, PupilDerivative, QuadraticIntegrand,
    RayModel, Region, choose_estimator, differentiate,
};

/// The sensitivities of the light and sharpness of a field, or of all fields, to the
/// semi-diameters.
#[derive(Debug, Clone, PartialEq)]
pub struct RimSensitivities {
    /// The area of the pupil, in mm² of the plane through the first vertex.
    pub area: f64,
    /// The RMS radius of the spot about its centroid, in mm.
    pub rms: f64,
    /// The sensitivity to the semi-diameter of each surface.
    pub surfaces: Vec<RimSensitivity>,
    /// The number of rays traced.
    pub rays: usize,
}

/// The sensitivity to the semi-diameter of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimSensitivity {
    /// The derivative of the area of the pupil, in mm² per mm.
    pub area: Estimate,
    /// The derivative of the RMS radius of the spot, in mm per mm.
    pub rms: Estimate,
}

impl RimSensitivity {
    /// True if one of the derivatives is larger than its error.
    pub fn is_significant(&self) -> bool {
        [self.area, self.rms].iter().any(|number| number.value.abs() > number.error)
    }
}

/// The accuracy if the edge is sampled by a warp field.
const SAMPLED_ACCURACY: Accuracy = Accuracy { tolerance: 0.05, max_rays: 32_768 };
/// The order of quadrature for area and spot.
const ORDER: usize = 3;
/// The relative rounding error of a sum over rays.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The sensitivities of a field at a wavelength. If the edge of the pupil is sampled by a warp
/// field, they are known to a few percent of the largest.
///
/// # Errors
/// A pupil without light or edge.
pub fn rim_sensitivities(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<RimSensitivities, DerivativeError> {
    if model.aiming == Aiming::Stop {
        return rim_sensitivities(&model.limited_by_stop()?, field, wavelength, accuracy);
    }
    let region = Region::new(model.launch(field, wavelength)?);
    let (estimator, _) = choose_estimator(&region, accuracy)?;
    let accuracy = if estimator == DerivativeEstimator::Warp { SAMPLED_ACCURACY } else { accuracy };
    let lit = region.trace_pupil(ORDER);
    let (area, center) = (lit.moments.area, lit.moments.centroid);
    let light = differentiate(&region, &QuadraticIntegrand::throughput(), estimator, accuracy)?;
    let spread = differentiate(&region, &QuadraticIntegrand::spread(center), estimator, accuracy)?;
    let rms = lit.moments.rms_radius();
    let rays = lit.rays_traced + light.rays + spread.rays;
    let effect = |i: usize| {
        sensitivity(
            [area, rms],
            semi_diameter_derivative(&light, i),
            semi_diameter_derivative(&spread, i),
            rays,
        )
    };
    let surfaces = (0..light.gradient.surfaces.len()).map(effect).collect();
    Ok(RimSensitivities { area, rms, surfaces, rays })
}

/// The derivative by a semi-diameter, and its error.
fn semi_diameter_derivative(of: &PupilDerivative, surface: usize) -> [f64; 2] {
    [&of.gradient, &of.error].map(|gradient| gradient.surfaces[surface].semi_diameter)
}

fn sensitivity(
    [area, rms]: [f64; 2],
    [darkening, dark_error]: [f64; 2],
    [spread, spread_error]: [f64; 2],
    rays: usize,
) -> RimSensitivity {
    // The throughput is the negative of the area.
    let (brightening, square, scale) = (-darkening, rms * rms, 2.0 * area * rms);
    let over = |value: f64| if scale > 0.0 { value / scale } else { 0.0 };
    let blur = over(spread - square * brightening);
    let blur_error = over(spread_error + square * dark_error);
    let number =
        |value: f64, error: f64| Estimate::new(value, error.max(ROUNDING * value.abs()), rays);
    RimSensitivity { area: number(brightening, dark_error), rms: number(blur, blur_error) }
}

/// The sensitivities of several fields together, each with its weight: of the mean of their areas,
/// and of the root mean square of their radii. `None` if no field has a weight.
pub fn mean_rim_sensitivities(fields: &[(f64, &RimSensitivities)]) -> Option<RimSensitivities> {
    let sum: f64 = fields.iter().map(|(weight, _)| weight).sum();
    let first = fields.first().filter(|_| sum > 0.0)?.1;
    let mean = |of: &dyn Fn(&RimSensitivities) -> f64| {
        fields.iter().map(|(weight, rims)| weight / sum * of(rims)).sum::<f64>()
    };
    let rms = mean(&|rims| rims.rms * rims.rms).sqrt();
    let rays = fields.iter().map(|(_, rims)| rims.rays).sum();
    // dr = Σ w rᵢ drᵢ / r.
    let share = |rims: &RimSensitivities| if rms > 0.0 { rims.rms / rms } else { 0.0 };
    let effect = |i: usize| {
        let area = |of: fn(&Estimate) -> f64| mean(&|rims| of(&rims.surfaces[i].area));
        let blur = |of: fn(&Estimate) -> f64| mean(&|rims| share(rims) * of(&rims.surfaces[i].rms));
        let [value, error]: [fn(&Estimate) -> f64; 2] = [|e| e.value, |e| e.error];
        RimSensitivity {
            area: Estimate::new(area(value), area(error), rays),
            rms: Estimate::new(blur(value), blur(error), rays),
        }
    };
    let surfaces = (0..first.surfaces.len()).map(effect).collect();
    Some(RimSensitivities { area: mean(&|rims| rims.area), rms, surfaces, rays })
}
