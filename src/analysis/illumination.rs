//! Relative illumination: the brightness of the image over the field.
//!
//! The light that reaches a point of the image is proportional to the area of its cone in direction
//! cosines, `∫ dL' dM'` (Rimmer, "Relative illumination calculations", Proc. SPIE 655, 1986), over
//! the lit pupil: `∫ |∂(L', M')/∂(px, py)| dpx dpy`.

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, Nodes, RayModel, Region, converge};
use rayon::prelude::*;

/// The light of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Illumination {
    /// The field.
    pub field: FieldPoint,
    /// The area of its cone in direction cosines: π sin² of the half angle for a full cone; 0 if no
    /// light gets through.
    pub cone: Estimate,
    /// The same relative to the first field; `None` if that one is dark.
    pub relative: Option<Estimate>,
    /// The reason if there is no light.
    pub error: Option<AnalysisError>,
}

/// The illumination of all fields at a wavelength; a field without light has 0 and the reason.
pub fn illumination(model: &RayModel, wavelength: usize, accuracy: Accuracy) -> Vec<Illumination> {
    let cones: Vec<_> =
        model.fields.par_iter().map(|field| cone(model, *field, wavelength, accuracy)).collect();
    let first = cones.first().and_then(|cone| cone.ok());
    let result = |(field, cone): (&FieldPoint, &Result<Estimate, AnalysisError>)| {
        let light = cone.unwrap_or(Estimate::new(0.0, 0.0, 0));
        let relative = first.map(|first| {
            let ratio = light.value / first.value;
            let error = (light.error + ratio * first.error) / first.value;
            Estimate::new(ratio, error, light.rays + first.rays)
        });
        Illumination { field: *field, cone: light, relative, error: cone.err() }
    };
    model.fields.iter().zip(&cones).map(result).collect()
}

fn cone(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let found = converge(&region, accuracy, |nodes| cone_area(&region, nodes), |cone| *cone);
    let found = found.ok_or(AnalysisError::NoLight)?;
    Ok(Estimate::new(found.values[0], found.errors[0], found.rays))
}

fn cone_area(region: &Region<'_>, nodes: &Nodes) -> Option<[f64; 1]> {
    let mut sum = 0.0;
    let mut lit = false;
    for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
        if let Some([l, m]) = region.launch.direction_derivatives(*p) {
            sum += weight * (l[0] * m[1] - l[1] * m[0]).abs();
            lit = true;
        }
    }
    lit.then_some([sum])
}
