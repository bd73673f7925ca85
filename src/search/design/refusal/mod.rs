//! Requirements that no lens can meet, refused by name before any search.

pub(super) mod check;

/// A specification that is malformed, or that no lens satisfies.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SpecificationError {
    /// A value that cannot be meant.
    #[error("specification, {key}: found {found}; expected {expected}")]
    Invalid {
        /// The key.
        key: &'static str,
        /// Its value.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
    /// A key without which nothing is specified.
    #[error("specification: no key `{0}`; expected focal length, aperture and field")]
    Missing(&'static str),
    /// Two values that cannot be meant together.
    #[error("specification: {0}")]
    Contradiction(String),
    /// Requirements that no lens satisfies.
    #[error("no lens can do that: {0}")]
    Impossible(String),
}

impl SpecificationError {
    pub(super) fn invalid(key: &'static str, found: String, expected: &'static str) -> Self {
        Self::Invalid { key, found, expected }
    }
}
