//! Contrast of the same lens by Optiland against the exact one.
//!
//! Optiland computes one wavelength at a time; its numbers are compared wavelength by wavelength with those of this
//! program to a tight tolerance.

use super::{ask, wrong_shape};
use crate::analysis::{AnalysisError, MtfCurve, diffraction_mtf, geometric_mtf};
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::lens::FieldPoint;
use crate::measure::TransferMethod;
use crate::pupil::{Accuracy, RayModel};
use serde::{Deserialize, Serialize};
use std::path::Path;

const SCRIPT: &str = include_str!("mtf.py");
/// The tolerance of the contrast that others are compared with.
const EXACT: f64 = 1e-5;

/// A chart of contrast by Optiland.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(in crate::cli::measure) struct OptilandRow {
    pub(in crate::cli::measure) method: TransferMethod,
    /// The number of rays along a side of the pupil.
    pub(in crate::cli::measure) rays: usize,
    /// The largest difference of a modulus from the exact one.
    pub(in crate::cli::measure) error: f64,
    /// The time of the chart, in milliseconds.
    pub(in crate::cli::measure) ms: f64,
}

/// The results of Optiland.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::cli::measure) struct OptilandCurves {
    pub(in crate::cli::measure) version: String,
    pub(in crate::cli::measure) rows: Vec<OptilandRow>,
}

/// The output of the script.
#[derive(Deserialize)]
struct ScriptOutput {
    version: String,
    rows: Vec<ScriptRow>,
}

#[derive(Deserialize)]
struct ScriptRow {
    method: TransferMethod,
    rays: usize,
    ms: f64,
    /// By wavelength, field, tangential and sagittal, and frequency.
    values: Vec<Vec<[Vec<f64>; 2]>>,
}

/// The charts of a lens by Optiland in an interpreter of Python, at some heights of the field and so many
/// frequencies up to one in cycles/mm.
pub(in crate::cli::measure) fn measure(
    python: &Path,
    opened: &LoadedLens,
    (model, heights): (&RayModel, &[f64]),
    (highest, count): (f64, usize),
) -> Result<OptilandCurves, CliError> {
    let asked = [highest.to_string(), count.to_string()];
    let found: ScriptOutput = ask(python, SCRIPT, &opened.lens, &asked)?;
    let frequencies: Vec<f64> = (1..=count).map(|i| highest * i as f64 / count as f64).collect();
    let exact = |method| exact_curves(model, heights, method, &frequencies);
    let (geometric, diffraction) =
        (exact(TransferMethod::Geometric), exact(TransferMethod::Diffraction));
    let row = |row: &ScriptRow| {
        let exact = match row.method {
            TransferMethod::Geometric => &geometric,
            TransferMethod::Diffraction => &diffraction,
        };
        let exact = exact.as_ref().map_err(|why| CliError::Failed(why.to_string()))?;
        let error = largest_difference(&row.values, exact).ok_or_else(|| wrong_shape(python))?;
        Ok(OptilandRow { method: row.method, rays: row.rays, error, ms: row.ms })
    };
    let rows: Result<Vec<OptilandRow>, CliError> = found.rows.iter().map(row).collect();
    Ok(OptilandCurves { version: found.version, rows: rows? })
}

/// The curves by wavelength and field.
fn exact_curves(
    model: &RayModel,
    heights: &[f64],
    method: TransferMethod,
    frequencies: &[f64],
) -> Result<Vec<Vec<MtfCurve>>, AnalysisError> {
    let accuracy = Accuracy { tolerance: EXACT, ..Accuracy::default() };
    let curve = |wavelength: usize, y: f64| {
        let field = FieldPoint { x: 0.0, y, weight: 1.0 };
        match method {
            TransferMethod::Geometric => {
                geometric_mtf(model, field, wavelength, frequencies, accuracy)
            }
            TransferMethod::Diffraction => {
                diffraction_mtf(model, field, wavelength, frequencies, accuracy)
            }
        }
    };
    let of_wavelength = |w: usize| heights.iter().map(|y| curve(w, *y)).collect();
    (0..model.channels.len()).map(of_wavelength).collect()
}

/// The largest difference of a modulus; `None` for values of another shape.
fn largest_difference(values: &[Vec<[Vec<f64>; 2]>], exact: &[Vec<MtfCurve>]) -> Option<f64> {
    let mut largest = 0.0f64;
    if values.len() != exact.len() {
        return None;
    }
    for (values, curves) in values.iter().zip(exact) {
        if values.len() != curves.len() {
            return None;
        }
        for ([tangential, sagittal], curve) in values.iter().zip(curves) {
            if tangential.len() != curve.points.len() || sagittal.len() != curve.points.len() {
                return None;
            }
            for ((t, s), point) in tangential.iter().zip(sagittal).zip(&curve.points) {
                let off = |found: f64, exact: f64| (found - exact).abs();
                largest = largest
                    .max(off(*t, point.tangential.modulus.value))
                    .max(off(*s, point.sagittal.modulus.value));
            }
        }
    }
    Some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Estimate, MtfPoint, TransferValue};

    #[test]
    fn differences_are_those_of_moduli_and_need_the_same_shape() {
        let value = |modulus: f64| TransferValue {
            re: modulus,
            im: 0.0,
            modulus: Estimate::new(modulus, 0.0, 1),
            sphere: 0.0,
        };
        let point = MtfPoint { frequency: 1.0, tangential: value(0.5), sagittal: value(0.75) };
        let curve = MtfCurve {
            points: vec![point],
            origin: [0.0; 2],
            reached: true,
            limit: None,
            sphere: 0.0,
            rays: 1,
            dark_share: 0.0,
        };
        let exact = vec![vec![curve]];
        let found = largest_difference(&[vec![[vec![0.5], vec![0.5]]]], &exact);
        assert_eq!(found, Some(0.25));
        assert_eq!(largest_difference(&[vec![[vec![0.5, 0.4], vec![0.5]]]], &exact), None);
        assert_eq!(largest_difference(&[], &exact), None);
    }
}
