//! The handles of the layout in the whole window: by the pointer, by keys, by a typed value.

use aplanat::paraxial::Handle;
use aplanat::session::Command;
use aplanat::studio::Studio;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{double_gauss, painted_texts};
use crate::window::{settle, window};

/// The name of a handle in the accessibility tree.
fn name(handle: Handle) -> String {
    format!("Handle: {handle}")
}

fn center(harness: &Harness<'_, Studio>, handle: Handle) -> Pos2 {
    harness.get_by_label(&name(handle)).rect().center()
}

fn button(harness: &mut Harness<'_, Studio>, pos: Pos2, pressed: bool, modifiers: Modifiers) {
    let button = PointerButton::Primary;
    harness.event(Event::PointerButton { pos, button, pressed, modifiers });
    harness.step();
}

fn move_to(harness: &mut Harness<'_, Studio>, pos: Pos2) {
    harness.event(Event::PointerMoved(pos));
    harness.step();
}

/// Holds these keys from now on.
fn hold_keys(harness: &mut Harness<'_, Studio>, modifiers: Modifiers) {
    harness.event(Event::ModifiersChanged(modifiers));
    harness.step();
}

/// Presses the button on a handle and moves it, without releasing it.
fn pull(harness: &mut Harness<'_, Studio>, handle: Handle, by: Vec2, modifiers: Modifiers) -> Pos2 {
    let from = center(harness, handle);
    hold_keys(harness, modifiers);
    move_to(harness, from);
    harness.step();
    button(harness, from, true, modifiers);
    for i in 1..=4_u8 {
        move_to(harness, from + by * (f32::from(i) / 4.0));
    }
    harness.step();
    from + by
}

fn curvature(harness: &Harness<'_, Studio>, surface: usize) -> f64 {
    harness.state().session().lens().surfaces[surface].curvature
}

fn undo_title(harness: &Harness<'_, Studio>) -> Option<String> {
    harness.state().session().view().undo
}

fn focal_length(harness: &Harness<'_, Studio>) -> f64 {
    let results = harness.state().session().results().unwrap();
    results.analyses.as_ref().unwrap().first_order().efl.unwrap()
}

const PLAIN: Modifiers = Modifiers::NONE;

#[test]
fn a_handle_dragged_by_the_pointer_is_one_undo_step() {
    let mut harness = window();
    let (handle, start) = (Handle::Curvature(0), curvature(&harness, 0));
    let to = pull(&mut harness, handle, Vec2::new(9.0, 0.0), PLAIN);
    assert!(curvature(&harness, 0) > start, "the lens follows before the button is released");
    assert_eq!(undo_title(&harness), None);
    button(&mut harness, to, false, PLAIN);
    settle(&mut harness);
    assert_eq!(undo_title(&harness).as_deref(), Some("drag the curvature of surface 1"));
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
    assert_eq!(undo_title(&harness), None);
}

#[test]
fn a_locked_focal_length_stays_and_the_window_says_what_has_moved() {
    let mut harness = window();
    let before = focal_length(&harness);
    harness.get_by_label("Hold the focal length").click();
    harness.run_steps(2);
    let to = pull(&mut harness, Handle::Curvature(2), Vec2::new(8.0, 0.0), PLAIN);
    button(&mut harness, to, false, PLAIN);
    settle(&mut harness);
    assert!((focal_length(&harness) / before - 1.0).abs() < 1e-9);
    assert_ne!(curvature(&harness, 2), double_gauss().surfaces[2].curvature);
    harness.get_by_label_contains("The focal length was held by ");
}

#[test]
fn escape_takes_a_drag_back() {
    let mut harness = window();
    let to = pull(&mut harness, Handle::Vertex(1), Vec2::new(9.0, 0.0), PLAIN);
    assert_ne!(*harness.state().session().lens().as_ref(), double_gauss());
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
    move_to(&mut harness, to + Vec2::new(5.0, 0.0));
    button(&mut harness, to + Vec2::new(5.0, 0.0), false, PLAIN);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
    assert_eq!(undo_title(&harness), None);
}

#[test]
fn a_value_typed_during_a_drag_counts_instead_of_the_pointer() {
    let mut harness = window();
    let to = pull(&mut harness, Handle::Curvature(0), Vec2::new(9.0, 0.0), PLAIN);
    for text in ["1", "5", ".", "5"] {
        harness.event(Event::Text(text.to_owned()));
        harness.step();
    }
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    assert_eq!(curvature(&harness, 0), 1.0 / 15.5);
    move_to(&mut harness, to + Vec2::new(20.0, 0.0));
    button(&mut harness, to + Vec2::new(20.0, 0.0), false, PLAIN);
    harness.run_steps(2);
    assert_eq!(curvature(&harness, 0), 1.0 / 15.5, "the button has no say any more");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
}

