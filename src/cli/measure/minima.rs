//! `measure minima`: different minima an hour.

use crate::cli::error::CliError;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::cli::search::SearchPlanArgs;
use crate::measure::{Machine, MinimaCount, count_minima};
use serde::Serialize;
use std::fmt::{self, Display};

/// Different minima an hour by descents from random lenses with the structure of a lens
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_minima.txt"))]
pub(super) struct MeasureMinimaArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The number of random lenses
    #[arg(long, value_name = "N", default_value_t = 500)]
    starts: u64,

    /// The seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    #[command(flatten)]
    plan_args: SearchPlanArgs,
}

impl MeasureMinimaArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if self.starts == 0 {
            return Err(CliError::Input("--starts: found 0; expected 1 or more".to_owned()));
        }
        let opened = self.lens.open()?;
        let refuse = |cause: &dyn Display| CliError::Input(format!("{}: {cause}", opened.file));
        let mut plan = self.plan_args.plan(&opened.lens)?;
        plan.settings.seed = self.seed;
        let lens = self.plan_args.start_lens(&opened.lens)?;
        self.plan_args.give_goal(&mut plan, &lens).map_err(|cause| refuse(&cause))?;
        let stop = stop_flag();
        let found =
            count_minima(&lens, &plan, self.starts, &stop).map_err(|cause| refuse(&cause))?;
        note_if_stopped(&stop);
        let (machine, seed) = (Machine::detect(), self.seed);
        output.print(&MeasureMinimaReport { machine, seed, found })
    }
}

#[derive(Serialize)]
struct MeasureMinimaReport {
    machine: Machine,
    seed: u64,
    #[serde(flatten)]
    found: MinimaCount,
}

impl Display for MeasureMinimaReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MinimaCount { starts, lost, unfinished, stuck, ended, .. } = &self.found;
        let MinimaCount {
            distinct, families, found_once, found_twice, evaluations, seconds, ..
        } = &self.found;
        writeln!(f, "{}", self.machine)?;
        writeln!(
            f,
            "{starts} random lenses, seed {}, {seconds:.1} s, {evaluations} evaluations",
            self.seed
        )?;
        writeln!(f, "  {ended} descents ended at a minimum, {stuck} elsewhere")?;
        writeln!(f, "  {unfinished} were given up, {lost} were lost")?;
        writeln!(f, "  {distinct} different minima with {families} patterns of signs")?;
        writeln!(f, "  {found_once} were found once, {found_twice} twice")?;
        if let Some(unseen) = self.found.unseen {
            writeln!(f, "  about {unseen:.0} more were not found")?;
        }
        writeln!(f, "  {:.0} different minima an hour", self.found.distinct_an_hour)?;
        let best: Vec<String> =
            self.found.best.iter().map(|merit| ShortNumber(*merit).to_string()).collect();
        writeln!(f, "best merits: {} mm^2", best.join(", "))
    }
}
