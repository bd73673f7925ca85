//! `measure gradient`: accuracy of aperture-aware derivatives against time.

use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{LensFile, Tolerance};
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{stop_flag, with_bar};
use crate::measure::{
    GradientBenchmark, GradientCost, GradientCurves, GradientRow, Integral, Machine, Precision,
    TermCost, TermCosts, measure_gradients, measure_term_costs,
};
use crate::pupil::DerivativeEstimator;
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};

/// Error against milliseconds of every estimator of derivatives over a moving pupil
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_gradient.txt"))]
pub(super) struct MeasureGradientArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The field beside the axis, in the unit of the lens's fields; absent: the most vignetted one
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// The spatial frequency of the terms about contrast, in cycles/mm
    #[arg(long, value_name = "NU", default_value_t = 20.0)]
    frequency: f64,

    /// Tolerance of the rays of the terms, of contrast five times that: `0.1%` or `1e-3`
    #[arg(long, value_name = "TOLERANCE", default_value = "2e-4")]
    tolerance: Tolerance,

    #[command(flatten)]
    plot: PlotArgs,
}

impl MeasureGradientArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if !(self.frequency > 0.0 && self.frequency.is_finite()) {
            let found = self.frequency;
            let text =
                format!("--frequency: found {found}; expected a positive number of cycles/mm");
            return Err(CliError::Input(text));
        }
        let opened = self.lens.open()?;
        self.plot.check([("the lens", self.lens.path())])?;
        opened.ray_model(self.zoom)?;
        self.field.map(|y| opened.field_at(y, self.zoom)).transpose()?;
        let (measured, _) = with_bar(&stop_flag(), "curves", |report| {
            measure_gradients(&opened.lens, self.zoom, self.field, report)
        });
        let blamed = opened.blame_field(self.field, self.zoom);
        let measured = measured.map_err(|e| CliError::Input(format!("{blamed}: {e}")))?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| CliError::Failed(error.to_string()))?;
        let asked = (self.frequency, self.tolerance.0);
        let terms = measure_term_costs(&opened.lens, self.zoom, asked, &pool);
        let terms = terms.map_err(|e| CliError::Input(format!("{}: {e}", opened.file)))?;
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw_curves(&measured, &opened.lens.name)));
        failures.note(output.print(&MeasureGradientReport {
            machine: Machine::detect(),
            lens: opened.file,
            measured,
            terms,
        }));
        failures.into_result()
    }
}

const COLORS: [(DerivativeEstimator, Color); 4] = [
    (DerivativeEstimator::Biased, [0x7f, 0x7f, 0x7f]),
    (DerivativeEstimator::Boundary, [0xd6, 0x27, 0x28]),
    (DerivativeEstimator::Warp, [0x2c, 0xa0, 0x2c]),
    (DerivativeEstimator::Difference, [0x1f, 0x77, 0xb4]),
];
const STROKES: [(Integral, Stroke); 2] =
    [(Integral::Spot, Stroke::Solid), (Integral::Throughput, Stroke::Dashed)];

/// Draws a chart for each field, in `f64`.
fn draw_curves(measured: &GradientBenchmark, title: &str) -> Result<Vec<u8>, ImageError> {
    let chart = |curves: &GradientCurves| {
        let curve = |(estimator, color), (integral, stroke)| {
            let mine = |row: &&GradientRow| {
                row.integral == integral
                    && row.estimator == estimator
                    && row.precision == Precision::F64
            };
            let points = curves.rows.iter().filter(mine).map(|row| [row.ms, row.worst()]);
            ErrorCurve { color, stroke, points: points.collect() }
        };
        let name = format!("field {}, {:.0} % light", ShortNumber(curves.y), 100.0 * curves.light);
        let all = COLORS.into_iter().flat_map(|c| STROKES.map(|s| curve(c, s))).collect();
        ErrorChart { name, curves: all }
    };
    let charts: Vec<ErrorChart> = measured.fields.iter().map(chart).collect();
    let colors = COLORS.map(|(estimator, color)| LegendEntry::colored(estimator.name(), color));
    let strokes = [("spot", Stroke::Solid), ("throughput", Stroke::Dashed)];
    let strokes = strokes.map(|(name, stroke)| LegendEntry::stroked(name, stroke));
    let labels: Vec<LegendEntry> = colors.into_iter().chain(strokes).collect();
    plot::draw(&charts, &labels, title)
}

/// The printed result.
#[derive(Serialize)]
struct MeasureGradientReport {
    machine: Machine,
    lens: String,
    #[serde(flatten)]
    measured: GradientBenchmark,
    terms: TermCosts,
}

