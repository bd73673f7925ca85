//! Progress and interruption of a long run: a bar on standard error, and the signals that end it.

use super::output::print_note;
use crate::measure::Stopwatch;
use indicatif::{ProgressBar, ProgressStyle};
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGTERM};
use std::io::{IsTerminal as _, stderr};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

/// True if the signals belong to a program that this library is a part of.
static SIGNALS_ARE_OF_HOST: AtomicBool = AtomicBool::new(false);

/// The flag of all commands that such a program runs.
static HOST_FLAG: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Leaves all signals to the program that this library is a part of, which ends commands by
/// [`stop_of_host`].
pub(super) fn leave_signals_to_host() {
    SIGNALS_ARE_OF_HOST.store(true, Ordering::Relaxed);
    HOST_FLAG.store(false, Ordering::Relaxed);
}

/// True if another program that this library is a part of decides what signals do.
pub(super) fn are_signals_of_host() -> bool {
    SIGNALS_ARE_OF_HOST.load(Ordering::Relaxed)
}

/// Ends the commands that the program runs which this library is a part of.
pub(super) fn stop_of_host() {
    HOST_FLAG.store(true, Ordering::Relaxed);
}

/// A flag that is raised by Ctrl-C, by a request to terminate, and by the end of the terminal; once
/// it is raised, further signals have no effect.
pub(super) fn stop_flag() -> Arc<AtomicBool> {
    if are_signals_of_host() {
        return Arc::clone(&HOST_FLAG);
    }
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    if let Err(error) = ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed)) {
        log::warn!("Ctrl-C will not save the best lens: {error}");
    }
    #[cfg(unix)]
    raise_on_signals(&flag);
    flag
}

/// Raises a flag at the signals that end a run besides Ctrl-C. A run under `nohup` ignores the end
/// of its terminal.
#[cfg(unix)]
fn raise_on_signals(flag: &Arc<AtomicBool>) {
    let hang_up = (!ignores_hang_up()).then_some(SIGHUP);
    for signal in [SIGTERM].into_iter().chain(hang_up) {
        if let Err(error) = signal_hook::flag::register(signal, Arc::clone(flag)) {
            log::warn!("signal {signal} will not save the best lens: {error}");
        }
    }
}

/// True if this process was started so that it ignores the end of its terminal, where the system
/// tells.
#[cfg(unix)]
fn ignores_hang_up() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // Signal 1 is the lowest bit.
    mask.is_some_and(|mask| mask >> (SIGHUP - 1) & 1 == 1)
}

/// A bar on standard error, shown if that is a terminal.
pub(super) fn progress_bar(steps: usize) -> ProgressBar {
    styled_bar(steps, "{wide_bar} {pos}/{len} {msg} {eta}")
}

/// A bar of this template.
pub(super) fn styled_bar(steps: usize, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template);
    let bar = ProgressBar::new(steps as u64);
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Lines on standard error that say where a long run is: the first after ten seconds, each of the others after
/// twice the time, at most ten minutes, so that a log of a day stays short.
#[derive(Debug)]
pub(super) struct ProgressNotes {
    clock: Stopwatch,
    /// The seconds at which the next line is due, and those from the line before to it.
    due: f64,
    pause: f64,
}

impl ProgressNotes {
    const FIRST: f64 = 10.0;
    const LONGEST: f64 = 600.0;

    pub(super) fn new() -> Self {
        Self { clock: Stopwatch::start(), due: Self::FIRST, pause: Self::FIRST }
    }

    /// Those of a run with a bar, which is shown on a terminal only: `None` there.
    pub(super) fn in_place_of_bar() -> Option<Self> {
        (!stderr().is_terminal()).then(Self::new)
    }

    /// Prints a line if one is due.
    pub(super) fn tell(&mut self, text: impl FnOnce() -> String) {
        let seconds = self.clock.seconds();
        if seconds < self.due {
            return;
        }
        print_note(format!("after {seconds:.0} s: {}", text()));
        self.pause = (2.0 * self.pause).min(Self::LONGEST);
        self.due = seconds + self.pause;
    }
}

/// Runs work that reports how many of its parts are done, with a bar that counts them. A request to
/// end breaks it off after a part, which is said; the second value is then true.
pub(super) fn with_bar<T>(
    stop: &AtomicBool,
    parts: &str,
    work: impl FnOnce(&mut dyn FnMut(usize, usize) -> ControlFlow<()>) -> T,
) -> (T, bool) {
    let bar = styled_bar(0, &format!("{{wide_bar}} {{pos}}/{{len}} {parts}"));
    let mut stopped = false;
    let result = work(&mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        stopped = done < all && stop.load(Ordering::Relaxed);
        if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    if stopped {
        print_note(STOPPED_NOTE);
    }
    (result, stopped)
}

/// Prints a note if a benchmark was asked to end.
pub(super) fn note_if_stopped(stop: &AtomicBool) {
    if stop.load(Ordering::Relaxed) {
        print_note(STOPPED_NOTE);
    }
}

const STOPPED_NOTE: &str = "note: stopped; only what was measured before is printed";
