//! Reading what a subcommand works on.

use super::failure::Failure;
use crate::files::{self, FileError, native};
use crate::lens::{Lens, System};
use serde::de::DeserializeOwned;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// The lens that a subcommand works on.
#[derive(Debug, clap::Args)]
pub(super) struct LensFile {
    /// The lens: .json or .zmx
    #[arg(value_name = "LENS")]
    path: PathBuf,
}

/// A lens that was read, and where from.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) lens: Lens,
    pub(super) file: String,
}

impl LensFile {
    /// Reads the lens.
    pub(super) fn open(&self) -> Result<Opened, Failure> {
        let file = self.path.display().to_string();
        Ok(Opened { lens: files::open(&self.path)?.lens, file })
    }
}

impl Opened {
    /// The lens in plain numbers, at its primary wavelength where no other is asked for.
    pub(super) fn system(&self, zoom: usize, um: Option<f64>) -> Result<System<f64>, Failure> {
        let um = um.unwrap_or_else(|| self.primary_um());
        let system = self.lens.system(zoom, um);
        system.map_err(|source| Failure::Lens { file: self.file.clone(), source })
    }

    /// The primary wavelength.
    pub(super) fn primary_um(&self) -> f64 {
        self.lens.wavelengths[self.lens.primary()].um
    }

    /// Refuses a zoom position that the lens does not have.
    pub(super) fn check_zoom(&self, zoom: usize) -> Result<(), Failure> {
        let count = self.lens.zoom_positions();
        if zoom < count {
            return Ok(());
        }
        let last = count - 1;
        Err(Failure::Input(format!("{}: no zoom position {zoom}; expected 0 to {last}", self.file)))
    }
}

/// Reads JSON from a file, or from standard input for `-`.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, Failure> {
    let file = name(path);
    let unreadable = |source| FileError::Unreadable { file: file.clone(), source };
    let text = if path == Path::new("-") {
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text).map_err(unreadable)?;
        text
    } else {
        std::fs::read_to_string(path).map_err(unreadable)?
    };
    Ok(native::read_json(&text, &file)?)
}

/// What a message calls a file.
pub(super) fn name(path: &Path) -> String {
    if path == Path::new("-") { "standard input".to_owned() } else { path.display().to_string() }
}
