//! What the whole program promises, one module a subject.

// The lenses that come with the program.
mod library;
