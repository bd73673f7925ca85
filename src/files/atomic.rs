//! Atomic writing: the bytes go to a temporary file beside the target, which is synchronized and
//! then renamed over it.

use super::FileError;
use super::identity::{folder_of, resolve_links};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Replaces the content of `path` by `bytes`; on failure the target is unchanged.
///
/// # Errors
/// [`FileError::Unwritable`]: the target is a folder or read-only, or the system refuses a step.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let unwritable = |source| FileError::Unwritable { file: path.display().to_string(), source };
    // A link is kept: the file behind it is replaced, or made if it is missing.
    let target = resolve_links(path).map_err(unwritable)?;
    check_replaceable(&target).map_err(unwritable)?;
    let beside = temporary_path(&target).map_err(unwritable)?;
    let written = write_and_rename(&beside, &target, bytes);
    if written.is_err() {
        // The error of the write is reported, not that of the clean-up.
        drop(fs::remove_file(&beside));
    }
    written.map_err(unwritable)
}

/// Checks that a file can be written or replaced, before there is anything to write.
///
/// # Errors
/// [`FileError::Unwritable`], as from [`write_atomic`].
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let unwritable = |source| FileError::Unwritable { file: path.display().to_string(), source };
    let target = resolve_links(path).map_err(unwritable)?;
    check_replaceable(&target).map_err(unwritable)?;
    let beside = temporary_path(&target).map_err(unwritable)?;
    let made = OpenOptions::new().write(true).create_new(true).open(&beside);
    made.and_then(|_| fs::remove_file(&beside)).map_err(unwritable)
}

/// Refuses targets that a rename would replace although they must not be written.
fn check_replaceable(target: &Path) -> io::Result<()> {
    match fs::metadata(target) {
        Ok(data) if data.is_dir() => Err(io::Error::other("it is a folder")),
        Ok(data) if !data.is_file() => Err(io::Error::other("it is a device or a pipe")),
        Ok(data) if data.permissions().readonly() => {
            Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is read-only"))
        }
        _ => Ok(()),
    }
}

/// An unused name in the folder of the target.
fn temporary_path(target: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = target.file_name().ok_or_else(|| io::Error::other("it has no file name"))?;
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let unique = format!(".{}.{}-{count}.part", name.to_string_lossy(), std::process::id());
    Ok(target.with_file_name(unique))
}

fn write_and_rename(beside: &Path, target: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create_new(true).open(beside)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    drop(file);
    if let Ok(old) = fs::metadata(target) {
        fs::set_permissions(beside, old.permissions())?;
    }
    fs::rename(beside, target)?;
    sync_folder(target);
    Ok(())
}

/// Synchronizes the rename to the disk, where the system can.
fn sync_folder(target: &Path) {
    if let Ok(folder) = File::open(folder_of(target)) {
        drop(folder.sync_all());
    }
}
