//! The whole window on a real session, without a display: a typed value reaches every panel.

use std::time::Duration;

use aplanat::experiments::{self, Effort, Experiment};
use aplanat::lens::{Edit, Parameter, Quantity};
use aplanat::paraxial::{DragSettings, FirstOrderLock};
use aplanat::session::{Command, ExperimentStatus, Session};
use aplanat::studio::Studio;
use aplanat::studio::draw::RenderBackend;
use aplanat::studio::panels::LayoutPanel;
use aplanat::studio::theme;
use aplanat::studio::window::Persistence;
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{double_gauss, sized_harness, view_of};

/// The maximum time of an analysis on a slow and busy machine.
const DEADLINE: Duration = Duration::from_mins(1);
const PAUSE: Duration = Duration::from_millis(5);

pub(super) fn window() -> Harness<'static, Studio> {
    let session = Session::new(double_gauss(), || {}).unwrap();
    let studio = Studio::new(session, RenderBackend::Software, Persistence::Disabled, None);
    let builder = Harness::builder().with_size([1280.0, 800.0]).with_context_setup(theme::apply);
    let mut harness = builder.build_ui_state(|ui, studio: &mut Studio| studio.ui(ui), studio);
    settle(&mut harness);
    harness
}

/// Goes on until something is so.
fn wait(harness: &mut Harness<'_, Studio>, what: &str, so: impl Fn(&Harness<'_, Studio>) -> bool) {
    let mut left = DEADLINE;
    loop {
        harness.step();
        if so(harness) {
            return;
        }
        left = left.checked_sub(PAUSE).unwrap_or_else(|| panic!("{what} never happened"));
        std::thread::sleep(PAUSE);
    }
}

/// Waits until all numbers belong to the lens as it is.
pub(super) fn settle(harness: &mut Harness<'_, Studio>) {
    wait(harness, "fresh numbers", |harness| harness.state().session().view().is_current());
    harness.run_steps(3);
}

fn spots(harness: &Harness<'_, Studio>) -> Vec<String> {
    harness.get_all_by_label_contains("RMS ").map(|node| node.value().unwrap()).collect()
}

fn type_radius(harness: &mut Harness<'_, Studio>, text: &str) {
    harness.get_by_label("Radius of surface 1").focus();
    harness.run_steps(2);
    harness.get_by_label("Radius of surface 1").type_text(text);
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    settle(harness);
}

/// Where each frame takes a second, as without a graphics card on a busy machine, a button goes down in one
/// and up in a later one.
#[test]
fn a_click_counts_on_a_slow_machine() {
    let builder = Harness::builder().with_step_dt(1.5).with_context_setup(theme::apply);
    let mut clicks = builder.build_ui_state(
        |ui, clicks: &mut usize| *clicks += usize::from(ui.button("Accept").clicked()),
        0,
    );
    let pos = clicks.get_by_label("Accept").rect().center();
    clicks.event(egui::Event::PointerMoved(pos));
    clicks.step();
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, Modifiers::NONE);
        clicks.event(egui::Event::PointerButton { pos, button, pressed, modifiers });
        clicks.step();
    }
    assert_eq!(*clicks.state(), 1);
}

#[test]
fn a_typed_radius_reaches_every_panel_and_undo_takes_it_back() {
    let mut harness = window();
    let before = (harness.state().session().view().version, spots(&harness));
    assert_eq!(before.1.len(), 3);
    harness.get_by_label("49.389 mm");

    type_radius(&mut harness, "14.5");
    assert!(harness.state().session().view().version > before.0);
    assert_ne!(spots(&harness), before.1);
    assert!(harness.query_by_label("49.389 mm").is_none(), "first-order data follow");
    assert!(harness.state().session().is_dirty());

    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    settle(&mut harness);
    let value = harness.get_by_label("Radius of surface 1").value();
    assert_eq!(value.as_deref(), Some("14.1615"));
    harness.get_by_label("49.389 mm");
    assert_eq!(radii(&spots(&harness)), radii(&before.1));
    assert!(!harness.state().session().is_dirty());
}

