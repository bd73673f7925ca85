//! Distortion and field curvature, from the chief ray and its derivatives.

use super::AnalysisError;
use crate::lens::{FieldKind, FieldPoint, Object};
use crate::math::Vec3;
use crate::pupil::RayModel;

/// The image height of a chief ray compared with the ideal one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distortion {
    /// The field.
    pub field: FieldPoint,
    /// The image height of the real chief ray along the field's direction, in mm.
    pub height: f64,
    /// The ideal image height, in mm: `f tan θ`, or the magnified object height.
    pub ideal: f64,
    /// `height / ideal − 1`; `None` on the axis.
    pub distortion: Option<f64>,
    /// The same relative to the paraxial chief ray in the image plane in use, so that a defocus counts
    /// as none; `None` on the axis.
    pub in_plane: Option<f64>,
    /// The same relative to `f θ`; `None` on the axis and for an object at a finite distance.
    pub f_theta: Option<f64>,
}

/// The foci of a narrow beam about a chief ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldCurvature {
    /// The field.
    pub field: FieldPoint,
    /// The distance from the image plane to the focus of rays in the plane of the field, in mm,
    /// positive along the light; `None` if they are parallel.
    pub tangential: Option<f64>,
    /// The same for rays perpendicular to the plane of the field.
    pub sagittal: Option<f64>,
}

impl RayModel {
    /// The image point of the chief ray of a field, without clipping, in mm.
    pub(super) fn chief_point(
        &self,
        field: FieldPoint,
        wavelength: usize,
    ) -> Result<[f64; 2], AnalysisError> {
        let launch = self.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
        let landing = launch.unclipped_landing([0.0, 0.0]).ok_or(AnalysisError::NoChief)?;
        Ok([landing.ray.point.x.value, landing.ray.point.y.value])
    }

    /// The ideal image height of a field along its direction, in mm.
    fn ideal_height(&self, field: FieldPoint) -> Option<f64> {
        let size = field.x.hypot(field.y);
        match (self.beam.field, self.beam.object) {
            (FieldKind::ImageHeight, _) => Some(size),
            (FieldKind::ObjectHeight, _) => Some(self.first_order.magnification? * size),
            (FieldKind::Angle, Object::Infinity) => {
                let index = self.channels[self.primary].system.index_before;
                Some(self.first_order.efl? * index * size.to_radians().tan())
            }
            (FieldKind::Angle, Object::Finite(distance)) => {
                let reach = distance + self.first_order.entrance_pupil.position?;
                Some(-self.first_order.magnification? * reach * size.to_radians().tan())
            }
        }
    }

    /// The height of a paraxial chief ray in the image plane over that in the paraxial image: from the exit
    /// pupil it goes on in a straight line.
    fn height_by_defocus(&self) -> Option<f64> {
        let first = &self.first_order;
        let (image, defocus) = (first.paraxial_image?, first.image_defocus?);
        let ratio = first.exit_pupil.position.map_or(1.0, |pupil| 1.0 + defocus / (image - pupil));
        ratio.is_finite().then_some(ratio)
    }
}

/// The distortion of a field at a wavelength.
///
/// # Errors
/// The chief ray does not reach the image, or the lens has no focal length to compare with.
pub fn distortion(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
) -> Result<Distortion, AnalysisError> {
    let [x, y] = model.chief_point(field, wavelength)?;
    let ideal =
        model.ideal_height(field).filter(|h| h.is_finite()).ok_or(AnalysisError::NoChief)?;
    let size = field.x.hypot(field.y);
    let height = if size == 0.0 { y } else { (x * field.x + y * field.y) / size };
    let against = |ideal: f64| (ideal != 0.0).then(|| height / ideal - 1.0);
    let collimated = model.beam.object == Object::Infinity && model.beam.field == FieldKind::Angle;
    let efl = model.first_order.efl.filter(|_| collimated);
    let f_theta = efl.and_then(|f| against(f * size.to_radians()));
    let in_plane = model.height_by_defocus().and_then(|ratio| against(ratio * ideal));
    Ok(Distortion { field, height, ideal, distortion: against(ideal), in_plane, f_theta })
}

