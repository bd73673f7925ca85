//! `measure search`: the samplers compared after the same time or the same number of gradients.

use crate::cli::error::CliError;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::cli::search::SearchPlanArgs;
use crate::measure::{
    Machine, SearchBenchmark, SearchBudget, SearchContender, SearchLength, SearchRow, SignTest,
    compare_searches,
};
use crate::search::SearchMethod;
use serde::Serialize;
use std::fmt::{self, Display};

/// Best merit after equal times or equal numbers of gradients: iterated local search, a descent alone,
/// basin hopping, brute force, Metropolis-Hastings and RESTORE with several seeds; over equal times also
/// the effect of the tolerance of the spots
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_search.txt"))]
pub(super) struct MeasureSearchArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The searches that are compared; the first one is compared with each of the others
    #[arg(long, value_enum, value_name = "METHODS", value_delimiter = ',',
        default_values_t = SearchContender::ALL)]
    methods: Vec<SearchContender>,

    /// The seconds of each search
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    seconds: f64,

    /// The gradients of each search, in place of the seconds
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    iterations: Option<u64>,

    /// The number of seeds
    #[arg(long, value_name = "N", default_value_t = 3)]
    seeds: u64,

    /// The first seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,

    #[command(flatten)]
    plan_args: SearchPlanArgs,
}

impl MeasureSearchArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Self { seconds, iterations, seeds, first_seed, .. } = *self;
        if !(seconds > 0.0 && seconds.is_finite()) {
            let text = format!("--seconds: found {seconds}; expected more than 0");
            return Err(CliError::Input(text));
        }
        for (name, count) in [("--seeds", Some(seeds)), ("--iterations", iterations)] {
            if count == Some(0) {
                return Err(CliError::Input(format!("{name}: found 0; expected 1 or more")));
            }
        }
        let length = iterations.map_or(SearchLength::Seconds(seconds), SearchLength::Gradients);
        let opened = self.lens.open()?;
        let mut plan = self.plan_args.plan(&opened.lens)?;
        let lens = self.plan_args.start_lens(&opened.lens)?;
        self.plan_args
            .give_goal(&mut plan, &lens)
            .map_err(|cause| CliError::Input(format!("{}: {cause}", opened.file)))?;
        let stop = stop_flag();
        let budget = SearchBudget { length, seeds, first_seed };
        let found = compare_searches(&lens, &plan, &self.methods, budget, &stop)
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

fn name(contender: SearchContender) -> &'static str {
    match contender {
        SearchContender::Sampler(SearchMethod::IteratedLocalSearch) => "iterated local search",
        SearchContender::Sampler(SearchMethod::Restore) => "RESTORE",
        SearchContender::Sampler(SearchMethod::Metropolis) => "Metropolis-Hastings",
        SearchContender::Sampler(SearchMethod::BruteForce) => "brute force",
        SearchContender::BasinHopping => "basin hopping",
        SearchContender::SingleTrial => "one mutant at a time",
        SearchContender::Descent => "descent alone",
    }
}

fn unit(length: SearchLength) -> &'static str {
    match length {
        SearchLength::Seconds(_) => "s",
        SearchLength::Gradients(_) => "gradients",
    }
}

impl Display for MeasureSearchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SearchBenchmark { race, start, methods, tolerances } = &self.found;
        writeln!(f, "{}", self.machine)?;
        let SearchBudget { length, seeds, first_seed } = race;
        writeln!(
            f,
            "{seeds} seeds from {first_seed} on, {} {} each; merit of the start {}",
            length.value(),
            unit(*length),
            ShortNumber(*start)
        )?;
        writeln!(f, "merit of the best lens: median of the seeds, best to worst\n")?;
        write_rows(f, "sampler", methods, *length)?;
        if !tolerances.is_empty() {
            write_rows(f, "RESTORE", tolerances, *length)?;
        }
        write_ends(f, methods, *first_seed)
    }
}

fn write_rows(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    rows: &[SearchRow],
    length: SearchLength,
) -> fmt::Result {
    let marks = rows.first().map_or(&[][..], |row| &row.marks);
    let after = marks.iter().map(|mark| format!("after {} {}", mark.after, unit(length)));
    let head: Vec<String> =
        [title, "tolerance", "gradients"].map(str::to_owned).into_iter().chain(after).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = TextTable::new(&head);
    for SearchRow { method, tolerance, gradients, marks, .. } in rows {
        let start = [name(*method).to_owned(), tolerance.to_string(), gradients.to_string()];
        let cells = marks.iter().map(|mark| {
            let [median, best, worst] = [mark.median, mark.best, mark.worst];
            format!("{median:.2e} ({best:.1e}..{worst:.1e})")
        });
        table.row(start.into_iter().chain(cells));
    }
    writeln!(f, "{table}")
}

/// Writes the merit at the end for each seed, and how often the first sampler is better.
fn write_ends(f: &mut fmt::Formatter<'_>, rows: &[SearchRow], first_seed: u64) -> fmt::Result {
    let count = rows.iter().map(|row| row.ends.len()).max().unwrap_or(0);
    let seeds = (0..count as u64).map(|i| format!("seed {}", first_seed + i));
    let head: Vec<String> = std::iter::once("end".to_owned())
        .chain(seeds)
        .chain(["first is better".to_owned(), "probability".to_owned()])
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = TextTable::new(&head);
    for SearchRow { method, ends, against, .. } in rows {
        let merits = (0..count).map(|i| ends.get(i).map_or("-".to_owned(), |m| format!("{m:.3e}")));
        let test = against.map_or(["-".to_owned(), "-".to_owned()], |test| {
            let SignTest { below, seeds, probability } = test;
            [format!("{below} of {seeds}"), format!("{probability:.3}")]
        });
        table.row(std::iter::once(name(*method).to_owned()).chain(merits).chain(test));
    }
    write!(f, "{table}")
}
