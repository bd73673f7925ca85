//! Distortion, field curvature, lateral colour and relative illumination from the axis to the edge of the
//! field.

use super::{
    AnalysisError, Distortion, FieldCurvature, Illumination, distortion, field_curvature,
    illumination, lateral_color,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;

/// The curves of a lens over its field, at the primary wavelength but for the lateral colour.
#[derive(Debug, Clone)]
pub struct FieldCurves {
    /// Points from the axis to the field farthest from it, evenly spaced along its direction.
    pub points: Vec<FieldCurvePoint>,
}

/// The numbers of a field.
#[derive(Debug, Clone)]
pub struct FieldCurvePoint {
    /// The distance of the field from the axis, in the unit of the lens's fields.
    pub height: f64,
    /// The distortion, or the reason why there is none.
    pub distortion: Result<Distortion, AnalysisError>,
    /// The field curvature, or the reason why there is none.
    pub curvature: Result<FieldCurvature, AnalysisError>,
    /// The lateral colour at every wavelength in mm, positive away from the axis, or the reason why there
    /// is none.
    pub lateral_color: Result<Vec<f64>, AnalysisError>,
    /// The illumination.
    pub illumination: Illumination,
}

/// The number of intervals between the axis and the edge of the field.
const INTERVALS: u32 = 10;

/// The curves of a lens up to the field point farthest from the axis.
pub fn field_curves(model: &RayModel, accuracy: Accuracy) -> FieldCurves {
    let edge = model.fields.iter().max_by(|a, b| height(a).total_cmp(&height(b)));
    let Some(edge) = edge.filter(|edge| height(edge) > 0.0) else {
        return FieldCurves { points: Vec::new() };
    };
    let at = |share: f64| FieldPoint { x: share * edge.x, y: share * edge.y, ..*edge };
    let fields = (0..=INTERVALS).map(|i| at(f64::from(i) / f64::from(INTERVALS))).collect();
    let model = RayModel { fields, ..model.clone() };
    let lights = illumination(&model, model.primary, accuracy);
    let point = |(field, illumination): (&FieldPoint, Illumination)| FieldCurvePoint {
        height: height(field),
        distortion: distortion(&model, *field, model.primary),
        curvature: field_curvature(&model, *field, model.primary),
        lateral_color: radial_color(&model, *field),
        illumination,
    };
    FieldCurves { points: model.fields.par_iter().zip(lights).map(point).collect() }
}

/// The lateral colour along the line from the axis to the image point.
fn radial_color(model: &RayModel, field: FieldPoint) -> Result<Vec<f64>, AnalysisError> {
    let [x, y] = model.chief_point(field, model.primary)?;
    let distance = x.hypot(y);
    let outwards = if distance > 0.0 { [x / distance, y / distance] } else { [0.0; 2] };
    let colors = lateral_color(model, field)?;
    Ok(colors.iter().map(|c| c.shift[0] * outwards[0] + c.shift[1] * outwards[1]).collect())
}

fn height(field: &FieldPoint) -> f64 {
    field.x.hypot(field.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Aperture, blank};

    /// A plane plate in front of a distant object images nothing, but its chief rays have a height:
    /// the curves go from the axis to the farthest field.
    #[test]
    fn the_curves_reach_from_the_axis_to_the_farthest_field() {
        let mut lens = blank();
        lens.aperture = Aperture::EntrancePupilDiameter(1.0);
        let field = |x, y| FieldPoint { x, y, weight: 1.0 };
        lens.fields.values = vec![field(0.0, 0.0), field(6.0, 8.0), field(0.0, 5.0)];
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let curves = field_curves(&model, Accuracy::default());
        let heights: Vec<f64> = curves.points.iter().map(|point| point.height).collect();
        assert_eq!((heights.first(), heights.len()), (Some(&0.0), 11));
        assert!((heights[10] - 10.0).abs() < 1e-12 && heights.is_sorted(), "{heights:?}");
        let relative = curves.points[0].illumination.relative.unwrap();
        assert!((relative.value - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_lens_with_its_field_on_the_axis_has_no_curves() {
        let mut lens = blank();
        lens.fields.values = vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }];
        let model = RayModel::from_lens(&lens, 0).unwrap();
        assert!(field_curves(&model, Accuracy::default()).points.is_empty());
    }
}
