//! Checks that the files that a command writes differ from those that it reads, and from each other.

use super::error::CliError;
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses a path that is not a folder and cannot become one.
pub(super) fn check_folder(folder: &Path) -> Result<(), CliError> {
    let existing = folder.ancestors().find(|part| part.exists());
    match existing {
        Some(part) if !part.is_dir() => {
            let (folder, part) = (folder.display(), part.display());
            Err(CliError::Input(format!("{folder}: {part} is a file; expected a folder")))
        }
        _ => Ok(()),
    }
}

/// Refuses files that would overwrite one that is read, or each other.
pub(super) fn check_distinct<'a>(
    targets: &[Option<(&'static str, &'a Path)>],
    read: impl Iterator<Item = (&'static str, &'a Path)>,
) -> Result<(), CliError> {
    let mut taken: Vec<(&str, PathBuf)> =
        read.map(|(name, path)| (name, canonical_path(path))).collect();
    for (name, path) in targets.iter().flatten() {
        let place = canonical_path(path);
        if let Some((other, _)) = taken.iter().find(|(_, taken)| *taken == place) {
            let text = format!("{name}: {} is {other}; expected another file", path.display());
            return Err(CliError::Input(text));
        }
        taken.push((name, place));
    }
    Ok(())
}

/// The canonical path of a file, which need not exist.
fn canonical_path(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = fs::canonicalize(folder.unwrap_or(Path::new(".")));
    let new = || Some(folder.ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(new).unwrap_or_else(|| path.to_owned())
}
