//! `design`: a lens from a specification, or the judgement of a lens against one.

mod checkpoint;
mod report;

use super::error::CliError;
use super::failures::Failures;
use super::input::{display_name, read_json};
use super::output::{Output, ShortNumber, print_note};
use super::output_paths::OutputPaths;
use super::progress::{stop_flag, styled_bar};
use crate::files::{self, FileError, FileLock};
use crate::measure::Stopwatch;
use crate::search::design::{
    DesignMerit, DesignRun, DesignSettings, DesignedLens, JUDGEMENT_TOLERANCE, LensJudgement,
    LensRequirements, LensSpecification, judge_lens,
};
use indicatif::ProgressBar;
use report::{DesignReport, JudgementReport};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Designs a lens from a specification, or judges a lens against one; Ctrl-C ends the design and
/// saves the best lens so far
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/design.txt"))]
pub(super) struct DesignArgs {
    /// The specification, as JSON; `-` reads it from standard input
    spec: PathBuf,

    /// The file for the best lens: .json or .zmx; absent: nothing is designed
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Judges this lens: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(long, value_name = "LENS", conflicts_with = "out")]
    judge: Option<PathBuf>,

    /// Maximum duration in minutes
    #[arg(long, value_name = "MINUTES")]
    minutes: Option<f64>,

    /// Maximum number of gradients, after which the round is ended; 200000 if --minutes is absent too
    #[arg(long, value_name = "N")]
    gradients: Option<u64>,

    /// The seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Lenses of the library that are no starts, and neither are their copies
    #[arg(long, value_name = "NAME")]
    without: Vec<String>,

    /// The class of care in making for which the lenses are refined at the end, in place of the
    /// specification's: none, commercial, precision, `shop_limit` or `moulded_plastic`
    #[arg(long, value_name = "GRADE")]
    as_built: Option<String>,

    /// A file in which the run is saved after every round; resumes the run if it exists
    #[arg(long, value_name = "FILE", requires = "out")]
    checkpoint: Option<PathBuf>,
}

/// Maximum number of gradients if neither it nor a duration is given.
const DEFAULT_GRADIENTS: u64 = 200_000;

impl DesignArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check()?;
        let mut spec: LensSpecification = read_json(&self.spec)?;
        spec.as_built = self.as_built.clone().or(spec.as_built);
        let file = display_name(&self.spec);
        let refuse = |error| CliError::Input(format!("{file}: {error}"));
        let (requirements, filled) = LensRequirements::complete(&spec).map_err(refuse)?;
        let Some(out) = &self.out else {
            let judged = self.judge.as_ref().map(|path| judge(path, &requirements));
            let judgement = judged.transpose()?;
            let broken = judgement.as_ref().map_or(0, |found| found.failures().len());
            output.print(&JudgementReport { requirements, filled, judgement })?;
            return check_judgement(broken);
        };
        let stop = stop_flag();
        let _lock = self.checkpoint.as_deref().map(FileLock::acquire).transpose()?;
        let without = self.without.clone();
        let settings = DesignSettings { without, ..DesignSettings::with_seed(self.seed) };
        let mut run = self.start_or_resume(&requirements, &settings)?;
        let mut failures = Failures::default();
        self.run_rounds(&mut run, &stop, &mut failures);
        let stopped = stop.load(Ordering::Relaxed);
        let lenses = if stopped { run.finish_best() } else { run.finish(&stop) };
        if !stopped && stop.load(Ordering::Relaxed) {
            print_note("note: stopped; the lenses are as they were before their last improvements");
        }
        if lenses.is_empty() {
            let why = if stopped { "stopped: " } else { "" };
            return Err(CliError::Failed(format!("{why}no start led to a lens")));
        }
        let saved = save_lenses(&lenses, out, &mut failures);
        let gradients = run.gradients();
        let report = DesignReport { requirements, filled, gradients, lenses, out: saved };
        failures.note(output.print(&report));
        failures.into_result()
    }

    fn check(&self) -> Result<(), CliError> {
        if let Some(minutes) = self.minutes.filter(|m| !(*m >= 0.0 && m.is_finite())) {
            let text = format!("--minutes: found {minutes}; expected 0 or more");
            return Err(CliError::Input(text));
        }
        let known = |name: &&String| files::library_lenses().iter().all(|lens| lens.name != **name);
        if let Some(name) = self.without.iter().find(known) {
            let text = format!(
                "--without: found `{name}`; expected a lens of the library, as `aplanat library` \
                 lists them"
            );
            return Err(CliError::Input(text));
        }
        let read = [("the specification", self.spec.as_path())];
        let judged = self.judge.as_deref().map(|path| ("--judge", path));
        let mut paths = OutputPaths::reading(read.into_iter().chain(judged));
        paths.file("--out", self.out.as_deref(), &["json", "zmx"])?;
        let others =
            self.out.iter().flat_map(|out| DesignMerit::ALL.map(|merit| beside(out, merit.name())));
        others.into_iter().try_for_each(|other| paths.take("--out", &other))?;
        paths.file("--checkpoint", self.checkpoint.as_deref(), &["json"])
    }

    fn start_or_resume(
        &self,
        asked: &LensRequirements,
        settings: &DesignSettings,
    ) -> Result<DesignRun, CliError> {
        match self.checkpoint.as_deref().filter(|path| path.exists()) {
            Some(path) => checkpoint::resume(path, asked, settings),
            None => Ok(DesignRun::new(asked, settings)),
        }
    }

    /// Rounds until the budget is used, or until Ctrl-C. A checkpoint that cannot be saved is said
    /// once and tried again; the failure of the last one is noted.
    fn run_rounds(&self, run: &mut DesignRun, stop: &AtomicBool, failures: &mut Failures) {
        let watch = Stopwatch::start();
        let bar = styled_bar(100, "{wide_bar} {pos} % {msg}");
        let mut failed = None;
        while !stop.load(Ordering::Relaxed) {
            let used = self.share_used(run, watch);
            bar.set_position((100.0 * used) as u64);
            let best = ShortNumber(1e3 * run.best());
            bar.set_message(format!("{:?}, {best} um", run.stage()));
            let goes_on = used < 1.0 && run.advance(used, stop);
            // A round that was ended is not saved: it depends on time.
            if !goes_on || stop.load(Ordering::Relaxed) {
                break;
            }
            failed = self.save(run, &bar, failed.is_some());
        }
        bar.finish_and_clear();
        failures.note(failed.map_or(Ok(()), Err));
    }

    /// Saves the checkpoint, if there is a file for it; its failure, said if it is the first one.
    fn save(&self, run: &DesignRun, bar: &ProgressBar, is_failing: bool) -> Option<FileError> {
        let error = checkpoint::save(self.checkpoint.as_deref()?, run).err()?;
        if !is_failing {
            bar.suspend(|| print_note(format!("note: the design goes on: {error}")));
        }
        Some(error)
    }

    /// The share of the budget that is used, at most about 1.
    fn share_used(&self, run: &DesignRun, watch: Stopwatch) -> f64 {
        let by_time = self.minutes.map(|minutes| watch.seconds() / (60.0 * minutes));
        let most = match (self.gradients, self.minutes) {
            (None, Some(_)) => None,
            (most, _) => Some(most.unwrap_or(DEFAULT_GRADIENTS)),
        };
        let by_gradients = most.map(|most| run.gradients() as f64 / most.max(1) as f64);
        [by_time, by_gradients].into_iter().flatten().fold(0.0, f64::max)
    }
}

