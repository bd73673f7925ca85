//! Design tasks in gradient-index fields: known lenses recovered, limits respected, invalid tasks
//! refused by name, and the same field on any number of threads.

use aplanat::grin::{GrinFate, LaunchMode};
use aplanat::grin_design::{
    self, BUILTIN_TASKS, BoundaryCondition, Domain, FieldRepresentation, GrinMethod, GrinOptimizer,
    GrinTask, GrinTaskError, InitialField, LightGoal, LightSource, LightView, ManufacturingLimits,
    ReferenceField, RefinementLevel, SourceDirections,
};
use aplanat::math::Vec3;
use rayon::ThreadPoolBuilder;

fn builtin(name: &str) -> GrinTask {
    grin_design::find_builtin(name).unwrap().task().unwrap()
}

/// Works on a task to its end.
fn solved(task: &GrinTask) -> GrinOptimizer {
    let mut runner = GrinOptimizer::new(task).unwrap();
    while !runner.step().unwrap().finished {}
    runner
}

/// A task without an answer that is quick to work on: a beam through a cube onto a point.
fn small() -> GrinTask {
    let source =
        LightSource::Beam { direction: [0.0, 0.0, 1.0], half: 0.5, rays: 12, fresh: false };
    let goal = LightGoal::Point([0.0, 0.0, 1.0]);
    let view = LightView { name: "beam".into(), source, goal, weight: 1.0, space: None };
    GrinTask {
        aplanat_grin: 1,
        name: "a lens in a cube".into(),
        notes: String::new(),
        field: FieldRepresentation::Trilinear { half: 1.0 },
        space: Domain::Cube { half: 1.0 },
        launch: LaunchMode::default(),
        views: vec![view],
        start: InitialField::default(),
        tolerance: 0.05,
        tracing: None,
        limits: ManufacturingLimits::default(),
        edge: None,
        method: GrinMethod::Lbfgs,
        levels: vec![
            RefinementLevel { nodes: 3, steps: 10 },
            RefinementLevel { nodes: 5, steps: 10 },
        ],
        exact: None,
    }
}

#[test]
fn grin_builtin_tasks_are_valid_and_round_trip() {
    assert!(BUILTIN_TASKS.len() >= 5 && grin_design::find_builtin("no such task").is_none());
    for builtin in BUILTIN_TASKS {
        let task = builtin.task().unwrap();
        task.check().unwrap();
        let text = serde_json::to_string(&task).unwrap();
        assert_eq!(grin_design::read_task(&text, builtin.name).unwrap(), task);
        let unknown = text.replacen("\"name\"", "\"nmae\"", 1);
        let error = grin_design::read_task(&unknown, "a file").unwrap_err().to_string();
        assert!(error.contains("nmae") && error.contains("a file"), "{error}");
    }
}

#[test]
fn grin_luneburg_is_recovered_as_a_radial_profile() {
    let runner = solved(&builtin("luneburg-radial"));
    let found = runner.task().difference(runner.best()).unwrap().unwrap();
    println!("luneburg-radial: {found:?}, {} rays", runner.rays_traced());
    assert!(found.relative < 1e-4 && found.without_offset <= found.relative, "{found:?}");
    let extremes = runner.task().extremes(runner.best());
    assert!(extremes.low >= 1.0 && extremes.high < 1.4143 && extremes.slope < 1.001);
}

#[test]
fn grin_a_grid_recovers_the_shape_better_than_the_constant() {
    let mut task = builtin("luneburg");
    task.levels =
        vec![RefinementLevel { nodes: 5, steps: 80 }, RefinementLevel { nodes: 9, steps: 100 }];
    let runner = solved(&task);
    let found = task.difference(runner.best()).unwrap().unwrap();
    println!("luneburg on 9^3: {found:?}");
    assert!(found.relative < 6e-2 && found.without_offset < 0.3 * found.relative, "{found:?}");
    let judged = runner.score(runner.best()).unwrap();
    assert_eq!(judged.views[0].counts.excluded().count(), 0);
    // Nodes outside the ball are held at 1, all others keep the limits.
    let volume = runner.best().volume(task.space, 0).unwrap();
    assert_eq!(volume.grid.counts(), [9; 3]);
    for (n, index) in volume.values.iter().enumerate() {
        let p = volume.grid.node(n);
        assert!(*index >= 1.0 && *index <= 2.0);
        assert!(p.dot(p) < 1.0 || *index == 1.0);
    }
}

#[test]
fn grin_the_designed_fibre_is_the_hyperbolic_secant() {
    let runner = solved(&builtin("fibre"));
    let spots: Vec<f64> =
        runner.score(runner.best()).unwrap().views.iter().map(|view| view.spot).collect();
    // The parabolic fibre at its best planes: 0.068, 0.196, 0.302 mm.
    println!("fibre: {spots:?}");
    assert!(spots[0] < 6.8e-5 && spots[1] < 1.96e-4 && spots[2] < 3.02e-4, "{spots:?}");
    for i in 0..95 {
        let r = 0.01 * f64::from(i);
        let index = runner.best().index_field().sample(Vec3::new(r, 0.0, 0.0)).index;
        assert!((index - 1f64.cosh() / r.cosh()).abs() < 1e-4, "{r}: {index}");
    }
}

