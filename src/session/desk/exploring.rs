//! What a session does with a search over structure: it passes wishes on, takes a lens, says news.

use super::{Session, SessionEvent};
use crate::lens::Lens;
use crate::session::command::StructureSearchCommand;
use crate::session::explorer::Told;
use crate::session::view::Severity;
use crate::session::worker::RunStatus;
use std::sync::Arc;

impl Session {
    pub(super) fn explore(&mut self, wish: StructureSearchCommand) {
        if let StructureSearchCommand::Accept(number) = wish {
            return self.take_found(number);
        }
        if matches!(wish, StructureSearchCommand::Start(_) | StructureSearchCommand::ResumeFrom(_))
        {
            self.candidate = None;
        }
        if let Err(why) = self.explorations.handle(wish, &self.lens) {
            self.say(Severity::Warning, why);
        }
    }

    /// Makes a lens of the search over structure the design, as one step.
    fn take_found(&mut self, number: u64) {
        let taken = self.explorations.lens_by_number(number).and_then(|lens| {
            let own = released(&lens);
            own.check().map(|()| own).map_err(|why| why.to_string())
        });
        match taken {
            Ok(lens) => {
                let title = format!("take lens {number} of the search");
                self.history.push(Arc::clone(&self.lens), title, None);
                self.explorations.end_preview();
                self.show(Arc::new(lens));
            }
            Err(why) => self.say(Severity::Warning, why),
        }
    }

    pub(super) fn hear_exploration(&mut self, told: Told) {
        match told {
            Told::Now(_, standing) => self.events.push(SessionEvent::Explored(standing)),
            Told::Failed(_, why) => {
                self.say(Severity::Error, why);
                self.events.push(SessionEvent::Explored(RunStatus::Stopped));
            }
            Told::Refused(why) => self.say(Severity::Warning, why),
            Told::Written(number, path, report) => {
                let text = format!("lens {number} finished and exported to {}", path.display());
                self.say(Severity::Note, format!("{text}\n{report}"));
                self.events.push(SessionEvent::Saved(path));
            }
            Told::NotWritten(_, why) | Told::NotSaved(why) => self.say(Severity::Error, why),
        }
    }
}

/// A lens of a search over structure as a person wants it: without the bounds that hold numbers,
/// which were never variables of theirs.
fn released(lens: &Lens) -> Lens {
    let mut own = lens.clone();
    own.variables.retain(|v| v.min.is_none() || v.min != v.max);
    own
}
