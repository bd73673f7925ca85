//! Accuracy against time, throughput, memory.
//!
//! A method, a reference and budgets give a curve; several methods are timed turn by turn in one
//! run, so that a busy machine slows all of them alike and ratios keep their meaning. A rate is
//! the median of many short turns, with the slowest and the fastest beside it.

mod clock;
mod double_gauss;
mod gradient;
mod grin;
mod grin_starts;
mod machine;
mod memory;
mod optimize;
mod process;
mod rates;
mod rounding;
mod search;
mod spot;
mod trace;

pub use clock::{Stopwatch, timed};
pub use double_gauss::double_gauss;
pub use gradient::{
    GradientCost, GradientCurves, GradientRow, Gradients, Integral, NoGradients, Numbers, gradients,
};
pub use grin::{GrinCost, GrinCurves, GrinMeasured, GrinMemory, GrinRow, NoGrin, grin};
pub use grin_starts::GrinStarts;
pub use machine::Machine;
pub use memory::{Memory, peak_megabytes};
pub use optimize::{StepCosts, StepRow, step_costs};
pub use process::{age_ms, processor_ms};
pub use rates::Rate;
pub use rounding::{Rounding, rounding};
pub use search::{Mark, Race, SearchRow, Searches, searches};
pub use spot::{NoCurves, Precision, Pupil, Sampling, SpotCurves, SpotRow, spot_curves};
pub use trace::{Throughput, TraceRow, Unmeasured, throughput};
