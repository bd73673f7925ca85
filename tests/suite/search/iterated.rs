//! Iterated local search: its first descent, races, budget, checkpoints, and its mutations without a
//! way back.

use super::super::merit::bundled;
use super::chain::settings;
use super::mutations::assert_lens;
use super::rugged::{Fault, Rugged, START};
use super::{generous, seeded};
use aplanat::files;
use aplanat::lens::{Lens, Medium, Parameter, Quantity, Variable, Wavelength, glass};
use aplanat::search::element::{piece_count, topology};
use aplanat::search::lens_landscape::{LensLandscape, SearchPlan, run};
use aplanat::search::{
    DescentEnd, Landscape as _, MutatedLens, MutationError, MutationKind, Refusal, RunEnd,
    SearchMethod, SearchRules, SearchRun, SearchRunOn, SearchSettings, SteerCommand, mutate,
    perturb,
};
use std::ops::ControlFlow;
use std::path::PathBuf;

const METHOD: SearchMethod = SearchMethod::IteratedLocalSearch;

fn begin(landscape: &Rugged, settings: &SearchSettings) -> SearchRunOn<Rugged> {
    SearchRun::new(landscape, START, settings).unwrap()
}

fn to_the_end(landscape: &Rugged, settings: &SearchSettings) -> (SearchRunOn<Rugged>, RunEnd) {
    let mut run = begin(landscape, settings);
    for _ in 0..30_000 {
        if let Some(end) = run.end_reason() {
            return (run, end);
        }
        run.round(landscape);
    }
    panic!("no end after {:?}", run.statistics());
}

#[test]
fn it_finds_the_best_structure() {
    for trials in [1, 2, 8] {
        let (run, end) =
            to_the_end(&Rugged::default(), &SearchSettings { trials, ..settings(METHOD) });
        assert_eq!(end, RunEnd::Gradients);
        assert!(run.best().point.elements == 6 && run.best().loss < 0.06, "{:?}", run.best());
        assert_eq!(run.chains().len(), trials + 1);
        let ended = &run.statistics().ended;
        assert!(
            ended[&DescentEnd::Outranked] > 3 && ended[&DescentEnd::Unpromising] > 3,
            "{ended:?}"
        );
    }
}

#[test]
fn the_first_chain_holds_the_best_point() {
    let landscape = Rugged::default();
    let mut run = begin(&landscape, &settings(METHOD));
    for _ in 0..400 {
        run.round(&landscape);
        let (_, held) = run.chains()[0].best().unwrap();
        let others = run.chains()[1..].iter().filter_map(|chain| chain.best());
        let least = others.map(|(_, loss)| loss).fold(held, f64::min);
        assert_eq!(run.best().loss, least);
        assert!(run.reservoir().entries().iter().all(|entry| entry.loss >= least));
        let found = run.found_points();
        assert!(
            found[0].entry.loss == least && found.is_sorted_by(|a, b| a.entry.loss <= b.entry.loss)
        );
    }
    let node = run.lineage().node(run.chains()[0].generation()).unwrap();
    assert_eq!((node.chain, node.end), (0, None));
    let line: Vec<u64> = run.lineage().ancestry(node.number).map(|node| node.number).collect();
    assert!(line.len() > 2 && line.last() == Some(&0), "{line:?}");
}

#[test]
fn a_budget_below_the_first_descent_is_used_up_by_it() {
    for gradients in [1, 2, 7, 50] {
        let given = SearchSettings { gradients: Some(gradients), ..settings(METHOD) };
        let (run, end) = to_the_end(&Rugged::default(), &given);
        assert_eq!((end, run.statistics().gradients), (RunEnd::Gradients, gradients));
        assert_eq!(run.lineage().total(), 1, "nothing is mutated before the start has descended");
        assert!(run.best().loss < run.start().loss);
    }
}

#[test]
fn results_do_not_depend_on_threads_and_depend_on_the_seed() {
    let on = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = SearchSettings { seed, gradients: Some(3000), ..settings(METHOD) };
        pool.install(|| to_the_end(&Rugged::default(), &settings).0)
    };
    let one = on(1, 7);
    assert!(on(2, 7) == one && on(3, 7) == one);
    assert!(on(1, 8).best() != one.best());
}

