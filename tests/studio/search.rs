//! The panel of the structure search, driven by its accessibility labels.

use std::path::PathBuf;
use std::sync::Arc;

use aplanat::files;
use aplanat::lens::{Fields, Lens, Medium, SurfaceNumber};
use aplanat::merit::ConstraintMargin;
use aplanat::optimize::pareto::ParetoPoint;
use aplanat::search::{
    DescentEnd, LineageNode, MutationKind, MutationStatistics, MutationWeights, OfferOutcome,
    Refusal, SearchMethod, SearchStatistics, SteerCommand, StructureChange, Temperature,
};
use aplanat::session::{
    CheckpointStatus, Command, DescentMark, FoundLens, HistorySample, RunId, RunKind, RunStatus,
    RunView, ScoredLens, SearchHistory, SessionView, StructureSearchCommand,
    StructureSearchRequest, StructureSearchSnapshot,
};
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::SearchPanel;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable};

use crate::harness::{
    LOWER, PanelState, double_gauss, painted_texts, panel_harness, small_harness, view, view_of,
};

fn panel(view: SessionView) -> Harness<'static, PanelState<SearchPanel>> {
    let mut harness = panel_harness(SearchPanel::default(), view);
    harness.run();
    harness
}

fn press(harness: &mut Harness<'_, PanelState<SearchPanel>>, name: &str) {
    harness.get_by_label(name).click();
    harness.run();
}

/// The commands for the search.
fn asked(harness: &Harness<'_, PanelState<SearchPanel>>) -> Vec<StructureSearchCommand> {
    let commands = harness.state().commands.iter();
    let asked = commands.filter_map(|command| match command {
        Command::StructureSearch(explore) => Some(explore.clone()),
        _ => None,
    });
    asked.collect()
}

fn started(harness: &Harness<'_, PanelState<SearchPanel>>) -> StructureSearchRequest {
    match asked(harness).as_slice() {
        [StructureSearchCommand::StartShown(quest)] => StructureSearchRequest::clone(quest),
        other => panic!("{other:?}"),
    }
}

/// A double Gauss with other glass behind its first surface.
fn other(number: u64) -> Arc<Lens> {
    let mut lens = double_gauss();
    lens.name = format!("lens {number}");
    lens.surfaces[0].medium = Medium::Glass("SCHOTT N-BK7".to_owned());
    Arc::new(lens)
}

fn found(number: u64, merit: f64) -> Arc<FoundLens> {
    let lens = other(number);
    let design = ParetoPoint {
        lens: Lens::clone(&lens),
        weight: None,
        min_light: None,
        spot: 0.5 * merit,
        spot_error: 1e-6,
        as_built: None,
        light: 90.0,
        light_error: 1e-3,
        has_light: true,
        rays: 900,
    };
    let judged = Some(ScoredLens { lens: Arc::clone(&lens), score: Ok(design) });
    Arc::new(FoundLens { number, merit, elements: 6, lens, score: judged })
}

fn node(number: u64, kind: Option<MutationKind>) -> Arc<LineageNode<Arc<Lens>>> {
    Arc::new(LineageNode {
        number,
        parent: number.checked_sub(1),
        chain: 0,
        kind,
        mutation: if number == 0 {
            StructureChange::Start.into()
        } else {
            StructureChange::Split { surface: SurfaceNumber::new(2) }.into()
        },
        loss_before: kind.map(|_| 0.05),
        start_loss: 0.08,
        best_loss: 0.02,
        moves: 17,
        gradients: 340,
        end: Some(DescentEnd::Regeneration),
        offer: Some(OfferOutcome::Entered),
        point: other(number),
    })
}

/// Glass that is thinner at its rim than it may be.
fn thin(value: f64) -> ConstraintMargin {
    ConstraintMargin {
        term: "glass_edge",
        surface: Some(2),
        field: None,
        zoom: 0,
        um: None,
        value,
        min: Some(0.8),
        max: None,
    }
}

