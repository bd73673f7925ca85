//! Errors of the JSON parser in the words of a lens file: place, found and expected.

use super::strict::Strict;
use crate::files::error::ParseError;
use serde::de::DeserializeOwned;
use serde_json::{Deserializer, Error, Value};

/// An expected object, in messages.
const OBJECT: &str = "an object with its keys: {\"key\": ...}";

/// Parses JSON. An error names the line, the column and the keys that lead to the place, such as
/// `views[0].source`, where list positions count from 0.
pub(super) fn parse<T: DeserializeOwned>(text: &str) -> Result<T, ParseError> {
    let mut deserializer = Deserializer::from_str(text);
    let strict = Strict(&mut deserializer);
    let value = serde_path_to_error::deserialize(strict).map_err(|error| {
        let keys = error.path().to_string();
        translate(error.inner(), &keys, text)
    })?;
    deserializer.end().map_err(|error| translate(&error, TOP, text))?;
    Ok(value)
}

/// The path of the outermost value.
const TOP: &str = ".";

/// The error of the parser, at the value to which these keys lead.
fn translate(error: &Error, keys: &str, text: &str) -> ParseError {
    let mut place = format!("line {}, column {}", error.line(), error.column());
    if keys != TOP {
        place = format!("{place}, {keys}");
    }
    let (found, expected) = if error.is_eof() {
        ("the end of the file".to_owned(), "the rest of it; is it truncated?".to_owned())
    } else if error.is_syntax() {
        (word_at(text, error.line(), error.column()), expected_syntax(error, text))
    } else {
        found_and_expected(&message(error))
    };
    ParseError { place, found, expected }
}

/// The message of the parser without the position that it appends.
fn message(error: &Error) -> String {
    let position = format!(" at line {} column {}", error.line(), error.column());
    let whole = error.to_string();
    whole.strip_suffix(&position).unwrap_or(&whole).to_owned()
}

fn expected_syntax(error: &Error, text: &str) -> String {
    // The parser calls it a syntax error too if sound JSON is given in place of a named variant.
    if serde_json::from_str::<Value>(text).is_ok() {
        "a name, or an object with one key".to_owned()
    } else {
        format!("JSON ({})", message(error))
    }
}

/// The two halves of a message about a value, without the names of the program's types: serde
/// offers them only as text.
fn found_and_expected(message: &str) -> (String, String) {
    let message = message.strip_prefix("invalid type: ").unwrap_or(message);
    let (found, expected) = message.split_once(", expected ").unwrap_or((message, "it"));
    let found = match found.strip_prefix("missing field ") {
        Some(key) => format!("no key {key}"),
        None if found == "sequence" => "a list".to_owned(),
        None => found
            .replace("unit variant", "a name alone")
            .replace("unknown field", "the unknown key")
            .replace("unknown variant", "the unknown name"),
    };
    let expected = match expected {
        of if of.starts_with("struct ") => OBJECT,
        "f64" => "a number",
        "usize" | "u64" | "u32" => "a whole number, 0 or more",
        "a sequence" => "a list",
        other => other,
    };
    (found, expected.to_owned())
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
