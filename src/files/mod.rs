//! Reading and writing of lenses and volumes; reading of images.
//!
//! The format of a file is recognized by its content, then by its extension. An import reports what it
//! used, approximated, preserved and dropped. An export is read back and traced before it is saved, and
//! every file is written beside its target and renamed, so that a failure leaves the target unchanged.

mod agf;
mod atomic;
mod bounded;
mod bundled;
mod checkpoint;
pub mod codev;
mod convert;
mod error;
mod first_order_beam;
mod folder;
mod foreign_lens;
mod glass_prices;
mod glass_query;
mod identity;
mod image_file;
mod image_side;
mod imported_file;
mod index_table;
pub mod json;
mod library;
mod lock;
mod optiland;
mod oslo;
mod outline;
mod own_glass;
mod plain_lens;
mod probe_rays;
mod ray_optics;
mod report;
mod round_trip;
mod self_check;
mod text;
mod vignetting;
mod volume;
mod yaml_glass;
mod zar;
pub mod zemax;

pub use agf::{AgfCatalogue, AgfExport, parse_agf, read_agf, write_agf};
pub use atomic::{check_writable, write_atomic};
pub use bounded::{MAX_DATA_BYTES, MAX_LENS_BYTES, read_bounded, read_file};
pub use bundled::{BundledLens, bundled_lenses};
pub use checkpoint::{CheckpointError, CheckpointFormat};
pub use convert::{Conversion, convert};
pub use error::FileError;
pub use folder::{own_files, stale_files};
pub use foreign_lens::{ImportSettings, StatedNumber};
pub use glass_query::{GlassQuery, GlassQueryError};
pub use identity::FileIdentity;
pub use image_file::{ColorImage, GrayscaleImage, read_color, read_grayscale};
pub use imported_file::ImportedFile;
pub use library::{
    LensScaleError, LibraryLens, LibraryQuery, LibraryQueryError, ShortRange, StatedAperture,
    StatedField, focal_length, focal_length_factor, library_lenses, parse_range,
    scale_to_focal_length,
};
pub use lock::{FileLock, check_unlocked};
pub use own_glass::{
    add_catalogue, add_melt, glass_folder, load_own_glasses, own_catalogues, remove_catalogue,
};
pub use report::{ConversionOutcome, ConversionReport, ConversionRow};
pub use round_trip::RoundTripCheck;
pub use self_check::SelfCheck;
pub use text::decode_unicode;
pub use vignetting::VignettingChoice;
pub use volume::{
    MAX_VOLUME_BYTES, Volume, is_npz, raw_path, read_volume, volume_files, write_volume,
};

use crate::lens::{Lens, Medium, SurfaceNumber};
use serde::Serialize;
use std::path::Path;

/// Names an imported lens after its file if it has no name, and notes the file if it has no source.
fn set_origin(lens: &mut Lens, file: &str) {
    let path = Path::new(file);
    if lens.name.is_empty() {
        lens.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    if lens.source.is_empty() {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        lens.source = format!("Imported from {name}");
    }
}

/// A file format of lenses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LensFormat {
    /// The JSON of this program, `.json`.
    Native,
    /// Zemax, `.zmx`.
    Zemax,
    /// CODE V, `.seq`.
    CodeV,
    /// The program ray-optics, `.roa`.
    RayOptics,
    /// The program Optiland, `.optiland.json`.
    Optiland,
    /// The program OSLO, `.len`.
    Oslo,
    /// An archive of Zemax with a lens and its catalogues, `.zar`; only read.
    Archive,
}

impl LensFormat {
    /// True for a format that lenses are written in.
    const fn is_written(self) -> bool {
        !matches!(self, Self::Archive)
    }
}

/// A lens read from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenedLens {
    /// The lens.
    pub lens: Lens,
    /// The format of the file.
    pub format: LensFormat,
    /// The report on the lines of a foreign file.
    pub report: Option<ConversionReport>,
    /// Numbers to compare with the program that wrote a foreign file; empty for JSON, and for a lens
    /// whose glasses have no index at its wavelengths.
    pub checks: Vec<SelfCheck>,
    /// Numbers that a foreign file states although they follow from the lens, beside those of this program.
    pub stated: Vec<StatedNumber>,
    /// The treatment of the vignetting factors of a foreign file; `None` if it has none.
    pub vignetting: Option<VignettingChoice>,
}

