//! Error against time of contrast, of the point spread and of pictures, measured for the present lens.

use super::{AnalysisSettings, contrast::highest_frequency};
use crate::analysis::AnalysisError;
use crate::analysis::Spot;
use crate::lens::{FieldKind, FieldPoint, Fields, Lens};
use crate::math::ShortNumber;
use crate::measure::{self, PictureWay, TransferMethod, measure_picture, measure_transfer};
use crate::pupil::RayModel;
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;

/// The time and the error of a way of computing something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccuracyPoint {
    /// The tolerance that was asked for; `None` for a way that has one error.
    pub tolerance: Option<f64>,
    /// The error against a reference: absolute for contrast, a share of the peak without aberrations for the point
    /// spread, a share of mid grey for a picture.
    pub error: f64,
    /// The time in milliseconds.
    pub ms: f64,
}

/// Error against time of some ways of computing the same.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyCurves {
    /// The thing that was measured.
    pub about: String,
    /// The ways by their names.
    pub ways: Vec<(String, Vec<AccuracyPoint>)>,
    /// The reason why a way is missing.
    pub refused: Option<String>,
}

/// The frequencies of a measured chart of contrast.
const FREQUENCIES: usize = 12;
/// The pixels of a picture, and those that the exact way is timed on.
const PIXELS: [[usize; 2]; 2] = [[360, 240], [120, 80]];

/// Contrast by rays and by diffraction at three heights of the field; `None` if it was interrupted.
pub(super) fn contrast_accuracy(
    model: &RayModel,
    spots: &[Result<Spot, AnalysisError>],
    is_interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<Result<AccuracyCurves, String>> {
    let pool = match ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(why) => return Some(Err(why.to_string())),
    };
    let highest = highest_frequency(model, spots);
    let watch = |_, _| proceed(is_interrupted);
    let found = measure_transfer(model, (highest, FREQUENCIES), &pool, watch);
    if is_interrupted() {
        return None;
    }
    let curves = found.map_err(|why| why.to_string()).map(|found| {
        let of = |method: TransferMethod| {
            let rows = found.rows.iter().filter(|row| row.method == method);
            let point = |row: &measure::TransferRow| AccuracyPoint {
                tolerance: Some(row.tolerance),
                error: row.error,
                ms: row.ms,
            };
            (method.name().to_owned(), rows.map(point).collect())
        };
        AccuracyCurves {
            about: format!(
                "a chart of {} fields, {} colours and {FREQUENCIES} frequencies up to {highest:.0} /mm on one \
                 thread",
                found.fields.len(),
                found.colors
            ),
            ways: TransferMethod::ALL.map(of).into(),
            refused: found.refused,
        }
    });
    Some(curves)
}

/// The point spread by diffraction of some fields, the first, the middle and the last one; `None` if it was
/// interrupted.
pub(super) fn point_spread_accuracy(
    model: &RayModel,
    fields: &Fields,
    is_interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<Result<AccuracyCurves, String>> {
    let pool = match ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(why) => return Some(Err(why.to_string())),
    };
    let last = model.fields.len().saturating_sub(1);
    let mut chosen = vec![0, last / 2, last];
    chosen.dedup();
    let (mut ways, mut refused) = (Vec::new(), Vec::new());
    for i in chosen {
        let (Some(traced), Some(given)) = (model.fields.get(i), fields.values.get(i)) else {
            continue;
        };
        let measure =
            || measure::point_spread_accuracy(model, *traced, model.primary, is_interrupted);
        let name = field_name(fields.kind, *given);
        match pool.install(measure) {
            Ok(rows) => {
                if rows.iter().any(|row| !row.reached) {
                    refused.push(format!(
                        "{name}: a tolerance is not reached, the error is the stated one"
                    ));
                }
                ways.push((name, rows.iter().map(AccuracyPoint::of_row).collect()));
            }
            Err(AnalysisError::Interrupted) => return None,
            Err(why) => refused.push(format!("{name}: {why}")),
        }
    }
    let um = model.channels[model.primary].um;
    let about = format!(
        "24 x 24 points within four Airy radii by diffraction at {:.0} nm on one thread",
        1e3 * um
    );
    let refused = (!refused.is_empty()).then(|| refused.join("; "));
    Some(Ok(AccuracyCurves { about, ways, refused }))
}

impl AccuracyPoint {
    /// The point of a row. The reference is no better where a tolerance is not reached: only the error that is stated
    /// counts there.
    fn of_row(row: &measure::AccuracyPoint) -> Self {
        let error = if row.reached { row.error } else { row.stated.max(row.error) };
        Self { tolerance: Some(row.tolerance), error, ms: row.ms }
    }
}

/// The name of a field with its unit.
pub(in crate::session) fn field_name(kind: FieldKind, field: FieldPoint) -> String {
    let unit = if kind == FieldKind::Angle { "°" } else { " mm" };
    match field.x {
        0.0 => format!("{}{unit}", ShortNumber(field.y)),
        x => format!("({}, {}){unit}", ShortNumber(x), ShortNumber(field.y)),
    }
}

/// The scene of the picture by the quick and by the exact way; `None` if it was interrupted.
pub(super) fn picture_accuracy(
    lens: &Lens,
    settings: &AnalysisSettings,
    is_interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<Result<AccuracyCurves, String>> {
    let found = measure_picture(lens, settings.scene, PIXELS, |_, _| proceed(is_interrupted));
    if is_interrupted() {
        return None;
    }
    let curves = found.map_err(|why| why.to_string()).map(|found| {
        let of = |way: PictureWay| {
            let rows = found.rows.iter().filter(|row| row.way == way);
            let point = |row: &measure::PictureRow| {
                Some(AccuracyPoint {
                    tolerance: row.tolerance,
                    error: row.error?,
                    ms: row.whole_ms,
                })
            };
            rows.filter_map(point).collect()
        };
        let [columns, rows] = found.pixels;
        AccuracyCurves {
            about: format!("the scene {} in {columns} x {rows} pixels", found.scene),
            ways: vec![
                ("quick".to_owned(), of(PictureWay::Quick)),
                ("exact".to_owned(), of(PictureWay::Exact)),
            ],
            refused: None,
        }
    });
    Some(curves)
}

fn proceed(is_interrupted: &(dyn Fn() -> bool + Sync)) -> ControlFlow<()> {
    if is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
