//! The file of a journal: where it lies, how it is read, appended to and written anew.

use super::entry::JournalEntry;
use super::state::JournalState;
use crate::files::{FileLock, write_atomic};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// The extension of journals.
const EXTENSION: &str = "journal";
/// The length at which a journal is written anew, in bytes.
const MAX_BYTES: u64 = 16 << 20;
/// The number of journals of closed designs that are kept.
const MAX_CLOSED: usize = 16;

/// A journal that is open for appending.
#[derive(Debug)]
pub(in crate::session) struct JournalFile {
    file: File,
    path: PathBuf,
    bytes: u64,
    /// True if there are lines that the disk may not have yet.
    is_dirty: bool,
    /// The state that the lines lead to.
    pub(in crate::session) state: JournalState,
    _lock: FileLock,
}

impl JournalFile {
    /// Begins the journal of a design in a folder, in place of an older one of the same design.
    pub(super) fn create(folder: &Path, state: JournalState) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let (path, lock) = free_path(folder, state.path.as_deref())?;
        let bytes = write_state(&path, &state)?;
        let file = OpenOptions::new().append(true).open(&path)?;
        Ok(Self { file, path, bytes, is_dirty: false, state, _lock: lock })
    }

    /// Opens a journal, without the lines that follow a damaged one; `None` if it is open elsewhere
    /// or has no beginning.
    pub(in crate::session) fn open(path: &Path) -> Option<Self> {
        let lock = FileLock::acquire(path).ok()?;
        let content = fs::read(path).ok()?;
        let (entries, bytes) = read_entries(&content);
        let state = JournalState::read(&entries)?;
        let file = OpenOptions::new().append(true).open(path).ok()?;
        file.set_len(bytes).ok()?;
        let path = path.to_owned();
        Some(Self { file, path, bytes, is_dirty: false, state, _lock: lock })
    }

    /// The journal of a lens file, if it has one that nobody uses.
    pub(in crate::session) fn of_document(folder: &Path, document: &Path) -> Option<Self> {
        let path = folder.join(file_name(Some(document), 0));
        path.exists().then(|| Self::open(&path)).flatten()
    }

    /// The journals in a folder that have something to recover, the newest first.
    pub(in crate::session) fn unfinished(folder: &Path) -> Vec<Self> {
        let paths = journals(folder).into_iter();
        paths.filter_map(|path| Self::open(&path)).filter(|j| j.state.needs_recovery()).collect()
    }

    /// The newest journal in a folder if it is of a file whose program ended without closing it, saved
    /// or not: somebody was at work on it. Older ones of saved designs tell of nothing that is missed.
    pub(in crate::session) fn interrupted_last(folder: &Path) -> Option<Self> {
        let newest = journals(folder).into_iter().next()?;
        let is_open = |state: &JournalState| state.was_interrupted() && state.path.is_some();
        Self::open(&newest).filter(|journal| is_open(&journal.state))
    }

    /// Appends an entry. Returns the number of versions that were forgotten since the file became
    /// too long.
    pub(super) fn append(&mut self, entry: &JournalEntry) -> io::Result<usize> {
        let line = entry.line().ok_or_else(|| io::Error::other("an entry has no text"))?;
        self.file.write_all(&line)?;
        self.is_dirty = true;
        self.bytes += line.len() as u64;
        self.state.apply(entry);
        if self.bytes > MAX_BYTES { self.shorten() } else { Ok(0) }
    }

    /// Hands the lines so far to the disk.
    pub(super) fn sync(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.is_dirty) { self.file.sync_data() } else { Ok(()) }
    }

    /// True if there are lines that the disk may not have yet.
    pub(super) const fn is_dirty(&self) -> bool {
        self.is_dirty
    }

    /// Writes the state anew, with fewer versions until it takes half of the room.
    fn shorten(&mut self) -> io::Result<usize> {
        let mut forgotten = 0;
        self.bytes = write_state(&self.path, &self.state)?;
        while self.bytes > MAX_BYTES / 2 && self.state.history.nodes().len() > 1 {
            let half = self.state.history.nodes().len() / 2;
            forgotten += self.state.history.prune(half);
            self.bytes = write_state(&self.path, &self.state)?;
        }
        self.file = OpenOptions::new().append(true).open(&self.path)?;
        Ok(forgotten)
    }

    /// Moves the journal to the place that belongs to the file of its design.
    pub(super) fn follow_document(&mut self, folder: &Path) -> io::Result<()> {
        let own = file_name(self.state.path.as_deref(), 0);
        if self.path.file_name().is_some_and(|name| *name == *own) {
            return Ok(());
        }
        let old = self.path.clone();
        *self = Self::create(folder, self.state.clone())?;
        fs::remove_file(old)
    }

    /// Ends the journal of a closed design. It is kept for its versions if the design has a file.
    pub(super) fn close(mut self, folder: &Path) -> io::Result<()> {
        if self.state.path.is_none() {
            return fs::remove_file(&self.path);
        }
        self.append(&JournalEntry::Closed)?;
        self.sync()?;
        drop(self);
        remove_surplus(folder);
        Ok(())
    }
}

