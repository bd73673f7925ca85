//! A front as files: a table of its numbers, a picture, and each of its lenses.
//!
//! One function for the window and the command line, so that both write the same folder:
//! `front.csv`, `front.png`, `start.json`, and `front_001.json` … by growing light, in the order of
//! the table; `biased_001.json` … where a front that was found with kept pupils stands beside it.

use crate::files::{self, FileError};
use crate::optimize::pareto::{Front, ParetoPoint};
use crate::picture::{Axis, BLACK, Canvas, Chart, Color, GREY, GRID, PALETTE, Stroke, TextAlign};
use std::io;
use std::path::{Path, PathBuf};

/// A front with what it is compared to.
#[derive(Debug, Clone, Copy)]
pub struct ParetoReport<'a> {
    /// What the lens is called.
    pub name: &'a str,
    /// The lens that the search has started from.
    pub start: &'a ParetoPoint,
    /// What was found.
    pub front: &'a Front,
    /// Spot in mm and light in mm² of the lenses that were looked at; may be empty.
    pub tried: &'a [[f64; 2]],
    /// What the same search finds when the derivatives keep the pupils as they are.
    pub biased: Option<&'a Front>,
}

/// How much larger than at the start a spot may be to count for the hypervolume.
const REFERENCE: f64 = 2.0;
/// The head of the table.
const HEAD: &str = "spot_mm,spot_error_mm,light_mm2,light_error_mm2,weight_mm2,rays,file\n";
/// Width and height of the picture, in pixels, and its margins: left, top, right, bottom.
const SIZE: [u32; 2] = [1000, 720];
const MARGINS: [f64; 4] = [110.0, 110.0, 40.0, 90.0];
/// From one line of the legend to the next, in pixels.
const LINE: f64 = 22.0;

/// The area that a front covers, in multiples of the spot of the lens at the start times its
/// light, against twice that spot.
pub fn hypervolume(front: &Front, start: &ParetoPoint) -> f64 {
    front.hypervolume(REFERENCE * start.spot, start.light)
}

/// Writes a front into a folder, which is made if it is not there. Returns the files, the table
/// first. Files of the same names are replaced, all others stay.
///
/// # Errors
/// A folder or a file that cannot be written; what was written before stays.
pub fn write(survey: &ParetoReport<'_>, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let unwritable = |source| FileError::Unwritable { file: folder.display().to_string(), source };
    std::fs::create_dir_all(folder).map_err(unwritable)?;
    let picture = survey.picture().png().map_err(|why| unwritable(io::Error::other(why)))?;
    let mut written = vec![folder.join("front.csv"), folder.join("front.png")];
    files::write_atomic(&written[1], &picture)?;
    for (name, design) in survey.lenses() {
        let path = folder.join(name);
        files::save(&design.lens, &path)?;
        written.push(path);
    }
    // The table names the other files: it comes when they are there.
    files::write_atomic(&written[0], survey.table().as_bytes())?;
    Ok(written)
}

impl ParetoReport<'_> {
    /// The numbers as comma-separated values, a line for every lens: the start, the front, the
    /// biased front. The lens at the start has no weight.
    pub fn table(&self) -> String {
        let mut text = HEAD.to_owned();
        for (file, design) in self.lenses() {
            let ParetoPoint { spot, spot_error, light, light_error, rays, .. } = design;
            let weight = design.weight.map(|weight| weight.to_string()).unwrap_or_default();
            let numbers = format!("{spot},{spot_error},{light},{light_error},{weight},{rays}");
            text.extend([numbers.as_str(), ",", file.as_str(), "\n"]);
        }
        text
    }

    /// Every lens with the name of its file.
    fn lenses(&self) -> Vec<(String, &ParetoPoint)> {
        let biased = self.biased.map_or(&[][..], Front::points);
        let mut all = vec![("start.json".to_owned(), self.start)];
        for (set, designs) in [("front", self.front.points()), ("biased", biased)] {
            let name = |i: usize| format!("{set}_{:03}.json", i + 1);
            all.extend(designs.iter().enumerate().map(|(i, design)| (name(i), design)));
        }
        all
    }

    /// Spot against light: the front over all that was tried, and the biased front in grey.
    pub fn picture(&self) -> Canvas {
        let mut canvas = Canvas::new(SIZE);
        let (front, start) = (places(self.front.points()), place(self.start));
        let biased = places(self.biased.map_or(&[], Front::points));
        let chart = chart(&[&front, &biased, &[start]]);
        chart.draw(&mut canvas, &format!("Sharpness against light: {}", self.name));
        for [spot, light] in self.tried {
            let at = [*light, 1e3 * spot];
            if chart.contains(at) {
                canvas.square(chart.to_pixel(at), 1, GRID);
            }
        }
        for (points, color) in [(&biased, GREY), (&front, PALETTE[1])] {
            let points = chart.to_pixels(points);
            canvas.curve(&points, color, Stroke::Solid);
            canvas.markers(&points, color);
        }
        canvas.markers(&chart.to_pixels(&[start]), BLACK);
        self.legend(&mut canvas);
        canvas
    }

    fn legend(&self, canvas: &mut Canvas) {
        let volume = |front: &Front| format!("hypervolume {:.4}", hypervolume(front, self.start));
        let mut lines: Vec<(String, Color)> = vec![
            ("start".to_owned(), BLACK),
            (format!("front, {}", volume(self.front)), PALETTE[1]),
        ];
        lines.extend(self.biased.map(|front| (format!("pupils kept, {}", volume(front)), GREY)));
        for (i, (text, color)) in lines.iter().enumerate() {
            let y = MARGINS[1] + 12.0 + LINE * i as f64;
            canvas.square([MARGINS[0] + 18.0, y + 7.0], 4, *color);
            canvas.text([MARGINS[0] + 32.0, y], text, BLACK, TextAlign::Left);
        }
    }
}

/// The axes: around the fronts and the start, not around all that was tried on the way.
fn chart(shown: &[&[[f64; 2]]]) -> Chart {
    let all = || shown.iter().flat_map(|points| points.iter());
    let x = Axis::linear("light, mm^2", all().map(|point| point[0]));
    let y = Axis::linear("RMS spot, um", all().map(|point| point[1]).chain([0.0]));
    let [left, top, right, bottom] = MARGINS;
    let [width, height] = SIZE.map(f64::from);
    Chart::new([left, top], [width - right, height - bottom], x, y)
}

/// Light in mm² and spot in µm.
fn place(design: &ParetoPoint) -> [f64; 2] {
    [design.light, 1e3 * design.spot]
}

fn places(designs: &[ParetoPoint]) -> Vec<[f64; 2]> {
    designs.iter().map(place).collect()
}
