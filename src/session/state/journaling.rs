//! The entries that a session writes into its journal, and the recovery of a design from one.

use super::Session;
use crate::files;
use crate::lens::Lens;
use crate::session::clock::Throttle;
use crate::session::history::VersionOrigin;
use crate::session::journal::{Journal, JournalEntry, JournalFile, JournalState, RunRecord};
use crate::session::run::RunKind;
use crate::session::view::Severity;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The shortest time between two records of running computations.
const RUN_INTERVAL: Duration = Duration::from_millis(500);

/// The number of unsaved changes that are told by their titles.
const TOLD_CHANGES: usize = 3;

/// A title, a merit and a lens that a run has found.
type RunLens = (String, Option<f64>, Arc<Lens>);

/// The journal of a session, and what of its runs is in it.
#[derive(Debug)]
pub(super) struct Journaling {
    journal: Option<Journal>,
    throttle: Throttle,
    /// The merit of the optimized lens that was recorded last.
    best: Option<f64>,
    /// The spot radius and the light of the lenses of the front that were recorded.
    front: Vec<[f64; 2]>,
}

impl Default for Journaling {
    fn default() -> Self {
        let throttle = Throttle::new(RUN_INTERVAL);
        Self { journal: None, throttle, best: None, front: Vec::new() }
    }
}

impl Session {
    /// Journals all changes in a folder from now on, so that they survive the end of the program.
    ///
    /// # Errors
    /// A system that cannot start a thread.
    pub fn set_journal_folder(
        &mut self,
        folder: impl Into<PathBuf>,
        wake: impl Fn() + Send + 'static,
    ) -> io::Result<()> {
        let journal = Journal::spawn(folder.into(), self.journal_state(), wake)?;
        self.journaling = Journaling { journal: Some(journal), ..Journaling::default() };
        Ok(())
    }

    /// Reopens the design whose program ended last without closing it, as it was then, whether it was
    /// saved or not. Returns true if there was one.
    pub fn recover(&mut self) -> bool {
        let Some(journal) = &self.journaling.journal else { return false };
        // An open journal is locked, so that it is not among the others.
        let last = JournalFile::interrupted_last(journal.folder());
        let mut unfinished = JournalFile::unfinished(journal.folder()).into_iter();
        let Some(file) = last.or_else(|| unfinished.next()) else { return false };
        let others = unfinished.count();
        self.continue_journal(file);
        if others > 0 {
            let designs = counted_designs(others, "more design");
            self.post_beside(format!("{designs} not closed; the next start reopens one"));
        }
        true
    }

    /// Says how many designs other than this one wait to be reopened.
    pub fn tell_unfinished(&mut self) {
        let Some(journal) = &self.journaling.journal else { return };
        // The journal of this design is in use and does not count.
        journal.sync();
        let others = JournalFile::unfinished(journal.folder()).len();
        if others > 0 {
            let designs = counted_designs(others, "other design");
            let text = format!("{designs} not closed; a start without a file reopens one");
            self.post_beside(text);
        }
    }

    /// Posts a note, together with the last one if that is recent: one line shows both.
    fn post_beside(&mut self, text: String) {
        let last = self.messages.last().filter(|_| self.message_is_recent).cloned();
        match last.filter(|last| last.severity == Severity::Note) {
            Some(last) => {
                Arc::make_mut(&mut self.messages).pop();
                self.post(Severity::Note, format!("{}; {text}", last.text));
            }
            None => self.post(Severity::Note, text),
        }
    }

    /// Waits until the journal is on the disk.
    pub fn sync_journal(&self) {
        if let Some(journal) = &self.journaling.journal {
            journal.sync();
        }
    }

    pub(super) fn record(&self, entry: JournalEntry) {
        if let Some(journal) = &self.journaling.journal {
            journal.record(entry);
        }
    }

    pub(super) fn record_present(&self) {
        self.record(JournalEntry::Present(self.history.present()));
    }

