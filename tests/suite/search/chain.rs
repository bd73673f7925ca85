//! Runs on a rugged landscape: their results, independence of threads, their end, and steering
//! commands.

use super::rugged::{Fault, Rugged, START, Spot};
use aplanat::search::{
    DescentEnd, MutationKind, RunEnd, SearchError, SearchEvent, SearchMethod, SearchRun,
    SearchRunOn, SearchSettings, SteerCommand, Temperature, Termination,
};
use std::collections::BTreeSet;

const METHODS: [SearchMethod; 3] =
    [SearchMethod::Restore, SearchMethod::Metropolis, SearchMethod::BruteForce];

pub(super) fn settings(method: SearchMethod) -> SearchSettings {
    SearchSettings {
        method,
        seed: 7,
        gradients: Some(20_000),
        longest: 60,
        ..SearchSettings::default()
    }
}

fn begin(settings: &SearchSettings) -> SearchRunOn<Rugged> {
    SearchRun::new(&Rugged::default(), START, settings).unwrap()
}

fn rounds(run: &mut SearchRunOn<Rugged>, landscape: &Rugged, count: usize) {
    for _ in 0..count {
        run.round(landscape);
    }
}

/// Runs to the end; none comes later than this.
fn to_the_end(run: &mut SearchRunOn<Rugged>, landscape: &Rugged) -> RunEnd {
    for _ in 0..30_000 {
        if let Some(over) = run.end_reason() {
            return over;
        }
        run.round(landscape);
    }
    panic!("no end after {:?}", run.statistics());
}

#[test]
fn a_search_finds_the_best_structure() {
    for termination in [Termination::Ratio, Termination::Relative, Termination::Clocks] {
        let mut run = begin(&SearchSettings { termination, ..settings(SearchMethod::Restore) });
        let over = to_the_end(&mut run, &Rugged::default());
        assert_eq!(over, RunEnd::Gradients);
        let best = run.best();
        assert!(best.point.elements == 6 && best.loss < 0.06, "{termination:?}: {best:?}");
        assert_eq!(run.reservoir().entries().len(), 5);
        let topologies: BTreeSet<&String> =
            run.reservoir().entries().iter().map(|entry| &entry.topology).collect();
        assert_eq!(topologies.len(), 5);
    }
}

#[test]
fn metropolis_walks_to_better_structures() {
    let mut settings = settings(SearchMethod::Metropolis);
    settings.metropolis.epsilon = 0.1;
    settings.metropolis.mutation = 0.1;
    let mut run = begin(&settings);
    assert_eq!(to_the_end(&mut run, &Rugged::default()), RunEnd::Gradients);
    assert!(run.best().loss < 0.3 * run.start().loss, "{:?}", run.best());
    let statistics = run.statistics();
    assert!(statistics.rejected > 0 && statistics.rejected < statistics.moves / 2);
    assert!(
        statistics.ended[&DescentEnd::Mutation] > 0 && statistics.ended[&DescentEnd::MaxMoves] > 0
    );
}

#[test]
fn brute_force_tries_each_element_once_each_way() {
    let mut run =
        begin(&SearchSettings { gradients: Some(400), ..settings(SearchMethod::BruteForce) });
    assert_eq!(to_the_end(&mut run, &Rugged::default()), RunEnd::Done);
    // Two elements, one more and one less for each, a hundred gradients for each.
    let nodes = &run.lineage().nodes()[1..];
    assert_eq!(nodes.len(), 4);
    for node in nodes {
        assert_eq!((node.gradients, node.end), (100, Some(DescentEnd::Budget)), "{node:?}");
        assert_eq!((node.parent, node.loss_before), (Some(0), Some(run.start().loss)));
    }
    let tried = [MutationKind::AddSinglet, MutationKind::RemoveSinglet]
        .map(|k| run.statistics().kinds[&k].tried);
    assert_eq!(tried, [2, 2]);
    assert_eq!(run.best().point.elements, 3);
    assert!(run.round(&Rugged::default()).is_empty());
}

#[test]
fn results_do_not_depend_on_threads() {
    for method in METHODS {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut run = begin(&settings(method));
            pool.install(|| rounds(&mut run, &Rugged::default(), 150));
            run
        };
        let one = on(1);
        assert!(one.statistics().moves >= 400, "{:?}", one.statistics());
        for threads in [2, 3] {
            assert!(on(threads) == one, "{method:?} on {threads} threads");
        }
    }
}

