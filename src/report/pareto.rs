//! A front of sharpness against light as files: a table, a plot, and each of its lenses.
//!
//! The window and the command line write the same folder: `front.csv`, `front.png`, `start.json`,
//! and `front_001.json` … in the order of increasing light, which is that of the table;
//! `biased_001.json` … if a front with frozen pupils is reported with it.

use crate::files::{self, FileError};
use crate::lens::{Lens, Wavelength};
use crate::optimize::pareto::{Front, ParetoPoint};
use crate::plot::{Axis, BLACK, Canvas, Chart, Color, GRID, Legend, PALETTE, Stroke, TextAlign};
use std::io;
use std::path::{Path, PathBuf};

/// A Pareto front with its starting lens and a front to compare with.
#[derive(Debug, Clone, Copy)]
pub struct ParetoReport<'a> {
    /// The name of the lens.
    pub name: &'a str,
    /// The wavelengths that the lenses of the report are written with.
    pub wavelengths: &'a [Wavelength],
    /// The starting lens.
    pub start: &'a ParetoPoint,
    /// The front.
    pub front: &'a Front,
    /// The spot in mm and the light in mm² of all lenses evaluated; may be empty.
    pub tried: &'a [[f64; 2]],
    /// The front found with frozen pupils, that is with biased derivatives.
    pub biased: Option<&'a Front>,
}

/// The head of the table.
const HEAD: &str = "spot_mm,spot_error_mm,light_mm2,light_error_mm2,weight_mm2,min_light_mm2,as_built_mm,rays,file\n";
/// The width and height of the plot in pixels, and its margins: left, top, right, bottom.
const SIZE: [u32; 2] = [1000, 720];
const MARGINS: [f64; 4] = [110.0, 200.0, 40.0, 90.0];
/// The place of the legend: above the chart, where it hides nothing.
const LEGEND: [f64; 2] = [MARGINS[0] + 18.0, 36.0];
/// The place of the name of the lens, in the middle.
const NAME: [f64; 2] = [500.0, 10.0];

/// The colour of the biased front.
const BIASED: Color = PALETTE[3];