/// The entries of a journal up to the first damaged line, and their length in bytes.
fn read_entries(content: &[u8]) -> (Vec<JournalEntry>, u64) {
    let mut entries = Vec::new();
    let mut bytes = 0;
    for line in content.split_inclusive(|byte| *byte == b'\n') {
        let Some(entry) = line.strip_suffix(b"\n").and_then(JournalEntry::from_line) else { break };
        bytes += line.len() as u64;
        entries.push(entry);
    }
    (entries, bytes)
}

/// Writes all lines of a state in place of a file. Returns its length in bytes.
fn write_state(path: &Path, state: &JournalState) -> io::Result<u64> {
    let lines: Vec<u8> = state.entries().iter().filter_map(JournalEntry::line).flatten().collect();
    write_atomic(path, &lines).map_err(io::Error::other)?;
    Ok(lines.len() as u64)
}

/// The journals in a folder, the one that was written last first.
fn journals(folder: &Path) -> Vec<PathBuf> {
    let Ok(files) = fs::read_dir(folder) else { return Vec::new() };
    let paths = files.flatten().map(|file| file.path());
    let journals = paths.filter(|path| path.extension().is_some_and(|end| end == EXTENSION));
    let dated =
        journals.filter_map(|path| Some((fs::metadata(&path).ok()?.modified().ok()?, path)));
    let mut dated: Vec<_> = dated.collect();
    dated.sort_by(|a, b| b.cmp(a));
    dated.into_iter().map(|(_, path)| path).collect()
}

/// Removes the oldest journals of closed designs beyond a number of them.
fn remove_surplus(folder: &Path) {
    for path in journals(folder).iter().skip(MAX_CLOSED) {
        if let Some(journal) = JournalFile::open(path)
            && !journal.state.needs_recovery()
        {
            // A journal that cannot be removed does no harm.
            drop(fs::remove_file(path));
        }
    }
}

/// The path of the journal of a design that no other program uses, with its lock.
fn free_path(folder: &Path, document: Option<&Path>) -> io::Result<(PathBuf, FileLock)> {
    let mut last = None;
    for number in 0..MAX_CLOSED {
        let path = folder.join(file_name(document, number));
        if document.is_none() && path.exists() {
            continue;
        }
        match FileLock::acquire(&path) {
            Ok(lock) => return Ok((path, lock)),
            Err(why) => last = Some(why),
        }
    }
    Err(last.map_or_else(|| io::Error::other("too many journals"), io::Error::other))
}

/// The name of the journal of a lens file, or of a design without one.
fn file_name(document: Option<&Path>, number: usize) -> String {
    let extra = if number == 0 { String::new() } else { format!("-{number}") };
    let Some(document) = document else { return format!("unsaved{extra}.{EXTENSION}") };
    let whole = fs::canonicalize(document).unwrap_or_else(|_| document.to_owned());
    let stem = document.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let checksum = crc32fast::hash(whole.as_os_str().as_encoded_bytes());
    format!("{stem}-{checksum:08x}{extra}.{EXTENSION}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Lens, blank};
    use crate::session::history::{DesignHistory, VersionOrigin};
    use std::sync::Arc;

    #[test]
    fn a_journal_that_is_too_long_forgets_its_oldest_versions() {
        let folder =
            std::env::temp_dir().join(format!("aplanat-long-journal-{}", std::process::id()));
        drop(fs::remove_dir_all(&folder));
        // Versions of 0.7 MB, of which half of the room holds some eleven.
        let lens = Arc::new(Lens { notes: "n".repeat(700_000), ..blank() });
        let mut history = DesignHistory::new(Arc::clone(&lens), VersionOrigin::new("opened"));
        for i in 0..12 {
            history.push(Arc::clone(&lens), VersionOrigin::new(format!("edit {i}")));
        }
        let present = history.present();
        let before = history.clone();
        history.push(lens, VersionOrigin::new("last"));
        let last = JournalEntry::Node(Arc::clone(history.node(present + 1).unwrap()));
        let mut file = JournalFile::create(&folder, JournalState::begin(None, before)).unwrap();
        // As if there had been many entries that are of no account any more.
        file.bytes = MAX_BYTES;
        let forgotten = file.append(&last).unwrap();
        file.sync().unwrap();
        let length = fs::metadata(&file.path).unwrap().len();
        assert!(length <= MAX_BYTES / 2 && length == file.bytes, "{length} {}", file.bytes);
        let kept = 14 - forgotten;
        assert!(forgotten > 0 && kept > 3, "{forgotten}");
        assert_eq!(file.append(&JournalEntry::Closed).unwrap(), 0);
        let path = file.path.clone();
        drop(file);
        let again = JournalFile::open(&path).unwrap();
        assert_eq!(again.state.history.nodes().len(), kept);
        assert!(again.state.history.node(present).is_some());
        drop(again);
        fs::remove_dir_all(&folder).unwrap();
    }
}