#[test]
fn chains_and_seeds_matter() {
    let run = |seed, chains| {
        let mut run = begin(&SearchSettings { seed, chains, ..settings(SearchMethod::Restore) });
        rounds(&mut run, &Rugged::default(), 50);
        run.best().clone()
    };
    assert!(run(1, 4) == run(1, 4) && run(1, 4) != run(2, 4) && run(1, 4) != run(1, 3));
}

#[test]
fn the_lineage_lists_every_descent() {
    let mut run = begin(&settings(SearchMethod::Restore));
    let (mut born, mut ended) = (BTreeSet::from([0]), BTreeSet::new());
    let mut best = run.best().loss;
    for _ in 0..200 {
        for event in run.round(&Rugged::default()) {
            match event {
                SearchEvent::Started(number) => assert!(born.insert(number)),
                SearchEvent::Ended(number) => assert!(ended.insert(number)),
                SearchEvent::NewBest(_) => best = f64::NAN,
            }
        }
        assert!(best.is_nan() || best == run.best().loss, "a best that nothing told");
        best = run.best().loss;
    }
    let tree = run.lineage();
    assert_eq!(tree.total(), born.len() as u64);
    for node in tree.nodes() {
        assert_eq!(node.end.is_some(), ended.contains(&node.number));
        assert_eq!(node.offer.is_some(), node.end.is_some() || node.number == 0);
        assert!(node.best_loss <= node.start_loss && node.gradients == 5 * node.moves);
        assert!(node.parent.is_none_or(|parent| parent < node.number));
        let drawn = node.kind == Some(MutationKind::Global) || node.number == 0;
        assert_eq!(node.loss_before.is_none(), drawn);
    }
    let statistics = run.statistics();
    let tallies = statistics.kinds.values();
    let [ends, tried, refused] = tallies.fold([0; 3], |[a, b, c], tally| {
        [a + tally.ended, b + tally.tried, c + tally.refused.values().sum::<u64>()]
    });
    let of_start = u64::from(tree.node(0).is_none_or(|start| start.end.is_some()));
    assert_eq!(ends + of_start, ended.len() as u64);
    assert_eq!(tried - refused, born.len() as u64 - 1);
    assert_eq!(statistics.moves, 800 - 4 * statistics.idle);
}

#[test]
fn a_long_run_stores_few_generations_but_all_ancestors() {
    let settings = SearchSettings {
        remembered: 20,
        moves: Some(8000),
        gradients: None,
        ..settings(SearchMethod::Restore)
    };
    let mut run = begin(&settings);
    assert_eq!(to_the_end(&mut run, &Rugged::default()), RunEnd::Moves);
    let tree = run.lineage();
    assert!(tree.total() > 300, "{}", tree.total());
    let mut kept = BTreeSet::new();
    for entry in run.reservoir().entries() {
        let line: Vec<u64> = tree.ancestry(entry.number).map(|node| node.number).collect();
        let oldest = tree.node(*line.last().unwrap()).unwrap();
        assert!(oldest.parent.is_none(), "the line of {} ends at {oldest:?}", entry.number);
        kept.extend(line);
    }
    assert!(
        tree.nodes().len() <= 2 * 20 + kept.len() + run.chains().len(),
        "{}",
        tree.nodes().len()
    );
}

#[test]
fn a_start_without_finite_loss_is_refused() {
    for (fault, loss) in [(Fault::NotANumber, "NaN"), (Fault::Infinite, "inf")] {
        let refused = SearchRun::new(&Rugged::with(fault), START, &SearchSettings::default());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(loss), "{message}");
    }
}

#[test]
fn descents_to_infinite_loss_end_and_are_rejected() {
    for fault in [Fault::DescentLost, Fault::DescentInfinite] {
        for method in [SearchMethod::Restore, SearchMethod::BruteForce] {
            let landscape = Rugged::with(fault);
            let mut run = SearchRun::new(&landscape, START, &settings(method)).unwrap();
            rounds(&mut run, &landscape, 100);
            assert!(run.best().loss <= run.start().loss);
            assert!(run.statistics().ended[&DescentEnd::InfiniteLoss] > 3);
            assert!(run.reservoir().entries().iter().all(|entry| entry.loss.is_finite()));
            assert!(run.lineage().nodes().iter().all(|node| node.best_loss.is_finite()));
        }
    }
}

