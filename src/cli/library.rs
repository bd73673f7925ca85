//! `library`: lists the published lenses that the program contains, and writes one as a file.

use super::error::CliError;
use super::output::{Output, TextTable};
use super::output_paths::OutputPaths;
use crate::files::{
    self, LibraryLens, LibraryQuery, SaveReport, ShortRange, library_lenses, scale_to_focal_length,
};
use crate::lens::Lens;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Lists and searches the published lenses that the program contains, or writes one of them
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/library.txt"))]
pub(super) struct LibraryArgs {
    /// Words of the name, title, type, aperture or source, and ranges such as mm=28..50 or f=..2;
    /// absent: every lens
    #[arg(value_name = "WORD")]
    words: Vec<String>,

    /// Writes the lens that is found to this file: .json or .zmx
    #[arg(long, value_name = "FILE", requires = "words")]
    out: Option<PathBuf>,

    /// Scales the written lens to this focal length
    #[arg(long, value_name = "MM", requires = "out")]
    focal_length: Option<f64>,
}

impl LibraryArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let query = LibraryQuery::new(self.words.iter().map(String::as_str));
        let found = query.map_err(|error| CliError::Input(error.to_string()))?.find();
        match &self.out {
            Some(out) => output.print(&self.write(&found, out)?),
            None if found.is_empty() => Err(self.nothing_found()),
            None => output.print(&LensList(found)),
        }
    }

    /// Writes the only lens that is found.
    fn write(&self, found: &[&'static LibraryLens], out: &Path) -> Result<WrittenLens, CliError> {
        let &[entry] = found else { return Err(self.not_one(found)) };
        OutputPaths::default().file("--out", Some(out), &["json", "zmx"])?;
        let lens = self.scaled(entry.open()?)?;
        let export = files::save(&lens, out)?;
        Ok(WrittenLens { written: entry, out: out.display().to_string(), export })
    }

    fn scaled(&self, lens: Lens) -> Result<Lens, CliError> {
        let Some(mm) = self.focal_length else { return Ok(lens) };
        let refuse = |error| CliError::Input(format!("--focal-length: {error}"));
        scale_to_focal_length(&lens, mm).map_err(refuse)
    }

    fn not_one(&self, found: &[&LibraryLens]) -> CliError {
        let [first, second, ..] = found else { return self.nothing_found() };
        let (count, query) = (found.len(), self.words.join(" "));
        let text = format!("{count} lenses for `{query}`: {}, {}", first.name, second.name);
        CliError::Input(format!("--out: found {text}, ...; expected the name of one"))
    }

    fn nothing_found(&self) -> CliError {
        let (all, query) = (library_lenses().len(), self.words.join(" "));
        CliError::Input(format!(
            "found no lens for `{query}`; `aplanat library` lists all {all}, and `aplanat library \
             triplet f=..4` those of a type and range"
        ))
    }
}

/// Lenses of the library, one line each; the only one with its title.
#[derive(Serialize)]
#[serde(transparent)]
struct LensList(Vec<&'static LibraryLens>);

const HEAD: [&str; 7] = ["name", "type", "mm", "aperture", "field", "elements", "source"];

impl fmt::Display for LensList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&HEAD).left(&[1, 6]);
        for lens in &self.0 {
            table.row([
                lens.name.clone(),
                lens.design.clone(),
                ShortRange(&lens.focal_length).to_string(),
                lens.aperture.to_string(),
                lens.field.to_string(),
                lens.parts(),
                lens.source.clone(),
            ]);
        }
        write!(f, "{table}")?;
        match &self.0[..] {
            [only] => writeln!(f, "{}", only.title),
            all => writeln!(f, "{} lenses", all.len()),
        }
    }
}

/// The report on a written lens.
#[derive(Serialize)]
struct WrittenLens {
    written: &'static LibraryLens,
    out: String,
    export: SaveReport,
}

impl fmt::Display for WrittenLens {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { written, out, export } = self;
        writeln!(f, "{}\nsource: {}\nsaved as {out}\n{export}", written.title, written.source)
    }
}
