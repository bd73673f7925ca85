//! The panel of the search over structure by what a screen reader calls its parts.

use std::path::PathBuf;
use std::sync::Arc;

use aplanat::files;
use aplanat::lens::{Fields, Lens, Medium};
use aplanat::merit::Margin;
use aplanat::optimize::pareto::Design;
use aplanat::search::{
    Ended, Kind, Method, Node, Offer, Statistics, Steer, Tally, Temperature, Weights,
};
use aplanat::session::{
    Checkpoint, Command, Exploration, Explore, Found, History, Judged, Mark, Moment, Place, Quest,
    Standing, View,
};
use aplanat::studio::panels::StructureSearch;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::bench::{Stand, double_gauss, stand, view, view_of};

fn panel(view: View) -> Harness<'static, Stand<StructureSearch>> {
    let mut harness = stand(StructureSearch::default(), view);
    harness.run();
    harness
}

fn press(harness: &mut Harness<'_, Stand<StructureSearch>>, name: &str) {
    harness.get_by_label(name).click();
    harness.run();
}

/// What was asked of the search.
fn asked(harness: &Harness<'_, Stand<StructureSearch>>) -> Vec<Explore> {
    let wishes = harness.state().wishes.iter();
    let asked = wishes.filter_map(|wish| match wish {
        Command::Explore(explore) => Some(explore.clone()),
        _ => None,
    });
    asked.collect()
}

