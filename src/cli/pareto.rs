//! `pareto`: the front of sharpness against light.

use super::effects::{DesignEffects, EffectArgs, EffectReport};
use super::error::CliError;
use super::failures::Failures;
use super::input::{LensFile, Tolerance};
use super::output::{Output, ShortNumber, TextTable, print_note, write_saved};
use super::output_paths::{OutputPaths, stale_note};
use super::progress::{progress_bar, stop_flag};
use crate::lens::{Lens, ToleranceGrade};
use crate::measure::time_ms;
use crate::merit::PupilEdge;
use crate::optimize::DescentMethod;
use crate::optimize::pareto::{
    ParetoError, ParetoPoint, ParetoSettings, ParetoSweep, Scalarization,
};
use crate::report::ParetoReport;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Sweeps the front of sharpness against light; Ctrl-C ends it and writes what was found
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/pareto.txt"))]
pub(super) struct ParetoArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The folder for table, picture and lenses
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// The number of levels of light, or of weights
    #[arg(long, default_value_t = ParetoSettings::default().points, value_name = "N")]
    points: usize,

    /// The problems whose solutions make up the front
    #[arg(long, value_enum, default_value_t = Scalarization::default())]
    scalarization: Scalarization,

    /// The least and the most light that is asked for, relative to that at the start
    #[arg(long, num_args = 2, value_names = ["LEAST", "MOST"],
          default_values_t = ParetoSettings::default().light)]
    light: Vec<f64>,

    /// The optimization method of weighted sums; absent: adam
    #[arg(long, value_enum)]
    method: Option<DescentMethod>,

    /// Maximum number of steps for each level of light or weight; absent: 60 for a level, 500 for a
    /// weight by adam, 100 by other methods
    #[arg(long, value_name = "N")]
    steps: Option<usize>,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-3", value_name = "TOLERANCE")]
    error: Tolerance,

    /// Compares lenses as they are built, with this class of care in making; absent: as the merit
    /// function of the lens says, or else as designed
    #[arg(long, value_enum, value_name = "GRADE")]
    as_built: Option<ToleranceGrade>,

    /// Omits the comparison with biased derivatives, which hold the transmitted rays fixed
    #[arg(long)]
    no_biased: bool,

    #[command(flatten)]
    effects: EffectArgs,
}

/// The default number of steps of a method with second derivatives for each weight.
const SECOND_ORDER_STEPS: usize = 100;

impl ParetoArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_method()?;
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.folder("--out", self.out.as_deref(), ParetoReport::is_own_file)?;
        let design = DesignEffects::new(&self.effects)?;
        let opened = self.lens.open()?;
        let lens = design.working_lens(&opened.lens);
        let stop = stop_flag();
        let refuse = |cause: ParetoError| {
            let blamed = match &cause {
                ParetoError::Settings { what: "the number of points", .. } => "--points",
                ParetoError::Settings { what: "the light", .. } => "--light",
                ParetoError::Settings { what: "the number of steps", .. } => "--steps",
                _ => &opened.file,
            };
            CliError::Input(format!("{blamed}: {cause}"))
        };
        let search = |pupil| self.search(&lens, pupil, &stop).map_err(refuse);
        let effects = design.report(&opened.lens, &opened.file)?;
        let (sweep, ms) = search(PupilEdge::Moving)?;
        let is_as_built = sweep.start.as_built.is_some();
        let with_biased = !self.no_biased && !is_as_built;
        let biased = if with_biased { Some(search(PupilEdge::Frozen)?) } else { None };
        let stopped = stop.load(Ordering::Relaxed);
        let mut report = ParetoSweepReport::new(&sweep, ms, biased.as_ref(), stopped, effects);
        let mut failures = Failures::default();
        if let Some(folder) = &self.out {
            let survey = ParetoReport {
                name: &opened.lens.name,
                wavelengths: &opened.lens.wavelengths,
                start: &sweep.start,
                front: sweep.front(),
                tried: sweep.evaluated(),
                biased: biased.as_ref().map(|(sweep, _)| sweep.front()),
            };
            match failures.note(survey.write(folder)) {
                Some(files) => report.files = files,
                None => report.unsaved = sweep.front().points().iter().map(|p| &p.lens).collect(),
            }
            report.stale = survey.stale_files(folder);
            stale_note(&report.stale).iter().for_each(|note| print_note(format!("note: {note}")));
        }
        failures.note(output.print(&report));
        failures.into_result()
    }

    fn search(
        &self,
        lens: &Lens,
        pupil: PupilEdge,
        stop: &AtomicBool,
    ) -> Result<(ParetoSweep, f64), ParetoError> {
        let settings = self.settings(pupil);
        let (sweep, ms) = time_ms(|| -> Result<ParetoSweep, ParetoError> {
            let mut sweep = ParetoSweep::new(lens, &settings)?;
            let bar = progress_bar(0);
            while !stop.load(Ordering::Relaxed) {
                let slice = sweep.step();
                bar.set_length(slice.total as u64);
                bar.set_position(slice.done as u64);
                bar.set_message(format!("hypervolume {}", ShortNumber(sweep.hypervolume())));
                if slice.finished {
                    break;
                }
            }
            bar.finish_and_clear();
            Ok(sweep)
        });
        Ok((sweep?, ms))
    }

    fn settings(&self, pupil: PupilEdge) -> ParetoSettings {
        let scalarization = match pupil {
            PupilEdge::Moving => self.scalarization,
            PupilEdge::Frozen => Scalarization::WeightedSum,
        };
        let default = match scalarization {
            Scalarization::EpsilonConstraint => ParetoSettings::default(),
            Scalarization::WeightedSum => ParetoSettings::weighted_sum(),
        };
        let method = self.method.unwrap_or(default.method);
        let is_second_order = method != DescentMethod::Adam;
        let few = is_second_order && scalarization == Scalarization::WeightedSum;
        // The steps that are asked for are those of the scalarization that is asked for.
        let asked = self.steps.filter(|_| scalarization == self.scalarization);
        ParetoSettings {
            points: self.points,
            method,
            steps: asked.unwrap_or(if few { SECOND_ORDER_STEPS } else { default.steps }),
            pupil,
            light: [self.light[0], self.light[1]],
            as_built: self.as_built,
            tolerance: self.error.0,
            ..default
        }
    }

    /// Refuses a method that would not be used.
    fn check_method(&self) -> Result<(), CliError> {
        let is_level = self.scalarization == Scalarization::EpsilonConstraint;
        let Some(method) = self.method.filter(|method| *method != DescentMethod::TrustRegion)
        else {
            return Ok(());
        };
        if !is_level {
            return Ok(());
        }
        let text = format!(
            "--method is {}; expected trust-region, or --scalarization weighted-sum",
            method.name()
        );
        Err(CliError::Input(text))
    }
}