#[test]
fn grin_tasks_give_the_same_bits_on_one_thread_and_on_two() {
    let mut adam = builtin("luneburg");
    adam.levels =
        vec![RefinementLevel { nodes: 5, steps: 12 }, RefinementLevel { nodes: 9, steps: 12 }];
    let mut squares = builtin("luneburg-radial");
    squares.levels.truncate(1);
    for task in [adam, squares, small()] {
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let runner = solved(&task);
                (runner.best().clone(), runner.rays_traced())
            })
        };
        assert_eq!(on(1), on(2), "{}", task.name);
    }
}

#[test]
fn grin_descent_by_lbfgs_focuses_a_beam_within_its_limits() {
    let task = small();
    let runner = GrinOptimizer::new(&task).unwrap();
    let before = runner.score(runner.best()).unwrap();
    let runner = solved(&task);
    let after = runner.score(runner.best()).unwrap();
    println!("beam: {:.3e} to {:.3e} mm", before.views[0].spot, after.views[0].spot);
    assert!(after.views[0].spot < 0.5 * before.views[0].spot);
    assert!(after.loss <= before.loss && after.views[0].counts.valid() == 144);
    // A maker who cannot make it so steep gets a flatter one.
    let steepest = task.extremes(runner.best()).slope;
    let limits = ManufacturingLimits { slope: Some(0.5 * steepest), ..task.limits };
    let flat = solved(&GrinTask { limits, ..task.clone() });
    let slope = task.extremes(flat.best()).slope;
    println!("slope {steepest:.3} / mm, with a limit of {:.3}: {slope:.3}", 0.5 * steepest);
    assert!(slope < 0.6 * steepest && flat.score(flat.best()).unwrap().views[0].spot < 0.4);
}

#[test]
fn grin_a_simulated_measurement_recovers_its_field() {
    let mut task = builtin("luneburg-radial");
    task.views[0].goal =
        LightGoal::Like { field: ReferenceField::Luneburg { radius: 1.0 }, direction: 1.0 };
    let found = solved(&task);
    let difference = task.difference(found.best()).unwrap().unwrap();
    println!("as from another field: {difference:?}");
    assert!(difference.relative < 1e-4, "{difference:?}");
}

#[test]
fn grin_a_design_stopped_early_has_a_best_field() {
    let mut runner = GrinOptimizer::new(&builtin("luneburg-radial")).unwrap();
    let first = runner.score(runner.best()).unwrap().loss;
    for step in 1..=3 {
        let progress = runner.step().unwrap();
        assert!(progress.step == step && !progress.finished && progress.loss.is_finite());
    }
    runner.finish().unwrap();
    let now = runner.score(runner.best()).unwrap().loss;
    assert!(now < first, "{first} {now}");
    let mut runner = solved(&small());
    let (best, progress) = (runner.best().clone(), runner.step().unwrap());
    assert!(progress.finished && *runner.best() == best, "a step after the end does nothing");
}

#[test]
fn grin_excluded_rays_are_counted_by_reason() {
    // Light wider than the ball: some of it passes by, some grazes.
    let mut task = small();
    task.field = FieldRepresentation::Trilinear { half: 3.0 };
    task.space = Domain::Ball { radius: 2.9 };
    task.views[0].source =
        LightSource::Parallel { directions: SourceDirections::Even(4), radius: 3.5, rays: 40 };
    task.views[0].goal = LightGoal::Antipode;
    let runner = GrinOptimizer::new(&task).unwrap();
    let counts = runner.score(runner.best()).unwrap().views[0].counts;
    let excluded: Vec<_> = counts.excluded().collect();
    println!("{excluded:?}");
    assert_eq!(counts.fates.total(), 160);
    assert!(counts.fates.count_of(GrinFate::NeverEntered) > 20 && counts.valid() > 80);
    let left_out: usize = excluded.iter().map(|(_, count)| count).sum();
    assert_eq!(left_out + counts.valid(), 160);
    assert!(excluded.iter().any(|(reason, _)| *reason == "never_entered"));
    // A search goes on all the same and never meets what is no number.
    let runner = solved(&task);
    assert!(runner.score(runner.best()).unwrap().loss.is_finite());
}

#[test]
fn grin_chaotic_rays_are_detected_by_retracing_and_counted() {
    let folder = std::env::temp_dir().join(format!("aplanat-{}-chaos.npz", std::process::id()));
    let grid = aplanat::grin::field::RegularGrid::cube(33, 1.0).unwrap();
    let values = (0..33 * 33 * 33).map(|i| 1.0 + 3.0 * (f64::from(i) * 0.754878).fract());
    let volume = aplanat::files::Volume { grid, values: values.collect() };
    aplanat::files::write_volume(&folder, &volume).unwrap();
    let mut task = small();
    task.start = InitialField::Volume(folder.clone().into());
    task.limits.high = 4.0;
    task.levels = vec![RefinementLevel { nodes: 33, steps: 1 }];
    task.read_files().unwrap();
    let runner = GrinOptimizer::new(&task).unwrap();
    let judged = runner.score(runner.best()).unwrap();
    std::fs::remove_file(folder).unwrap();
    let counts = judged.views[0].counts;
    println!("{:?}", counts.excluded().collect::<Vec<_>>());
    assert!(counts.fates.count_of(GrinFate::Chaotic) > 0 && judged.loss.is_finite());
}

