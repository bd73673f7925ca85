//! The file behind a path: links, `.` and `..` may lead to one file by several paths.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The maximum number of links that are followed to a file that does not exist yet.
const MAX_LINKS: usize = 40;

/// The file that a path leads to; it need not exist.
#[derive(Debug, Clone)]
pub struct FileIdentity {
    path: PathBuf,
    /// The number of the file and that of its device, by which the system knows it; `None` if the
    /// file does not exist, or the system has no such numbers.
    number: Option<[u64; 2]>,
}

impl FileIdentity {
    /// The file of a path.
    pub fn of(path: &Path) -> Self {
        let path = resolve_links(path).unwrap_or_else(|_| path.to_owned());
        Self { number: file_number(&path), path }
    }

    /// The name of the file, if it lies in a folder.
    pub fn name_in(&self, folder: &Self) -> Option<&str> {
        let lies_there = self.path.parent() == Some(&folder.path);
        self.path.file_name().filter(|_| lies_there)?.to_str()
    }

    /// True if both are one file, whatever their paths; two names of a file that is linked twice
    /// are the same file too.
    pub fn is_same(&self, other: &Self) -> bool {
        self.path == other.path || self.number.is_some() && self.number == other.number
    }
}

/// The canonical path of the file that a path leads to, which need not exist: a link to a missing
/// file leads to the place of that file.
pub(super) fn resolve_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        if let Ok(canonical) = fs::canonicalize(&path) {
            return Ok(canonical);
        }
        let folder = folder_of(&path).to_owned();
        let Ok(target) = fs::read_link(&path) else {
            let name = path.file_name().ok_or_else(|| io::Error::other("it has no file name"))?;
            return Ok(fs::canonicalize(folder)?.join(name));
        };
        path = folder.join(target);
    }
    Err(io::Error::other("it is a link that leads to itself"))
}

/// The folder of a path; the current one if the path is a name alone.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(unix)]
pub(super) fn file_number(path: &Path) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt as _;
    fs::metadata(path).ok().map(|data| [data.dev(), data.ino()])
}

#[cfg(not(unix))]
pub(super) fn file_number(_path: &Path) -> Option<[u64; 2]> {
    None
}
