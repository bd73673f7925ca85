//! Tolerances of the same lens by Optiland: the same errors, one by one and at random.
//!
//! Optiland moves single surfaces only, fills the pupil of paraxial optics, and finds the growth of a spot by
//! three values of every error; no focus is adjusted there, which would cost it an optimization for each. Its rays in
//! rings weigh the rim of the pupil too much, less so with more rings.

use super::{ask, wrong_shape};
use crate::cli::error::CliError;
use crate::lens::{Lens, PerturbationKind, Tolerance, ToleranceGrade};
use crate::measure::{SomeTolerances, ToleranceBenchmarkError, measure_some_tolerances};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;

const SCRIPT: &str = include_str!("tolerance.py");
/// The numbers of rings of Optiland's rays in a pupil: its own default, and four times as many.
const RINGS: [usize; 2] = [6, 24];
/// The relative accuracy of this program's spot radii: growths are squares, and are to be good to 1e-4.
const ACCURACY: f64 = 4e-5;
/// The lenses with random errors of this program and of Optiland, which takes a fifth of a second for one.
const LENSES: [usize; 2] = [500, 20];

/// The kinds of errors that both programs know, by Optiland's name and axis.
const SHARED: [(PerturbationKind, &str, Option<&str>); 7] = [
    (PerturbationKind::Curvature, "reciprocal_radius", None),
    (PerturbationKind::Conic, "conic", None),
    (PerturbationKind::Thickness, "thickness", None),
    (PerturbationKind::SurfaceDecenterX, "decenter", Some("x")),
    (PerturbationKind::SurfaceDecenterY, "decenter", Some("y")),
    (PerturbationKind::SurfaceTiltX, "tilt", Some("x")),
    (PerturbationKind::SurfaceTiltY, "tilt", Some("y")),
];

/// The tolerances that both programs know, by both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::cli::measure) struct OptilandTolerances {
    pub(in crate::cli::measure) version: String,
    /// By this program.
    pub(in crate::cli::measure) own: SomeTolerances,
    /// By Optiland, with more and more rays.
    pub(in crate::cli::measure) rows: Vec<OptilandRow>,
}

/// The tolerances by Optiland with a number of rays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::cli::measure) struct OptilandRow {
    pub(in crate::cli::measure) rays: usize,
    /// The growth of the mean square spot by each error; `null` where it finds no spot.
    growth: Vec<Option<f64>>,
    pub(in crate::cli::measure) sensitivities_ms: f64,
    pub(in crate::cli::measure) lens_ms: f64,
    /// The median of the relative differences of growths from those by this program, and how many there are.
    #[serde(default)]
    pub(in crate::cli::measure) median_difference: Option<(f64, usize)>,
}

/// The output of the script.
#[derive(Deserialize)]
struct ScriptOutput {
    version: String,
    rows: Vec<OptilandRow>,
}

/// Measures the tolerances of a class on a lens by this program and by Optiland in an interpreter of Python.
pub(in crate::cli::measure) fn measure(
    python: &Path,
    (lens, file): (&Lens, &str),
    grade: ToleranceGrade,
) -> Result<OptilandTolerances, CliError> {
    let kinds = SHARED.map(|(kind, ..)| kind);
    let [samples, few] = LENSES;
    let own = measure_some_tolerances(lens, (&kinds, grade), (ACCURACY, samples));
    let fail = |e: ToleranceBenchmarkError| CliError::Failed(format!("{file}: {e}"));
    let own = own.map_err(fail)?;
    let errors: Vec<serde_json::Value> = own.tolerances.iter().filter_map(name_error).collect();
    let asked = [json!(errors).to_string(), json!(RINGS).to_string(), few.to_string()];
    let mut found: ScriptOutput = ask(python, SCRIPT, lens, &asked)?;
    for row in &mut found.rows {
        if row.growth.len() != own.growth.len() {
            return Err(wrong_shape(python));
        }
        row.median_difference = median_difference(&own.growth, &row.growth);
    }
    Ok(OptilandTolerances { version: found.version, own, rows: found.rows })
}

/// An error in Optiland's terms: its surfaces are counted from the object.
fn name_error(tolerance: &Tolerance) -> Option<serde_json::Value> {
    let (_, name, axis) = SHARED.iter().find(|(kind, ..)| *kind == tolerance.error.kind)?;
    Some(json!([name, tolerance.error.first + 1, axis, tolerance.half_range]))
}

/// The median of the differences relative to the own growths, the upper one of two, and their number; `None` without
/// any.
fn median_difference(own: &[f64], others: &[Option<f64>]) -> Option<(f64, usize)> {
    let apart = |(own, other): (&f64, &Option<f64>)| {
        let relative = (other.as_ref()? / own - 1.0).abs();
        relative.is_finite().then_some(relative)
    };
    let mut apart: Vec<f64> = own.iter().zip(others).filter_map(apart).collect();
    apart.sort_by(f64::total_cmp);
    Some((*apart.get(apart.len() / 2)?, apart.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{ErrorDistribution, Perturbation};

    #[test]
    fn errors_are_named_by_surfaces_counted_from_the_object() {
        let error = Perturbation::of_surface(PerturbationKind::SurfaceTiltY, 3);
        let distribution = ErrorDistribution::default();
        let tolerance = Tolerance { error, half_range: 1e-3, distribution };
        assert_eq!(name_error(&tolerance), Some(json!(["tilt", 4, "y", 1e-3])));
        let error = Perturbation::of_surface(PerturbationKind::Irregularity, 3);
        assert_eq!(name_error(&Tolerance { error, ..tolerance }), None);
    }

    #[test]
    fn the_median_leaves_out_what_was_not_found() {
        let own = [1.0, 2.0, 4.0, 0.0];
        let others = [Some(1.5), None, Some(4.0), Some(1.0)];
        assert_eq!(median_difference(&own, &others), Some((0.5, 2)));
        assert_eq!(median_difference(&own, &[None; 4]), None);
    }
}
