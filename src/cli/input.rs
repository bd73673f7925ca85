//! The input of subcommands: lenses, fields, tolerances and JSON.

use super::error::CliError;
use super::output::print_note;
use super::progress::{stop_flag, with_bar};
use crate::files::{self, ConversionOutcome, json};
use crate::lens::{FieldKind, FieldPoint, Lens, System};
use crate::pupil::RayModel;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::AtomicBool;

/// The lens argument of a subcommand.
#[derive(Debug, clap::Args)]
pub(super) struct LensFile {
    /// The lens: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS")]
    path: PathBuf,
}

/// The lens arguments of a benchmark that takes several.
#[derive(Debug, clap::Args)]
pub(super) struct LensFiles {
    /// The lenses: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS", required = true)]
    paths: Vec<PathBuf>,
}

impl LensFiles {
    /// The lenses of some files.
    pub(super) const fn new(paths: Vec<PathBuf>) -> Self {
        Self { paths }
    }

    /// The number of files.
    pub(super) const fn count(&self) -> usize {
        self.paths.len()
    }

    /// Measures every lens, and makes a row of its file and what was found; a bar counts them, and
    /// a request to end leaves out those that have not begun. The second argument of `measure` is
    /// the name of the file without its ending, the third is true once it is asked to end; a lens
    /// of which nothing is found then has no row.
    pub(super) fn map<T, R>(
        &self,
        measure: impl Fn(&Lens, &str, &AtomicBool) -> Option<T>,
        row: impl Fn(String, T) -> R,
    ) -> Result<Vec<R>, CliError> {
        let open = |path: &PathBuf| LensFile { path: path.clone() }.open();
        let opened: Vec<LoadedLens> = self.paths.iter().map(open).collect::<Result<_, _>>()?;
        let stop = stop_flag();
        let (rows, _) = with_bar(&stop, "lenses", |report| {
            let mut rows = Vec::new();
            for (done, (opened, path)) in opened.iter().zip(&self.paths).enumerate() {
                let name = path.file_stem().unwrap_or_default().to_string_lossy();
                let found = measure(&opened.lens, &name, &stop);
                rows.extend(found.map(|found| row(opened.file.clone(), found)));
                if report(done, self.paths.len()).is_break() {
                    break;
                }
            }
            rows
        });
        Ok(rows)
    }
}

/// A lens with the name of its file.
#[derive(Debug, Clone)]
pub(super) struct LoadedLens {
    pub(super) lens: Lens,
    pub(super) file: String,
}

impl LensFile {
    /// The lens of a file.
    pub(super) fn of(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the lens; a note counts the lines of a foreign file that are not represented exactly.
    pub(super) fn open(&self) -> Result<LoadedLens, CliError> {
        let file = self.path.display().to_string();
        let opened = files::open(&self.path)?;
        let report = opened.report.unwrap_or_default();
        let [dropped, locked, changed] = [
            ConversionOutcome::Dropped,
            ConversionOutcome::Locked,
            ConversionOutcome::Approximated,
        ]
        .map(|outcome| report.count(outcome));
        if dropped + locked + changed > 0 {
            let locked = if locked > 0 { format!("{locked} locked, ") } else { String::new() };
            let text = format!("{dropped} lines dropped, {locked}{changed} approximated");
            print_note(format!("note: {file}: {text}; `aplanat convert` lists them"));
        }
        Ok(LoadedLens { lens: opened.lens, file })
    }
}

impl LoadedLens {
    /// The resolved lens, at the primary wavelength if `um` is `None`.
    pub(super) fn system(&self, zoom: usize, um: Option<f64>) -> Result<System<f64>, CliError> {
        let um = um.unwrap_or_else(|| self.primary_um());
        let system = self.lens.resolve(zoom, um);
        system.map_err(|source| CliError::Lens { file: self.file.clone(), source })
    }

