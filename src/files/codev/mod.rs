//! CODE V `.seq`: reading and writing.
//!
//! A sequence file is a list of commands. Commands that belong to a surface follow its `S`, or name it.
//! The report lists every command as used, approximated, preserved, locked or dropped.
//!
//! Signs: ADE and BDE are left-handed, CDE is right-handed. Angles of fields are degrees, wavelengths
//! nanometres, and `M` as a dimension means millimetres.

mod build;
mod command;
mod file;
mod parse;
mod surface;
mod write;

pub(super) use build::frames;
pub(super) use file::Placement;
pub(super) use write::place;
pub use write::write;

use super::error::FileError;
use super::foreign_lens::ForeignLens;
use super::report::ConversionReport;
use crate::lens::Lens;

/// Reads a lens from the text of a file. `file` is its name in messages, and the name of a lens that has
/// none.
///
/// # Errors
/// A malformed command, or an invalid lens.
pub fn read(text: &str, file: &str) -> Result<(Lens, ConversionReport), FileError> {
    let ForeignLens { lens, report, .. } = read_foreign(text, file)?;
    Ok((lens, report))
}

/// The same with what the file says of the beam.
pub(super) fn read_foreign(text: &str, file: &str) -> Result<ForeignLens, FileError> {
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let (parsed, mut report) = parse::parse(&text).map_err(|wrong| wrong.in_file(file))?;
    let mut lens = build::build(&parsed, &mut report).map_err(|wrong| wrong.in_file(file))?;
    crate::files::set_origin(&mut lens, file);
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    build::solve_focus(&parsed, &mut lens, &mut report);
    Ok(build::with_beam(&parsed, lens, report))
}