fn started(harness: &Harness<'_, Stand<StructureSearch>>) -> Quest {
    match asked(harness).as_slice() {
        [Explore::Start(quest)] => Quest::clone(quest),
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

fn found(number: u64, merit: f64) -> Arc<Found> {
    let lens = other(number);
    let design = Design {
        lens: Lens::clone(&lens),
        weight: None,
        spot: 0.5 * merit,
        spot_error: 1e-6,
        light: 90.0,
        light_error: 1e-3,
        lit: true,
        rays: 900,
    };
    let judged = Some(Judged { lens: Arc::clone(&lens), found: Ok(design) });
    Arc::new(Found { number, merit, elements: 6, lens, judged })
}

fn node(number: u64, kind: Option<Kind>) -> Arc<Node<Arc<Lens>>> {
    Arc::new(Node {
        number,
        parent: number.checked_sub(1),
        chain: 0,
        kind,
        what: if number == 0 { "the start" } else { "a plate before surface 2" }.to_owned(),
        before: kind.map(|_| 0.05),
        mutated: 0.08,
        descended: 0.02,
        moves: 17,
        gradients: 340,
        ended: Some(Ended::Clock),
        offer: Some(Offer::Entered),
        point: other(number),
    })
}

/// Glass that is thinner at its rim than it may be.
fn thin(value: f64) -> Margin {
    Margin { term: "glass_edge", surface: Some(2), zoom: 0, value, min: Some(0.8), max: None }
}

/// A search from the double Gauss that has found two lenses, and stands somehow.
fn searching(standing: Standing) -> View {
    let mut view = view();
    let mut history = History::default();
    for round in 0..30_u32 {
        let merit = 0.1 / f64::from(round + 1);
        let chains = vec![Some((2.0 * merit, 6)), None];
        history.moments.push(Moment { round: round.into(), best: merit, chains });
    }
    let kind = Some(Kind::AddSinglet);
    history.marks.push(Mark { round: 9, number: 1, chain: 0, kind, merit: 0.08, entered: true });
    let mut statistics = Statistics { moves: 60, gradients: 1200, ..Statistics::default() };
    let refused = [("no gap is wide enough before surface 2".to_owned(), 3)].into();
    let tally = Tally { tried: 5, refused, ended: 2, improved: 1, moves: 34, ..Tally::default() };
    statistics.kinds.insert(Kind::AddSinglet, tally);
    let place = Place { number: 1, merit: 0.03, elements: 6, lens: other(1) };
    let run = Exploration {
        number: 1,
        standing,
        quest: Arc::default(),
        start: found(0, 0.1),
        best: found(1, 0.02),
        reservoir: vec![found(1, 0.02), found(0, 0.1)],
        pinned: None,
        chains: vec![Some(place), None],
        statistics,
        temperature: Temperature::new(0.15).unwrap(),
        weights: Weights::default(),
        history: Arc::new(history),
        family: vec![node(0, None), node(1, kind)],
        over: None,
        seconds: 12.0,
        gradients: 1200,
        rays: 300,
        start_breaks: vec![thin(0.2), thin(0.3)],
        best_breaks: vec![thin(0.79)],
        checkpoint: Checkpoint { path: Some("a/b.json".into()), moves: Some(50), failed: None },
    };
    view.explorations.here = Some(Arc::new(run.start.judged.clone().unwrap()));
    view.explorations.run = Some(Arc::new(run));
    view
}

#[test]
fn a_search_is_wished_for_as_the_panel_says() {
    let mut harness = panel(view());
    harness.get_by_label_contains("Which lens of another structure is better?");
    press(&mut harness, "Paraxial projection");
    press(&mut harness, "of this lens");
    press(&mut harness, "Open them up to");
    press(&mut harness, "minutes");
    press(&mut harness, "Search");
    let quest = started(&harness);
    assert_eq!(quest.plan.settings.method, Method::Restore);
    assert!(!quest.plan.rules.projection && !quest.free);
    assert!(quest.open.is_some() && quest.minutes.is_some());
    assert!(quest.plan.settings.gradients.is_none(), "nothing but a person ends it");
    let glasses = &quest.plan.rules.glasses;
    assert!(glasses.len() > 1 && glasses.iter().all(|name| name.contains(' ')), "{glasses:?}");
}

#[test]
fn every_field_may_keep_a_share_of_its_own() {
    let mut harness = panel(view());
    assert!(harness.query_by_label("Least light").is_some());
    press(&mut harness, "each field by itself");
    assert!(harness.query_by_label("Least light").is_none());
    let fields = double_gauss().fields.values.len();
    assert_eq!(harness.query_all_by_label_contains("Least light at ").count(), fields);
    press(&mut harness, "Search");
    assert_eq!(started(&harness).plan.light, vec![1.0; fields]);

    let mut harness = panel(view());
    press(&mut harness, "each field by itself");
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
fn limits_weights_and_the_sampler_are_there_by_name() {
    let mut harness = panel(view());
    for (part, fields) in [
        ("What the factory can make", ["Least glass on the axis", "Steepness", "set"].as_slice()),
        ("How often each mutation is tried", &["Weight of glue at the start"]),
        ("How it samples", &["C", "Gamma", "Longest descent", "Lenses kept", "Error of spots"]),
    ] {
        press(&mut harness, part);
        for field in fields {
            assert!(harness.query_all_by_label(field).count() > 0, "{field}");
        }
        press(&mut harness, part);
    }
}

#[test]
fn a_search_can_be_held_ended_saved_and_forgotten() {
    let cases = [
        (Standing::Running, "Pause", Explore::Pause),
        (Standing::Paused, "Resume", Explore::Resume),
        (Standing::Running, "Stop", Explore::Stop),
        (Standing::Running, "Save to…", Explore::SaveTo(None)),
        (Standing::Stopped, "Open…", Explore::GoOn(None)),
        (Standing::Finished, "Clear", Explore::Clear),
        (Standing::Running, "Reheat", Explore::Steer(Steer::Reheat)),
        (Standing::Running, "Follow the search", Explore::Follow(Some(0))),
    ];
    for (standing, button, explore) in cases {
        let mut harness = panel(searching(standing));
        press(&mut harness, button);
        assert_eq!(asked(&harness), [explore], "{button}");
    }
    let mut harness = panel(searching(Standing::Running));
    press(&mut harness, "Search");
    assert_eq!(asked(&harness), [], "one at a time");
    harness.get_by_label_contains("merit 0.1 to 0.02");
    harness.get_by_label_contains("60 moves, 1200 gradients of 300 rays, 100 gradients/s (10 ms");
    harness.get_by_label("Saved up to move 50 to b.json");
    harness.get_by_label_contains("The start breaks 2 limits");
    harness.get_by_label_contains("The best lens breaks 1 limit:");
    harness.get_by_label_contains("Merit against iterations: 30 moments, 1 descents");
    harness.get_by_label("Elements of chain 1 against iterations: 6 now");
}

#[test]
fn a_lens_that_is_kept_is_compared_pinned_taken_and_exported() {
    let mut harness = panel(searching(Standing::Running));
    harness.get_by_label_contains("Click a lens or a mark");
    harness.get_by_label_contains("Lens 1: 10 µm, 90 mm², 6 elements").click();
    harness.run();
    let preview = Command::Preview(Some(Box::new(Lens::clone(&other(1)))));
    assert_eq!(harness.state().wishes, [preview]);
    harness.get_by_label_contains("Lens 1: RMS 50 to 10 µm (-80 %), light 90 to 90 mm² (0 %)");
    for button in ["Pin", "Take", "Export…"] {
        press(&mut harness, button);
    }
    let export = Explore::Export { number: 1, path: None };
    assert_eq!(asked(&harness), [Explore::Steer(Steer::Pin(1)), Explore::Take(1), export]);
    press(&mut harness, "Back to the design");
    assert_eq!(harness.state().wishes.last(), Some(&Command::Preview(None)));

    let mut pinned = searching(Standing::Running);
    let mut run = Exploration::clone(pinned.explorations.run.as_ref().unwrap());
    run.pinned = Some(1);
    pinned.explorations.run = Some(Arc::new(run));
    let mut harness = panel(pinned);
    harness.get_by_label_contains("Lens 1, pinned: 10 µm").click();
    harness.run();
    press(&mut harness, "Unpin");
    assert_eq!(asked(&harness), [Explore::Steer(Steer::Unpin)]);
}

#[test]
fn moves_are_counted_with_reasons() {
    let mut harness = panel(searching(Standing::Running));
    press(&mut harness, "Moves");
    harness.get_by_label("Weight of add singlet");
    harness.get_by_label("1 of 2");
    harness.get_by_label("17");
    harness
        .get_by_label_contains("Add singlet, 3 × refused: no gap is wide enough before surface 3");
}

#[test]
fn every_lens_tells_where_it_came_from() {
    let mut harness = panel(searching(Standing::Stopped));
    press(&mut harness, "Family");
    harness.get_by_label("Family tree of 2 generations");
    harness.get_by_label("add singlet: a plate before surface 3");
    harness.get_by_label("the start");
    harness.get_by_label_contains(
        "merit 0.05 before, 0.08 after the mutation, 0.02 after the descent",
    );
    let fates = harness.get_all_by_label_contains("17 moves, 340 gradients in chain 1: the clock");
    assert_eq!(fates.count(), 2);
    press(&mut harness, "Show lens 0");
    let preview = Command::Preview(Some(Box::new(Lens::clone(&other(0)))));
    assert_eq!(harness.state().wishes, [preview]);
}

#[test]
fn without_a_search_the_panel_says_what_is_missing() {
    let mut failed = view();
    failed.explorations.failed = Some("surface 2 is steeper than a hemisphere".to_owned());
    panel(failed).get_by_label("Surface 3 is steeper than a hemisphere");

    let mut left = view();
    let path = PathBuf::from("folder/Nikkor_1.search.json");
    left.explorations.left = Some(path.clone());
    let mut harness = panel(left);
    harness.get_by_label("Nikkor_1");
    press(&mut harness, "Go on");
    press(&mut harness, "Forget it");
    assert_eq!(asked(&harness), [Explore::GoOn(Some(path)), Explore::ForgetLeft]);

    let mut dark = view();
    let mut results = Arc::unwrap_or_clone(dark.results.take().unwrap());
    results.numbers = Err("no beam at surface 2".to_owned());
    dark.results = Some(Arc::new(results));
    let mut harness = panel(dark);
    press(&mut harness, "Search");
    assert_eq!(asked(&harness), []);
    harness.get_by_label("No light gets through this lens");

    let zooms = files::library()
        .iter()
        .map(|bundled| files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens);
    let zoom = zooms.into_iter().find(|lens| lens.zoom_positions() > 1).unwrap();
    panel(view_of(zoom)).get_by_label_contains("A zoom lens");
}
