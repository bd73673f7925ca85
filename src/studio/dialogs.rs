//! The dialogs of the window, at most one of each kind at a time.

use egui::{Context, Key, Popup};

use super::actions::Actions;
use super::command_palette::CommandPalette;
use super::element_dialog::{ElementDialog, ElementTask};
use super::library_window::LibraryWindow;
use super::manual::ManualWindow;
use super::menu_items::MenuContext;
use super::new_lens::NewLensDialog;
use super::shortcut_list;

/// A dialog.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DialogKind {
    /// The first numbers of a new lens.
    NewLens,
    /// A change of an element or of the whole lens.
    Element(ElementTask),
    /// The browser of the lens library.
    Library,
    /// The search over all commands.
    CommandPalette,
    /// The manual.
    Manual,
    /// The list of keyboard shortcuts.
    Shortcuts,
}

/// The dialogs that are open.
#[derive(Debug, Default)]
pub(super) struct Dialogs {
    new_lens: Option<NewLensDialog>,
    element: Option<ElementDialog>,
    palette: Option<CommandPalette>,
    library: Option<LibraryWindow>,
    manual: ManualWindow,
    shows_shortcuts: bool,
    /// True if a list or a menu was open in the frame before: Escape closes it and nothing else.
    had_list: bool,
}

impl Dialogs {
    /// Opens a dialog.
    pub(super) fn open(&mut self, kind: DialogKind, menus: &MenuContext<'_>) {
        match kind {
            DialogKind::NewLens => self.new_lens = Some(NewLensDialog::default()),
            DialogKind::Element(task) => {
                self.element = Some(ElementDialog::new(task, menus.view));
            }
            DialogKind::CommandPalette => self.palette = Some(CommandPalette::default()),
            DialogKind::Library => self.library = Some(LibraryWindow::default()),
            DialogKind::Manual => self.manual.open(),
            DialogKind::Shortcuts => self.shows_shortcuts = true,
        }
    }

    /// Shows all dialogs that are open.
    pub(super) fn ui(&mut self, context: &Context, menus: &MenuContext<'_>, actions: &mut Actions) {
        // Escape belongs to what keeps it to itself, such as a handle of the layout, and to an open list.
        let escapes = !context.egui_wants_keyboard_input()
            && !self.had_list
            && context.input(|input| input.key_pressed(Key::Escape));
        if self.new_lens.as_mut().is_some_and(|dialog| dialog.ui(context, actions)) {
            self.new_lens = None;
        }
        if self.element.as_mut().is_some_and(|dialog| dialog.ui(context, menus.view, actions)) {
            self.element = None;
        }
        if self.palette.as_mut().is_some_and(|palette| palette.ui(context, menus, actions)) {
            self.palette = None;
        }
        if self.library.as_mut().is_some_and(|library| library.ui(context, actions)) {
            self.library = None;
        }
        self.manual.ui(context);
        if self.shows_shortcuts {
            self.shows_shortcuts = shortcut_list::ui(context, menus);
        }
        if escapes {
            self.close_windows(actions);
        }
        self.had_list = Popup::is_any_open(context);
    }

    /// True while the drawings show what an open dialog would give: it alone accepts or discards that.
    pub(super) fn has_preview(&self) -> bool {
        self.element.as_ref().is_some_and(ElementDialog::has_preview)
    }

    /// Closes the dialogs that leave the rest of the window usable.
    fn close_windows(&mut self, actions: &mut Actions) {
        if let Some(element) = self.element.take() {
            element.end_preview(actions);
        }
        self.library = None;
        self.manual.close();
        self.shows_shortcuts = false;
    }
}