/// The radii without their errors, which may differ in their last digits.
fn radii(spots: &[String]) -> Vec<&str> {
    spots.iter().map(|text| text.split('±').next().unwrap_or_default()).collect()
}

/// The words about a field without rays end where the controls at the right begin.
#[test]
fn a_field_without_rays_does_not_cover_the_controls_of_the_layout() {
    let mut lens = double_gauss();
    lens.surfaces[0].curvature = 0.1509;
    let mut harness =
        sized_harness(LayoutPanel::new(RenderBackend::Software), view_of(lens), [600.0, 400.0]);
    harness.run_steps(3);
    let words = harness.get_by_label_contains("no ray of this field").rect();
    let controls = harness.get_by_label("Rays of each field").rect();
    assert!(words.width() > 50.0 && words.right() <= controls.left(), "{words:?} {controls:?}");
}

/// A question that waits for an answer keeps the keys of the menus from the window behind it.
#[test]
fn shortcuts_do_nothing_behind_a_question() {
    let mut harness = window();
    type_radius(&mut harness, "*1.1");
    let changed = harness.state().session().lens().surfaces[0].curvature;
    harness.key_press_modifiers(Modifiers::COMMAND, Key::N);
    harness.run_steps(3);
    harness.get_by_label("Create").click();
    harness.run_steps(3);
    harness.get_by_label("Save the changes first?");
    for key in [Key::Z, Key::N, Key::K] {
        harness.key_press_modifiers(Modifiers::COMMAND, key);
        harness.run_steps(3);
    }
    assert_eq!(harness.state().session().lens().surfaces[0].curvature, changed);
    assert!(harness.query_by_label("Create").is_none());
    assert!(harness.query_by_label("Find a command").is_none());
    harness.get_by_label("Cancel").click();
    harness.run_steps(3);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_ne!(harness.state().session().lens().surfaces[0].curvature, changed);
}

#[test]
fn keys_undo_and_redo() {
    let mut harness = window();
    type_radius(&mut harness, "*1.1");
    let changed = harness.state().session().lens().surfaces[0].curvature;
    for (keys, key, undone) in [
        (Modifiers::COMMAND, Key::Z, true),
        (Modifiers::COMMAND | Modifiers::SHIFT, Key::Z, false),
        (Modifiers::COMMAND, Key::Z, true),
        (Modifiers::COMMAND, Key::Y, false),
    ] {
        harness.key_press_modifiers(keys, key);
        harness.run_steps(3);
        let now = harness.state().session().lens().surfaces[0].curvature;
        assert_eq!(now != changed, undone);
    }
}

#[test]
fn a_refused_entry_does_not_block_undo() {
    let mut harness = window();
    type_radius(&mut harness, "*1.1");
    type_radius(&mut harness, "abc");
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    harness.get_by_label("Thickness of surface 1").focus();
    harness.run_steps(2);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
}

#[test]
fn unsaved_changes_are_not_discarded_without_confirmation() {
    let mut harness = window();
    type_radius(&mut harness, "15");
    let lens = harness.state().session().lens().clone();
    let create = |harness: &mut Harness<'_, Studio>| {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::N);
        harness.run_steps(3);
        harness.get_by_label("Create").click();
        harness.run_steps(3);
    };
    create(&mut harness);
    assert_eq!(*harness.state().session().lens(), lens, "the lens is still there");
    harness.get_by_label("Cancel").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Save the changes first?").is_none());
    create(&mut harness);
    harness.get_by_label("Don't save").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session().lens().name, "Achromat 50 mm f/4");
}

