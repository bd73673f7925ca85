//! `measure psf`: the point spread by diffraction, its error and its time.

use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::analysis::AnalysisError;
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::lens::FieldPoint;
use crate::measure::{AccuracyPoint, Machine, point_spread_accuracy};
use crate::pupil::RayModel;
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};
use std::sync::atomic::Ordering;

/// Error and milliseconds of the point spread by diffraction, on one core
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_psf.txt"))]
pub(super) struct MeasurePsfArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    #[command(flatten)]
    plot: PlotArgs,
}

/// The parts of the farthest field, each with its colour in the drawing.
const ZONES: [(f64, &str, Color); 3] = [
    (0.0, "axis", [0x2c, 0xa0, 0x2c]),
    (0.7, "0.7 of the field", [0x1f, 0x77, 0xb4]),
    (1.0, "edge", [0xd6, 0x27, 0x28]),
];

impl MeasurePsfArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.plot.check([("the lens", self.lens.path())])?;
        let opened = self.lens.open()?;
        let model = opened.ray_model(self.zoom)?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| CliError::Failed(error.to_string()))?;
        let stop = stop_flag();
        let curve = |(zone, ..): (f64, &str, Color)| {
            let y = zone * model.beam.edge;
            FieldCurve::measure(&model, y, &|| stop.load(Ordering::Relaxed))
        };
        let fields = pool.install(|| ZONES.into_iter().map(curve).collect());
        note_if_stopped(&stop);
        let um = model.channels[model.primary].um;
        let report =
            MeasurePsfReport { machine: Machine::detect(), lens: opened.file.clone(), um, fields };
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw(&report.fields, &opened.lens.name)));
        failures.note(output.print(&report));
        failures.into_result()
    }
}

/// The curve of a field, or why there is none.
#[derive(Serialize)]
struct FieldCurve {
    /// In the unit of the lens.
    y: f64,
    rows: Vec<AccuracyPoint>,
    refused: Option<String>,
}

impl FieldCurve {
    fn measure(model: &RayModel, y: f64, interrupted: &(dyn Fn() -> bool + Sync)) -> Self {
        let field = FieldPoint { x: 0.0, y, weight: 1.0 };
        let found: Result<_, AnalysisError> =
            point_spread_accuracy(model, field, model.primary, interrupted);
        match found {
            Ok(rows) => Self { y, rows, refused: None },
            Err(why) => Self { y, rows: Vec::new(), refused: Some(why.to_string()) },
        }
    }
}

/// The printed result.
#[derive(Serialize)]
struct MeasurePsfReport {
    machine: Machine,
    lens: String,
    um: f64,
    fields: Vec<FieldCurve>,
}

fn draw(fields: &[FieldCurve], title: &str) -> Result<Vec<u8>, ImageError> {
    let curve = |(field, (_, _, color)): (&FieldCurve, (f64, &str, Color))| {
        let points = field.rows.iter().map(|row| [row.ms, row.error]).collect();
        ErrorCurve { color, stroke: Stroke::Solid, points }
    };
    let curves = fields.iter().zip(ZONES).map(curve).collect();
    let chart = ErrorChart { name: title.to_owned(), curves };
    let labels = ZONES.map(|(_, name, color)| LegendEntry::colored(name, color));
    plot::draw(&[chart], &labels, "point spread: absolute error against time")
}

impl Display for MeasurePsfReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        writeln!(
            f,
            "{}: point spread at 24 x 24 points within four Airy radii, {} um, one core\n",
            self.lens,
            ShortNumber(self.um)
        )?;
        let mut table = TextTable::new(&["field", "tolerance", "error", "stated", "rays", "ms"]);
        for field in &self.fields {
            field.rows.iter().for_each(|row| table.row(cells(field.y, row)));
        }
        write!(f, "{table}")?;
        let refused =
            self.fields.iter().filter_map(|field| Some((field.y, field.refused.as_ref()?)));
        for (y, why) in refused {
            writeln!(f, "field {}: {why}", ShortNumber(y))?;
        }
        Ok(())
    }
}

fn cells(y: f64, row: &AccuracyPoint) -> Vec<String> {
    vec![
        ShortNumber(y).to_string(),
        format!("{:.0e}", row.tolerance),
        format!("{:.1e}", row.error),
        format!("{:.1e}{}", row.stated, if row.reached { "" } else { " not reached" }),
        row.rays.to_string(),
        format!("{:.2}", row.ms),
    ]
}
