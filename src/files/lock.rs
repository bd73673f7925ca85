//! A lock that keeps two programs from writing one file.
//!
//! A file that is replaced whole cannot be locked itself, so the lock is on a small file beside it,
//! which contains the number of the process that holds it. The system releases the lock when that
//! process ends in any way; the small file may remain after a crash, and is then taken over.

use super::FileError;
use super::identity::{file_number, resolve_links};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

/// The maximum number of attempts to lock a file that its holder removes at the same moment.
const MAX_ATTEMPTS: usize = 10;
/// The maximum number of characters of the number of a process.
const MAX_NUMBER: u64 = 20;
/// The holder of a lock that does not tell its number.
const UNKNOWN_HOLDER: &str = "another process";

/// The exclusive use of a file; released when it is dropped.
#[derive(Debug)]
pub struct FileLock {
    /// The file beside it, which is locked while it is open.
    locked: File,
    path: PathBuf,
}

impl FileLock {
    /// Takes the exclusive use of a file, which need not exist.
    ///
    /// # Errors
    /// [`FileError::InUse`] if it is locked, with its holder; [`FileError::Unwritable`] if nothing
    /// can be written in its folder; [`FileError::Unsuitable`] if another file has the name of the
    /// lock, or if the file has several names, of which a lock would keep one only.
    pub fn acquire(path: &Path) -> Result<Self, FileError> {
        let name = path.display().to_string();
        check_single_name(path)?;
        let unwritable = |source| FileError::Unwritable { file: name.clone(), source };
        let beside = lock_path(path).map_err(unwritable)?;
        for _ in 0..MAX_ATTEMPTS {
            if beside.is_dir() {
                return Err(foreign_lock(&beside, "a folder"));
            }
            let mut file = open(&beside).map_err(unwritable)?;
            match file.try_lock() {
                Ok(()) if is_current(&file, &beside) => {
                    if !is_lock(&mut file) {
                        return Err(foreign_lock(
                            &beside,
                            "a file that is no lock of this program",
                        ));
                    }
                    write_holder(&mut file);
                    return Ok(Self { locked: file, path: beside });
                }
                // The former holder removed it between the two steps.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(FileError::InUse { file: name, holder: read_holder(&mut file) });
                }
                Err(TryLockError::Error(error)) => return Err(unwritable(error)),
            }
        }
        Err(FileError::InUse { file: name, holder: UNKNOWN_HOLDER.to_owned() })
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // Without file numbers another program could lock the removed file and not notice.
        let is_numbered = open_file_number(&self.locked).is_some();
        if is_numbered && is_current(&self.locked, &self.path) {
            drop(fs::remove_file(&self.path));
        }
    }
}

/// Refuses a file that another program holds with a [`FileLock`].
///
/// # Errors
/// [`FileError::InUse`].
pub fn check_unlocked(path: &Path) -> Result<(), FileError> {
    let Ok(mut lock) = lock_path(path).and_then(File::open) else { return Ok(()) };
    // A shared lock does not disturb a program that begins at this moment for longer than this.
    match lock.try_lock_shared() {
        Err(TryLockError::WouldBlock) => {
            let (file, holder) = (path.display().to_string(), read_holder(&mut lock));
            Err(FileError::InUse { file, holder })
        }
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// Refuses a file with several hard links: to replace it under one name would part it from the
/// others.
#[cfg(unix)]
fn check_single_name(path: &Path) -> Result<(), FileError> {
    use std::os::unix::fs::MetadataExt as _;
    let names =
        fs::metadata(path).ok().filter(fs::Metadata::is_file).map_or(1, |data| data.nlink());
    if names < 2 {
        return Ok(());
    }
    Err(FileError::Unsuitable {
        file: path.display().to_string(),
        found: format!("a file with {names} names (hard links), which saving would part"),
        expected: "a file with one name; symbolic links to it are kept".to_owned(),
    })
}

#[cfg(not(unix))]
fn check_single_name(_path: &Path) -> Result<(), FileError> {
    Ok(())
}

/// The file beside a file that is locked in its place.
fn lock_path(path: &Path) -> io::Result<PathBuf> {
    let target = resolve_links(path)?;
    let name = target.file_name().ok_or_else(|| io::Error::other("it has no file name"))?;
    Ok(target.with_file_name(format!(".{}.lock", name.to_string_lossy())))
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)
}

/// True if an open file still has this path.
fn is_current(file: &File, path: &Path) -> bool {
    open_file_number(file) == file_number(path)
}

#[cfg(unix)]
fn open_file_number(file: &File) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt as _;
    file.metadata().ok().map(|data| [data.dev(), data.ino()])
}

#[cfg(not(unix))]
fn open_file_number(_file: &File) -> Option<[u64; 2]> {
    None
}

/// The error of a file that has the name of a lock and is none.
fn foreign_lock(path: &Path, found: &str) -> FileError {
    FileError::Unsuitable {
        file: path.display().to_string(),
        found: found.to_owned(),
        expected: "nothing of this name, which is that of the lock".to_owned(),
    }
}

/// True if a file contains nothing but the number of a process: anything else must not be written
/// over or removed.
fn is_lock(file: &mut File) -> bool {
    let mut bytes = Vec::new();
    let read = file.take(MAX_NUMBER + 1).read_to_end(&mut bytes);
    let is_short = bytes.len() as u64 <= MAX_NUMBER;
    read.is_ok() && is_short && bytes.iter().all(u8::is_ascii_digit)
}

/// Writes the number of this process. A disk without room for it does not matter: the lock holds.
fn write_holder(file: &mut File) {
    let number = std::process::id().to_string();
    let emptied = file.set_len(0).and_then(|()| file.rewind());
    drop(emptied.and_then(|()| file.write_all(number.as_bytes())));
}

/// The process that holds the lock, as text.
fn read_holder(file: &mut File) -> String {
    let mut text = String::new();
    // Some systems do not let others read what is locked.
    let read = file.take(MAX_NUMBER).read_to_string(&mut text);
    match text.trim().parse::<u32>() {
        Ok(number) if read.is_ok() => format!("process {number}"),
        _ => UNKNOWN_HOLDER.to_owned(),
    }
}
