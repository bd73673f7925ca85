//! The wavefront error: the optical path difference from a perfect sphere about the image point.
//!
//! The optical path of every ray is counted from the object point, or from a plane wave through the
//! first vertex, to a sphere about the chief ray's image point through the centre of the paraxial
//! exit pupil (Welford, *Aberrations of Optical Systems*, 1986, section 7.2). An undercorrected
//! lens has positive differences.

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::{Accuracy, Launch, Nodes, RayModel, Region, converge};
use crate::trace::{Landings, Ray, Rays};

/// The wavefront error of a field at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wavefront {
    /// The standard deviation of the path difference over the lit pupil, in wavelengths.
    pub rms: Estimate,
    /// The mean path difference from the chief ray, in wavelengths.
    pub mean: Estimate,
    /// True if the tolerance was reached.
    pub converged: bool,
}

/// The wavefront of a field at a wavelength; errors are relative to its RMS.
///
/// # Errors
/// The field is dark or its chief ray does not reach the image.
pub fn wavefront(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Wavefront, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::new(&region.launch).ok_or(AnalysisError::NoChief)?;
    let rounding = sphere.rounding();
    let scales = |[rms, _]: &[f64; 2]| [rms.max(rounding / accuracy.tolerance); 2];
    let found = converge(&region, accuracy, |nodes| sphere.moments(&region, nodes), scales);
    let found = found.ok_or(AnalysisError::NoLight)?;
    let estimate =
        |k: usize| Estimate::new(found.values[k], found.errors[k].max(rounding), found.rays);
    Ok(Wavefront { rms: estimate(0), mean: estimate(1), converged: found.converged })
}

/// The path differences at some pupil points in wavelengths; `None` for a ray that is lost.
///
/// # Errors
/// The field has no rays or its chief ray does not reach the image.
pub fn path_differences(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    points: &[[f64; 2]],
) -> Result<Vec<Option<f64>>, AnalysisError> {
    let launch = model.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
    let sphere = ReferenceSphere::new(&launch).ok_or(AnalysisError::NoChief)?;
    let at = |p: &[f64; 2]| {
        let ray = launch.ray(*p)?;
        let landing = launch.channel().tracer.trace(ray);
        let path = launch.optical_path_to(ray) + landing.opl;
        landing.fate.is_imaged().then(|| sphere.difference(landing.ray, path))
    };
    Ok(points.iter().map(at).collect())
}

/// The reference sphere, with the chief ray that ends at its centre.
struct ReferenceSphere {
    middle: Vec3<f64>,
    direction: Vec3<f64>,
    path: f64,
    /// The signed distance from the centre to the exit pupil, in mm, negative if the light has
    /// passed the pupil before; `None` for a pupil at infinity.
    radius: Option<f64>,
    index: f64,
    /// The wavelength, in mm.
    wavelength: f64,
}

impl ReferenceSphere {
    fn new(launch: &Launch<'_>) -> Option<Self> {
        let chief = launch.unclipped_landing([0.0, 0.0])?;
        let path = launch.optical_path_to(launch.ray([0.0, 0.0])?) + chief.opl.value;
        let system = &launch.channel().system;
        let (middle, direction) = (chief.ray.point.value(), chief.ray.direction.value());
        let last = system.surfaces.len().checked_sub(2)?;
        let radius = launch.model.first_order.exit_pupil.position.map(|z| {
            let pupil = Vec3::new(0.0, 0.0, z - system.surfaces[last].thickness);
            let away = pupil - middle;
            let along = if away.z * direction.z > 0.0 { 1.0 } else { -1.0 };
            along * away.dot(away).sqrt()
        });
        let index = system.surfaces[last].index;
        let wavelength = launch.channel().um * 1e-3;
        Some(Self { middle, direction, path, radius, index, wavelength })
    }

    /// The path difference of a ray at the image, in wavelengths, from its optical path up to
    /// there.
    fn difference(&self, ray: Ray<f64>, path: f64) -> f64 {
        let off = ray.point - self.middle;
        let along = off.dot(ray.direction);
        let beyond = match self.radius {
            // The distance to the sphere beyond that of the chief ray, without a difference of two
            // radii.
            Some(radius) => {
                let square = along * along - off.dot(off);
                let root = (radius * radius + square).max(0.0).sqrt();
                square / (root + radius.abs()) * radius.signum() - along
            }
            None => -(off.dot(self.direction) / ray.direction.dot(self.direction)),
        };
        (self.path - path - self.index * beyond) / self.wavelength
    }

    /// The rounding error of a path, in wavelengths.
    fn rounding(&self) -> f64 {
        let longest = self.path.abs().max(self.radius.unwrap_or(0.0).abs());
        8.0 * f64::EPSILON * longest / self.wavelength
    }

    /// The standard deviation and the mean over some nodes; `None` if no ray arrives.
    fn moments(&self, region: &Region<'_>, nodes: &Nodes) -> Option<[f64; 2]> {
        let rays: Rays<f64> = nodes.points.iter().filter_map(|p| region.launch.ray(*p)).collect();
        let landed = region.trace::<Landings<f64>>(nodes);
        let hits = &landed.sink;
        let difference = |i: usize| {
            let point = Vec3::new(hits.x[i], hits.y[i], hits.z[i]);
            let direction = Vec3::new(hits.l[i], hits.m[i], hits.n[i]);
            let path = region.launch.optical_path_to(rays.get(i)) + hits.opl[i];
            self.difference(Ray { point, direction }, path)
        };
        let differences: Vec<_> = landed.arrivals().map(|(i, w)| (difference(i), w)).collect();
        let area: f64 = differences.iter().map(|(_, w)| w).sum();
        if !(area > 0.0) {
            return None;
        }
        let mean = differences.iter().map(|(d, w)| w * d).sum::<f64>() / area;
        let square = differences.iter().map(|(d, w)| w * (d - mean).powi(2)).sum::<f64>() / area;
        Some([square.sqrt(), mean])
    }
}
