//! What a session does with a gradient-index field: it passes wishes on and says news.

use super::{Session, SessionEvent};
use crate::session::forming::{GrinCommand, Told};
use crate::session::view::Severity;
use crate::session::worker::RunStatus;

impl Session {
    pub(super) fn form(&mut self, wish: GrinCommand) {
        if let Err(why) = self.forming.handle(wish) {
            self.say(Severity::Warning, why);
        }
    }

    pub(super) fn hear_forming(&mut self, told: Told) {
        match told {
            Told::Now(_, standing) => self.events.push(SessionEvent::Formed(standing)),
            Told::NotOpened(_, why) | Told::NotWritten(why) => self.say(Severity::Error, why),
            Told::Failed(_, why) => {
                self.say(Severity::Error, why);
                self.events.push(SessionEvent::Formed(RunStatus::Stopped));
            }
            Told::Written(path, report) => {
                self.say(Severity::Note, report);
                self.events.push(SessionEvent::Saved(path));
            }
        }
    }
}
