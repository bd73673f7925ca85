//! The table of the prescription as a spreadsheet: cursor, ranges, clipboard, semi-diameters.

use std::path::Path;

use aplanat::lens::{
    Edit, ErrorDistribution, Lens, Parameter, Perturbation, PerturbationKind, Quantity, Tolerance,
    ToleranceSheet, Variable, blank,
};
use aplanat::report::{ReportSettings, report_bytes};
use aplanat::session::{CandidateSource, CandidateView, Command, SessionView};
use aplanat::studio::panels::PrescriptionPanel;
use egui::accesskit::Role;
use egui::{Event, Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{
    LOWER, PanelState, double_gauss, painted_places, panel_harness, small_harness, view_of,
};

type Table = Harness<'static, PanelState<PrescriptionPanel>>;

fn table(lens: Lens) -> Table {
    let mut harness = panel_harness(PrescriptionPanel::default(), view_of(lens));
    harness.run();
    harness
}

fn enter(harness: &mut Table, cell: &str) {
    harness.get_by_label(cell).focus();
    harness.run();
}

fn edits(harness: &Table) -> Vec<Edit> {
    let commands = harness.state().commands.iter();
    commands
        .filter_map(|c| if let Command::Edit(edit) = c { Some(edit.clone()) } else { None })
        .collect()
}

fn key(key: Key, modifiers: Modifiers) -> Event {
    Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
}

/// A slow frame, a remote desktop or a macro delivers many keys at once.
#[test]
fn a_number_and_enter_in_one_frame_change_one_row_only() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    let text = |text: &str| Event::Text(text.to_owned());
    let all = key(Key::A, Modifiers::COMMAND);
    let typed = [all, text("9"), text("."), text("5"), key(Key::Enter, Modifiers::NONE)];
    harness.input_mut().events.extend(typed);
    harness.step();
    harness.run();
    assert_eq!(edits(&harness), [Edit::set_radius(0, 9.5)]);
    let next = harness.get_by_label("Radius of surface 2");
    assert!(next.is_focused());
    assert_ne!(next.value().as_deref(), Some("9.5"));
}

#[test]
fn arrows_go_from_cell_to_cell() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    for (pressed, cell) in [
        (Key::ArrowDown, "Radius of surface 2"),
        (Key::ArrowRight, "Thickness of surface 2"),
        (Key::ArrowUp, "Thickness of surface 1"),
        (Key::ArrowUp, "Object distance"),
        (Key::ArrowRight, "Medium of the object"),
        (Key::ArrowDown, "Glass of surface 1"),
        (Key::ArrowLeft, "Thickness of surface 1"),
        (Key::Home, "Radius of surface 1"),
    ] {
        harness.key_press(pressed);
        harness.run();
        assert!(harness.get_by_label(cell).is_focused(), "{cell}");
    }
    assert_eq!(edits(&harness), []);
}

/// A person who presses arrows quickly types into the cell they lead to.
#[test]
fn arrows_in_frames_after_each_other_keep_the_keyboard_in_the_table() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    for pressed in [Key::ArrowDown, Key::ArrowRight, Key::ArrowRight, Key::ArrowDown] {
        harness.input_mut().events.push(key(pressed, Modifiers::NONE));
        harness.step();
    }
    harness.run();
    assert!(harness.get_by_label("Glass of surface 3").is_focused());
    harness.get_by_label("Glass of surface 3").type_text("n-lak33a");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    assert_eq!(edits(&harness).len(), 1, "what is typed is not lost");
}

#[test]
fn the_tab_key_right_after_an_arrow_goes_on_from_its_cell() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    for pressed in [Key::ArrowDown, Key::Tab] {
        harness.input_mut().events.push(key(pressed, Modifiers::NONE));
        harness.step();
    }
    harness.run();
    assert!(harness.get_by_label("Thickness of surface 2").is_focused());
}

#[test]
fn after_f2_arrows_move_in_the_text() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    harness.key_press(Key::F2);
    harness.run();
    harness.key_press(Key::ArrowLeft);
    harness.run();
    harness.get_by_label("Radius of surface 1").type_text("9");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    assert_eq!(edits(&harness), [Edit::set_radius(0, 14.16195)]);
}

