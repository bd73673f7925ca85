//! Errors of the JSON parser in the words of a lens file: place, found and expected.

use super::mismatch::{Mismatch, ValueError};
use super::strict::{MismatchSlot, Strict};
use crate::files::error::ParseError;
use serde::de::DeserializeOwned;
use serde_json::{Deserializer, Error, Value};

/// Parses JSON. An error names the line, the column and the keys that lead to the place, such as
/// `views[0].source`, where list positions count from 0.
pub(super) fn parse<T: DeserializeOwned>(text: &str) -> Result<T, ParseError> {
    let mut deserializer = Deserializer::from_str(text);
    let slot = MismatchSlot::default();
    let strict = Strict::new(&mut deserializer, &slot);
    let value = serde_path_to_error::deserialize(strict).map_err(|error| {
        let keys = error.path().to_string();
        match (error.into_inner(), slot.take()) {
            (ValueError::Mismatch(mismatch), _) => mismatch_error(mismatch, "line 1", &keys),
            (ValueError::Parser(error), Some(mismatch)) => {
                mismatch_error(mismatch, &position(&error), &keys)
            }
            (ValueError::Parser(error), None) => syntax_error(&error, &keys, text),
        }
    })?;
    deserializer.end().map_err(|error| syntax_error(&error, TOP, text))?;
    Ok(value)
}

/// The path of the outermost value.
const TOP: &str = ".";

fn position(error: &Error) -> String {
    format!("line {}, column {}", error.line(), error.column())
}

/// The place at a position, with the keys that lead there.
fn place(position: &str, keys: &str) -> String {
    if keys == TOP { position.to_owned() } else { format!("{position}, {keys}") }
}

/// The error of a value that does not fit.
fn mismatch_error(mismatch: Mismatch, position: &str, keys: &str) -> ParseError {
    let Mismatch { found, expected, .. } = mismatch;
    ParseError { place: place(position, keys), found, expected }
}

/// The error of a text that is not JSON.
fn syntax_error(error: &Error, keys: &str, text: &str) -> ParseError {
    let (found, expected) = if error.is_eof() {
        ("the end of the file".to_owned(), "the rest of it; is it truncated?".to_owned())
    } else {
        (word_at(text, error.line(), error.column()), expected_syntax(error, text))
    };
    ParseError { place: place(&position(error), keys), found, expected }
}

fn expected_syntax(error: &Error, text: &str) -> String {
    // The parser calls it a syntax error too if sound JSON is given in place of a named variant.
    if serde_json::from_str::<Value>(text).is_ok() {
        "a name, or an object with one key".to_owned()
    } else {
        format!("JSON ({error})")
    }
}

/// The word around a position, in quotes.
fn word_at(text: &str, line: usize, column: usize) -> String {
    let Some(line) = text.lines().nth(line.saturating_sub(1)) else {
        return "the end of the file".to_owned();
    };
    let bytes = line.as_bytes();
    let inside = |b: u8| b.is_ascii_alphanumeric() || b"+-._".contains(&b) || b >= 0x80;
    let at = column.saturating_sub(1).min(bytes.len());
    let start = bytes[..at].iter().rposition(|b| !inside(*b)).map_or(0, |i| i + 1);
    let end = bytes[at..].iter().position(|b| !inside(*b)).map_or(bytes.len(), |i| i + at);
    let end = end.max((start + 1).min(bytes.len())).min(start + 40);
    match String::from_utf8_lossy(&bytes[start.min(end)..end]) {
        word if word.is_empty() => "the end of the line".to_owned(),
        word => format!("`{word}`"),
    }
}