/// Saves the lenses: the best one under its name, the others beside it. Returns their files, `None`
/// for one that could not be saved.
fn save_lenses(
    lenses: &[DesignedLens],
    out: &Path,
    failures: &mut Failures,
) -> Vec<Option<String>> {
    let mut save = |(i, lens): (usize, &DesignedLens)| {
        let path = if i == 0 { out.into() } else { beside(out, lens.merit.name()) };
        failures.note(files::save(&lens.lens, &path)).map(|_| path.display().to_string())
    };
    let saved = lenses.iter().enumerate().map(&mut save).collect();
    if lenses.first().is_some_and(|best| !best.judgement.is_valid()) {
        print_note("note: the best lens breaks limits");
    }
    saved
}

/// The path of another lens beside that of the best one.
fn beside(out: &Path, name: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let extension = out.extension().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}_{name}.{extension}"))
}

/// Fails if the judged lens breaks limits.
fn check_judgement(broken: usize) -> Result<(), CliError> {
    match broken {
        0 => Ok(()),
        1 => Err(CliError::Failed("the lens breaks 1 limit".to_owned())),
        _ => Err(CliError::Failed(format!("the lens breaks {broken} limits"))),
    }
}

fn judge(path: &Path, asked: &LensRequirements) -> Result<LensJudgement, CliError> {
    let opened = files::open(path)?;
    let refuse = |error| CliError::Input(format!("{}: {error}", path.display()));
    judge_lens(&opened.lens, asked, JUDGEMENT_TOLERANCE).map_err(refuse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Lens, blank};

    #[test]
    fn the_best_lens_has_the_name_that_is_asked_for_and_others_their_merit() {
        let spec = r#"{"focal_length_mm": 100, "f_number": 10, "half_field_deg": 1}"#;
        let spec: LensSpecification = serde_json::from_str(spec).unwrap();
        let (asked, _) = LensRequirements::complete(&spec).unwrap();
        let mut lens = blank();
        (lens.surfaces[0].curvature, lens.surfaces[1].thickness) = (0.02, 95.0);
        let judgement = judge_lens(&lens, &asked, JUDGEMENT_TOLERANCE).unwrap();
        let designed = |merit: DesignMerit| DesignedLens {
            merit,
            origin: String::new(),
            judgement: judgement.clone(),
            as_built: None,
            costs: Vec::new(),
            lens: Lens { name: merit.name().to_owned(), ..lens.clone() },
        };
        let folder = std::env::temp_dir().join(format!("aplanat-designed-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let lenses = [DesignMerit::Best, DesignMerit::Simplest].map(designed);
        let mut failures = Failures::default();
        let saved = save_lenses(&lenses, &folder.join("a.json"), &mut failures);
        failures.into_result().unwrap();
        for (saved, name) in saved.iter().zip(["a.json", "a_simplest.json"]) {
            assert_eq!(saved.as_deref(), Some(folder.join(name).to_str().unwrap()));
        }
        let name = |file: &str| files::open(folder.join(file)).unwrap().lens.name;
        assert_eq!([name("a.json"), name("a_simplest.json")], ["best", "simplest"]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
