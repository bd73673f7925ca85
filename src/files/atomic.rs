//! Writing a file so that nothing is lost: beside the target, to the disk, then renamed over it.

use super::FileError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes `bytes` to `path`; where that fails, what was there before is untouched.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let unwritable = |source| FileError::Unwritable { file: path.display().to_string(), source };
    // A link keeps pointing where it did: the file behind it is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    check_replaceable(&target).map_err(unwritable)?;
    let beside = temporary_path(&target).map_err(unwritable)?;
    let written = write_and_rename(&beside, &target, bytes);
    if written.is_err() {
        // The first error is the one that counts.
        drop(fs::remove_file(&beside));
    }
    written.map_err(unwritable)
}

/// Refuses a file that could not be written, or replaced, before there is anything to write.
///
/// # Errors
/// The system's.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let unwritable = |source| FileError::Unwritable { file: path.display().to_string(), source };
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    check_replaceable(&target).map_err(unwritable)?;
    let beside = temporary_path(&target).map_err(unwritable)?;
    let made = OpenOptions::new().write(true).create_new(true).open(&beside);
    made.and_then(|_| fs::remove_file(&beside)).map_err(unwritable)
}

/// Refuses what a rename would replace although it must not be written.
fn check_replaceable(target: &Path) -> io::Result<()> {
    match fs::metadata(target) {
        Ok(data) if data.is_dir() => Err(io::Error::other("it is a folder")),
        Ok(data) if data.permissions().readonly() => {
            Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is read-only"))
        }
        _ => Ok(()),
    }
}

/// A name in the same folder that nothing has.
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

/// Lets the rename reach the disk too; not every system can.
fn sync_folder(target: &Path) {
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Ok(folder) = File::open(folder) {
        drop(folder.sync_all());
    }
}
