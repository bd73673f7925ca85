//! Accuracy against time, throughput, memory.

mod trace;

use super::failure::Failure;
use super::output::Output;
use clap::Subcommand;

/// Measures accuracy against time, throughput and memory on this machine
#[derive(Debug, clap::Args)]
pub(super) struct Measure {
    #[command(subcommand)]
    what: What,
}

/// Everything that is measured.
#[derive(Debug, Subcommand)]
enum What {
    Trace(trace::Trace),
}

impl Measure {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        match &self.what {
            What::Trace(trace) => trace.run(output),
        }
    }
}
