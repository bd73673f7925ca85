//! The versions of the design and its live merit, driven by accessibility labels.

use std::sync::Arc;

use aplanat::lens::{Edit, Lens, Parameter, Quantity};
use aplanat::merit::{
    ConstraintMargin, Goal, OperandKind, Term, TermScope, TermValue, WeightedTerm,
};
use aplanat::session::{
    AnalysisResults, Command, CurvePoint, HistoryNode, MeritReport, MeritValues, OptimizationCurve,
    SessionView,
};
use aplanat::studio::panels::{HistoryPanel, OptimizerPanel};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{
    LOWER, PanelState, double_gauss, painted_galleys, painted_texts, panel_harness, small_harness,
    view,
};

fn version(id: u64, parent: Option<u64>, title: &str, merit: f64, lens: &Arc<Lens>) -> HistoryNode {
    HistoryNode {
        id,
        parent,
        title: title.to_owned(),
        name: None,
        merit: Some(merit),
        time: 86_400 + 3_723,
        seed: None,
        lens: Arc::clone(lens),
        curve: None,
        proposal: None,
    }
}

/// A design with two branches, of which the second is an optimization.
fn branched() -> SessionView {
    let mut view = view();
    let mut other = double_gauss();
    other.surfaces[2].thickness += 0.5;
    let other = Arc::new(other);
    let point =
        |step: usize| CurvePoint { step, merit: 0.02 / (step + 1) as f64, values: vec![0.02] };
    let curve = OptimizationCurve {
        parameters: vec![Parameter::new(0, Quantity::Curvature)],
        points: (0..5).map(point).collect(),
    };
    let nodes = [
        version(0, None, "opened", 0.02, &view.lens),
        version(1, Some(0), "thickness of surface 3", 0.03, &other),
        HistoryNode {
            curve: Some(Arc::new(curve)),
            seed: Some(7),
            ..version(2, Some(0), "accept the optimized lens", 0.01, &view.lens)
        },
    ];
    view.history = Arc::new(nodes.into_iter().map(Arc::new).collect());
    view.version_id = 2;
    view
}

fn history() -> Harness<'static, PanelState<HistoryPanel>> {
    let mut harness = panel_harness(HistoryPanel::default(), branched());
    harness.run();
    harness
}

#[test]
fn versions_are_compared_named_and_gone_to() {
    let mut harness = history();
    harness
        .get_by_label("Present version: Accept the optimized lens: merit 0.01 (-50.0 %), seed 7");
    harness.get_by_label("Thickness of surface 3: merit 0.03 (+50.0 %)").click();
    harness.run();
    let commands = &harness.state().commands;
    assert!(
        matches!(&commands[..], [Command::Preview(Some(lens))] if lens.name == double_gauss().name)
    );
    for text in ["merit", "+200.00 %", "thickness after surface 3", "total track, mm"] {
        assert!(harness.query_all_by_label(text).count() > 0, "{text}");
    }
    harness.get_by_label("Name of the version").focus();
    harness.run();
    harness.get_by_label("Name of the version").type_text("thick");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    harness.get_by_label("Go to").click();
    harness.run();
    let named = Command::NameVersion { id: 1, name: "thick".into() };
    assert_eq!(harness.state().commands[1..], [named, Command::GoTo(1)]);
}

/// The merit of a candidate is one number in all panels: that by the merit function of the design.
#[test]
fn versions_are_compared_by_one_merit_function() {
    let mut view = branched();
    let report = |lens: &Arc<Lens>, total: f64| {
        let values = MeritValues { total, ..MeritValues::default() };
        let goal = Arc::new(Goal::default_for(lens).unwrap());
        let lens = Arc::clone(lens);
        Some(Arc::new(MeritReport { lens, goal, values: Ok(values), ms: 1.0 }))
    };
    view.merit = report(&view.lens, 0.01);
    view.preview_merit = report(&view.history[1].lens, 0.05);
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label_contains("Thickness of surface 3").click();
    harness.run();
    assert!(harness.query_all_by_label("+400.00 %").count() > 0, "not by the stored 0.03");
}