#[test]
fn an_optimization_changes_the_preview_and_is_accepted_as_one_step() {
    let mut harness = window();
    let before = spots(&harness);
    harness.get_by_label("Optimize").click();
    harness.run_steps(3);
    wait(&mut harness, "a better spot", |harness| {
        let view = harness.state().session().view();
        let steps =
            view.optimization.snapshot.and_then(|search| search.progress.as_ref().map(|p| p.step));
        view.preview_results.is_some() && steps.unwrap_or(0) > 3
    });
    harness.get_by_label("Stop").click();
    wait(&mut harness, "the end", |harness| {
        harness.query_by_label("Stopped").is_some() || harness.query_by_label("Finished").is_some()
    });
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss(), "not taken yet");
    harness.get_all_by_label("Accept").last().unwrap().click();
    harness.run_steps(3);
    settle(&mut harness);
    assert_ne!(radii(&spots(&harness)), radii(&before));
    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    settle(&mut harness);
    assert_eq!(radii(&spots(&harness)), radii(&before));
}

#[test]
fn a_structure_search_shows_lenses_and_one_is_accepted_as_one_step() {
    let mut harness = window();
    harness.get_by_label("Search").click();
    harness.run_steps(3);
    let button = harness.get_all_by_label("Search").last().unwrap();
    button.click();
    wait(&mut harness, "a card", |harness| {
        let cards = harness.query_all_by_label_contains(" elements, ");
        let moves = harness.state().session().view().structure_search.run.snapshot;
        cards.count() > 0 && moves.is_some_and(|run| run.statistics.moves > 8)
    });
    // A search is followed unless a person looks away.
    wait(&mut harness, "the lens of the chain", |harness| {
        harness.state().session().view().preview_results.is_some()
    });
    assert!(!harness.state().session().is_dirty());
    harness.get_by_label("Stop").click();
    wait(&mut harness, "the end", |harness| {
        harness.query_by_label_contains("Stopped, merit").is_some()
    });
    let card = harness.get_all_by_label_contains(" elements, ").next().unwrap();
    card.click_accesskit();
    harness.run_steps(3);
    harness.get_all_by_label("Accept").last().unwrap().click();
    harness.run_steps(3);
    settle(&mut harness);
    assert!(harness.state().session().is_dirty());
    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    assert_eq!(*harness.state().session().lens().as_ref(), double_gauss());
}

#[test]
fn bundled_lenses_open_from_the_menu() {
    let mut harness = window();
    harness.get_by_label("File").click();
    harness.run_steps(3);
    harness.get_by_label("Bundled lenses").click();
    harness.run_steps(3);
    harness.get_by_label("Triplet 100 mm f/2.7").click();
    harness.run_steps(3);
    settle(&mut harness);
    assert_eq!(harness.state().session().lens().surfaces.len(), 7);
}

#[test]
fn pupils_are_computed_while_they_are_shown_and_follow_an_edit() {
    let mut harness = window();
    let pupils = |harness: &Harness<'_, Studio>| {
        let results = harness.state().session().results().unwrap();
        results.analyses.as_ref().unwrap().pupils.is_some()
    };
    assert!(!pupils(&harness), "what is not shown is not computed");
    harness.get_by_label("Pupil").click();
    harness.run_steps(3);
    settle(&mut harness);
    assert!(pupils(&harness));
    harness.get_by_label_contains("94.61 mm²");
    type_radius(&mut harness, "14.5");
    assert!(harness.query_by_label_contains("94.61 mm²").is_none(), "the pupil follows");
    harness.get_by_label("Rim of surface 11").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session().view().selected, Some(10));
    harness.get_by_label("Spot diagram").click();
    harness.run_steps(3);
    settle(&mut harness);
    assert!(!pupils(&harness));
}