/// The report on a saved lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SaveReport {
    /// The format of the file.
    pub format: LensFormat,
    /// Everything that a foreign file cannot hold exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<ConversionReport>,
    /// The comparison of a foreign file with the lens by rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proof: Option<RoundTripCheck>,
}

const READABLE: &str = "a lens: JSON with the key `aplanat`, Zemax .zmx or .zar, CODE V .seq, OSLO .len, \
     ray-optics .roa or the JSON of Optiland";

/// Reads a lens from a file of any known format.
///
/// # Errors
/// A file that cannot be read or is too long, and those of [`parse`].
pub fn open(path: impl AsRef<Path>) -> Result<OpenedLens, FileError> {
    open_with(path, ImportSettings::default())
}

/// The same with the choices of a person on foreign files.
///
/// # Errors
/// As [`open`].
pub fn open_with(
    path: impl AsRef<Path>,
    settings: ImportSettings,
) -> Result<OpenedLens, FileError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    parse_with(&read_file(path, MAX_LENS_BYTES)?, &file, settings)
}

/// Reads a lens from the bytes of a file. `name` is its name in messages, and its extension decides
/// where the content does not.
///
/// # Errors
/// Bytes that are not a lens, malformed text, or an invalid lens.
pub fn parse(bytes: &[u8], name: &str) -> Result<OpenedLens, FileError> {
    parse_with(bytes, name, ImportSettings::default())
}

/// The same with the choices of a person on foreign files.
///
/// # Errors
/// As [`parse`].
pub fn parse_with(
    bytes: &[u8],
    name: &str,
    settings: ImportSettings,
) -> Result<OpenedLens, FileError> {
    if zar::is_archive(bytes) {
        parse_archive(bytes, name, settings)
    } else {
        parse_text(bytes, name, settings)
    }
}

/// The lens of an archive. Its other files are listed in the report.
fn parse_archive(
    bytes: &[u8],
    name: &str,
    settings: ImportSettings,
) -> Result<OpenedLens, FileError> {
    let members = zar::members(bytes, name)?;
    let lens = members.iter().position(|member| member.has_extension("zmx"));
    let Some(lens) = lens else {
        let found = "an archive with no lens .zmx".to_owned();
        return Err(FileError::NotALens { file: name.to_owned(), found, expected: READABLE });
    };
    let file = format!("{name}/{}", members[lens].name());
    let mut opened = parse_text(&members[lens].contents(name)?, &file, settings)?;
    opened.format = LensFormat::Archive;
    let report = opened.report.get_or_insert_default();
    for (i, member) in members.iter().enumerate() {
        if i != lens {
            let note = if member.has_extension("agf") {
                format!("a glass catalogue, not known until `aplanat glass --add \"{name}\"`")
            } else {
                "a file of the archive, not read".to_owned()
            };
            report.add(ConversionOutcome::Preserved, &member.name(), note);
        }
    }
    Ok(opened)
}

fn parse_text(bytes: &[u8], name: &str, settings: ImportSettings) -> Result<OpenedLens, FileError> {
    let nothing = |found| FileError::NotALens { file: name.to_owned(), found, expected: READABLE };
    if let Some(found) = text::binary_kind(bytes) {
        return Err(nothing(found));
    }
    let text = text::decode(bytes);
    let format = format_by_content(&text).or_else(|| format_by_extension(Path::new(name)));
    let format = format.ok_or_else(|| nothing("text that is not a lens".to_owned()))?;
    let read = match format {
        LensFormat::Native => {
            return Ok(OpenedLens::native(json::read(&decode_unicode(bytes, name)?, name)?));
        }
        LensFormat::Zemax => zemax::read_foreign(&text, name)?,
        LensFormat::RayOptics => ray_optics::read(&decode_unicode(bytes, name)?, name)?.into(),
        LensFormat::Optiland => optiland::read(&decode_unicode(bytes, name)?, name)?,
        LensFormat::CodeV => codev::read_foreign(&text, name)?,
        LensFormat::Oslo => oslo::read(&text, name)?.into(),
        LensFormat::Archive => return Err(nothing("a damaged archive".to_owned())),
    };
    Ok(read.opened(format, settings))
}

impl OpenedLens {
    /// A lens of the native format, which holds every lens exactly.
    fn native(lens: Lens) -> Self {
        let (checks, stated) = (Vec::new(), Vec::new());
        Self { lens, format: LensFormat::Native, report: None, checks, stated, vignetting: None }
    }
}