#[test]
fn arrow_keys_step_a_selected_handle_as_one_undo_step() {
    let mut harness = window();
    let at = center(&harness, Handle::Curvature(0));
    move_to(&mut harness, at);
    harness.step();
    button(&mut harness, at, true, PLAIN);
    button(&mut harness, at, false, PLAIN);
    harness.run_steps(2);
    assert_eq!(harness.state().session().view().selected, Some(0));
    let start = curvature(&harness, 0);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(2);
    let coarse = curvature(&harness, 0) - start;
    harness.key_press_modifiers(Modifiers::SHIFT, Key::ArrowRight);
    harness.run_steps(2);
    let fine = curvature(&harness, 0) - start - coarse;
    assert!(coarse > 0.0 && (fine / coarse - 0.1).abs() < 0.02, "{coarse:e} {fine:e}");
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    assert_eq!(undo_title(&harness).as_deref(), Some("drag the curvature of surface 1"));
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
}

/// The pointer rests in the drawing while a person goes through the handles by keys.
#[test]
fn the_tab_key_goes_through_the_handles_of_the_surface_that_arrows_select() {
    let mut harness = window();
    let layout = harness.get_by_label_contains("Section of ").rect();
    move_to(&mut harness, layout.right_bottom() - Vec2::new(12.0, 12.0));
    harness.get_by_label_contains("Section of ").focus();
    harness.run_steps(2);
    for selected in [0, 1] {
        harness.key_press(Key::ArrowRight);
        harness.run_steps(2);
        assert_eq!(harness.state().session().view().selected, Some(selected));
    }
    for handle in [Handle::Vertex(1), Handle::Curvature(1), Handle::Rim(1)] {
        harness.key_press(Key::Tab);
        harness.run_steps(3);
        assert!(harness.get_by_label(&name(handle)).is_focused(), "{handle}");
        let told = painted_texts(&harness);
        let what = handle.to_string();
        assert!(told.iter().any(|text| text.starts_with(&what)), "{what}: {told:?}");
    }
}

#[test]
fn plus_and_home_zoom_a_drawing_with_the_keyboard() {
    let mut harness = window();
    let whole = center(&harness, Handle::ImagePlane).x - center(&harness, Handle::Vertex(0)).x;
    let size = |harness: &Harness<'_, Studio>| {
        center(harness, Handle::Vertex(4)).x - center(harness, Handle::Vertex(0)).x
    };
    let before = size(&harness);
    harness.get_by_label_contains("Section of ").focus();
    harness.run_steps(2);
    harness.event(Event::Text("+".to_owned()));
    harness.run_steps(2);
    assert!((size(&harness) / before - 1.2).abs() < 0.01);
    harness.key_press(Key::Home);
    harness.run_steps(2);
    let now = center(&harness, Handle::ImagePlane).x - center(&harness, Handle::Vertex(0)).x;
    assert!((now - whole).abs() < 1.0);
}

#[test]
fn control_snaps_to_round_numbers_and_alt_bends_an_element() {
    let mut harness = window();
    let to = pull(&mut harness, Handle::Curvature(0), Vec2::new(-9.0, 0.0), Modifiers::COMMAND);
    button(&mut harness, to, false, Modifiers::COMMAND);
    hold_keys(&mut harness, PLAIN);
    let radius = 1.0 / curvature(&harness, 0);
    assert!((radius * 10.0 - (radius * 10.0).round()).abs() < 1e-9, "{radius}");
    settle(&mut harness);

    let before = harness.state().session().lens().clone();
    let element = Handle::Element { front: 0, back: 1 };
    let to = pull(&mut harness, element, Vec2::new(-9.0, 0.0), Modifiers::ALT);
    button(&mut harness, to, false, Modifiers::ALT);
    let change = |i: usize| curvature(&harness, i) - before.surfaces[i].curvature;
    assert!(change(0) != 0.0 && (change(1) / change(0) - 1.0).abs() < 1e-9);
    assert_eq!(change(2), 0.0);
}

#[test]
fn a_drag_on_the_drawing_itself_moves_the_view() {
    let mut harness = window();
    let layout = harness.get_by_label_contains("Section of ").rect();
    let from = layout.left_top() + Vec2::new(12.0, 12.0);
    let before = center(&harness, Handle::Vertex(3));
    move_to(&mut harness, from);
    button(&mut harness, from, true, PLAIN);
    let by = Vec2::new(30.0, 20.0);
    move_to(&mut harness, from + by);
    button(&mut harness, from + by, false, PLAIN);
    harness.run_steps(2);
    assert!((center(&harness, Handle::Vertex(3)) - before - by).length() < 1.0);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
}

#[test]
fn another_lens_is_shown_whole() {
    let mut harness = window();
    let places = |harness: &Harness<'_, Studio>| {
        [Handle::Vertex(3), Handle::ImagePlane].map(|handle| center(harness, handle))
    };
    let whole = places(&harness);
    let layout = harness.get_by_label_contains("Section of ").rect();
    let from = layout.left_top() + Vec2::new(12.0, 12.0);
    move_to(&mut harness, from);
    button(&mut harness, from, true, PLAIN);
    move_to(&mut harness, from + Vec2::new(30.0, 20.0));
    button(&mut harness, from + Vec2::new(30.0, 20.0), false, PLAIN);
    harness.run_steps(2);
    assert!((places(&harness)[0] - whole[0]).length() > 20.0);
    harness.state_mut().session_mut().apply(Command::New(Box::new(double_gauss())));
    settle(&mut harness);
    for (now, whole) in places(&harness).into_iter().zip(whole) {
        assert!((now - whole).length() < 1.0, "{now:?} {whole:?}");
    }
}
