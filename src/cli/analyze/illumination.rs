//! The illumination of the fields.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{Estimate, Illumination, illumination};
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::pupil::RayModel;
use serde::Serialize;

/// The light at a field; a field without light has 0 and the reason.
#[derive(Serialize)]
pub(super) struct IlluminationJson {
    cone: Estimate,
    relative: Option<Estimate>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dark: Option<String>,
}

pub(super) fn illuminations(run: &AnalysisRun) -> Vec<AtField<IlluminationJson>> {
    // The reference is the first field of the lens, even if it is not selected.
    let first = run.model.fields.first();
    let selected: Vec<FieldPoint> = run.fields.iter().map(|field| field.traced).collect();
    let skipped = usize::from(first != selected.first());
    let fields = first.into_iter().take(skipped).chain(&selected).copied().collect();
    let model = RayModel { fields, ..run.model.clone() };
    let (results, ms) = time_ms(|| illumination(&model, model.primary, run.accuracy));
    let dark = results.iter().all(|light| light.error.is_some());
    let found = |(field, light): (&SelectedField, &Illumination)| match light.error {
        Some(why) if dark => AtField::new(field, Err(why)),
        _ => keys(field, light, ms),
    };
    run.fields.iter().zip(&results[skipped..]).map(found).collect()
}

fn keys(
    field: &SelectedField,
    light: &Illumination,
    milliseconds: f64,
) -> AtField<IlluminationJson> {
    let milliseconds = Some(milliseconds);
    let keys = IlluminationJson {
        cone: Estimate { milliseconds, ..light.cone },
        relative: light.relative.map(|e| Estimate { milliseconds, ..e }),
        dark: light.error.map(|dark| dark.to_string()),
    };
    AtField::new(field, Ok(keys))
}

impl TextLines for IlluminationJson {
    const TITLE: &'static str = "illumination at the primary wavelength: area of the cone in direction cosines, and \
         against the first field";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![estimate_text("cone", &self.cone)];
        lines.extend(self.relative.iter().map(|e| estimate_text("relative", e)));
        lines.extend(self.dark.clone());
        lines
    }
}
