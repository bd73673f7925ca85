//! Drags of handles in a session: one undo step each, taken back by a command, with the slopes of
//! the merit.

use aplanat::files::{bundled_lenses, focal_length, json};
use aplanat::lens::{Edit, ElementEdit, Lens, Medium};
use aplanat::merit::{Goal, Merit, Term, TermValue, WeightedTerm};
use aplanat::paraxial::{DragSettings, FirstOrderLock, FreeNumbers, Handle};
use aplanat::session::{Command, MeritSlopes, Session};
use std::thread;
use std::time::Duration;

fn bundled(name: &str) -> Lens {
    let found = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
    json::read(found.text, name).unwrap()
}

fn session() -> Session {
    Session::new(bundled("cooke_triplet_100_f27"), || {}).unwrap()
}

fn drag(handle: Handle, value: f64) -> Command {
    Command::DragHandle { handle, value, rim: None }
}

fn lock(session: &mut Session, locks: &[FirstOrderLock]) {
    let settings = DragSettings { locks: locks.to_vec(), ..DragSettings::default() };
    session.apply(Command::SetDragSettings(settings));
}

fn last_message(session: &Session) -> String {
    session.view().messages.last().map(|message| message.text.clone()).unwrap_or_default()
}

#[test]
fn a_drag_is_one_undo_step() {
    let mut session = session();
    let before = session.lens().clone();
    lock(&mut session, &[FirstOrderLock::FocalLength]);
    let start = before.surfaces[1].curvature;
    for i in 1..=20 {
        session.apply(drag(Handle::Curvature(1), start + 1e-5 * f64::from(i)));
    }
    let view = session.view();
    let progress = view.drag.progress.unwrap();
    assert_eq!((progress.value, progress.start), (start + 2e-4, start));
    assert_eq!((view.undo, progress.stop.clone()), (None, None));
    assert!(!progress.moved.is_empty() && *progress.before == *before);
    session.apply(Command::EndDrag);
    assert!(session.view().drag.progress.is_none());
    assert_eq!(session.view().undo.as_deref(), Some("drag the curvature of surface 2"));
    let told = last_message(&session);
    assert!(told.starts_with("the focal length was held by radius of surface "), "{told}");
    assert!(!told.contains("curvature"), "the table shows radii: {told}");
    let after = session.lens().clone();
    session.apply(Command::Undo);
    assert_eq!(*session.lens(), before);
    assert_eq!(session.view().undo, None, "one step");
    session.apply(Command::Redo);
    assert_eq!(*session.lens(), after);
}

#[test]
fn a_drag_is_taken_back_without_a_trace() {
    let mut session = session();
    let before = session.lens().clone();
    session.apply(drag(Handle::Vertex(2), 1.0));
    assert_ne!(*session.lens(), before);
    session.apply(Command::CancelDrag);
    let view = session.view();
    assert_eq!((view.lens, view.undo, view.redo, view.dirty), (before, None, None, false));
}

#[test]
fn another_handle_or_edit_ends_a_drag() {
    let mut session = session();
    let start = session.lens().surfaces[0].curvature;
    session.apply(drag(Handle::Curvature(0), 1.01 * start));
    session.apply(drag(Handle::ImagePlane, 80.0));
    session.apply(Command::Edit(Edit::set_radius(2, -40.0)));
    for title in ["radius of surface 3", "drag the image plane", "drag the curvature of surface 1"]
    {
        assert_eq!(session.view().undo.as_deref(), Some(title));
        session.apply(Command::Undo);
    }
    assert_eq!(session.view().undo, None);
    session.apply(drag(Handle::ImagePlane, session.lens().surfaces[6].thickness));
    session.apply(Command::EndDrag);
    assert_eq!(session.view().undo, None, "a handle that came back is no step");
}

#[test]
fn a_handle_that_cannot_be_dragged_says_why_once() {
    let mut session = session();
    lock(&mut session, &[FirstOrderLock::Magnification]);
    for _ in 0..3 {
        session.apply(drag(Handle::Curvature(0), 0.01));
    }
    let view = session.view();
    let why = "the magnification cannot be held: the object is at infinity, so that there is no \
               magnification";
    assert_eq!(view.drag.error.as_deref(), Some(why));
    assert_eq!((view.messages.len(), view.dirty), (1, false));
}

