//! `optimize`: local optimization, which saves the best lens however it ends.

use super::effects::{DesignEffects, EffectArgs, EffectReport};
use super::error::CliError;
use super::failures::Failures;
use super::glass_exchange::{GlassExchangeArgs, GlassExchangeReport, exchange, failure};
use super::input::{self, LensFile, LoadedLens, Tolerance};
use super::limit_prices;
use super::names::value_name;
use super::output::{Output, ShortNumber, TextTable, or_dash, write_saved};
use super::output_paths::OutputPaths;
use super::progress::{progress_bar, stop_flag};
use super::terms::TermComparison;
use crate::files::{self, FileError, json};
use crate::lens::{Lens, ParameterKind, Quantity, ToleranceGrade, Variable, add_variables};
use crate::measure::time_ms;
use crate::merit::{Goal, Merit, MeritError, Term, TermValue};
use crate::optimize::{
    DescentMethod, LimitPrice, OptimizationEnd, OptimizationProgress, Optimizer, start,
};
use crate::paraxial::{Beam, first_order};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Optimizes the variables of a lens; Ctrl-C ends it and saves the best lens so far
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/optimize.txt"))]
pub(super) struct OptimizeArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The file for the best lens: .json or .zmx
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// The optimization method
    #[arg(long, value_enum, default_value_t = DescentMethod::TrustRegion)]
    method: DescentMethod,

    /// Maximum number of steps; absent: 1000 for trust-region, 100 for dls,
    /// 2000 for adam
    #[arg(long, value_name = "N")]
    steps: Option<usize>,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-6", value_name = "TOLERANCE")]
    error: Tolerance,

    /// Kinds of parameters to vary in addition to the variables of the lens
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KINDS")]
    vary: Vec<ParameterKind>,

    /// The merit function, as JSON, in place of the default one with all its terms, limits of
    /// thicknesses included; absent: that of the lens file, or else sharp spots at the present focal
    /// length within limits
    #[arg(long, value_name = "FILE")]
    goal: Option<PathBuf>,

    /// Optimizes the spots of lenses that are made with the tolerances of this class, in place of the
    /// spots as designed
    #[arg(long, value_enum, value_name = "GRADE")]
    as_built: Option<ToleranceGrade>,

    /// A file for the history of all steps, as JSON
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,

    #[command(flatten)]
    glasses: GlassExchangeArgs,

    #[command(flatten)]
    effects: EffectArgs,
}

/// Steps where --steps is absent.
fn default_steps(method: DescentMethod) -> usize {
    match method {
        DescentMethod::TrustRegion => 1000,
        DescentMethod::DampedLeastSquares => 100,
        DescentMethod::Adam => 2000,
    }
}

