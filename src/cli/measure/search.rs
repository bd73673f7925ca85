//! `measure search`: the samplers compared at the same time.

use crate::cli::error::CliError;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::cli::search::{SearchPlanArgs, give_goal};
use crate::measure::{Machine, SearchBenchmark, SearchBudget, SearchRow, compare_searches};
use crate::search::SearchMethod;
use serde::Serialize;
use std::fmt::{self, Display};

/// Best merit against seconds: RESTORE, Metropolis-Hastings and brute force with several seeds; and the
/// effect of the tolerance of the spots
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_search.txt"))]
pub(super) struct MeasureSearchArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The seconds of each search
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    seconds: f64,

    /// The number of seeds
    #[arg(long, value_name = "N", default_value_t = 3)]
    seeds: u64,

    #[command(flatten)]
    plan_args: SearchPlanArgs,
}

impl MeasureSearchArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Self { seconds, seeds, .. } = *self;
        if !(seconds > 0.0 && seconds.is_finite()) {
            let text = format!("--seconds: found {seconds}; expected more than 0");
            return Err(CliError::Input(text));
        }
        if seeds == 0 {
            return Err(CliError::Input("--seeds: found 0; expected 1 or more".into()));
        }
        let opened = self.lens.open()?;
        let mut plan = self.plan_args.plan(&opened.lens)?;
        let lens = self.plan_args.start_lens(&opened.lens)?;
        give_goal(&mut plan, &lens)
            .map_err(|cause| CliError::Input(format!("{}: {cause}", opened.file)))?;
        let stop = stop_flag();
        let found = compare_searches(&lens, &plan, SearchBudget { seconds, seeds }, &stop)
            .map_err(|cause| CliError::Input(format!("{}: {cause}", opened.file)))?;
        note_if_stopped(&stop);
        output.print(&MeasureSearchReport { machine: Machine::detect(), found })
    }
}

#[derive(Serialize)]
struct MeasureSearchReport {
    machine: Machine,
    #[serde(flatten)]
    found: SearchBenchmark,
}

fn name(method: SearchMethod) -> &'static str {
    match method {
        SearchMethod::Restore => "RESTORE",
        SearchMethod::Metropolis => "Metropolis-Hastings",
        SearchMethod::BruteForce => "brute force",
    }
}

impl Display for MeasureSearchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SearchBenchmark { race, start, methods, tolerances } = &self.found;
        writeln!(f, "{}", self.machine)?;
        let SearchBudget { seconds, seeds } = race;
        writeln!(
            f,
            "{seeds} seeds of {seconds} s each; merit of the start {}",
            ShortNumber(*start)
        )?;
        writeln!(f, "merit of the best lens: median of the seeds, best to worst\n")?;
        for (title, rows) in [("sampler", methods), ("RESTORE", tolerances)] {
            let marks = rows.first().map_or(&[][..], |row| &row.marks);
            let after = marks.iter().map(|mark| format!("after {} s", mark.seconds));
            let head: Vec<String> = [title, "tolerance", "gradients"]
                .map(str::to_owned)
                .into_iter()
                .chain(after)
                .collect();
            let head: Vec<&str> = head.iter().map(String::as_str).collect();
            let mut table = TextTable::new(&head);
            for SearchRow { method, tolerance, gradients, marks } in rows {
                let start =
                    [name(*method).to_owned(), tolerance.to_string(), gradients.to_string()];
                let cells = marks.iter().map(|mark| {
                    let [median, best, worst] = [mark.median, mark.best, mark.worst];
                    format!("{median:.2e} ({best:.1e}..{worst:.1e})")
                });
                table.row(start.into_iter().chain(cells));
            }
            writeln!(f, "{table}")?;
        }
        Ok(())
    }
}
