//! The exchange of glasses after local optimization: `optimize --glasses`.

use super::error::CliError;
use super::input::LoadedLens;
use super::output::{ShortNumber, TextTable, or_dash};
use super::progress::progress_bar;
use crate::files::GlassQuery;
use crate::lens::Lens;
use crate::lens::glass::{self, Glass};
use crate::merit::Goal;
use crate::optimize::{GlassExchange, GlassRound, GlassSearch, GlassSearchError, Optimizer};
use serde::Serialize;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

/// The choice of the glasses that others are exchanged for.
#[derive(Debug, clap::Args)]
pub(super) struct GlassExchangeArgs {
    /// Then exchanges glasses for others that match these words and ranges, as of `aplanat glass`
    /// ("schott nd=1.5..1.8"; without any: every glass), and replaces model glasses
    #[arg(long, value_name = "WORDS", num_args = 0..=1, default_missing_value = "")]
    glasses: Option<String>,

    /// The seed of the order in which --glasses tries them
    #[arg(long, default_value_t = 0, value_name = "N", requires = "glasses")]
    glass_seed: u64,
}

/// The exchanges of a run.
#[derive(Debug, Serialize)]
pub(super) struct GlassExchangeReport {
    /// The glasses that were taken, in their order.
    accepted: Vec<GlassExchange>,
    /// The number of exchanges that were optimized.
    tried: usize,
    /// The evaluations of the merit for all of that.
    evaluations: usize,
    merit_before: f64,
    merit_after: f64,
    /// True if no further exchange is expected to gain.
    finished: bool,
}

impl GlassExchangeArgs {
    /// A search from a lens among the glasses that are asked for; `None` if none is to be exchanged.
    ///
    /// # Errors
    /// Words that no glass has, a range that is none, or a lens without a glass to exchange.
    pub(super) fn search(
        &self,
        opened: &LoadedLens,
        lens: &Lens,
        goal: &Goal,
        tolerance: f64,
    ) -> Result<Option<GlassSearch>, CliError> {
        let Some(words) = &self.glasses else { return Ok(None) };
        let search = GlassSearch::new(lens, goal, tolerance, permitted(words)?, self.glass_seed);
        search.map(Some).map_err(|why| failure(&opened.file, why))
    }
}

/// The glasses that match some words.
fn permitted(words: &str) -> Result<Vec<&'static Glass>, CliError> {
    let query = GlassQuery::new(words.split_whitespace())
        .map_err(|why| CliError::Input(format!("--glasses: {why}")))?;
    let found: Vec<_> = glass::known().filter(|glass| query.is_met_by(glass)).collect();
    if found.is_empty() {
        let text = format!("--glasses: found no glass for `{words}`; `aplanat glass` lists all");
        return Err(CliError::Input(text));
    }
    Ok(found)
}

/// The failure of a search among the glasses of a lens.
pub(super) fn failure(file: &str, why: GlassSearchError) -> CliError {
    match why {
        GlassSearchError::Merit(source) => CliError::Merit { file: file.to_owned(), source },
        why => CliError::Input(format!("{file}: {why}")),
    }
}

/// Rounds of a search until it has ended or is stopped; the optimizer becomes that of its best lens.
pub(super) fn exchange(
    mut search: GlassSearch,
    optimizer: &mut Box<dyn Optimizer>,
    stop: &AtomicBool,
) -> Result<GlassExchangeReport, GlassSearchError> {
    search.restart(optimizer.best())?;
    let merit_before = search.merit();
    let bar = progress_bar(usize::MAX);
    let mut rounds: Vec<GlassRound> = Vec::new();
    while !stop.load(Ordering::Relaxed) && !rounds.last().is_some_and(|round| round.finished) {
        rounds.push(search.round()?);
        bar.set_message(format!("glasses, merit {}", ShortNumber(search.merit())));
    }
    bar.finish_and_clear();
    *optimizer = search.resume()?;
    Ok(GlassExchangeReport {
        tried: rounds.iter().map(|round| round.tried.len()).sum(),
        evaluations: rounds.last().map_or(0, |round| round.evaluations),
        finished: rounds.last().is_some_and(|round| round.finished),
        accepted: rounds.into_iter().filter_map(|round| round.accepted).collect(),
        merit_before,
        merit_after: search.merit(),
    })
}

impl fmt::Display for GlassExchangeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = [self.merit_before, self.merit_after].map(ShortNumber);
        let end = if self.finished { "none left that gains" } else { "stopped" };
        writeln!(
            f,
            "glasses: merit {before} -> {after}, {} exchanges optimized in {} evaluations; {end}",
            self.tried, self.evaluations
        )?;
        if self.accepted.is_empty() {
            return writeln!(f, "no glass was exchanged\n");
        }
        let mut table = TextTable::new(&["surface", "from", "to", "merit"]);
        for row in &self.accepted {
            let merit = or_dash(row.merit);
            table.row([row.surface.to_string(), row.from.clone(), row.to.clone(), merit]);
        }
        writeln!(f, "{table}")
    }
}
