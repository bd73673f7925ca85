//! A lens begun from nothing: the dialogs, the system, zoom positions, the command palette.

use std::path::PathBuf;
use std::sync::Arc;

use aplanat::lens::{
    Aperture, Edit, ElementEdit, ElementForm, FieldKind, Fields, Lens, Object, Quantity,
    StartingForm, StartingLens, WavelengthPreset, ZoomPosition, apply_edit,
};
use aplanat::merit::Term;
use aplanat::session::{Command, Session, SessionView};
use aplanat::studio::Studio;
use aplanat::studio::draw::RenderBackend;
use aplanat::studio::panels::{FirstOrderPanel, Panel, PrescriptionPanel, SystemPanel, ZoomPanel};
use aplanat::studio::theme;
use aplanat::studio::window::Persistence;
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{
    PanelState, double_gauss, painted_galleys, painted_texts, panel_harness, view_of,
};

fn starting(form: StartingForm) -> Lens {
    let starting = StartingLens {
        form,
        focal_length: 50.0,
        aperture: Aperture::FNumber(4.0),
        fields: Fields::equal_area(FieldKind::Angle, 10.0, 3),
        wavelengths: WavelengthPreset::ALL[0].wavelengths(),
        object: Object::Infinity,
    };
    starting.lens().unwrap()
}

fn achromat() -> Lens {
    starting(StartingForm::Element(ElementForm::CementedDoublet))
}

/// The window on a lens, without waiting for its numbers.
fn window(lens: Lens) -> Harness<'static, Studio> {
    let session = Session::new(lens, || {}).unwrap();
    let studio = Studio::new(session, RenderBackend::Software, Persistence::Disabled, None);
    let builder = Harness::builder().with_size([1280.0, 800.0]).with_context_setup(theme::apply);
    let mut harness = builder.build_ui_state(|ui, studio: &mut Studio| studio.ui(ui), studio);
    harness.run_steps(2);
    harness
}

fn press(harness: &mut Harness<'_, Studio>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(3);
}

/// Types into a field of a dialog.
fn enter_text(harness: &mut Harness<'_, Studio>, field: &str, text: &str) {
    harness.get_by_label(field).focus();
    harness.run_steps(2);
    harness.get_by_label(field).type_text(text);
    harness.run_steps(3);
}

/// Presses an item of a menu, whose label also has its shortcut.
fn press_item(harness: &mut Harness<'_, Studio>, text: &str) {
    harness.get_by_label_contains(text).click();
    harness.run_steps(3);
}

fn keys(harness: &mut Harness<'_, Studio>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(3);
}

/// Waits until all numbers belong to the lens as it is.
fn wait_for_numbers(harness: &mut Harness<'_, Studio>) {
    crate::window::settle(harness);
}

fn lens(harness: &Harness<'_, Studio>) -> Arc<Lens> {
    Arc::clone(harness.state().session().lens())
}

fn focal_length(lens: &Lens) -> f64 {
    let view = view_of(lens.clone());
    let analyses = view.results.as_ref().unwrap().analyses.as_ref().unwrap();
    analyses.first_order().efl.unwrap()
}

#[test]
fn a_new_lens_comes_from_the_dialog() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    press(&mut harness, "Nothing");
    press(&mut harness, "Create");
    let lens = lens(&harness);
    assert_eq!((lens.surfaces.len(), lens.fields.values.len()), (1, 3));
    assert_eq!(lens.aperture, Aperture::EntrancePupilDiameter(12.5));
    assert!(harness.query_by_label("Create").is_none(), "the dialog is closed");
    assert!(harness.state().session().view().messages.is_empty());
    assert_eq!(harness.state().session().view().history[0].title, "new lens");
}

/// The first element of a lens that was begun from nothing has the focal length that was asked for.
#[test]
fn the_first_element_is_proposed_with_the_focal_length_that_was_asked_for() {
    let asked = 35.0;
    let mut begun = starting(StartingForm::Empty);
    begun.surfaces[0].thickness = asked;
    let mut harness = window(begun);
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!((focal_length(&lens(&harness)) - asked).abs() < 1e-3 * asked);
}

/// Enter on a choice that is made already goes on, as on a number.
#[test]
fn enter_on_a_chosen_form_creates_the_lens() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    harness.get_by_label("Nothing").focus();
    harness.run_steps(2);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    harness.get_by_label("New lens");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(harness.query_by_label("New lens").is_none(), "the second Enter confirms");
    assert_eq!(lens(&harness).surfaces.len(), 1);
}