/// A request for a search by some method.
fn request_for(method: SearchMethod) -> StructureSearchRequest {
    let mut request = StructureSearchRequest::default();
    request.plan.settings.method = method;
    request
}

/// A search from the double Gauss that has found two lenses, and stands somehow.
fn searching(standing: RunStatus) -> SessionView {
    let mut view = view();
    let mut history = SearchHistory::default();
    for round in 0..30_u32 {
        let merit = 0.1 / f64::from(round + 1);
        let chains = vec![Some((2.0 * merit, 6)), None];
        history.moments.push(HistorySample { round: round.into(), best: merit, chains });
    }
    let kind = Some(MutationKind::AddSinglet);
    history.marks.push(DescentMark {
        round: 9,
        number: 1,
        chain: 0,
        kind,
        merit: 0.08,
        entered: true,
    });
    let mut statistics =
        SearchStatistics { moves: 60, gradients: 1200, ..SearchStatistics::default() };
    let refused = [(Refusal::NoAirGap, 3)].into();
    let tally = MutationStatistics {
        tried: 5,
        refused,
        ended: 2,
        improved: 1,
        moves: 34,
        ..MutationStatistics::default()
    };
    statistics.kinds.insert(MutationKind::AddSinglet, tally);
    let run = StructureSearchSnapshot {
        request: Arc::new(request_for(SearchMethod::Restore)),
        start: found(0, 0.1),
        best: found(1, 0.02),
        reservoir: vec![found(1, 0.02), found(0, 0.1)],
        pinned: None,
        chains: vec![Some(other(1)), None],
        statistics,
        temperature: Temperature::new(0.15).unwrap(),
        weights: MutationWeights::default(),
        history: Arc::new(history),
        lineage: vec![node(0, None), node(1, kind)],
        end_reason: None,
        seconds: 12.0,
        gradients: 1200,
        rays: 300,
        start_violations: vec![thin(0.2), thin(0.3)],
        best_violations: vec![thin(0.79)],
        checkpoint: CheckpointStatus {
            path: Some("a/b.json".into()),
            moves: Some(50),
            ..CheckpointStatus::default()
        },
    };
    view.design_score = Some(Arc::new(run.start.score.clone().unwrap()));
    view.structure_search.run = RunView {
        id: Some(RunId { kind: RunKind::StructureSearch, number: 1 }),
        status: standing,
        error: None,
        snapshot: Some(Arc::new(run)),
    };
    view
}

#[test]
fn a_search_is_requested_with_the_settings_of_the_panel() {
    let mut harness = panel(view());
    harness.get_by_label_contains("Which lens of another structure is better?");
    press(&mut harness, "Paraxial projection");
    press(&mut harness, "of this lens");
    press(&mut harness, "Open them up to");
    press(&mut harness, "minutes");
    press(&mut harness, "Search");
    let quest = started(&harness);
    assert_eq!(quest.plan.settings.method, SearchMethod::IteratedLocalSearch);
    assert!(!quest.plan.rules.projection && !quest.free);
    assert!(quest.open.is_some() && quest.minutes.is_some());
    assert!(quest.plan.settings.gradients.is_none(), "nothing but a person ends it");
    let glasses = &quest.plan.rules.glasses;
    assert!(glasses.len() > 1 && glasses.iter().all(|name| name.contains(' ')), "{glasses:?}");
}

#[test]
fn each_field_may_keep_its_own_share_of_light() {
    let mut harness = panel(view());
    assert!(harness.query_by_label("Least light").is_some());
    press(&mut harness, "each field separately");
    assert!(harness.query_by_label("Least light").is_none());
    let fields = double_gauss().fields.values.len();
    assert_eq!(harness.query_all_by_label_contains("Least light at ").count(), fields);
    press(&mut harness, "Search");
    assert_eq!(started(&harness).plan.light, vec![1.0; fields]);

    let mut harness = panel(view());
    press(&mut harness, "each field separately");
    harness.state_mut().view = view_of(Lens { fields: one_field(), ..double_gauss() });
    harness.run();
    press(&mut harness, "Search");
    assert_eq!(started(&harness).plan.light, [1.0], "another lens, other fields");
}