/// The error with which a task is refused.
fn refused(change: impl FnOnce(&mut GrinTask)) -> String {
    let mut task = small();
    change(&mut task);
    let checked = task.check().and_then(|()| task.read_files());
    checked.and_then(|()| GrinOptimizer::new(&task)).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn grin_invalid_tasks_are_refused_by_name() {
    let says = |found: String, words: &[&str]| {
        words.iter().for_each(|word| assert!(found.contains(word), "`{found}`: no `{word}`"));
    };
    says(refused(|t| t.limits.low = 0.9), &["limits, low", "0.9", "1 or more", "vacuum"]);
    says(refused(|t| t.limits.high = 0.5), &["limits, high", "0.5"]);
    says(refused(|t| t.limits.low = f64::NAN), &["limits, low", "NaN"]);
    says(refused(|t| t.start = InitialField::Uniform(0.7)), &["start", "0.7", "from 1 to 2"]);
    says(refused(|t| t.levels[0].nodes = 1), &["levels, number 0", "found 1", "2 to"]);
    says(refused(|t| t.levels.clear()), &["levels", "none"]);
    let far = |t: &mut GrinTask| t.space = Domain::Ball { radius: 3.0 };
    says(refused(far), &["space", "a reach of 3 mm", "the field covers"]);
    says(refused(|t| t.views.clear()), &["views", "none"]);
    says(refused(|t| t.views[0].weight = 0.0), &["views", "weight"]);
    says(refused(|t| t.views[0].goal = LightGoal::Antipode), &["antipode", "parallel"]);
    says(refused(|t| t.tolerance = 0.0), &["tolerance", "above 0"]);
    says(refused(|t| t.space = Domain::Ball { radius: -1.0 }), &["space", "-1"]);
    says(refused(|t| t.aplanat_grin = 7), &["aplanat_grin", "7", "expected 1"]);
    says(
        refused(|t| {
            t.method = GrinMethod::LeastSquares;
            t.levels[1].nodes = 9;
        }),
        &["method", "729 numbers", "lbfgs"],
    );
    says(
        refused(|t| {
            t.views[0].source = LightSource::Parallel {
                directions: SourceDirections::Fresh(6),
                radius: 0.5,
                rays: 10,
            };
        }),
        &["directions", "fresh", "adam"],
    );
    says(
        refused(|t| {
            t.field = FieldRepresentation::Sphere { radius: 1.0 };
            t.levels[0].nodes = 4;
            t.start = InitialField::Volume("a.npz".into());
        }),
        &["start", "volume", "uniform"],
    );
    says(
        refused(|t| t.start = InitialField::Volume("there is none.npz".into())),
        &["start", "there is none.npz", "cannot be read"],
    );
}

#[test]
fn grin_a_single_voxel_works_and_one_without_free_nodes_is_refused() {
    let mut task = small();
    task.levels = vec![RefinementLevel { nodes: 2, steps: 3 }];
    assert!(solved(&task).score(solved(&task).best()).unwrap().loss.is_finite());
    task.space = Domain::Ball { radius: 0.9 };
    task.edge = Some(BoundaryCondition { index: 1.0, fixed: true, weight: 0.0 });
    let error = GrinOptimizer::new(&task).unwrap_err();
    assert!(matches!(error, GrinTaskError::NoFreeParameters { nodes: 2 }), "{error}");
}

#[test]
fn grin_a_display_approaches_both_target_images() {
    let mut task = builtin("display");
    task.levels =
        vec![RefinementLevel { nodes: 5, steps: 20 }, RefinementLevel { nodes: 9, steps: 20 }];
    for view in &mut task.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 64;
        }
        if let LightGoal::Image { pixels, .. } = &mut view.goal {
            *pixels = 32;
        }
    }
    let quality = |runner: &GrinOptimizer| -> Vec<f64> {
        let views = runner.score(runner.best()).unwrap().views;
        views.iter().filter_map(|view| view.psnr).collect()
    };
    let before = quality(&GrinOptimizer::new(&task).unwrap());
    let after = quality(&solved(&task));
    println!("display: {before:.1?} to {after:.1?} dB");
    assert!(after.len() == 2 && after.iter().zip(&before).all(|(a, b)| *a > b + 2.0));
    task.method = GrinMethod::LeastSquares;
    let error = GrinOptimizer::new(&task).unwrap_err().to_string();
    assert!(error.contains("fresh") || error.contains("image"), "{error}");
}
