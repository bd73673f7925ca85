//! From one file format to another, with all that was lost on the way.

use super::failure::Failure;
use super::input::check_target;
use super::output::Output;
use crate::files::{self, Format, Proof, Report as Changes, SelfCheck};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Converts a lens between formats; reports what was used, approximated, preserved and dropped
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/convert.txt"))]
pub(super) struct Convert {
    /// The lens that is read: .json or .zmx
    #[arg(value_name = "IN")]
    from: PathBuf,

    /// The file that is written, in the format of its extension: .json or .zmx
    #[arg(value_name = "OUT")]
    to: PathBuf,
}

impl Convert {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let opened = files::open(&self.from)?;
        check_target(&self.to, &["json", "zmx"])?;
        let saved = files::save(&opened.lens, &self.to)?;
        output.print(&Converted {
            from: Side {
                file: self.from.display().to_string(),
                format: opened.format,
                report: opened.report,
                proof: None,
            },
            to: Side {
                file: self.to.display().to_string(),
                format: saved.format,
                report: saved.report,
                proof: saved.proof,
            },
            checks: opened.checks,
        })
    }
}

/// What is printed.
#[derive(Serialize)]
struct Converted {
    from: Side,
    to: Side,
    checks: Vec<SelfCheck>,
}

/// One of the two files.
#[derive(Serialize)]
struct Side {
    file: String,
    format: Format,
    report: Option<Changes>,
    #[serde(skip_serializing_if = "Option::is_none")]
    proof: Option<Proof>,
}

impl Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(report) = &self.report {
            write!(f, "  {}", report.to_string().replace('\n', "\n  ").trim_end_matches("  "))?;
        }
        self.proof.iter().try_for_each(|proof| writeln!(f, "  {proof}"))
    }
}

impl Display for Converted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "read {}\n{}", self.from.file, self.from)?;
        for check in &self.checks {
            writeln!(f, "  {check}")?;
        }
        write!(f, "wrote {}\n{}", self.to.file, self.to)
    }
}
