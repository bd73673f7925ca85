//! A design that begins without glass: what was asked for stays, and the merit function that is shown
//! is the one that is saved.

use super::session_journal::{Folder, journaled, killed, rename, reopened};
use aplanat::files;
use aplanat::lens::{
    Aperture, Edit, ElementEdit, ElementForm, FieldKind, Fields, Lens, NewElement, Object,
    Parameter, Quantity, StartingForm, StartingLens, WavelengthPreset, blank,
};
use aplanat::merit::{Goal, Term};
use aplanat::session::{Command, Session};
use std::path::Path;

/// A lens of 35 mm and f/2 without any glass.
fn starting() -> StartingLens {
    StartingLens {
        form: StartingForm::Empty,
        focal_length: 35.0,
        aperture: Aperture::FNumber(2.0),
        fields: Fields::equal_area(FieldKind::Angle, 18.0, 3),
        wavelengths: WavelengthPreset::ALL[0].wavelengths(),
        object: Object::Infinity,
    }
}

fn begun(session: &mut Session) {
    session.apply(Command::Begin(Box::new(starting())));
}

/// Adds an element behind the last one.
fn add(session: &mut Session, form: ElementForm, focal_length: f64) {
    let element = NewElement { form, focal_length, semi_diameter: 12.0, shape_factor: 0.0 };
    let rows = element.rows(0.5875618).unwrap();
    let at = session.lens().surfaces.len();
    session.apply(Edit::Element(ElementEdit::Insert { at, rows }).into());
}

fn goal(session: &Session) -> Goal {
    Goal::clone(&session.view().goal.unwrap())
}

/// The focal length that a merit function asks for.
fn target(goal: &Goal) -> Option<f64> {
    goal.terms.iter().find_map(|weighted| match weighted.term {
        Term::FocalLength(target) => Some(target),
        _ => None,
    })
}

fn longest_track(goal: &Goal) -> f64 {
    let track = |term| if let Term::TotalTrack(max) = term { Some(max) } else { None };
    goal.terms.iter().find_map(|weighted| track(weighted.term)).unwrap()
}

/// The merit function that a reader of a file takes.
fn goal_of_file(path: &Path) -> (Option<Goal>, Goal) {
    let lens: Lens = files::open(path).unwrap().lens;
    let own = lens.merit.clone();
    (own, Goal::of_lens(&lens).unwrap())
}

#[test]
fn a_lens_that_begins_without_glass_keeps_what_was_asked_for() {
    let mut session = Session::new(blank(), || {}).unwrap();
    begun(&mut session);
    assert_eq!(session.lens().aperture, Aperture::EntrancePupilDiameter(17.5), "it has no focus");
    add(&mut session, ElementForm::Singlet, 60.0);
    assert_eq!(session.lens().aperture, Aperture::FNumber(2.0));
    assert_eq!(target(&goal(&session)), Some(35.0));
    let text = session.view().messages.last().unwrap().text.clone();
    assert!(text.contains("f/2"), "{text}");
    add(&mut session, ElementForm::CementedDoublet, 70.0);
    let grown = goal(&session);
    assert_eq!(target(&grown), Some(35.0));
    let track = session.lens().resolve(0, 0.5875618).unwrap().total_track();
    assert!(longest_track(&grown) > track, "{} {track}", longest_track(&grown));
    session.apply(Command::ScaleToFocalLength(35.0));
    assert_eq!(session.lens().aperture, Aperture::FNumber(2.0));
    assert!((target(&goal(&session)).unwrap() - 35.0).abs() < 1e-9);
    // Back at the empty stop it is asked for anew.
    for _ in 0..3 {
        session.apply(Command::Undo);
    }
    assert_eq!(session.lens().aperture, Aperture::EntrancePupilDiameter(17.5));
    add(&mut session, ElementForm::Singlet, 50.0);
    assert_eq!(session.lens().aperture, Aperture::FNumber(2.0));
}

/// An element that shortens the focal length shortens the track, but not the room for the one that is asked
/// for: a limit of the short track would make it a telephoto lens.
#[test]
fn an_added_element_leaves_room_for_the_focal_length_that_is_asked_for() {
    let mut session = Session::new(blank(), || {}).unwrap();
    let form = StartingForm::Element(ElementForm::CementedDoublet);
    session.apply(Command::Begin(Box::new(StartingLens { form, ..starting() })));
    let before = longest_track(&goal(&session));
    add(&mut session, ElementForm::Singlet, 35.0);
    let after = longest_track(&goal(&session));
    assert!(after >= before, "{before} {after}");
    session.apply(Command::ScaleToFocalLength(35.0));
    let scaled = longest_track(&goal(&session));
    assert!((after / scaled - 1.0).abs() < 1e-6, "{after} {scaled}");
}

#[test]
fn an_aperture_that_was_set_by_hand_stays() {
    let mut session = Session::new(blank(), || {}).unwrap();
    begun(&mut session);
    let narrow = Aperture::EntrancePupilDiameter(10.0);
    session.apply(Edit::SetAperture(narrow).into());
    add(&mut session, ElementForm::Singlet, 60.0);
    assert_eq!(session.lens().aperture, narrow);
}

#[test]
fn the_proposed_merit_function_that_is_shown_is_in_the_file() {
    let folder = Folder::new("begin-saved");
    let file = folder.0.join("saved.json");
    let mut session = journaled(blank(), &folder.journals());
    begun(&mut session);
    add(&mut session, ElementForm::Singlet, 60.0);
    session.apply(Command::Save(Some(file.clone())));
    let shown = goal(&session);
    assert_eq!(goal_of_file(&file), (Some(shown.clone()), shown.clone()));
    assert!(!session.is_dirty());
    // In the window it is still a proposal, which follows the structure.
    drop(session);
    let mut again = journaled(blank(), &folder.journals());
    again.apply(Command::Open(file.clone()));
    assert_eq!((goal(&again), again.lens().merit.clone()), (shown.clone(), None));
    assert_eq!(again.view().history.len(), 2);
    add(&mut again, ElementForm::CementedDoublet, 70.0);
    assert_ne!(goal(&again), shown);
    assert_eq!(target(&goal(&again)), Some(35.0));
    // What a reader would propose in any case is not written.
    again.apply(Command::ScaleToFocalLength(35.0));
    again.apply(Command::Save(None));
    assert_eq!(goal_of_file(&file), (None, goal(&again)));
    let parameter = Parameter::new(1, Quantity::Thickness);
    let value = again.lens().surfaces[1].thickness + 2.0;
    again.apply(Edit::Set { parameter, value }.into());
    again.apply(Command::Save(None));
    assert_eq!(goal_of_file(&file).1, goal(&again));
}

#[test]
fn what_was_asked_for_survives_a_kill() {
    let folder = Folder::new("begin-killed");
    let mut session = journaled(blank(), &folder.journals());
    begun(&mut session);
    rename(&mut session, "without glass");
    let copy = folder.0.join("copy");
    killed(&session, &folder.journals(), &copy);
    let (mut again, text) = reopened(&copy);
    assert!(text.is_some());
    add(&mut again, ElementForm::Singlet, 60.0);
    assert_eq!(again.lens().aperture, Aperture::FNumber(2.0));
    assert_eq!(target(&goal(&again)), Some(35.0));
}
