//! Messages as a designer reads them: surfaces are counted from 1 in the window, from 0 in files.

use crate::session::RunStatus;

/// A message with every `surface 3` and `surfaces 3 to 5` counted one further.
pub fn counted_from_one(message: &str) -> String {
    let mut words: Vec<String> = message.split(' ').map(str::to_owned).collect();
    for i in 1..words.len() {
        let named = matches!(words[i - 1].as_str(), "surface" | "surfaces" | "Surface");
        let second = i > 2 && matches!(words[i - 1].as_str(), "to" | "and");
        if named || (second && words[i - 3].starts_with("surface")) {
            words[i] = one_more(&words[i]);
        }
    }
    words.join(" ")
}

/// A word that begins with a number, with that number one larger.
fn one_more(word: &str) -> String {
    let end = word.find(|c: char| !c.is_ascii_digit()).unwrap_or(word.len());
    let (digits, rest) = word.split_at(end);
    let number: Result<usize, _> = digits.parse();
    number.map_or_else(|_| word.to_owned(), |n| format!("{}{rest}", n + 1))
}

/// A text with a capital first letter.
pub fn capitalize(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    first + letters.as_str()
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
    fn surfaces_are_counted_from_one() {
        let cases = [
            ("radius of surface 0", "radius of surface 1"),
            ("surface 9: unknown glass `BK 7`", "surface 10: unknown glass `BK 7`"),
            ("surfaces 2 and 4 are both the stop", "surfaces 3 and 5 are both the stop"),
            ("flip surfaces 0 to 1", "flip surfaces 1 to 2"),
            ("2 surfaces are plane", "2 surfaces are plane"),
            ("the surface is plane", "the surface is plane"),
        ];
        for (message, counted) in cases {
            assert_eq!(counted_from_one(message), counted);
        }
    }
}