#[test]
fn an_impossible_new_lens_cannot_be_created() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    press(&mut harness, "at");
    harness.get_by_label("Object distance of the new lens").focus();
    harness.run_steps(2);
    harness.get_by_label("Object distance of the new lens").type_text("30");
    harness.run_steps(2);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    harness.get_by_label_contains("Object distance is");
    press(&mut harness, "Create");
    assert_eq!(*lens(&harness), double_gauss());
}

#[test]
fn an_element_is_added_with_a_preview_and_as_one_step() {
    let mut harness = window(starting(StartingForm::Empty));
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    assert!(harness.state().session().view().preview_lens.is_some(), "shown before it is added");
    press(&mut harness, "Apply");
    assert_eq!(lens(&harness).surfaces.len(), 3);
    assert!(harness.state().session().view().preview_lens.is_none());
    press(&mut harness, "Undo");
    assert_eq!(lens(&harness).surfaces.len(), 1);
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    press(&mut harness, "Cancel");
    assert!(harness.state().session().view().preview_lens.is_none());
    assert_eq!(lens(&harness).surfaces.len(), 1);
}

#[test]
fn the_element_menu_applies_to_the_selected_element() {
    let mut harness = window(achromat());
    harness.state_mut().session_mut().apply(Command::Select(Some(2)));
    harness.run_steps(2);
    press(&mut harness, "Element");
    press_item(&mut harness, "Split the element");
    let apart = apply_edit(&achromat(), &Edit::Element(ElementEdit::Split(2))).unwrap();
    assert_eq!(*lens(&harness), apart);
    keys(&mut harness, Modifiers::COMMAND, Key::J);
    assert_eq!(lens(&harness).surfaces.len(), 4, "cemented again by its key");
}

#[test]
fn the_palette_shows_an_open_panel_and_ranks_an_exact_title_first() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "prescription");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    harness.get_by_label("Radius of surface 1");
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "optimize");
    let top = |words| {
        let found = harness.get_all_by_label_contains(words).map(|node| node.rect().top());
        found.min_by(f32::total_cmp).unwrap()
    };
    assert!(top("Optimizer: Optimize") < top("View: Optimizer"));
}

/// A panel is found by what it shows.
#[test]
fn the_palette_finds_a_panel_by_its_contents() {
    let mut harness = window(double_gauss());
    for (words, panel) in [
        ("relative illumination", "View: Field curves"),
        ("encircled energy", "View: Wavefront"),
        ("multi-configuration", "View: Zoom positions"),
    ] {
        keys(&mut harness, Modifiers::COMMAND, Key::K);
        enter_text(&mut harness, "Find a command", words);
        let texts = painted_texts(&harness);
        assert!(texts.iter().any(|text| text == panel), "{panel} in {texts:?}");
        keys(&mut harness, Modifiers::NONE, Key::Escape);
    }
}

/// A palette that had found little keeps no small window.
#[test]
fn a_long_list_of_the_palette_is_shown_after_a_short_one() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "no such words");
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    let texts = painted_texts(&harness);
    let listed = texts.iter().filter(|text| text.starts_with("File: ")).count();
    assert!(listed > 10, "{listed} in {texts:?}");
}

#[test]
fn enter_closes_a_message() {
    let mut harness = window(double_gauss());
    let command = Command::Open(PathBuf::from("no such file.json"));
    let context = harness.ctx.clone();
    harness.state_mut().apply(&context, command);
    harness.run_steps(3);
    harness.get_by_label("OK");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(harness.query_by_label("OK").is_none());
}

/// A slow frame delivers the shortcut and the first letters together.
#[test]
fn letters_typed_at_once_after_the_shortcut_reach_the_palette() {
    let mut harness = window(double_gauss());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::K);
    harness.step();
    harness.input_mut().events.push(egui::Event::Text("undo".into()));
    harness.run_steps(3);
    assert_eq!(harness.get_by_label("Find a command").value().as_deref(), Some("undo"));
}

/// Letters that come while the field has no keyboard, for a frame, keep their place among the others.
#[test]
fn letters_of_the_palette_stay_in_order() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "defau");
    let field = harness.ctx.memory(egui::Memory::focused).unwrap();
    harness.ctx.memory_mut(|memory| memory.surrender_focus(field));
    for text in ["lt", " arr"] {
        harness.input_mut().events.push(egui::Event::Text(text.into()));
        harness.step();
    }
    assert_eq!(harness.get_by_label("Find a command").value().as_deref(), Some("default arr"));
}

#[test]
fn the_cursor_is_in_the_first_number_of_a_dialog() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    let mut named = harness.get_all_by_label("Focal length");
    assert!(named.any(|node| node.is_focused()), "that of the dialog, not of the panel");
    drop(named);
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    harness.get_by_label("New lens");
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("New lens").is_none());
}