/// The second click that edits in place is one into a cell that has the keyboard.
#[test]
fn a_click_into_a_cell_without_the_keyboard_enters_it() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    let cell = harness.ctx.memory(egui::Memory::focused).unwrap();
    harness.ctx.memory_mut(|memory| memory.surrender_focus(cell));
    harness.run();
    assert!(!harness.get_by_label("Radius of surface 1").is_focused());
    harness.get_by_label("Radius of surface 1").click();
    harness.run();
    harness.key_press(Key::ArrowDown);
    harness.run();
    assert!(harness.get_by_label("Radius of surface 2").is_focused());
}

#[test]
fn a_typed_value_is_committed_by_an_arrow() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 2");
    harness.get_by_label("Radius of surface 2").type_text("77");
    harness.run();
    harness.key_press(Key::ArrowDown);
    harness.run();
    assert_eq!(edits(&harness), [Edit::set_radius(1, 77.0)]);
    assert!(harness.get_by_label("Radius of surface 3").is_focused());
}

#[test]
fn insert_and_delete_work_on_the_row_of_the_cursor() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Conic of surface 3");
    harness.key_press(Key::Delete);
    harness.run();
    assert_eq!(edits(&harness), [Edit::RemoveRow(2)]);
    enter(&mut harness, "Conic of surface 3");
    harness.key_press(Key::Insert);
    harness.run();
    assert!(matches!(edits(&harness)[1], Edit::InsertRow { at: 2, .. }));
}

#[test]
fn a_range_is_copied_pasted_and_cleared() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    for pressed in [Key::ArrowDown, Key::ArrowRight] {
        harness.key_press_modifiers(Modifiers::SHIFT, pressed);
        harness.run();
    }
    harness.input_mut().events.push(Event::Copy);
    harness.step();
    let copied =
        harness.output().platform_output.commands.iter().find_map(|command| match command {
            egui::OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        });
    let lens = double_gauss();
    let line = |i: usize| {
        let row = &lens.surfaces[i];
        format!("{}\t{}", 1.0 / row.curvature, row.thickness)
    };
    assert_eq!(copied, Some(format!("{}\n{}", line(0), line(1))));
    harness.input_mut().events.push(Event::Paste("50\t2\n-60\t3\n".to_owned()));
    harness.run();
    let [Edit::Sequence { title, edits: pasted }] = &edits(&harness)[..] else { panic!() };
    let gap = |surface: usize, value: f64| Edit::Set {
        parameter: Parameter::new(surface, Quantity::Thickness),
        value,
    };
    let wanted = [Edit::set_radius(0, 50.0), gap(0, 2.0), Edit::set_radius(1, -60.0), gap(1, 3.0)];
    assert_eq!((title.as_str(), &pasted[..]), ("paste", &wanted[..]));
}

/// The numbers of a range that Ctrl+Shift+V makes variable (true) or fixed, by surface.
fn varied_range(lens: Lens) -> Vec<(usize, bool)> {
    let mut harness = table(lens);
    enter(&mut harness, "Radius of surface 1");
    for _ in 0..2 {
        harness.key_press_modifiers(Modifiers::SHIFT, Key::ArrowDown);
        harness.run();
    }
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::V);
    harness.run();
    let found = edits(&harness);
    let [Edit::Sequence { edits, .. }] = &found[..] else { panic!("{found:?}") };
    let varied = |edit: &Edit| match edit {
        Edit::AddVariable(variable) => (variable.parameter.surface, true),
        Edit::RemoveVariable(parameter) => (parameter.surface, false),
        other => panic!("{other:?}"),
    };
    edits.iter().map(varied).collect()
}

#[test]
fn all_numbers_of_a_range_are_varied_and_fixed_together() {
    let varied = double_gauss();
    assert_eq!(varied_range(varied.clone()), [0, 1, 2].map(|surface| (surface, false)));
    let fixed = Lens { variables: Vec::new(), ..varied };
    assert_eq!(varied_range(fixed), [0, 1, 2].map(|surface| (surface, true)));
}

/// Undo and pasting change the text under the cursor: what is typed next replaces all of it.
#[test]
fn a_typed_value_replaces_all_of_a_value_that_has_changed_under_the_cursor() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 2");
    let mut longer = double_gauss();
    longer.surfaces[1].curvature = -1.0 / 107.7891;
    harness.state_mut().view = view_of(longer);
    harness.input_mut().events.extend([Event::Text("6".into()), Event::Text("0".into())]);
    harness.step();
    harness.key_press(Key::Enter);
    harness.run();
    assert_eq!(edits(&harness), [Edit::set_radius(1, 60.0)]);
}

