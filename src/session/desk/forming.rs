//! What a session does with a gradient-index field: it passes wishes on and says news.

use super::{Event, Session};
use crate::session::forming::{Form, Told};
use crate::session::view::Severity;
use crate::session::worker::Standing;

impl Session {
    pub(super) fn form(&mut self, wish: Form) {
        if let Err(why) = self.forming.obey(wish) {
            self.say(Severity::Warning, why);
        }
    }

    pub(super) fn hear_forming(&mut self, told: Told) {
        match told {
            Told::Now(_, standing) => self.events.push(Event::Formed(standing)),
            Told::NotOpened(_, why) | Told::NotWritten(why) => self.say(Severity::Error, why),
            Told::Failed(_, why) => {
                self.say(Severity::Error, why);
                self.events.push(Event::Formed(Standing::Stopped));
            }
            Told::Written(path, report) => {
                self.say(Severity::Note, report);
                self.events.push(Event::Saved(path));
            }
        }
    }
}
