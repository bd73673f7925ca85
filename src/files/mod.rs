//! Reading and writing lenses and volumes; reading pictures.
//!
//! A file is known by its content first and its extension second. An import reports what it used,
//! approximated, preserved and dropped; an export is read back and traced before it counts as
//! written; a file is written beside its target and renamed, so that nothing is lost on the way.

mod convert;
mod error;
mod library;
pub mod native;
mod photo;
mod probe;
mod report;
mod save;
mod text;
mod volume;
pub mod zemax;

pub use convert::{Conversion, convert};
pub use error::FileError;
pub use library::{Bundled, library};
pub use photo::{Photo, read_photo};
pub use probe::{Proof, SelfCheck};
pub use report::{Outcome, Report, ReportRow};
pub use save::{check_writable, replace};
pub use volume::{Volume, read_volume, write_volume};

use crate::lens::Lens;
use serde::Serialize;
use std::path::Path;

/// The formats that are read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Our own JSON, `.json`.
    Native,
    /// Zemax, `.zmx`.
    Zemax,
}

/// A lens from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// The lens.
    pub lens: Lens,
    /// What it was read from.
    pub format: Format,
    /// What became of the lines of a foreign file.
    pub report: Option<Report>,
    /// The numbers to compare with the program from which a foreign file comes; empty for our own
    /// files, and for a lens whose glasses have no index at its wavelengths.
    pub checks: Vec<SelfCheck>,
}

/// What became of a saved lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SaveReport {
    /// What was written.
    pub format: Format,
    /// What a foreign file could not hold exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<Report>,
    /// That a foreign file traces like the lens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proof: Option<Proof>,
}

const KNOWN: &str = "a lens: our JSON (with the key `aplanat`) or Zemax .zmx";

/// Reads a lens from a file of any known format.
pub fn open(path: impl AsRef<Path>) -> Result<Opened, FileError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|source| FileError::Unreadable { file: file.clone(), source })?;
    parse(&bytes, &file)
}

/// Reads a lens from the bytes of a file; `name` is for messages and, by its extension, a hint.
pub fn parse(bytes: &[u8], name: &str) -> Result<Opened, FileError> {
    let nothing = |found| FileError::NotALens { file: name.to_owned(), found, expected: KNOWN };
    if let Some(found) = text::not_text(bytes) {
        return Err(nothing(found));
    }
    let text = text::decode(bytes);
    let format = by_content(&text).or_else(|| by_extension(Path::new(name)));
    match format.ok_or_else(|| nothing("text that is no lens".to_owned()))? {
        Format::Native => {
            text::refuse_other_than_unicode(bytes).map_err(|wrong| wrong.of(name))?;
            let lens = native::read(&text, name)?;
            Ok(Opened { lens, format: Format::Native, report: None, checks: Vec::new() })
        }
        Format::Zemax => {
            let (lens, report) = zemax::read(&text, name)?;
            let checks = probe::self_checks(&lens).unwrap_or_default();
            Ok(Opened { lens, format: Format::Zemax, report: Some(report), checks })
        }
    }
}

fn by_content(text: &str) -> Option<Format> {
    if text.trim_start().starts_with('{') {
        return Some(Format::Native);
    }
    let mut keywords = text.lines().filter_map(|line| line.split_whitespace().next());
    keywords.any(|word| matches!(word, "SURF" | "MODE" | "VERS")).then_some(Format::Zemax)
}

fn by_extension(path: &Path) -> Option<Format> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "json" => Some(Format::Native),
        "zmx" => Some(Format::Zemax),
        _ => None,
    }
}

/// Writes a lens to a file, in the format of its extension: `.json` or `.zmx`. A foreign file is
/// read back and traced first. Where anything fails, what was there before is untouched.
pub fn save(lens: &Lens, path: impl AsRef<Path>) -> Result<SaveReport, FileError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    lens.check().map_err(|source| FileError::Lens { file: file.clone(), source })?;
    let Some(format) = by_extension(path) else {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let found = format!("the extension `{extension}`");
        return Err(FileError::NotALens { file, found, expected: "`.json` or `.zmx` to write to" });
    };
    let (bytes, report, proof) = match format {
        Format::Native => (native::write(lens).into_bytes(), None, None),
        Format::Zemax => {
            let (bytes, report, proof) = proven_zemax(lens, &file)?;
            (bytes, Some(report), Some(proof))
        }
    };
    replace(path, &bytes)?;
    Ok(SaveReport { format, report, proof })
}

/// The bytes of a Zemax file that traces like the lens.
fn proven_zemax(lens: &Lens, file: &str) -> Result<(Vec<u8>, Report, Proof), FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let (text, report) = zemax::write(lens).map_err(unusable)?;
    let bytes = text::utf16(&text);
    let back = parse(&bytes, file)?;
    let proof = probe::prove(lens, &back.lens, file)?;
    Ok((bytes, report, proof))
}