#[test]
fn a_scene_is_seen_through_the_lens_while_its_panel_is_shown() {
    let mut harness = window();
    let picture = |harness: &Harness<'_, Studio>| {
        let results = harness.state().session().results().unwrap();
        results.analyses.as_ref().unwrap().picture.clone()
    };
    assert!(picture(&harness).is_none(), "what is not shown is not computed");
    harness.get_by_label("Picture").click();
    harness.run_steps(3);
    settle(&mut harness);
    harness.get_by_label("Picture of star through the lens");
    let shown = picture(&harness).unwrap();
    let found = shown.value.as_ref().unwrap();
    assert!(found.picture.values.iter().flatten().any(|value| *value > 0.5 * found.picture.white));
    assert!(found.picture.values.iter().flatten().all(|value| value.is_finite()));
    let path = std::env::temp_dir().join(format!("aplanat-{}-panel.png", std::process::id()));
    let save = Command::SavePicture(path.clone());
    harness.state_mut().session_mut().apply(save);
    harness.run_steps(3);
    let image = image::open(&path).unwrap();
    assert!(image.width() >= 96 && image.height() >= 64);
    assert_eq!(image.color(), image::ColorType::Rgb16, "16 bits for a colour of a pixel");
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn an_experiment_runs_from_the_menu_and_shows_its_claims_and_pictures() {
    let mut harness = window();
    let by_time = |a: &&Experiment, b: &&Experiment| a.seconds.total_cmp(&b.seconds);
    let study = experiments::ALL.iter().min_by(by_time).unwrap();
    harness.get_by_label("Help").click();
    harness.run_steps(3);
    harness.get_by_label("Studies of the thesis").click();
    harness.run_steps(3);
    for study in experiments::ALL {
        harness.get_by_label_contains(study.title);
    }
    harness.get_by_label_contains(study.title).click();
    harness.run_steps(3);
    harness.get_by_label("Cancel").click();
    wait(&mut harness, "the end", |harness| {
        harness.query_by_label("Stopped before it had a result.").is_some()
    });
    let effort = Effort::Small;
    harness
        .state_mut()
        .session_mut()
        .apply(Command::StartExperiment { id: study.id.into(), effort });
    wait(&mut harness, "the outcome", |harness| {
        harness.query_by_label_contains("claims hold").is_some()
    });
    harness.run_steps(3);
    let count = harness.get_all_by_label("holds").count();
    let view = harness.state().session().view();
    let Some(ExperimentStatus::Done(report)) =
        view.experiment.as_deref().map(|trial| trial.status.clone())
    else {
        panic!("{:?}", view.experiment);
    };
    assert_eq!(count, report.outcome.claims.len());
    let pictures = harness.get_all_by_label_contains("of the experiment").count();
    assert_eq!(pictures, report.outcome.pictures.len());
}

#[test]
fn an_idle_window_does_not_repaint() {
    let mut harness = window();
    harness.get_by_label("Radius of surface 1").focus();
    harness.run();
    let next = harness.output().viewport_output.values().next().unwrap().repaint_delay;
    assert_eq!(next, Duration::MAX, "a text cursor does not blink");
}

#[test]
fn a_field_is_analysed_only_while_its_panel_is_shown() {
    let mut harness = window();
    let forming = |harness: &Harness<'_, Studio>| harness.state().session().view().grin;
    assert!(!forming(&harness).is_active && forming(&harness).run.snapshot.is_none());
    harness.get_by_label("GRIN slice").click();
    harness.run_steps(3);
    assert!(forming(&harness).is_active);
    harness.get_by_label("Luneburg lens as a function of the radius").click();
    wait(&mut harness, "a slice", |harness| forming(harness).slice.is_some());
    harness.run_steps(2);
    harness.get_by_label_contains("Slice of Luneburg");
    harness.get_by_label("Layout").click();
    harness.run_steps(3);
    assert!(
        !forming(&harness).is_active && forming(&harness).run.snapshot.is_some(),
        "it stays open"
    );
}

#[test]
fn a_panel_can_have_the_window_and_a_search_can_be_watched() {
    let mut harness = window();
    let width =
        |harness: &Harness<'_, Studio>| harness.get_by_label_contains("Section of ").rect().width();
    let among_others = width(&harness);
    harness.get_by_label("Maximize Layout").click();
    harness.run_steps(3);
    assert!(width(&harness) > 1.3 * among_others);
    assert!(harness.query_by_label("Radius of surface 1").is_none());
    harness.key_press(Key::F11);
    harness.run_steps(3);
    harness.get_by_label("Radius of surface 1");
    assert!((width(&harness) - among_others).abs() < 1.0);
    harness.get_by_label("Pupil").click();
    harness.run_steps(3);
    harness.key_press(Key::F11);
    harness.run_steps(3);
    settle(&mut harness);
    harness.get_by_label("Show all panels");
    harness.get_by_label_contains("Pupil of field 1");
    harness.get_by_label("View").click();
    harness.run_steps(3);
    harness.get_by_label("Arrangement for a search").click();
    harness.run_steps(3);
    harness.get_by_label("Paraxial projection");
    harness.get_by_label("Radius of surface 1");
    harness.get_by_label("Spots");
}