fn slopes(session: &mut Session) -> MeritSlopes {
    for _ in 0..6000 {
        session.poll();
        let view = session.view();
        let slopes = view.drag.slopes.filter(|slopes| slopes.version == view.version);
        if let Some(slopes) = slopes {
            return slopes.result.clone().unwrap();
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("no slopes");
}

#[test]
fn slopes_are_the_derivatives_of_the_merit() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let mut session = Session::new(lens.clone(), || {}).unwrap();
    let found = slopes(&mut session);
    let goal = Goal::default_for(&lens).unwrap();
    let start = Merit::new(&lens, &goal, 1e-5).unwrap();
    let merit = |lens: &Lens| {
        let merit = Merit::new(lens, &goal, 1e-5).unwrap();
        let merit = merit.with_initial_light(start.initial_light());
        merit.value(&merit.values(lens)).unwrap()
    };
    for (handle, h) in
        [(Handle::Curvature(2), 2e-6), (Handle::Vertex(4), 1e-4), (Handle::Rim(0), 1e-3)]
    {
        let value = handle.value(&lens, 0).unwrap();
        let at = |value: f64| {
            let mut moved = lens.clone();
            for (parameter, by) in handle.motion(&lens, 0) {
                let old = lens.get(parameter).unwrap();
                moved.set(parameter, old + by * (value - handle.value(&lens, 0).unwrap()));
            }
            merit(&moved)
        };
        let difference = (at(value + h) - at(value - h)) / (2.0 * h);
        let slope = found.slope(handle).unwrap();
        let off = (slope - difference).abs() / difference.abs().max(1e-6);
        assert!(off < 0.05, "{handle}: {slope:e} {difference:e}");
    }
    assert!((found.merit / found.before - 1.0).abs() < 1e-9);
}

#[test]
fn the_merit_at_the_handles_is_that_of_the_design() {
    let mut session = session();
    // Another focal length than that which the proposed merit function asks for.
    session.apply(Command::Edit(Edit::set_radius(0, 60.0)));
    let at_handles = slopes(&mut session).merit;
    let goal = session.view().goal.unwrap();
    let merit = Merit::new(session.lens(), &goal, 1e-5).unwrap();
    let own = merit.value(&merit.values(session.lens())).unwrap();
    assert!((at_handles / own - 1.0).abs() < 1e-2, "{at_handles} {own}");
    let proposed_now = Goal::of_lens(session.lens()).unwrap();
    let merit = Merit::new(session.lens(), &proposed_now, 1e-5).unwrap();
    let other = merit.value(&merit.values(session.lens())).unwrap();
    assert!((own / other - 1.0).abs() > 0.05, "the two are told apart: {own} {other}");
}

/// The pupils of the lens before follow the dragged one: its merit is that of pupils of its own.
#[test]
fn the_merit_of_a_dragged_lens_comes_with_its_slopes() {
    let mut session = session();
    slopes(&mut session);
    let start = session.lens().surfaces[0].curvature;
    session.apply(drag(Handle::Curvature(0), 1.01 * start));
    let found = slopes(&mut session);
    let report = session.view().merit.unwrap();
    assert!(std::sync::Arc::ptr_eq(&report.lens, session.lens()));
    assert_eq!(report.values.as_ref().unwrap().total, found.values.total);
    let merit = Merit::new(session.lens(), &report.goal, 1e-3).unwrap();
    let spot = |terms: &[TermValue]| terms.iter().find(|term| term.term == "spot").unwrap().value;
    let fresh = spot(&merit.terms(&merit.values(session.lens())).unwrap());
    let followed = spot(&found.values.terms);
    assert!((followed / fresh - 1.0).abs() < 5e-3, "{followed} and {fresh}");
}

/// Rims that nobody has fixed follow the dragged lens, and the edges at them: the merit is the same once
/// the handle is released.
#[test]
fn the_edges_of_a_dragged_lens_are_those_at_its_own_rims() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let terms = [Term::Spot, Term::GlassEdge(20.0)];
    let terms = terms.map(|term| WeightedTerm::new(term, 1.0)).to_vec();
    lens.merit = Some(Goal { terms, ..Goal::default_for(&lens).unwrap() });
    let mut session = Session::new(lens.clone(), || {}).unwrap();
    slopes(&mut session);
    let edges = |lens: &Lens, of: &Lens| {
        let mut merit = Merit::new(lens, lens.merit.as_ref().unwrap(), 1e-2).unwrap();
        merit.follow_rims(of);
        let terms = merit.terms(&merit.values(lens)).unwrap();
        terms.iter().find(|term| term.term == "glass_edge").unwrap().value
    };
    let handle = Handle::Vertex(3);
    let start = handle.value(&lens, 0).unwrap();
    session.apply(drag(handle, start + 4.0));
    let found = slopes(&mut session);
    let held = found.values.terms.iter().find(|term| term.term == "glass_edge").unwrap().value;
    let dragged = Lens::clone(session.lens());
    let [own, outdated] = [&dragged, &lens].map(|of| edges(&dragged, of));
    assert!((held / own - 1.0).abs() < 1e-9, "{held} {own}");
    assert!((outdated / own - 1.0).abs() > 1e-3, "the two are told apart: {outdated} {own}");
}

