//! What chief rays show: distortion and field curvature.

use super::{AtField, Lines, Task, show};
use crate::analysis::{Estimate, distortion, field_curvature};
use crate::measure::timed;
use serde::Serialize;

/// The distortion at a field.
#[derive(Serialize)]
pub(super) struct DistortionKeys {
    height: Estimate,
    ideal: f64,
    distortion: Option<Estimate>,
    f_theta: Option<Estimate>,
}

pub(super) fn distortions(task: &Task) -> Vec<AtField<DistortionKeys>> {
    let at = |field: &crate::lens::Field| {
        let (result, ms) = timed(|| distortion(&task.bench, *field, task.bench.primary));
        let keys = result.map(|d| {
            let height = task.of_one_ray(d.height, ms);
            let relative =
                |value| Estimate { value, error: height.error / d.ideal.abs(), ..height };
            DistortionKeys {
                height,
                ideal: d.ideal,
                distortion: d.distortion.map(relative),
                f_theta: d.f_theta.map(relative),
            }
        });
        AtField::new(*field, keys)
    };
    task.fields.iter().map(at).collect()
}

impl Lines for DistortionKeys {
    const TITLE: &'static str =
        "distortion of the chief ray at the primary wavelength: heights in mm, ratios minus 1";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![show("chief ray height", &self.height)];
        lines.extend(self.distortion.iter().map(|e| show("against f tan(theta)", e)));
        lines.extend(self.f_theta.iter().map(|e| show("against f theta", e)));
        lines
    }
}

/// The foci at a field.
#[derive(Serialize)]
pub(super) struct CurvatureKeys {
    tangential: Option<Estimate>,
    sagittal: Option<Estimate>,
}

pub(super) fn curvatures(task: &Task) -> Vec<AtField<CurvatureKeys>> {
    // A focus is where rays cross at a small angle: rounding across the axis counts more along it.
    let cone = task.bench.first.working_f_number.unwrap_or(1.0).abs().max(1.0);
    let at = |field: &crate::lens::Field| {
        let (result, ms) = timed(|| field_curvature(&task.bench, *field, task.bench.primary));
        let estimate = |value: f64| {
            let one = task.of_one_ray(value, ms);
            Estimate { error: one.error * cone, ..one }
        };
        let keys = result.map(|c| CurvatureKeys {
            tangential: c.tangential.map(estimate),
            sagittal: c.sagittal.map(estimate),
        });
        AtField::new(*field, keys)
    };
    task.fields.iter().map(at).collect()
}

impl Lines for CurvatureKeys {
    const TITLE: &'static str =
        "foci along the chief ray at the primary wavelength, in mm behind the image plane";

    fn lines(&self) -> Vec<String> {
        let line = |name: &str, focus: &Option<Estimate>| {
            focus.as_ref().map_or(format!("{name}: rays are parallel"), |e| show(name, e))
        };
        vec![line("tangential", &self.tangential), line("sagittal", &self.sagittal)]
    }
}