/// A row has what the version knows: time and seed too, and its title is not cut.
#[test]
fn a_version_is_told_in_full_in_a_narrow_panel() {
    let mut view = branched();
    let title = "accept lens 17 of the search, which bends the second element";
    let nodes = Arc::make_mut(&mut view.history);
    Arc::make_mut(&mut nodes[2]).title = title.to_owned();
    let mut harness = small_harness(HistoryPanel::default(), view, LOWER);
    harness.run();
    let texts = painted_texts(&harness);
    let facts = "merit 0.01 (-50.0 %), seed 7, 01:02:03 UTC";
    assert!(texts.iter().any(|text| text == facts), "{texts:?}");
    let row = harness.get_by_label_contains("Present version: Accept lens 17");
    assert!(row.rect().right() <= 414.0 && row.rect().height() > 40.0, "{:?}", row.rect());
    let painted = painted_galleys(&harness);
    let shown = painted.iter().find(|galley| galley.text().starts_with("Accept lens 17")).unwrap();
    assert!(!shown.elided, "{}", shown.text());
}

#[test]
fn changes_of_the_merit_are_no_noise_and_no_thousands_of_percent() {
    let mut view = branched();
    let nodes = Arc::make_mut(&mut view.history);
    for (node, merit) in nodes.iter_mut().zip([0.02, 0.02 * (1.0 + 1e-15), 35.52]) {
        Arc::make_mut(node).merit = Some(merit);
    }
    view.version_id = 0;
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label("Accept the optimized lens: merit 35.52 (1776 times), seed 7").click();
    harness.run();
    harness.get_by_label("1776 times");
    harness.get_by_label("Thickness of surface 3: merit 0.02").click();
    harness.run();
    harness.get_by_label("0 %");
}

#[test]
fn the_course_of_an_optimization_can_be_rewound() {
    let mut harness = history();
    harness.get_by_label_contains("Present version").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::Preview(None)], "it is shown already");
    harness.get_by_label("Merit against steps of this version");
    harness.get_by_label("Rewind").click();
    harness.run();
    let rewind = Command::Rewind { version: Some(2), step: 4 };
    assert_eq!(harness.state().commands.last(), Some(&rewind));
}

#[test]
fn the_merit_of_the_design_and_its_limits_are_shown_without_asking() {
    let mut view = view();
    let goal = Goal::default_for(&view.lens).unwrap();
    let names = goal.terms.iter().map(|weighted| (weighted.term.name(), weighted.weight));
    let value = |(term, weight)| TermValue {
        term,
        weight,
        value: if term == "spot" { 4e-4 } else { 0.0 },
        error: 1e-9,
        rays: 4200,
        reached: true,
    };
    let limit = |surface, value| ConstraintMargin {
        term: "glass_edge",
        surface: Some(surface),
        field: None,
        zoom: 0,
        um: None,
        value,
        min: Some(0.5),
        max: None,
    };
    let values = MeritValues {
        total: 4e-4,
        terms: names.map(value).collect(),
        limits: vec![limit(0, 2.0), limit(2, 0.5), limit(4, 0.2)],
    };
    let (lens, goal) = (Arc::clone(&view.lens), Arc::new(goal));
    view.goal = Some(Arc::clone(&goal));
    view.merit = Some(Arc::new(MeritReport { lens, goal, values: Ok(values), ms: 1.0 }));
    let mut harness = panel_harness(OptimizerPanel::default(), view);
    harness.run();
    for text in ["Merit 0.0004", "20 µm", "100 %", "3 limits: 1 broken, 1 binding"] {
        assert!(harness.query_all_by_label(text).count() > 0, "{text}");
    }
    harness.get_by_label("Glass edge at surface 5: 0.2 of at least 0.5").click();
    harness.run();
    let commands = &harness.state().commands;
    assert_eq!(*commands, [Command::ShowZoom(0), Command::Select(Some(4))]);
    // While a candidate is shown, they are not its limits.
    let state = harness.state_mut();
    state.view.preview_results.clone_from(&state.view.results);
    harness.run();
    for text in ["Merit of the design 0.0004", "3 limits of the design: 1 broken, 1 binding"] {
        assert!(harness.query_all_by_label(text).count() > 0, "{text}");
    }
}