impl ParetoReport<'_> {
    /// Writes the report into a folder, which is created if it does not exist. Returns the files,
    /// the table first. Files of the same names are replaced, all others stay, see
    /// [`ParetoReport::stale_files`].
    ///
    /// # Errors
    /// A folder or a file that cannot be written; files written before remain.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let unwritable =
            |source| FileError::Unwritable { file: folder.display().to_string(), source };
        std::fs::create_dir_all(folder).map_err(unwritable)?;
        let mut written = vec![folder.join("front.csv"), folder.join("front.png")];
        // The picture can be drawn again from the table, and the table be computed from the lenses.
        for (name, design) in self.lenses() {
            let path = folder.join(name);
            let wavelengths = self.wavelengths.to_vec();
            files::save(&Lens { wavelengths, ..design.lens.clone() }, &path)?;
            written.push(path);
        }
        files::write_atomic(&written[0], self.table().as_bytes())?;
        let plot = self.plot().png().map_err(|why| unwritable(io::Error::other(why)))?;
        files::write_atomic(&written[1], &plot)?;
        Ok(written)
    }

    /// True for the name of a file of a report, of this one or of another.
    pub fn is_own_file(name: &str) -> bool {
        let numbered = |set: &str| {
            let number = name.strip_prefix(set).and_then(|rest| rest.strip_suffix(".json"));
            number.is_some_and(|n| n.len() >= 3 && n.bytes().all(|c| c.is_ascii_digit()))
        };
        let fixed = ["front.csv", "front.png", "start.json"];
        fixed.contains(&name) || ["front_", "biased_"].into_iter().any(numbered)
    }

    /// The files of an earlier report that remain in a folder into which this one was written.
    pub fn stale_files(&self, folder: &Path) -> Vec<PathBuf> {
        let fixed = ["front.csv", "front.png"].map(str::to_owned);
        let names = self.lenses().into_iter().map(|(name, _)| name).chain(fixed);
        let written: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
        files::stale_files(folder, &written, Self::is_own_file)
    }

    /// The numbers as comma-separated values, a line for every lens: the start, the front, the
    /// biased front. A lens has the weight or the light that was asked for, the one at the start neither.
    pub fn table(&self) -> String {
        let mut text = HEAD.to_owned();
        for (file, design) in self.lenses() {
            let ParetoPoint { spot, spot_error, light, light_error, rays, .. } = design;
            let number = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
            let as_built = design.as_built.map(|as_built| as_built.value);
            let asked = [design.weight, design.min_light, as_built].map(number).join(",");
            let numbers = format!("{spot},{spot_error},{light},{light_error},{asked},{rays}");
            text.extend([numbers.as_str(), ",", file.as_str(), "\n"]);
        }
        text
    }

    /// All lenses with the names of their files.
    fn lenses(&self) -> Vec<(String, &ParetoPoint)> {
        let biased = self.biased.map_or(&[][..], Front::points);
        let mut all = vec![("start.json".to_owned(), self.start)];
        for (set, designs) in [("front", self.front.points()), ("biased", biased)] {
            let name = |i: usize| format!("{set}_{:03}.json", i + 1);
            all.extend(designs.iter().enumerate().map(|(i, design)| (name(i), design)));
        }
        all
    }

    /// Spot against light: the front over all lenses evaluated, and the biased front in orange.
    pub fn plot(&self) -> Canvas {
        let mut canvas = Canvas::new(SIZE);
        let (front, start) = (places(self.front.points()), place(self.start));
        let biased = places(self.biased.map_or(&[], Front::points));
        let is_as_built = self.start.as_built.is_some();
        let chart = chart(&[&front, &biased, &[start]], is_as_built);
        let room = SIZE[0] as usize - 20;
        let name = shortened(self.name, Canvas::letters(room));
        canvas.text(NAME, &name, BLACK, TextAlign::Middle);
        chart.draw(&mut canvas, "Sharpness against light");
        for [spot, light] in self.tried {
            let at = [*light, 1e3 * spot];
            if chart.contains(at) {
                canvas.square(chart.to_pixel(at), 1, GRID);
            }
        }
        for (points, color) in [(&biased, BIASED), (&front, PALETTE[1])] {
            let points = chart.to_pixels(points);
            canvas.marked_curve(&points, color, Stroke::Solid);
        }
        canvas.markers(&chart.to_pixels(&[start]), BLACK);
        self.legend(&mut canvas);
        canvas
    }

    fn legend(&self, canvas: &mut Canvas) {
        let volume =
            |front: &Front| format!("hypervolume {:.4}", front.relative_hypervolume(self.start));
        let mut lines: Vec<(String, Color)> = vec![
            ("start".to_owned(), BLACK),
            (format!("front, {}", volume(self.front)), PALETTE[1]),
        ];
        lines.extend(self.biased.map(|front| (format!("fixed pupils, {}", volume(front)), BIASED)));
        let mut legend = Legend::new(LEGEND);
        for (text, color) in &lines {
            legend.marker(canvas, text, *color);
        }
    }
}

/// A text of at most this number of letters, the last three of a longer one dots.
fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    text.chars().take(letters.saturating_sub(3)).chain("...".chars()).collect()
}

/// The chart, with axes that contain the fronts and the start but not all lenses evaluated.
fn chart(shown: &[&[[f64; 2]]], is_as_built: bool) -> Chart {
    let radius = if is_as_built { "RMS spot as built, um" } else { "RMS spot, um" };
    let all = || shown.iter().flat_map(|points| points.iter());
    let x = Axis::linear("light, mm^2", all().map(|point| point[0]));
    let y = Axis::linear(radius, all().map(|point| point[1]).chain([0.0]));
    let [left, top, right, bottom] = MARGINS;
    let [width, height] = SIZE.map(f64::from);
    Chart::new([left, top], [width - right, height - bottom], x, y)
}

/// Light in mm² and spot in µm.
fn place(design: &ParetoPoint) -> [f64; 2] {
    [design.light, 1e3 * design.radius()]
}

fn places(designs: &[ParetoPoint]) -> Vec<[f64; 2]> {
    designs.iter().map(place).collect()
}
