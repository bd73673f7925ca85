//! Contrast of the same lens by Optiland, timed beside, against the exact one.
//!
//! Optiland computes one wavelength at a time; its numbers are compared wavelength by wavelength with those of this
//! program to a tight tolerance. A script runs in the interpreter that is named, on one thread.

use crate::analysis::{AnalysisError, MtfCurve, diffraction_mtf, geometric_mtf};
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::files;
use crate::lens::FieldPoint;
use crate::measure::TransferMethod;
use crate::pupil::{Accuracy, RayModel};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The script, and how to get the program that it needs.
const SCRIPT: &str = include_str!("optiland_mtf.py");
pub(super) const HOW_TO_GET: &str = "Optiland: not run; `python -m venv optiland`, \
     `optiland/bin/pip install optiland`, then --optiland optiland/bin/python";
/// The tolerance of the contrast that others are compared with.
const EXACT: f64 = 1e-5;

/// A chart of contrast by Optiland.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct OptilandRow {
    pub(super) method: TransferMethod,
    /// The number of rays along a side of the pupil.
    pub(super) rays: usize,
    /// The largest difference of a modulus from the exact one.
    pub(super) error: f64,
    /// The time of the chart, in milliseconds.
    pub(super) ms: f64,
}

/// The results of Optiland.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OptilandCurves {
    pub(super) version: String,
    pub(super) rows: Vec<OptilandRow>,
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

/// A file that is removed in the end.
struct ScratchFile(PathBuf);

impl Drop for ScratchFile {
    fn drop(&mut self) {
        // One that is gone already is no fault.
        drop(std::fs::remove_file(&self.0));
    }
}

/// The charts of a lens by Optiland in an interpreter of Python, at some heights of the field and so many
/// frequencies up to one in cycles/mm.
pub(super) fn measure(
    python: &Path,
    opened: &LoadedLens,
    (model, heights): (&RayModel, &[f64]),
    (highest, count): (f64, usize),
) -> Result<OptilandCurves, CliError> {
    let name = format!("aplanat_mtf_{}.optiland.json", std::process::id());
    let file = ScratchFile(std::env::temp_dir().join(name));
    files::save(&opened.lens, &file.0)?;
    let mut command = Command::new(python);
    command.arg("-c").arg(SCRIPT).arg(&file.0).arg(highest.to_string()).arg(count.to_string());
    for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"] {
        command.env(threads, "1");
    }
    let wrong = |what: String| CliError::Failed(format!("{}: {what}", python.display()));
    let output = command.output().map_err(|error| wrong(error.to_string()))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
        return Err(wrong(last.to_owned()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().last().unwrap_or_default();
    let found: ScriptOutput =
        serde_json::from_str(line).map_err(|error| wrong(error.to_string()))?;
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
        let error = largest_difference(&row.values, exact)
            .ok_or_else(|| wrong("its answer has not the shape of the question".to_owned()))?;
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
        };
        let point = MtfPoint { frequency: 1.0, tangential: value(0.5), sagittal: value(0.75) };
        let curve = MtfCurve {
            points: vec![point],
            origin: [0.0; 2],
            reached: true,
            limit: None,
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
