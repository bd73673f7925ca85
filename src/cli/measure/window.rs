//! `measure window`: the times of the studio.

use crate::cli::error::CliError;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::cli::window;
use crate::measure::Machine;
use serde::Serialize;
use serde_json::Value;
use std::fmt::{self, Display};

/// First frame, edits and frames of the studio, measured in a real window, which needs a display
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_window.txt"))]
pub(super) struct MeasureWindowArgs {}

impl MeasureWindowArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Self {} = self;
        let stop = stop_flag();
        let figures = window::benchmark(&stop)?;
        note_if_stopped(&stop);
        output.print(&MeasureWindowReport { machine: Machine::detect(), figures })
    }
}

#[derive(Serialize)]
struct MeasureWindowReport {
    machine: Machine,
    #[serde(flatten)]
    figures: Value,
}

/// The keys of the results, and their descriptions.
const NAMES: [(&str, &str); 16] = [
    ("first_frame_ms", "process start to first frame, ms"),
    ("edit_ms", "an edit to the results of all panels, ms"),
    ("slowest_edit_ms", "the slowest edit, ms"),
    ("drag_ms", "a move of a handle to all numbers and the merit, ms"),
    ("slowest_drag_ms", "the slowest of 200 moves, ms"),
    ("largest_lens", "the largest bundled lens"),
    ("largest_drag_ms", "a move of a handle of it, ms"),
    ("slowest_largest_drag_ms", "the slowest of 200 moves of it, ms"),
    ("unjournaled_edit_ms", "an edit of it on the window's thread without a journal, ms"),
    ("slowest_unjournaled_edit_ms", "the slowest of 200 such edits, ms"),
    ("journaled_edit_ms", "an edit of it on the window's thread with a journal, ms"),
    ("slowest_journaled_edit_ms", "the slowest of 200 such edits, ms"),
    ("frame_processor_ms", "processor time of a frame without changes, ms"),
    ("idle_seconds", "time without input, s"),
    ("idle_processor_ms", "processor time in that time, ms"),
    ("renderer", "drawn by"),
];

impl Display for MeasureWindowReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        let mut table = TextTable::default();
        for (key, name) in NAMES {
            let value = match &self.figures[key] {
                Value::String(text) => text.clone(),
                value => value.as_f64().map_or("-".to_owned(), |v| ShortNumber(v).to_string()),
            };
            table.row([name.to_owned(), value]);
        }
        write!(f, "{table}")
    }
}
