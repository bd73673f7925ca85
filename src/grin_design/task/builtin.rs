//! The tasks that come with the program: the gradient-index lenses and the plume of the thesis.

use super::GrinTask;
use crate::files::{FileError, json};

/// A task that comes with the program, under its name.
#[derive(Debug, Clone, Copy)]
pub struct BuiltinTask {
    /// The name by which it is selected.
    pub name: &'static str,
    /// The text of its task file.
    pub text: &'static str,
}

/// Every task that comes with the program.
pub const BUILTIN_TASKS: &[BuiltinTask] = &[
    BuiltinTask { name: "luneburg", text: include_str!("../../../assets/grin/luneburg.json") },
    BuiltinTask {
        name: "luneburg-radial",
        text: include_str!("../../../assets/grin/luneburg-radial.json"),
    },
    BuiltinTask { name: "maxwell", text: include_str!("../../../assets/grin/maxwell.json") },
    BuiltinTask {
        name: "maxwell-radial",
        text: include_str!("../../../assets/grin/maxwell-radial.json"),
    },
    BuiltinTask { name: "display", text: include_str!("../../../assets/grin/display.json") },
    BuiltinTask { name: "multifocal", text: include_str!("../../../assets/grin/multifocal.json") },
    BuiltinTask {
        name: "caustic-near",
        text: include_str!("../../../assets/grin/caustic-near.json"),
    },
    BuiltinTask {
        name: "caustic-far",
        text: include_str!("../../../assets/grin/caustic-far.json"),
    },
    BuiltinTask { name: "caustic", text: include_str!("../../../assets/grin/caustic.json") },
    BuiltinTask { name: "fibre", text: include_str!("../../../assets/grin/fibre.json") },
    BuiltinTask { name: "plume", text: include_str!("../../../assets/grin/plume.json") },
    BuiltinTask { name: "plume-10x", text: include_str!("../../../assets/grin/plume-10x.json") },
    BuiltinTask { name: "plume-100x", text: include_str!("../../../assets/grin/plume-100x.json") },
    BuiltinTask {
        name: "plume-1000x",
        text: include_str!("../../../assets/grin/plume-1000x.json"),
    },
];

impl BuiltinTask {
    /// Parses the task.
    ///
    /// # Errors
    /// A text that is not a task, which none of the built-in texts is.
    pub fn task(&self) -> Result<GrinTask, FileError> {
        read_task(self.text, self.name)
    }
}

/// The built-in task of this name.
pub fn find_builtin(name: &str) -> Option<&'static BuiltinTask> {
    BUILTIN_TASKS.iter().find(|builtin| builtin.name == name)
}

/// Parses a task; `file` is used for the error message only. The values are not checked: see
/// [`GrinTask::check`].
///
/// # Errors
/// A text that is not a task, with the position of the error.
pub fn read_task(text: &str, file: &str) -> Result<GrinTask, FileError> {
    json::read_json(text, file)
}
