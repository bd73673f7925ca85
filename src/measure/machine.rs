//! The machine of a measurement.

use crate::trace::SimdWidth;
use serde::Serialize;
use std::fmt;

/// The properties of a machine that measurements depend on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// The name of the processor, as the system reports it.
    pub processor: String,
    /// The number of cores available to this process.
    pub cores: usize,
    /// The width of the SIMD registers used by batches, in bits.
    pub lane_bits: usize,
    /// True if the program was compiled with optimisation.
    pub optimised: bool,
}

impl Machine {
    /// The machine that the program runs on.
    pub fn detect() -> Self {
        Self {
            processor: processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            lane_bits: match SimdWidth::detect() {
                SimdWidth::Baseline => 128,
                SimdWidth::Bits256 => 256,
                SimdWidth::Bits512 => 512,
            },
            optimised: !cfg!(debug_assertions),
        }
    }
}

fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { processor, cores, lane_bits, optimised } = self;
        let build = if *optimised { "" } else { "; NOT OPTIMISED, build with --release" };
        write!(f, "{processor}, {cores} cores, lanes of {lane_bits} bits{build}")
    }
}