/// In every stage of a race, which a run of this length has all of.
#[test]
fn a_run_resumes_bit_for_bit_in_the_middle_of_a_race() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("search").join("iterated");
    std::fs::create_dir_all(&folder).unwrap();
    let landscape = Rugged { displaces: true, ..Rugged::default() };
    let path = folder.join("run.json");
    let settings = SearchSettings { gradients: Some(1500), ..settings(METHOD) };
    let (whole, _) = to_the_end(&landscape, &settings);
    let mut run = begin(&landscape, &settings);
    while run.end_reason().is_none() {
        run.round(&landscape);
        run.save(&landscape, &path).unwrap();
        run = SearchRun::load(&landscape, &settings, &path).unwrap();
    }
    assert!(run == whole);
    let other = SearchSettings { trials: 4, ..settings };
    let refused = SearchRun::<_, super::rugged::Momentum>::load(&landscape, &other, &path);
    assert!(refused.unwrap_err().to_string().contains("settings.trials"));
}

/// Some races have several mutants, some one, and some one displacement of the best point.
#[test]
fn the_best_point_is_displaced_where_the_landscape_permits_it() {
    let landscape = Rugged { displaces: true, ..Rugged::default() };
    let mut run = begin(&landscape, &settings(METHOD));
    let (mut displaced, mut single) = (0, 0);
    while run.end_reason().is_none() {
        let best = run.chains()[0].generation();
        let before = run.lineage().total();
        run.round(&landscape);
        let nodes = run.lineage().nodes();
        let born: Vec<_> = nodes.iter().filter(|node| node.number >= before).collect();
        let kinds: Vec<_> = born.iter().map(|node| node.kind).collect();
        if kinds.contains(&Some(MutationKind::Displacement)) {
            assert!(kinds.len() == 1 && born[0].parent == Some(best), "{born:?}");
            displaced += 1;
        } else if kinds.len() == 1 {
            single += 1;
        }
    }
    assert!(displaced > 3 && single > 3, "{displaced} {single}");
    assert!(run.best().point.elements == 6 && run.best().loss < 0.06, "{:?}", run.best());
    let kinds = &run.statistics().kinds;
    assert!(kinds[&MutationKind::AddSinglet].tried > displaced);
}

#[test]
fn without_mutations_the_start_descends_and_the_search_ends() {
    for fault in [Fault::AllRefused, Fault::AllWorthless] {
        let (run, end) = to_the_end(&Rugged::with(fault), &settings(METHOD));
        assert_eq!((end, run.lineage().total()), (RunEnd::Stuck, 1), "{fault:?}");
        assert!(run.best().loss < 0.5 * run.start().loss, "{:?}", run.best());
    }
    let (run, end) = to_the_end(&Rugged::with(Fault::WithoutGradient), &settings(METHOD));
    assert_eq!((end, run.statistics().gradients), (RunEnd::Stuck, 0));
}

#[test]
fn worthless_flat_and_huge_losses_are_survived() {
    let faults = [Fault::DescentLost, Fault::DescentInfinite, Fault::Flat, Fault::Huge];
    for landscape in faults.map(Rugged::with) {
        let given = SearchSettings { gradients: Some(2000), ..settings(METHOD) };
        let mut run = begin(&landscape, &given);
        for _ in 0..200 {
            run.round(&landscape);
        }
        assert!(run.best().loss.is_finite() && run.best().loss <= run.start().loss);
        assert!(run.reservoir().entries().iter().all(|entry| entry.loss.is_finite()));
        assert!(run.lineage().nodes().iter().all(|node| node.best_loss.is_finite()));
        assert!(run.statistics().moves > 10);
    }
}

#[test]
fn steering_commands_hold() {
    let landscape = Rugged::default();
    let mut run = begin(&landscape, &settings(METHOD));
    (0..100).for_each(|_| drop(run.round(&landscape)));
    run.steer(&landscape, SteerCommand::Pin(0)).unwrap();
    run.steer(&landscape, SteerCommand::Weight(MutationKind::Bend, 0.0)).unwrap();
    let tried = run.statistics().kinds[&MutationKind::Bend].tried;
    // The race in progress is not affected.
    let born = run.lineage().total() + 8;
    (0..200).for_each(|_| drop(run.round(&landscape)));
    let young: Vec<_> = run.lineage().nodes().iter().filter(|node| node.number >= born).collect();
    assert!(young.len() > 20 && young.iter().all(|node| node.parent == Some(0)));
    assert!(young.iter().all(|node| node.kind != Some(MutationKind::Bend)));
    assert_eq!(run.statistics().kinds[&MutationKind::Bend].tried, tried);
}

