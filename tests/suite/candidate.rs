//! A candidate in place of the design: named, accepted, kept, discarded; and messages that end.

use aplanat::files::{bundled_lenses, json};
use aplanat::lens::{Edit, Lens, blank};
use aplanat::session::{CandidateSource, Command, Session, SessionView};

fn double_gauss() -> Lens {
    json::read(bundled_lenses()[0].text, bundled_lenses()[0].name).unwrap()
}

fn session() -> Session {
    Session::new(double_gauss(), || {}).unwrap()
}

/// The design with another first radius.
fn other() -> Lens {
    let mut lens = double_gauss();
    lens.surfaces[0].curvature *= 1.01;
    lens
}

fn preview(session: &mut Session) {
    session.apply(Command::Preview(Some(Box::new(other()))));
}

fn wait(session: &mut Session, happened: impl Fn(&SessionView) -> bool) {
    for _ in 0..10_000 {
        session.poll();
        if happened(&session.view()) {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("it never happened");
}

#[test]
fn a_candidate_is_named_and_becomes_the_design_as_one_step() {
    let mut session = session();
    assert_eq!(session.view().candidate, None);
    preview(&mut session);
    let candidate = session.view().candidate.unwrap();
    assert_eq!((candidate.source, candidate.shown), (CandidateSource::Chosen, true));
    session.apply(Command::AcceptCandidate);
    assert_eq!(**session.lens(), other());
    assert_eq!(session.view().candidate, None);
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), double_gauss());
}

#[test]
fn a_discarded_candidate_leaves_the_design() {
    let mut session = session();
    preview(&mut session);
    session.apply(Command::DiscardCandidate);
    assert_eq!(session.view().candidate, None);
    assert_eq!(**session.lens(), double_gauss());
    session.apply(Command::AcceptCandidate);
    assert!(session.view().messages.last().unwrap().text.contains("no candidate"));
}

#[test]
fn a_kept_candidate_can_be_shown_again() {
    let mut session = session();
    preview(&mut session);
    session.apply(Command::KeepCandidate);
    session.apply(Command::KeepCandidate);
    session.apply(Command::DiscardCandidate);
    let kept = session.view().kept;
    assert_eq!(kept.len(), 1);
    assert_eq!((&*kept[0].lens, &**session.lens()), (&other(), &double_gauss()));
    session.apply(Command::Preview(Some(Box::new(Lens::clone(&kept[0].lens)))));
    assert_eq!(session.view().candidate.unwrap().title, kept[0].title);
}

#[test]
fn a_kept_candidate_is_a_branch_of_the_history() {
    let mut session = session();
    preview(&mut session);
    assert_eq!(session.view().candidate.unwrap().title, "a changed lens");
    session.apply(Command::KeepCandidate);
    session.apply(Command::DiscardCandidate);
    let view = session.view();
    assert_eq!((view.version_id, view.history.len(), view.undo), (0, 2, None));
    let branch = view.history.last().unwrap();
    assert_eq!((branch.parent, &*branch.title), (Some(0), "kept lens 1: a changed lens"));
    session.apply(Command::GoTo(branch.id));
    assert_eq!(**session.lens(), other());
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), double_gauss());
}

#[test]
fn the_design_can_be_shown_in_spite_of_a_candidate() {
    let mut session = session();
    preview(&mut session);
    wait(&mut session, |view| view.preview_results.is_some());
    session.apply(Command::ShowCandidate(false));
    let view = session.view();
    assert!(view.preview_results.is_none() && !view.candidate.unwrap().shown);
    session.apply(Command::ShowCandidate(true));
    wait(&mut session, |view| view.preview_results.is_some());
}

#[test]
fn a_message_is_old_once_something_else_is_done() {
    let mut session = session();
    session.apply(Command::Open("no/such/file.json".into()));
    assert!(session.view().message_is_recent);
    session.apply(Edit::SetName("Another".into()).into());
    assert!(!session.view().message_is_recent);
    assert_eq!(session.view().messages.len(), 1, "it can be read again");
}

#[test]
fn another_lens_is_another_document() {
    let mut session = session();
    let first = session.view().document;
    session.apply(Edit::SetName("Another".into()).into());
    assert_eq!(session.view().document, first);
    session.apply(Command::New(Box::new(blank())));
    assert_ne!(session.view().document, first);
}

/// The variables of the design would name other surfaces of a lens that has one more.
#[test]
fn a_candidate_with_another_surface_keeps_its_own_variables() {
    let mut session = session();
    let mut lens = double_gauss();
    lens.surfaces.insert(0, aplanat::lens::Row { thickness: 1.0, ..Default::default() });
    lens.variables.truncate(1);
    let own = lens.variables.clone();
    session.apply(Command::Preview(Some(Box::new(lens))));
    session.apply(Command::AcceptCandidate);
    assert_eq!(session.lens().variables, own);
}
