//! A file that a task names, whose content is read explicitly.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// The path of a file, with its content once it has been read. Clones share the content; the task
/// file holds the path alone.
#[derive(Serialize, Deserialize)]
#[serde(from = "PathBuf", into = "PathBuf", bound = "")]
pub struct TaskFile<T> {
    path: PathBuf,
    content: Arc<OnceLock<T>>,
}

impl<T> TaskFile<T> {
    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path as text, for messages.
    pub(in crate::grin_design) fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// The content; `None` before it is read.
    pub(in crate::grin_design) fn content(&self) -> Option<&T> {
        self.content.get()
    }

    /// Reads the content, unless it has been read.
    pub(in crate::grin_design) fn read<E>(
        &self,
        reader: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Result<&T, E> {
        if let Some(content) = self.content.get() {
            return Ok(content);
        }
        let content = reader(&self.path)?;
        Ok(self.content.get_or_init(|| content))
    }
}

impl<T> Clone for TaskFile<T> {
    fn clone(&self) -> Self {
        Self { path: self.path.clone(), content: Arc::clone(&self.content) }
    }
}

impl<T> PartialEq for TaskFile<T> {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path
    }
}

impl<T> fmt::Debug for TaskFile<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("TaskFile").field(&self.path).finish()
    }
}

impl<T> From<PathBuf> for TaskFile<T> {
    fn from(path: PathBuf) -> Self {
        Self { path, content: Arc::default() }
    }
}

impl<T> From<&str> for TaskFile<T> {
    fn from(path: &str) -> Self {
        PathBuf::from(path).into()
    }
}

impl<T> From<TaskFile<T>> for PathBuf {
    fn from(file: TaskFile<T>) -> Self {
        file.path
    }
}