/// A lens with two elements that face each other with different radii, and the surface in front of the air
/// between them.
fn parted() -> (Session, usize) {
    let mut session = Session::new(bundled("double_gauss_rudolph_50"), || {}).unwrap();
    let rows = &session.lens().surfaces;
    let is_cemented =
        |i: &usize| rows[*i].medium != Medium::Air && rows[*i - 1].medium != Medium::Air;
    let surface = (1..rows.len()).find(is_cemented).unwrap();
    session.apply(Edit::Element(ElementEdit::Split(surface)).into());
    let radius = 1.0 / session.lens().surfaces[surface].curvature;
    session.apply(Edit::set_radius(surface, 2.0 * radius).into());
    (session, surface)
}

#[test]
fn cementing_tells_how_the_focal_length_has_changed() {
    let (mut session, surface) = parted();
    let before = focal_length(session.lens(), 0).unwrap();
    session.apply(Edit::Element(ElementEdit::Cement(surface)).into());
    let after = focal_length(session.lens(), 0).unwrap();
    assert!((after - before).abs() > 1e-3 * before, "{before} {after}");
    let told = last_message(&session);
    let says = |value: f64| told.contains(&format!("{value:.2}")[..4]);
    assert!(told.starts_with("the focal length has changed from "), "{told}");
    assert!(says(before) && says(after), "{told}: {before} {after}");
    assert!(told.contains("Scale to a focal length"), "it says what restores it: {told}");
}

#[test]
fn cementing_holds_what_is_locked() {
    let (mut session, surface) = parted();
    let before = session.lens().clone();
    lock(&mut session, &[FirstOrderLock::FocalLength, FirstOrderLock::Track]);
    session.apply(Edit::Element(ElementEdit::Cement(surface)).into());
    let after = session.lens().clone();
    let [kept, now] = [&before, &after].map(|lens| focal_length(lens, 0).unwrap());
    assert!((now - kept).abs() < 1e-8 * kept, "{kept} {now}");
    let [kept, now] = [&before, &after].map(|lens| lens.total_track());
    assert!((now - kept).abs() < 1e-8 * kept, "{kept} {now}");
    let told = last_message(&session);
    assert!(told.starts_with("the focal length and the track were held by "), "{told}");
    session.apply(Command::Undo);
    assert_eq!(*session.lens(), before, "one step");
}

#[test]
fn an_edit_that_cannot_hold_what_is_locked_says_why_and_what_has_changed() {
    let (mut session, surface) = parted();
    let locks = vec![FirstOrderLock::FocalLength];
    let settings = DragSettings { locks, free: FreeNumbers::Variables };
    session.apply(Command::SetDragSettings(settings));
    session.apply(Edit::SetVariables(Vec::new()).into());
    session.apply(Edit::Element(ElementEdit::Cement(surface)).into());
    let told = last_message(&session);
    assert!(told.starts_with("the focal length cannot be held: "), "{told}");
    assert!(told.contains("the focal length has changed from "), "{told}");
}
