//! What the window costs.

use crate::cli::failure::Failure;
use crate::cli::output::Output;

/// First frame, edits, repainting and idling of the studio; it opens a window for ten seconds
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_window.txt"))]
pub(super) struct Window {}

impl Window {
    #[cfg(feature = "studio")]
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let Self {} = self;
        let figures = crate::studio::measure().map_err(|why| Failure::Failed(why.to_string()))?;
        output.print(&shown::Report { machine: crate::measure::Machine::here(), figures })
    }

    #[cfg(not(feature = "studio"))]
    pub(super) fn run(&self, _output: &Output) -> Result<(), Failure> {
        let Self {} = self;
        let text = "this program was built without its window (cargo feature `studio`)";
        Err(Failure::Failed(text.to_owned()))
    }
}

#[cfg(feature = "studio")]
mod shown {
    use crate::measure::Machine;
    use crate::studio::Figures;
    use serde::Serialize;
    use std::fmt::{self, Display};

    #[derive(Serialize)]
    pub(super) struct Report {
        pub(super) machine: Machine,
        #[serde(flatten)]
        pub(super) figures: Figures,
    }

    impl Display for Report {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            let Self { machine, figures } = self;
            let ms = |value: Option<f64>| {
                value.map_or_else(|| "unknown".to_owned(), |ms| format!("{ms:.1} ms"))
            };
            let [width, height] = figures.size;
            writeln!(f, "{machine}")?;
            writeln!(f, "{width} x {height} pixels, drawn by {}\n", figures.renderer)?;
            writeln!(f, "start of the process to a full frame   {}", ms(figures.first_frame_ms))?;
            writeln!(f, "an edit to the numbers of all panels   {:.1} ms", figures.edit_ms)?;
            writeln!(
                f,
                "  the slowest of 21 edits              {:.1} ms",
                figures.slowest_edit_ms
            )?;
            writeln!(
                f,
                "a frame without new drawings           {} of processor time",
                ms(figures.frame_processor_ms)
            )?;
            writeln!(
                f,
                "idle for {} s, cursor in a text field   {} of processor time",
                figures.idle_seconds,
                ms(figures.idle_processor_ms)
            )
        }
    }
}
