//! `measure picture`: pictures, their errors and their times.

use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{LensFile, LoadedLens};
use crate::cli::output::{Output, TextTable};
use crate::cli::picture::{DeviceChoice, parse_pixels};
use crate::cli::progress::{stop_flag, with_bar};
use crate::measure::{Machine, PictureCurves, PictureRow, PictureWay, measure_picture};
use crate::picture::BuiltInScene;
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Error and milliseconds of pictures, the quick way and the exact one
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_picture.txt"))]
pub(super) struct MeasurePictureArgs {
    /// The lenses: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS", required = true)]
    lenses: Vec<PathBuf>,

    /// The scene: white, target, star, edge, checkerboard or lights
    #[arg(long, value_name = "SCENE", default_value = "star")]
    scene: String,

    /// The columns and rows of the picture
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = parse_pixels)]
    pixels: [usize; 2],

    /// The columns and rows that the exact way is timed on; its time is scaled to those of the picture
    #[arg(long, value_name = "WxH", default_value = "240x135", value_parser = parse_pixels)]
    exact_pixels: [usize; 2],

    /// The device of the quick way: auto (a graphics card where there is one), gpu or cpu
    #[arg(long, value_name = "DEVICE", default_value = "auto")]
    device: DeviceChoice,

    #[command(flatten)]
    plot: PlotArgs,
}

impl MeasurePictureArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let scene = self.scene()?;
        self.device.install()?;
        self.plot.check(self.lenses.iter().map(|path| ("the lens", path.as_path())))?;
        let open = |path: &PathBuf| LensFile::of(path).open();
        let opened: Vec<LoadedLens> = self.lenses.iter().map(open).collect::<Result<_, _>>()?;
        let rows: Result<Vec<_>, CliError> =
            opened.iter().map(|opened| self.measure(opened, scene)).collect();
        let report = MeasurePictureReport { machine: Machine::detect(), lenses: rows? };
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw(&report.lenses)));
        failures.note(output.print(&report));
        failures.into_result()
    }

    fn scene(&self) -> Result<BuiltInScene, CliError> {
        let mut flat = BuiltInScene::ALL.into_iter().filter(|(scene, _)| !scene.has_depth());
        if let Some((scene, _)) = flat.clone().find(|(_, name)| *name == self.scene) {
            return Ok(scene);
        }
        let first = flat.next().map_or("", |(_, name)| name);
        let names = flat.fold(first.to_owned(), |all, (_, name)| format!("{all}, {name}"));
        let text = format!("--scene: no scene `{}`; expected one of {names}", self.scene);
        Err(CliError::Input(text))
    }

    fn measure(&self, opened: &LoadedLens, scene: BuiltInScene) -> Result<LensPictures, CliError> {
        let pixels = [self.pixels, self.exact_pixels];
        let (found, _) = with_bar(&stop_flag(), "pictures", |report| {
            measure_picture(&opened.lens, scene, pixels, report)
        });
        let curves = found.map_err(|why| CliError::Input(format!("{}: {why}", opened.file)))?;
        Ok(LensPictures { lens: opened.file.clone(), name: opened.lens.name.clone(), curves })
    }
}

/// The pictures of a lens.
#[derive(Serialize)]
struct LensPictures {
    lens: String,
    #[serde(skip)]
    name: String,
    #[serde(flatten)]
    curves: PictureCurves,
}

/// The printed result.
#[derive(Serialize)]
struct MeasurePictureReport {
    machine: Machine,
    lenses: Vec<LensPictures>,
}

const COLORS: [(PictureWay, Color); 2] =
    [(PictureWay::Quick, [0x2c, 0xa0, 0x2c]), (PictureWay::Exact, [0xd6, 0x27, 0x28])];

fn name(way: PictureWay) -> &'static str {
    match way {
        PictureWay::First => "first after an edit",
        PictureWay::Quick => "quick",
        PictureWay::Exact => "exact",
    }
}

/// Draws the first two lenses side by side.
fn draw(lenses: &[LensPictures]) -> Result<Vec<u8>, ImageError> {
    let chart = |lens: &LensPictures| {
        let curve = |(way, color)| {
            let rows = lens.curves.rows.iter().filter(|row| row.way == way);
            let points = rows.filter_map(|row| Some([row.whole_ms, row.error?])).collect();
            ErrorCurve { color, stroke: Stroke::Solid, points }
        };
        ErrorChart { name: lens.name.clone(), curves: COLORS.into_iter().map(curve).collect() }
    };
    let charts: Vec<ErrorChart> = lenses.iter().take(2).map(chart).collect();
    let labels = COLORS.map(|(way, color)| LegendEntry::colored(name(way), color));
    plot::draw(&charts, &labels, "pictures: error as a share of mid grey against time")
}

impl Display for MeasurePictureReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        for LensPictures { lens, curves, .. } in &self.lenses {
            let [width, height] = curves.pixels;
            let (scene, prepare) = (curves.scene, curves.prepare_ms);
            writeln!(f, "\n{lens}: {scene}, {width} x {height} pixels in three colours")?;
            let device = curves.device.as_deref().unwrap_or("the processor");
            writeln!(f, "the quick way on {device}")?;
            writeln!(f, "{prepare:.0} ms before the first pixel, counted in every whole picture")?;
            let head = ["", "tolerance", "error", "pixels", "ms", "ms of the whole", ""];
            let mut table = TextTable::new(&head);
            curves.rows.iter().for_each(|row| table.row(cells(row)));
            write!(f, "{table}")?;
        }
        Ok(())
    }
}

fn cells(row: &PictureRow) -> Vec<String> {
    let percent = |share: Option<f64>| {
        share.map_or_else(|| "-".to_owned(), |share| format!("{:.2} %", 100.0 * share))
    };
    vec![
        name(row.way).to_owned(),
        percent(row.tolerance),
        percent(row.error),
        format!("{}x{}", row.pixels[0], row.pixels[1]),
        format!("{:.0}", row.ms),
        format!("{:.0}", row.whole_ms),
        if row.reached { String::new() } else { "not reached".to_owned() },
    ]
}
