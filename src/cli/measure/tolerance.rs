//! `measure tolerance`: the exactness and the cost of tolerances, and the gain of designs as built.

use super::optiland::HOW_TO_GET;
use super::optiland::tolerance::{self as optiland, OptilandTolerances};
use crate::cli::error::CliError;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::stop_flag;
use crate::files;
use crate::lens::{Lens, ToleranceGrade};
use crate::measure::{
    AgreementRow, AsBuiltComparison, Machine, MadeDesign, ReferenceAgreement, ToleranceBenchmark,
    ToleranceBenchmarkError, ToleranceReference, compare_as_built, measure_tolerances,
};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};

/// Exactness and cost of tolerances, and the spread of lenses by a design that is optimized as built
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_tolerance.txt"))]
pub(super) struct MeasureToleranceArgs {
    /// The lens: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS")]
    lens: Option<PathBuf>,

    /// The class of the tolerances
    #[arg(long, value_enum, value_name = "GRADE", default_value_t = ToleranceGrade::Commercial)]
    grade: ToleranceGrade,

    /// The number of errors: those of the class, filled up with different ones of further kinds
    #[arg(long, default_value_t = 150, value_name = "N")]
    errors: usize,

    /// Lenses with random errors whose rays are traced
    #[arg(long, default_value_t = 500, value_name = "N")]
    samples: usize,

    /// The maximum number of steps of each descent; 0 for none
    #[arg(long, value_name = "N", default_value_t = 1000)]
    steps: usize,

    /// A Python that has Optiland: its tolerancing of the same lens and errors is timed in the same run
    #[arg(long, value_name = "PYTHON")]
    optiland: Option<PathBuf>,

    /// Exact answers of other lenses (.json, as tests/reference/tolerances.json): the agreement with them alone
    #[arg(long, value_name = "FILE", conflicts_with_all = ["lens", "optiland"])]
    reference: Option<PathBuf>,
}

/// The lens without a file: that of costs, and that which is optimized.
const DOUBLE_GAUSS: &str = "double_gauss_rudolph_50";
const SENSITIVE: &str = "double_gauss_canon_ef50_f18";

impl MeasureToleranceArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if self.samples == 0 {
            return Err(CliError::Input("--samples: found 0; expected 1 or more".into()));
        }
        if self.errors == 0 {
            return Err(CliError::Input("--errors: found 0; expected 1 or more".into()));
        }
        if let Some(path) = &self.reference {
            return agree_with_reference(path, self.samples, output);
        }
        let (lens, file) = self.lens()?;
        let fail = |e: ToleranceBenchmarkError| CliError::Failed(format!("{file}: {e}"));
        let stop = stop_flag();
        let cost = measure_tolerances(&lens, self.grade, (self.errors, self.samples), &stop)
            .map_err(fail)?;
        let Some(cost) = cost else {
            let text = "stopped before the costs were measured".to_owned();
            return Err(CliError::Failed(text));
        };
        let beside = |python: &PathBuf| optiland::measure(python, (&lens, &file), self.grade);
        let optiland = self.optiland.as_ref().map(beside).transpose()?;
        // The bundled lens on which costs are measured has little to gain: its spot as designed is
        // nine tenths of that as built.
        let designed = if self.lens.is_some() { lens } else { bundled(SENSITIVE)?.0 };
        let designs = if self.steps > 0 {
            let effort = (self.steps, self.samples);
            compare_as_built(&designed, self.grade, effort, &stop).map_err(fail)?
        } else {
            None
        };
        let machine = Machine::detect();
        output.print(&MeasureToleranceReport { machine, file, cost, optiland, designs })
    }

    /// The lens and its name.
    fn lens(&self) -> Result<(Lens, String), CliError> {
        if let Some(path) = &self.lens {
            let opened = LensFile::of(path).open()?;
            return Ok((opened.lens, opened.file));
        }
        bundled(DOUBLE_GAUSS)
    }
}

