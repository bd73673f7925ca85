//! `tolerance`: what manufacturing errors do to a lens.

mod checkpoint;
mod compensators;
mod loosest;
mod merits;
mod plots;
mod report;
mod tables;
mod units;
mod warnings;

use self::checkpoint::RandomLensSource;
use self::loosest::LoosestReport;
use self::merits::FurtherMerits;
use self::report::{ToleranceReport, WorstLens};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{LensFile, LoadedLens, Tolerance as RelativeError};
use crate::cli::output::{Output, ShortNumber};
use crate::cli::output_paths::OutputPaths;
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::files::{self, FileLock};
use crate::lens::{Compensator, Lens, Perturbation, ToleranceSheet};
use crate::report::tolerance_table;
use crate::tolerance::{
    ErrorModel, FocusTreatment, LoosestGoal, LoosestRequest, LoosestTolerances, MadeLens, RealLens,
    SecondDerivatives, StopTest, ToleranceAnalysis, ToleranceError, ToleranceGrade,
    ToleranceRequest, ToleranceScene, graded_sheet, refuse_lost_lenses, worst_lens,
};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

fn parse_sample_count(text: &str) -> Result<usize, &'static str> {
    text.parse().ok().filter(|count| *count >= 2).ok_or("expected a whole number, 2 or more")
}

/// Shows what manufacturing errors do to a lens: sensitivities, expected spot, quantiles, yield
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/tolerance.txt"))]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct ToleranceArgs {
    #[command(flatten)]
    lens: LensFile,

    /// A class of tolerances in place of those of the lens file; precision where it has none
    #[arg(long, value_enum, value_name = "GRADE")]
    grade: Option<ToleranceGrade>,

    /// Lenses with random errors whose rays are traced; two at least, or nothing tells the error of
    /// the quadratic model
    #[arg(long, default_value_t = 500, value_name = "N", value_parser = parse_sample_count)]
    samples: usize,

    /// The seed of the random errors
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Tolerance of the radius of each spot by its sampling: `0.1%` or `1e-3`
    #[arg(long, default_value = "0.1%", value_name = "TOLERANCE")]
    error: RelativeError,

    /// The zoom position, counted from 0
    #[arg(long, default_value_t = 0, value_name = "N")]
    zoom: usize,

    /// The order of the errors in text, JSON and CSV: by their share of the growth of the spot when it is
    /// refocused, or at the fixed image plane
    #[arg(long, value_enum, default_value = "refocused", value_name = "FOCUS")]
    sort: FocusTreatment,

    /// Prints every error, and not only the twenty worst ones and the sum of the others
    #[arg(long)]
    all: bool,

    /// The largest rms spot radius of a good lens in mm: adds the yield, the share of good lenses
    #[arg(long, value_name = "MM")]
    rms: Option<f64>,

    /// Adds the loosest tolerances with which the expected refocused rms is this, in mm
    #[arg(long, value_name = "MM")]
    loosest: Option<f64>,

    /// Adds the loosest tolerances with which this share of the lenses is good by --rms, refocused
    #[arg(long, value_name = "SHARE", requires = "rms", conflicts_with = "loosest")]
    loosest_yield: Option<RelativeError>,

    /// A part that is adjusted after assembly, with its largest travel in mm or degrees, beside what the file
    /// names: `focus=0.3`, `sensor_tilt_x=0.2`, `thickness@3=0.1`, `element_decenter_y@3-4=0.05`
    #[arg(long = "compensator", value_name = "KIND@SURFACES=TRAVEL")]
    compensators: Vec<Compensator>,

    /// Adds the second derivatives of rays to the quadratic model, which leaves them out: one more pass of all
    /// rays for each error
    #[arg(long)]
    second_derivatives: bool,

    /// Holds the rays of the lens as designed in all lenses with errors. Else the pupils of these are found anew,
    /// and the quadratic model has the motion of their edges, where that changes spots by 0.1 %
    #[arg(long)]
    hold_pupils: bool,

    /// Adds what the errors do to the RMS wavefront at the primary wavelength
    #[arg(long)]
    wavefront: bool,

    /// Adds what the errors do to the geometric contrast at this frequency in cycles/mm
    #[arg(long, value_name = "FREQUENCY")]
    mtf: Option<f64>,

    /// A file (.json) in which the lenses of Monte Carlo are saved: a run that was stopped, or one with more
    /// --samples, goes on from there
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,

    /// A file for the table of sensitivities, as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,

    /// A file for the lens with the largest refocused spot of those with random errors, as a lens of its
    /// own (.json, .zmx)
    #[arg(long, value_name = "FILE")]
    worst: Option<PathBuf>,

    /// A file for the worst errors, the distribution and the yield as a picture: PNG, SVG or PDF
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