/// Nothing of a term is cut at the right of the panel in a window of 1280 points.
#[test]
fn the_terms_fit_into_a_narrow_panel() {
    let mut view = view();
    let mut goal = Goal::default_for(&view.lens).unwrap();
    let long = Term::RelativeIllumination { field: 2, min: 0.5 };
    let kind = OperandKind::Astigmatism;
    let bounded = Term::Operand { kind, min: Some(-0.125), max: Some(0.125) };
    goal.terms.extend([long, bounded].map(|term| WeightedTerm::new(term, 1000.0)));
    let value = |weighted: &WeightedTerm| TermValue {
        term: weighted.term.name(),
        weight: weighted.weight,
        value: if weighted.term == Term::Spot { 1.2345e-6 } else { 0.0 },
        error: 1e-9,
        rays: 4200,
        reached: true,
    };
    let terms: Vec<TermValue> = goal.terms.iter().map(value).collect();
    let values = MeritValues { total: 4e-4, terms, limits: Vec::new() };
    let (lens, goal) = (Arc::clone(&view.lens), Arc::new(goal));
    view.goal = Some(Arc::clone(&goal));
    view.merit = Some(Arc::new(MeritReport { lens, goal, values: Ok(values), ms: 1.0 }));
    let mut harness = small_harness(OptimizerPanel::default(), view, LOWER);
    harness.run();
    let right = |label: &str| {
        let found = harness.query_all_by_label_contains(label);
        found.map(|node| node.rect().right()).fold(0.0, f32::max)
    };
    let labels = ["Remove ", "satisfied", "1.11 µm", "Weight of", "Minimum of", "Scope of"];
    for label in labels.into_iter().chain(["Maximum of", "Value, share"]) {
        assert!((1.0..=414.0).contains(&right(label)), "{label}: {}", right(label));
    }
}

/// The steps of one column of pixels are a part of the line, and no band with a wedge beside it.
#[test]
fn the_curve_of_many_steps_is_a_line() {
    let mut view = branched();
    let history = Arc::make_mut(&mut view.history);
    let node = Arc::make_mut(&mut history[2]);
    let curve = Arc::make_mut(node.curve.as_mut().unwrap());
    let merit = |step: usize| if step < 700 { 0.02 } else { 0.01 };
    let point = |step: usize| CurvePoint { step, merit: merit(step), values: vec![0.02] };
    curve.points = (0..2000).map(point).collect();
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label_contains("Present version").click();
    harness.run();
    harness.get_by_label("Merit against steps of this version");
    let is_band = |shape: &egui::Shape| matches!(shape, egui::Shape::Band(_));
    let bands = harness.output().shapes.iter().filter(|painted| is_band(&painted.shape)).count();
    assert_eq!(bands, 0);
}

/// The curve of an optimization has titles, and marks however little the merit has changed.
#[test]
fn the_merit_curve_has_titles_and_marks() {
    let mut view = branched();
    let mut nodes = (*view.history).clone();
    let points = (0..5).map(|step| CurvePoint {
        step,
        merit: 0.02 - 0.001 * step as f64,
        values: vec![0.02],
    });
    let curve = OptimizationCurve { parameters: Vec::new(), points: points.collect() };
    Arc::make_mut(&mut nodes[2]).curve = Some(Arc::new(curve));
    view.history = Arc::new(nodes);
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label_contains("Present version").click();
    harness.run();
    let texts = painted_texts(&harness);
    for title in ["step", "merit"] {
        assert!(texts.iter().any(|text| text == title), "{title} in {texts:?}");
    }
    let is_mark = |text: &&String| text.parse().is_ok_and(|v: f64| (0.015..=0.021).contains(&v));
    assert!(texts.iter().filter(is_mark).count() >= 2, "{texts:?}");
}

#[test]
fn a_term_may_be_there_several_times() {
    let mut harness = panel_harness(OptimizerPanel::default(), view());
    harness.run();
    for _ in 0..2 {
        harness.get_by_label("Add a term").click();
        harness.run();
        harness.get_all_by_label("Relative illumination").last().unwrap().click();
        harness.run();
    }
    assert!(harness.query_by_label("Weight of Relative illumination 2").is_some());
    let Some(Command::Edit(Edit::SetMerit(Some(goal)))) = harness.state().commands.last() else {
        panic!("{:?}", harness.state().commands);
    };
    let count = |name: &str| goal.terms.iter().filter(|w| w.term.name() == name).count();
    assert_eq!((count("relative_illumination"), count("spot")), (2, 1));
}

