//! The panel of glasses: search, order, map, and the replacement of the glass of a surface.

use aplanat::lens::glass;
use aplanat::lens::{Edit, Lens, Medium};
use aplanat::merit::Goal;
use aplanat::session::{Command, SessionView};
use aplanat::studio::panels::GlassPanel;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::sync::Arc;

use crate::harness::{
    PanelState, double_gauss, painted_places, painted_texts, panel_harness, view_of,
};

type Bench = Harness<'static, PanelState<GlassPanel>>;

/// The panel on a lens with a selected surface.
fn bench(lens: Lens, selected: Option<usize>) -> Bench {
    let mut view = view_of(lens);
    view.selected = selected;
    let mut harness = panel_harness(GlassPanel::default(), view);
    harness.run();
    harness
}

fn search(harness: &mut Bench, words: &str) {
    harness.get_by_label("Search the glasses").focus();
    harness.run();
    harness.get_by_label("Search the glasses").type_text(words);
    harness.run();
}

fn press(harness: &mut Bench, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

/// The commands that replace the glass of the first surface as one undo step.
fn replaced_by(name: &str) -> [Command; 2] {
    let medium = Medium::Glass(name.to_owned());
    [Command::Edit(Edit::SetMedium { surface: 0, medium }), Command::CommitEdit]
}

fn says(harness: &Bench, text: &str) -> bool {
    painted_texts(harness).iter().any(|painted| painted.contains(text))
}

#[test]
fn a_glass_that_is_clicked_replaces_that_of_the_surface_in_one_step() {
    let mut harness = bench(double_gauss(), Some(0));
    search(&mut harness, "schott n-sf11");
    assert!(says(&harness, "1 glass"));
    press(&mut harness, "SCHOTT N-SF11");
    assert_eq!(harness.state().commands, replaced_by("SCHOTT N-SF11"));
}

#[test]
fn listed_glasses_are_exchanged_by_an_optimization() {
    let mut lens = double_gauss();
    let button = "Optimize with these";
    let goal = Arc::new(Goal::default_for(&lens).unwrap());
    let with_goal = |lens: Lens| {
        let view = SessionView { goal: Some(Arc::clone(&goal)), ..view_of(lens) };
        let mut harness = panel_harness(GlassPanel::default(), view);
        harness.run();
        harness
    };
    let mut harness = with_goal(lens.clone());
    search(&mut harness, "ohara lead=no");
    press(&mut harness, button);
    let [Command::Optimize { glasses: Some(words), .. }] = &harness.state().commands[..] else {
        panic!("{:?}", harness.state().commands);
    };
    assert_eq!(words, "ohara lead=no");
    // Without variables the lens could not follow another glass.
    lens.variables.clear();
    let mut harness = with_goal(lens);
    press(&mut harness, button);
    assert!(harness.state().commands.is_empty());
}

#[test]
fn a_click_without_a_surface_of_glass_says_what_is_needed() {
    let air = double_gauss().surfaces.iter().position(|row| row.medium == Medium::Air).unwrap();
    for (selected, why) in [(None, "Choose a surface with glass"), (Some(air), "has air")] {
        let mut harness = bench(double_gauss(), selected);
        search(&mut harness, "schott n-sf11");
        press(&mut harness, "SCHOTT N-SF11");
        assert!(says(&harness, why), "{:?}", painted_texts(&harness));
        assert_eq!(harness.state().commands, []);
    }
    let mut harness = bench(double_gauss(), None);
    press(&mut harness, "Surface whose glass is replaced");
    harness.get_by_label_contains("1  ").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::Select(Some(0))]);
}

#[test]
fn titles_sort_the_table_and_a_search_that_is_none_is_refused() {
    let mut harness = bench(double_gauss(), Some(0));
    search(&mut harness, "schott n-sf");
    let is_above = |harness: &Bench, names: [&str; 2]| {
        let [a, b] = names.map(|name| harness.get_by_label(name).rect().top());
        a < b
    };
    // Abbe numbers 25.68 and 32.25.
    let names = ["SCHOTT N-SF11", "SCHOTT N-SF5"];
    press(&mut harness, "Sort by vd");
    assert!(is_above(&harness, names));
    press(&mut harness, "Sort by vd");
    assert!(!is_above(&harness, names));
    search(&mut harness, " nd=high");
    assert!(says(&harness, "Found the range `high`; expected"));
}

#[test]
fn a_model_glass_is_replaced_by_the_nearest_glass() {
    let mut lens = double_gauss();
    lens.surfaces[0].medium = Medium::Model { nd: 1.5168, vd: 64.17 };
    let mut harness = bench(lens, Some(0));
    search(&mut harness, "schott");
    press(&mut harness, "Replace by the nearest glass, SCHOTT N-BK7");
    assert_eq!(harness.state().commands, replaced_by("SCHOTT N-BK7"));
    press(&mut harness, "Nearest first");
    let top = |name: &str| harness.get_by_label(name).rect().top();
    assert!(top("SCHOTT N-BK7") < top("SCHOTT N-K5"));
}

#[test]
fn a_glass_is_named_on_the_map_and_replaces_by_a_click() {
    let mut harness = bench(double_gauss(), Some(0));
    search(&mut harness, "schott n-lak8");
    let lak = glass::find("SCHOTT N-LAK8").unwrap();
    let map = harness.get_by_label("Map of glasses, nd over vd: 1").rect();
    // The numbers at the axes take about 45 and 35 points; Abbe numbers grow to the left.
    let [left, bottom] = [map.left() + 45.0, map.bottom() - 35.0];
    let share = [(100.0 - lak.vd) / 85.0, (lak.nd - 1.4) / 0.75].map(|share| share as f32);
    let guess = egui::pos2(
        left + share[0] * (map.right() - left),
        bottom - share[1] * (bottom - map.top()),
    );
    let around = (0..49).map(|i| egui::vec2((i % 7 - 3) as f32, (i / 7 - 3) as f32) * 9.0);
    for by in around {
        harness.hover_at(guess + by);
        harness.run();
        if says(&harness, "SCHOTT N-LAK8\n") {
            harness.drag_at(guess + by);
            harness.drop_at(guess + by);
            harness.run();
            break;
        }
    }
    assert_eq!(harness.state().commands, replaced_by("SCHOTT N-LAK8"));
    press(&mut harness, "Axes of the map");
    press(&mut harness, "PgF over vd");
    harness.get_by_label("Map of glasses, PgF over vd: 1");
}

/// The numbers of surfaces stand beside the marks of their glasses, and glasses near each other have both
/// names readable.
#[test]
fn the_labels_of_near_glasses_do_not_overlap() {
    let mut lens = double_gauss();
    // Two more glasses beside those of the lens, in places where labels on fixed sides would meet.
    for (surface, nd, vd) in [(0, 1.5725, 57.3), (2, 1.5737, 57.0)] {
        lens.surfaces[surface].medium = Medium::Model { nd, vd };
    }
    let harness = bench(lens, None);
    let all = painted_places(&harness);
    let labels = ["1", "3", "4, 7", "8, 10"];
    let place = |label: &str| {
        let mut found =
            all.iter().filter(|(text, _)| text.trim() == label).map(|(_, place)| *place);
        // The names of surfaces stand elsewhere, too; the map is at the right.
        found.next_back().unwrap_or_else(|| panic!("{label}: {all:?}"))
    };
    let places = labels.map(place);
    for (i, one) in places.iter().enumerate() {
        assert!(places[..i].iter().all(|other| !one.intersects(*other)), "{places:?}");
    }
}