/// A bundled lens and its name.
fn bundled(name: &str) -> Result<(Lens, String), CliError> {
    let missing = || CliError::Failed(format!("there is no bundled lens {name}"));
    let found = files::bundled_lenses().iter().find(|lens| lens.name == name);
    let found = found.ok_or_else(missing)?;
    let lens = files::json::read(found.text, found.name)?;
    Ok((lens, name.to_owned()))
}

/// Prints the agreement with the exact answers of a file.
fn agree_with_reference(path: &Path, samples: usize, output: &Output) -> Result<(), CliError> {
    let file = path.display().to_string();
    let wrong = |why: &dyn Display| CliError::Input(format!("{file}: {why}"));
    let text = std::fs::read_to_string(path).map_err(|why| wrong(&why))?;
    let reference: ToleranceReference = serde_json::from_str(&text).map_err(|why| wrong(&why))?;
    reference.check().map_err(|why| wrong(&why))?;
    let stop = stop_flag();
    let mut lenses = Vec::new();
    for lens in &reference.lenses {
        let found = lens.agreement(samples, &stop);
        let failed = |why| CliError::Failed(format!("{file}: {}: {why}", lens.id));
        let stopped = || CliError::Failed("stopped before all answers were compared".to_owned());
        lenses.push(found.map_err(failed)?.ok_or_else(stopped)?);
    }
    let agrees = lenses.iter().flat_map(|lens| &lens.rows).all(AgreementRow::agrees);
    output.print(&ReferenceReport { machine: Machine::detect(), file, lenses })?;
    let differ = || CliError::Failed("answers differ by more than their bounds".to_owned());
    agrees.then_some(()).ok_or_else(differ)
}

#[derive(Serialize)]
struct ReferenceReport {
    machine: Machine,
    file: String,
    lenses: Vec<ReferenceAgreement>,
}

impl Display for ReferenceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\n{}\n", self.machine, self.file)?;
        let head = ["lens", "answers", "number", "largest difference", "bound", ""];
        let mut table = TextTable::new(&head);
        for lens in &self.lenses {
            for row in &lens.rows {
                let kept = if row.agrees() { "kept" } else { "broken" };
                let [largest, bound] = [row.largest, row.bound].map(|value| format!("{value:.1e}"));
                let cells = [row.what.to_owned(), row.answers.to_string(), largest, bound];
                let cells = std::iter::once(lens.id.clone()).chain(cells);
                table.row(cells.chain([kept.to_owned()]));
            }
        }
        write!(f, "{table}")
    }
}

#[derive(Serialize)]
struct MeasureToleranceReport {
    machine: Machine,
    file: String,
    cost: ToleranceBenchmark,
    optiland: Option<OptilandTolerances>,
    designs: Option<AsBuiltComparison>,
}

/// The gain in the 90 % quantile that is asked for, as a share.
const GAIN: f64 = 0.2;

impl MeasureToleranceReport {
    fn costs(&self) -> TextTable {
        let ToleranceBenchmark { errors, rays, samples, .. } = self.cost;
        let cost = &self.cost;
        let mut table = TextTable::new(&["", "asked", "reached"]);
        let ms = |ms: f64| format!("{} ms", ShortNumber(ms));
        let mut row = |what: String, asked: String, reached: String| {
            table.row([what, asked, reached]);
        };
        let exact = |error: f64| format!("{error:.1e}");
        row("first derivatives".into(), "1.0e-9".into(), exact(cost.first_error));
        row("second derivatives".into(), "1.0e-7".into(), exact(cost.second_error));
        row("growth of the spot by each error".into(), "1.0e-4".into(), exact(cost.sampling_error));
        let sweep = format!("sensitivities by {errors} errors, {rays} rays, one core");
        row(sweep, ms(5.0), ms(cost.sweep_ms));
        row("the same with second derivatives of rays".into(), String::new(), ms(cost.jets_ms));
        if let Some(merits) = &cost.merits {
            row("the same of the wavefront".into(), String::new(), ms(merits.wavefront_ms));
            let at = ShortNumber(merits.frequency);
            let contrast = format!("the same of the contrast at {at} cycles/mm");
            row(contrast, String::new(), ms(merits.contrast_ms));
        }
        row("yield by the quadratic form, one core".into(), ms(50.0), ms(cost.form_ms));
        let real = format!("{samples} real lenses, {} rays each, two cores", cost.samples_rays);
        row(real, ms(1000.0), ms(cost.samples_ms));
        for gradient in &cost.gradients {
            let what = format!("as-built gradient, {} tolerances", gradient.tolerances);
            let ratio = format!("{:.1} x ({})", gradient.ordinary_gradients, ms(gradient.ms));
            row(what, "8 ordinary ones".into(), ratio);
        }
        if let Some(poses) = &cost.poses {
            let [centred, posed] = [poses.centred_ns, poses.posed_ns].map(ShortNumber);
            row(
                "a ray of the centred lens, one core".into(),
                String::new(),
                format!("{centred} ns"),
            );
            let reached = format!("{posed} ns, {} rays differ", poses.different);
            row("the same as one with poses".into(), "the same bits".into(), reached);
        }
        table
    }
}

