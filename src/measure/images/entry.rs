//! The entries of a file of exact answers: numbers, or the decimal text of one, and where they stand.

use serde_json::Value;

/// An entry that is not what it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: expected {expected}")]
pub struct ImageFileError {
    place: String,
    expected: String,
}

impl ImageFileError {
    pub(super) fn new(place: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { place: place.into(), expected: expected.into() }
    }
}

/// A value of a file with the way to it.
#[derive(Debug, Clone)]
pub struct ImageEntry<'a> {
    /// The value.
    pub value: &'a Value,
    pub(super) place: String,
}

type Found<T> = Result<T, ImageFileError>;

impl<'a> ImageEntry<'a> {
    pub(super) fn new(value: &'a Value, place: impl Into<String>) -> Self {
        Self { value, place: place.into() }
    }

    fn refuse<T>(&self, found: Option<T>, expected: &str) -> Found<T> {
        found.ok_or_else(|| ImageFileError::new(&self.place, expected))
    }

    /// The entry of a key; that of a missing one is null.
    pub(super) fn get(&self, key: &str) -> Self {
        let value = self.value.get(key).unwrap_or(&Value::Null);
        let dot = if self.place.is_empty() { "" } else { "." };
        Self { value, place: format!("{}{dot}{key}", self.place) }
    }

    pub(super) fn is_null(&self) -> bool {
        self.value.is_null()
    }

    /// A number, or the decimal text of one.
    pub(super) fn number(&self) -> Found<f64> {
        let text = || self.value.as_str()?.parse().ok();
        let number = self.value.as_f64().or_else(text).filter(|v: &f64| v.is_finite());
        self.refuse(number, "a number")
    }

    /// The number of a key.
    pub(super) fn at(&self, key: &str) -> Found<f64> {
        self.get(key).number()
    }

    pub(super) fn count(&self) -> Found<usize> {
        self.refuse(self.value.as_u64().and_then(|v| usize::try_from(v).ok()), "a count")
    }

    pub(super) fn text(&self) -> Found<&'a str> {
        self.refuse(self.value.as_str(), "a text")
    }

    /// The entries of a list.
    pub(super) fn list(&self) -> Found<Vec<Self>> {
        let list = self.refuse(self.value.as_array(), "a list")?;
        let entry =
            |(i, value): (usize, &'a Value)| Self::new(value, format!("{}[{i}]", self.place));
        Ok(list.iter().enumerate().map(entry).collect())
    }

    /// The entries of a list; none if it is missing or null.
    pub(super) fn list_or_none(&self) -> Found<Vec<Self>> {
        if self.is_null() { Ok(Vec::new()) } else { self.list() }
    }

    pub(super) fn numbers(&self) -> Found<Vec<f64>> {
        self.list()?.iter().map(Self::number).collect()
    }

    /// The names and the numbers of an object.
    pub(super) fn named_numbers(&self) -> Found<Vec<(&'a str, f64)>> {
        let all = self.refuse(self.value.as_object(), "an object")?;
        let pair = |name: &'a String| Ok((name.as_str(), self.at(name)?));
        all.keys().map(pair).collect()
    }

    /// The points of two keys, times a scale.
    pub(super) fn pair(&self, keys: [&str; 2], scale: f64) -> Found<[f64; 2]> {
        Ok([scale * self.at(keys[0])?, scale * self.at(keys[1])?])
    }
}