#[test]
fn a_number_that_is_no_index_is_refused_as_glass() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Glass of surface 1");
    harness.get_by_label("Glass of surface 1").type_text("60");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    assert_eq!(edits(&harness), []);
    let refused = harness.get_by_label("Glass of surface 1");
    assert_eq!(refused.value().as_deref(), Some("60"));
}

#[test]
fn backspace_clears_a_range() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    harness.key_press_modifiers(Modifiers::SHIFT, Key::ArrowDown);
    harness.run();
    harness.key_press(Key::Backspace);
    harness.run();
    let [Edit::Sequence { edits: cleared, .. }] = &edits(&harness)[..] else {
        panic!("{:?}", edits(&harness))
    };
    let plane = |surface| Edit::set_radius(surface, f64::INFINITY);
    assert_eq!(cleared[..], [plane(0), plane(1)]);
}

#[test]
fn the_mouse_spans_a_range() {
    let mut harness = table(double_gauss());
    let at = |harness: &Table, cell: &str| harness.get_by_label(cell).rect().center();
    let (from, to) = (at(&harness, "Radius of surface 1"), at(&harness, "Thickness of surface 3"));
    harness.drag_at(from);
    harness.run();
    harness.hover_at(to);
    harness.run();
    harness.drop_at(to);
    harness.run();
    harness.input_mut().events.push(Event::Paste("7".to_owned()));
    harness.run();
    let [Edit::Sequence { edits: pasted, .. }] = &edits(&harness)[..] else { panic!() };
    assert_eq!(pasted.len(), 6, "three rows of two cells");
}

#[test]
fn a_wrong_paste_changes_nothing_and_names_the_cell() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Thickness of surface 1");
    harness.input_mut().events.push(Event::Paste("1\n2,5\n3".to_owned()));
    harness.run();
    assert_eq!(edits(&harness), []);
    harness.get_by_label_contains("Thickness of surface 2: `2,5` is no number");
}

#[test]
fn a_hundred_thousand_pasted_cells_do_not_hang() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Radius of surface 1");
    harness.input_mut().events.push(Event::Paste("1\t2\n".repeat(50_000)));
    harness.run();
    assert_eq!(edits(&harness), []);
    harness.get_by_label_contains("50000 surfaces; expected at most 1000");
}

#[test]
fn a_semi_diameter_is_automatic_until_a_person_fixes_it() {
    let mut lens = blank();
    lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let mut harness = table(lens);
    let cell = "Semi-diameter of surface 1";
    assert_eq!(harness.get_by_label(cell).value().as_deref(), Some(""));
    harness.get_by_label("Semi-diameter of surface 1 variable").click();
    harness.run();
    harness.get_by_label("Fixed: clips").click();
    harness.run();
    let [Edit::SetSemiDiameter { surface: 0, value: Some(size) }] = edits(&harness)[..] else {
        panic!("{:?}", edits(&harness))
    };
    assert!((size - 5.0).abs() < 1e-9, "the beam of 10 mm");
    enter(&mut harness, cell);
    harness.get_by_label(cell).type_text("auto");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    assert_eq!(edits(&harness).len(), 2);
}

/// A copied semi-diameter would clip the beam of the neighbour.
#[test]
fn an_inserted_surface_does_not_clip() {
    let mut harness = table(double_gauss());
    harness.get_by_label("Row of surface 2").click();
    harness.run();
    harness.get_by_label("Insert after").click();
    harness.run();
    let [Edit::InsertRow { at: 2, row }] = &edits(&harness)[..] else { panic!() };
    assert_eq!(row.semi_diameter, None);
}

#[test]
fn bounds_of_a_radius_are_asked_as_radii() {
    let mut harness = table(double_gauss());
    harness.get_by_label("Radius of surface 1 variable").click_secondary();
    harness.run();
    for (bound, radius) in [("Minimum", "20"), ("Maximum", "40")] {
        harness.get_by_role_and_label(Role::TextInput, bound).focus();
        harness.run();
        harness.get_by_role_and_label(Role::TextInput, bound).type_text(radius);
        harness.run();
        harness.key_press(Key::Enter);
        harness.run();
        let Some(Edit::AddVariable(variable)) = edits(&harness).pop() else { panic!() };
        let mut view = harness.state().view.clone();
        let mut lens = Lens::clone(&view.lens);
        lens.variables.retain(|v| v.parameter != variable.parameter);
        lens.variables.push(variable);
        view.lens = lens.into();
        harness.state_mut().view = view;
        harness.run();
    }
    let parameter = Parameter::new(0, Quantity::Curvature);
    let wanted = Variable { parameter, min: Some(0.025), max: Some(0.05) };
    assert_eq!(edits(&harness).last(), Some(&Edit::AddVariable(wanted)));
    harness.get_by_label("Allowed: R ≥ 20 mm and R ≤ 40 mm");
}

