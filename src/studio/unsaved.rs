//! The question before something is lost that is in no file: the lens, or the field that was formed.

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
            Self::Run(Command::New(_) | Command::Open(_)) => &[UnsavedDocument::Lens],
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
    pub(super) fn would_discard(&self, then: &PendingAction) -> bool {
        then.discards().iter().any(|lost| self.is_unsaved(*lost))
    }

    fn is_unsaved(&self, lost: UnsavedDocument) -> bool {
        match lost {
            UnsavedDocument::Lens => self.session.is_dirty(),
            UnsavedDocument::Field => {
                self.session.view().grin.run.snapshot.is_some_and(|run| run.is_unsaved())
            }
        }
    }

    /// Does something, at once or after a question for each thing that would be lost, those up to the
    /// one that was answered apart.
    pub(super) fn run_or_ask(
        &mut self,
        context: &Context,
        then: PendingAction,
        answered: Option<UnsavedDocument>,
    ) {
        let losses = then.discards();
        let done = losses.iter().position(|lost| Some(*lost) == answered).map_or(0, |i| i + 1);
        if let Some(lost) = losses[done..].iter().find(|lost| self.is_unsaved(**lost)) {
            self.pending = Some(PendingState::Asking(*lost, then));
            return context.request_repaint();
        }
        match then {
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
            Some(PendingState::Saving(lost, then)) => self.continue_when_saved(context, lost, then),
            Some(PendingState::Asking(lost, then)) => {
                match ask_about_unsaved(context, view, lost) {
                    None => self.pending = Some(PendingState::Asking(lost, then)),
                    Some(answer) => self.on_unsaved_answer(context, view, (lost, then), answer),
                }
            }
        }
    }

    fn on_unsaved_answer(
        &mut self,
        context: &Context,
        view: &SessionView,
        (lost, then): (UnsavedDocument, PendingAction),
        answer: UnsavedAnswer,
    ) {
        context.request_repaint();
        match answer {
            UnsavedAnswer::Cancel => {}
            UnsavedAnswer::Discard => self.run_or_ask(context, then, Some(lost)),
            UnsavedAnswer::Save => {
                self.pending = Some(PendingState::Saving(lost, then));
                self.save_document(context, view, lost);
            }
        }
    }

    fn save_document(&mut self, context: &Context, view: &SessionView, lost: UnsavedDocument) {
        match lost {
            UnsavedDocument::Lens if view.path.is_some() => {
                self.apply(context, Command::Save(None))
            }
            UnsavedDocument::Lens => self.file_dialog.ask(context, FileRequest::Save, None),
            UnsavedDocument::Field => {
                // What goes on changing is never saved as it is.
                if view.grin.run.status == RunStatus::Running {
                    self.apply(context, Command::Grin(GrinCommand::Pause));
                }
                self.ask_path(context, view, FileRequest::SaveField(DEFAULT_NODES));
            }
        }
    }

    /// Goes on once it is saved; gives up where no file was chosen or it could not be saved.
    fn continue_when_saved(
        &mut self,
        context: &Context,
        lost: UnsavedDocument,
        then: PendingAction,
    ) {
        let is_writing = lost == UnsavedDocument::Field && self.session.view().grin.writing;
        if !self.is_unsaved(lost) {
            self.run_or_ask(context, then, Some(lost));
        } else if self.file_dialog.is_open() || is_writing {
            self.pending = Some(PendingState::Saving(lost, then));
        }
    }
}

fn ask_about_unsaved(
    context: &Context,
    view: &SessionView,
    lost: UnsavedDocument,
) -> Option<UnsavedAnswer> {
    let (heading, text) = match lost {
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