/// What is typed into a dialog that has just been opened replaces its first number, and Enter confirms it.
#[test]
fn a_dialog_is_filled_in_and_confirmed_by_keys_alone() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    harness.input_mut().events.push(egui::Event::Text("35".into()));
    harness.run_steps(2);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(harness.query_by_label("New lens").is_none(), "Enter creates the lens");
    assert!((focal_length(&lens(&harness)) - 35.0).abs() < 1e-6);
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::F);
    harness.input_mut().events.push(egui::Event::Text("70".into()));
    harness.run_steps(2);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!((focal_length(&lens(&harness)) - 70.0).abs() < 1e-6);
}

/// Escape closes the list alone, and the next Tab goes on from the list.
#[test]
fn a_list_of_a_dialog_that_a_key_closes_keeps_the_cursor() {
    let mut harness = window(double_gauss());
    keys(&mut harness, Modifiers::COMMAND, Key::N);
    press(&mut harness, "Aperture of the new lens");
    harness.get_by_label("numerical aperture, image");
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("numerical aperture, image").is_none(), "the list is closed");
    harness.get_by_label("New lens");
    assert!(harness.get_by_label("Aperture of the new lens").is_focused());
    keys(&mut harness, Modifiers::NONE, Key::Tab);
    assert!(harness.get_by_label("Aperture value").is_focused());
}

/// The same in a dialog that leaves the window usable: it stays open.
#[test]
fn escape_in_a_list_leaves_the_dialog_of_an_element_open() {
    let mut harness = window(starting(StartingForm::Empty));
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    press(&mut harness, "Element form");
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("Cemented doublet").is_none(), "the list is closed");
    harness.get_by_label("Apply");
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("Apply").is_none());
}

/// A list of a panel is used by keys alone: what Enter chooses closes it, and Tab goes on from its button.
#[test]
fn a_key_that_chooses_from_a_list_closes_it() {
    let mut harness = panel(SystemPanel::default(), achromat());
    harness.get_by_label("Field kind").focus();
    harness.run_steps(2);
    harness.key_press(Key::Space);
    harness.run_steps(3);
    harness.get_by_label("Paraxial image height").focus();
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert!(!harness.state().commands.is_empty(), "it is chosen");
    assert!(harness.query_by_label("Paraxial image height").is_none(), "the list is closed");
    assert!(harness.get_by_label("Field kind").is_focused());
}

/// What a dialog would give is applied or left there, and not made the design behind its back.
#[test]
fn the_preview_of_a_dialog_is_accepted_in_the_dialog_alone() {
    let mut harness = window(starting(StartingForm::Empty));
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    let texts = painted_texts(&harness);
    assert!(texts.iter().any(|text| text.starts_with("Preview of the dialog")), "{texts:?}");
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "accept the candidate");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert_eq!(lens(&harness).surfaces.len(), 1, "nothing was added");
}

/// A preview that changes nothing yet is not taken for an old version.
#[test]
fn a_preview_without_a_change_is_called_the_design() {
    let mut harness = window(double_gauss());
    harness.state_mut().session_mut().apply(Command::Select(Some(2)));
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::M);
    let texts = painted_texts(&harness);
    assert!(texts.iter().any(|text| text.contains("the design itself")), "{texts:?}");
}

/// The whole lens at another size is seen before it is asked for, as a moved element is.
#[test]
fn scaling_is_shown_before_it_is_done() {
    let mut harness = window(achromat());
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::F);
    harness.input_mut().events.push(egui::Event::Text("70".into()));
    harness.run_steps(4);
    let shown = harness.state().session().view().preview_lens.unwrap();
    assert!((focal_length(&shown) - 70.0).abs() < 1e-6);
    assert_eq!(*lens(&harness), achromat());
}

/// At 800 points of height every panel and every setting of the menu is within the window.
#[test]
fn the_menu_of_views_fits_into_a_small_window() {
    let mut harness = window(achromat());
    press(&mut harness, "View");
    let is_inside = |node: egui_kittest::Node<'_>| {
        let rect = node.rect();
        rect.top() >= 0.0 && rect.bottom() <= 800.0
    };
    assert!(harness.get_all_by_label_contains("Layout").all(is_inside));
    assert!(harness.get_all_by_label_contains("Import report").all(is_inside));
    assert!(is_inside(harness.get_by_label("Default arrangement")));
    press_item(&mut harness, "Settings");
    assert!(is_inside(harness.get_by_label("51 rays of each field in the layout")));
}

