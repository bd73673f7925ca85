//! Progress and interruption of a long run: a bar on standard error, and Ctrl-C.

use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C raises; a second Ctrl-C has no further effect.
pub(super) fn stop_flag() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    if let Err(error) = ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed)) {
        log::warn!("Ctrl-C will not save the best lens: {error}");
    }
    flag
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

/// Runs work that reports how many of its parts are done, with a bar that counts them.
pub(super) fn with_bar<T>(parts: &str, work: impl FnOnce(&mut dyn FnMut(usize, usize)) -> T) -> T {
    let bar = styled_bar(0, &format!("{{wide_bar}} {{pos}}/{{len}} {parts}"));
    let result = work(&mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    result
}
