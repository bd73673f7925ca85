//! The times of a session: edits, drags of a handle, and what the journal adds on the window's thread.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crate::files;
use crate::lens::{Edit, Lens, Parameter, Quantity};
use crate::measure::time_ms;
use crate::paraxial::{DragSettings, FirstOrderLock, Handle};
use crate::session::{Command, Session};

/// The number of timed edits with all their results.
const EDITS: usize = 21;
/// The number of timed moves of a handle, and of timed edits with and without a journal.
const MOVES: usize = 200;
/// The longest time for the analysis after an edit.
const MAX_POLLS: u32 = 20_000; // looks, a tenth of a millisecond apart

/// Some times in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimeSummary {
    pub(super) median: f64,
    pub(super) slowest: f64,
}

impl TimeSummary {
    /// `None` without any times.
    fn new(times: impl Iterator<Item = f64>) -> Option<Self> {
        let mut times: Vec<f64> = times.collect();
        times.sort_by(f64::total_cmp);
        Some(Self { median: *times.get(times.len() / 2)?, slowest: *times.last()? })
    }
}

/// Changes a radius and waits each time for the numbers of all panels.
pub(super) fn time_edits(session: &mut Session, stop: &AtomicBool) -> Option<TimeSummary> {
    let going_on = (0..EDITS).take_while(|_| !stop.load(Ordering::Relaxed));
    TimeSummary::new(going_on.map(|i| time_edit(session, i)))
}

fn time_edit(session: &mut Session, i: usize) -> f64 {
    let curvature = Parameter::new(0, Quantity::Curvature);
    let factor = if i.is_multiple_of(2) { 1.001 } else { 1.0 / 1.001 };
    let value = session.lens().get(curvature).unwrap_or(0.0) / factor;
    let edit = Edit::Set { parameter: curvature, value };
    let ((), ms) = time_ms(|| {
        session.apply(Command::Edit(edit));
        session.apply(Command::CommitEdit);
        for _ in 0..MAX_POLLS {
            if session.view().is_current() {
                break;
            }
            thread::sleep(Duration::from_micros(100));
        }
    });
    ms
}

/// The lens with the most surfaces of those that come with the program.
pub(super) fn largest_lens() -> Option<Lens> {
    let open = |bundled: &files::BundledLens| {
        files::parse(bundled.text.as_bytes(), bundled.name).ok().map(|opened| opened.lens)
    };
    files::bundled_lenses().iter().filter_map(open).max_by_key(|lens| lens.surfaces.len())
}

/// Moves a handle of a lens, with the focal length held.
pub(super) fn time_moves(
    session: &mut Session,
    lens: Lens,
    stop: &AtomicBool,
) -> Option<TimeSummary> {
    session.apply(Command::New(Box::new(lens)));
    let locks = vec![FirstOrderLock::FocalLength];
    session.apply(Command::SetDragSettings(DragSettings { locks, ..DragSettings::default() }));
    // Nobody takes a handle before it is drawn.
    wait_for_numbers(session);
    let start = session.lens().surfaces[0].curvature;
    let going_on = (0..MOVES).take_while(|_| !stop.load(Ordering::Relaxed));
    let times = TimeSummary::new(going_on.map(|i| time_move(session, start, i)));
    session.apply(Command::CancelDrag);
    session.apply(Command::SetDragSettings(DragSettings::default()));
    times
}

/// The time of a move of the first curvature to all numbers.
fn time_move(session: &mut Session, start: f64, i: usize) -> f64 {
    let value = start * (1.0 + 1e-4 * i as f64);
    let ((), ms) = time_ms(|| {
        session.apply(Command::DragHandle { handle: Handle::Curvature(0), value, rim: None });
        wait_for_numbers(session);
    });
    ms
}

/// Waits for all numbers of the design, the derivatives at its handles included.
fn wait_for_numbers(session: &mut Session) {
    for _ in 0..MAX_POLLS {
        session.poll();
        let view = session.view();
        let slopes = view.drag.slopes.as_ref().map(|slopes| slopes.version);
        if view.is_current() && slopes == Some(view.version) {
            break;
        }
        thread::sleep(Duration::from_micros(100));
    }
}

/// Edits of the largest lens without a journal and with one, until the commands return.
pub(super) fn time_journaled_edits(stop: &AtomicBool) -> Option<[TimeSummary; 2]> {
    let folder = std::env::temp_dir().join(format!("aplanat-journal-{}", std::process::id()));
    let without = time_returns(None, stop);
    let with = time_returns(Some(folder.clone()), stop);
    if let Err(why) = std::fs::remove_dir_all(&folder) {
        log::warn!("{}: {why}", folder.display());
    }
    Some([without?, with?])
}

fn time_returns(journals: Option<PathBuf>, stop: &AtomicBool) -> Option<TimeSummary> {
    let mut session = Session::new(largest_lens()?, || {}).ok()?;
    if let Some(folder) = journals {
        session.set_journal_folder(folder, || {}).ok()?;
    }
    let going_on = (0..MOVES).take_while(|_| !stop.load(Ordering::Relaxed));
    TimeSummary::new(going_on.map(|i| {
        let edit = Edit::SetName(i.to_string());
        let ((), ms) = time_ms(|| {
            session.apply(Command::Edit(edit));
            session.apply(Command::CommitEdit);
        });
        ms
    }))
}