/// The double Gauss with a larger gap.
fn candidate() -> aplanat::lens::Lens {
    let mut lens = double_gauss();
    lens.surfaces[1].thickness += 0.4;
    lens
}

/// A candidate is shown without moving anything that a person may be about to click.
#[test]
fn a_candidate_moves_no_row() {
    let mut harness = window();
    let rows = |harness: &Harness<'_, Studio>| {
        ["Row of surface 1", "Row of surface 5", "Section of Double Gauss", "Undo"]
            .map(|name| harness.get_all_by_label_contains(name).next().unwrap().rect())
    };
    let before = rows(&harness);
    harness.state_mut().session_mut().apply(Command::Preview(Some(Box::new(candidate()))));
    wait(&mut harness, "the candidate", |harness| {
        harness.state().session().view().preview_results.is_some()
    });
    harness.run_steps(3);
    let text = harness.get_by_label_contains("Candidate: a changed lens");
    assert!(text.rect().bottom() < before[3].bottom() + 2.0, "it is in the menu bar");
    assert_eq!(rows(&harness), before);
    harness.get_by_label("Keep both").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session().view().kept.len(), 1);
}

/// The sharpness beside a candidate is the one of the merit function, the front and the search.
#[test]
fn one_number_is_the_sharpness_everywhere() {
    let mut harness = window();
    let view = harness.state().session().view();
    let spots = &view.results.as_ref().unwrap().analyses.as_ref().unwrap().spots.value;
    let squares = spots.iter().map(|spot| (1e3 * spot.as_ref().unwrap().rms.value).powi(2));
    let expected = (squares.sum::<f64>() / spots.len() as f64).sqrt();
    harness.state_mut().session_mut().apply(Command::Preview(Some(Box::new(candidate()))));
    wait(&mut harness, "the candidate", |harness| {
        harness.state().session().view().preview_results.is_some()
    });
    harness.run_steps(3);
    harness.get_by_label_contains(&format!("design {expected:.2} µm"));
}

/// The merit above the drawing is that of the lens in the drawing.
#[test]
fn the_layout_tells_the_merit_of_the_candidate() {
    let mut harness = window();
    let goal = harness.state().session().view().goal.unwrap();
    let tolerance = harness.state().session().view().settings.tolerance;
    let own = aplanat::merit::Merit::new(&double_gauss(), &goal, tolerance).unwrap();
    let lens = candidate();
    let merit = aplanat::merit::Merit::new(&lens, &goal, tolerance).unwrap();
    let merit = merit.with_initial_light(own.initial_light());
    let wanted = merit.value(&merit.values(&lens)).unwrap();
    harness.state_mut().session_mut().apply(Command::Preview(Some(Box::new(lens))));
    wait(&mut harness, "the merit of the candidate", |harness| {
        let view = harness.state().session().view();
        view.preview_merit.is_some() && view.merit.is_some()
    });
    harness.run_steps(3);
    let view = harness.state().session().view();
    let total = |report: &Option<std::sync::Arc<aplanat::session::MeritReport>>| {
        report.as_ref().unwrap().values.as_ref().unwrap().total
    };
    let (new, old) = (total(&view.preview_merit), total(&view.merit));
    assert!((new / wanted - 1.0).abs() < 1e-9, "{new} {wanted}");
    assert!((new / old - 1.0).abs() > 1e-3, "{new} {old}");
    harness.get_by_label_contains(&format!("merit {}", &new.to_string()[..4]));
}

