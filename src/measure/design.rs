//! Lenses designed from specifications, each against the figures of a known lens.

use super::Stopwatch;
use crate::search::design::{
    DesignRun, DesignSettings, JUDGEMENT_TOLERANCE, LensJudgement, LensRequirements,
    LensSpecification, SpecificationError, judge_lens,
};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};

/// A specification with the known lens that it was taken from.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SpecificationSheet {
    /// The name of the sheet.
    pub id: String,
    /// The specification.
    pub spec: LensSpecification,
    /// The known lens.
    pub reference: SheetReference,
    /// The RMS spot radius in µm that its structure reaches.
    pub bar_rms_um: f64,
}

/// The known lens of a sheet.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SheetReference {
    /// The file of the lens, whose name in the library is excluded from the starts.
    pub source: String,
    /// Its RMS spot radius over the fields, in µm.
    pub rms_um_over_fields: f64,
}

/// The result of one sheet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SheetScore {
    /// The name of the sheet.
    pub id: String,
    /// The RMS spot radius over the fields, in µm; `None` without a lens.
    pub rms_um: Option<f64>,
    /// The radius over that which the structure of the known lens reaches.
    pub score: Option<f64>,
    /// The radius over that of the known lens itself.
    pub against_reference: Option<f64>,
    /// The limits that the lens breaks.
    pub failures: Vec<String>,
    /// The origin of the lens.
    pub origin: String,
    /// The number of gradients.
    pub gradients: u64,
    /// The duration in seconds.
    pub seconds: f64,
}

/// Designs a lens from a sheet for some seconds, without the known lens and its copies among the
/// starts, and judges it anew. The finish comes on top of the time. `None` once `stop` is true.
///
/// # Errors
/// A specification that no lens satisfies.
pub fn measure_design(
    sheet: &SpecificationSheet,
    seconds: f64,
    seed: u64,
    stop: &AtomicBool,
) -> Result<Option<SheetScore>, SpecificationError> {
    let (asked, _) = LensRequirements::complete(&sheet.spec)?;
    let known = sheet.reference.source.rsplit('/').next().unwrap_or_default();
    let without = vec![known.trim_end_matches(".json").to_owned()];
    let settings = DesignSettings { without, ..DesignSettings::with_seed(seed) };
    let watch = Stopwatch::start();
    let mut run = DesignRun::new(&asked, &settings);
    while watch.seconds() < seconds && run.advance(watch.seconds() / seconds, stop) {}
    let designed = run.finish(stop).into_iter().next();
    // What was broken off depends on time.
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let judged = designed
        .as_ref()
        .and_then(|found| judge_lens(&found.lens, &asked, JUDGEMENT_TOLERANCE).ok());
    let rms_um = judged.as_ref().map(|judgement| 1e3 * judgement.rms);
    Ok(Some(SheetScore {
        id: sheet.id.clone(),
        score: rms_um.map(|rms| rms / sheet.bar_rms_um),
        against_reference: rms_um.map(|rms| rms / sheet.reference.rms_um_over_fields),
        rms_um,
        failures: judged.as_ref().map_or_else(Vec::new, LensJudgement::failures),
        origin: designed.map_or_else(String::new, |found| found.origin),
        gradients: run.gradients(),
        seconds: watch.seconds(),
    }))
}
