//! The files in which runs are saved, so that they outlive a program that is killed.

use std::fs;
use std::path::{Path, PathBuf};

/// The latest file in a folder whose name ends so.
pub(super) fn newest_file(folder: &Path, ending: &str) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let saved = files.filter(|file| file.file_name().to_string_lossy().ends_with(ending));
    let dated = saved.filter_map(|file| Some((file.metadata().ok()?.modified().ok()?, file)));
    dated.max_by_key(|(date, _)| *date).map(|(_, file)| file.path())
}
