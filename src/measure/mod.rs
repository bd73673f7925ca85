//! Benchmarks: accuracy against time, throughput, memory.
//!
//! A method, a reference and budgets give a curve. Several methods are timed in turn in one run, so
//! that a busy machine slows all of them alike and ratios remain meaningful. A rate is the median
//! of many short repetitions, reported with the slowest and the fastest.

mod accuracy;
mod arrival;
mod design;
mod double_gauss;
mod effects;
mod glasses;
mod gradient;
mod grin;
mod grin_starts;
mod images;
mod limits;
mod machine;
mod minima;
mod mtf;
mod optimize;
mod picture;
mod picture_effects;
mod rounding;
mod search;
mod some_tolerances;
mod spot;
mod term_cost;
mod timing;
mod tolerance;
mod tolerance_cases;
mod tolerance_reference;
mod trace;

pub use accuracy::{AccuracyPoint, point_spread_accuracy, transfer_accuracy};
pub use arrival::{ArrivalComparison, ArrivalRow, measure_arrival};
pub use design::{SheetReference, SheetScore, SpecificationSheet, measure_design};
pub use double_gauss::double_gauss;
pub use effects::EffectTask;
pub use glasses::{GlassGain, GlassPhase, GlassProgress, measure_glass_gain};
pub use gradient::{
    GradientBenchmark, GradientBenchmarkError, GradientCost, GradientCurves, GradientRow, Integral,
    ParameterClass, measure_gradients,
};
pub use grin::{
    GrinBenchmark, GrinBenchmarkError, GrinCost, GrinCurves, GrinMemory, GrinRow, measure_grin,
};
pub use grin_starts::GrinStarts;
pub use images::{
    ImageAnswers, ImageEntry, ImageField, ImageFileError, ImageLens, image_kinds, measure_images,
};
pub use limits::{LimitComparison, LimitedDescent, compare_limit_treatments};
pub use machine::{Machine, MemoryUse, age_ms, peak_megabytes, processor_ms};
pub use minima::{MinimaCount, count_minima};
pub use mtf::{TransferCurves, TransferMethod, TransferRow, measure_transfer};
pub use optimize::{StepCosts, StepRow, measure_step_costs};
pub use picture::{PictureCurves, PictureRow, PictureWay, measure_picture};
pub use picture_effects::{EFFECT_TILES, PictureEffects, tile_ms};
pub use rounding::{Rounding, measure_rounding};
pub use search::{
    MeritQuantiles, SearchBenchmark, SearchBudget, SearchContender, SearchLength, SearchRow,
    SignTest, compare_searches,
};
pub use some_tolerances::{SomeTolerances, measure_some_tolerances};
pub use spot::{
    Precision, PupilClipping, PupilSampling, SpotCurves, SpotCurvesError, SpotRow,
    measure_spot_curves,
};
pub use term_cost::{TermCost, TermCosts, measure_term_costs};
pub use timing::{RateStatistics, Stopwatch, time_ms};
pub use tolerance::{
    AsBuiltComparison, AsBuiltCost, MadeDesign, ToleranceBenchmark, ToleranceBenchmarkError,
    compare_as_built, measure_tolerances,
};
pub use tolerance_cases::{MeritSweepCost, PoseCost};
pub use tolerance_reference::{
    AgreementRow, ReferenceAgreement, ReferenceLens, ToleranceReference, ToleranceReferenceError,
};
pub use trace::{BenchmarkError, Throughput, TraceRow, measure_throughput};
