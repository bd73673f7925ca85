//! Accuracy of a spot against time.

use super::plot::{self, Chart, Color, Curve, Label, Stroke};
use crate::cli::failure::Failure;
use crate::cli::input::{LensFile, check_target};
use crate::cli::output::{Number, Output, Table};
use crate::files;
use crate::measure::{Machine, Precision, Pupil, Sampling, SpotCurves, SpotRow, spot_curves};
use image::ImageError;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Error against milliseconds of every way to sample a pupil, clear and clipped, f32 and f64
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_spot.txt"))]
pub(super) struct Spot {
    #[command(flatten)]
    lens: LensFile,

    /// The field, in the unit of the lens's fields; 0.7 of the farthest one where it is absent
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// Draws the curves
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
}

/// A usual place to look: neither the axis nor the corner.
const ZONE: f64 = 0.7;

impl Spot {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let opened = self.lens.open()?;
        self.plot.iter().try_for_each(|path| check_target(path, &["png"]))?;
        let bench = opened.bench(self.zoom)?;
        let field = opened.field(self.field.unwrap_or(ZONE * bench.beam.edge), self.zoom)?;
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} curves");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let curves = spot_curves(&opened.lens, self.zoom, field, |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        });
        bar.finish_and_clear();
        let curves = curves
            .map_err(|e| Failure::Input(format!("{}, field {}: {e}", opened.file, field.y)))?;
        if let Some(path) = &self.plot {
            let title = format!("{}, field {}", opened.lens.name, Number(field.y));
            let png = picture(&curves, &title).map_err(|e| Failure::Failed(e.to_string()))?;
            files::replace(path, &png)?;
        }
        output.print(&Report { machine: Machine::here(), lens: opened.file, y: field.y, curves })
    }
}

const COLORS: [(Sampling, Color); 6] = [
    (Sampling::SquareGrid, [0x1f, 0x77, 0xb4]),
    (Sampling::Hexapolar, [0x8c, 0x56, 0x4b]),
    (Sampling::Random, [0x7f, 0x7f, 0x7f]),
    (Sampling::LowDiscrepancy, [0x2c, 0xa0, 0x2c]),
    (Sampling::Gauss, [0xff, 0x7f, 0x0e]),
    (Sampling::SplitBoundary, [0xd6, 0x27, 0x28]),
];
const STROKES: [(Precision, Stroke); 2] =
    [(Precision::F64, Stroke::Solid), (Precision::F32, Stroke::Dashed)];

/// The clear pupil beside the clipped one.
fn picture(curves: &SpotCurves, title: &str) -> Result<Vec<u8>, ImageError> {
    let chart = |pupil| {
        let name = match pupil {
            Pupil::Clear => "clear pupil".to_owned(),
            Pupil::Clipped => format!("clipped pupil, {:.0} % lit", 100.0 * curves.lit),
        };
        let curve = |(method, color), (precision, stroke)| {
            let mine = |row: &&SpotRow| {
                row.pupil == pupil && row.method == method && row.precision == precision
            };
            let points = curves.rows.iter().filter(mine).map(|row| [row.ms, row.error]).collect();
            Curve { color, stroke, points }
        };
        let all = COLORS.into_iter().flat_map(|c| STROKES.map(|s| curve(c, s))).collect();
        Chart { name, curves: all }
    };
    let colors = COLORS.map(|(method, color)| Label::of(method.name(), color));
    let strokes = [("f64", Stroke::Solid), ("f32", Stroke::Dashed)];
    let strokes = strokes.map(|(name, stroke)| Label::drawn(name, stroke));
    let labels: Vec<Label> = colors.into_iter().chain(strokes).collect();
    plot::draw(&[chart(Pupil::Clear), chart(Pupil::Clipped)], &labels, title)
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    lens: String,
    y: f64,
    #[serde(flatten)]
    curves: SpotCurves,
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, lens, y, curves } = self;
        writeln!(f, "{machine}\n{lens}, field {}: relative error of the RMS radius", Number(*y))?;
        for pupil in [Pupil::Clear, Pupil::Clipped] {
            let (title, rms) = match pupil {
                Pupil::Clear => ("clear pupil".to_owned(), Some(curves.rms_clear)),
                Pupil::Clipped => {
                    let lit = 100.0 * curves.lit;
                    (format!("clipped pupil, {lit:.1} % of the disc lit"), curves.rms_clipped)
                }
            };
            match rms {
                Some(rms) => writeln!(f, "\n{title}; RMS radius {} mm", Number(rms))?,
                None => writeln!(f, "\n{title}: no light gets through")?,
            }
            write!(f, "{}", table(curves, pupil))?;
        }
        Ok(())
    }
}

fn table(curves: &SpotCurves, pupil: Pupil) -> Table {
    let mut table = Table::new(&["", "rays", "f64 error", "ms", "f32 error", "ms"]);
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
