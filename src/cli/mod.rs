//! The headless command line: the same work as in the window, results as text or JSON.
//!
//! Results go to standard output; progress and errors go to standard error. The exit status is 0
//! when the work is done, 1 when it failed, 2 when the input is wrong. An error names the file, the
//! place in it, what was found and what was expected.
//!
//! A subcommand is a file of this folder, a line in `CliCommand` and a line in its `run`. The JSON
//! that it reads and writes stands in `help/`, which is its `--help` and a part of the README.

mod analyze;
mod convert;
mod error;
mod experiment;
mod gradient;
mod grin;
mod info;
mod input;
mod measure;
mod names;
mod optimize;
mod output;
mod output_paths;
mod pareto;
mod progress;
mod search;
mod terms;
mod trace;
mod window;

use clap::{Parser, Subcommand};
use error::CliError;
use output::{Output, print_note};
use std::path::PathBuf;
use std::process::ExitCode;

/// Designs lenses by computation. Without arguments, or with just a lens, it opens the studio;
/// with a subcommand it works without a window or a display.
#[derive(Debug, Parser)]
#[command(version, after_help = EXIT)]
struct CliArgs {
    /// The lens that the studio opens: .json or .zmx
    lens: Option<PathBuf>,

    /// Prints the result as JSON
    #[arg(long, global = true)]
    json: bool,

    #[command(subcommand)]
    command: Option<CliCommand>,
}

const EXIT: &str = "Exit status: 0 done, 1 the work failed, 2 the input is wrong.\n\
    Lengths in mm, angles in degrees, wavelengths in um; surfaces count from 0.";

/// Every subcommand.
#[derive(Debug, Subcommand)]
enum CliCommand {
    Info(info::InfoArgs),
    Trace(trace::TraceArgs),
    Analyze(analyze::AnalyzeArgs),
    Gradient(gradient::GradientArgs),
    Optimize(optimize::OptimizeArgs),
    Pareto(pareto::ParetoArgs),
    Search(Box<search::SearchArgs>),
    Grin(grin::GrinArgs),
    Convert(convert::ConvertArgs),
    Experiment(experiment::ExperimentArgs),
    Measure(measure::MeasureArgs),
}

impl CliCommand {
    fn run(&self, output: &Output) -> Result<(), CliError> {
        match self {
            Self::Info(info) => info.run(output),
            Self::Trace(trace) => trace.run(output),
            Self::Analyze(analyze) => analyze.run(output),
            Self::Gradient(gradient) => gradient.run(output),
            Self::Optimize(optimize) => optimize.run(output),
            Self::Pareto(pareto) => pareto.run(output),
            Self::Search(search) => search.run(output),
            Self::Grin(grin) => grin.run(output),
            Self::Convert(convert) => convert.run(output),
            Self::Experiment(experiment) => experiment.run(output),
            Self::Measure(measure) => measure.run(output),
        }
    }
}

/// Does what the arguments of the process ask for.
pub fn run() -> ExitCode {
    env_logger::init();
    match CliArgs::try_parse() {
        Ok(arguments) => exit_code(arguments.run()),
        Err(usage) => {
            // Help that nobody reads to its end is no failure.
            drop(usage.print());
            ExitCode::from(u8::try_from(usage.exit_code()).unwrap_or(2))
        }
    }
}

impl CliArgs {
    fn run(&self) -> Result<(), CliError> {
        let output = Output::new(self.json);
        match &self.command {
            Some(_) if self.lens.is_some() => Err(CliError::Input(
                "a lens in front of a subcommand; expected it behind: `aplanat info LENS`".into(),
            )),
            Some(command) => command.run(&output),
            None => window::open(self.lens.as_deref()),
        }
    }
}

fn exit_code(result: Result<(), CliError>) -> ExitCode {
    let Err(failure) = result else { return ExitCode::SUCCESS };
    if !failure.is_closed_pipe() {
        print_note(format!("error: {failure}"));
    }
    ExitCode::from(failure.exit_status())
}
