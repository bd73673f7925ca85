//! The illumination of the image: the irradiance at a point of it, over the field.
//!
//! The irradiance at a point of the image of a uniform scene is its radiance times `n'²/n²` and the
//! projected solid angle `∫ dL' dM'` of the directions at that point from which light arrives, in
//! cosines against the tangent plane of the image surface. These directions are found backwards: the
//! reversed lens has a pupil with a boundary of its own, as seen from the image point.
//!
//! Two other numbers are kept apart. The energy of a field element gives the same irradiance without
//! a ray backwards, and checks it. The cone of one field is the area that its rays sweep in direction
//! cosines (Rimmer, "Relative illumination calculations", Proc. SPIE 655, 1986): the irradiance only
//! where the image is sharp, since rays of other fields arrive at the same point too.

use super::seen_from_image::{BackwardLens, SeenFromImage};
use super::{AnalysisError, Estimate, ImageFold, lit_region};
use crate::lens::{FieldKind, FieldPoint};
use crate::math::Vec3;
use crate::pupil::{Accuracy, ConvergedValues, Nodes, RayModel, Region, converge};
use crate::trace::{Ray, TraceSink as _};
use rayon::prelude::*;

/// The light at a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Illumination {
    /// The field.
    pub field: FieldPoint,
    /// The irradiance at the centroid of the field's spot over the radiance of a uniform scene; 0 if
    /// no light gets through, and with an infinite error if it is not known how much does.
    pub irradiance: Estimate,
    /// The same relative to the first field; `None` if that one is dark or this one is not known.
    pub relative: Option<Estimate>,
    /// The centroid of the spot, x and y in mm: the point of the irradiance.
    pub point: [f64; 2],
    /// The area of the cone of the field's rays in direction cosines: π sin² of the half angle for a
    /// full cone; 0 if no light gets through.
    pub cone: Estimate,
    /// The same relative to the first field; `None` if that one is dark or has no cone.
    pub relative_cone: Option<Estimate>,
    /// The reason if there is no light, or no number of it.
    pub error: Option<AnalysisError>,
}

/// The light at a field that has some.
#[derive(Debug, Clone, Copy)]
struct FieldLight {
    /// The reason if it is not known.
    irradiance: Result<Estimate, AnalysisError>,
    point: [f64; 2],
    cone: Estimate,
}

/// The illumination of all fields at a wavelength; a field without light has 0 and the reason.
pub fn illumination(model: &RayModel, wavelength: usize, accuracy: Accuracy) -> Vec<Illumination> {
    let fold = ImageFold::find(model, wavelength);
    let light = |field: &FieldPoint| field_light(model, *field, (wavelength, fold), accuracy);
    let lights: Vec<_> = model.fields.par_iter().map(light).collect();
    let first = lights.first().and_then(|light| light.ok());
    let result = |(field, light): (&FieldPoint, &Result<FieldLight, AnalysisError>)| {
        let dark = Estimate::new(0.0, 0.0, 0);
        let dark = |why| FieldLight { irradiance: Err(why), point: [0.0; 2], cone: dark };
        let FieldLight { irradiance, point, cone } = light.unwrap_or_else(dark);
        let of_first = first.and_then(|first| first.irradiance.ok());
        let is_known = irradiance.map_or_else(|why| why.is_loss_of_light(), |_| true);
        let irradiance_or_none = irradiance.unwrap_or_else(without_number);
        Illumination {
            field: *field,
            irradiance: irradiance_or_none,
            relative: of_first.filter(|_| is_known).map(|first| ratio(irradiance_or_none, first)),
            point,
            cone,
            relative_cone: first.filter(has_cone).map(|first| ratio(cone, first.cone)),
            error: irradiance.err(),
        }
    };
    model.fields.iter().zip(&lights).map(result).collect()
}

/// True for light that comes from a cone, and not from one direction alone as that of an afocal lens does.
fn has_cone(light: &FieldLight) -> bool {
    light.cone.value > light.cone.error.max(NO_CONE)
}

/// A cone below this area in direction cosines is rounding.
const NO_CONE: f64 = 1e-14;

/// No irradiance, or one that is not known.
fn without_number(why: AnalysisError) -> Estimate {
    Estimate::new(0.0, if why.is_loss_of_light() { 0.0 } else { f64::INFINITY }, 0)
}

fn ratio(light: Estimate, first: Estimate) -> Estimate {
    let ratio = light.value / first.value;
    let error = (light.error + ratio * first.error) / first.value;
    Estimate::new(ratio, error, light.rays + first.rays)
}

fn field_light(
    model: &RayModel,
    field: FieldPoint,
    (wavelength, fold): (usize, Option<ImageFold>),
    accuracy: Accuracy,
) -> Result<FieldLight, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let cone = region_cone(&region, accuracy)?;
    let point = centroid(&region, accuracy)?;
    match irradiance_beside(fold, model, wavelength, point, accuracy) {
        Err(why) if why.is_loss_of_light() => Err(why),
        irradiance => Ok(FieldLight { irradiance, point, cone }),
    }
}