/// A lens without a file is proposed beside the file that was used last, and one with a file beside it.
#[test]
fn saving_proposes_a_folder() {
    let path = std::env::temp_dir().join(format!("aplanat-{}-beside.json", std::process::id()));
    let save_as = Modifiers::COMMAND | Modifiers::SHIFT;
    let proposed = |harness: &mut Harness<'_, Studio>| {
        keys(harness, save_as, Key::S);
        let value = harness.get_by_label("Path").value().map(PathBuf::from);
        press(harness, "Cancel");
        value.unwrap()
    };
    let mut harness = window(achromat());
    assert!(proposed(&mut harness).is_absolute(), "it is said where the file would be");
    let save = Command::Save(Some(path.clone()));
    harness.state_mut().session_mut().apply(save);
    harness.run_steps(2);
    assert_eq!(proposed(&mut harness), path);
    harness.state_mut().session_mut().apply(Command::New(Box::new(double_gauss())));
    harness.run_steps(2);
    assert_eq!(proposed(&mut harness).parent(), path.parent());
    std::fs::remove_file(path).unwrap();
}

/// The first position of a zoom lens gives the focal length that the proposed merit function asks for.
#[test]
fn the_proposed_merit_function_follows_the_first_zoom_position() {
    let mut lens = zoom_lens();
    let last = lens.surfaces.len() - 1;
    let curvature = 0.5 * lens.surfaces[last].curvature;
    lens.zoom[1].set_number(last, Quantity::Curvature, curvature);
    let mut session = Session::new(lens, || {}).unwrap();
    let target = |session: &Session| {
        let goal = session.view().goal.unwrap();
        let found = goal.terms.iter().find_map(|weighted| match weighted.term {
            Term::FocalLength(target) => Some(target),
            _ => None,
        });
        found.unwrap()
    };
    let own = |session: &Session| focal_length(&session.view().lens);
    assert_close(target(&session), own(&session));
    session.apply(Edit::RemoveZoom(0).into());
    assert_close(target(&session), own(&session));
    assert!((own(&session) - 50.0).abs() > 0.1, "the positions differ");
    session.apply(Command::Undo);
    assert_close(target(&session), 50.0);
    session.apply(Edit::RemoveZoom(1).into());
    assert_close(target(&session), 50.0);
}

fn assert_close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9 * b.abs(), "{a} {b}");
}

/// A file that was saved under a new name, or named at the start, is a recent one.
#[test]
fn a_file_is_recent_however_it_became_that_of_the_design() {
    let path = std::env::temp_dir().join(format!("aplanat-{}-recent.json", std::process::id()));
    let mut harness = window(achromat());
    let command = Command::Save(Some(path.clone()));
    harness.state_mut().session_mut().apply(command);
    harness.run_steps(2);
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "recent.json");
    harness.get_by_label_contains("Recent file: ");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn the_palette_finds_an_item_as_it_lists_it() {
    let mut harness = window(achromat());
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "optimizer: optimize");
    harness.get_by_label_contains("Optimizer: Optimize");
}

#[test]
fn the_palette_finds_commands_panels_and_lenses_by_words() {
    let mut harness = window(achromat());
    for (words, found) in [
        ("zemax", "File: Export for Zemax…"),
        ("pareto view", "View: Pareto front"),
        ("triplet", "Lens: Triplet 100 mm f/2.7"),
        ("light theme", "Setting: Light theme"),
        ("focal scale", "Element: Scale to a focal length…"),
        ("vary curvatures", "Variables: Vary all curvatures"),
        ("stop optimization", "Optimizer: Stop the optimization"),
        ("start front", "Front: Start a Pareto front with default settings"),
        ("start search", "Search: Start a search with default settings"),
        ("discard candidate", "Candidate: Discard the candidate"),
        ("watch search", "Search: Watch the search in the whole window"),
        ("task luneburg-radial", "Gradient index: Open the task luneburg-radial"),
        ("hold focal", "Setting: Hold the focal length in drags"),
        ("effect never aim", "Setting: Effect"),
        ("add term track", "Merit function: Add a term: Total track"),
    ] {
        keys(&mut harness, Modifiers::COMMAND, Key::K);
        harness.get_by_label("Find a command").type_text(words);
        harness.run_steps(3);
        harness.get_by_label_contains(found);
        keys(&mut harness, Modifiers::NONE, Key::Escape);
        assert!(harness.query_by_label("Find a command").is_none());
    }
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    harness.get_by_label("Find a command").type_text("triplet");
    harness.run_steps(2);
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert_eq!(lens(&harness).surfaces.len(), 7, "Enter opens it");
}

#[test]
fn help_has_a_manual_and_the_shortcuts() {
    let mut harness = window(achromat());
    keys(&mut harness, Modifiers::NONE, Key::F1);
    enter_text(&mut harness, "Search the manual", "cemented");
    assert!(harness.query_by_label("Files").is_none(), "only the pages with the word are listed");
    harness.get_by_label_contains("all curvatures change together");
    press(&mut harness, "Help");
    press_item(&mut harness, "Keyboard shortcuts");
    harness.get_by_label("Ctrl+K");
}

