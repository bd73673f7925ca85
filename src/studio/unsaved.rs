//! The question before something is lost that is in no file: the lens, or the field that was formed.

use super::app::Studio;
use super::chooser::Purpose;
use super::panels::slice::NODES;
use crate::session::{Command, Form, Standing, View};
use eframe::egui::{Context, Id, Modal, ViewportCommand};

/// What may be lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lost {
    Lens,
    Field,
}

/// What a person wants to do although something would be lost.
#[derive(Debug)]
pub(super) enum Then {
    Do(Command),
    Quit,
}

impl Then {
    /// What it throws away.
    fn losses(&self) -> &'static [Lost] {
        match self {
            Self::Quit => &[Lost::Lens, Lost::Field],
            Self::Do(Command::New(_) | Command::Open(_)) => &[Lost::Lens],
            Self::Do(Command::Form(
                Form::Open(Some(_)) | Form::Builtin(_) | Form::Close | Form::Start,
            )) => &[Lost::Field],
            Self::Do(_) => &[],
        }
    }
}

/// What waits until a person has answered, or until something is saved.
#[derive(Debug)]
pub(super) enum Waiting {
    Answer(Lost, Then),
    Saving(Lost, Then),
}

/// What a person answers to whether changes may be lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Save,
    Lose,
    Stay,
}

impl Studio {
    /// Whether something would be lost that is in no file.
    pub(super) fn loses(&self, then: &Then) -> bool {
        then.losses().iter().any(|lost| self.is_unsaved(*lost))
    }

    fn is_unsaved(&self, lost: Lost) -> bool {
        match lost {
            Lost::Lens => self.session.is_dirty(),
            Lost::Field => self.session.view().forming.run.is_some_and(|run| run.is_unsaved()),
        }
    }

    /// Does something, at once or after a question for each thing that would be lost, those up to the
    /// one that was answered apart.
    pub(super) fn attempt(&mut self, context: &Context, then: Then, answered: Option<Lost>) {
        let losses = then.losses();
        let done = losses.iter().position(|lost| Some(*lost) == answered).map_or(0, |i| i + 1);
        if let Some(lost) = losses[done..].iter().find(|lost| self.is_unsaved(**lost)) {
            self.waiting = Some(Waiting::Answer(*lost, then));
            return context.request_repaint();
        }
        match then {
            Then::Do(command) => self.apply(context, command),
            Then::Quit => {
                self.leaving = true;
                context.send_viewport_cmd(ViewportCommand::Close);
            }
        }
    }

    /// Asks before changes are lost.
    pub(super) fn question(&mut self, context: &Context, view: &View) {
        match self.waiting.take() {
            None => {}
            Some(Waiting::Saving(lost, then)) => self.go_on_when_saved(context, lost, then),
            Some(Waiting::Answer(lost, then)) => match ask(context, view, lost) {
                None => self.waiting = Some(Waiting::Answer(lost, then)),
                Some(answer) => self.answered(context, view, (lost, then), answer),
            },
        }
    }

    fn answered(
        &mut self,
        context: &Context,
        view: &View,
        (lost, then): (Lost, Then),
        answer: Answer,
    ) {
        context.request_repaint();
        match answer {
            Answer::Stay => {}
            Answer::Lose => self.attempt(context, then, Some(lost)),
            Answer::Save => {
                self.waiting = Some(Waiting::Saving(lost, then));
                self.save(context, view, lost);
            }
        }
    }

    fn save(&mut self, context: &Context, view: &View, lost: Lost) {
        match lost {
            Lost::Lens if view.path.is_some() => self.apply(context, Command::Save(None)),
            Lost::Lens => self.chooser.ask(context, Purpose::Save, None),
            Lost::Field => {
                // What goes on changing is never saved as it is.
                let run = view.forming.run.as_ref();
                if run.is_some_and(|run| run.standing == Standing::Running) {
                    self.apply(context, Command::Form(Form::Pause));
                }
                self.choose_field(context, view, NODES);
            }
        }
    }

    /// Goes on once it is saved; gives up where no file was chosen or it could not be saved.
    fn go_on_when_saved(&mut self, context: &Context, lost: Lost, then: Then) {
        let is_writing = lost == Lost::Field && self.session.view().forming.writing;
        if !self.is_unsaved(lost) {
            self.attempt(context, then, Some(lost));
        } else if self.chooser.is_open() || is_writing {
            self.waiting = Some(Waiting::Saving(lost, then));
        }
    }
}

fn ask(context: &Context, view: &View, lost: Lost) -> Option<Answer> {
    let (heading, text) = match lost {
        Lost::Lens => {
            let name = &view.lens.name;
            ("Save the changes first?", format!("{name} has changes that are in no file yet."))
        }
        Lost::Field => {
            let name = view.forming.run.as_ref().map_or("", |run| run.subject.name.as_str());
            ("Save the field first?", format!("The field of “{name}” is in no file yet."))
        }
    };
    let mut answer = None;
    let modal = Modal::new(Id::unique("unsaved")).show(context, |ui| {
        ui.set_width(340.0);
        ui.heading(heading);
        ui.label(text);
        ui.add_space(8.0);
        let answers =
            [("Save", Answer::Save), ("Don't save", Answer::Lose), ("Cancel", Answer::Stay)];
        ui.horizontal(|ui| {
            for (text, chosen) in answers {
                if ui.button(text).clicked() {
                    answer = Some(chosen);
                }
            }
        });
    });
    answer.or_else(|| modal.should_close().then_some(Answer::Stay))
}
