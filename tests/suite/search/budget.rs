//! A budget of gradients is used up and never exceeded, on any number of threads, resumed or not;
//! the best point of an active descent is among the results.

use super::chain::settings;
use super::rugged::{Rugged, START, STEPS};
use aplanat::search::{RunEnd, SearchMethod, SearchRun, SearchRunOn, SearchSettings};
use std::fs;
use std::path::PathBuf;

const METHODS: [SearchMethod; 4] = [
    SearchMethod::IteratedLocalSearch,
    SearchMethod::Restore,
    SearchMethod::Metropolis,
    SearchMethod::BruteForce,
];

fn begin(settings: &SearchSettings) -> SearchRunOn<Rugged> {
    SearchRun::new(&Rugged::default(), START, settings).unwrap()
}

fn of(method: SearchMethod, gradients: u64) -> SearchSettings {
    SearchSettings { gradients: Some(gradients), ..settings(method) }
}

/// Runs to the end.
fn whole(settings: &SearchSettings) -> (SearchRunOn<Rugged>, RunEnd) {
    let mut run = begin(settings);
    loop {
        if let Some(over) = run.end_reason() {
            return (run, over);
        }
        run.round(&Rugged::default());
    }
}

#[test]
fn a_gradient_budget_is_used_up_and_not_exceeded() {
    for gradients in [1, 2, 3, 4, 7, 19, 20, 21, 50, 137, 1000] {
        for method in
            [SearchMethod::IteratedLocalSearch, SearchMethod::Restore, SearchMethod::Metropolis]
        {
            let (run, over) = whole(&of(method, gradients));
            let made = run.statistics().gradients;
            assert_eq!((over, made), (RunEnd::Gradients, gradients), "{method:?}");
        }
        let (run, over) = whole(&of(SearchMethod::BruteForce, gradients));
        assert_eq!(over, RunEnd::Done);
        assert!(run.statistics().gradients <= gradients, "{:?}", run.statistics());
        assert!(run.statistics().gradients + 4 > gradients, "{:?}", run.statistics());
    }
}

#[test]
fn the_remaining_budget_is_divided_independently_of_threads() {
    for method in METHODS {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| whole(&of(method, 137)).0)
        };
        assert!(on(1) == on(2), "{method:?}");
    }
}

#[test]
fn moves_are_shortened_only_at_the_end() {
    let (mut short, mut long) =
        (begin(&of(SearchMethod::Restore, 137)), begin(&of(SearchMethod::Restore, 1000)));
    let round = short.settings().chains * STEPS;
    let mut rounds = 0;
    while short.statistics().gradients + round as u64 <= 137 {
        short.round(&Rugged::default());
        long.round(&Rugged::default());
        rounds += 1;
    }
    assert!(rounds >= 6);
    assert_eq!(short.best(), long.best());
    assert_eq!(short.chains(), long.chains());
    assert_eq!(short.statistics(), long.statistics());
}

#[test]
fn a_resumed_run_distributes_the_remaining_budget_alike() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("search").join("budget");
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("run.json");
    for method in METHODS {
        let settings = of(method, 137);
        let (undisturbed, _) = whole(&settings);
        let mut run = begin(&settings);
        while run.end_reason().is_none() {
            run.round(&Rugged::default());
            run.save(&Rugged::default(), &path).unwrap();
            run = SearchRun::load(&Rugged::default(), &settings, &path).unwrap();
        }
        assert!(run == undisturbed, "{method:?}");
    }
}

#[test]
fn the_best_point_is_always_among_the_results() {
    let mut run = begin(&of(SearchMethod::Restore, 2000));
    let mut running = 0;
    while run.end_reason().is_none() {
        run.round(&Rugged::default());
        let found = run.found_points();
        assert_eq!(found[0].entry.loss, run.best().loss);
        assert!(found.is_sorted_by(|a, b| a.entry.loss <= b.entry.loss));
        assert!(found[1..].iter().all(|other| !other.running));
        let kept = run.reservoir().entries().len();
        assert_eq!(found.len(), kept + usize::from(found[0].running));
        if found[0].running {
            running += 1;
            let lives =
                run.chains().iter().any(|chain| chain.generation() == found[0].entry.number);
            assert!(lives, "generation {}", found[0].entry.number);
        }
    }
    assert!(running > 0);
}