fn panel<P: Panel + 'static>(panel: P, lens: Lens) -> Harness<'static, PanelState<P>> {
    let mut harness = panel_harness(panel, view_of(lens));
    harness.run_steps(3);
    harness
}

fn type_into<P: Panel>(harness: &mut Harness<'_, PanelState<P>>, field: &str, text: &str) {
    harness.get_by_label(field).focus();
    harness.run_steps(2);
    harness.get_by_label(field).type_text(text);
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(2);
}

fn click<P: Panel>(harness: &mut Harness<'_, PanelState<P>>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(3);
}

/// The lens after all edits that a panel asked for.
fn edited<P>(harness: &Harness<'_, PanelState<P>>) -> Lens {
    let state = harness.state();
    let mut lens = Lens::clone(&state.view.lens);
    for command in &state.commands {
        if let Command::Edit(edit) = command {
            lens = apply_edit(&lens, edit).unwrap();
        }
    }
    lens
}

#[test]
fn the_system_panel_edits_aperture_fields_and_wavelengths() {
    let mut harness = panel(SystemPanel::default(), achromat());
    type_into(&mut harness, "Aperture value", "*2");
    type_into(&mut harness, "Field 3 y", "12");
    assert_eq!(edited(&harness).aperture, Aperture::FNumber(8.0));
    assert_eq!(edited(&harness).fields.values[2].y, 12.0);

    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "Delete field 2");
    assert_eq!(edited(&harness).fields.values.len(), 2);

    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "Primary wavelength 3");
    assert_eq!(edited(&harness).primary(), 2);

    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "Delete wavelength 2");
    assert_eq!(edited(&harness).wavelengths.len(), 2);
    assert_eq!(edited(&harness).wavelengths.iter().filter(|w| w.primary).count(), 1);
}

/// A note that is cut in one line is not read.
#[test]
fn long_notes_are_read_in_full() {
    let notes = "Scaled from a patent; the rims are guesses from its drawing. ".repeat(3);
    let harness = panel(SystemPanel::default(), Lens { notes: notes.clone(), ..achromat() });
    let painted = painted_galleys(&harness);
    let shown = painted.iter().find(|galley| galley.text() == notes).expect("the notes are shown");
    assert!(shown.rows.len() > 1, "{} row", shown.rows.len());
    let width = harness.get_by_label("Notes of the lens").rect().width();
    assert!(shown.rect.width() <= width, "{} in {width}", shown.rect.width());
}

#[test]
fn another_kind_of_aperture_keeps_the_beam() {
    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "Aperture kind");
    click(&mut harness, "Entrance pupil diameter");
    let Aperture::EntrancePupilDiameter(diameter) = edited(&harness).aperture else {
        panic!("{:?}", edited(&harness).aperture)
    };
    assert!((diameter - 12.5).abs() < 1e-9, "{diameter}");
}

#[test]
fn another_kind_of_field_keeps_the_directions() {
    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "Field kind");
    click(&mut harness, "Paraxial image height");
    let fields = edited(&harness).fields;
    assert_eq!(fields.kind, FieldKind::ImageHeight);
    assert!((fields.values[2].y - 50.0 * 10_f64.to_radians().tan()).abs() < 1e-9);
}

#[test]
fn the_object_comes_near_and_goes_far_again() {
    let mut harness = panel(SystemPanel::default(), achromat());
    click(&mut harness, "At");
    assert_eq!(edited(&harness).object, Object::Finite(500.0));
    let near = edited(&harness);
    let mut harness = panel(SystemPanel::default(), near);
    click(&mut harness, "At infinity");
    assert_eq!(edited(&harness).object, Object::Infinity);
}

#[test]
fn a_refused_number_stays_in_its_field_with_the_reason() {
    let mut harness = panel(SystemPanel::default(), achromat());
    type_into(&mut harness, "Aperture value", "0");
    assert!(harness.state().commands.is_empty());
    assert_eq!(harness.get_by_label("Aperture value").value().as_deref(), Some("0"));
    harness.get_by_label_contains("F-number is 0; expected");
}

fn zoom_lens() -> Lens {
    let mut lens = achromat();
    lens.zoom = vec![ZoomPosition::default(), ZoomPosition::default()];
    lens
}