    /// The primary wavelength, in µm.
    pub(super) fn primary_um(&self) -> f64 {
        self.lens.wavelengths[self.lens.primary()].um
    }

    /// The lens with its beam and aiming at a zoom position.
    pub(super) fn ray_model(&self, zoom: usize) -> Result<RayModel, CliError> {
        self.check_zoom(zoom)?;
        let model = RayModel::from_lens(&self.lens, zoom);
        model.map_err(|source| CliError::RayModel { file: self.file.clone(), source })
    }

    /// Refuses a lens through which no rays can be traced at some zoom position.
    pub(super) fn check_traceable(&self) -> Result<(), CliError> {
        (0..self.lens.zoom_positions()).try_for_each(|zoom| {
            self.lens
                .wavelengths
                .iter()
                .try_for_each(|w| self.system(zoom, Some(w.um)).map(drop))?;
            self.ray_model(zoom).map(drop)
        })
    }

    /// The field point at this height (mm) or angle (degrees), as the lens defines its fields.
    pub(super) fn field_at(&self, y: f64, zoom: usize) -> Result<FieldPoint, CliError> {
        let angle = self.lens.fields_at(zoom).kind == FieldKind::Angle;
        if y.is_finite() && !(angle && y.abs() >= 180.0) {
            return Ok(FieldPoint { x: 0.0, y, weight: 1.0 });
        }
        let unit = if angle { "an angle below 180 degrees" } else { "a finite height in mm" };
        Err(CliError::Input(format!("--field: found {y}; expected {unit}")))
    }

    /// Refuses a zoom position that does not exist.
    pub(super) fn check_zoom(&self, zoom: usize) -> Result<(), CliError> {
        let count = self.lens.zoom_positions();
        if zoom < count {
            return Ok(());
        }
        let last = count - 1;
        let expected =
            if last == 0 { "0, the only one".to_owned() } else { format!("0 to {last}") };
        Err(CliError::Input(format!(
            "--zoom: no zoom position {zoom} in {}; expected {expected}",
            self.file
        )))
    }

    /// The beginning of an error of a lens that is seen at one field: the option `--field` if the lens has no
    /// such field of its own, else the file.
    pub(super) fn blame_field(&self, field: Option<f64>, zoom: usize) -> String {
        let is_own =
            |y: f64| self.lens.fields_at(zoom).values.iter().any(|f| f.x == 0.0 && f.y == y);
        match field.filter(|y| !is_own(*y)) {
            Some(y) => format!(
                "--field: found {y}; expected a field whose light gets through {}",
                self.file
            ),
            None => self.file.clone(),
        }
    }
}

/// A relative tolerance: `0.1%` or `1e-3`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerance(pub(super) f64);

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (digits, unit) = match text.strip_suffix('%') {
            Some(digits) => (digits, 0.01),
            None => (text, 1.0),
        };
        match digits.trim().parse::<f64>().map(|value| value * unit) {
            Ok(value) if value > 0.0 && value < 1.0 => Ok(Self(value)),
            _ => Err("expected more than 0 and less than 100%, as in `0.1%` or `1e-3`".to_owned()),
        }
    }
}

/// Reads JSON that describes a design from a file, or from standard input if the path is `-`.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, CliError> {
    read_long_json(path, files::MAX_LENS_BYTES)
}

/// Reads JSON of at most `max` bytes from a file, or from standard input if the path is `-`.
pub(super) fn read_long_json<T: DeserializeOwned>(path: &Path, max: u64) -> Result<T, CliError> {
    let file = display_name(path);
    let bytes = if path == Path::new("-") {
        files::read_bounded(std::io::stdin().lock(), &file, max)?
    } else {
        files::read_file(path, max)?
    };
    Ok(json::read_json(&files::decode_unicode(&bytes, &file)?, &file)?)
}

/// The name of a file in messages.
pub(super) fn display_name(path: &Path) -> String {
    if path == Path::new("-") { "standard input".to_owned() } else { path.display().to_string() }
}
