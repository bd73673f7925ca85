//! The illumination of the fields.

use super::{AnalysisRun, AtField, TextLines, estimate_text};
use crate::analysis::{Estimate, Illumination, illumination};
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
    let first = run.model.fields.first().copied();
    let alone = first.is_some_and(|first| run.fields == [first]);
    let selected = if alone { Vec::new() } else { run.fields.clone() };
    let listed = run.fields == run.model.fields;
    let fields = if listed { selected } else { first.into_iter().chain(selected).collect() };
    let skipped = usize::from(!listed && !alone);
    let model = RayModel { fields, ..run.model.clone() };
    let (results, ms) = time_ms(|| illumination(&model, model.primary, run.accuracy));
    let dark = results.iter().all(|light| light.error.is_some());
    let found = |light: &Illumination| match light.error {
        Some(why) if dark => AtField::new(light.field, Err(why)),
        _ => keys(light, ms),
    };
    results.iter().skip(skipped).map(found).collect()
}

fn keys(light: &Illumination, milliseconds: f64) -> AtField<IlluminationJson> {
    let milliseconds = Some(milliseconds);
    let keys = IlluminationJson {
        cone: Estimate { milliseconds, ..light.cone },
        relative: light.relative.map(|e| Estimate { milliseconds, ..e }),
        dark: light.error.map(|dark| dark.to_string()),
    };
    AtField::new(light.field, Ok(keys))
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
