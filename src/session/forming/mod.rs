//! The gradient-index field of a session: a task that is worked on in the background, or a volume to
//! look at; and what is seen of it.
//!
//! Three threads share the work: one takes the steps of the search, one lays slices, one follows all
//! light of the task. Nothing is open at first, and what nobody looks at is not computed.

mod contour;
mod former;
mod observer;
mod sight;
mod slice;
mod subject;
mod wish;

pub use contour::Contour;
pub(super) use former::Told;
pub use former::{Formation, Loss, MOST_NODES};
pub use sight::{Quantity, Sight};
pub use slice::{Profile, Slice};
pub use subject::{Origin, Subject};
pub use wish::Form;

use super::clock::{Pace, Timed, timed};
use super::worker::Standing;
use crate::grin_task::{Medium, Seen};
use former::Former;
use observer::Observer;
use slice::{Wanted, slice};
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// The time between two looks at all light while a search runs, at least.
const BETWEEN: Duration = Duration::from_secs(1);

/// All light of a task in a field, and how long that took.
#[derive(Debug, Clone)]
pub struct Sighting {
    /// The task.
    pub subject: Arc<Subject>,
    /// The field.
    pub medium: Arc<Medium>,
    /// Every view of the task.
    pub views: Timed<Vec<Seen>>,
}

/// What is known about the gradient-index field.
#[derive(Debug, Clone, Default)]
pub struct Forming {
    /// What is open, and how far its search is.
    pub run: Option<Arc<Formation>>,
    /// Whether something is being opened.
    pub opening: bool,
    /// Whether a field is being written.
    pub writing: bool,
    /// How the search will stand once its step is done, where it was told so.
    pub pending: Option<Standing>,
    /// Why the last thing could not be opened, or why its search broke.
    pub failed: Option<String>,
    /// How it is looked at.
    pub sight: Sight,
    /// Whether it is looked at.
    pub watched: bool,
    /// The newest slice, maybe of a step or a sight before; or why there is none.
    pub slice: Option<Arc<Result<Slice, String>>>,
    /// All light of the task, maybe some steps before; or why that cannot be seen.
    pub sighting: Option<Arc<Result<Sighting, String>>>,
}

/// What a session keeps of it.
#[derive(Debug)]
pub(super) struct FormingDesk {
    former: Former,
    slicer: Observer<Wanted, Slice>,
    viewer: Observer<(Arc<Subject>, Arc<Medium>), Sighting>,
    /// How many were asked for.
    count: u64,
    /// What is open.
    number: Option<u64>,
    /// What was asked for and is not open yet.
    opening: Option<u64>,
    writing: bool,
    pending: Option<Standing>,
    failed: Option<String>,
    sight: Sight,
    watched: bool,
    /// The slice and the field whose light was asked for.
    asked: Option<Wanted>,
    followed: Option<Arc<Medium>>,
    pace: Pace,
}

impl FormingDesk {
    pub(super) fn spawn(wake: impl Fn() + Send + Clone + 'static) -> io::Result<Self> {
        Ok(Self {
            former: Former::spawn(wake.clone())?,
            slicer: Observer::spawn("slice", wake.clone(), |wanted| Ok(slice(wanted)))?,
            viewer: Observer::spawn("light", wake, |(subject, medium)| sighting(&subject, medium))?,
            count: 0,
            number: None,
            opening: None,
            writing: false,
            pending: None,
            failed: None,
            sight: Sight::default(),
            watched: false,
            asked: None,
            followed: None,
            pace: Pace::new(BETWEEN),
        })
    }

    /// Does what a person asks for; why that cannot be done.
    pub(super) fn obey(&mut self, wish: Form) -> Result<(), String> {
        match wish {
            Form::Open(Some(path)) => self.open(Origin::File(path)),
            Form::Builtin(name) => self.open(Origin::Builtin(name)),
            Form::Start => self.start()?,
            Form::Pause => self.stand(Standing::Paused),
            Form::Resume => self.stand(Standing::Running),
            Form::Stop => self.stand(Standing::Stopped),
            Form::Save { path: Some(path), nodes } => {
                self.writing = true;
                self.former.write(path, nodes);
            }
            Form::Open(None) | Form::Save { path: None, .. } => {
                return Err("no file was named".to_owned());
            }
            Form::Close => self.close(),
            Form::Look(sight) => {
                let run = self.run();
                self.sight = run.map_or(sight, |run| run.subject.held(sight));
            }
            Form::Watch(watched) => self.watched = watched,
        }
        Ok(())
    }

    fn open(&mut self, origin: Origin) {
        self.count += 1;
        self.opening = Some(self.count);
        self.failed = None;
        self.former.open(self.count, origin);
    }

