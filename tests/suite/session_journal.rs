//! The journal of a design: whatever ends the program, what was done is there again.

use super::session_pareto::wait;
use aplanat::files;
use aplanat::lens::{Edit, Lens, Parameter, Quantity, Variable, blank};
use aplanat::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::DescentMethod;
use aplanat::session::{Command, Session};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that is removed at the end.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("aplanat-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(fs::canonicalize(path).unwrap())
    }

    pub(crate) fn journals(&self) -> PathBuf {
        self.0.join("journals")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(fs::remove_dir_all(&self.0));
    }
}

pub(crate) fn journaled(lens: Lens, journals: &Path) -> Session {
    let mut session = Session::new(lens, || {}).unwrap();
    session.set_journal_folder(journals, || {}).unwrap();
    session
}

pub(crate) fn rename(session: &mut Session, name: &str) {
    session.apply(Edit::SetName(name.to_owned()).into());
    session.apply(Command::CommitEdit);
}

/// The journals as a killed program would leave them at this moment.
pub(crate) fn killed(session: &Session, journals: &Path, copy: &Path) {
    session.sync_journal();
    fs::create_dir_all(copy).unwrap();
    for file in fs::read_dir(journals).unwrap().flatten() {
        if file.file_name().to_string_lossy().ends_with(".journal") {
            fs::copy(file.path(), copy.join(file.file_name())).unwrap();
        }
    }
}

/// A session that finds these journals, and the message about what it has recovered.
pub(crate) fn reopened(journals: &Path) -> (Session, Option<String>) {
    let mut session = journaled(blank(), journals);
    let text = session.recover().then(|| {
        let messages = session.view().messages;
        messages.last().unwrap().text.clone()
    });
    (session, text)
}

#[test]
fn a_killed_design_reopens_where_it_was() {
    let folder = Folder::new("journal-killed");
    let mut session = journaled(blank(), &folder.journals());
    assert!(!folder.journals().exists(), "nothing has happened yet");
    for name in ["a", "b", "c"] {
        rename(&mut session, name);
    }
    session.apply(Command::Undo);
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::Spot, 2.0)],
        pupil: PupilEdge::Frozen,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    session.apply(Edit::SetMerit(Some(goal.clone())).into());
    session.apply(Command::NameVersion { id: 3, name: "left behind".into() });
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (again, text) = reopened(&copy);
    let text = text.unwrap();
    assert!(
        text.starts_with(
            "recovered b, which the program ended without closing, with 3 unsaved changes"
        ),
        "{text}"
    );
    assert_eq!(text.lines().count(), 1);
    assert_eq!(again.lens(), session.lens());
    assert_eq!(again.view().goal.as_deref(), Some(&goal));
    assert!(again.is_dirty());
    let [ours, theirs] = [&session, &again].map(Session::view);
    assert_eq!((theirs.history.len(), theirs.version_id), (5, ours.version_id));
    assert_eq!(theirs.history[3].name.as_deref(), Some("left behind"));
    assert_eq!((theirs.undo, theirs.history[3].parent), (ours.undo, Some(2)));
    // What happens now is in the same journal.
    let mut again = again;
    rename(&mut again, "d");
    let second = folder.0.join("second");
    killed(&again, &copy, &second);
    assert_eq!(reopened(&second).0.lens().name, "d");
}

#[test]
fn a_saved_design_reopens_as_it_was_and_a_closed_one_does_not() {
    let folder = Folder::new("journal-closed");
    let mut session = journaled(blank(), &folder.journals());
    rename(&mut session, "given up");
    drop(session);
    assert_eq!(fs::read_dir(folder.journals()).unwrap().count(), 0, "it has no file");

    let mut session = journaled(blank(), &folder.journals());
    rename(&mut session, "kept");
    let file = folder.0.join("kept.json");
    session.apply(Command::Save(Some(file.clone())));
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (again, text) = reopened(&copy);
    let text = text.unwrap();
    assert!(text.starts_with("reopened kept as it was saved, with the 2 versions"), "{text}");
    assert_eq!(text.lines().count(), 1);
    assert_eq!((again.lens().name.as_str(), again.view().path), ("kept", Some(file.clone())));
    assert!(!again.is_dirty(), "it is as it was saved");
    rename(&mut session, "changed");
    let changed = folder.0.join("changed");
    killed(&session, &folder.journals(), &changed);
    let (again, _) = reopened(&changed);
    assert_eq!((again.lens().name.as_str(), again.view().path), ("changed", Some(file.clone())));
    drop(session);
    assert_eq!(reopened(&folder.journals()).1, None, "it was closed");

    let mut session = journaled(blank(), &folder.journals());
    session.apply(Command::Open(file));
    let view = session.view();
    assert_eq!((view.history.len(), view.lens.name.as_str()), (3, "kept"), "its history is back");
    assert!(!view.dirty && view.undo.is_some());
}

#[test]
fn a_damaged_end_is_cut_wherever_it_begins() {
    let folder = Folder::new("journal-damaged");
    let mut session = journaled(blank(), &folder.journals());
    let names = ["a", "b", "c", "d"];
    for name in names {
        rename(&mut session, name);
    }
    session.sync_journal();
    let mut files = fs::read_dir(folder.journals()).unwrap().flatten().map(|file| file.path());
    let file = files.find(|path| path.extension().is_some_and(|end| end == "journal"));
    let whole = fs::read(file.unwrap()).unwrap();
    let copy = folder.0.join("copy");
    let mut found = Vec::new();
    for cut in (0..whole.len()).step_by(whole.len() / 40).chain([whole.len()]) {
        fs::create_dir_all(&copy).unwrap();
        let mut damaged = whole[..cut].to_vec();
        damaged.extend([b"garbage".as_slice(), &whole[whole.len().min(cut + 9)..]].concat());
        fs::write(copy.join("unsaved.journal"), damaged).unwrap();
        let (again, text) = reopened(&copy);
        if text.is_some() {
            found.push(again.lens().name.clone());
        }
        drop(again);
        fs::remove_dir_all(&copy).unwrap();
    }
    assert!(found.is_sorted() && found.len() > 10, "{found:?}");
    assert_eq!(found.last().unwrap(), "d", "{found:?}");
}

