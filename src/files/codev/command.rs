//! The commands of a sequence file: words separated by blanks, one command a line or several separated
//! by semicolons; `&` continues a line, `!` begins a comment.

use crate::files::error::ParseError;

/// The largest accepted number.
const MAX_NUMBER: f64 = 1e100;

/// One command.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Command {
    /// The line on which it begins, from 1.
    pub(super) line: usize,
    /// The first word, in upper case.
    pub(super) name: String,
    /// The surface that the command names, if its second word does.
    pub(super) surface: Option<SurfaceWord>,
    /// The other words; a quoted text is one word.
    pub(super) words: Vec<String>,
    /// The whole text.
    pub(super) text: String,
}

/// A surface that a command names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SurfaceWord {
    Object,
    Number(usize),
    Image,
}

/// The commands of a text.
pub(super) fn commands(text: &str) -> Vec<Command> {
    let mut commands = Vec::new();
    let mut joined = String::new();
    let mut first = 1;
    for (number, line) in (1..).zip(text.lines()) {
        let line = without_comment(line).trim_end();
        if joined.is_empty() {
            first = number;
        }
        if let Some(begun) = line.strip_suffix('&') {
            joined.push_str(begun);
            joined.push(' ');
            continue;
        }
        joined.push_str(line);
        commands.extend(split(&joined, ';').into_iter().filter_map(|text| parse(text, first)));
        joined.clear();
    }
    commands.extend(split(&joined, ';').into_iter().filter_map(|text| parse(text, first)));
    commands
}

fn without_comment(line: &str) -> &str {
    split(line, '!').first().copied().unwrap_or_default()
}

/// The parts of a text between separators that are not inside quotes.
fn split(text: &str, separator: char) -> Vec<&str> {
    let mut quote = None;
    text.split(|c: char| {
        match (quote, c) {
            (None, '\'' | '"') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
        quote.is_none() && c == separator
    })
    .collect()
}

fn parse(text: &str, line: usize) -> Option<Command> {
    let text = text.trim();
    let mut words = words(text).into_iter().peekable();
    let name = words.next()?.to_ascii_uppercase();
    let surface = words.peek().and_then(|word| surface_word(word));
    if surface.is_some() {
        words.next();
    }
    Some(Command { line, name, surface, words: words.collect(), text: text.to_owned() })
}

fn words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let (word, behind) = match first {
            '\'' | '"' => rest[1..].split_once(first).unwrap_or((&rest[1..], "")),
            _ => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        words.push(word.to_owned());
        rest = behind.trim_start();
    }
    words
}

/// The surface of a word such as `S3`, `SO` or `SI`.
pub(super) fn surface_word(word: &str) -> Option<SurfaceWord> {
    let word = word.to_ascii_uppercase();
    match word.as_str() {
        "SO" => Some(SurfaceWord::Object),
        "SI" => Some(SurfaceWord::Image),
        _ => {
            let digits = word.strip_prefix('S')?;
            let number = digits.parse().ok().filter(|_| digits.bytes().all(|b| b.is_ascii_digit()));
            number.map(SurfaceWord::Number)
        }
    }
}

/// A number; `None` for other words, and for numbers from 1e100 on.
pub(super) fn parse_number(word: &str) -> Option<f64> {
    let number: f64 = word.parse().ok()?;
    (number.abs() <= MAX_NUMBER).then_some(number)
}

impl Command {
    /// The error that the command is malformed.
    pub(super) fn malformed(&self, found: impl Into<String>, expected: &str) -> ParseError {
        let place = format!("line {}", self.line);
        ParseError { place, found: found.into(), expected: expected.to_owned() }
    }

    /// The number in a word, counted from 0 behind the name and the surface.
    pub(super) fn number(&self, word: usize) -> Result<f64, ParseError> {
        let found = self.words.get(word);
        found.and_then(|word| parse_number(word)).ok_or_else(|| {
            let found = format!("`{}`", self.text);
            self.malformed(found, &format!("a number below 1e100 as its word {}", word + 1))
        })
    }

    /// The last word as a number.
    pub(super) fn last_number(&self) -> Result<f64, ParseError> {
        self.number(self.words.len().saturating_sub(1))
    }

    /// All words as numbers.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, ParseError> {
        (0..self.words.len()).map(|word| self.number(word)).collect()
    }

    /// True if a word is this one, in any case.
    pub(super) fn has_word(&self, word: &str) -> bool {
        self.words.iter().any(|own| own.eq_ignore_ascii_case(word))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_joined_split_and_stripped() {
        let text = "rdm;len ! new\ntit 'a;b!c'\ns 0.1 &\n  2 ! glass\nwl 1; cir s3 edg 5";
        let found = commands(text);
        let names: Vec<&str> = found.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["RDM", "LEN", "TIT", "S", "WL", "CIR"]);
        assert_eq!(found[2].words, ["a;b!c"]);
        assert_eq!((found[3].line, found[3].numbers().unwrap()), (3, vec![0.1, 2.0]));
        assert_eq!(found[5].surface, Some(SurfaceWord::Number(3)));
        assert!(found[5].has_word("EDG") && found[5].last_number() == Ok(5.0));
    }

    #[test]
    fn words_that_are_no_numbers_are_refused() {
        for word in ["nan", "inf", "1e300", "five", "--1"] {
            assert_eq!(parse_number(word), None, "{word}");
        }
        assert!(commands("EPD x")[0].number(0).unwrap_err().found.contains("`EPD x`"));
        assert_eq!(surface_word("SLB"), None);
    }
}
