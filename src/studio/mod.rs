//! The window: panels read a view and push commands.
//!
//! **A panel changes nothing**: it gets a view of the design and writes down wishes.

pub mod chooser;
pub mod draw;
pub mod number;
pub mod palette;
pub mod section;
pub mod shell;