#[test]
fn zoom_positions_are_added_varied_and_edited() {
    let mut harness = panel(ZoomPanel::default(), achromat());
    click(&mut harness, "Add position");
    assert_eq!(edited(&harness).zoom.len(), 1);

    let mut harness = panel(ZoomPanel::default(), zoom_lens());
    click(&mut harness, "Vary");
    click(&mut harness, "Aperture");
    let varied = edited(&harness);
    assert!(varied.zoom.iter().all(|position| position.aperture == Some(varied.aperture)));

    let mut harness = panel(ZoomPanel::default(), varied);
    type_into(&mut harness, "Aperture of position 2", "8");
    type_into(&mut harness, "Name of position 1", "Wide");
    let lens = edited(&harness);
    assert_eq!(lens.aperture_at(1), Aperture::FNumber(8.0));
    assert_eq!(lens.zoom[0].name, "Wide");
    click(&mut harness, "Do not vary the aperture");
    assert!(edited(&harness).zoom.iter().all(|position| position.aperture.is_none()));
}

#[test]
fn any_number_of_a_surface_can_differ_between_positions() {
    let mut harness = panel(ZoomPanel::default(), zoom_lens());
    click(&mut harness, "Vary");
    click(&mut harness, "Radius");
    click(&mut harness, "Radius of surface 2");
    let varied = edited(&harness);
    let curvature = varied.surfaces[1].curvature;
    assert_eq!(varied.zoom[1].number(1, Quantity::Curvature), Some(curvature));

    let mut harness = panel(ZoomPanel::default(), varied);
    type_into(&mut harness, "Radius of surface 2 at position 2", "-50");
    let lens = edited(&harness);
    assert_eq!(lens.zoom[1].number(1, Quantity::Curvature), Some(-0.02));
    assert_eq!(lens.zoom[0].number(1, Quantity::Curvature), Some(curvature));
    click(&mut harness, "Do not vary the radius of surface 2");
    let same = edited(&harness);
    assert!(same.zoom.iter().all(|position| position.numbers.is_empty()));
}

/// A list of all numbers would end below the window; and what is varied is named in the undo step.
#[test]
fn every_number_that_can_vary_is_within_the_window() {
    let mut lens = double_gauss();
    lens.zoom = vec![ZoomPosition::default(), ZoomPosition::default()];
    let mut harness = panel(ZoomPanel::default(), lens);
    click(&mut harness, "Vary");
    click(&mut harness, "Other number of a surface");
    click(&mut harness, "Surface 11");
    let item = harness.get_by_label("Conic constant of surface 11").rect();
    assert!(item.bottom() <= 620.0, "{item:?}");
    click(&mut harness, "Conic constant of surface 11");
    assert_eq!(edited(&harness).zoom[1].number(10, Quantity::Conic), Some(0.0));
    let Some(Command::Edit(edit)) = harness.state().commands.last() else { panic!("no edit") };
    assert_eq!(edit.title(), "vary the conic constant of surface 11 between the zoom positions");
}

#[test]
fn equal_area_fields_reach_a_typed_largest_one() {
    let mut lens = achromat();
    lens.fields = Fields::equal_area(FieldKind::Angle, 0.0, 1);
    let mut harness = panel(SystemPanel::default(), lens);
    type_into(&mut harness, "Largest equal-area field", "20");
    click(&mut harness, "equal-area steps");
    assert_eq!(edited(&harness).fields, Fields::equal_area(FieldKind::Angle, 20.0, 3));
}

#[test]
fn playing_goes_through_the_positions() {
    let mut harness = panel(ZoomPanel::default(), zoom_lens());
    click(&mut harness, "Play");
    harness.run_steps(40);
    let shown = |command: &Command| matches!(command, Command::ShowZoom(1));
    assert!(harness.state().commands.iter().any(shown), "{:?}", harness.state().commands);
    click(&mut harness, "Stop");
}

#[test]
fn a_table_row_has_the_menu_of_its_element() {
    let mut harness = panel(PrescriptionPanel::default(), achromat());
    harness.get_by_label("Row of surface 2").click_secondary();
    harness.run_steps(3);
    click(&mut harness, "Element");
    harness.get_by_label_contains("Remove the element").click();
    harness.run_steps(3);
    assert_eq!(edited(&harness).surfaces.len(), 1);
}

#[test]
fn an_empty_lens_shows_no_error_in_any_panel() {
    let view: SessionView = view_of(starting(StartingForm::Empty));
    let results = view.results.as_ref().unwrap();
    assert!(results.analyses.is_ok(), "{:?}", results.analyses.as_ref().err());
    let mut harness = panel_harness(FirstOrderPanel, view);
    harness.run_steps(3);
    harness.get_by_label_contains("There is no glass yet. Add an element");
}

/// A file that is dropped on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &std::path::Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|why| why.to_string())
    }
}

fn drop_file(harness: &mut Harness<'_, Studio>, path: PathBuf) {
    harness.input_mut().dropped_files.push(Arc::new(Dropped(path)));
    harness.run_steps(3);
}

