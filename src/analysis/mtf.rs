//! The modulation transfer function by rays alone: the contrast of a grating, `|mean exp(−2πi ν·x)|`
//! over the arriving beam (Hopkins and Yzuel, Optica Acta 17, 1970).
//!
//! Values are complex, about the image point of the chief ray at the primary wavelength, so that
//! those of several wavelengths can be added: lateral colour is a phase. All frequencies come from
//! the same rays.

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, ConvergedList, Nodes, RayModel, Region, converge_list};
use crate::trace::ImagePoints;
use serde::Serialize;
use std::f64::consts::{FRAC_2_PI, TAU};

/// The optical transfer function at one spatial frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TransferValue {
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
    /// The modulus: the contrast; its error is that of the complex number.
    pub modulus: Estimate,
}

/// The contrast at one spatial frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MtfPoint {
    /// The spatial frequency, in cycles/mm.
    pub frequency: f64,
    /// For lines perpendicular to y: from the spread of light along y.
    pub tangential: TransferValue,
    /// For lines perpendicular to x.
    pub sagittal: TransferValue,
}

/// The contrast of a field against spatial frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MtfCurve {
    /// The points, in the order of the frequencies asked for.
    pub points: Vec<MtfPoint>,
    /// The image point that phases are counted from, x and y in mm.
    pub origin: [f64; 2],
    /// True if the tolerance was reached at every frequency.
    pub reached: bool,
    /// The number of rays traced.
    pub rays: usize,
    /// The share of the weight of wavelengths without light, which are left out.
    pub dark_share: f64,
}

impl TransferValue {
    /// A complex value with its error.
    pub(super) fn new(re: f64, im: f64, error: f64, rays: usize) -> Self {
        Self { re, im, modulus: Estimate::new(re.hypot(im), error, rays) }
    }
}

/// The geometric contrast of a field at one wavelength and some frequencies in cycles/mm;
/// errors are absolute.
///
/// # Errors
/// The field is dark.
pub fn geometric_mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let origin = origin(model, field, &region)?;
    let numbers = |nodes: &Nodes| transfer(&region, nodes, origin, frequencies);
    let half = Accuracy { tolerance: accuracy.tolerance / CHANGES, ..accuracy };
    let found = converge_list(&region, half, numbers, |list| vec![1.0; list.len()]);
    let mut found = found.ok_or(AnalysisError::NoLight)?;
    found.errors.iter_mut().for_each(|error| *error *= CHANGES);
    Ok(curve(frequencies, origin, &found))
}

/// The error of a contrast in changes by the last raising of the order. Its integrand oscillates, so
/// that changes do not fall evenly: those of one spot in two directions differ by up to 1.5 times
/// the sum of the last changes.
const CHANGES: f64 = 2.0;

/// The curve of converged numbers: four a frequency, the real and imaginary parts of the tangential
/// and the sagittal value.
pub(super) fn curve(frequencies: &[f64], origin: [f64; 2], found: &ConvergedList) -> MtfCurve {
    let value = |k: usize| {
        let (v, e) = (&found.values[k..k + 2], &found.errors[k..k + 2]);
        TransferValue::new(v[0], v[1], e[0].hypot(e[1]), found.rays)
    };
    let point = |(i, frequency): (usize, &f64)| MtfPoint {
        frequency: *frequency,
        tangential: value(4 * i),
        sagittal: value(4 * i + 2),
    };
    MtfCurve {
        points: frequencies.iter().enumerate().map(point).collect(),
        origin,
        reached: found.converged,
        rays: found.rays,
        dark_share: 0.0,
    }
}

/// The image point that phases are counted from: that of the chief ray at the primary wavelength, or
/// of the first ray of the pupil if the chief ray is lost.
pub(super) fn origin(
    model: &RayModel,
    field: FieldPoint,
    region: &Region<'_>,
) -> Result<[f64; 2], AnalysisError> {
    model.chief_point(field, model.primary).or_else(|_| {
        let landed = region.trace::<ImagePoints<f64>>(&region.nodes(0));
        let first = landed.arrivals().next().ok_or(AnalysisError::NoLight)?.0;
        let x = if landed.mirrored { 0.0 } else { landed.sink.x[first] };
        Ok([x, landed.sink.y[first]])
    })
}

