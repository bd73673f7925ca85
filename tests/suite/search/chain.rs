//! Runs on a rugged landscape: what they find, that threads do not matter, that nothing stops them
//! but what should, and a hand on them.

use super::rugged::{Fault, Rugged, START, Spot};
use aplanat::search::{
    Ended, Event, Kind, Method, Over, Run, RunOf, SearchError, Settings, Steer, Temperature,
    Termination,
};
use std::collections::BTreeSet;

const METHODS: [Method; 3] = [Method::Restore, Method::Metropolis, Method::Brute];

pub(super) fn settings(method: Method) -> Settings {
    Settings { method, seed: 7, gradients: Some(20_000), longest: 60, ..Settings::default() }
}

fn begin(settings: &Settings) -> RunOf<Rugged> {
    Run::new(&Rugged::default(), START, settings).unwrap()
}

fn rounds(run: &mut RunOf<Rugged>, landscape: &Rugged, count: usize) {
    for _ in 0..count {
        run.round(landscape);
    }
}

/// Runs to the end; none comes later than this.
fn to_the_end(run: &mut RunOf<Rugged>, landscape: &Rugged) -> Over {
    for _ in 0..30_000 {
        if let Some(over) = run.over() {
            return over;
        }
        run.round(landscape);
    }
    panic!("no end after {:?}", run.statistics());
}

#[test]
fn a_search_finds_the_best_structure() {
    for termination in [Termination::Ratio, Termination::Relative, Termination::Clocks] {
        let mut run = begin(&Settings { termination, ..settings(Method::Restore) });
        let over = to_the_end(&mut run, &Rugged::default());
        assert_eq!(over, Over::Gradients);
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
    let mut settings = settings(Method::Metropolis);
    settings.metropolis.epsilon = 0.1;
    settings.metropolis.mutation = 0.1;
    let mut run = begin(&settings);
    assert_eq!(to_the_end(&mut run, &Rugged::default()), Over::Gradients);
    assert!(run.best().loss < 0.3 * run.start().loss, "{:?}", run.best());
    let statistics = run.statistics();
    assert!(statistics.rejected > 0 && statistics.rejected < statistics.moves / 2);
    assert!(statistics.ended[&Ended::Mutated] > 0 && statistics.ended[&Ended::Longest] > 0);
}

#[test]
fn brute_force_tries_each_element_once_each_way() {
    let mut run = begin(&Settings { gradients: Some(400), ..settings(Method::Brute) });
    assert_eq!(to_the_end(&mut run, &Rugged::default()), Over::Done);
    // Two elements, one more and one less for each, a hundred gradients for each.
    let nodes = &run.tree().nodes()[1..];
    assert_eq!(nodes.len(), 4);
    for node in nodes {
        assert_eq!((node.gradients, node.ended), (100, Some(Ended::Budget)), "{node:?}");
        assert_eq!((node.parent, node.before), (Some(0), Some(run.start().loss)));
    }
    let tried = [Kind::AddSinglet, Kind::RemoveSinglet].map(|k| run.statistics().kinds[&k].tried);
    assert_eq!(tried, [2, 2]);
    assert_eq!(run.best().point.elements, 3);
    assert!(run.round(&Rugged::default()).is_empty());
}

#[test]
fn threads_do_not_matter() {
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
        let mut run = begin(&Settings { seed, chains, ..settings(Method::Restore) });
        rounds(&mut run, &Rugged::default(), 50);
        run.best().clone()
    };
    assert!(run(1, 4) == run(1, 4) && run(1, 4) != run(2, 4) && run(1, 4) != run(1, 3));
}

#[test]
fn the_tree_tells_every_descent() {
    let mut run = begin(&settings(Method::Restore));
    let (mut born, mut ended) = (BTreeSet::from([0]), BTreeSet::new());
    let mut best = run.best().loss;
    for _ in 0..200 {
        for event in run.round(&Rugged::default()) {
            match event {
                Event::Born(number) => assert!(born.insert(number)),
                Event::Ended(number) => assert!(ended.insert(number)),
                Event::Best(_) => best = f64::NAN,
            }
        }
        assert!(best.is_nan() || best == run.best().loss, "a best that nothing told");
        best = run.best().loss;
    }
    let tree = run.tree();
    assert_eq!(tree.born(), born.len() as u64);
    for node in tree.nodes() {
        assert_eq!(node.ended.is_some(), ended.contains(&node.number));
        assert_eq!(node.offer.is_some(), node.ended.is_some() || node.number == 0);
        assert!(node.descended <= node.mutated && node.gradients == 5 * node.moves);
        assert!(node.parent.is_none_or(|parent| parent < node.number));
        let drawn = node.kind == Some(Kind::Global) || node.number == 0;
        assert_eq!(node.before.is_none(), drawn);
    }
    let statistics = run.statistics();
    let tallies = statistics.kinds.values();
    let [ends, tried, refused] = tallies.fold([0; 3], |[a, b, c], tally| {
        [a + tally.ended, b + tally.tried, c + tally.refused.values().sum::<u64>()]
    });
    let of_start = u64::from(tree.node(0).is_none_or(|start| start.ended.is_some()));
    assert_eq!(ends + of_start, ended.len() as u64);
    assert_eq!(tried - refused, born.len() as u64 - 1);
    assert_eq!(statistics.moves, 800 - 4 * statistics.idle);
}