    /// Notes that the lenses of a run are accepted or dismissed.
    pub(super) fn end_journaled_run(&mut self, kind: RunKind) {
        match kind {
            RunKind::Optimization => self.journaling.best = None,
            _ => self.journaling.front.clear(),
        }
        if let Some(journal) = &self.journaling.journal {
            journal.end_run(kind);
        }
    }

    /// The present state as a journal begins with it.
    fn journal_state(&self) -> JournalState {
        let locks = self.drag.settings.clone();
        JournalState::begin(self.path.clone(), self.history.clone()).holding(locks)
    }

    /// Closes the journal of the design before and begins one of this design.
    pub(super) fn begin_journal(&mut self) {
        (self.journaling.best, self.journaling.front) = (None, Vec::new());
        if let Some(journal) = &self.journaling.journal {
            journal.begin(self.journal_state());
        }
    }

    /// Takes over the history of the file that was just opened; if its program ended without closing
    /// it, the design as it was then.
    pub(super) fn resume_journal(&mut self) {
        let (Some(journal), Some(path)) = (&self.journaling.journal, &self.path) else { return };
        let Some(mut file) = JournalFile::of_document(journal.folder(), path) else { return };
        if file.state.needs_recovery() {
            return self.continue_journal(file);
        }
        let saved = file.state.saved.and_then(|id| file.state.history.go_to(id));
        let Some(lens) = saved else { return };
        let opened = (Arc::clone(&self.lens), self.history.clone());
        self.history = file.state.history.clone();
        self.lens = Arc::clone(&lens);
        self.proposal = self.proposal_of_history();
        if !self.is_written_as(&opened.0) {
            // Another program has changed the file meanwhile: the history is of another lens.
            (self.lens, self.history) = opened;
            self.proposal = self.proposal_of_history();
            return;
        }
        self.saved = Arc::clone(&lens);
        self.set_design(lens);
        let interrupted = file.state.was_interrupted();
        if interrupted {
            self.drag.hold(file.state.locks.clone());
        }
        if let Some(journal) = &self.journaling.journal {
            journal.go_on_with(file);
        }
        self.record_present();
        if interrupted {
            self.post(Severity::Note, reopening_text(&self.lens.name, self.history.nodes().len()));
        }
    }

    /// Makes the design of a journal that was not closed the design.
    fn continue_journal(&mut self, file: JournalFile) {
        let state = file.state.clone();
        let Some(present) = state.history.node(state.history.present()).cloned() else { return };
        let saved = state.saved.and_then(|id| state.history.node(id)).cloned();
        let mut text = if state.needs_recovery() {
            recovery_text(&state, &present.lens)
        } else {
            reopening_text(&present.lens.name, state.history.nodes().len())
        };
        self.replace_design(Lens::clone(&present.lens), state.path.clone());
        self.history = state.history;
        // A lens that was never saved differs from every file.
        self.saved =
            saved.map_or_else(|| Arc::new(crate::lens::blank()), |node| Arc::clone(&node.lens));
        self.set_design(Arc::clone(&present.lens));
        if let Some(path) = self.path.clone().filter(|_| !self.is_dirty() && !self.is_in_file()) {
            self.saved = Arc::new(crate::lens::blank());
            text = format!("{text}; it is not what {} contains now", path.display());
        }
        self.drag.hold(state.locks);
        if let Some(journal) = &self.journaling.journal {
            journal.go_on_with(file);
        }
        state.runs.iter().for_each(|run| self.keep_interrupted(run));
        self.post(Severity::Note, text);
    }

    /// True if the file of the design contains it.
    fn is_in_file(&self) -> bool {
        let opened = self.path.as_ref().and_then(|path| files::open(path).ok());
        opened.is_some_and(|opened| self.is_written_as(&opened.lens))
    }

