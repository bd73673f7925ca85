//! `measure spot`: accuracy of a spot against time.

use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::LensFile;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{stop_flag, with_bar};
use crate::measure::{
    Machine, Precision, PupilClipping, PupilSampling, SpotCurves, SpotRow, measure_spot_curves,
};
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};

/// Error against milliseconds of every sampling of a pupil, clear and clipped, in f32 and f64
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_spot.txt"))]
pub(super) struct MeasureSpotArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The field, in the unit of the lens's fields; absent: 0.7 of the farthest one
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    #[command(flatten)]
    plot: PlotArgs,
}

/// The default field relative to the farthest one: neither the axis nor the corner.
const DEFAULT_ZONE: f64 = 0.7;

impl MeasureSpotArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let opened = self.lens.open()?;
        self.plot.check([("the lens", self.lens.path())])?;
        let model = opened.ray_model(self.zoom)?;
        let field =
            opened.field_at(self.field.unwrap_or(DEFAULT_ZONE * model.beam.edge), self.zoom)?;
        let (curves, stopped) = with_bar(&stop_flag(), "curves", |report| {
            measure_spot_curves(&opened.lens, self.zoom, field, report)
        });
        let blamed = opened.blame_field(self.field, self.zoom);
        let curves =
            curves.map_err(|e| CliError::Input(format!("{blamed}: field {}: {e}", field.y)))?;
        if curves.rms_clipped.is_none() && !stopped {
            return Err(CliError::no_light(&blamed));
        }
        let title = format!("{}, field {}", opened.lens.name, ShortNumber(field.y));
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw_curves(&curves, &title)));
        failures.note(output.print(&MeasureSpotReport {
            machine: Machine::detect(),
            lens: opened.file,
            y: field.y,
            curves,
        }));
        failures.into_result()
    }
}

const COLORS: [(PupilSampling, Color); 6] = [
    (PupilSampling::SquareGrid, [0x1f, 0x77, 0xb4]),
    (PupilSampling::Hexapolar, [0x8c, 0x56, 0x4b]),
    (PupilSampling::Random, [0x7f, 0x7f, 0x7f]),
    (PupilSampling::LowDiscrepancy, [0x2c, 0xa0, 0x2c]),
    (PupilSampling::Gauss, [0xff, 0x7f, 0x0e]),
    (PupilSampling::SplitBoundary, [0xd6, 0x27, 0x28]),
];
const STROKES: [(Precision, Stroke); 2] =
    [(Precision::F64, Stroke::Solid), (Precision::F32, Stroke::Dashed)];

/// Draws the clear pupil beside the clipped one.
fn draw_curves(curves: &SpotCurves, title: &str) -> Result<Vec<u8>, ImageError> {
    let chart = |pupil| {
        let name = match pupil {
            PupilClipping::Clear => "clear pupil".to_owned(),
            PupilClipping::Clipped => {
                format!("clipped pupil, {:.0} % transmitted", 100.0 * curves.transmitted)
            }
        };
        let curve = |(method, color), (precision, stroke)| {
            let mine = |row: &&SpotRow| {
                row.pupil == pupil && row.method == method && row.precision == precision
            };
            let points = curves.rows.iter().filter(mine).map(|row| [row.ms, row.error]).collect();
            ErrorCurve { color, stroke, points }
        };
        let all = COLORS.into_iter().flat_map(|c| STROKES.map(|s| curve(c, s))).collect();
        ErrorChart { name, curves: all }
    };
    let colors = COLORS.map(|(method, color)| LegendEntry::colored(method.name(), color));
    let strokes = [("f64", Stroke::Solid), ("f32", Stroke::Dashed)];
    let strokes = strokes.map(|(name, stroke)| LegendEntry::stroked(name, stroke));
    let labels: Vec<LegendEntry> = colors.into_iter().chain(strokes).collect();
    plot::draw(&[chart(PupilClipping::Clear), chart(PupilClipping::Clipped)], &labels, title)
}

/// The printed result.
#[derive(Serialize)]
struct MeasureSpotReport {
    machine: Machine,
    lens: String,
    y: f64,
    #[serde(flatten)]
    curves: SpotCurves,
}

impl Display for MeasureSpotReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, lens, y, curves } = self;
        writeln!(
            f,
            "{machine}\n{lens}, field {}: relative error of the RMS radius",
            ShortNumber(*y)
        )?;
        for pupil in [PupilClipping::Clear, PupilClipping::Clipped] {
            let (title, rms) = match pupil {
                PupilClipping::Clear => ("clear pupil".to_owned(), Some(curves.rms_clear)),
                PupilClipping::Clipped => {
                    let percent = 100.0 * curves.transmitted;
                    let title = format!("clipped pupil, {percent:.1} % of the disc transmitted");
                    (title, curves.rms_clipped)
                }
            };
            match rms {
                Some(rms) => writeln!(f, "\n{title}; RMS radius {} mm", ShortNumber(rms))?,
                None if curves.stopped => {
                    writeln!(f, "\nclipped pupil: stopped before it was reached")?;
                }
                None => writeln!(f, "\n{title}: no light is transmitted")?,
            }
            write!(f, "{}", table(curves, pupil))?;
        }
        Ok(())
    }
}

fn table(curves: &SpotCurves, pupil: PupilClipping) -> TextTable {
    let mut table = TextTable::new(&["", "rays", "f64 error", "ms", "f32 error", "ms"]);
    let of = |precision| move |row: &&SpotRow| row.pupil == pupil && row.precision == precision;
    let single: Vec<&SpotRow> = curves.rows.iter().filter(of(Precision::F32)).collect();
    for row in curves.rows.iter().filter(of(Precision::F64)) {
        let same = |other: &&&SpotRow| other.method == row.method && other.rays == row.rays;
        let pair = |row: &SpotRow| [format!("{:.1e}", row.error), format!("{:.4}", row.ms)];
        let other = single.iter().find(same).map_or_else(Default::default, |row| pair(row));
        let start = [row.method.name().to_owned(), row.rays.to_string()];
        table.row(start.into_iter().chain(pair(row)).chain(other));
    }
    table
}
