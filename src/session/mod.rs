//! One open design: the document, commands and undo, a search and an analyst in the background.
//!
//! A [`Session`] is told what a person wants as [`Command`]s and shows what there is as a
//! [`View`]. It knows no widgets: the window, a test and a script use it alike.
//!
//! - *The document changes only by a command*, and an edit that would leave a lens that cannot be
//!   used is refused: the document is then what it was.
//! - *A search works on its own copy*: its result becomes the document when it is taken, as one
//!   undo step. So does the sweep of a front, whose lenses can be looked at before.
//! - *Nothing here waits*: numbers and searches are in newest-value slots, and `wake` is called when
//!   something new is in one.

mod analyst;
mod background;
mod clock;
mod command;
mod course;
mod desk;
mod diary;
mod edit;
mod exploration;
mod explorations;
mod explorer;
mod finishing;
mod forming;
mod fresh;
mod fronts;
mod history;
mod judged;
mod laboratory;
mod layout;
mod moments;
mod pupils;
mod quest;
mod rows;
mod saving;
mod scale;
mod scatter;
mod slot;
mod sweeper;
mod typed;
mod view;
mod worker;

pub use analyst::{Numbers, Results, compute};
pub use clock::Timed;
pub use command::{Command, Edit, Explore};
pub use desk::{Event, Session};
pub use edit::{EditError, edited};
pub use exploration::{Checkpoint, Ending, Exploration, Found, Place};
pub use explorations::Explorations;
pub use forming::{
    Contour, Form, Formation, Forming, Loss, MOST_NODES, Origin, Profile, Quantity, Sight,
    Sighting, Slice, Subject,
};
pub use fresh::fresh_glass;
pub use fronts::Fronts;
pub use judged::Judged;
pub use laboratory::{Stage, Trial};
pub use layout::{DrawnRay, Layout, layout};
pub use moments::{History, Mark, Moment};
pub use pupils::Pupils;
pub use quest::Quest;
pub use saving::timed_plan;
pub use scatter::{Scatter, scatter};
pub use slot::Slot;
pub use sweeper::{FrontRun, Leg};
pub use typed::{NoNumber, evaluate};
pub use view::{Message, Settings, Severity, View, blank};
pub use worker::{HistoryPoint, Search, Standing, Starter, Task};