#[test]
fn glasses_are_chosen_by_arrows_and_enter() {
    let mut harness = table(double_gauss());
    enter(&mut harness, "Glass of surface 1");
    harness.get_by_label("Glass of surface 1").type_text("n-lak");
    harness.run();
    harness.key_press(Key::ArrowDown);
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    let [Edit::SetMedium { surface: 0, medium }] = &edits(&harness)[..] else {
        panic!("{:?}", edits(&harness))
    };
    assert!(format!("{medium:?}").contains("N-LAK"), "{medium:?}");
}

#[test]
fn a_column_can_be_hidden() {
    let mut harness = table(double_gauss());
    harness.get_by_label("Conic of surface 1");
    harness.get_by_label("Columns").click();
    harness.run();
    harness.get_by_role_and_label(Role::CheckBox, "Conic").click();
    harness.run();
    assert!(harness.query_by_label("Conic of surface 1").is_none());
    harness.get_by_label("Show all columns").click();
    harness.run();
    harness.get_by_label("Conic of surface 1");
}

#[test]
fn aspheres_obstructions_and_gradients_are_added_in_the_menu_of_a_row() {
    for (item, number) in [
        ("Add an asphere term", "asphere of surface 1"),
        ("Add an obstruction", "obstruction of surface 1"),
        ("Make the glass a gradient", "glass after surface 1"),
    ] {
        let mut harness = table(double_gauss());
        harness.get_by_label("Row of surface 1").click_secondary();
        harness.run();
        harness.get_by_label(item).click();
        harness.run();
        let titles: Vec<String> = edits(&harness).iter().map(Edit::title).collect();
        assert_eq!(titles, [number]);
    }
}

#[test]
fn a_wide_number_is_shortened_and_not_cut() {
    let mut lens = double_gauss();
    lens.surfaces[0].curvature = 1e-300;
    lens.surfaces[0].conic = -1.234567e-12;
    let harness = table(lens);
    let value = |cell: &str| harness.get_by_label(cell).value();
    assert_eq!(value("Radius of surface 1").as_deref(), Some("1e300"));
    let conic = value("Conic of surface 1").unwrap();
    assert!(conic.len() <= 8 && conic.ends_with("e-12"), "{conic}");
}

/// All panels show the same lens, and the table says what differs from the design.
#[test]
fn the_table_shows_the_candidate_with_what_it_changes() {
    let design = view_of(double_gauss());
    let mut lens = double_gauss();
    lens.surfaces[1].thickness = 7.5;
    let candidate =
        CandidateView { source: CandidateSource::Chosen, title: "a lens".into(), shown: true };
    let view = SessionView {
        candidate: Some(candidate),
        preview_results: view_of(lens).results,
        ..design
    };
    let mut harness = panel_harness(PrescriptionPanel::default(), view);
    harness.run();
    let gap = |surface: usize| double_gauss().surfaces[surface].thickness;
    harness.get_by_label(&format!("Thickness of surface 1 of the candidate: {}", gap(0)));
    let changed = "Thickness of surface 2 of the candidate: 7.5";
    harness.get_by_label(&format!("{changed}. In the design: {}", gap(1)));
    assert!(harness.query_by_label("Thickness of surface 2").is_none(), "nothing can be edited");
    harness.state_mut().view.candidate.as_mut().unwrap().shown = false;
    harness.run();
    harness.get_by_label("Thickness of surface 2");
}

