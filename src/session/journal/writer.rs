//! The thread that writes a journal.

use super::entry::JournalEntry;
use super::file::JournalFile;
use super::state::JournalState;
use crate::session::run::RunKind;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// The time after which the disk is to have what was written.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);

/// A request to the thread.
enum JournalRequest {
    /// Closes the journal and begins that of another design, which is written once something happens
    /// to it.
    Begin(Box<JournalState>),
    /// Closes the journal and goes on with this one.
    Continue(Box<JournalFile>),
    /// Appends an entry.
    Append(JournalEntry),
    /// Answers once everything so far is on the disk.
    Sync(Sender<()>),
    /// Closes the journal.
    Close,
}

/// The session's handle of the journal. Dropping it closes the journal, except in a panic.
#[derive(Debug)]
pub(in crate::session) struct Journal {
    folder: PathBuf,
    requests: Option<Sender<JournalRequest>>,
    problems: Receiver<String>,
    thread: Option<JoinHandle<()>>,
}

impl Journal {
    /// Starts the thread with the journal of a design; `wake` is called when there is a problem.
    pub(in crate::session) fn spawn(
        folder: PathBuf,
        state: JournalState,
        wake: impl Fn() + Send + 'static,
    ) -> io::Result<Self> {
        let (requests, inbox) = mpsc::channel();
        let (sender, problems) = mpsc::channel();
        let report = move |text: String| {
            // Nobody listens while the session is being dropped.
            sender.send(text).unwrap_or_default();
            wake();
        };
        let begun = Some(Box::new(state));
        let writer = JournalWriter {
            folder: folder.clone(),
            begun,
            file: None,
            has_failed: false,
            report: Box::new(report),
        };
        let thread = thread::Builder::new().name("journal".to_owned());
        let thread = Some(thread.spawn(move || writer.serve(&inbox))?);
        Ok(Self { folder, requests: Some(requests), problems, thread })
    }

    /// The folder of all journals.
    pub(in crate::session) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends an entry.
    pub(in crate::session) fn record(&self, entry: JournalEntry) {
        self.send(JournalRequest::Append(entry));
    }

    /// Closes the journal and begins that of another design.
    pub(in crate::session) fn begin(&self, state: JournalState) {
        self.send(JournalRequest::Begin(Box::new(state)));
    }

    /// Closes the journal and goes on with another one.
    pub(in crate::session) fn go_on_with(&self, file: JournalFile) {
        self.send(JournalRequest::Continue(Box::new(file)));
    }

    /// Notes that the lenses of a run are accepted or dismissed.
    pub(in crate::session) fn end_run(&self, kind: RunKind) {
        self.record(JournalEntry::RunEnded(kind));
    }

    /// Waits until everything so far is on the disk.
    pub(in crate::session) fn sync(&self) {
        let (sender, done) = mpsc::channel();
        self.send(JournalRequest::Sync(sender));
        done.recv().unwrap_or_default();
    }

    /// The problems since the last call.
    pub(in crate::session) fn problems(&self) -> Vec<String> {
        self.problems.try_iter().collect()
    }

    fn send(&self, request: JournalRequest) {
        if let Some(requests) = &self.requests {
            requests.send(request).unwrap_or_default();
        }
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        if !thread::panicking() {
            self.send(JournalRequest::Close);
        }
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

/// The thread's side.
struct JournalWriter {
    folder: PathBuf,
    /// A design to which nothing has happened yet.
    begun: Option<Box<JournalState>>,
    file: Option<JournalFile>,
    /// True after a failure that was reported.
    has_failed: bool,
    report: Box<dyn Fn(String) + Send>,
}

impl JournalWriter {
    fn serve(mut self, inbox: &Receiver<JournalRequest>) {
        loop {
            let unsynced = self.file.as_ref().is_some_and(JournalFile::is_dirty);
            let request = if unsynced {
                inbox.recv_timeout(SYNC_INTERVAL)
            } else {
                inbox.recv().map_err(|_closed| RecvTimeoutError::Disconnected)
            };
            match request {
                Ok(request) => self.handle(request),
                Err(RecvTimeoutError::Timeout) => self.sync(),
                Err(RecvTimeoutError::Disconnected) => return self.sync(),
            }
        }
    }

    fn handle(&mut self, request: JournalRequest) {
        match request {
            JournalRequest::Begin(state) => {
                self.close();
                self.begun = Some(state);
            }
            JournalRequest::Continue(file) => {
                self.close();
                self.file = Some(*file);
            }
            JournalRequest::Append(entry) => self.append(&entry),
            JournalRequest::Sync(done) => {
                self.sync();
                done.send(()).unwrap_or_default();
            }
            JournalRequest::Close => self.close(),
        }
    }

    fn append(&mut self, entry: &JournalEntry) {
        let appended = self.try_append(entry);
        match appended {
            Ok(0) => {}
            Ok(forgotten) => {
                let text = format!(
                    "the journal became too long: the {forgotten} oldest versions of the history \
                     are not in it any more"
                );
                (self.report)(text);
            }
            Err(why) => self.fail(&why),
        }
    }

    fn try_append(&mut self, entry: &JournalEntry) -> io::Result<usize> {
        if self.file.is_none() {
            let matters = matches!(
                entry,
                JournalEntry::Node(_) | JournalEntry::Run(_) | JournalEntry::Saved { .. }
            );
            let Some(state) = &mut self.begun else { return Ok(0) };
            if !matters {
                state.apply(entry);
                return Ok(0);
            }
            self.file = Some(JournalFile::create(&self.folder, (**state).clone())?);
            self.begun = None;
        }
        let Some(file) = &mut self.file else { return Ok(0) };
        let forgotten = file.append(entry)?;
        if matches!(entry, JournalEntry::Saved { .. }) {
            file.follow_document(&self.folder)?;
        }
        Ok(forgotten)
    }

    fn sync(&mut self) {
        if let Some(Err(why)) = self.file.as_mut().map(JournalFile::sync) {
            self.fail(&why);
        }
    }

    fn close(&mut self) {
        self.begun = None;
        if let Some(Err(why)) = self.file.take().map(|file| file.close(&self.folder)) {
            self.fail(&why);
        }
    }

    /// Reports the first failure: changes are not protected from then on.
    fn fail(&mut self, why: &io::Error) {
        if !std::mem::replace(&mut self.has_failed, true) {
            let folder = self.folder.display();
            (self.report)(format!(
                "changes are not journaled and would be lost in a crash: {folder}: {why}"
            ));
        }
    }
}