/// The key of a panel brings it to the front with the keyboard in it, and never hides it: the menu does that.
#[test]
fn the_key_of_a_panel_puts_the_keyboard_in_it() {
    let mut harness = window();
    for _ in 0..2 {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Num3);
        harness.run_steps(3);
        assert!(harness.get_by_label("Radius of surface 1").is_focused());
    }
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Num1);
    harness.run_steps(8);
    assert!(harness.get_by_label("Fit").is_focused());
    harness.key_press(Key::Tab);
    harness.run_steps(3);
    assert!(harness.get_by_label("Rays of each field").is_focused());
}

/// The tab of the panel that is shown is in its bar, however narrow that is.
#[test]
fn the_tab_in_front_is_seen() {
    for (name, title) in [("import report", "Import report"), ("view: ghosts", "Ghosts")] {
        let mut harness = window();
        harness.key_press_modifiers(Modifiers::COMMAND, Key::K);
        harness.run_steps(4);
        harness.event(egui::Event::Text(name.to_owned()));
        harness.run_steps(4);
        harness.key_press(Key::Enter);
        harness.run_steps(12);
        let place = harness.get_by_label(title).rect();
        assert!(place.left() > 836.0 && place.right() < 1256.0, "{title}: {place}");
    }
}

#[test]
fn save_as_proposes_the_name_of_the_lens() {
    let mut harness = window();
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    harness.run_steps(3);
    let proposed = harness.get_by_label("Path").value().unwrap();
    let proposed = std::path::Path::new(&proposed);
    let name = proposed.file_name().unwrap().to_string_lossy();
    assert!(name.starts_with("Double Gauss") && name.ends_with(".json"), "{proposed:?}");
    assert!(proposed.is_absolute(), "it is said where the file would be");
}

/// A window on a file whose program was killed says what it has recovered, and holds what was held.
#[test]
fn a_file_that_was_open_when_the_program_was_killed_is_told() {
    let folder = std::env::temp_dir().join(format!("aplanat-told-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [journals, copy] = ["journals", "copy"].map(|name| folder.join(name));
    let file = folder.join("lens.json");
    aplanat::files::save(&double_gauss(), &file).unwrap();
    let mut session = Session::new(double_gauss(), || {}).unwrap();
    session.set_journal_folder(&journals, || {}).unwrap();
    session.apply(Command::Open(file.clone()));
    let parameter = Parameter::new(1, Quantity::Thickness);
    session.apply(Edit::Set { parameter, value: 2.5 }.into());
    session.apply(Command::CommitEdit);
    let locks = DragSettings { locks: vec![FirstOrderLock::FocalLength], ..Default::default() };
    session.apply(Command::SetDragSettings(locks.clone()));
    session.sync_journal();
    // The journals as a killed program leaves them.
    std::fs::create_dir_all(&copy).unwrap();
    for journal in std::fs::read_dir(&journals).unwrap().flatten() {
        if journal.path().extension().is_some_and(|end| end == "journal") {
            std::fs::copy(journal.path(), copy.join(journal.file_name())).unwrap();
        }
    }
    let mut again = Session::new(double_gauss(), || {}).unwrap();
    again.set_journal_folder(&copy, || {}).unwrap();
    let studio = Studio::new(again, RenderBackend::Software, Persistence::Disabled, None);
    let builder = Harness::builder().with_size([1280.0, 800.0]).with_context_setup(theme::apply);
    let mut harness = builder.build_ui_state(|ui, studio: &mut Studio| studio.ui(ui), studio);
    harness.state_mut().session_mut().apply(Command::Open(file));
    harness.state_mut().session_mut().tell_unfinished();
    settle(&mut harness);
    let view = harness.state().session().view();
    assert_eq!((view.lens.surfaces[1].thickness, &view.drag.settings), (2.5, &locks));
    let told = harness.get_by_label_contains("with 1 unsaved change (").value().unwrap();
    assert!(told.starts_with("Recovered") && told.contains("thickness"), "{told}");
    assert!(!told.contains("other design"), "{told}");
    drop(harness);
    drop(session);
    std::fs::remove_dir_all(folder).unwrap();
}