/// A candidate has the automatic semi-diameters and the badges that the design has.
#[test]
fn a_candidate_shows_semi_diameters_and_badges() {
    let mut lens = double_gauss();
    lens.surfaces[1].semi_diameter = None;
    let design = view_of(lens.clone());
    lens.surfaces[1].thickness = 7.5;
    let candidate =
        CandidateView { source: CandidateSource::Chosen, title: "a lens".into(), shown: true };
    let shown = view_of(lens);
    let reached = shown.results.as_ref().unwrap().analyses.as_ref().unwrap();
    let reached = format!("{:.3}", reached.semi_diameters.value[1]);
    let view = SessionView { candidate: Some(candidate), preview_results: shown.results, ..design };
    let mut harness = panel_harness(PrescriptionPanel::default(), view);
    harness.run();
    let cell = "Semi-diameter of surface 2 of the candidate: ";
    let cells = harness.get_all_by_label_contains(cell).filter_map(|node| node.value());
    let cells: Vec<String> = cells.filter(|text| text.starts_with("Semi")).collect();
    let is_reached = |text: &String| text.contains(&reached[..4]);
    assert!(cells.len() == 1 && is_reached(&cells[0]), "{cells:?}, rays reach {reached}");
    for (cell, status) in [
        ("Radius of surface 1", "variable"),
        ("Semi-diameter of surface 1", "fixed, clips"),
        ("Semi-diameter of surface 2", "automatic"),
        ("Conic of surface 1", "fixed"),
    ] {
        harness.get_by_label(&format!("Badge of {cell} of the candidate: {status}"));
    }
}

/// A table that is wider than its panel is read by the numbers of its rows.
#[test]
fn the_numbers_of_the_rows_stay_while_the_columns_are_scrolled() {
    let mut lens = double_gauss();
    lens.surfaces[0].asphere = vec![1e-7, 1e-9, 1e-11, 1e-13];
    let panel = PrescriptionPanel::default();
    let mut harness = small_harness(panel, view_of(lens), LOWER);
    harness.run();
    let number = "Row of surface 2";
    let place = |harness: &Harness<'_, _>, label| harness.get_by_label(label).rect();
    let (before, radius) = (place(&harness, number), place(&harness, "Radius of surface 2"));
    // The cursor at the other end of its row brings that into view.
    harness.get_by_label("Remark on surface 2").focus();
    harness.run_steps(20);
    let moved = place(&harness, "Radius of surface 2");
    assert!((moved.center().y - before.center().y).abs() < 3.0, "{moved:?} beside {before:?}");
    assert!(moved.left() < radius.left() - 100.0, "the table is scrolled: {radius:?} {moved:?}");
    assert_eq!(place(&harness, number), before);
    let header = painted_places(&harness).into_iter().find(|(text, _)| text == "Surf").unwrap().1;
    assert!(header.left() < before.right(), "{header:?}");
    // What the numbers would hide is brought beside them.
    harness.get_by_label("Radius of surface 2").focus();
    harness.run_steps(20);
    assert!(place(&harness, "Radius of surface 2").left() >= before.right() - 1.0);
    // The numbers can be clicked wherever the columns are.
    harness.get_by_label("Remark on surface 2").focus();
    harness.run_steps(20);
    harness.get_by_label("Row of surface 3").click();
    harness.run();
    assert_eq!(harness.state().view.selected, Some(2));
}

/// The half ranges of a lens stand beside its surfaces, in the table and in the report; a lens without has
/// no such column.
#[test]
fn tolerances_stand_beside_the_surfaces() {
    let lens = double_gauss();
    let harness = table(lens.clone());
    assert!(harness.query_by_label("Tolerances").is_none());
    let error = |kind| Perturbation::of_surface(kind, 0);
    let tolerance = |kind, half_range| Tolerance {
        error: error(kind),
        half_range,
        distribution: ErrorDistribution::default(),
    };
    let angle = (2.0_f64 / 60.0).to_radians();
    let errors = vec![
        tolerance(PerturbationKind::Curvature, 0.001 * lens.surfaces[0].curvature),
        tolerance(PerturbationKind::Thickness, 0.05),
        tolerance(PerturbationKind::SurfaceTiltX, angle),
        tolerance(PerturbationKind::SurfaceTiltY, angle),
    ];
    let lens = Lens { tolerances: Some(ToleranceSheet::of_errors(errors)), ..lens };
    let harness = table(lens.clone());
    harness.get_by_label("Tolerances");
    harness.get_by_label("Tolerances of surface 1: R 0.1 %, t 0.05, tilt 2'");
    let settings = ReportSettings { tolerance: 0.01 };
    let (bytes, _) = report_bytes(&lens, settings, Path::new("report.html")).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("R 0.1 %, t 0.05, tilt 2"), "no tolerances in the report");
}
