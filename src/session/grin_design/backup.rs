//! The file in which the best field of a design is kept while the design goes on, so that it outlives
//! a program that is killed.

use crate::files::{FileLock, Volume, write_volume};
use crate::session::clock::{Throttle, time};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The shortest time between two writes.
const INTERVAL: Duration = Duration::from_secs(1);
/// The largest part of the time that they take.
const SHARE: f64 = 0.05;
/// The beginning of the names of these files.
const PREFIX: &str = "field-";
/// Their extension.
const EXTENSION: &str = "npz";

/// The number of nodes along a side of a field that is a spline in one coordinate.
pub(super) const NODES: usize = 65;

/// The backup of a field.
pub(super) struct FieldBackup {
    path: PathBuf,
    throttle: Throttle,
    lock: Option<FileLock>,
}

impl FieldBackup {
    /// A backup in a folder, in a file that no other program uses.
    pub(super) fn new(folder: &Path) -> Self {
        let path = folder.join(format!("{PREFIX}{}.{EXTENSION}", std::process::id()));
        Self { path, throttle: Throttle::new(INTERVAL), lock: None }
    }

    /// Writes a field, unless that was done a moment ago.
    pub(super) fn update(
        &mut self,
        volume: impl FnOnce() -> Result<Volume, String>,
    ) -> Result<(), String> {
        if !self.throttle.ready() {
            return Ok(());
        }
        let written = time(|| self.write(&volume()?));
        let pause = Duration::from_secs_f64(1e-3 * written.ms / SHARE);
        self.throttle = Throttle::new(INTERVAL.max(pause));
        self.throttle.ready();
        written.value
    }

    fn write(&mut self, volume: &Volume) -> Result<(), String> {
        if self.lock.is_none() {
            let folder = self.path.parent().map_or(Ok(()), fs::create_dir_all);
            folder.map_err(|why| format!("{}: {why}", self.path.display()))?;
            self.lock = Some(FileLock::acquire(&self.path).map_err(|why| why.to_string())?);
        }
        write_volume(&self.path, volume).map(drop).map_err(|why| why.to_string())
    }

    /// Removes the file: the field is saved, or given up.
    pub(super) fn remove(&mut self) {
        if self.lock.take().is_some()
            && let Err(why) = fs::remove_file(&self.path)
        {
            log::warn!("{}: {why}", self.path.display());
        }
    }
}

/// The newest field that a killed program has left in a folder. It gets another name, so that it is
/// found once; the others stay for the next start.
pub(super) fn take_interrupted(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let is_backup = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        let is_named = name.is_some_and(|name| name.starts_with(PREFIX));
        is_named && path.extension().is_some_and(|extension| extension == EXTENSION)
    };
    let left = files.map(|file| file.path()).filter(is_backup);
    let unused = left.filter(|path| FileLock::acquire(path).is_ok());
    let dated = unused.filter_map(|path| Some((path.metadata().ok()?.modified().ok()?, path)));
    let (_, newest) = dated.max_by_key(|(date, _)| *date)?;
    let found = folder.join(format!("interrupted.{EXTENSION}"));
    fs::rename(&newest, &found).ok()?;
    Some(found)
}
