//! The geometric modulation transfer function: the contrast of a grating imaged by rays alone,
//! `|mean exp(−2πi ν y)|` (Hopkins and Yzuel, Optica Acta 17, 1970).

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, Nodes, RayModel, Region, converge};
use crate::trace::ImagePoints;
use std::f64::consts::TAU;

/// The contrast at one spatial frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MtfPoint {
    /// The spatial frequency, in line pairs per mm.
    pub frequency: f64,
    /// The contrast of lines perpendicular to y: from the spread of rays along y.
    pub tangential: Estimate,
    /// The contrast of lines perpendicular to x.
    pub sagittal: Estimate,
}

/// The contrast of a field at one wavelength and some frequencies in line pairs per mm; errors are
/// absolute.
///
/// # Errors
/// The field is dark.
pub fn mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<Vec<MtfPoint>, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let at = |frequency: &f64| {
        let numbers = |nodes: &Nodes| modulation(&region, nodes, *frequency);
        let found =
            converge(&region, accuracy, numbers, |_| [1.0; 2]).ok_or(AnalysisError::NoLight)?;
        let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], found.rays);
        Ok(MtfPoint { frequency: *frequency, tangential: estimate(0), sagittal: estimate(1) })
    };
    frequencies.iter().map(at).collect()
}

fn modulation(region: &Region<'_>, nodes: &Nodes, frequency: f64) -> Option<[f64; 2]> {
    let landed = region.trace::<ImagePoints<f64>>(nodes);
    let points = &landed.sink;
    let area: f64 = landed.arrivals().map(|(_, w)| w).sum();
    let first = landed.arrivals().next()?.0;
    let (x0, y0) = (points.x[first], points.y[first]);
    let mut sums = [0.0; 4];
    for (i, w) in landed.arrivals() {
        let (sin, cos) = (TAU * frequency * (points.y[i] - y0)).sin_cos();
        sums[0] += w * cos;
        sums[1] += w * sin;
        // The mirror image of a half pupil cancels the sine.
        let from = if nodes.mirrored { 0.0 } else { x0 };
        let (sin, cos) = (TAU * frequency * (points.x[i] - from)).sin_cos();
        sums[2] += w * cos;
        sums[3] += if nodes.mirrored { 0.0 } else { w * sin };
    }
    let [a, b, c, d] = sums.map(|sum| sum / area);
    Some([a.hypot(b), c.hypot(d)])
}