/// The axis alone.
fn one_field() -> Fields {
    let mut fields = double_gauss().fields;
    fields.values.truncate(1);
    fields
}

#[test]
fn search_settings_are_labelled() {
    let mut harness = panel(view());
    for (part, fields) in [
        ("Manufacturing limits", ["Least glass on the axis", "Steepness", "set"].as_slice()),
        ("Weights of the mutations", &["Weight of glue at the start"]),
        ("Descents and retained lenses", &["Retained lenses", "Error of spots"]),
    ] {
        press(&mut harness, part);
        for field in fields {
            assert!(harness.query_all_by_label(field).count() > 0, "{field}");
        }
        press(&mut harness, part);
    }
}

/// Settings that a method does not depend on are not shown.
#[test]
fn settings_follow_the_method() {
    let mut harness = panel(view());
    press(&mut harness, "Descents and retained lenses");
    let shown = |harness: &Harness<'_, PanelState<SearchPanel>>| {
        [
            "C",
            "Longest descent",
            "several of each pattern",
            "one of each pattern",
            "Steps per move",
            "Weights of the mutations",
        ]
        .map(|name| harness.query_all_by_label(name).count() > 0)
    };
    assert_eq!(shown(&harness), [false, false, true, false, true, true]);
    for (method, expected) in [
        ("RESTORE", [true, true, false, true, true, true]),
        ("Metropolis-Hastings", [false, true, false, true, false, true]),
        ("Brute force", [false, false, false, true, true, false]),
    ] {
        press(&mut harness, "Search method");
        press(&mut harness, method);
        assert_eq!(shown(&harness), expected, "{method}");
    }
}

#[test]
fn a_method_without_a_temperature_shows_none() {
    let mut view = searching(RunStatus::Running);
    assert!(panel(view.clone()).query_by_label("Reheat").is_some());
    let run = Arc::make_mut(view.structure_search.run.snapshot.as_mut().unwrap());
    run.request = Arc::new(request_for(SearchMethod::IteratedLocalSearch));
    let harness = panel(view);
    assert!(harness.query_by_label("Reheat").is_none());
    assert!(harness.query_by_label("Temperature").is_none());
}

#[test]
fn a_search_can_be_paused_stopped_saved_and_dismissed() {
    let cases = [
        (RunStatus::Running, "Pause", StructureSearchCommand::Pause),
        (RunStatus::Paused, "Resume", StructureSearchCommand::Resume),
        (RunStatus::Running, "Stop", StructureSearchCommand::Stop),
        (RunStatus::Finished, "Clear", StructureSearchCommand::Clear),
        (RunStatus::Running, "Reheat", StructureSearchCommand::Control(SteerCommand::Reheat)),
        (RunStatus::Running, "Preview the search", StructureSearchCommand::Preview(Some(0))),
    ];
    for (standing, button, explore) in cases {
        let mut harness = panel(searching(standing));
        press(&mut harness, button);
        assert_eq!(asked(&harness), [explore], "{button}");
    }
    for (status, button, request) in [
        (RunStatus::Running, "Save to…", FileRequest::SaveSearch),
        (RunStatus::Stopped, "Open…", FileRequest::OpenSearch),
    ] {
        let mut harness = panel(searching(status));
        press(&mut harness, button);
        assert_eq!(harness.state().requests, [request], "{button}");
    }
    let mut harness = panel(searching(RunStatus::Running));
    press(&mut harness, "Search");
    assert_eq!(asked(&harness), [], "one at a time");
    harness.get_by_label_contains("merit 0.1 to 0.02");
    harness.get_by_label_contains("60 moves, 1200 gradients of 300 rays, 100 gradients/s (10 ms");
    harness.get_by_label("Saved up to move 50 to b.json");
    harness.get_by_label_contains("The start breaks 2 limits of this search");
    harness.get_by_label_contains("The best lens breaks 1 limit of this search");
    harness.get_by_label_contains("Merit against iterations: 30 moments, 1 descents");
    harness.get_by_label("Elements of chain 1 against iterations: 6 now");
}

