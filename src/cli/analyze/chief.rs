//! Results from chief rays: distortion and field curvature.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{Estimate, distortion, field_curvature};
use crate::measure::time_ms;
use serde::Serialize;

/// The distortion at a field.
#[derive(Serialize)]
pub(super) struct DistortionJson {
    height: Estimate,
    ideal: f64,
    distortion: Option<Estimate>,
    f_theta: Option<Estimate>,
}

pub(super) fn distortions(run: &AnalysisRun) -> Vec<AtField<DistortionJson>> {
    let at = |field: &SelectedField| {
        let (result, ms) = time_ms(|| distortion(&run.model, field.traced, run.model.primary));
        let keys = result.map(|d| {
            let height = run.single_ray_estimate(d.height, ms);
            let error = height.error + run.model.neglected.ray_shift;
            let height = Estimate { error, ..height };
            let relative =
                |value| Estimate { value, error: height.error / d.ideal.abs(), ..height };
            DistortionJson {
                height,
                ideal: d.ideal,
                distortion: d.distortion.map(relative),
                f_theta: d.f_theta.map(relative),
            }
        });
        AtField::new(field, keys)
    };
    run.fields.iter().map(at).collect()
}

impl TextLines for DistortionJson {
    const TITLE: &'static str =
        "distortion of the chief ray at the primary wavelength: heights in mm, ratios minus 1";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![estimate_text("chief ray height", &self.height)];
        lines.extend(self.distortion.iter().map(|e| estimate_text("against f tan(theta)", e)));
        lines.extend(self.f_theta.iter().map(|e| estimate_text("against f theta", e)));
        lines
    }
}

/// The foci at a field.
#[derive(Serialize)]
pub(super) struct FieldCurvatureJson {
    tangential: Option<Estimate>,
    sagittal: Option<Estimate>,
}

pub(super) fn curvatures(run: &AnalysisRun) -> Vec<AtField<FieldCurvatureJson>> {
    // Rays cross at the focus at a small angle, so rounding across the axis is enlarged along it.
    let cone = run.model.first_order.working_f_number.unwrap_or(1.0).abs().max(1.0);
    let at = |field: &SelectedField| {
        let (result, ms) = time_ms(|| field_curvature(&run.model, field.traced, run.model.primary));
        let estimate = |value: f64| {
            let one = run.single_ray_estimate(value, ms);
            Estimate { error: one.error * cone, ..one }
        };
        let keys = result.map(|c| FieldCurvatureJson {
            tangential: c.tangential.map(estimate),
            sagittal: c.sagittal.map(estimate),
        });
        AtField::new(field, keys)
    };
    run.fields.iter().map(at).collect()
}

impl TextLines for FieldCurvatureJson {
    const TITLE: &'static str =
        "foci along the chief ray at the primary wavelength, in mm behind the image plane";

    fn lines(&self) -> Vec<String> {
        let line = |name: &str, focus: &Option<Estimate>| {
            focus.as_ref().map_or(format!("{name}: rays are parallel"), |e| estimate_text(name, e))
        };
        vec![line("tangential", &self.tangential), line("sagittal", &self.sagittal)]
    }
}
