//! The journal of a design: everything that happens to it, as it happens, so that a program that is
//! killed loses nothing.
//!
//! A journal is a file of lines that are only appended, each with a checksum. A thread of its own
//! writes it, so that the window waits for nothing. What follows a damaged line is cut off when the
//! journal is read; a journal that has become long is written anew without the oldest versions.
//! There is one journal a design, locked while the design is open.

mod entry;
mod file;
mod state;
mod writer;

pub(super) use entry::{JournalEntry, RunRecord};
pub(super) use file::JournalFile;
pub(super) use state::JournalState;
pub(super) use writer::Journal;