/// A lens that keeps its merit function can break the limits of a search: it is said which, whose they are,
/// and they can be loosened for the next one.
#[test]
fn broken_limits_are_named_and_can_be_allowed() {
    let mut view = searching(RunStatus::Stopped);
    let mut run =
        StructureSearchSnapshot::clone(view.structure_search.run.snapshot.as_ref().unwrap());
    let dark = |field: usize, value: f64| ConstraintMargin {
        term: "light",
        surface: Some(field),
        um: Some(0.5876),
        value,
        min: Some(80.0),
        ..thin(0.0)
    };
    run.start_violations = vec![thin(0.2), thin(0.3), dark(0, 72.0), dark(2, 60.0)];
    view.structure_search.run.snapshot = Some(Arc::new(run));
    let mut harness = panel(view);
    press(&mut harness, "The start breaks 4 limits of this search");
    harness.get_by_label_contains(
        "glass edge, surface 3: 0.2000 instead of at least 0.8000 (limit of Setup)",
    );
    harness
        .get_by_label_contains("light at 24°, 588 nm: 60 mm² instead of at least 80, and 1 more");
    harness.get_by_label_contains("the optimizer keeps those of the merit function alone");
    press(&mut harness, "Allow what the start has");
    press(&mut harness, "Search");
    let quest = started(&harness);
    assert_eq!((quest.plan.rules.glass_edge, quest.plan.light), (0.2, vec![0.75]));
}

#[test]
fn a_followed_search_says_who_runs_it_and_goes_on_here_when_asked() {
    let mut view = searching(RunStatus::Running);
    let run = Arc::make_mut(view.structure_search.run.snapshot.as_mut().unwrap());
    run.checkpoint.is_followed = true;
    let mut harness = panel(view);
    harness.get_by_label("Followed, not run here: b.json has it up to move 50");
    press(&mut harness, "Resume here");
    assert_eq!(asked(&harness), [StructureSearchCommand::ResumeFrom("a/b.json".into())]);
}

#[test]
fn a_retained_lens_is_compared_pinned_accepted_and_exported() {
    let mut harness = panel(searching(RunStatus::Running));
    harness.get_by_label_contains("Click a lens or a mark");
    harness.get_by_label_contains("Lens 1: 10 µm, 90 mm², 6 elements").click();
    harness.run();
    let lens = Box::new(Lens::clone(&other(1)));
    let choose = StructureSearchCommand::Choose { number: 1, lens: lens.clone() };
    let preview = Command::Preview(Some(lens));
    assert_eq!(harness.state().commands, [choose.clone().into(), preview]);
    harness.get_by_label_contains(
        "Lens 1: RMS over the fields 50 to 10 µm (-80 %), light 90 to 90 mm² (0 %)",
    );
    for button in ["Pin", "Accept", "Export…"] {
        press(&mut harness, button);
    }
    let pin = StructureSearchCommand::Control(SteerCommand::Pin(1));
    assert_eq!(asked(&harness), [choose.clone(), pin, StructureSearchCommand::Accept(1)]);
    assert_eq!(harness.state().requests, [FileRequest::ExportSearchLens(1)]);
    press(&mut harness, "Show the design");
    assert_eq!(harness.state().commands.last(), Some(&Command::Preview(None)));

    let mut pinned = searching(RunStatus::Running);
    let mut run =
        StructureSearchSnapshot::clone(pinned.structure_search.run.snapshot.as_ref().unwrap());
    run.pinned = Some(1);
    pinned.structure_search.run.snapshot = Some(Arc::new(run));
    let mut harness = panel(pinned);
    harness.get_by_label_contains("Lens 1, pinned: 10 µm").click();
    harness.run();
    press(&mut harness, "Unpin");
    assert_eq!(asked(&harness), [choose, StructureSearchCommand::Control(SteerCommand::Unpin)]);
}

