//! Accuracy against time, throughput, memory.

mod gradient;
mod grin;
mod optimize;
mod plot;
mod search;
mod spot;
mod trace;
mod window;

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
    Spot(spot::Spot),
    Gradient(gradient::Gradient),
    Grin(grin::Grin),
    Optimize(optimize::Optimize),
    Search(Box<search::Search>),
    Window(window::Window),
}

impl Measure {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        match &self.what {
            What::Trace(trace) => trace.run(output),
            What::Spot(spot) => spot.run(output),
            What::Gradient(gradient) => gradient.run(output),
            What::Grin(grin) => grin.run(output),
            What::Optimize(optimize) => optimize.run(output),
            What::Search(search) => search.run(output),
            What::Window(window) => window.run(output),
        }
    }
}
