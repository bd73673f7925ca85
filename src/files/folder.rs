//! Results that fill a folder: files of an earlier result with the same kind of names may remain.

use super::FileIdentity;
use std::fs;
use std::path::{Path, PathBuf};

/// The files of a folder whose names are those of a kind of result, but that do not belong to the one
/// that was written last; sorted. `is_own` recognizes the names of that kind.
pub fn stale_files(
    folder: &Path,
    written: &[PathBuf],
    is_own: impl Fn(&str) -> bool,
) -> Vec<PathBuf> {
    let written: Vec<FileIdentity> = written.iter().map(|path| FileIdentity::of(path)).collect();
    let mut stale = own_files(folder, is_own);
    stale.retain(|path| {
        let file = FileIdentity::of(path);
        !written.iter().any(|written| written.is_same(&file))
    });
    stale
}

/// The existing files of a folder with names of a kind of result, sorted.
pub fn own_files(folder: &Path, is_own: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let own = entries.filter(|entry| entry.file_name().to_str().is_some_and(&is_own));
    let mut paths: Vec<PathBuf> = own.map(|entry| entry.path()).collect();
    paths.sort();
    paths
}