#[test]
fn retained_lenses_are_sorted_by_a_number() {
    let mut view = searching(RunStatus::Stopped);
    let run = Arc::make_mut(view.structure_search.run.snapshot.as_mut().unwrap());
    let bright = Arc::make_mut(&mut run.reservoir[1]);
    bright.score.as_mut().unwrap().score.as_mut().unwrap().light = 120.0;
    let mut harness = panel(view);
    let first = |harness: &Harness<'_, PanelState<SearchPanel>>| {
        let cards = harness.get_all_by_label_contains(" elements, ");
        let place = |rect: egui::Rect| (rect.top(), rect.left());
        let order = |a: &egui::Rect, b: &egui::Rect| place(*a).partial_cmp(&place(*b)).unwrap();
        let cards = cards.map(|card| (card.rect(), card.accesskit_node().label().unwrap()));
        cards.min_by(|a, b| order(&a.0, &b.0)).unwrap().1
    };
    let by_merit = first(&harness);
    harness.get_by_label("Order of the lenses").click();
    harness.run();
    press(&mut harness, "By light");
    assert_ne!(first(&harness), by_merit);
}

#[test]
fn moves_are_counted_with_reasons() {
    let mut harness = panel(searching(RunStatus::Running));
    press(&mut harness, "Statistics");
    harness.get_by_label("Weight of add singlet");
    harness.get_by_label("1 of 2");
    harness.get_by_label("17");
    harness.get_by_label_contains(
        "Add singlet, 3 × refused: no air gap that the rules allow to change",
    );
}

#[test]
fn the_family_page_shows_the_lineage_of_a_lens() {
    let mut harness = panel(searching(RunStatus::Stopped));
    press(&mut harness, "Family");
    harness.get_by_label("Family tree of 2 generations");
    harness.get_by_label("add singlet: split the cemented surface 3");
    harness.get_by_label("the start");
    harness.get_by_label_contains(
        "merit 0.05 before, 0.08 after the mutation, 0.02 after the descent",
    );
    let fates = harness
        .get_all_by_label_contains("17 moves, 340 gradients in chain 1: ended at random (restart)");
    assert_eq!(fates.count(), 2);
    press(&mut harness, "Show lens 0");
    let lens = Box::new(Lens::clone(&other(0)));
    let choose = StructureSearchCommand::Choose { number: 0, lens: lens.clone() };
    assert_eq!(harness.state().commands, [choose.into(), Command::Preview(Some(lens))]);
}

#[test]
fn without_a_search_the_panel_names_what_is_missing() {
    let mut failed = view();
    failed.structure_search.run.error = Some("surface 3 is steeper than a hemisphere".to_owned());
    panel(failed).get_by_label("Surface 3 is steeper than a hemisphere");

    let mut left = view();
    let path = PathBuf::from("folder/Nikkor_1.search.json");
    left.structure_search.unfinished = Some(path.clone());
    let mut harness = panel(left);
    harness.get_by_label("Nikkor_1");
    press(&mut harness, "Resume");
    press(&mut harness, "Dismiss");
    assert_eq!(
        asked(&harness),
        [StructureSearchCommand::ResumeFrom(path), StructureSearchCommand::DismissUnfinished]
    );

    let mut dark = view();
    let mut results = Arc::unwrap_or_clone(dark.results.take().unwrap());
    results.analyses = Err("no beam at surface 3".to_owned());
    dark.results = Some(Arc::new(results));
    let mut harness = panel(dark);
    press(&mut harness, "Search");
    assert_eq!(asked(&harness), []);
    harness.get_by_label("No light gets through this lens");

    let zooms = files::bundled_lenses()
        .iter()
        .map(|bundled| files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens);
    let zoom = zooms.into_iter().find(|lens| lens.zoom_positions() > 1).unwrap();
    panel(view_of(zoom)).get_by_label_contains("A zoom lens");
}

