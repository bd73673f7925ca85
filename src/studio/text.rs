//! Texts that several parts of the window share.

use crate::session::RunStatus;

/// A text with a capital first letter.
pub fn capitalize(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    first + letters.as_str()
}

/// A text of the library, whose lengths are in `um`, with the sign for micrometres.
pub fn micrometres(text: &str) -> String {
    text.replace(" um", " µm")
}

/// A text of the library, whose angles are in `deg`, with the sign for degrees.
pub fn degrees(text: &str) -> String {
    text.replace(" deg", "°")
}

/// A count with its noun, in the plural unless it is 1.
pub fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The status of a background run, as the window shows it.
pub fn status_text(status: RunStatus) -> &'static str {
    match status {
        RunStatus::Idle => "",
        RunStatus::Starting => "Starting…",
        RunStatus::Running => "Running",
        RunStatus::Pausing => "Pausing…",
        RunStatus::Paused => "Paused",
        RunStatus::Stopping => "Stopping…",
        RunStatus::Stopped => "Stopped",
        RunStatus::Finished => "Finished",
        RunStatus::Failed => "Failed",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_begin_with_a_capital_and_counts_have_plurals() {
        assert_eq!(capitalize("édition"), "Édition");
        assert_eq!(micrometres("3 um apart"), "3 µm apart");
        assert_eq!(degrees("14 deg"), "14°");
        assert_eq!([counted(1, "ray"), counted(0, "ray")], ["1 ray", "0 rays"]);
    }
}