impl Display for MeasureGradientReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, lens, measured, terms } = self;
        writeln!(f, "{machine}\n{lens}: relative errors of derivatives, one thread")?;
        for curves in &measured.fields {
            write_curves(f, curves)?;
        }
        writeln!(f, "\ncost of derivatives, relative to the integral or trace itself:\n")?;
        write!(f, "{}", costs(&measured.costs))?;
        let TermCosts { variables, tolerance, frequency, rows } = terms;
        writeln!(
            f,
            "\nterms of a merit, rays good to {tolerance}, contrast at {} cycles/mm; derivatives by all \
             {variables} numbers:\n",
            ShortNumber(*frequency)
        )?;
        write!(f, "{}", term_costs(rows))?;
        let refused = rows.iter().filter_map(|row| Some((row.term, row.refused.as_ref()?)));
        refused.into_iter().try_for_each(|(term, why)| writeln!(f, "{term}: {why}"))
    }
}

fn term_costs(rows: &[TermCost]) -> TextTable {
    let mut table = TextTable::new(&[
        "term",
        "value",
        "error",
        "value ms",
        "with gradient",
        "ratio",
        "gradient error",
        "off differences",
        "variable",
    ]);
    for row in rows.iter().filter(|row| row.refused.is_none()) {
        table.row([
            row.term.to_owned(),
            ShortNumber(row.value).to_string(),
            format!("{:.0e}{}", row.error, if row.reached { "" } else { " not reached" }),
            format!("{:.3}", row.value_ms),
            format!("{:.3}", row.gradient_ms),
            format!("{:.2}", row.gradient_ms / row.value_ms),
            row.gradient_error.map_or("-".to_owned(), |error| format!("{error:.0e}")),
            format!("{:.0e}", row.difference),
            row.at.clone().unwrap_or_default(),
        ]);
    }
    table
}

fn write_curves(f: &mut fmt::Formatter<'_>, curves: &GradientCurves) -> fmt::Result {
    let GradientCurves { y, light, planned, reason, reference, checked, .. } = curves;
    let light = 100.0 * light;
    writeln!(f, "\nfield {}, {light:.1} % of the light on the axis", ShortNumber(*y))?;
    writeln!(f, "planned: {planned}, because {reason}")?;
    let check = match reference {
        DerivativeEstimator::Warp => "its standard error",
        _ => "central differences differ by",
    };
    let [spot, throughput] = checked;
    writeln!(
        f,
        "reference: {reference}; {check} {spot:.0e} (spot), {throughput:.0e} (throughput)"
    )?;
    for (integral, name) in [(Integral::Spot, "spot"), (Integral::Throughput, "throughput")] {
        let rows = curves.rows.iter().filter(|row| row.integral == integral);
        write!(f, "\n{}", table(name, rows))?;
    }
    Ok(())
}

fn table<'a>(name: &str, rows: impl Iterator<Item = &'a GradientRow>) -> TextTable {
    let kinds = ["curvature", "conic", "asphere", "thickness", "index", "semi-d."];
    let rows: Vec<&GradientRow> = rows.collect();
    let used = |i: &usize| rows.iter().any(|row| row.errors[*i].is_some());
    let columns: Vec<usize> = (0..kinds.len()).filter(used).collect();
    let head = [name, "rays", "ms"].into_iter().chain(columns.iter().map(|i| kinds[*i]));
    let mut table = TextTable::new(&head.collect::<Vec<_>>());
    for row in rows {
        let precision = if row.precision == Precision::F32 { " f32" } else { "" };
        let start = [
            format!("{}{precision}", row.estimator),
            row.rays.to_string(),
            format!("{:.3}", row.ms),
        ];
        let error = |i: &usize| row.errors[*i].map_or("-".to_owned(), |e| format!("{e:.1e}"));
        table.row(start.into_iter().chain(columns.iter().map(error)));
    }
    table
}

fn costs(costs: &[GradientCost]) -> TextTable {
    let mut table = TextTable::new(&[
        "surfaces",
        "numbers",
        "integral ms",
        "boundary",
        "difference",
        "warp/trace",
        "in f32",
    ]);
    for cost in costs {
        let times = |times: f64| format!("{times:.2}");
        table.row([
            cost.surfaces.to_string(),
            cost.numbers.to_string(),
            format!("{:.3}", cost.integral_ms),
            cost.boundary.map_or("-".to_owned(), times),
            times(cost.difference),
            times(cost.warp),
            times(cost.warp_single),
        ]);
    }
    table
}
