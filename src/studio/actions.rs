//! The user's requests in one frame, as panels and menus collect them.

use egui::Theme;

use super::arrangement::Arrangement;
use super::dialogs::DialogKind;
use super::file_dialog::FileRequest;
use super::panels::PanelKind;
use crate::files::{BundledLens, LibraryLens};
use crate::lens::Edit;
use crate::session::{Command, GrinCommand, SpecifiedDesignCommand, StructureSearchCommand};

/// A request of the user to the window.
#[expect(clippy::large_enum_variant, reason = "made once for each action of a person")]
#[derive(Debug, Clone, PartialEq)]
pub enum UiAction {
    /// Runs a command of the session.
    Run(Command),
    /// Opens a lens that comes with the program.
    OpenBundled(&'static BundledLens),
    /// Opens a lens of the library, scaled to a focal length in mm if one is given.
    OpenLibrary(&'static LibraryLens, Option<f64>),
    /// Asks for a path, and runs the command that needs it.
    AskPath(FileRequest),
    /// Opens a dialog.
    ShowDialog(DialogKind),
    /// Shows a panel in front of the others, with the keyboard in it.
    ShowPanel(PanelKind),
    /// Shows a panel in front of the others, or hides it if it is there.
    TogglePanel(PanelKind),
    /// Gives the keyboard to the panel this many places behind the one that was in front last.
    StepPanel(isize),
    /// Gives one panel all the room of the others, or shows them again.
    MaximizePanel(Option<PanelKind>),
    /// Arranges all panels.
    ArrangePanels(Arrangement),
    /// Gives the search the window, with the lens of this chain in the drawings.
    WatchSearch(usize),
    /// Sets the theme.
    SetTheme(Theme),
    /// Closes the window.
    Quit,
}

impl From<DialogKind> for UiAction {
    fn from(dialog: DialogKind) -> Self {
        Self::ShowDialog(dialog)
    }
}

impl From<Command> for UiAction {
    fn from(command: Command) -> Self {
        Self::Run(command)
    }
}

impl From<Edit> for UiAction {
    fn from(edit: Edit) -> Self {
        Self::Run(edit.into())
    }
}

impl From<StructureSearchCommand> for UiAction {
    fn from(command: StructureSearchCommand) -> Self {
        Self::Run(Command::StructureSearch(command))
    }
}

impl From<GrinCommand> for UiAction {
    fn from(command: GrinCommand) -> Self {
        Self::Run(Command::Grin(command))
    }
}

impl From<SpecifiedDesignCommand> for UiAction {
    fn from(command: SpecifiedDesignCommand) -> Self {
        Self::Run(Command::SpecifiedDesign(command))
    }
}

impl From<FileRequest> for UiAction {
    fn from(request: FileRequest) -> Self {
        Self::AskPath(request)
    }
}

/// The requests of one frame, in the order in which they were made.
#[derive(Debug, Default)]
pub struct Actions(Vec<UiAction>);

impl Actions {
    /// Adds a request.
    pub fn push(&mut self, action: impl Into<UiAction>) {
        self.0.push(action.into());
    }

    /// Adds several requests.
    pub fn extend<A: Into<UiAction>>(&mut self, actions: impl IntoIterator<Item = A>) {
        self.0.extend(actions.into_iter().map(Into::into));
    }

    /// All requests in order.
    pub fn as_slice(&self) -> &[UiAction] {
        &self.0
    }
}

impl IntoIterator for Actions {
    type Item = UiAction;
    type IntoIter = std::vec::IntoIter<UiAction>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}
