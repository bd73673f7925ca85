//! The question before unsaved changes are discarded: of the lens, or of the optimized field.

use super::app::Studio;
use super::file_dialog::FileRequest;
use super::panels::grin::DEFAULT_NODES;
use crate::session::{Command, GrinCommand, RunStatus, SessionView};
use egui::{Context, Id, Modal, ViewportCommand};

/// A document that can have unsaved changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UnsavedDocument {
    Lens,
    Field,
}

/// An action that may discard unsaved changes.
#[expect(clippy::large_enum_variant, reason = "made once for each action of a person")]
#[derive(Debug)]
pub(super) enum PendingAction {
    Run(Command),
    Quit,
}

impl PendingAction {
    /// The documents whose unsaved changes it would discard.
    fn discards(&self) -> &'static [UnsavedDocument] {
        match self {
            Self::Quit => &[UnsavedDocument::Lens, UnsavedDocument::Field],
            Self::Run(Command::New(_) | Command::Begin(_) | Command::Open(_)) => {
                &[UnsavedDocument::Lens]
            }
            Self::Run(Command::Grin(
                GrinCommand::OpenFile(_)
                | GrinCommand::OpenBuiltin(_)
                | GrinCommand::Close
                | GrinCommand::Start,
            )) => &[UnsavedDocument::Field],
            Self::Run(_) => &[],
        }
    }
}

/// An action that waits for an answer of the user or for a file to be written.
#[derive(Debug)]
pub(super) enum PendingState {
    Asking(UnsavedDocument, PendingAction),
    Saving(UnsavedDocument, PendingAction),
}

/// The answer to the question about unsaved changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum UnsavedAnswer {
    Save,
    Discard,
    Cancel,
}

impl Studio {
    /// True if the action would discard unsaved changes.
    pub(super) fn would_discard(&self, action: &PendingAction) -> bool {
        action.discards().iter().any(|document| self.is_unsaved(*document))
    }

    fn is_unsaved(&self, document: UnsavedDocument) -> bool {
        match document {
            UnsavedDocument::Lens => self.session.is_dirty(),
            UnsavedDocument::Field => {
                self.session.view().grin.run.snapshot.is_some_and(|run| run.is_unsaved())
            }
        }
    }

    /// Runs an action, at once or after a question for each document with unsaved changes that it
    /// would discard, except those up to the one that is already answered.
    pub(super) fn run_or_ask(
        &mut self,
        context: &Context,
        action: PendingAction,
        answered: Option<UnsavedDocument>,
    ) {
        let losses = action.discards();
        let done =
            losses.iter().position(|document| Some(*document) == answered).map_or(0, |i| i + 1);
        if let Some(document) = losses[done..].iter().find(|document| self.is_unsaved(**document)) {
            self.pending = Some(PendingState::Asking(*document, action));
            return context.request_repaint();
        }
        match action {
            PendingAction::Run(command) => self.apply(context, command),
            PendingAction::Quit => {
                self.closing = true;
                context.send_viewport_cmd(ViewportCommand::Close);
            }
        }
    }

    /// Asks before changes are lost.
    pub(super) fn unsaved_dialog(&mut self, context: &Context, view: &SessionView) {
        match self.pending.take() {
            None => {}
            Some(PendingState::Saving(document, action)) => {
                self.continue_when_saved(context, document, action);
            }
            Some(PendingState::Asking(document, action)) => {
                match ask_about_unsaved(context, view, document) {
                    None => self.pending = Some(PendingState::Asking(document, action)),
                    Some(answer) => {
                        self.on_unsaved_answer(context, view, (document, action), answer);
                    }
                }
            }
        }
    }

    fn on_unsaved_answer(
        &mut self,
        context: &Context,
        view: &SessionView,
        (document, action): (UnsavedDocument, PendingAction),
        answer: UnsavedAnswer,
    ) {
        context.request_repaint();
        match answer {
            UnsavedAnswer::Cancel => {}
            UnsavedAnswer::Discard => self.run_or_ask(context, action, Some(document)),
            UnsavedAnswer::Save => {
                self.pending = Some(PendingState::Saving(document, action));
                self.save_document(context, view, document);
            }
        }
    }

    fn save_document(&mut self, context: &Context, view: &SessionView, document: UnsavedDocument) {
        match document {
            UnsavedDocument::Lens if view.path.is_some() => {
                self.apply(context, Command::Save(None));
            }
            UnsavedDocument::Lens => self.ask_path(context, view, FileRequest::Save),
            UnsavedDocument::Field => {
                // A field that still changes is paused before it is saved.
                if view.grin.run.status == RunStatus::Running {
                    self.apply(context, Command::Grin(GrinCommand::Pause));
                }
                self.ask_path(context, view, FileRequest::SaveField(DEFAULT_NODES));
            }
        }
    }

    /// Continues once the document is saved; gives up if no file was chosen or writing failed.
    fn continue_when_saved(
        &mut self,
        context: &Context,
        document: UnsavedDocument,
        action: PendingAction,
    ) {
        let is_writing = document == UnsavedDocument::Field && self.session.view().grin.writing;
        if !self.is_unsaved(document) {
            self.run_or_ask(context, action, Some(document));
        } else if self.file_dialog.is_open() || is_writing {
            self.pending = Some(PendingState::Saving(document, action));
        }
    }
}

fn ask_about_unsaved(
    context: &Context,
    view: &SessionView,
    document: UnsavedDocument,
) -> Option<UnsavedAnswer> {
    let (heading, text) = match document {
        UnsavedDocument::Lens => {
            let name = &view.lens.name;
            ("Save the changes first?", format!("{name} has unsaved changes."))
        }
        UnsavedDocument::Field => {
            let name = view.grin.run.snapshot.as_ref().map_or("", |run| run.document.name.as_str());
            ("Save the field first?", format!("The field of “{name}” has not been saved."))
        }
    };
    let mut answer = None;
    let modal = Modal::new(Id::unique("unsaved")).show(context, |ui| {
        ui.set_width(340.0);
        ui.heading(heading);
        ui.label(text);
        ui.add_space(8.0);
        let answers = [
            ("Save", UnsavedAnswer::Save),
            ("Don't save", UnsavedAnswer::Discard),
            ("Cancel", UnsavedAnswer::Cancel),
        ];
        ui.horizontal(|ui| {
            for (text, chosen) in answers {
                if ui.button(text).clicked() {
                    answer = Some(chosen);
                }
            }
        });
    });
    answer.or_else(|| modal.should_close().then_some(UnsavedAnswer::Cancel))
}