#[test]
fn the_proposed_merit_function_is_the_same_after_a_recovery() {
    let folder = Folder::new("journal-goal");
    let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "singlet_la1131");
    let lens = files::json::read(bundled.unwrap().text, "singlet").unwrap();
    let mut session = journaled(lens, &folder.journals());
    let power = session.lens().surfaces[0].curvature + session.lens().surfaces[1].curvature.abs();
    session.apply(Edit::set_radius(0, 1.0 / (1.3 * power)).into());
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (again, _) = reopened(&copy);
    assert_eq!(again.lens(), session.lens());
    assert_eq!(again.view().goal, session.view().goal);
    assert_ne!(again.view().goal, Goal::default_for(again.lens()).ok().map(Into::into));
}

#[test]
fn an_interrupted_optimization_leaves_its_best_lens_in_the_history() {
    let folder = Folder::new("journal-run");
    let parameter = Parameter::new(0, Quantity::Curvature);
    let mut lens = blank();
    lens.surfaces[0].curvature = 0.02;
    lens.variables = vec![Variable { parameter, min: None, max: None }];
    let mut session = journaled(lens, &folder.journals());
    let terms = vec![WeightedTerm::new(Term::FocalLength(150.0), 1.0)];
    let goal = Goal {
        terms,
        pupil: PupilEdge::Frozen,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    session.apply(Command::Optimize {
        method: DescentMethod::Adam,
        goal: goal.clone(),
        glasses: None,
    });
    wait(&mut session, "a journal", |_, _| folder.journals().join("unsaved.journal").exists());
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (again, text) = reopened(&copy);
    assert!(text.unwrap().contains("1 lens of an interrupted run"));
    let view = again.view();
    let kept = view.history.last().unwrap();
    assert!(kept.title.starts_with("optimization, interrupted at step "), "{}", kept.title);
    assert_eq!((kept.parent, kept.lens.merit.as_ref()), (Some(0), Some(&goal)));
    assert_eq!(view.version_id, 0, "the design itself has not changed");
    session.apply(Command::Stop);
    session.apply(Command::DiscardResult);
    let second = folder.0.join("second");
    killed(&session, &folder.journals(), &second);
    assert_eq!(reopened(&second).1, None, "a dismissed result is not recovered");
}

#[test]
fn two_windows_have_two_journals() {
    let folder = Folder::new("journal-two");
    let mut first = journaled(blank(), &folder.journals());
    let mut second = journaled(blank(), &folder.journals());
    rename(&mut first, "first");
    first.sync_journal();
    rename(&mut second, "second");
    second.sync_journal();
    assert_eq!(reopened(&folder.journals()).1, None, "both are open");
    let copy = folder.0.join("copy");
    killed(&first, &folder.journals(), &copy);
    let (one, _) = reopened(&copy);
    let (other, _) = reopened(&copy);
    let mut names = [one.lens().name.clone(), other.lens().name.clone()];
    names.sort();
    assert_eq!(names, ["first", "second"]);
}

/// A new design has a journal of its own: what was done to it before it was killed is all there is.
#[test]
fn a_killed_design_that_followed_another_reopens_without_it() {
    let folder = Folder::new("journal-next");
    let mut session = journaled(blank(), &folder.journals());
    rename(&mut session, "first");
    let file = folder.0.join("first.json");
    session.apply(Command::Save(Some(file)));
    session.apply(Command::New(Box::new(blank())));
    rename(&mut session, "second");
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (again, text) = reopened(&copy);
    assert!(
        text.unwrap().starts_with(
            "recovered second, which the program ended without closing, with 1 unsaved"
        )
    );
    assert_eq!((again.lens(), again.view().path), (session.lens(), None));
    assert_eq!(again.view().history.len(), session.view().history.len());
}

/// A lens that was begun and saved without any edit is where the work was, and so is one whose file has
/// changed since.
#[test]
fn a_lens_that_was_only_saved_reopens_unless_another_one_was_used_later() {
    let folder = Folder::new("journal-saved");
    let mut session = journaled(blank(), &folder.journals());
    let lens = Lens { name: "begun".to_owned(), ..blank() };
    session.apply(Command::New(Box::new(lens.clone())));
    let file = folder.0.join("begun.json");
    session.apply(Command::Save(Some(file.clone())));
    let [copy, second] = ["copy", "second"].map(|name| folder.0.join(name));
    killed(&session, &folder.journals(), &copy);
    killed(&session, &folder.journals(), &second);
    let (again, text) = reopened(&copy);
    assert!(text.unwrap().starts_with("reopened begun as it was saved"));
    assert_eq!(again.view().path, Some(file.clone()));
    drop(again);
    assert_eq!(reopened(&copy).1, None, "it was closed in order");
    let other = Lens { notes: "by another program".to_owned(), ..lens };
    files::save(&other, &file).unwrap();
    let (again, text) = reopened(&second);
    let text = text.unwrap();
    assert!(text.contains("begun.json contains now") && text.lines().count() == 1, "{text}");
    assert!(again.is_dirty() && again.lens().notes.is_empty());
}
