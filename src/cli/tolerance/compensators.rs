//! Compensators in the results of `tolerance`: how far they travel, and what their stops cost.

use super::tables::{percent, surfaces, with_error};
use crate::cli::output::{ShortNumber, TextTable};
use crate::lens::AdjustedPart;
use crate::tolerance::{AdjustmentTravel, StoppedLenses, ToleranceAnalysis, TravelStatistics};
use serde::Serialize;

/// The travel of a compensator in lenses that are made, in mm or radians.
#[derive(Serialize)]
pub(super) struct CompensatorRow {
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    last: Option<usize>,
    /// The largest adjustment to either side; `None` for one without an end.
    travel: Option<f64>,
    /// The adjustment of the lens as designed.
    nominal: f64,
    form: TravelStatistics,
    real: Option<TravelStatistics>,
    #[serde(skip)]
    part: AdjustedPart,
}

/// The compensators of an analysis.
pub(super) fn compensator_rows(analysis: &ToleranceAnalysis) -> Vec<CompensatorRow> {
    let row = |own: &AdjustmentTravel| {
        let in_lens = own.part.in_lens();
        CompensatorRow {
            kind: own.part.key(),
            first: in_lens.map(|part| part.first),
            last: in_lens.map(|part| part.last),
            travel: own.travel,
            nominal: own.nominal,
            form: own.form,
            real: own.real,
            part: own.part,
        }
    };
    analysis.travels.iter().map(row).collect()
}

/// The compensators as text: angles in minutes of arc; of the real lenses, or by the form without any.
pub(super) fn compensator_table(rows: &[CompensatorRow]) -> TextTable {
    let head = [
        "compensator",
        "surfaces",
        "travel",
        "as designed",
        "mean",
        "standard deviation",
        "largest",
        "at stop",
    ];
    let mut table = TextTable::new(&head);
    for row in rows {
        let (factor, unit) =
            if row.part.is_angle() { (60.0_f64.to_degrees(), "'") } else { (1.0, " mm") };
        let number = |value: f64| format!("{}{unit}", ShortNumber(factor * value + 0.0));
        let found = row.real.unwrap_or(row.form);
        let place = row.part.in_lens().map_or_else(String::new, |p| surfaces(p.first, p.last));
        table.row([
            row.part.name().to_owned(),
            place,
            row.travel.map_or_else(|| "unlimited".to_owned(), number),
            number(row.nominal),
            number(found.mean),
            number(found.deviation),
            number(found.largest),
            percent(found.at_stop),
        ]);
    }
    table
}

/// The share of lenses at a stop above which a warning tells of it.
const MANY: f64 = 0.01;

/// A warning of the effect of stops on the quadratic model, where many lenses are at one.
pub(super) fn stop_warning(stopped: Option<StoppedLenses>) -> Option<String> {
    let StoppedLenses { share, difference } = stopped.filter(|stopped| stopped.share > MANY)?;
    Some(format!(
        "in {} of the lenses a compensator ends at its stop, where the spot is no quadratic function of \
         the errors; the rms of these by their rays differs from the model by {} mm",
        percent(share),
        with_error(difference)
    ))
}