#[test]
fn a_search_without_gradients_comes_to_an_end() {
    let landscape = Rugged::with(Fault::WithoutGradient);
    let settings =
        SearchSettings { moves: None, gradients: Some(1000), ..settings(SearchMethod::Restore) };
    let mut run = SearchRun::new(&landscape, START, &settings).unwrap();
    rounds(&mut run, &landscape, 200);
    assert_eq!(run.end_reason(), Some(RunEnd::Stuck));
    assert_eq!(run.statistics().gradients, 0);
}

#[test]
fn a_search_without_mutations_comes_to_an_end() {
    for fault in [Fault::AllRefused, Fault::AllWorthless] {
        let landscape = Rugged::with(fault);
        let settings = SearchSettings { gamma: 0.0, ..settings(SearchMethod::Restore) };
        let mut run = SearchRun::new(&landscape, START, &settings).unwrap();
        assert_eq!(to_the_end(&mut run, &landscape), RunEnd::Stuck, "{fault:?}");
        assert_eq!(run.lineage().total(), 1);
        assert!(run.statistics().kinds[&MutationKind::AddSinglet].refused.len() <= 2);
        let mut brute =
            SearchRun::new(&landscape, START, &self::settings(SearchMethod::BruteForce)).unwrap();
        assert_eq!(to_the_end(&mut brute, &landscape), RunEnd::Done);
    }
}

#[test]
fn every_temperature_gives_finite_densities() {
    for value in [0.0, 1e-300, 1e300, f64::INFINITY] {
        for method in METHODS {
            let temperature = Temperature::new(value);
            let mut run = begin(&SearchSettings { temperature, ..settings(method) });
            rounds(&mut run, &Rugged::default(), 200);
            assert_eq!(run.temperature().value(), value);
            assert!(run.best().loss < run.start().loss, "{method:?} at {value}");
        }
    }
}

#[test]
fn flat_and_huge_losses_stay_finite() {
    for fault in [Fault::Flat, Fault::Huge] {
        for method in METHODS {
            let landscape = Rugged::with(fault);
            let mut run = SearchRun::new(&landscape, START, &settings(method)).unwrap();
            rounds(&mut run, &landscape, 200);
            assert!(run.temperature().value() > 0.0 && run.best().loss.is_finite());
            assert!(run.statistics().moves > 10);
        }
    }
}

#[test]
fn a_reservoir_of_one_and_a_single_chain_work() {
    let one = SearchSettings { reservoir: Some(1), chains: 1, ..settings(SearchMethod::Restore) };
    let mut run = begin(&one);
    to_the_end(&mut run, &Rugged::default());
    assert_eq!(run.reservoir().entries().len(), 1);
    assert_eq!(run.best().point.elements, 6);
}

#[test]
fn invalid_settings_are_refused_by_name() {
    let good = SearchSettings::default();
    let wrong = [
        ("chains", SearchSettings { chains: 0, ..good.clone() }),
        ("reservoir", SearchSettings { reservoir: Some(0), ..good.clone() }),
        ("longest", SearchSettings { longest: 0, ..good.clone() }),
        ("gamma", SearchSettings { gamma: 1.1, ..good.clone() }),
        ("gamma", SearchSettings { gamma: f64::NAN, ..good.clone() }),
        ("c", SearchSettings { c: -0.1, ..good.clone() }),
        ("c", SearchSettings { c: f64::INFINITY, ..good.clone() }),
        ("reheat", SearchSettings { reheat: 0.0, ..good.clone() }),
        ("gradients", SearchSettings { method: SearchMethod::BruteForce, gradients: None, ..good }),
    ];
    for (name, settings) in wrong {
        let error = SearchRun::new(&Rugged::default(), START, &settings).unwrap_err();
        let named = matches!(&error, SearchError::Setting { name: found, .. } if *found == name);
        assert!(named, "{name}: {error}");
    }
    let unknown = serde_json::from_str::<SearchSettings>(r#"{"seed": 1, "heat": 2}"#).unwrap_err();
    assert!(unknown.to_string().contains("heat"), "{unknown}");
}

#[test]
fn regenerations_begin_from_the_pinned_lens() {
    let landscape = Rugged::default();
    let mut run = begin(&settings(SearchMethod::Restore));
    rounds(&mut run, &landscape, 150);
    let pinned = run.lineage().nodes().iter().rev().find(|node| node.end.is_some()).unwrap().number;
    run.steer(&landscape, SteerCommand::Pin(pinned)).unwrap();
    let born = run.lineage().total();
    rounds(&mut run, &landscape, 150);
    let young = |run: &SearchRunOn<Rugged>, from: u64| -> Vec<Option<u64>> {
        let nodes = run.lineage().nodes().iter().filter(|node| node.number >= from);
        nodes.map(|node| node.parent).collect()
    };
    let parents = young(&run, born);
    assert!(parents.len() > 10 && parents.iter().all(|parent| *parent == Some(pinned)));
    run.steer(&landscape, SteerCommand::Unpin).unwrap();
    let born = run.lineage().total();
    rounds(&mut run, &landscape, 150);
    assert!(young(&run, born).iter().any(|parent| *parent != Some(pinned)));
    let error = run.steer(&landscape, SteerCommand::Pin(1_000_000)).unwrap_err();
    assert!(matches!(error, SearchError::UnknownGeneration { number: 1_000_000, .. }));
}

#[test]
fn a_forbidden_kind_is_not_tried() {
    let landscape = Rugged::default();
    let mut run = begin(&SearchSettings { gamma: 0.5, ..settings(SearchMethod::Restore) });
    for kind in [MutationKind::AddSinglet, MutationKind::Global] {
        run.steer(&landscape, SteerCommand::Weight(kind, 0.0)).unwrap();
    }
    rounds(&mut run, &landscape, 100);
    let kinds: Vec<MutationKind> = run.statistics().kinds.keys().copied().collect();
    assert_eq!(kinds, [MutationKind::RemoveSinglet, MutationKind::Bend]);
    let before = run.clone();
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(run.steer(&landscape, SteerCommand::Weight(MutationKind::Bend, weight)).is_err());
    }
    assert!(run == before);
}

