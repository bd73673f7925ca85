//! Exact answers for pictures through a lens, kind by kind, beside what the program finds.
//!
//! The answers come in a file with bounds of their own: ten times the error that it states for an integral, at least
//! 1e-9; 1e-8 waves for path differences; a few units in the last place of what it prints for closed forms. Every
//! number of a kind is compared with the functions that commands print the numbers of, at a tolerance below these
//! bounds. A number that is refused breaks its bound.

mod books;
mod entry;
mod ghosts;
mod image_lens;
mod lenses;
mod light;

pub use entry::{ImageEntry, ImageFileError};
pub use image_lens::{ImageField, ImageLens};

use serde::Serialize;
use serde_json::Value;
use std::fmt::Display;
use std::ops::ControlFlow;

/// The numbers of a kind, and the one that is farthest from its exact value by its bound.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageAnswers {
    /// The kind.
    pub kind: &'static str,
    /// The count of numbers that were compared.
    pub numbers: usize,
    /// The difference of the worst one from its exact value; `None` if there is no such number.
    pub difference: Option<f64>,
    /// Its bound.
    pub bound: f64,
    /// Its place in the file, and why it was refused.
    pub place: String,
    /// True if every number is within its bound.
    pub kept: bool,
}

/// Compares the numbers of a kind.
type Compare = fn(&ImageEntry<'_>, &mut Answers) -> Result<(), ImageFileError>;

/// The kinds, in the order of the file.
const KINDS: [(&str, Compare); 20] = [
    ("airy-disc", books::airy_discs),
    ("ring", books::rings),
    ("defocus", books::defocus),
    ("aberrated-disc", books::aberrated_discs),
    ("other-pupils", books::other_pupils),
    ("coating", light::coatings),
    ("photons", light::photons),
    ("sensor", light::sensors),
    ("blur", light::blur),
    ("first-order", lenses::first_order),
    ("paths", lenses::paths),
    ("wavefront", lenses::wavefronts),
    ("zernike", lenses::zernike_sums),
    ("psf", lenses::point_spreads),
    ("mtf", lenses::contrast),
    ("colour-mtf", lenses::contrast_of_colors),
    ("distortion", lenses::chief_rays),
    ("illumination", lenses::illuminations),
    ("ghosts", ghosts::first_order),
    ("ghost-rays", ghosts::real_rays),
];

/// The names of the kinds.
pub fn image_kinds() -> impl Iterator<Item = &'static str> {
    KINDS.iter().map(|(kind, _)| *kind)
}

/// Compares the numbers of some kinds of a file, or of all of them if none is named; `report` is told the kind that
/// comes next, and may break.
///
/// # Errors
/// An entry that is not what it should be.
pub fn measure_images(
    file: &Value,
    only: &[String],
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<ImageAnswers>, ImageFileError> {
    let is_asked = |kind: &str| only.is_empty() || only.iter().any(|name| name == kind);
    let asked: Vec<_> = KINDS.iter().filter(|(kind, _)| is_asked(kind)).collect();
    let mut found = Vec::new();
    for (i, (kind, compare)) in asked.iter().enumerate() {
        if report(i, asked.len()).is_break() {
            break;
        }
        let mut answers = Answers::new(kind);
        compare(&ImageEntry::new(file, ""), &mut answers)?;
        found.push(answers.found);
    }
    Ok(found)
}

/// The numbers of a kind as they are compared.
struct Answers {
    found: ImageAnswers,
    /// The largest difference over its bound.
    worst: f64,
}

impl Answers {
    fn new(kind: &'static str) -> Self {
        let place = String::new();
        // A kind without numbers says nothing about the program.
        let found =
            ImageAnswers { kind, numbers: 0, difference: None, bound: 0.0, place, kept: false };
        Self { found, worst: -1.0 }
    }

    /// Compares a number with an exact one.
    fn note(&mut self, found: f64, exact: f64, bound: f64, place: &str) {
        let difference = (found - exact).abs();
        let part = if difference == 0.0 { 0.0 } else { difference / bound };
        self.take(Some(difference).filter(|d| d.is_finite()), part, bound, place.to_owned());
    }

    /// Compares a number with that of a key, to a bound.
    fn note_key(
        &mut self,
        found: f64,
        entry: &ImageEntry<'_>,
        key: &str,
        bound: impl Fn(f64) -> f64,
    ) -> Result<(), ImageFileError> {
        let known = entry.get(key);
        let exact = known.number()?;
        self.note(found, exact, bound(exact), &known.place);
        Ok(())
    }

    /// Notes a number that the program refuses.
    fn refused(&mut self, place: &str, why: impl Display) {
        self.take(None, f64::INFINITY, 0.0, format!("{place}: {why}"));
    }

    /// The value of a number, or notes why there is none.
    fn accept<T, E: Display>(&mut self, found: Result<T, E>, place: &str) -> Option<T> {
        found.map_err(|why| self.refused(place, why)).ok()
    }

    fn take(&mut self, difference: Option<f64>, part: f64, bound: f64, place: String) {
        self.found.numbers += 1;
        // A number that is none must win, hence the negation.
        if !(part <= self.worst) && self.worst < f64::INFINITY {
            self.worst = if part.is_nan() { f64::INFINITY } else { part };
            (self.found.difference, self.found.bound, self.found.place) =
                (difference, bound, place);
        }
        self.found.kept = self.worst <= 1.0;
    }
}

/// The absolute bound of integrals whose error the file does not tell.
const INTEGRAL: f64 = 1e-9;

/// The bound of an integral: ten times its error in the file.
fn integral(error: &ImageEntry<'_>) -> Result<f64, ImageFileError> {
    Ok((10.0 * error.number()?).max(INTEGRAL))
}

/// The bound of a closed form, relative to its value.
fn closed_form(exact: f64) -> f64 {
    1e-12 * exact.abs()
}