fn format_by_content(text: &str) -> Option<LensFormat> {
    if ray_optics::is_model(text) {
        return Some(LensFormat::RayOptics);
    }
    if optiland::is_lens(text) {
        return Some(LensFormat::Optiland);
    }
    if text.trim_start().starts_with('{') {
        return Some(LensFormat::Native);
    }
    if oslo::is_lens(text) {
        return Some(LensFormat::Oslo);
    }
    let lines = || text.split(['\n', '\r']);
    let keywords = || lines().filter_map(|line| line.split_whitespace().next());
    if keywords().any(|word| matches!(word, "SURF" | "MODE" | "VERS")) {
        return Some(LensFormat::Zemax);
    }
    let object = |word: &str| word.eq_ignore_ascii_case("SO");
    keywords().any(object).then_some(LensFormat::CodeV)
}

fn format_by_extension(path: &Path) -> Option<LensFormat> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    if name.ends_with(".optiland.json") {
        return Some(LensFormat::Optiland);
    }
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "json" => Some(LensFormat::Native),
        "zmx" => Some(LensFormat::Zemax),
        "seq" => Some(LensFormat::CodeV),
        "roa" => Some(LensFormat::RayOptics),
        "len" => Some(LensFormat::Oslo),
        "zar" => Some(LensFormat::Archive),
        _ => None,
    }
}

/// Writes a lens to a file, in the format of its extension: `.json`, `.zmx`, `.seq`, `.len`, `.roa` or
/// `.optiland.json`. A foreign file is read back and traced first. On failure the target is unchanged.
///
/// # Errors
/// An invalid lens, another extension, a foreign file that does not trace like the lens, or a target
/// that cannot be written.
pub fn save(lens: &Lens, path: impl AsRef<Path>) -> Result<SaveReport, FileError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    lens.check().map_err(|source| FileError::Lens { file: file.clone(), source })?;
    let Some(format) = format_by_extension(path).filter(|format| format.is_written()) else {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let found = format!("the extension `{extension}`");
        let expected = "`.json`, `.zmx`, `.seq`, `.len` or `.roa` to write to, or `.optiland.json`";
        return Err(FileError::NotALens { file, found, expected });
    };
    let (bytes, report, proof) = if format == LensFormat::Native {
        (json::write(lens).into_bytes(), None, None)
    } else {
        let (bytes, report, proof) = checked_foreign(lens, format, &file)?;
        (bytes, Some(report), Some(proof))
    };
    write_atomic(path, &bytes)?;
    Ok(SaveReport { format, report, proof })
}

/// The error of a file that would not be read back; nobody has seen its lines.
fn unreadable_export(file: &str, error: &FileError) -> FileError {
    let what = match error {
        FileError::Malformed { found, expected, .. } => {
            format!("its text would have {found}; expected {expected}")
        }
        error => error.to_string(),
    };
    FileError::RoundTripFailed { file: file.to_owned(), what }
}

/// Refuses a gradient-index medium, which a sequence cannot hold although rays meet it.
fn refuse_gradients(lens: &Lens, file: &str) -> Result<(), FileError> {
    let graded = lens.surfaces.iter().position(|row| matches!(row.medium, Medium::Grin(_)));
    let Some(surface) = graded else { return Ok(()) };
    let surface = SurfaceNumber::new(surface);
    let found =
        format!("the gradient-index medium of surface {surface}, which a .seq file cannot hold");
    let (file, expected) = (file.to_owned(), ".zmx or .json for it".to_owned());
    Err(FileError::Unsuitable { file, found, expected })
}

/// The bytes of a foreign file, checked by reading it back and tracing it.
fn checked_foreign(
    lens: &Lens,
    format: LensFormat,
    file: &str,
) -> Result<(Vec<u8>, ConversionReport, RoundTripCheck), FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let (text, report) = match format {
        LensFormat::CodeV => {
            refuse_gradients(lens, file)?;
            codev::write(lens).map_err(unusable)?
        }
        LensFormat::Oslo => oslo::write(lens, file)?,
        LensFormat::RayOptics => ray_optics::write(lens, file)?,
        LensFormat::Optiland => optiland::write(lens, file)?,
        _ => zemax::write(lens).map_err(unusable)?,
    };
    let is_zemax = format == LensFormat::Zemax;
    let bytes = if is_zemax { text::encode_utf16(&text) } else { text.into_bytes() };
    let back = parse(&bytes, file).map_err(|error| unreadable_export(file, &error))?;
    let proof = round_trip::check_round_trip(lens, &back.lens, file)?;
    Ok((bytes, report, proof))
}