#[test]
fn reheat_and_stop_commands_take_effect() {
    let landscape = Rugged::default();
    let mut run = begin(&settings(SearchMethod::Restore));
    let first = run.temperature().value();
    run.steer(&landscape, SteerCommand::Reheat).unwrap();
    assert_eq!(run.temperature().value(), 2.0 * first);
    run.steer(&landscape, SteerCommand::Temperature(Temperature::new(0.0).unwrap())).unwrap();
    run.steer(&landscape, SteerCommand::Reheat).unwrap();
    assert_eq!(run.temperature().value(), 0.0);
    run.steer(&landscape, SteerCommand::Stop).unwrap();
    assert_eq!((run.end_reason(), run.round(&landscape)), (Some(RunEnd::Stopped), Vec::new()));
    run.steer(&landscape, SteerCommand::Resume).unwrap();
    run.round(&landscape);
    assert_eq!(run.statistics().rounds, 1);
}

#[test]
fn the_best_point_of_an_active_descent_can_be_pinned() {
    let landscape = Rugged::default();
    let mut run = begin(&SearchSettings { c: 0.0, ..settings(SearchMethod::Restore) });
    rounds(&mut run, &landscape, 3);
    let (best, loss): (Spot, f64) = {
        let (best, loss) = run.chains()[0].best().unwrap();
        (best.clone(), loss)
    };
    run.steer(&landscape, SteerCommand::Pin(0)).unwrap();
    let pinned = run.pinned().unwrap();
    assert!(pinned.point == best && pinned.loss == loss && loss < run.start().loss);
}

#[test]
fn a_run_admits_what_another_one_has_found() {
    let landscape = Rugged::default();
    let mut other = begin(&settings(SearchMethod::Restore));
    to_the_end(&mut other, &landscape);
    let found = other.best().clone();
    let mut run = begin(&SearchSettings { seed: 8, ..settings(SearchMethod::Restore) });
    rounds(&mut run, &landscape, 3);
    let generations = run.lineage().total();
    assert!(run.admit(&landscape, found.point.clone()).is_accepted());
    assert_eq!((run.best().loss, &run.best().point), (found.loss, &found.point));
    assert_eq!(run.lineage().total(), generations + 1);
    assert!(!run.admit(&landscape, found.point).is_accepted(), "it is there already");
    rounds(&mut run, &landscape, 50);
    assert!(run.best().loss <= found.loss);
    // Nothing is believed: the loss is that of this landscape.
    let before = run.clone();
    let worthless = Rugged::with(Fault::NotANumber);
    assert!(!run.admit(&worthless, Spot { elements: 6, x: 0.0 }).is_accepted());
    assert!(run == before, "what is rejected leaves no trace");
}
