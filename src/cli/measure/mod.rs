//! `measure`: benchmarks of accuracy against time, throughput and memory.

mod arrival;
mod design;
mod glasses;
mod gradient;
mod grin;
mod images;
mod limits;
mod minima;
mod mtf;
mod optiland;
mod optimize;
mod picture;
mod plot;
mod psf;
mod search;
mod spot;
mod tolerance;
mod trace;
mod window;

use super::error::CliError;
use super::output::Output;
use clap::Subcommand;

/// Measures accuracy against time, throughput and memory on this machine
#[derive(Debug, clap::Args)]
pub(super) struct MeasureArgs {
    #[command(subcommand)]
    what: BenchmarkCommand,
}

/// The benchmarks.
#[derive(Debug, Subcommand)]
enum BenchmarkCommand {
    Trace(trace::MeasureTraceArgs),
    Spot(spot::MeasureSpotArgs),
    Mtf(mtf::MeasureMtfArgs),
    Psf(psf::MeasurePsfArgs),
    Gradient(gradient::MeasureGradientArgs),
    Picture(picture::MeasurePictureArgs),
    Images(images::MeasureImagesArgs),
    Grin(grin::MeasureGrinArgs),
    Optimize(optimize::MeasureOptimizeArgs),
    Limits(limits::MeasureLimitsArgs),
    Glasses(glasses::MeasureGlassesArgs),
    Search(Box<search::MeasureSearchArgs>),
    Minima(Box<minima::MeasureMinimaArgs>),
    Design(design::MeasureDesignArgs),
    Tolerance(tolerance::MeasureToleranceArgs),
    Window(window::MeasureWindowArgs),
}

impl MeasureArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        match &self.what {
            BenchmarkCommand::Trace(trace) => trace.run(output),
            BenchmarkCommand::Spot(spot) => spot.run(output),
            BenchmarkCommand::Mtf(mtf) => mtf.run(output),
            BenchmarkCommand::Psf(psf) => psf.run(output),
            BenchmarkCommand::Gradient(gradient) => gradient.run(output),
            BenchmarkCommand::Picture(picture) => picture.run(output),
            BenchmarkCommand::Images(images) => images.run(output),
            BenchmarkCommand::Grin(grin) => grin.run(output),
            BenchmarkCommand::Optimize(optimize) => optimize.run(output),
            BenchmarkCommand::Limits(limits) => limits.run(output),
            BenchmarkCommand::Glasses(glasses) => glasses.run(output),
            BenchmarkCommand::Search(search) => search.run(output),
            BenchmarkCommand::Minima(minima) => minima.run(output),
            BenchmarkCommand::Design(design) => design.run(output),
            BenchmarkCommand::Tolerance(tolerance) => tolerance.run(output),
            BenchmarkCommand::Window(window) => window.run(output),
        }
    }
}
