//! The files of a command: what it writes differs from what it reads, and from what else it writes.

use super::error::CliError;
use crate::files::{self, FileIdentity};
use std::path::{Path, PathBuf};

/// The files that a command reads and writes, each with the name that messages use. Every file that
/// a command writes is added here before the work begins.
#[derive(Debug, Default)]
pub(super) struct OutputPaths {
    taken: Vec<(&'static str, FileIdentity)>,
}

impl OutputPaths {
    /// The files of a command that reads these; `-` is standard input.
    pub(super) fn reading<'a>(read: impl IntoIterator<Item = (&'static str, &'a Path)>) -> Self {
        let files = read.into_iter().filter(|(_, path)| *path != Path::new("-"));
        Self { taken: files.map(|(name, path)| (name, FileIdentity::of(path))).collect() }
    }

    /// Adds a file that will be written, if there is one. Refuses another extension, a file that
    /// cannot be written, and one that is read or written under another name, whatever its path.
    pub(super) fn file(
        &mut self,
        name: &'static str,
        path: Option<&Path>,
        extensions: &[&str],
    ) -> Result<(), CliError> {
        let Some(path) = path else { return Ok(()) };
        check_writable(path, extensions)?;
        self.take(name, path)
    }

    /// Adds a folder that will be filled, if there is one, and creates it. Of the files that it
    /// already contains, `is_own` recognizes by their names those that may be written over; no other
    /// file that is read or written may have such a name there.
    pub(super) fn folder(
        &mut self,
        name: &'static str,
        folder: Option<&Path>,
        is_own: impl Fn(&str) -> bool,
    ) -> Result<(), CliError> {
        let Some(folder) = folder else { return Ok(()) };
        check_folder(folder)?;
        let place = FileIdentity::of(folder);
        let is_taken = |(_, file): &&(_, FileIdentity)| file.name_in(&place).is_some_and(&is_own);
        if let Some((other, file)) = self.taken.iter().find(is_taken) {
            let taken = file.name_in(&place).unwrap_or_default();
            let folder = folder.join(taken);
            let text = format!("{name}: {} is {other}; expected another file", folder.display());
            return Err(CliError::Input(text));
        }
        files::own_files(folder, is_own).iter().try_for_each(|file| self.take(name, file))?;
        std::fs::create_dir_all(folder).map_err(|error| {
            CliError::Input(format!("{}: {error}; expected a folder", folder.display()))
        })
    }

    /// Adds a file that will be written beside another one.
    pub(super) fn take(&mut self, name: &'static str, path: &Path) -> Result<(), CliError> {
        let file = FileIdentity::of(path);
        if let Some((other, _)) = self.taken.iter().find(|(_, taken)| taken.is_same(&file)) {
            let text = format!("{name}: {} is {other}; expected another file", path.display());
            return Err(CliError::Input(text));
        }
        self.taken.push((name, file));
        Ok(())
    }
}

/// Refuses a path that is not a folder and cannot become one.
fn check_folder(folder: &Path) -> Result<(), CliError> {
    let existing = folder.ancestors().find(|part| part.exists());
    if let Some(part) = existing.filter(|part| !part.is_dir()) {
        let inside = if part == folder { String::new() } else { format!("{}: ", folder.display()) };
        let text = format!("{inside}{} is a file; expected a folder", part.display());
        return Err(CliError::Input(text));
    }
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
    if let Some(parent) = parent.filter(|parent| !parent.exists()) {
        let (folder, parent) = (folder.display(), parent.display());
        let text = format!("{folder}: found no folder {parent}; expected one that exists");
        return Err(CliError::Input(text));
    }
    Ok(())
}

/// Refuses a target that cannot be written.
fn check_writable(path: &Path, extensions: &[&str]) -> Result<(), CliError> {
    let file = path.display();
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !extensions.contains(&extension.to_ascii_lowercase().as_str()) {
        let expected = extensions.join("` or `.");
        let text = format!("{file}: found the extension `{extension}`; expected `.{expected}`");
        return Err(CliError::Input(text));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if path.is_dir() || !folder.is_dir() {
        let found = if path.is_dir() { "a folder of that name" } else { "no such folder" };
        let text = format!("{file}: found {found}; expected a file in a folder that exists");
        return Err(CliError::Input(text));
    }
    files::check_unlocked(path)?;
    files::check_writable(path).map_err(|error| CliError::Input(error.to_string()))
}

/// A note on files of an earlier result that remain in a folder; `None` if there are none.
pub(super) fn stale_note(stale: &[PathBuf]) -> Option<String> {
    let [first, .., last] = stale else {
        return stale.first().map(|file| format!("{} is of an earlier run", file.display()));
    };
    let (count, first, last) = (stale.len(), first.display(), last.display());
    Some(format!("{count} files are of an earlier run: {first} to {last}"))
}