/// The printed result.
#[derive(Serialize)]
struct ParetoSweepReport<'a> {
    ms: f64,
    stopped: bool,
    hypervolume: f64,
    tried: usize,
    start: &'a ParetoPoint,
    front: &'a [ParetoPoint],
    biased: Option<BiasedSweep<'a>>,
    #[serde(flatten)]
    effects: EffectReport,
    files: Vec<PathBuf>,
    /// Files of an earlier front in the same folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    stale: Vec<PathBuf>,
    /// The lenses of the front, if they could not all be saved.
    #[serde(rename = "lenses", skip_serializing_if = "Vec::is_empty")]
    unsaved: Vec<&'a Lens>,
}

#[derive(Serialize)]
struct BiasedSweep<'a> {
    ms: f64,
    hypervolume: f64,
    dominated: usize,
    front: &'a [ParetoPoint],
}

impl<'a> ParetoSweepReport<'a> {
    fn new(
        sweep: &'a ParetoSweep,
        ms: f64,
        biased: Option<&'a (ParetoSweep, f64)>,
        stopped: bool,
        effects: EffectReport,
    ) -> Self {
        let ours = sweep.front().points();
        let beaten = |design: &&ParetoPoint| ours.iter().any(|ours| ours.dominates(design));
        let biased = biased.map(|(other, ms)| BiasedSweep {
            ms: *ms,
            hypervolume: other.hypervolume(),
            dominated: other.front().points().iter().filter(beaten).count(),
            front: other.front().points(),
        });
        Self {
            ms,
            stopped,
            hypervolume: sweep.hypervolume(),
            tried: sweep.evaluated().len(),
            start: &sweep.start,
            front: sweep.front().points(),
            biased,
            effects,
            files: Vec::new(),
            stale: Vec::new(),
            unsaved: Vec::new(),
        }
    }
}

/// The number of lenses in the printed table; the files have all of them.
const MAX_LISTED: usize = 20;

impl Display for ParetoSweepReport<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { ms, hypervolume, tried, front, .. } = self;
        let stopped = if self.stopped { ", stopped" } else { "" };
        let count = front.len();
        writeln!(f, "{count} lenses of {tried} in {:.2} s{stopped}", 1e-3 * ms)?;
        writeln!(f, "hypervolume {hypervolume:.4} of twice the spot and the light at the start")?;
        if let Some(BiasedSweep { ms, hypervolume, dominated, front }) = &self.biased {
            write!(f, "biased: {} lenses in {:.2} s, hypervolume ", front.len(), 1e-3 * ms)?;
            writeln!(f, "{hypervolume:.4}; {dominated} of them are dominated")?;
        }
        writeln!(f)?;
        let is_as_built = self.start.as_built.is_some();
        let made = if is_as_built { "as built, um" } else { "" };
        let head = ["rms spot, um", "error", made, "light, mm^2", "error", "asked for", "rays"];
        let shown = |i: &usize| is_as_built || *i != 2;
        let columns: Vec<usize> = (0..head.len()).filter(shown).collect();
        let mut table = TextTable::new(&columns.iter().map(|i| head[*i]).collect::<Vec<_>>());
        let every = count.div_ceil(MAX_LISTED).max(1);
        for point in std::iter::once(self.start).chain(front.iter().step_by(every)) {
            let asked = match (point.weight, point.min_light) {
                (Some(weight), _) => format!("{:.1} um at the rim", 1e3 * weight.sqrt()),
                (None, Some(light)) => format!("{light:.3} mm^2"),
                (None, None) => "start".to_owned(),
            };
            let cells = [
                format!("{:.3}", 1e3 * point.spot),
                format!("{:.0e}", 1e3 * point.spot_error),
                format!("{:.3}", 1e3 * point.radius()),
                format!("{:.3}", point.light),
                format!("{:.0e}", point.light_error),
                asked,
                point.rays.to_string(),
            ];
            table.row(columns.iter().map(|i| cells[*i].clone()));
        }
        write!(f, "{table}\n{}", self.effects)?;
        if let Some(first) = self.files.first() {
            writeln!(f, "\n{} files, the table is {}", self.files.len(), first.display())?;
        }
        self.unsaved.iter().try_for_each(|lens| write_saved(f, None, Some(lens)))
    }
}
