//! `design`: a lens from a specification, or the judgement of a lens against one.

mod report;

use super::error::CliError;
use super::input::{display_name, read_json};
use super::output::Output;
use crate::files;
use crate::search::design::{
    JUDGEMENT_TOLERANCE, LensJudgement, LensRequirements, LensSpecification, judge_lens,
};
use report::JudgementReport;
use std::path::{Path, PathBuf};

/// Fills a specification of a lens and judges a lens against it
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/design.txt"))]
pub(super) struct DesignArgs {
    /// The specification, as JSON; `-` reads it from standard input
    spec: PathBuf,

    /// Judges this lens: .json or .zmx
    #[arg(long, value_name = "LENS")]
    judge: Option<PathBuf>,
}

impl DesignArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let spec: LensSpecification = read_json(&self.spec)?;
        let file = display_name(&self.spec);
        let refuse = |error| CliError::Input(format!("{file}: {error}"));
        let (requirements, filled) = LensRequirements::complete(&spec).map_err(refuse)?;
        let judgement = self.judge.as_ref().map(|path| judge(path, &requirements)).transpose()?;
        output.print(&JudgementReport { requirements, filled, judgement })
    }
}

fn judge(path: &Path, asked: &LensRequirements) -> Result<LensJudgement, CliError> {
    let opened = files::open(path)?;
    let refuse = |error| CliError::Input(format!("{}: {error}", path.display()));
    judge_lens(&opened.lens, asked, JUDGEMENT_TOLERANCE).map_err(refuse)
}