#[test]
fn a_long_run_remembers_little_but_all_ancestors() {
    let settings = Settings {
        remembered: 20,
        moves: Some(8000),
        gradients: None,
        ..settings(Method::Restore)
    };
    let mut run = begin(&settings);
    assert_eq!(to_the_end(&mut run, &Rugged::default()), Over::Moves);
    let tree = run.tree();
    assert!(tree.born() > 300, "{}", tree.born());
    let mut kept = BTreeSet::new();
    for entry in run.reservoir().entries() {
        let line: Vec<u64> = tree.line(entry.number).map(|node| node.number).collect();
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
fn a_start_that_is_worth_nothing_is_refused() {
    for (fault, loss) in [(Fault::NotANumber, "NaN"), (Fault::Infinite, "inf")] {
        let refused = Run::new(&Rugged::with(fault), START, &Settings::default());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(loss), "{message}");
    }
}

#[test]
fn descents_into_nothing_end_and_are_not_taken() {
    for fault in [Fault::DescentLost, Fault::DescentInfinite] {
        for method in [Method::Restore, Method::Brute] {
            let landscape = Rugged::with(fault);
            let mut run = Run::new(&landscape, START, &settings(method)).unwrap();
            rounds(&mut run, &landscape, 100);
            assert!(run.best().loss <= run.start().loss);
            assert!(run.statistics().ended[&Ended::Lost] > 3);
            assert!(run.reservoir().entries().iter().all(|entry| entry.loss.is_finite()));
            assert!(run.tree().nodes().iter().all(|node| node.descended.is_finite()));
        }
    }
}

#[test]
fn a_search_without_mutations_comes_to_an_end() {
    for fault in [Fault::AllRefused, Fault::AllWorthless] {
        let landscape = Rugged::with(fault);
        let settings = Settings { gamma: 0.0, ..settings(Method::Restore) };
        let mut run = Run::new(&landscape, START, &settings).unwrap();
        assert_eq!(to_the_end(&mut run, &landscape), Over::Stuck, "{fault:?}");
        assert_eq!(run.tree().born(), 1);
        assert!(run.statistics().kinds[&Kind::AddSinglet].refused.len() <= 2);
        let mut brute = Run::new(&landscape, START, &self::settings(Method::Brute)).unwrap();
        assert_eq!(to_the_end(&mut brute, &landscape), Over::Done);
    }
}

#[test]
fn every_temperature_is_sound() {
    for value in [0.0, 1e-300, 1e300, f64::INFINITY] {
        for method in METHODS {
            let temperature = Temperature::new(value);
            let mut run = begin(&Settings { temperature, ..settings(method) });
            rounds(&mut run, &Rugged::default(), 200);
            assert_eq!(run.temperature().value(), value);
            assert!(run.best().loss < run.start().loss, "{method:?} at {value}");
        }
    }
}

#[test]
fn flat_and_huge_losses_are_sound() {
    for fault in [Fault::Flat, Fault::Huge] {
        for method in METHODS {
            let landscape = Rugged::with(fault);
            let mut run = Run::new(&landscape, START, &settings(method)).unwrap();
            rounds(&mut run, &landscape, 200);
            assert!(run.temperature().value() > 0.0 && run.best().loss.is_finite());
            assert!(run.statistics().moves > 10);
        }
    }
}

#[test]
fn a_reservoir_and_a_chain_of_one_search_too() {
    let one = Settings { reservoir: 1, chains: 1, ..settings(Method::Restore) };
    let mut run = begin(&one);
    to_the_end(&mut run, &Rugged::default());
    assert_eq!(run.reservoir().entries().len(), 1);
    assert_eq!(run.best().point.elements, 6);
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name() {
    let good = Settings::default();
    let wrong = [
        ("chains", Settings { chains: 0, ..good.clone() }),
        ("reservoir", Settings { reservoir: 0, ..good.clone() }),
        ("longest", Settings { longest: 0, ..good.clone() }),
        ("gamma", Settings { gamma: 1.1, ..good.clone() }),
        ("gamma", Settings { gamma: f64::NAN, ..good.clone() }),
        ("c", Settings { c: -0.1, ..good.clone() }),
        ("c", Settings { c: f64::INFINITY, ..good.clone() }),
        ("reheat", Settings { reheat: 0.0, ..good.clone() }),
        ("gradients", Settings { method: Method::Brute, gradients: None, ..good }),
    ];
    for (name, settings) in wrong {
        let error = Run::new(&Rugged::default(), START, &settings).unwrap_err();
        let named = matches!(&error, SearchError::Setting { name: found, .. } if *found == name);
        assert!(named, "{name}: {error}");
    }
    let unknown = serde_json::from_str::<Settings>(r#"{"seed": 1, "heat": 2}"#).unwrap_err();
    assert!(unknown.to_string().contains("heat"), "{unknown}");
}

#[test]
fn a_pinned_branch_is_what_regenerations_begin_from() {
    let landscape = Rugged::default();
    let mut run = begin(&settings(Method::Restore));
    rounds(&mut run, &landscape, 150);
    let pinned = run.tree().nodes().iter().rev().find(|node| node.ended.is_some()).unwrap().number;
    run.steer(&landscape, Steer::Pin(pinned)).unwrap();
    let born = run.tree().born();
    rounds(&mut run, &landscape, 150);
    let young = |run: &RunOf<Rugged>, from: u64| -> Vec<Option<u64>> {
        let nodes = run.tree().nodes().iter().filter(|node| node.number >= from);
        nodes.map(|node| node.parent).collect()
    };
    let parents = young(&run, born);
    assert!(parents.len() > 10 && parents.iter().all(|parent| *parent == Some(pinned)));
    run.steer(&landscape, Steer::Unpin).unwrap();
    let born = run.tree().born();
    rounds(&mut run, &landscape, 150);
    assert!(young(&run, born).iter().any(|parent| *parent != Some(pinned)));
    let error = run.steer(&landscape, Steer::Pin(1_000_000)).unwrap_err();
    assert!(matches!(error, SearchError::Forgotten { number: 1_000_000, .. }));
}

#[test]
fn a_forbidden_kind_is_not_tried() {
    let landscape = Rugged::default();
    let mut run = begin(&Settings { gamma: 0.5, ..settings(Method::Restore) });
    for kind in [Kind::AddSinglet, Kind::Global] {
        run.steer(&landscape, Steer::Weight(kind, 0.0)).unwrap();
    }
    rounds(&mut run, &landscape, 100);
    let kinds: Vec<Kind> = run.statistics().kinds.keys().copied().collect();
    assert_eq!(kinds, [Kind::RemoveSinglet, Kind::Bend]);
    let before = run.clone();
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(run.steer(&landscape, Steer::Weight(Kind::Bend, weight)).is_err());
    }
    assert!(run == before);
}

#[test]
fn heat_and_stop_are_obeyed() {
    let landscape = Rugged::default();
    let mut run = begin(&settings(Method::Restore));
    let first = run.temperature().value();
    run.steer(&landscape, Steer::Reheat).unwrap();
    assert_eq!(run.temperature().value(), 2.0 * first);
    run.steer(&landscape, Steer::Temperature(Temperature::new(0.0).unwrap())).unwrap();
    run.steer(&landscape, Steer::Reheat).unwrap();
    assert_eq!(run.temperature().value(), 0.0);
    run.steer(&landscape, Steer::Stop).unwrap();
    assert_eq!((run.over(), run.round(&landscape)), (Some(Over::Stopped), Vec::new()));
    run.steer(&landscape, Steer::Resume).unwrap();
    run.round(&landscape);
    assert_eq!(run.statistics().rounds, 1);
}

#[test]
fn the_best_point_of_a_living_descent_can_be_pinned() {
    let landscape = Rugged::default();
    let mut run = begin(&Settings { c: 0.0, ..settings(Method::Restore) });
    rounds(&mut run, &landscape, 3);
    let (best, loss): (Spot, f64) = {
        let (best, loss) = run.chains()[0].best().unwrap();
        (best.clone(), loss)
    };
    run.steer(&landscape, Steer::Pin(0)).unwrap();
    let pinned = run.pinned().unwrap();
    assert!(pinned.point == best && pinned.loss == loss && loss < run.start().loss);
}