impl OptimizeArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_paths()?;
        let stop = stop_flag();
        let design = DesignEffects::new(&self.effects)?;
        let opened = self.lens.open()?;
        let mut lens = design.working_lens(&opened.lens);
        add_variables(&mut lens, &self.vary);
        let refuse = |source| self.merit_error(&opened, source);
        let goal = self.goal(&lens).map_err(|e| e.or_else(refuse))?;
        let glasses = self.glasses.search(&opened, &lens, &goal, self.error.0)?;
        let started = start(self.method, &lens, &goal, self.error.0);
        let mut optimizer = started.map_err(refuse)?;
        let before = optimizer.terms().map_err(refuse)?;
        let merit = |lens: &Lens| Merit::new(lens, &goal, self.error.0).map_err(refuse);
        let at_start = merit(&lens)?;
        if at_start.is_dark() {
            return Err(CliError::no_light(&opened.file));
        }
        let effects = design.report(&opened.lens, &opened.file)?;
        let (search, ms) = time_ms(|| self.search(optimizer.as_mut(), &opened.lens, &stop));
        let mut failures = Failures::default();
        let exchanged = glasses.map(|found| exchange(found, &mut optimizer, &stop)).transpose();
        let glasses = failures.note(exchanged.map_err(|why| failure(&opened.file, why))).flatten();
        // The lens is saved before anything else is computed from it.
        let best = with_own_parts(optimizer.best(), &opened.lens);
        let saved = failures.note(files::save(&best, &self.out)).is_some();
        let kept = failures.note(self.write_history(&search)).is_some();
        let after = optimizer.terms().map_err(refuse)?;
        let light = [at_start.light(), merit(optimizer.best())?.light()];
        let limits = optimizer.binding_limits().to_vec();
        let search = &search;
        let saved = SavedParts { lens: saved, history: kept };
        let found =
            OptimizeOutcome { search, ms, light, before, after, limits, glasses, saved, effects };
        failures.note(output.print(&OptimizeReport::new(self, &lens, &best, found)));
        failures.note(check_conflict(optimizer.as_ref()).map_err(refuse));
        failures.into_result()
    }

    fn check_paths(&self) -> Result<(), CliError> {
        let goal = self.goal.as_deref().map(|path| ("--goal", path));
        let mut paths =
            OutputPaths::reading([("the lens", self.lens.path())].into_iter().chain(goal));
        paths.file("--out", Some(&self.out), &["json", "zmx"])?;
        paths.file("--history", self.history.as_deref(), &["json"])
    }

    fn write_history(&self, search: &OptimizeRun) -> Result<(), FileError> {
        let Some(path) = &self.history else { return Ok(()) };
        let text = json::pretty(&StepHistory { steps: &search.steps });
        files::write_atomic(path, text.as_bytes())
    }

    fn goal(&self, lens: &Lens) -> Result<Goal, GoalError> {
        let goal: Goal = match &self.goal {
            Some(path) => input::read_json(path).map_err(GoalError::Failure)?,
            None => Goal::of_lens(lens).map_err(GoalError::Merit)?,
        };
        if self.as_built.is_some() && !goal.terms.iter().any(|w| w.term == Term::Spot) {
            let text = "--as-built: found a merit function without a term `spot`; expected one";
            return Err(GoalError::Failure(CliError::Input(text.to_owned())));
        }
        Ok(if self.as_built.is_some() { goal.as_built(self.as_built) } else { goal })
    }

    /// The error of a merit function: a wrong term is one of the file of the goal, if there is one.
    fn merit_error(&self, opened: &LoadedLens, source: MeritError) -> CliError {
        let file = match (&self.goal, &source) {
            (Some(goal), MeritError::DoesNotApply { .. }) => input::display_name(goal),
            _ => opened.file.clone(),
        };
        match source {
            MeritError::NoVariables => CliError::Input(format!(
                "{file}: found no variables; expected some in the file (`\"variables\"`), or kinds \
                 of parameters to vary: `--vary curvatures,thicknesses`"
            )),
            source => CliError::Merit { file, source },
        }
    }

    /// Steps until convergence, the maximum number of steps or Ctrl-C.
    fn search(
        &self,
        optimizer: &mut dyn Optimizer,
        opened: &Lens,
        stop: &AtomicBool,
    ) -> OptimizeRun {
        let most = self.steps.unwrap_or(default_steps(self.method));
        let bar = progress_bar(most);
        let mut search = OptimizeRun { steps: Vec::new(), ended: OptimizeEnd::Steps };
        while search.steps.len() < most {
            if stop.load(Ordering::Relaxed) {
                search.ended = OptimizeEnd::Stopped;
                break;
            }
            let progress = optimizer.step();
            bar.inc(1);
            bar.set_message(format!("merit {}", ShortNumber(progress.best)));
            let finished = progress.finished;
            search.steps.push(progress);
            if finished {
                search.ended = OptimizeEnd::Finished;
                break;
            }
        }
        if search.ended == OptimizeEnd::Stopped {
            // Whoever asks for an end may not wait for the check behind it.
            let best = with_own_parts(optimizer.best(), opened);
            if let Err(why) = files::save(&best, &self.out) {
                log::warn!("not saved yet: {why}");
            }
        }
        optimizer.verify_best();
        bar.finish_and_clear();
        search
    }
}

/// A lens with the variables and wavelengths of the file from which it comes.
fn with_own_parts(lens: &Lens, opened: &Lens) -> Lens {
    let Lens { variables, wavelengths, .. } = opened.clone();
    let mut lens = Lens { wavelengths, variables, ..lens.clone() };
    // A glass of the catalogue in place of a model glass has no index that varies.
    let values = lens.clone();
    lens.variables.retain(|variable| values.get(variable.parameter).is_some());
    lens
}

/// An error of the merit function.
enum GoalError {
    Failure(CliError),
    Merit(MeritError),
}

impl GoalError {
    fn or_else(self, refuse: impl FnOnce(MeritError) -> CliError) -> CliError {
        match self {
            Self::Failure(failure) => failure,
            Self::Merit(source) => refuse(source),
        }
    }
}

