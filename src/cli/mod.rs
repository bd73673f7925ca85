//! The command line: the same work as in the window, without one; results as text or JSON.
//!
//! Results go to standard output; progress and errors go to standard error. The exit status is 0
//! when the work is done, 1 when it failed, 2 when the input is wrong. An error names the file, the
//! place in it, what was found and what was expected.
//!
//! A subcommand is a file of this folder, a variant of `CliCommand` and a line in its `run`. The
//! folder `help/` has the texts that `--help` adds to its options, and the topics of
//! `aplanat help`.

mod analyze;
mod calc;
mod convert;
mod design;
mod drawing;
mod effects;
mod error;
mod experiment;
mod failures;
mod glass;
mod glass_exchange;
mod gradient;
mod grin;
mod heap;
mod help;
mod info;
mod input;
mod library;
mod limit_prices;
mod measure;
mod names;
mod optimize;
mod output;
mod output_paths;
mod overdue;
mod pareto;
mod picture;
mod progress;
mod report;
mod search;
mod terms;
#[cfg(test)]
mod tests;
mod tolerance;
mod trace;
mod window;

use crate::files;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use error::CliError;
use output::{Output, print_note};
use std::any::TypeId;
use std::error::Error;
use std::num::{IntErrorKind, ParseIntError};
use std::path::PathBuf;
use std::process::ExitCode;

/// Designs lenses by computation. Without arguments, or with a lens alone, it opens the studio; a
/// subcommand needs neither window nor display.
#[derive(Debug, Parser)]
#[command(version, after_help = AFTER_HELP, disable_help_subcommand = true)]
struct CliArgs {
    /// The lens that the studio opens: .json, .zmx, .zar, .seq, .len or .roa
    lens: Option<PathBuf>,

    /// Prints the result as JSON
    #[arg(long, global = true)]
    json: bool,

    #[command(subcommand)]
    command: Option<CliCommand>,
}

const AFTER_HELP: &str = "Exit status: 0 done, 1 the work failed, 2 the input is wrong, also where a \
    lens lets no light\nthrough. Ctrl-C, SIGTERM and SIGHUP end a long command, which saves what it \
    found.\n\
    Lengths in mm, angles in degrees, wavelengths in um. Texts count surfaces as the \
    window does: 0 is\nthe object, 1 the first surface; JSON counts from 0. See `aplanat help \
    conventions` and `aplanat help\nlens-file`.";

/// Every subcommand.
#[derive(Debug, Subcommand)]
enum CliCommand {
    Info(info::InfoArgs),
    Trace(trace::TraceArgs),
    Analyze(analyze::AnalyzeArgs),
    Picture(picture::PictureArgs),
    Calc(calc::CalcArgs),
    Gradient(gradient::GradientArgs),
    Optimize(optimize::OptimizeArgs),
    Pareto(pareto::ParetoArgs),
    Tolerance(tolerance::ToleranceArgs),
    Search(Box<search::SearchArgs>),
    Design(design::DesignArgs),
    Grin(grin::GrinArgs),
    Convert(convert::ConvertArgs),
    Report(report::ReportArgs),
    Drawing(drawing::DrawingArgs),
    Library(library::LibraryArgs),
    Glass(glass::GlassArgs),
    Experiment(experiment::ExperimentArgs),
    Measure(measure::MeasureArgs),
    Help(help::HelpArgs),
}

impl CliCommand {
    fn run(&self, output: &Output) -> Result<(), CliError> {
        match self {
            Self::Info(info) => info.run(output),
            Self::Trace(trace) => trace.run(output),
            Self::Analyze(analyze) => analyze.run(output),
            Self::Picture(picture) => picture.run(output),
            Self::Calc(calc) => calc.run(output),
            Self::Gradient(gradient) => gradient.run(output),
            Self::Optimize(optimize) => optimize.run(output),
            Self::Pareto(pareto) => pareto.run(output),
            Self::Tolerance(tolerance) => tolerance.run(output),
            Self::Search(search) => search.run(output),
            Self::Design(design) => design.run(output),
            Self::Grin(grin) => grin.run(output),
            Self::Convert(convert) => convert.run(output),
            Self::Report(report) => report.run(output),
            Self::Drawing(drawing) => drawing.run(output),
            Self::Library(library) => library.run(output),
            Self::Glass(glass) => glass.run(output),
            Self::Experiment(experiment) => experiment.run(output),
            Self::Measure(measure) => measure.run(output),
            Self::Help(help) => help.run(output),
        }
    }
}

