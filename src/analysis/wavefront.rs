//! The wavefront error: the optical path difference from a perfect sphere about the image point.
//!
//! The optical path of every ray is counted from the object point, or from a plane wave through the
//! first vertex, to the [reference sphere](super::ReferenceForm). An undercorrected lens has
//! positive differences.

use super::reference_sphere::{ReferenceForm, ReferenceSphere, check_paths};
use super::{AnalysisError, Estimate, lit_region, rms_without_tilt};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::{Accuracy, Nodes, RayModel, Region, converge};
use crate::trace::{Fate, Landings, Ray, Rays};

/// The wavefront error of a field at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wavefront {
    /// The standard deviation of the path difference over the lit pupil, in wavelengths: piston is
    /// removed, tilt is not.
    pub rms: Estimate,
    /// The same with tilt removed too: about the image point that makes it least, defocus as it is.
    /// `None` for an afocal lens, and if rays miss the reference sphere.
    pub rms_without_tilt: Option<Estimate>,
    /// The mean path difference from the chief ray, in wavelengths.
    pub mean: Estimate,
    /// True if the tolerance was reached.
    pub converged: bool,
    /// The sphere that paths are compared on.
    pub reference: ReferenceForm,
    /// The share of the light whose rays miss that sphere and are left out.
    pub missed: f64,
}

/// The reason why a ray has no path difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// No ray was found at the pupil point.
    #[error("no ray was found at this point of the pupil")]
    NoRay,
    /// The ray does not reach the image.
    #[error("the ray is lost: {}", .0.name())]
    Lost(Fate),
    /// The ray misses the reference sphere.
    #[error("the ray misses the reference sphere")]
    MissesSphere,
}

/// The wavefront of a field at a wavelength; errors are relative to its RMS.
///
/// # Errors
/// The field is dark or neither its chief ray nor the ray at the centroid of its pupil reaches the
/// image.
pub fn wavefront(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Wavefront, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::for_region(&region)?;
    let rounding = sphere.rounding();
    let scales = |[rms, _, _, _]: &[f64; 4]| {
        let scale = rms.max(rounding / accuracy.tolerance);
        [scale, scale, 1.0, scale]
    };
    let numbers = |nodes: &Nodes| {
        let [rms, mean, missed] = moments(&sphere, &region, nodes)?;
        let without_tilt = rms_without_tilt(&region, nodes, sphere.form);
        Some([rms, mean, missed, without_tilt.unwrap_or(0.0)])
    };
    let found = converge(&region, accuracy, numbers, scales);
    let found = found.ok_or(AnalysisError::NoLight)?;
    let estimate =
        |k: usize| Estimate::new(found.values[k], found.errors[k].max(rounding), found.rays);
    let has_best_point = sphere.form != ReferenceForm::Plane && found.values[2] == 0.0;
    Ok(Wavefront {
        rms: estimate(0),
        rms_without_tilt: has_best_point.then(|| estimate(3)),
        mean: estimate(1),
        converged: found.converged,
        reference: sphere.form,
        missed: found.values[2],
    })
}

/// The chief ray of a field, which the paths of the others are compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiefPath {
    /// The point where it meets the image, x and y in mm: the centre of the reference sphere.
    pub point: [f64; 2],
    /// Its optical path to the image in mm, from the object point, or from a plane wave through the first
    /// vertex.
    pub path: f64,
    /// The reference sphere.
    pub reference: ReferenceForm,
}

/// A ray where it meets the reference sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathDifference {
    /// The path of the chief ray less that of the ray, in wavelengths.
    pub waves: f64,
    /// The direction cosines along x and y of the line from the point of the sphere to its centre.
    pub cosines: [f64; 2],
}

/// The chief ray of a field, and the path differences of the rays at some pupil points.
pub type FieldPaths = (ChiefPath, Vec<Result<PathDifference, PathError>>);

/// The path differences at some pupil points in wavelengths, or why there is none.
///
/// # Errors
/// The field has no rays or its chief ray does not reach the image.
pub fn path_differences(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    points: &[[f64; 2]],
) -> Result<Vec<Result<f64, PathError>>, AnalysisError> {
    let (_, found) = field_paths(model, field, wavelength, points)?;
    Ok(found.into_iter().map(|found| found.map(|path| path.waves)).collect())
}

/// The chief ray of a field at a wavelength, and the rays at some pupil points on its reference sphere, or
/// why there is none.
///
/// # Errors
/// The field has no rays or its chief ray does not reach the image.
pub fn field_paths(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    points: &[[f64; 2]],
) -> Result<FieldPaths, AnalysisError> {
    let launch = model.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
    check_paths(&launch)?;
    let sphere = ReferenceSphere::new(&launch).ok_or(AnalysisError::NoChief)?;
    let at = |p: &[f64; 2]| {
        let ray = launch.ray(*p).ok_or(PathError::NoRay)?;
        let landing = launch.channel().tracer.trace(ray);
        if !landing.fate.is_imaged() {
            return Err(PathError::Lost(landing.fate));
        }
        let path = launch.optical_path_to(ray) + landing.opl;
        let found = sphere.project(landing.ray, path).ok_or(PathError::MissesSphere)?;
        Ok(PathDifference { waves: found.waves, cosines: found.cosines })
    };
    let Vec3 { x, y, .. } = sphere.center;
    let chief = ChiefPath { point: [x, y], path: sphere.path, reference: sphere.form };
    Ok((chief, points.iter().map(at).collect()))
}

/// The standard deviation, the mean and the share of rays that miss the sphere; `None` if no ray
/// arrives.
fn moments(sphere: &ReferenceSphere, region: &Region<'_>, nodes: &Nodes) -> Option<[f64; 3]> {
    let rays: Rays<f64> = nodes.points.iter().filter_map(|p| region.launch.ray(*p)).collect();
    let landed = region.trace::<Landings<f64>>(nodes);
    let hits = &landed.sink;
    let difference = |i: usize| {
        let point = Vec3::new(hits.x[i], hits.y[i], hits.z[i]);
        let direction = Vec3::new(hits.l[i], hits.m[i], hits.n[i]);
        let path = region.launch.optical_path_to(rays.get(i)) + hits.opl[i];
        sphere.project(Ray { point, direction }, path)
    };
    let arrived: Vec<_> = landed.arrivals().map(|(i, w)| (difference(i), w)).collect();
    let light: f64 = arrived.iter().map(|(_, w)| w).sum();
    let differences = || arrived.iter().filter_map(|(d, w)| Some((d.as_ref()?.waves, w)));
    let area: f64 = differences().map(|(_, w)| w).sum();
    if !(area > 0.0) {
        return None;
    }
    let mean = differences().map(|(d, w)| w * d).sum::<f64>() / area;
    let square = differences().map(|(d, w)| w * (d - mean).powi(2)).sum::<f64>() / area;
    Some([square.sqrt(), mean, (light - area) / light])
}