/// Returns an error if the limits contradict each other.
fn check_conflict(optimizer: &dyn Optimizer) -> Result<(), MeritError> {
    match optimizer.conflict() {
        [] => Ok(()),
        limits => Err(MeritError::ConflictingLimits { limits: limits.to_vec() }),
    }
}

/// The steps of a run and the reason of its end.
struct OptimizeRun {
    steps: Vec<OptimizationProgress>,
    ended: OptimizeEnd,
}

/// The reason why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum OptimizeEnd {
    /// It converged.
    Finished,
    /// The maximum number of steps was reached.
    Steps,
    /// It was stopped by Ctrl-C.
    Stopped,
}

#[derive(Serialize)]
struct StepHistory<'a> {
    steps: &'a [OptimizationProgress],
}

/// A run with the terms before and after it.
struct OptimizeOutcome<'a> {
    search: &'a OptimizeRun,
    ms: f64,
    /// The mean pupil area before and after, in mm².
    light: [f64; 2],
    before: Vec<TermValue>,
    after: Vec<TermValue>,
    limits: Vec<LimitPrice>,
    glasses: Option<GlassExchangeReport>,
    saved: SavedParts,
    effects: EffectReport,
}

/// The parts of a result that are in files, or were not asked for there.
struct SavedParts {
    lens: bool,
    history: bool,
}

/// The printed result.
#[derive(Serialize)]
struct OptimizeReport {
    method: String,
    steps: usize,
    ended: OptimizeEnd,
    /// The reason for which the method ended by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<OptimizationEnd>,
    ms: f64,
    merit_before: f64,
    merit_after: f64,
    light_before: f64,
    light_after: f64,
    /// The focal length at each zoom position before and after, in mm.
    focal_lengths: Vec<FocalLengths>,
    refused_steps: usize,
    last_refusal: Option<String>,
    terms: Vec<TermComparison>,
    /// The limits that hold the best lens, with their prices.
    limits: Vec<LimitPrice>,
    variables: Vec<VariableComparison>,
    /// The exchange of glasses, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    glasses: Option<GlassExchangeReport>,
    /// True if thicknesses vary that no term limits.
    #[serde(skip)]
    free_thicknesses: bool,
    #[serde(flatten)]
    effects: EffectReport,
    out: Option<String>,
    /// The best lens, if it could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<Lens>,
    /// The steps of the history, if they could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    history: Option<Vec<OptimizationProgress>>,
}

/// The focal length of a lens at a zoom position, in mm; `None` for an afocal one.
#[derive(Serialize)]
struct FocalLengths {
    before: Option<f64>,
    after: Option<f64>,
}

impl FocalLengths {
    /// The focal lengths of two lenses at every zoom position.
    fn compare(before: &Lens, after: &Lens) -> Vec<Self> {
        let of = |lens: &Lens, zoom| {
            let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).ok()?;
            first_order(&system, &Beam::for_lens(lens, zoom)).ok()?.efl
        };
        let pair = |zoom| Self { before: of(before, zoom), after: of(after, zoom) };
        (0..before.zoom_positions()).map(pair).collect()
    }
}

impl Display for FocalLengths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "focal length {} -> {} mm", or_dash(self.before), or_dash(self.after))?;
        let Some((before, after)) = self.before.zip(self.after) else { return Ok(()) };
        write!(f, " ({:+.2} %)", 100.0 * (after / before - 1.0))
    }
}

#[derive(Serialize)]
struct VariableComparison {
    parameter: String,
    before: Option<f64>,
    after: Option<f64>,
}

/// The terms that limit thicknesses.
const THICKNESS_TERMS: [&str; 8] = [
    "glass_center",
    "glass_edge",
    "air_center",
    "air_edge",
    "total_track",
    "back_focus",
    "gap",
    "track",
];

/// True if a lens varies thicknesses that none of these terms limits.
fn has_free_thicknesses(lens: &Lens, terms: &[TermValue]) -> bool {
    let is_thickness = |variable: &Variable| variable.parameter.quantity == Quantity::Thickness;
    let is_limited = terms.iter().any(|term| THICKNESS_TERMS.contains(&term.term));
    lens.variables.iter().any(is_thickness) && !is_limited
}

