//! The modulation transfer function from the axis to the edge of the field.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::{
    ContrastAtHeight, MtfCurve, MtfPoint, check_some_light, contrast_over_field,
};
use crate::cli::output::{ShortNumber, counted};
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The contrast over the field.
#[derive(Serialize)]
pub(super) struct FieldMtfJson {
    frequencies: Vec<f64>,
    rays: usize,
    milliseconds: f64,
    heights: Vec<HeightJson>,
}

/// The contrast at a distance from the axis, or the reason why there is none.
#[derive(Serialize)]
struct HeightJson {
    height: f64,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    curve: Option<MtfCurve>,
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
    /// The reason why the contrast is that of rays alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    by_rays: Option<String>,
}

/// The intervals between the axis and the edge of the field.
const INTERVALS: u32 = 10;

pub(super) fn over_field(run: &AnalysisRun) -> Vec<AtField<FieldMtfJson>> {
    let (found, milliseconds) = time_ms(|| {
        check_some_light(run.model.fields.iter().map(|field| (&run.model, *field)))?;
        contrast_over_field(&run.model, INTERVALS, &run.frequencies, run.accuracy, &|| false)
    });
    let reason = |heights: &[ContrastAtHeight]| {
        let all = heights.iter().all(|height| height.curve.is_err());
        heights.iter().find_map(|height| height.curve.as_ref().err().copied()).filter(|_| all)
    };
    let keys = found.and_then(|heights| match reason(&heights) {
        Some(why) => Err(why),
        None => Ok(FieldMtfJson {
            frequencies: run.frequencies.clone(),
            rays: heights.iter().flat_map(|height| &height.curve).map(|curve| curve.rays).sum(),
            milliseconds,
            heights: heights.into_iter().map(HeightJson::new).collect(),
        }),
    });
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    vec![AtField::new(&SelectedField { given: axis, traced: axis }, keys)]
}

impl HeightJson {
    fn new(found: ContrastAtHeight) -> Self {
        let ContrastAtHeight { height, curve, without_diffraction } = found;
        Self {
            height,
            refused: curve.as_ref().err().map(ToString::to_string),
            curve: curve.ok(),
            by_rays: without_diffraction.map(|why| why.to_string()),
        }
    }
}

impl TextLines for FieldMtfJson {
    const TITLE: &'static str = "MTF over the field, all wavelengths: tangential and sagittal at each frequency in \
         cycles/mm, heights in the unit of the fields";

    fn error_unit(_key: &str) -> &'static str {
        ""
    }

    fn lines(&self) -> Vec<String> {
        let Self { rays, milliseconds, frequencies, heights } = self;
        let mut lines = vec![format!("{}, {milliseconds:.3} ms", counted(*rays, "ray"))];
        let heads =
            frequencies.iter().map(|nu| format!("{:>26}", format!("{} /mm", ShortNumber(*nu))));
        lines.push(format!("{:>10}{}", "height", heads.collect::<String>()));
        let pair = |point: &MtfPoint| {
            let [t, s] = [point.tangential, point.sagittal].map(|value| value.modulus);
            let text = format!("{:.4} {:.4} ± {:.0e}", t.value, s.value, t.error.max(s.error));
            format!("{text:>26}")
        };
        lines.extend(heights.iter().map(|row| {
            let height = format!("{:>10}", ShortNumber(row.height).to_string());
            let points = row.curve.iter().flat_map(|curve| &curve.points);
            let refused = row.refused.as_ref().map(|why| format!("  {why}")).unwrap_or_default();
            let by_rays = if row.by_rays.is_some() { "  rays alone" } else { "" };
            height + &points.map(pair).collect::<String>() + &refused + by_rays
        }));
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let curve = |k: usize, section: &str, of: fn(&MtfPoint) -> f64| {
            let point =
                |row: &HeightJson| (row.height, row.curve.as_ref().map(|c| of(&c.points[k])));
            let name = format!("{}/mm {section}", ShortNumber(self.frequencies[k]));
            ChartCurve::new(name, k, self.heights.iter().map(point))
        };
        let curves = (0..self.frequencies.len()).flat_map(|k| {
            let tangential = curve(k, "tangential", |point| point.tangential.modulus.value);
            let sagittal = curve(k, "sagittal", |point| point.sagittal.modulus.value).dashed();
            [tangential, sagittal]
        });
        vec![CurveChart::new("over the field", ["field", "contrast"], curves.collect())]
    }
}
