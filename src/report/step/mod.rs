//! The elements of a lens as solids in a STEP file (ISO 10303-214), for mechanical design.
//!
//! Every element is a closed shell: its two surfaces, flat rings where a surface is smaller than the rim,
//! and a cylinder. Spheres, planes and cylinders are exact. A conic or an asphere is a surface of
//! revolution of a cubic spline, whose distance from the true profile is given.
//!
//! Neither truck nor another crate writes what mechanics expect, a named product for every element with
//! analytic surfaces: their solids have spline surfaces without names. The text of the file, a list of
//! numbered entities, is written here.

mod entities;
mod profile;
mod solid;

use super::body::LensBody;
use super::error::ReportError;
use super::materials::material_name;
use entities::StepEntities;

/// A STEP file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StepFile {
    /// The text.
    pub(super) text: String,
    /// The largest distance in mm between a spline and the profile that it stands for; 0 where there is
    /// none.
    pub(super) deviation: f64,
}

/// The elements as solids in the frame of the first vertex of the lens, in mm.
///
/// # Errors
/// No element at all, or elements that are not solids of revolution, each with its reason.
pub(super) fn step_file(name: &str, bodies: &[LensBody]) -> Result<StepFile, ReportError> {
    if bodies.is_empty() {
        return Err(ReportError::NoBodies);
    }
    let faults: Vec<_> =
        bodies.iter().filter_map(|body| Some((body.number, body.solid().err()?))).collect();
    if !faults.is_empty() {
        return Err(ReportError::of_bodies(faults));
    }
    let mut entities = StepEntities::new();
    let mut deviation: f64 = 0.0;
    for body in bodies {
        let (shell, error) = solid::closed_shell(&mut entities, body);
        deviation = deviation.max(error);
        let title = format!("Element {}", body.number);
        entities.product(&title, &material_name(&body.medium), shell);
    }
    Ok(StepFile { text: entities.into_text(name, deviation), deviation })
}
