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
    let [sagittal, tangential] = [0, 1].map(|axis| {
        let mut sums = vec![[0.0; 2]; frequencies.len()];
        let rays: Vec<[f64; 2]> = arrived.iter().map(|(off, w)| [off[axis], *w]).collect();
        match equal_steps(frequencies) {
            Some(step) => add_in_steps(&rays, frequencies[0], step, &mut sums),
            None => add_each(&rays, frequencies, &mut sums),
        }
        sums
    });
    // The mirror image of a half pupil cancels the sine.
    let across = if nodes.mirrored { 0.0 } else { 1.0 };
    let both = tangential.iter().zip(&sagittal);
    let values = both.flat_map(|([tr, ti], [sr, si])| [*tr, *ti, *sr, across * si]);
    let values: Vec<f64> = values.map(|sum| sum / area).collect();
    (area > 0.0).then_some(values)
}

/// The largest relative departure of frequencies from equal steps, and the fewest that are worth it.
const EQUAL: f64 = 1e-12;
const FEW: usize = 6;
/// The number of rays whose phases are turned together.
const TURNED: usize = 8;

/// The step of equally spaced frequencies; `None` for others, and for few.
fn equal_steps(frequencies: &[f64]) -> Option<f64> {
    let [first, .., last] = frequencies else { return None };
    let step = (last - first) / (frequencies.len() - 1) as f64;
    let is_even = |(i, nu): (usize, &f64)| {
        (nu - first - i as f64 * step).abs() <= EQUAL * (first.abs() + last.abs())
    };
    (frequencies.len() >= FEW && frequencies.iter().enumerate().all(is_even)).then_some(step)
}

/// Adds `w exp(−2πiν x)` of rays, given by x and w, at each frequency.
fn add_each(rays: &[[f64; 2]], frequencies: &[f64], sums: &mut [[f64; 2]]) {
    for (frequency, sum) in frequencies.iter().zip(sums) {
        for [x, weight] in rays {
            let (sin, cos) = (TAU * frequency * x).sin_cos();
            sum[0] += weight * cos;
            sum[1] -= weight * sin;
        }
    }
}

/// The same at frequencies in equal steps: the phase of a ray is turned by the same angle from each to the
/// next, which a product does.
fn add_in_steps(rays: &[[f64; 2]], first: f64, step: f64, sums: &mut [[f64; 2]]) {
    for chunk in rays.chunks(TURNED) {
        let [mut re, mut im, mut turn_re, mut turn_im] = [[0.0; TURNED]; 4];
        for (k, [x, weight]) in chunk.iter().enumerate() {
            let (sin, cos) = (TAU * first * x).sin_cos();
            (re[k], im[k]) = (weight * cos, -weight * sin);
            let (sin, cos) = (TAU * step * x).sin_cos();
            (turn_re[k], turn_im[k]) = (cos, -sin);
        }
        for sum in &mut *sums {
            sum[0] += re.iter().sum::<f64>();
            sum[1] += im.iter().sum::<f64>();
            for k in 0..TURNED {
                let turned = re[k] * turn_re[k] - im[k] * turn_im[k];
                im[k] = re[k] * turn_im[k] + im[k] * turn_re[k];
                re[k] = turned;
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_turned_in_steps_are_those_of_each_frequency() {
        let rays: Vec<[f64; 2]> =
            (0..37).map(|i| [0.05 * (1.7 * f64::from(i)).sin(), 1.0 + f64::from(i % 5)]).collect();
        let even: Vec<f64> = (1..=200).map(|i| 0.5 * f64::from(i)).collect();
        assert_eq!(equal_steps(&even), Some(0.5));
        let [mut turned, mut each] = [0, 1].map(|_| vec![[0.0; 2]; even.len()]);
        add_in_steps(&rays, 0.5, 0.5, &mut turned);
        add_each(&rays, &even, &mut each);
        for (a, b) in turned.iter().flatten().zip(each.iter().flatten()) {
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
        for uneven in [&[1.0, 2.0, 3.0, 4.0, 5.0, 7.0][..], &[10.0, 20.0], &[3.0]] {
            assert_eq!(equal_steps(uneven), None);
        }
    }
}
