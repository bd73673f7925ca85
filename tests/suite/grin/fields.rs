//! Placeholder for tests of this kind.
