//! Bounded reading: a file is read only up to the size that its kind can have, and neither devices
//! nor named pipes are opened, which may have no end or wait for a writer.

use super::FileError;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// The maximum size of a lens file, and of any other text that describes a design, in bytes.
pub const MAX_LENS_BYTES: u64 = 64_000_000;
/// The maximum size of rays, of a checkpoint and of a picture, in bytes.
pub const MAX_DATA_BYTES: u64 = 1_000_000_000;

/// Reads a file of at most `max` bytes.
///
/// # Errors
/// A file that cannot be read or is longer, a device, or a named pipe.
pub fn read_file(path: &Path, max: u64) -> Result<Vec<u8>, FileError> {
    let file = path.display().to_string();
    let unreadable = |source| FileError::Unreadable { file: file.clone(), source };
    let data = fs::metadata(path).map_err(unreadable)?;
    if let Some(found) = special_kind(path, &data) {
        let expected = "a file".to_owned();
        return Err(FileError::Unsuitable { file, found: found.to_owned(), expected });
    }
    let opened = open_unblocked(path, &data).map_err(unreadable)?;
    read_bounded(opened, &file, max).map_err(|error| match error {
        FileError::Unreadable { file, source } if source.kind() == ErrorKind::WouldBlock => {
            let found = "a file that waits for what is not written yet".to_owned();
            FileError::Unsuitable { file, found, expected: "a file with an end".to_owned() }
        }
        error => error,
    })
}

/// Opens a file so that reading does not wait: some files of the system itself, such as
/// `/proc/kmsg`, do. The pipes that a shell opens for a command do wait for it.
#[cfg(unix)]
fn open_unblocked(path: &Path, data: &Metadata) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt as _;
    let flags = if data.is_file() { libc::O_NONBLOCK } else { 0 };
    fs::OpenOptions::new().read(true).custom_flags(flags).open(path)
}

#[cfg(not(unix))]
fn open_unblocked(path: &Path, _data: &Metadata) -> io::Result<File> {
    File::open(path)
}

/// Reads at most `max` bytes to the end; `file` is the name of the source in messages.
///
/// # Errors
/// A source that cannot be read or is longer.
pub fn read_bounded(from: impl Read, file: &str, max: u64) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let read = from.take(max.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(|source| FileError::Unreadable { file: file.to_owned(), source })?;
    if bytes.len() as u64 <= max {
        return Ok(bytes);
    }
    let size = size_text(max);
    let (found, expected) = (format!("more than {size}"), format!("at most {size}"));
    Err(FileError::Unsuitable { file: file.to_owned(), found, expected })
}

/// A number of bytes as text.
fn size_text(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{bytes} bytes"),
        _ => format!("{:.0} MB", bytes as f64 / 1e6),
    }
}

/// The kind of a file that is not to be opened; `None` for files, folders, and the pipes that a
/// shell opens for a command, which have no name in the file system.
#[cfg(unix)]
fn special_kind(path: &Path, data: &Metadata) -> Option<&'static str> {
    use std::os::unix::fs::FileTypeExt as _;
    let kind = data.file_type();
    if kind.is_char_device() || kind.is_block_device() {
        Some("a device")
    } else if kind.is_socket() {
        Some("a socket")
    } else {
        (kind.is_fifo() && fs::canonicalize(path).is_ok()).then_some("a named pipe")
    }
}

#[cfg(not(unix))]
fn special_kind(_path: &Path, _data: &Metadata) -> Option<&'static str> {
    None
}
