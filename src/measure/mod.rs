//! Accuracy against time, throughput, memory.
//!
//! A method, a reference and budgets give a curve; several methods are timed turn by turn in one
//! run, so that a busy machine slows all of them alike and ratios keep their meaning. A rate is
//! the median of many short turns, with the slowest and the fastest beside it.

mod clock;
mod double_gauss;
mod machine;
mod memory;
mod process;
mod rates;
mod rounding;
mod trace;

pub use clock::timed;
pub use double_gauss::double_gauss;
pub use machine::Machine;
pub use memory::{Memory, peak_megabytes};
pub use process::{age_ms, processor_ms};
pub use rates::Rate;
pub use rounding::{Rounding, rounding};
pub use trace::{Throughput, TraceRow, Unmeasured, throughput};
