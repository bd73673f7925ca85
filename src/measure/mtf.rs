//! Error against time of the modulation transfer function, by rays and by diffraction.
//!
//! The work is that of a designer's chart: every field and colour, tangential and sagittal, at all
//! frequencies, on one thread. The reference is the tightest tolerance; errors are the largest absolute
//! differences of the complex sums over wavelengths from it. The pupils of the fields are searched for once, as
//! a design session does for all analyses, and that is timed by itself.

use super::timing::time_median;
use crate::analysis::{
    AnalysisError, ContrastLimit, MtfCurve, TransferValue, polychromatic_diffraction_mtf,
    polychromatic_geometric_mtf,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel, Region};
use rayon::ThreadPool;
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::ops::ControlFlow;

/// The way of computing contrast.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransferMethod {
    /// By rays alone.
    Geometric,
    /// By diffraction.
    Diffraction,
}

impl TransferMethod {
    /// Both ways.
    pub const ALL: [Self; 2] = [Self::Geometric, Self::Diffraction];

    /// The name of the method in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Geometric => "rays",
            Self::Diffraction => "diffraction",
        }
    }
}

/// A chart of contrast at one tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TransferRow {
    /// The method.
    pub method: TransferMethod,
    /// The tolerance asked for.
    pub tolerance: f64,
    /// The largest error estimate, without what the reference sphere leaves.
    pub stated: f64,
    /// The largest part of an error by the choice of the reference sphere; charts on the same sphere do not differ by
    /// it.
    pub sphere: f64,
    /// The largest difference from the reference.
    pub error: f64,
    /// True if every curve says that it reached the tolerance.
    pub reached: bool,
    /// The cause of errors above the tolerance; `None` if it was reached.
    pub limit: Option<ContrastLimit>,
    /// The rays of all curves.
    pub rays: usize,
    /// The time of the whole chart on one thread, in milliseconds.
    pub ms: f64,
}

/// Error against time of both methods for a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransferCurves {
    /// The fields, in the unit of the lens.
    pub fields: Vec<f64>,
    /// The number of wavelengths.
    pub colors: usize,
    /// The lowest and the highest frequency, in cycles/mm.
    pub frequencies: [f64; 2],
    /// The number of frequencies.
    pub count: usize,
    /// The time in which the pupils of all fields and colours are found, on one thread, in milliseconds.
    pub pupils_ms: f64,
    /// The charts.
    pub rows: Vec<TransferRow>,
    /// The reason why there are no charts by diffraction.
    pub refused: Option<String>,
}

/// The tolerances of the charts, and that of the reference.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
const REFERENCE: f64 = 3e-7;
/// The parts of the farthest field.
const ZONES: [f64; 3] = [0.0, 0.7, 1.0];

/// Measures the charts of a lens at so many frequencies up to one in cycles/mm, on the thread of a pool;
/// `report` is told how many of all parts are
/// done, and may break.
///
/// # Errors
/// No field has light.
pub fn measure_transfer(
    model: &RayModel,
    (highest, count): (f64, usize),
    pool: &ThreadPool,
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<TransferCurves, AnalysisError> {
    let edge = model.beam.edge;
    let fields = ZONES.map(|zone| FieldPoint { x: 0.0, y: zone * edge, weight: 1.0 }).to_vec();
    let model = &RayModel { fields: fields.clone(), ..model.clone() };
    let ((), pupils_ms) = pool.install(|| time_median(1..=9, || find_pupils(&model.clone())));
    find_pupils(model);
    let chart = TransferChart {
        model,
        pool,
        fields,
        frequencies: (1..=count).map(|i| highest * i as f64 / count as f64).collect(),
    };
    let mut curves = TransferCurves {
        fields: chart.fields.iter().map(|field| field.y).collect(),
        colors: model.channels.len(),
        frequencies: [highest / count as f64, highest],
        count,
        pupils_ms,
        rows: Vec::new(),
        refused: None,
    };
    let all = TransferMethod::ALL.len() * (TOLERANCES.len() + 1);
    let mut done = 0;
    for method in TransferMethod::ALL {
        let exact = match chart.compute(method, REFERENCE) {
            Ok(exact) => exact,
            Err(why) if method == TransferMethod::Geometric => return Err(why),
            Err(why) => {
                curves.refused = Some(why.to_string());
                break;
            }
        };
        for tolerance in TOLERANCES {
            done += 1;
            if report(done, all).is_break() {
                return Ok(curves);
            }
            curves.rows.push(chart.row(method, tolerance, &exact)?);
        }
    }
    Ok(curves)
}

/// Finds the pupils of the fields of a model, which remembers them.
fn find_pupils(model: &RayModel) {
    for field in &model.fields {
        for wavelength in 0..model.channels.len() {
            // A field without rays has no pupil, and the charts say so.
            drop(black_box(model.launch(*field, wavelength).map(Region::new)));
        }
    }
}

/// The chart of a lens: its fields and frequencies.
struct TransferChart<'a> {
    model: &'a RayModel,
    /// One thread.
    pool: &'a ThreadPool,
    fields: Vec<FieldPoint>,
    frequencies: Vec<f64>,
}

impl TransferChart<'_> {
    fn compute(
        &self,
        method: TransferMethod,
        tolerance: f64,
    ) -> Result<Vec<MtfCurve>, AnalysisError> {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let curve = |field: &FieldPoint| match method {
            TransferMethod::Geometric => {
                polychromatic_geometric_mtf(self.model, *field, &self.frequencies, accuracy)
            }
            TransferMethod::Diffraction => {
                polychromatic_diffraction_mtf(self.model, *field, &self.frequencies, accuracy)
            }
        };
        self.pool.install(|| self.fields.iter().map(curve).collect())
    }

    fn row(
        &self,
        method: TransferMethod,
        tolerance: f64,
        exact: &[MtfCurve],
    ) -> Result<TransferRow, AnalysisError> {
        let (found, ms) = time_median(1..=9, || self.compute(method, tolerance));
        let found = found?;
        let pairs = values(&found).zip(values(exact));
        let limits = found.iter().filter_map(|curve| curve.limit);
        let off = |(a, b): (TransferValue, TransferValue)| (a.re - b.re).hypot(a.im - b.im);
        Ok(TransferRow {
            method,
            tolerance,
            stated: found.iter().map(MtfCurve::numerical_error).fold(0.0, f64::max),
            sphere: found.iter().map(|curve| curve.sphere).fold(0.0, f64::max),
            error: pairs.map(off).fold(0.0, f64::max),
            reached: found.iter().all(|curve| curve.reached),
            limit: limits.max_by(|a, b| a.error().total_cmp(&b.error())),
            rays: found.iter().map(|curve| curve.rays).sum(),
            ms,
        })
    }
}

fn values(curves: &[MtfCurve]) -> impl Iterator<Item = TransferValue> + '_ {
    let points = curves.iter().flat_map(|curve| &curve.points);
    points.flat_map(|point| [point.tangential, point.sagittal])
}