#[test]
fn a_card_that_was_clicked_stays_the_lens_that_was_clicked() {
    let mut view = searching(RunStatus::Running);
    let mut run =
        StructureSearchSnapshot::clone(view.structure_search.run.snapshot.as_ref().unwrap());
    let descending = |merit: f64| {
        let mut lens = Lens::clone(&other(0));
        lens.surfaces[0].thickness += merit;
        let lens = Arc::new(lens);
        Arc::new(FoundLens { lens, score: None, ..FoundLens::clone(&found(0, merit)) })
    };
    run.best = descending(0.01);
    let clicked = Arc::clone(&run.best.lens);
    view.structure_search.run.snapshot = Some(Arc::new(run.clone()));
    let mut harness = panel(view);
    harness.get_by_label_contains("Lens 0: 50 µm");
    harness.get_by_label_contains("Lens 0, best so far: 6 elements, 0.01").click();
    harness.run();
    run.best = descending(0.005);
    harness.state_mut().view.structure_search.run.snapshot = Some(Arc::new(run));
    harness.run();
    press(&mut harness, "Accept");
    let chosen = asked(&harness);
    let [StructureSearchCommand::Choose { number: 0, lens }, StructureSearchCommand::Accept(0)] =
        chosen.as_slice()
    else {
        panic!("{chosen:?}");
    };
    assert_eq!(**lens, *clicked, "neither the start nor the lens of a moment later");
}

#[test]
fn the_line_of_a_lens_is_replayed_from_the_oldest_on() {
    let mut harness = panel(searching(RunStatus::Stopped));
    press(&mut harness, "Family");
    press(&mut harness, "Replay");
    let shown = |harness: &Harness<'_, PanelState<SearchPanel>>| {
        let numbers = harness.state().commands.iter().filter_map(|command| match command {
            Command::StructureSearch(StructureSearchCommand::Choose { number, .. }) => {
                Some(*number)
            }
            _ => None,
        });
        numbers.collect::<Vec<_>>()
    };
    assert_eq!(shown(&harness).first(), Some(&0));
    harness.run_steps(200);
    assert_eq!(shown(&harness), [0, 1]);
    assert!(harness.query_by_label("Replay").is_some(), "it has ended");
}

/// In the default arrangement of a window of 1280 by 800 points a row of cards is visible whole, and
/// the curves have a page of their own with titles.
#[test]
fn a_narrow_panel_shows_whole_cards() {
    let mut harness = small_harness(SearchPanel::default(), searching(RunStatus::Running), LOWER);
    harness.run();
    let cards = harness.get_all_by_label_contains("Lens 1").map(|card| card.rect());
    let card = cards.reduce(|a, b| if a.height() > b.height() { a } else { b }).unwrap();
    assert!(card.height() > 100.0, "{card:?}");
    let bar = harness.get_by_label_contains("Click a lens or a mark").rect();
    assert!(card.bottom() <= bar.top() || card.top() >= bar.bottom(), "{card:?} {bar:?}");
    assert!(card.bottom() <= 392.0 && card.right() <= 414.0, "{card:?}");
    press(&mut harness, "Curves");
    harness.get_by_label_contains("Merit against iterations");
    let texts = painted_texts(&harness);
    for title in ["merit", "iteration", "elements"] {
        assert!(texts.iter().any(|text| text == title), "{title} in {texts:?}");
    }
}
