//! `measure glasses`: what the exchange of glasses gains.

use crate::cli::error::CliError;
use crate::cli::input::{LensFiles, Tolerance};
use crate::cli::output::{Output, ShortNumber, TextTable, counted};
use crate::cli::progress::ProgressNotes;
use crate::measure::{GlassGain, GlassPhase, GlassProgress, Machine, measure_glass_gain};
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// The merit of optimized lenses before and after an exchange of their glasses
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_glasses.txt"))]
pub(super) struct MeasureGlassesArgs {
    #[command(flatten)]
    lenses: LensFiles,

    /// The seed of the order of exchanges
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-3", value_name = "TOLERANCE")]
    error: Tolerance,

    /// The evaluations of the merit after which an exchange ends; without it, when nothing gains any more
    #[arg(long, value_name = "N")]
    evaluations: Option<usize>,
}

impl MeasureGlassesArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if self.evaluations == Some(0) {
            return Err(CliError::Input("--evaluations: found 0; expected 1 or more".to_owned()));
        }
        let is_single = self.lenses.count() == 1;
        let compare = |lens: &_, name: &str, stop: &AtomicBool| {
            // A bar counts lenses where there are several.
            let mut notes = if is_single {
                Some(ProgressNotes::new())
            } else {
                ProgressNotes::in_place_of_bar()
            };
            let mut watch = |progress: GlassProgress| {
                if let Some(notes) = &mut notes {
                    notes.tell(|| format!("{name}: {}", progress_text(progress)));
                }
                if stop.load(Ordering::Relaxed) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            let way = (self.seed, self.error.0);
            measure_glass_gain(lens, way, self.evaluations, &mut watch).transpose()
        };
        let rows = self.lenses.map(compare, |file, found| match found {
            Ok(found) => GlassRow { file, found: Some(found), refused: None },
            Err(cause) => GlassRow { file, found: None, refused: Some(cause.to_string()) },
        })?;
        output.print(&MeasureGlassesReport { machine: Machine::detect(), seed: self.seed, rows })
    }
}

/// The state of a measurement that goes on, in a line.
fn progress_text(GlassProgress { phase, evaluations, merit, exchanges }: GlassProgress) -> String {
    let doing = match phase {
        GlassPhase::Descent => "descent with its own glasses".to_owned(),
        GlassPhase::Guided => format!("{}, guided", counted(exchanges, "exchange")),
        GlassPhase::Random => format!("{}, at random", counted(exchanges, "exchange")),
    };
    format!("{doing}, {evaluations} evaluations, merit {}", ShortNumber(merit))
}

#[derive(Serialize)]
struct MeasureGlassesReport {
    machine: Machine,
    seed: u64,
    rows: Vec<GlassRow>,
}

#[derive(Serialize)]
struct GlassRow {
    file: String,
    #[serde(flatten)]
    found: Option<GlassGain>,
    /// The reason for which no glass is exchanged.
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

impl Display for MeasureGlassesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}\nmerit as it is, optimized, and with other glasses; at random with as many evaluations\n",
            self.machine
        )?;
        let columns = [
            "lens",
            "merit",
            "optimized",
            "other glasses",
            "exchanges",
            "evaluations",
            "s",
            "random",
        ];
        let mut table = TextTable::new(&columns);
        for GlassRow { file, found, .. } in &self.rows {
            let Some(found) = found else { continue };
            let merits = [found.merit_before, found.merit_optimized, found.merit];
            let merits = merits.map(|merit| ShortNumber(merit).to_string());
            let counts = [found.exchanges, found.evaluations].map(|count| count.to_string());
            let seconds = format!("{:.1}", found.seconds);
            let cells = std::iter::once(file.clone()).chain(merits).chain(counts);
            let random = found.merit_random.map_or("-".to_owned(), |m| ShortNumber(m).to_string());
            table.row(cells.chain([seconds, random]));
        }
        write!(f, "{table}")?;
        for row in &self.rows {
            if let Some(why) = &row.refused {
                writeln!(f, "{}: {why}", row.file)?;
            }
            if row.found.as_ref().is_some_and(|found| !found.finished) {
                writeln!(f, "{}: ended before exchanges stopped gaining", row.file)?;
            }
        }
        Ok(())
    }
}