#[test]
fn a_dropped_lens_is_opened_and_remembered_and_another_file_refused_by_name() {
    let folder = std::env::temp_dir().join(format!("aplanat-drop-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("achromat.json");
    aplanat::files::save(&achromat(), &path).unwrap();
    let mut harness = window(double_gauss());
    drop_file(&mut harness, path.clone());
    assert_eq!(*lens(&harness), achromat());
    press(&mut harness, "File");
    press(&mut harness, "Recent files");
    harness.get_by_label(&path.display().to_string());
    keys(&mut harness, Modifiers::NONE, Key::Escape);

    let other = folder.join("picture.png");
    std::fs::write(&other, b"no picture").unwrap();
    drop_file(&mut harness, other);
    assert!(harness.query_all_by_label_contains("picture.png").next().is_some());
    press(&mut harness, "OK");
    let text = folder.join("letter.txt");
    std::fs::write(&text, b"dear").unwrap();
    drop_file(&mut harness, text);
    harness.get_by_label_contains("`letter.txt` is none of the files");
    press(&mut harness, "OK");
    // Of many files at once, each that is refused is named.
    for name in ["letter.txt", "picture.png", "achromat.json"] {
        harness.input_mut().dropped_files.push(Arc::new(Dropped(folder.join(name))));
    }
    harness.run_steps(3);
    for name in ["`letter.txt` is none of the files", "picture.png"] {
        assert!(harness.query_all_by_label_contains(name).next().is_some(), "{name}");
    }
    press(&mut harness, "OK");
    let glasses = folder.join("glasses.agf");
    std::fs::write(&glasses, b"no glass").unwrap();
    drop_file(&mut harness, glasses);
    let mut said = harness.query_all_by_label_contains("expected a glass catalogue .agf");
    assert!(said.next().is_some());
    std::fs::remove_dir_all(folder).unwrap();
}

/// What was opened is seen, whatever tab was in front.
#[test]
fn a_dropped_lens_brings_the_layout_forward() {
    let path = std::env::temp_dir().join(format!("aplanat-forward-{}.json", std::process::id()));
    aplanat::files::save(&achromat(), &path).unwrap();
    let mut harness = window(double_gauss());
    press(&mut harness, "GRIN slice");
    assert!(harness.query_by_label_contains("Section of ").is_none());
    drop_file(&mut harness, path.clone());
    wait_for_numbers(&mut harness);
    harness.get_by_label_contains("Section of ");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_dropped_picture_is_the_scene_of_the_panel_picture() {
    let path = std::env::temp_dir().join(format!("aplanat-scene-{}.png", std::process::id()));
    image::RgbImage::from_pixel(24, 16, image::Rgb([200, 90, 30])).save(&path).unwrap();
    let mut harness = window(achromat());
    drop_file(&mut harness, path.clone());
    wait_for_numbers(&mut harness);
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    harness.get_by_label(&format!("Picture of {name} through the lens"));
    let results = harness.state().session().results().unwrap();
    let picture = results.analyses.as_ref().unwrap().picture.clone().unwrap();
    let picture = &picture.value.as_ref().unwrap().picture;
    let [red, _, blue] = picture.values[picture.values.len() / 2 + picture.frame.pixels[0] / 2];
    assert!(red > 2.0 * blue, "the colours are those of the file: {red} {blue}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn the_palette_says_why_a_command_is_not_possible() {
    let mut harness = window(double_gauss());
    for (words, why) in [
        ("stop the search", "No search is running."),
        ("reverse the element", "Select a surface of an element first"),
        ("accept the candidate", "There is no candidate"),
    ] {
        keys(&mut harness, Modifiers::COMMAND, Key::K);
        enter_text(&mut harness, "Find a command", words);
        keys(&mut harness, Modifiers::NONE, Key::Enter);
        harness.get_by_label_contains(why);
        keys(&mut harness, Modifiers::NONE, Key::Escape);
        assert!(harness.query_by_label("Find a command").is_none());
    }
}

#[test]
fn a_run_that_is_asked_for_by_words_is_seen() {
    let mut harness = window(double_gauss());
    wait_for_numbers(&mut harness);
    let is_seen = |harness: &Harness<'_, Studio>| harness.query_by_label("Export…").is_some();
    assert!(!is_seen(&harness));
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "start a pareto front");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(is_seen(&harness), "the panel Pareto front");
    harness.state_mut().session_mut().apply(Command::ClearPareto);
}

#[test]
fn a_key_goes_from_panel_to_panel() {
    let mut harness = window(double_gauss());
    wait_for_numbers(&mut harness);
    keys(&mut harness, Modifiers::NONE, Key::F6);
    assert!(harness.get_by_label("Radius of surface 1").is_focused(), "behind the layout");
    keys(&mut harness, Modifiers::SHIFT, Key::F6);
    harness.run_steps(4);
    assert!(harness.get_by_label("Fit").is_focused());
    keys(&mut harness, Modifiers::SHIFT, Key::F6);
    harness.run_steps(4);
    let focused = harness.ctx.memory(egui::Memory::focused);
    assert!(focused.is_some() && !harness.get_by_label("Fit").is_focused());
}

#[test]
fn the_library_is_found_by_type_and_range_and_opens_a_scaled_lens() {
    let mut harness = window(achromat());
    keys(&mut harness, Modifiers::COMMAND, Key::L);
    let all = aplanat::files::library_lenses();
    harness.get_by_label(&format!("{0} of {0} lenses", all.len()));
    enter_text(&mut harness, "Search the library", "tessar");
    enter_text(&mut harness, "Elements range", "..4");
    let query = aplanat::files::LibraryQuery::new(["tessar", "elements=..4"]).unwrap();
    let found = query.find();
    harness.get_by_label(&format!("{} of {} lenses", found.len(), all.len()));
    press(&mut harness, &found[0].title);
    press(&mut harness, "scaled to the focal length");
    press(&mut harness, "Open");
    let opened = lens(&harness);
    assert!(opened.notes.contains("to a focal length of 50 mm"), "{}", opened.notes);
    assert!(harness.query_by_label("Search the library").is_none(), "the browser is closed");
}

#[test]
fn a_range_that_cannot_be_meant_is_said() {
    let mut harness = window(achromat());
    keys(&mut harness, Modifiers::COMMAND, Key::L);
    enter_text(&mut harness, "Focal length range", "long");
    harness.get_by_label_contains("found the range `long`; expected");
}

#[test]
fn escape_closes_the_dialogs_that_leave_the_window_usable() {
    let mut harness = window(starting(StartingForm::Empty));
    keys(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    keys(&mut harness, Modifiers::COMMAND, Key::L);
    assert!(harness.query_by_label("Search the library").is_some());
    keys(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("Search the library").is_none());
    assert!(harness.query_by_label("Apply").is_none());
    assert!(harness.state().session().view().preview_lens.is_none(), "the design is shown again");
}

/// The focal length of the whole lens stays when one of its lenses becomes two.
#[test]
fn splitting_a_lens_keeps_the_focal_length_of_the_whole() {
    let lens = double_gauss();
    let split = apply_edit(&lens, &Edit::Element(ElementEdit::Split(0))).unwrap();
    assert_eq!(split.surfaces.len(), lens.surfaces.len() + 2);
    let [before, after] = [&lens, &split].map(focal_length);
    assert!((after / before - 1.0).abs() < 1e-10, "{before} {after}");
}

/// Elements on both sides of a stop that stands alone are not cemented, and the message says why.
#[test]
fn cementing_across_the_stop_names_the_stop() {
    let lens = double_gauss();
    let stop = lens.stop().unwrap();
    assert!(lens.element_around(stop).is_none(), "it stands alone");
    let refused = apply_edit(&lens, &Edit::Element(ElementEdit::Cement(stop - 1))).unwrap_err();
    let text = refused.to_string();
    assert!(text.starts_with(&format!("surface {}, the stop, stands between", stop + 1)), "{text}");
}

/// The coordinates of a field fit into their cells, and notes of two lines are two lines.
#[test]
fn the_system_shows_whole_coordinates_and_lines() {
    let mut lens = double_gauss();
    lens.fields.values[1].y = -7.071_068;
    lens.notes = "first line\nsecond line".to_owned();
    let mut harness = panel_harness(SystemPanel::default(), view_of(lens));
    harness.run();
    let cell = harness.get_by_label("Field 2 y");
    let galleys = painted_galleys(&harness);
    let number = galleys.iter().find(|galley| galley.text() == "-7.071068").unwrap();
    // The frame of a field has a margin of four points on each side.
    assert!(number.size().x + 8.0 <= cell.rect().width(), "{:?}", cell.rect());
    let notes = galleys.iter().find(|galley| galley.text().starts_with("first line")).unwrap();
    assert_eq!(notes.rows.len(), 2);
}

#[test]
fn a_lens_from_a_specification_is_found_in_the_menu_and_in_the_palette() {
    let mut harness = window(double_gauss());
    press(&mut harness, "File");
    press_item(&mut harness, "New from specification…");
    harness.get_by_label("Design a lens");
    press(&mut harness, "Layout");
    assert!(harness.query_by_label("Design a lens").is_none());
    keys(&mut harness, Modifiers::COMMAND, Key::K);
    enter_text(&mut harness, "Find a command", "new from specification");
    keys(&mut harness, Modifiers::NONE, Key::Enter);
    harness.get_by_label("Design a lens");
}
