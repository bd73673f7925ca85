//! Surfaces and gaps in texts.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A surface in a text: holds the index, which counts from 0, and is displayed as designers count,
/// with the object as number 0 and the first surface as number 1.
///
/// Serialized it is the index, because the surfaces of a file are an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SurfaceNumber {
    index: usize,
}

impl SurfaceNumber {
    /// The number of the surface with this index.
    pub const fn new(index: usize) -> Self {
        Self { index }
    }

    /// The index of the surface, which counts from 0.
    pub const fn index(self) -> usize {
        self.index
    }
}

impl From<usize> for SurfaceNumber {
    fn from(index: usize) -> Self {
        Self { index }
    }
}

impl fmt::Display for SurfaceNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.index.saturating_add(1).fmt(f)
    }
}

/// A gap in a text, as the place of its medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MediumPlace {
    /// The space in front of the first surface.
    Object,
    /// The gap behind a surface.
    After(SurfaceNumber),
}

impl MediumPlace {
    /// The gap behind the surface with this index.
    pub const fn behind(index: usize) -> Self {
        Self::After(SurfaceNumber::new(index))
    }
}

impl fmt::Display for MediumPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Object => f.write_str("in object space"),
            Self::After(surface) => write!(f, "after surface {surface}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::SurfaceNumber;

    #[test]
    fn the_first_surface_is_number_one() {
        let first = SurfaceNumber::new(0);
        assert_eq!((first.to_string(), format!("{first:>3}")), ("1".into(), "  1".into()));
        assert_eq!(serde_json::to_string(&first).unwrap(), "0");
    }
}
