//! `measure mtf`: contrast, its error and its time.

use super::optiland::HOW_TO_GET;
use super::optiland::mtf::{self, OptilandCurves, OptilandRow};
use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{LensFile, LoadedLens};
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{stop_flag, with_bar};
use crate::measure::{Machine, TransferCurves, TransferMethod, TransferRow, measure_transfer};
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Error and milliseconds of a chart of contrast, by rays and by diffraction, on one core
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_mtf.txt"))]
pub(super) struct MeasureMtfArgs {
    /// The lenses: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS", required = true)]
    lenses: Vec<PathBuf>,

    /// The highest spatial frequency in cycles/mm
    #[arg(long, value_name = "NU", default_value_t = 50.0)]
    highest: f64,

    /// The number of frequencies
    #[arg(long, value_name = "N", default_value_t = 50)]
    count: usize,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// A Python that has Optiland: its two contrasts of the same lens are timed and compared in the same run
    #[arg(long, value_name = "PYTHON")]
    optiland: Option<PathBuf>,

    #[command(flatten)]
    plot: PlotArgs,
}

/// The most frequencies of a chart.
const MOST: usize = 10_000;

impl MeasureMtfArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check()?;
        self.plot.check(self.lenses.iter().map(|path| ("the lens", path.as_path())))?;
        let open = |path: &PathBuf| LensFile::of(path).open();
        let opened: Vec<LoadedLens> = self.lenses.iter().map(open).collect::<Result<_, _>>()?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| CliError::Failed(error.to_string()))?;
        let rows: Result<Vec<_>, CliError> =
            opened.iter().map(|opened| self.measure(opened, &pool)).collect();
        let report = MeasureMtfReport { machine: Machine::detect(), lenses: rows? };
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw(&report.lenses)));
        failures.note(output.print(&report));
        failures.into_result()
    }

    fn check(&self) -> Result<(), CliError> {
        if !(self.highest > 0.0 && self.highest.is_finite()) {
            let found = self.highest;
            let text = format!("--highest: found {found}; expected a positive number of cycles/mm");
            return Err(CliError::Input(text));
        }
        if !(1..=MOST).contains(&self.count) {
            let text = format!("--count: found {}; expected 1 to {MOST}", self.count);
            return Err(CliError::Input(text));
        }
        Ok(())
    }

    fn measure(
        &self,
        opened: &LoadedLens,
        pool: &rayon::ThreadPool,
    ) -> Result<LensCurves, CliError> {
        let model = opened.ray_model(self.zoom)?;
        let (found, _) = with_bar(&stop_flag(), "charts", |report| {
            measure_transfer(&model, (self.highest, self.count), pool, report)
        });
        let curves = found.map_err(|why| CliError::Input(format!("{}: {why}", opened.file)))?;
        let beside = |python: &PathBuf| {
            let asked = (self.highest, self.count);
            mtf::measure(python, opened, (&model, &curves.fields), asked)
        };
        let optiland = self.optiland.as_ref().map(beside).transpose()?;
        let (lens, name) = (opened.file.clone(), opened.lens.name.clone());
        Ok(LensCurves { lens, name, curves, optiland })
    }
}

/// The curves of a lens.
#[derive(Serialize)]
struct LensCurves {
    lens: String,
    #[serde(skip)]
    name: String,
    #[serde(flatten)]
    curves: TransferCurves,
    optiland: Option<OptilandCurves>,
}

/// The printed result.
#[derive(Serialize)]
struct MeasureMtfReport {
    machine: Machine,
    lenses: Vec<LensCurves>,
}

const COLORS: [(TransferMethod, Color); 2] = [
    (TransferMethod::Geometric, [0x2c, 0xa0, 0x2c]),
    (TransferMethod::Diffraction, [0xd6, 0x27, 0x28]),
];

/// Draws the first two lenses side by side.
fn draw(lenses: &[LensCurves]) -> Result<Vec<u8>, ImageError> {
    let chart = |lens: &LensCurves| {
        let curve = |(method, color)| {
            let rows = lens.curves.rows.iter().filter(|row| row.method == method);
            let points = rows.map(|row| [row.ms, row.error]).collect();
            ErrorCurve { color, stroke: Stroke::Solid, points }
        };
        ErrorChart { name: lens.name.clone(), curves: COLORS.into_iter().map(curve).collect() }
    };
    let charts: Vec<ErrorChart> = lenses.iter().take(2).map(chart).collect();
    let labels = COLORS.map(|(method, color)| LegendEntry::colored(method.name(), color));
    plot::draw(&charts, &labels, "contrast: absolute error against time")
}

impl Display for MeasureMtfReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        for LensCurves { lens, curves, optiland, .. } in &self.lenses {
            let [low, high] = curves.frequencies.map(ShortNumber);
            let (count, fields, colors) = (curves.count, curves.fields.len(), curves.colors);
            writeln!(
                f,
                "\n{lens}: {count} frequencies from {low} to {high} cycles/mm, {fields} fields, \
                 {colors} colours, one core; pupils found in {:.2} ms",
                curves.pupils_ms
            )?;
            let mut table =
                TextTable::new(&["", "tolerance", "error", "stated", "sphere", "rays", "ms", ""]);
            curves.rows.iter().for_each(|row| table.row(cells(row)));
            let others = optiland.iter().flat_map(|found| &found.rows);
            others.for_each(|row| table.row(optiland_cells(row)));
            write!(f, "{table}")?;
            if let Some(refused) = &curves.refused {
                writeln!(f, "diffraction: {refused}")?;
            }
            match optiland {
                Some(found) => writeln!(f, "Optiland {}, each wavelength alone", found.version)?,
                None => writeln!(f, "{HOW_TO_GET}")?,
            }
        }
        Ok(())
    }
}

fn optiland_cells(row: &OptilandRow) -> Vec<String> {
    vec![
        format!("Optiland, {}", row.method.name()),
        String::new(),
        format!("{:.1e}", row.error),
        String::new(),
        String::new(),
        format!("{0} x {0}", row.rays),
        format!("{:.2}", row.ms),
        String::new(),
    ]
}

fn cells(row: &TransferRow) -> Vec<String> {
    vec![
        row.method.name().to_owned(),
        format!("{:.0e}", row.tolerance),
        format!("{:.1e}", row.error),
        format!("{:.1e}", row.stated),
        if row.sphere > 0.0 { format!("{:.1e}", row.sphere) } else { String::new() },
        row.rays.to_string(),
        format!("{:.2}", row.ms),
        row.limit.map_or_else(String::new, |limit| limit.to_string()),
    ]
}