/// The mean of `exp(−2πiν x)` over the light of some nodes, with distances from an origin: for each
/// frequency in cycles/mm the real and imaginary part of the tangential value, then of the sagittal
/// one. `None` if no ray arrives.
pub fn transfer(
    region: &Region<'_>,
    nodes: &Nodes,
    [x0, y0]: [f64; 2],
    frequencies: &[f64],
) -> Option<Vec<f64>> {
    let landed = region.trace::<ImagePoints<f64>>(nodes);
    let points = &landed.sink;
    let arrived: Vec<_> =
        landed.arrivals().map(|(i, w)| ([points.x[i] - x0, points.y[i] - y0], w)).collect();
    let area: f64 = arrived.iter().map(|(_, w)| w).sum();
    let mean = |frequency: f64, axis: usize| {
        let (mut re, mut im) = (0.0, 0.0);
        for (off, weight) in &arrived {
            let (sin, cos) = (TAU * frequency * off[axis]).sin_cos();
            re += weight * cos;
            im -= weight * sin;
        }
        // The mirror image of a half pupil cancels the sine.
        [re / area, if nodes.mirrored && axis == 0 { 0.0 } else { im / area }]
    };
    let values = frequencies.iter().flat_map(|nu| [mean(*nu, 1), mean(*nu, 0)]).flatten();
    (area > 0.0).then(|| values.collect())
}

/// The contrast of a perfect lens with a round pupil at a fraction of the frequency where it ends.
pub fn perfect_contrast(fraction: f64) -> f64 {
    let f = fraction.abs();
    if f >= 1.0 { 0.0 } else { (f.acos() - f * (1.0 - f * f).sqrt()) * FRAC_2_PI }
}

/// The geometric contrast of a field over all wavelengths: the sum of the complex values by weight.
///
/// # Errors
/// Every wavelength is dark.
pub fn polychromatic_geometric_mtf(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    sum_wavelengths(model, |wavelength| {
        geometric_mtf(model, field, wavelength, frequencies, accuracy)
    })
}

/// The sum of the curves of all wavelengths by weight; dark ones are left out and their share is
/// kept.
pub(super) fn sum_wavelengths(
    model: &RayModel,
    curve: impl Fn(usize) -> Result<MtfCurve, AnalysisError>,
) -> Result<MtfCurve, AnalysisError> {
    let curves: Vec<_> = (0..model.channels.len()).map(curve).collect();
    let weighted = || model.channels.iter().map(|channel| channel.weight).zip(&curves);
    let lit: Vec<(f64, &MtfCurve)> =
        weighted().filter_map(|(w, curve)| Some((w, curve.as_ref().ok()?))).collect();
    let total: f64 = weighted().map(|(weight, _)| weight).sum();
    let light: f64 = lit.iter().map(|(weight, _)| weight).sum();
    let first = lit.iter().find(|(weight, _)| *weight > 0.0);
    let Some((_, first)) = first else {
        let reason = curves.iter().find_map(|curve| curve.as_ref().err().copied());
        return Err(reason.unwrap_or(AnalysisError::NoLight));
    };
    let rays = lit.iter().map(|(_, curve)| curve.rays).sum();
    let sum = |of: &dyn Fn(&MtfCurve) -> TransferValue| {
        let mean = |part: &dyn Fn(&TransferValue) -> f64| -> f64 {
            lit.iter().map(|(weight, curve)| weight / light * part(&of(curve))).sum()
        };
        TransferValue::new(mean(&|v| v.re), mean(&|v| v.im), mean(&|v| v.modulus.error), rays)
    };
    let point = |i: usize| MtfPoint {
        frequency: first.points[i].frequency,
        tangential: sum(&|curve| curve.points[i].tangential),
        sagittal: sum(&|curve| curve.points[i].sagittal),
    };
    Ok(MtfCurve {
        points: (0..first.points.len()).map(point).collect(),
        origin: first.origin,
        reached: lit.iter().all(|(_, curve)| curve.reached),
        rays,
        dark_share: (total - light) / total,
    })
}
