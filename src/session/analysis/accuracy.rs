//! Error against time of contrast and of pictures, measured for the present lens.

use super::{AnalysisSettings, contrast::highest_frequency};
use crate::analysis::AnalysisError;
use crate::analysis::Spot;
use crate::lens::Lens;
use crate::measure::{PictureWay, TransferMethod, measure_picture, measure_transfer};
use crate::pupil::RayModel;
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;

/// The time and the error of a way of computing something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccuracyPoint {
    /// The tolerance that was asked for; `None` for a way that has one error.
    pub tolerance: Option<f64>,
    /// The error against a reference, absolute for contrast, a share of mid grey for a picture.
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
    pub ways: Vec<(&'static str, Vec<AccuracyPoint>)>,
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
            let point = |row: &crate::measure::TransferRow| AccuracyPoint {
                tolerance: Some(row.tolerance),
                error: row.error,
                ms: row.ms,
            };
            (method.name(), rows.map(point).collect())
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
            let point = |row: &crate::measure::PictureRow| {
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
            ways: vec![("quick", of(PictureWay::Quick)), ("exact", of(PictureWay::Exact))],
            refused: None,
        }
    });
    Some(curves)
}

fn proceed(is_interrupted: &(dyn Fn() -> bool + Sync)) -> ControlFlow<()> {
    if is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