#[test]
fn the_spots_of_two_versions_stand_beside_each_other() {
    let mut view = branched();
    let results = view.results.clone().unwrap();
    let lens = Arc::clone(&view.history[1].lens);
    view.preview_results = Some(Arc::new(AnalysisResults { lens, ..(*results).clone() }));
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label_contains("Thickness of surface 3").click();
    harness.run();
    for which in ["present", "selected"] {
        harness.get_by_label_contains(&format!("Spot of field 1 of the {which} version: RMS"));
        let label = format!("of the {which} version: RMS");
        let all = harness.get_all_by_label_contains(&label);
        let lefts: Vec<f32> = all.map(|picture| picture.rect().left()).collect();
        assert!(lefts.iter().all(|left| *left == lefts[0]), "{which}: {lefts:?}");
    }
}

/// Until a version is clicked, all the room is for the tree.
#[test]
fn the_tree_has_the_room_while_no_version_is_selected() {
    let mut harness = small_harness(HistoryPanel::default(), branched(), LOWER);
    harness.run();
    let hint = harness.get_by_label("Click a version to compare it with the present one.").rect();
    assert!(hint.top() > LOWER - 40.0, "{hint:?}");
}

/// In a wide panel the selected version stands beside the tree.
#[test]
fn a_version_is_compared_beside_the_tree_where_there_is_room() {
    let mut harness = history();
    harness.get_by_label_contains("Thickness of surface 3").click();
    harness.run();
    let row = harness.get_by_label_contains("Present version").rect();
    let button = harness.get_by_label("Go to").rect();
    assert!(button.left() > row.right() - 1.0 && button.top() < row.bottom(), "{button:?} {row:?}");
}

/// A last thickness that is solved is that of the solve, and not the written one.
#[test]
fn the_track_of_a_solved_image_plane_is_compared_as_it_is() {
    let mut view = branched();
    let mut solved = double_gauss();
    solved.image_solve = Some(0.0);
    solved.variables.clear();
    let mut other = solved.clone();
    other.surfaces.last_mut().unwrap().thickness += 20.0;
    other.surfaces[2].thickness += 0.5;
    view.lens = Arc::new(solved);
    Arc::make_mut(&mut Arc::make_mut(&mut view.history)[1]).lens = Arc::new(other);
    let track = |lens: &Lens| {
        let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
        system.total_track()
    };
    let [own, selected] = [track(&view.lens), track(&view.history[1].lens)];
    let change = aplanat::studio::number::format_change(own, selected, 2).unwrap();
    let mut harness = panel_harness(HistoryPanel::default(), view);
    harness.run();
    harness.get_by_label_contains("Thickness of surface 3").click();
    harness.run();
    let row = harness.get_by_label("total track, mm").rect();
    let cells = harness.get_all_by_label(&change);
    let mut heights = cells.map(|cell| cell.rect().center().y);
    assert!(heights.any(|y| (y - row.center().y).abs() < 3.0), "{change}");
}

#[test]
fn a_term_is_bounded_and_restricted_to_a_part_of_the_lens() {
    let mut harness = panel_harness(OptimizerPanel::default(), view());
    harness.run();
    let type_into = |harness: &mut Harness<'_, _>, field: &str, text: &str| {
        harness.get_by_label(field).focus();
        harness.run();
        harness.get_by_label(field).type_text(text);
        harness.run();
        harness.key_press(Key::Enter);
        harness.run();
    };
    harness.get_by_label("Add a term").click();
    harness.run();
    harness.get_by_label_contains("Chief rays").click();
    harness.run();
    harness.get_all_by_label("Chief-ray angle").last().unwrap().click();
    harness.run();
    type_into(&mut harness, "Maximum of Chief-ray angle", "12");
    harness.get_by_label("Scope of Chief-ray angle").click();
    harness.run();
    type_into(&mut harness, "Surfaces of Chief-ray angle", "3-4");
    let Some(Command::Edit(Edit::SetMerit(Some(goal)))) = harness.state().commands.last() else {
        panic!("{:?}", harness.state().commands);
    };
    let term = goal.terms.last().unwrap();
    let kind = OperandKind::ChiefRayAngle;
    assert_eq!(term.term, Term::Operand { kind, min: None, max: Some(12.0) });
    assert_eq!(term.scope, TermScope { surfaces: Some([2, 3]), ..TermScope::ALL });
    let count = harness.state().commands.len();
    type_into(&mut harness, "Surfaces of Chief-ray angle", "99");
    assert_eq!(harness.state().commands.len(), count, "the lens has no such surface");
}