/// The image points of the chief rays of a field at all wavelengths, x and y in mm, without clipping;
/// `None` where one does not reach the image.
pub fn chief_points(model: &RayModel, field: FieldPoint) -> Vec<Option<[f64; 2]>> {
    let point = |wavelength: usize| model.chief_point(field, wavelength).ok();
    (0..model.channels.len()).map(point).collect()
}

/// A point of a square grid in the scene and in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridPoint {
    /// The field.
    pub field: FieldPoint,
    /// The image point of a lens without distortion, in mm.
    pub ideal: [f64; 2],
    /// The image point of the chief ray in mm, or the reason why there is none.
    pub real: Result<[f64; 2], AnalysisError>,
}

impl GridPoint {
    /// The distance of the image point from the ideal one over the height of the ideal one; `None` on the
    /// axis and without an image point.
    pub fn distortion(&self) -> Option<f64> {
        let real = self.real.ok()?;
        let height = self.ideal[0].hypot(self.ideal[1]);
        let off = (real[0] - self.ideal[0]).hypot(real[1] - self.ideal[1]);
        (height > 0.0).then(|| off / height)
    }
}

/// The images of a square grid of points, row by row from below, whose corners are as far from the axis as
/// the farthest field: squares in a plane across the axis, so that a lens without distortion images
/// squares. `steps` is the number of squares along a side.
///
/// # Errors
/// The lens has no focal length to compare with, or all fields are on the axis.
pub fn distortion_grid(
    model: &RayModel,
    wavelength: usize,
    steps: usize,
) -> Result<Vec<GridPoint>, AnalysisError> {
    let size = |field: &FieldPoint| field.x.hypot(field.y);
    let corner = model.fields.iter().map(size).fold(0.0, f64::max);
    if corner == 0.0 {
        return Err(AnalysisError::NoChief);
    }
    let is_angle = model.beam.field == FieldKind::Angle;
    let reach = if is_angle { corner.to_radians().tan() } else { corner } / 2f64.sqrt();
    let side = |i: usize| reach * (2.0 * i as f64 / steps.max(1) as f64 - 1.0);
    let point = |i: usize| {
        let (x, y) = (side(i % (steps + 1)), side(i / (steps + 1)));
        let length = x.hypot(y);
        let size = if is_angle { length.atan().to_degrees() } else { length };
        // No rounding on the axis.
        let scale = if length > 1e-12 * reach { size / length } else { 0.0 };
        let field = FieldPoint { x: scale * x, y: scale * y, weight: 1.0 };
        let height = model.ideal_height(field).filter(|height| height.is_finite());
        let height = height.ok_or(AnalysisError::NoChief)?;
        let share = if scale == 0.0 { 0.0 } else { height / length };
        let real = model.chief_point(field, wavelength);
        Ok(GridPoint { field, ideal: [share * x, share * y], real })
    };
    (0..(steps + 1).pow(2)).map(point).collect()
}

/// The tangential and sagittal focus of a field at a wavelength, from the derivatives of the chief
/// ray: the same numbers as Coddington's equations give.
///
/// # Errors
/// The chief ray does not reach the image.
pub fn field_curvature(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
) -> Result<FieldCurvature, AnalysisError> {
    let launch = model.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
    let landing = launch.unclipped_landing([0.0, 0.0]).ok_or(AnalysisError::NoChief)?;
    let Vec3 { x, y, .. } = landing.ray.point;
    let d = landing.ray.direction;
    let slopes = [d.x / d.z, d.y / d.z];
    let size = field.x.hypot(field.y);
    let [tx, ty] = if size == 0.0 { [0.0, 1.0] } else { [field.x / size, field.y / size] };
    let focus = |ex: f64, ey: f64| {
        // Along (ex, ey) in the pupil and in the image.
        let along = |v: [crate::math::Dual<f64, 2>; 2]| {
            let by = |s: [f64; 2]| s[0] * ex + s[1] * ey;
            ex * by(v[0].slope) + ey * by(v[1].slope)
        };
        let turn = along(slopes);
        (turn != 0.0).then(|| -along([x, y]) / turn)
    };
    Ok(FieldCurvature { field, tangential: focus(tx, ty), sagittal: focus(-ty, tx) })
}