/// The area of the cone of a field's rays at the image in direction cosines, π sin² of the half
/// angle for a full cone, at a wavelength.
///
/// # Errors
/// No ray of the field gets through at the wavelength.
pub fn image_cone(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    region_cone(&lit_region(model, field, wavelength)?, accuracy)
}

fn region_cone(region: &Region<'_>, accuracy: Accuracy) -> Result<Estimate, AnalysisError> {
    let found = converge(region, accuracy, |nodes| cone_area(region, nodes), |cone| *cone);
    let found = found.ok_or(AnalysisError::NoLight)?;
    Ok(area_estimate(1.0, &found))
}

/// The relative error of an area whose edge is found to 1e-11 of its radius, ray by ray.
const EDGE_NOISE: f64 = 1e-10;

/// A multiple of an area that was integrated up to its edge.
fn area_estimate(scale: f64, found: &ConvergedValues<1>) -> Estimate {
    let ([area], [change]) = (found.values, found.errors);
    Estimate::new(scale * area, scale * change.max(EDGE_NOISE * area.abs()), found.rays)
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

/// The centroid of the spot of a pupil, in mm, to a part of the tolerance times its size.
fn centroid(region: &Region<'_>, accuracy: Accuracy) -> Result<[f64; 2], AnalysisError> {
    let numbers = |nodes: &Nodes| {
        let spot = region.moments(nodes);
        (spot.area > 0.0).then(|| [spot.centroid[0], spot.centroid[1], spot.rms_radius()])
    };
    let found = converge(region, accuracy, numbers, |[_, _, size]| [*size; 3]);
    found.map(|f| [f.values[0], f.values[1]]).ok_or(AnalysisError::NoLight)
}

/// The irradiance at a point of the image, x and y in mm, over the radiance of a uniform scene:
/// `n'²/n²` times the projected solid angle of the directions from which light arrives.
///
/// # Errors
/// No light arrives at the point, or that of two fields.
pub fn irradiance(
    model: &RayModel,
    wavelength: usize,
    point: [f64; 2],
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    irradiance_beside(ImageFold::find(model, wavelength), model, wavelength, point, accuracy)
}

/// The same for a fold of the image that is known.
///
/// # Errors
/// As [`irradiance`].
pub(crate) fn irradiance_beside(
    fold: Option<ImageFold>,
    model: &RayModel,
    wavelength: usize,
    point: [f64; 2],
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    ImageFold::refuse(fold, point)?;
    let seen = SeenFromImage::new(model, wavelength, point)?;
    let region = lit_region(&seen.model, seen.model.fields[0], 0)?;
    let numbers = |nodes: &Nodes| seen.solid_angle(&region, nodes);
    let found = converge(&region, accuracy, numbers, |area| *area);
    let found = found.ok_or(AnalysisError::NoLight)?;
    Ok(area_estimate(seen.index_ratio, &found))
}

/// The irradiance at a point of the image, x and y in mm, of a scene: its radiance along a ray that leads
/// away from the lens, in the frame of the first vertex.
///
/// # Errors
/// No light arrives at the point, or that of two fields.
pub fn scene_irradiance(
    model: &RayModel,
    wavelength: usize,
    point: [f64; 2],
    radiance: impl Fn(&Ray<f64>) -> f64,
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    ImageFold::refuse(ImageFold::find(model, wavelength), point)?;
    let seen = SeenFromImage::new(model, wavelength, point)?;
    let backward = BackwardLens::new(model, wavelength).map_err(|_error| AnalysisError::NoLight)?;
    let region = lit_region(&seen.model, seen.model.fields[0], 0)?;
    let of_ray = |landed: Ray<f64>, mirrored: bool| {
        let ray = backward.scene_ray(landed);
        let Ray { point: p, direction: d } = ray;
        // A node of half a pupil stands for its mirror image, which sees another part of the scene.
        let mirror =
            || Ray { point: Vec3::new(-p.x, p.y, p.z), direction: Vec3::new(-d.x, d.y, d.z) };
        if mirrored { 0.5 * (radiance(&ray) + radiance(&mirror())) } else { radiance(&ray) }
    };
    let numbers = |nodes: &Nodes| seen.light(&region, nodes, of_ray);
    let found = converge(&region, accuracy, numbers, |light| *light);
    let found = found.ok_or(AnalysisError::NoLight)?;
    Ok(area_estimate(seen.index_ratio, &found))
}

/// The step of the field in the energy of a field element, relative to the field, and in radians or
/// relative to the lens on the axis.
const FIELD_STEP: f64 = 0.01;

/// The irradiance at a field from the energy of an element of it, over the radiance of a uniform
/// scene: the light that an annulus of the field sends into the lens over the area of its image by
/// centroids. It needs no ray backwards, and differs from [`irradiance`] where the image is so blurred
/// that its brightness varies within a spot.
///
/// # Errors
/// No light arrives from the field or its neighbours, or that of another field arrives at the same point, the lens
/// has no image of it, or the lens is not symmetric about its axis: an element of its field is no annulus.
pub fn energy_irradiance(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Estimate, AnalysisError> {
    let system = &model.channels[wavelength].system;
    if system.has_poses() || !system.has_round_apertures() {
        return Err(AnalysisError::NotSymmetric);
    }
    let region = lit_region(model, field, wavelength)?;
    let element = FieldElement { model, field, wavelength, accuracy };
    let [_, square] = element.squares(field)?;
    ImageFold::refuse(ImageFold::find(model, wavelength), [0.0, square.sqrt()])?;
    let accepted = element.acceptance(&region)?;
    let [wide, narrow] =
        [FIELD_STEP, 0.5 * FIELD_STEP].map(|step| element.magnification(step, square));
    let [wide, narrow] = [wide?, narrow?];
    // Richardson: both are wrong by the square of the step.
    let best = (4.0 * narrow - wide) / 3.0;
    let value = accepted.value * best;
    let error = accepted.value * (best - narrow).abs() + accepted.error * best;
    Ok(Estimate::new(value, error, 9 * accepted.rays))
}

/// An element of the field.
struct FieldElement<'a> {
    model: &'a RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
}

impl FieldElement<'_> {
    /// The beam that the lens takes up from the field: the area across a collimated beam in mm², or
    /// the projected solid angle from an object point.
    fn acceptance(&self, region: &Region<'_>) -> Result<Estimate, AnalysisError> {
        let launch = &region.launch;
        let factor = launch.axis_cosine();
        let unit = |p: [f64; 2]| {
            if let Some(cosine) = factor {
                return Some(launch.area() * cosine.abs() * launch.beam_share(p));
            }
            let direction = launch.dual_ray(p)?.direction;
            let [l, m] = [direction.x.slope, direction.y.slope];
            Some((l[0] * m[1] - l[1] * m[0]).abs())
        };
        let sum = |nodes: &Nodes| {
            let (launched, landed) = launch.trace_points(&nodes.points);
            let lit = launched.iter().enumerate().filter(|(ray, _)| landed.fate(*ray).is_imaged());
            let part = |(_, i): (usize, &usize)| Some(nodes.weights[*i] * unit(nodes.points[*i])?);
            let area: f64 = lit.filter_map(part).sum();
            (area > 0.0).then_some([area])
        };
        let found = converge(region, self.accuracy, sum, |area| *area);
        let found = found.ok_or(AnalysisError::NoLight)?;
        Ok(Estimate::new(found.values[0], found.errors[0], found.rays))
    }

    /// The size of an annulus of the field over the area of its image, for a step of the field, whose own image height
    /// has this square in mm².
    fn magnification(&self, step: f64, square: f64) -> Result<f64, AnalysisError> {
        let size = self.field.x.hypot(self.field.y);
        if size == 0.0 {
            let edge = self.model.beam.edge.abs();
            let reach = if edge > 0.0 { edge } else { 1.0 };
            let [source, image] = self.squares(FieldPoint { y: step * reach, ..self.field })?;
            return Ok((source / image).abs());
        }
        let scaled = |factor: f64| {
            let FieldPoint { x, y, weight } = self.field;
            self.squares(FieldPoint { x: factor * x, y: factor * y, weight })
        };
        let ([outer, far], [inner, near]) = (scaled(1.0 + step)?, scaled(1.0 - step)?);
        // At a turn of the height an element of the field has no area to fall on.
        if (far - square) * (square - near) < 0.0 {
            return Err(AnalysisError::FoldedImage);
        }
        Ok(((outer - inner) / (far - near)).abs())
    }

    /// Twice one minus the cosine of a field's angle, or the square of its object height, and the
    /// square of its image height.
    fn squares(&self, field: FieldPoint) -> Result<[f64; 2], AnalysisError> {
        let region = lit_region(self.model, field, self.wavelength)?;
        let tolerance = self.accuracy.tolerance.min(1e-4);
        let [x, y] = centroid(&region, Accuracy { tolerance, ..self.accuracy })?;
        let source = match region.launch.axis_cosine() {
            Some(_) if self.model.beam.field == FieldKind::Angle => {
                4.0 * (0.5 * field.x.hypot(field.y).to_radians()).sin().powi(2)
            }
            Some(cosine) => 2.0 * (1.0 - cosine),
            None => {
                let start = region.launch.ray([0.0; 2]).ok_or(AnalysisError::NoLight)?;
                start.point.x.powi(2) + start.point.y.powi(2)
            }
        };
        Ok([source, x * x + y * y])
    }
}
