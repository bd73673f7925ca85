//! The tasks that come with the program: the lenses and the plume of the thesis.

use super::task::Task;
use crate::files::{FileError, native};

/// A task under a name.
#[derive(Debug, Clone, Copy)]
pub struct Builtin {
    /// What a person types.
    pub name: &'static str,
    /// The text of its file.
    pub text: &'static str,
}

/// Every task that comes with the program.
pub const BUILTIN: &[Builtin] = &[
    Builtin { name: "luneburg", text: include_str!("../../assets/grin/luneburg.json") },
    Builtin {
        name: "luneburg-radial",
        text: include_str!("../../assets/grin/luneburg-radial.json"),
    },
    Builtin { name: "maxwell", text: include_str!("../../assets/grin/maxwell.json") },
    Builtin { name: "maxwell-radial", text: include_str!("../../assets/grin/maxwell-radial.json") },
    Builtin { name: "display", text: include_str!("../../assets/grin/display.json") },
    Builtin { name: "multifocal", text: include_str!("../../assets/grin/multifocal.json") },
    Builtin { name: "caustic-near", text: include_str!("../../assets/grin/caustic-near.json") },
    Builtin { name: "caustic-far", text: include_str!("../../assets/grin/caustic-far.json") },
    Builtin { name: "caustic", text: include_str!("../../assets/grin/caustic.json") },
    Builtin { name: "fibre", text: include_str!("../../assets/grin/fibre.json") },
    Builtin { name: "plume", text: include_str!("../../assets/grin/plume.json") },
    Builtin { name: "plume-10x", text: include_str!("../../assets/grin/plume-10x.json") },
    Builtin { name: "plume-100x", text: include_str!("../../assets/grin/plume-100x.json") },
    Builtin { name: "plume-1000x", text: include_str!("../../assets/grin/plume-1000x.json") },
];

impl Builtin {
    /// The task.
    ///
    /// # Errors
    /// A text that is no task, which none of ours is.
    pub fn task(&self) -> Result<Task, FileError> {
        read(self.text, self.name)
    }
}

/// The task of a name that comes with the program.
pub fn find(name: &str) -> Option<&'static Builtin> {
    BUILTIN.iter().find(|builtin| builtin.name == name)
}

/// Reads a task; `file` is only for the message. What it says is not checked: see [`Task::check`].
///
/// # Errors
/// A text that is no task, with its place.
pub fn read(text: &str, file: &str) -> Result<Task, FileError> {
    native::read_json(text, file)
}