/// Runs the command that the arguments of the process name, or opens the studio.
pub fn run() -> ExitCode {
    heap::keep_free_memory();
    env_logger::init();
    // A catalogue that cannot be read is said, and is no reason to end.
    files::load_own_glasses().iter().for_each(|error| print_note(format!("note: {error}")));
    match CliArgs::read() {
        Ok(arguments) => ExitCode::from(exit_status(arguments.run())),
        Err(usage) => {
            // A reader of the help that closes the pipe early is no failure.
            drop(usage.print());
            ExitCode::from(u8::try_from(usage.exit_code()).unwrap_or(2))
        }
    }
}

/// The outcome of a subcommand that a program has run.
#[derive(Debug)]
pub struct CommandOutcome {
    /// The result as JSON; empty if there is none. A command that fails late has one all the same.
    pub json: String,
    /// The error, as the command line prints it.
    pub error: Option<String>,
    /// The exit status of the command line.
    pub status: u8,
}

/// Runs a subcommand with its arguments, as in `["analyze", "lens.json", "spot"]`, and returns its
/// result instead of printing it. Signals are left to the caller, and so are the glasses that a person
/// has added: see [`files::load_own_glasses`].
pub fn run_collecting(arguments: &[String]) -> CommandOutcome {
    progress::leave_signals_to_host();
    let words = std::iter::once("aplanat").chain(arguments.iter().map(String::as_str));
    let matches = with_numbers(CliArgs::command()).try_get_matches_from(words);
    let parsed =
        matches.map_err(in_plain_words).and_then(|matches| CliArgs::from_arg_matches(&matches));
    let output = Output::collecting();
    let (error, status) = match parsed.map(|arguments| arguments.run_with(&output)) {
        Ok(Ok(())) => (None, 0),
        Ok(Err(failure)) => (Some(failure.to_string()), failure.exit_status()),
        Err(usage) => (Some(usage.to_string()), 2),
    };
    CommandOutcome { json: output.into_collected(), error, status }
}

/// Ends the long commands of [`run_collecting`] that other threads run, as Ctrl-C ends those of the command
/// line: with what they have.
pub fn stop_collecting() {
    progress::stop_of_host();
}

impl CliArgs {
    /// The arguments of the process.
    fn read() -> Result<Self, clap::Error> {
        let matches = with_numbers(Self::command()).try_get_matches();
        Self::from_arg_matches(&matches.map_err(in_plain_words)?)
    }

    fn run(&self) -> Result<(), CliError> {
        self.run_with(&Output::new(self.json))
    }

    fn run_with(&self, output: &Output) -> Result<(), CliError> {
        match &self.command {
            Some(_) if self.lens.is_some() => Err(CliError::Input(
                "a lens in front of a subcommand; expected it behind: `aplanat info LENS`".into(),
            )),
            Some(command) => command.run(output),
            None => window::open(self.lens.as_deref()),
        }
    }
}

/// A command whose options, and those of its subcommands, take negative numbers as values, so that a
/// wrong number is refused by the range that it violates, and refuse other texts in plain words.
fn with_numbers(command: Command) -> Command {
    command.mut_args(with_number).mut_subcommands(with_numbers)
}

fn with_number(option: Arg) -> Arg {
    if option.get_long().is_none() || !option.get_action().takes_values() {
        return option;
    }
    let is_length = option.get_value_parser().type_id() == TypeId::of::<f64>();
    let option = option.allow_negative_numbers(true);
    if is_length { option.value_parser(parse_number) } else { option }
}

/// A wrong whole number with what was expected in place of it; any other error as it is.
fn in_plain_words(usage: clap::Error) -> clap::Error {
    let wrong = usage.source().and_then(|source| source.downcast_ref::<ParseIntError>());
    let Some(kind) = wrong.map(ParseIntError::kind) else { return usage };
    let expected = match kind {
        IntErrorKind::PosOverflow => "expected a smaller whole number",
        _ => "expected a whole number, 0 or more",
    };
    let word = |kind| match usage.get(kind) {
        Some(ContextValue::String(word)) => word.clone(),
        _ => String::new(),
    };
    let (option, found) = (word(ContextKind::InvalidArg), word(ContextKind::InvalidValue));
    let text = format!("invalid value '{found}' for '{option}': {expected}\n");
    clap::Error::raw(ErrorKind::ValueValidation, text)
}

fn parse_number(text: &str) -> Result<f64, &'static str> {
    text.parse().map_err(|_not_a_number| "expected a number")
}

/// Prints the error of a command, if it has one, and returns its exit status.
fn exit_status(result: Result<(), CliError>) -> u8 {
    let Err(failure) = result else { return 0 };
    if !failure.is_closed_pipe() {
        print_note(format!("error: {failure}"));
    }
    failure.exit_status()
}
