//! The found and the expected of a value that does not fit, as serde reports it.

use serde::de::{Error, Expected, Unexpected};
use std::fmt::{self, Display, Formatter};

/// A value that does not fit.
#[derive(Debug)]
pub(super) struct Mismatch {
    /// The value, or the fault of the object.
    pub(super) found: String,
    /// The accepted value.
    pub(super) expected: String,
    /// True if the value has another type than the accepted one, or is outside its range.
    other_type: bool,
}

impl Mismatch {
    fn new(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { found: found.into(), expected: expected.into(), other_type: false }
    }
}

/// An error of a deserialization: of a value, or of the parser, passed on.
#[derive(Debug)]
pub(super) enum ValueError<E> {
    /// A value that does not fit.
    Mismatch(Mismatch),
    /// The error of the parser.
    Parser(E),
}

impl<E> ValueError<E> {
    /// The same error; a value of another type has these words for the accepted one.
    pub(super) fn expecting(mut self, accepted: &str) -> Self {
        if let Self::Mismatch(mismatch) = &mut self
            && mismatch.other_type
        {
            accepted.clone_into(&mut mismatch.expected);
        }
        self
    }
}

impl<E: Display> Display for ValueError<E> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mismatch(it) => write!(f, "found {}; expected {}", it.found, it.expected),
            Self::Parser(error) => error.fmt(f),
        }
    }
}

impl<E: Error> std::error::Error for ValueError<E> {}

impl<E: Error> Error for ValueError<E> {
    fn custom<T: Display>(found: T) -> Self {
        Self::Mismatch(Mismatch::new(found.to_string(), "a value that fits"))
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let mismatch = Mismatch::new(describe(found), expected.to_string());
        Self::Mismatch(Mismatch { other_type: true, ..mismatch })
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        // A number that does not fit into the program's type for it.
        let other_type =
            matches!(found, Unexpected::Signed(_) | Unexpected::Unsigned(_) | Unexpected::Float(_));
        let mismatch = Mismatch::new(describe(found), expected.to_string());
        Self::Mismatch(Mismatch { other_type, ..mismatch })
    }

    fn invalid_length(found: usize, expected: &dyn Expected) -> Self {
        Self::Mismatch(Mismatch::new(format!("a list of length {found}"), expected.to_string()))
    }

    fn unknown_variant(found: &str, expected: &'static [&'static str]) -> Self {
        Self::Mismatch(Mismatch::new(format!("the unknown name `{found}`"), one_of(expected)))
    }

    fn unknown_field(found: &str, expected: &'static [&'static str]) -> Self {
        Self::Mismatch(Mismatch::new(format!("the unknown key `{found}`"), one_of(expected)))
    }

    fn missing_field(key: &'static str) -> Self {
        Self::Mismatch(Mismatch::new(format!("no key `{key}`"), "it"))
    }

    fn duplicate_field(key: &'static str) -> Self {
        Self::Mismatch(Mismatch::new(format!("the key `{key}` twice"), "it once"))
    }
}

/// A found value in the words of a JSON file.
fn describe(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(value) => value.to_string(),
        Unexpected::Unsigned(value) => value.to_string(),
        Unexpected::Signed(value) => value.to_string(),
        Unexpected::Float(value) => value.to_string(),
        Unexpected::Unit => "null".to_owned(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "an object".to_owned(),
        Unexpected::UnitVariant => "a name alone".to_owned(),
        Unexpected::NewtypeVariant | Unexpected::TupleVariant | Unexpected::StructVariant => {
            "a name with a value".to_owned()
        }
        other => other.to_string(),
    }
}

/// The accepted names.
fn one_of(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.as_slice() {
        [] => "none".to_owned(),
        [name] => name.clone(),
        [first, second] => format!("{first} or {second}"),
        _ => format!("one of {}", quoted.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepted_names_are_listed_as_one_says_them() {
        assert_eq!(one_of(&["a"]), "`a`");
        assert_eq!(one_of(&["a", "b"]), "`a` or `b`");
        assert_eq!(one_of(&["a", "b", "c"]), "one of `a`, `b`, `c`");
    }

    #[test]
    fn no_accepted_name_is_said_so() {
        assert_eq!(one_of(&[]), "none");
    }
}