/// The table of both programs.
fn beside_optiland(found: &OptilandTolerances) -> String {
    let OptilandTolerances { version, own, rows } = found;
    let errors = own.growth.len();
    let columns =
        ["the same errors, one core", "ready", "sensitivities", "rays", "a lens by rays", "off by"];
    let mut table = TextTable::new(&columns);
    let ms = |ms: f64| format!("{} ms", ShortNumber(ms));
    let times = [own.setup_ms, own.sensitivities_ms, own.lens_ms].map(ms);
    let [ready, sensitivities, lens] = times;
    table.row([
        "this program".into(),
        ready,
        sensitivities,
        own.rays.to_string(),
        lens,
        String::new(),
    ]);
    for other in rows {
        let [sensitivities, lens] = [other.sensitivities_ms, other.lens_ms].map(ms);
        let apart = other.median_difference.map_or(String::new(), |(share, count)| {
            format!("{:.1} % (median of {count})", 100.0 * share)
        });
        let program = format!("Optiland {version}");
        table.row([program, String::new(), sensitivities, other.rays.to_string(), lens, apart]);
    }
    format!(
        "{table}{errors} errors of single surfaces, image plane fixed; off: growth of the mean square spot\n"
    )
}

impl Display for MeasureToleranceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\n{}\n\n{}", self.machine, self.file, self.costs())?;
        match &self.optiland {
            Some(found) => writeln!(f, "{}", beside_optiland(found))?,
            None => writeln!(f, "{HOW_TO_GET}\n")?,
        }
        let Some(designs) = &self.designs else { return Ok(()) };
        let AsBuiltComparison { name, samples, nominal, as_built, .. } = designs;
        writeln!(f, "{name}: refocused rms spots in mm, {samples} lenses by Monte Carlo:\n")?;
        let head = ["optimized", "as designed", "mean as built", "90 %", "light mm^2", "steps"];
        let mut table = TextTable::new(&head);
        for (name, design) in [("as designed", nominal), ("as built", as_built)] {
            let MadeDesign { rms, mean, quantile, light, steps } = *design;
            let number = |value: f64| ShortNumber(value).to_string();
            let mean = format!("{} ± {:.1e}", ShortNumber(mean[0]), mean[1]);
            let cells = [number(rms), mean, number(quantile), number(light), steps.to_string()];
            table.row(std::iter::once(name.to_owned()).chain(cells));
        }
        writeln!(f, "{table}")?;
        let cost = as_built.rms / nominal.rms - 1.0;
        let [gain, most] = [designs.gain(), designs.most()].map(|share| 100.0 * share);
        writeln!(
            f,
            "asked: the 90 % quantile {:.0} % less; reached: {gain:.1} % less, and {:.1} % more as \
             designed; without any errors it would be {most:.1} % less",
            100.0 * GAIN,
            100.0 * cost
        )
    }
}