#[test]
fn a_better_lens_of_another_run_becomes_the_best_one() {
    let landscape = Rugged::default();
    let (other, _) = to_the_end(&landscape, &settings(METHOD));
    let found = other.best().clone();
    for rounds in [1, 20, 40, 41, 42] {
        let mut run = begin(&landscape, &SearchSettings { seed: 8, ..settings(METHOD) });
        (0..rounds).for_each(|_| drop(run.round(&landscape)));
        assert!(run.admit(&landscape, found.point.clone()).is_accepted());
        let (point, loss) = run.chains()[0].best().unwrap();
        assert_eq!((point, loss), (&found.point, found.loss));
        assert_eq!(run.best().loss, found.loss);
        (0..50).for_each(|_| drop(run.round(&landscape)));
        assert!(run.best().loss <= found.loss);
        let line = run.lineage().ancestry(run.chains()[0].generation()).last();
        assert!(line.is_some_and(|first| first.parent.is_none()));
    }
}

#[test]
fn the_number_of_trials_is_checked() {
    for trials in [0, 100_000] {
        let wrong = SearchSettings { trials, ..SearchSettings::default() };
        assert!(wrong.check().unwrap_err().to_string().contains("trials"));
    }
}

fn only(kind: MutationKind) -> SearchRules {
    let others = MutationKind::MUTATIONS.into_iter().filter(|other| *other != kind);
    SearchRules { weights: others.map(|kind| (kind, 0.0)).collect(), ..generous() }
}

fn perturbed(lens: &Lens, rules: &SearchRules, seed: u64) -> Result<MutatedLens, MutationError> {
    perturb(lens, rules, &mut seeded(seed))
}

#[test]
fn every_perturbation_of_every_lens_gives_a_lens_or_a_reason() {
    for entry in files::bundled_lenses() {
        let lens = bundled(entry.name);
        for seed in 0..24 {
            if let Ok(mutant) = perturbed(&lens, &generous(), seed) {
                assert_lens(&mutant.lens);
                assert!(mutant.log_ratio.is_none() && !mutant.change.to_string().is_empty());
            }
        }
    }
}

/// The powers of all surfaces at the primary wavelength, in 1/mm.
fn powers(lens: &Lens) -> Vec<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    let mut before = system.index_before;
    let power = |surface: &aplanat::lens::Surface<f64>| {
        let step = surface.index - std::mem::replace(&mut before, surface.index);
        step * surface.shape.curvature()
    };
    system.surfaces.iter().map(power).collect()
}

#[test]
fn a_far_exchange_of_glass_keeps_the_powers() {
    let mut lens = bundled("double_gauss_nikkor_s_50");
    // Its curvatures have bounds, beyond which no surface is bent.
    lens.variables.clear();
    let rules = SearchRules { projection: false, ..only(MutationKind::ExchangeGlass) };
    let (mut far, mut kept) = (0, 0);
    for seed in 0..40 {
        let mutant = perturbed(&lens, &rules, seed).unwrap().lens;
        let row = (0..lens.surfaces.len())
            .find(|row| lens.surfaces[*row].medium != mutant.surfaces[*row].medium)
            .unwrap();
        let [old, new] = [&lens, &mutant].map(|lens| match &lens.surfaces[row].medium {
            Medium::Glass(name) => glass::find(name).unwrap(),
            other => panic!("{other:?}"),
        });
        assert!(!old.is_twin_of(new), "{old:?} {new:?}");
        far += usize::from((old.nd - new.nd).abs() > 0.06);
        let pairs = powers(&lens).into_iter().zip(powers(&mutant));
        let changed: Vec<usize> =
            pairs.enumerate().filter(|(_, (a, b))| (a - b).abs() > 1e-9).map(|(i, _)| i).collect();
        // A surface whose step of the index changes by more than a factor of two is not bent.
        for row in &changed {
            assert_eq!(mutant.surfaces[*row].curvature, lens.surfaces[*row].curvature);
        }
        kept += usize::from(changed.is_empty());
        assert_eq!(topology(&mutant), topology(&lens));
    }
    assert!(far > 10, "{far} exchanges are far");
    assert!(kept > 10, "all powers are kept by {kept} exchanges");
}

