//! Zemax `.zmx`: reading and writing.
//!
//! There is no public specification: the format is known from files and from programs that read them.
//! The report lists every line of a file as used, approximated, preserved or dropped.

mod build;
mod even_fit;
mod file;
mod freeform;
mod glass;
mod gradient;
mod line;
mod parse;
mod row_plan;
mod shape;
mod tolerance;
mod write;

pub(super) use freeform::merged_powers;
pub(super) use glass::{ImportedMedium, is_general, named_medium};
pub use write::write;

use super::error::{FileError, ParseError};
use super::foreign_lens::ForeignLens;
use super::report::ConversionReport;
use crate::lens::Lens;

/// Thicknesses from this on are infinite, which is accepted for the object only.
const INFINITE_GAP: f64 = 1e18;

/// The beginning of the note with the source of the lens.
const SOURCE: &str = "Source: ";

/// The beginning of a note with the name of a zoom position.
const ZOOM_NAME: &str = "Zoom position: ";

/// Reads a lens from the text of a file. `file` is its name in messages, and the name of a lens that has
/// none.
///
/// # Errors
/// A malformed line, a surface that cannot be traced, or an invalid lens.
pub fn read(text: &str, file: &str) -> Result<(Lens, ConversionReport), FileError> {
    let ForeignLens { lens, report, .. } = read_foreign(text, file)?;
    Ok((lens, report))
}

/// The same with what the file says of the beam.
pub(super) fn read_foreign(text: &str, file: &str) -> Result<ForeignLens, FileError> {
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let mut read = parse_lens(&text).map_err(|wrong| wrong.in_file(file))?;
    crate::files::set_origin(&mut read.lens, file);
    read.lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    apply_focus_solve(&mut read.lens);
    Ok(read)
}

fn parse_lens(text: &str) -> Result<ForeignLens, ParseError> {
    let (file, mut report) = parse::parse(text)?;
    if file.surfaces.is_empty() {
        let expected = "SURF lines: is this a Zemax lens file?".to_owned();
        let found = "no SURF line".to_owned();
        return Err(ParseError { place: "the whole file".to_owned(), found, expected });
    }
    let lens = build::build(&file, &mut report)?;
    Ok(build::with_beam(&file, lens, report))
}

/// Writes the solved gap into the lens, so that its prescription shows the position of the focus.
pub(super) fn apply_focus_solve(lens: &mut Lens) {
    if lens.image_solve.is_none() {
        return;
    }
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um);
    let Some(last) = lens.surfaces.last_mut() else { return };
    match system {
        Ok(system) => last.thickness = system.surfaces[system.surfaces.len() - 2].thickness,
        // Without a paraxial focus the solve is dropped.
        Err(_) => lens.image_solve = None,
    }
}