impl ToleranceArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_paths()?;
        self.check_numbers()?;
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let _lock = self.checkpoint.as_deref().map(FileLock::acquire).transpose()?;
        let refuse = |source: ToleranceError| self.error(&opened, &source);
        let stop = stop_flag();
        let stops = || stop.load(Ordering::Relaxed);
        let scene = ToleranceScene::new_until(&opened.lens, self.zoom, self.error.0, &stops);
        let scene = scene.map_err(refuse)?;
        let scene = if self.hold_pupils { scene.with_held_pupils() } else { scene };
        let sheet = self.sheet(&opened, &scene)?;
        self.check_frequency(&opened)?;
        let mut failures = Failures::default();
        let analysis = self.analysis((&opened, &scene, &sheet), &stops, &mut failures)?;
        refuse_lost_lenses(analysis.lost, analysis.samples, "these tolerances").map_err(refuse)?;
        let loosest = self.loosest((&opened.lens, &scene), &analysis, (&sheet, &stops));
        let loosest = loosest.map_err(|source| self.loosest_error(&opened, &source))?;
        let loosest = LoosestReport::new(loosest, &scene.lens);
        let further = FurtherMerits::new(self, (&opened.lens, &scene, &sheet), &stops);
        let further = further.map_err(refuse)?;
        note_if_stopped(&stop);
        let worst = self.worst(&opened, &scene, &sheet, &analysis.real).map_err(refuse)?;
        if let Some(path) = &self.csv {
            let columns = further.columns(&sheet);
            let table = tolerance_table(&sheet, &analysis, &columns, self.sort).map_err(refuse)?;
            failures.note(files::write_atomic(path, table.as_bytes()));
        }
        if let Some(path) = &self.plot {
            failures.note(plots::save(path, &opened.lens.name, &sheet, &analysis));
        }
        let lens = (&opened.lens, &scene, &sheet);
        let mut report =
            ToleranceReport::new(self, lens, analysis, (loosest, further)).map_err(refuse)?;
        report.worst = worst.as_ref().map(WorstLens::new);
        if let (Some(path), Some(worst)) = (&self.worst, &worst) {
            failures.note(files::save(&worst.lens, path));
        }
        failures.note(output.print(&report));
        failures.into_result()
    }

    /// The worst lens, if it is asked for.
    fn worst(
        &self,
        opened: &LoadedLens,
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        real: &[RealLens],
    ) -> Result<Option<MadeLens>, ToleranceError> {
        if self.worst.is_none() {
            return Ok(None);
        }
        worst_lens((&opened.lens, self.zoom), scene, sheet, real)
    }

    /// The analysis, whose real lenses are read from the checkpoint and saved there.
    fn analysis(
        &self,
        (opened, scene, sheet): (&LoadedLens, &ToleranceScene, &ToleranceSheet),
        stop: StopTest<'_>,
        failures: &mut Failures,
    ) -> Result<ToleranceAnalysis, CliError> {
        let refuse = |source: ToleranceError| self.error(opened, &source);
        let lens = Lens { tolerances: Some(sheet.clone()), ..opened.lens.clone() };
        let source = RandomLensSource::new(&lens, self.zoom, self.error.0, self.seed);
        let source = source.with_held_pupils(self.hold_pupils);
        let known = match self.checkpoint.as_deref() {
            Some(path) => source.known(path)?,
            None => Vec::new(),
        };
        let second = if self.second_derivatives {
            SecondDerivatives::Traced
        } else {
            SecondDerivatives::Neglected
        };
        let request = ToleranceRequest { seed: self.seed, samples: self.samples, limit: self.rms };
        let model = ErrorModel::new(scene, sheet, second, stop).map_err(refuse)?;
        // Before the random lenses, which take most of the time.
        let reached = self.goal().map_or(Ok(()), |goal| goal.check(&model.forms[1]));
        reached.map_err(|source| self.loosest_error(opened, &source))?;
        let mut failed = None;
        let save = |lenses: &[RealLens]| {
            let saved = self.checkpoint.as_deref().map(|path| source.save(path, lenses));
            failed = saved.and_then(Result::err);
        };
        let found = model.analyze_on((scene, sheet), request, stop, (&known, save));
        let failed = failed.map(|why| CliError::Failed(why.to_string()));
        failures.note(failed.map_or(Ok(()), Err));
        found.map_err(refuse)
    }

    fn check_paths(&self) -> Result<(), CliError> {
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.file("--checkpoint", self.checkpoint.as_deref(), &["json"])?;
        paths.file("--csv", self.csv.as_deref(), &["csv"])?;
        paths.file("--worst", self.worst.as_deref(), &["json", "zmx"])?;
        paths.file("--plot", self.plot.as_deref(), &plots::EXTENSIONS)
    }

    /// The aim of the loosest tolerances, if they are asked for.
    fn goal(&self) -> Option<LoosestGoal> {
        match (self.loosest, self.loosest_yield, self.rms) {
            (Some(rms), ..) => Some(LoosestGoal::Rms(rms)),
            (None, Some(share), Some(rms)) => Some(LoosestGoal::Yield { rms, share: share.0 }),
            _ => None,
        }
    }

    /// The loosest tolerances, if they are asked for.
    fn loosest(
        &self,
        lens: (&Lens, &ToleranceScene),
        analysis: &ToleranceAnalysis,
        (sheet, stop): (&ToleranceSheet, StopTest<'_>),
    ) -> Result<Option<LoosestTolerances>, ToleranceError> {
        let Some(goal) = self.goal() else { return Ok(None) };
        let request = LoosestRequest { goal, limit: self.rms, seed: self.seed };
        let form = (&analysis.forms[1], analysis.pupils.moves);
        LoosestTolerances::new(lens, form, sheet, request, stop).map(Some)
    }

    fn check_numbers(&self) -> Result<(), CliError> {
        let numbers = [
            ("--rms", self.rms, "mm"),
            ("--loosest", self.loosest, "mm"),
            ("--mtf", self.mtf, "cycles/mm"),
        ];
        for (name, value, unit) in numbers {
            if let Some(found) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                let text = format!("{name}: found {found}; expected more than 0, in {unit}");
                return Err(CliError::Input(text));
            }
        }
        Ok(())
    }

    /// Refuses a frequency at which no lens of this aperture has any contrast.
    fn check_frequency(&self, opened: &LoadedLens) -> Result<(), CliError> {
        let Some(frequency) = self.mtf else { return Ok(()) };
        let first_order = opened.ray_model(self.zoom)?.first_order;
        let shortest = opened.lens.wavelengths.iter().map(|w| w.um).fold(f64::INFINITY, f64::min);
        let cutoff = first_order.working_f_number.map(|f| 1e3 / (shortest * f.abs()));
        match cutoff.filter(|cutoff| frequency > *cutoff) {
            Some(cutoff) => Err(CliError::Input(format!(
                "--mtf: found {frequency}; expected at most {} cycles/mm, where diffraction ends all contrast",
                ShortNumber(cutoff)
            ))),
            None => Ok(()),
        }
    }

    /// The class of the tolerances; `None` for those of the lens file.
    fn grade_of(&self, lens: &Lens) -> Option<ToleranceGrade> {
        let own = lens.tolerances.is_some();
        self.grade.or_else(|| (!own).then(ToleranceGrade::default))
    }

    /// The tolerances of the lens file, or those of the class, with the compensators that are asked for.
    fn sheet(
        &self,
        opened: &LoadedLens,
        scene: &ToleranceScene,
    ) -> Result<ToleranceSheet, CliError> {
        let mut sheet = match (&opened.lens.tolerances, self.grade_of(&opened.lens)) {
            (_, Some(grade)) => graded_sheet(&opened.lens, &scene.lens, grade),
            (own, None) => own.clone().unwrap_or_default(),
        };
        let check = |sheet: &ToleranceSheet, blamed: &str| {
            let with = Lens { tolerances: Some(sheet.clone()), ..opened.lens.clone() };
            with.check().map_err(|why| CliError::Input(format!("{blamed}: {why}")))
        };
        check(&sheet, &opened.file)?;
        self.compensators.iter().for_each(|own| sheet.set_compensator(*own));
        check(&sheet, "--compensator")?;
        Ok(sheet)
    }

    /// The error of the loosest tolerances: a spot that no tolerances give is one of the option.
    fn loosest_error(&self, opened: &LoadedLens, source: &ToleranceError) -> CliError {
        let option = if self.loosest.is_some() { "--loosest" } else { "--rms" };
        match source {
            ToleranceError::BelowNominal { .. } => CliError::Input(format!("{option}: {source}")),
            other => self.error(opened, other),
        }
    }

    /// The error of an analysis, which names the option where a compensator that was asked for is at fault.
    fn error(&self, opened: &LoadedLens, source: &ToleranceError) -> CliError {
        let is_own = |what: &Perturbation| {
            self.compensators.iter().any(|own| own.part.in_lens().as_ref() == Some(what))
        };
        let blamed = match source {
            ToleranceError::NotPossible { what, .. } if is_own(what) => "--compensator",
            _ => &opened.file,
        };
        let text = format!("{blamed}: {source}");
        match source {
            ToleranceError::MostLost { .. } | ToleranceError::Stopped => CliError::Failed(text),
            _ => CliError::Input(text),
        }
    }
}