/// A model of a glass is exchanged for one of the catalogue, and its index varies no longer.
#[test]
fn a_model_glass_is_exchanged_for_one_of_the_catalogue() {
    let mut lens = bundled("tessar_50_f28");
    assert!(matches!(lens.surfaces[0].medium, Medium::Model { .. }));
    let index = Parameter::new(0, Quantity::Index);
    lens.variables.push(Variable { parameter: index, min: None, max: None });
    let rules =
        SearchRules { fixed_ends: [0, 6], projection: false, ..only(MutationKind::ExchangeGlass) };
    let mutant = perturbed(&lens, &rules, 1).unwrap();
    assert!(matches!(mutant.lens.surfaces[0].medium, Medium::Glass(_)));
    assert!(mutant.lens.variable(index).is_none());
    assert!(
        mutant.change.to_string().starts_with("exchanged nd 1.67786, vd 55.5 behind surface 1")
    );
    // The sampler of the thesis has a kernel between glasses of the catalogue alone.
    let refused = mutate(MutationKind::ExchangeGlass, &lens, &rules, &mut seeded(1)).unwrap_err();
    assert_eq!(refused.refusal, Refusal::NoExchangeableGlass);
}

#[test]
fn without_another_glass_none_is_exchanged() {
    let lens = bundled("singlet_la1131");
    let rules =
        SearchRules { glasses: vec!["SCHOTT N-BK7".into()], ..only(MutationKind::ExchangeGlass) };
    assert_eq!(perturbed(&lens, &rules, 1).unwrap_err().refusal, Refusal::NoOtherGlass);
}

/// Where the rules permit it, a new meniscus may be so thin that it is as good as none.
#[test]
fn a_new_meniscus_changes_little_however_thin_it_may_be() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    for least in [0.0, 1.0] {
        let limits = SearchRules {
            glass_center: [least, 30.0],
            glass_edge: 0.0,
            air_center: [0.0, 100.0],
            air_edge: 0.0,
            ..only(MutationKind::AddSinglet)
        };
        let plan = SearchPlan { rules: limits.clone(), ..SearchPlan::default() };
        let landscape = plan.landscape(&lens).unwrap();
        let before = landscape.loss(landscape.start());
        let mut better = 0;
        for seed in 0..20 {
            let mutant = perturbed(landscape.start(), &limits, seed).unwrap();
            assert_lens(&mutant.lens);
            assert_eq!(piece_count(&mutant.lens), 4);
            let loss = landscape.loss(&mutant.lens.into());
            better += usize::from(loss < 10.0 * before);
        }
        assert!(better > 10, "{better} of 20 with a thickness of {least} mm");
    }
}

fn search(
    lens: &Lens,
    rules: SearchRules,
    gradients: u64,
) -> (LensLandscape, SearchRunOn<LensLandscape>) {
    let settings = SearchSettings {
        method: METHOD,
        gradients: Some(gradients),
        seed: 2,
        ..SearchSettings::default()
    };
    let plan = SearchPlan { rules, settings, ..SearchPlan::default() };
    let found = run(lens, &plan, |_, _| ControlFlow::Continue(())).unwrap();
    (plan.landscape(lens).unwrap(), found)
}

#[test]
fn a_lens_is_improved_within_the_rules() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let rules = SearchRules { elements: [3, 4], fixed_ends: [2, 0], ..SearchRules::default() };
    let (landscape, run) = search(&lens, rules.clone(), 2000);
    assert_eq!(run.statistics().gradients, 2000);
    assert!(run.best().loss < 0.2 * run.start().loss, "{} {}", run.best().loss, run.start().loss);
    assert!(run.lineage().total() > 8);
    for node in run.lineage().nodes() {
        assert_lens(&node.point);
        assert!((3..=4).contains(&piece_count(&node.point)));
        assert_eq!(node.point.surfaces[0].medium, landscape.start().surfaces[0].medium);
    }
}

/// The first descent is cut short: no lens of that structure is of use.
#[test]
fn a_start_outside_the_permitted_structures_is_left() {
    let mut lens = bundled("double_gauss_nikkor_s_50");
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    for elements in [[1, 5], [9, 12]] {
        let rules = SearchRules { elements, ..SearchRules::default() };
        let (landscape, run) = search(&lens, rules, 900);
        assert_eq!(landscape.structure_violation(landscape.start()), 2);
        assert_eq!(landscape.structure_violation(&run.best().point), 0, "{elements:?}");
        assert_eq!(run.statistics().gradients, 900);
    }
}