    fn start(&mut self) -> Result<(), String> {
        let run = self.run().ok_or("there is no task to work on; open one first")?;
        if run.subject.task.is_none() {
            return Err("a volume has no task to work on".to_owned());
        }
        self.failed = None;
        self.pending = Some(Standing::Running);
        self.former.start();
        Ok(())
    }

    /// Lets the search stand otherwise once its step is done; one that has ended stays so.
    fn stand(&mut self, standing: Standing) {
        let is_starting = self.pending == Some(Standing::Running);
        if is_starting || self.run().is_some_and(|run| run.is_under_way()) {
            self.pending = Some(standing);
            self.former.stand(standing);
        }
    }

    fn close(&mut self) {
        self.former.close();
        self.number = None;
        self.opening = None;
        self.pending = None;
        self.failed = None;
        self.asked = None;
        self.followed = None;
    }

    /// What happened since the last look to what is open or being opened.
    pub(super) fn told(&mut self) -> Vec<Told> {
        let mut told = self.former.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::NotOpened(number, _) | Told::Failed(number, _) => {
                self.number == Some(*number) || self.opening == Some(*number)
            }
            Told::Written(..) | Told::NotWritten(_) => true,
        });
        told.iter().for_each(|told| self.hear(told));
        told
    }

    fn hear(&mut self, told: &Told) {
        match told {
            Told::Now(number, standing) => {
                if self.opening == Some(*number) {
                    self.opened(*number);
                } else if Some(*standing) == self.pending || !standing.can_go_on() {
                    self.pending = None;
                }
            }
            Told::NotOpened(_, why) => {
                self.opening = None;
                self.failed = Some(why.clone());
            }
            Told::Failed(_, why) => {
                self.pending = None;
                self.failed = Some(why.clone());
            }
            Told::Written(..) | Told::NotWritten(_) => self.writing = false,
        }
    }

    fn opened(&mut self, number: u64) {
        self.number = Some(number);
        self.opening = None;
        self.pending = None;
        self.asked = None;
        self.followed = None;
        if let Some(run) = self.run() {
            self.sight = run.subject.first_sight();
        }
    }

    /// Asks for what is to be seen, while somebody looks.
    pub(super) fn keep_up(&mut self) {
        let Some(run) = self.run().filter(|_| self.watched) else { return };
        let (subject, medium) = (Arc::clone(&run.subject), Arc::clone(&run.medium));
        let wanted = Wanted { subject, medium, sight: self.sight };
        if !self.asked.as_ref().is_some_and(|asked| asked.is(&wanted)) {
            self.asked = Some(wanted.clone());
            self.slicer.ask(wanted);
        }
        self.follow(&run);
    }

    /// Asks for all light of the task: seldom while the field changes all the time.
    fn follow(&mut self, run: &Formation) {
        let known = self.followed.as_ref().is_some_and(|known| Arc::ptr_eq(known, &run.medium));
        if known || run.subject.task.is_none() {
            return;
        }
        let busy = self.followed.is_some() && self.sighting().is_none();
        let is_running = run.standing == Standing::Running;
        if !is_running || !busy && self.pace.is_due() {
            self.followed = Some(Arc::clone(&run.medium));
            self.viewer.ask((Arc::clone(&run.subject), Arc::clone(&run.medium)));
        }
    }

    fn run(&self) -> Option<Arc<Formation>> {
        self.former.formation().filter(|run| self.number == Some(run.number))
    }

    pub(super) fn view(&self) -> Forming {
        let run = self.run();
        let is_of = |slice: &Slice| {
            run.as_ref().is_some_and(|run| Arc::ptr_eq(&slice.subject, &run.subject))
        };
        let slice = self.slicer.answer().filter(|_| self.asked.is_some());
        let slice = slice.filter(|slice| slice.as_ref().as_ref().map_or(true, is_of));
        Forming {
            opening: self.opening.is_some(),
            writing: self.writing,
            pending: self.pending,
            failed: self.failed.clone(),
            sight: self.sight,
            watched: self.watched,
            slice,
            sighting: self.sighting(),
            run,
        }
    }

    /// The newest answer about all light, if it is of what is open.
    fn sighting(&self) -> Option<Arc<Result<Sighting, String>>> {
        let run = self.run()?;
        let is_of = |seen: &Sighting| Arc::ptr_eq(&seen.subject, &run.subject);
        let answer = self.viewer.answer().filter(|_| self.followed.is_some());
        answer.filter(|answer| answer.as_ref().as_ref().map_or(true, is_of))
    }
}

/// Follows all light of a task.
fn sighting(subject: &Arc<Subject>, medium: Arc<Medium>) -> Result<Sighting, String> {
    let Some(task) = &subject.task else { return Err("a volume has no light".to_owned()) };
    let Timed { value, ms } = timed(|| task.seen(&medium));
    let value = value.map_err(|why| why.to_string())?;
    Ok(Sighting { subject: Arc::clone(subject), medium, views: Timed { value, ms } })
}