impl OptimizeReport {
    fn new(args: &OptimizeArgs, lens: &Lens, best: &Lens, found: OptimizeOutcome<'_>) -> Self {
        let OptimizeOutcome { search, ms, light, before, after, limits, glasses, saved, effects } =
            found;
        let merit = |terms: &[TermValue]| terms.iter().map(|t| t.weight * t.value).sum();
        let refusals = || search.steps.iter().filter_map(|step| step.refused.as_ref());
        let variable = |v: &Variable| VariableComparison {
            parameter: v.parameter.to_string(),
            before: lens.get(v.parameter),
            after: best.get(v.parameter),
        };
        Self {
            method: value_name(&args.method),
            steps: search.steps.len(),
            ended: search.ended,
            reason: search.steps.last().and_then(|step| step.end),
            ms,
            merit_before: merit(&before),
            merit_after: merit(&after),
            light_before: light[0],
            light_after: light[1],
            focal_lengths: FocalLengths::compare(lens, best),
            refused_steps: refusals().count(),
            last_refusal: refusals().next_back().cloned(),
            free_thicknesses: has_free_thicknesses(lens, &after),
            terms: TermComparison::compare(&before, &after),
            limits,
            variables: lens.variables.iter().map(variable).collect(),
            glasses,
            effects,
            out: saved.lens.then(|| args.out.display().to_string()),
            lens: (!saved.lens).then(|| best.clone()),
            history: (!saved.history).then(|| search.steps.clone()),
        }
    }
}

/// The number of variables in the text.
const SHOWN_VARIABLES: usize = 30;

impl OptimizeReport {
    fn write_variables(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&["variable", "before", "after"]);
        for VariableComparison { parameter, before, after } in
            self.variables.iter().take(SHOWN_VARIABLES)
        {
            table.row([parameter.clone(), or_dash(*before), or_dash(*after)]);
        }
        write!(f, "{table}")?;
        match self.variables.len().saturating_sub(SHOWN_VARIABLES) {
            0 => writeln!(f),
            more => writeln!(f, "{more} more in --json\n"),
        }
    }
}

/// The terms that depend on the transmitted light.
const LIGHT_TERMS: [&str; 6] =
    ["throughput", "throughput_loss", "light", "mean_light", "relative_illumination", "f_number"];

impl Display for OptimizeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, ms, merit_before, merit_after, .. } = self;
        let ended = match (self.ended, self.reason) {
            (OptimizeEnd::Finished, Some(reason)) => reason.text(),
            (OptimizeEnd::Finished, None) => "converged",
            (OptimizeEnd::Steps, _) => "the maximum number of steps was reached",
            (OptimizeEnd::Stopped, _) => "stopped",
        };
        writeln!(f, "{steps} steps in {:.3} s: {ended}", 1e-3 * ms)?;
        if let Some(refusal) = &self.last_refusal {
            writeln!(f, "{} steps rejected or shortened, the last: {refusal}", self.refused_steps)?;
        }
        if let Some(glasses) = &self.glasses {
            write!(f, "{glasses}")?;
        }
        writeln!(f, "merit {} -> {}", ShortNumber(*merit_before), ShortNumber(*merit_after))?;
        let [before, after] = [self.light_before, self.light_after];
        let change = 100.0 * (after / before - 1.0);
        let light = [ShortNumber(before), ShortNumber(after)];
        writeln!(
            f,
            "light {} -> {} mm^2 ({change:+.1} %), mean over the spots",
            light[0], light[1]
        )?;
        self.focal_lengths.iter().try_for_each(|focal| writeln!(f, "{focal}"))?;
        let asks = self.terms.iter().any(|term| LIGHT_TERMS.contains(&term.term));
        if change < -1.0 && !asks {
            writeln!(
                f,
                "  no term depends on the light: part of the sharpness was gained by clipping"
            )?;
        }
        if self.free_thicknesses {
            writeln!(f, "  no term limits thicknesses, but thicknesses vary")?;
        }
        writeln!(f)?;
        let table = TermComparison::table(&self.terms);
        writeln!(f, "{table}")?;
        if let Some(note) = TermComparison::note(&self.terms) {
            writeln!(f, "{note}")?;
        }
        limit_prices::write(&self.limits, *merit_after, f)?;
        self.write_variables(f)?;
        writeln!(f, "{}", self.effects)?;
        write_saved(f, self.out.as_deref(), self.lens.as_ref())
    }
}