    /// Adds the lenses of an interrupted run to the history.
    fn keep_interrupted(&mut self, run: &RunRecord) {
        for (title, merit, lens) in &run.lenses {
            let origin = VersionOrigin::new(title.clone());
            let node = self.history.branch(run.node, Arc::clone(lens), origin);
            self.history.change(node.id, |node| node.merit = *merit);
            if let Some(node) = self.history.node(node.id) {
                self.record(JournalEntry::Node(Arc::clone(node)));
            }
        }
        self.end_journaled_run(run.kind);
    }

    /// Journals what the runs have found since the last time.
    pub(super) fn journal_runs(&mut self) {
        let problems = self.journaling.journal.as_ref().map(Journal::problems);
        for problem in problems.into_iter().flatten() {
            self.post(Severity::Warning, problem);
        }
        let runs = self.optimization.status().is_active() || self.pareto.run.status().is_active();
        if !runs || self.journaling.journal.is_none() || !self.journaling.throttle.ready() {
            return;
        }
        let optimized = self.new_optimized_lens();
        let front = self.new_front_lenses();
        for (kind, lenses) in [(RunKind::Optimization, optimized), (RunKind::Pareto, front)] {
            if !lenses.is_empty() {
                let node = self.history.present();
                self.record(JournalEntry::Run(RunRecord { kind, node, lenses }));
            }
        }
    }

    /// The best lens of the optimization, if it is better than the one that was recorded.
    fn new_optimized_lens(&mut self) -> Vec<RunLens> {
        let Some(run) = self.optimization.snapshot() else { return Vec::new() };
        let Some(progress) = &run.progress else { return Vec::new() };
        if self.journaling.best == Some(progress.best) {
            return Vec::new();
        }
        self.journaling.best = Some(progress.best);
        let title = format!("optimization, interrupted at step {}", progress.step);
        vec![(title, Some(progress.best), Arc::clone(&run.best))]
    }

    /// The lenses of the front that were not recorded.
    fn new_front_lenses(&mut self) -> Vec<RunLens> {
        let Some(run) = self.pareto.run.snapshot() else { return Vec::new() };
        let mut found = Vec::new();
        for point in run.main.front.points() {
            let place = [point.spot, point.light];
            if !self.journaling.front.contains(&place) {
                self.journaling.front.push(place);
                let [spot, light] = [1e3 * point.spot, point.light];
                let title = format!("front, interrupted: {spot:.4} um, {light:.4} mm^2");
                found.push((title, None, Arc::new(point.lens.clone())));
            }
        }
        found
    }
}

/// The line that tells that a design was reopened which was saved before its program ended.
fn reopening_text(name: &str, versions: usize) -> String {
    let noun = if versions == 1 { "version" } else { "versions" };
    format!(
        "reopened {name} as it was saved, with the {versions} {noun} of its history: the program \
         ended without closing it"
    )
}

/// The line that tells what was recovered.
fn recovery_text(state: &JournalState, lens: &Lens) -> String {
    let changes = state.saved.map_or(0, |saved| state.history.distance(saved));
    let found: usize = state.runs.iter().map(|run| run.lenses.len()).sum();
    let lenses = match found {
        0 => String::new(),
        1 => " and 1 lens of an interrupted run, which is in the history".to_owned(),
        _ => format!(" and {found} lenses of interrupted runs, which are in the history"),
    };
    let plural = if changes == 1 { "change" } else { "changes" };
    let titles = state.saved.map(|saved| state.history.titles_since(saved)).unwrap_or_default();
    let told = titles.iter().take(TOLD_CHANGES).copied().collect::<Vec<_>>().join(", ");
    let told = match titles.len() {
        0 => String::new(),
        1..=TOLD_CHANGES => format!(" ({told})"),
        _ => format!(" (the last: {told})"),
    };
    format!(
        "recovered {}, which the program ended without closing, with {changes} unsaved \
         {plural}{told}{lenses}",
        lens.name
    )
}

/// A number of designs that were not closed, up to the verb.
fn counted_designs(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun} was") } else { format!("{count} {noun}s were") }
}
