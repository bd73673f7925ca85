//! Manufacturing limits: a designed field of any representation respects every limit, and every
//! limit is reported with its value.

use aplanat::files::{Volume, write_volume};
use aplanat::grin::field::RegularGrid;
use aplanat::grin::{Integrator, LaunchMode};
use aplanat::grin_design::{
    Domain, FieldRepresentation, GrinMethod, GrinOptimizer, GrinTask, InitialField, LightGoal,
    LightSource, LightView, LimitCheck, ManufacturingLimits, RefinementLevel, SourceDirections,
    TracingSettings,
};
use aplanat::math::Vec3;

/// A lens that wants more than it may have: parallel light shall meet within a ball.
fn greedy(field: FieldRepresentation, method: GrinMethod, nodes: usize) -> GrinTask {
    let source = LightSource::Parallel {
        directions: SourceDirections::Given(vec![[0.0, 0.0, 1.0]]),
        radius: 0.8,
        rays: 40,
    };
    let goal = LightGoal::Point([0.0, 0.0, 1.0]);
    let view = LightView { name: "focus".into(), source, goal, weight: 1.0, space: None };
    GrinTask {
        aplanat_grin: 1,
        name: "a lens at its limits".into(),
        notes: String::new(),
        field,
        space: Domain::Ball { radius: 1.0 },
        launch: LaunchMode::AsGiven,
        views: vec![view],
        start: InitialField::Uniform(1.1),
        tolerance: 0.01,
        tracing: Some(TracingSettings { integrator: Integrator::LeapfrogDkd, per_voxel: 1.0 }),
        limits: ManufacturingLimits { low: 1.05, high: 1.12, slope: None, change: 0.05 },
        edge: None,
        method,
        levels: vec![RefinementLevel { nodes, steps: 8 }],
        exact: None,
    }
}

const FIELDS: [(FieldRepresentation, GrinMethod, usize); 5] = [
    (FieldRepresentation::Trilinear { half: 1.0 }, GrinMethod::Lbfgs, 7),
    (FieldRepresentation::Tricubic { half: 1.0 }, GrinMethod::Lbfgs, 6),
    (FieldRepresentation::Tricubic { half: 1.0 }, GrinMethod::Adam { rate: 0.02, fall: 1.0 }, 6),
    (FieldRepresentation::Sphere { radius: 1.0 }, GrinMethod::LeastSquares, 9),
    (FieldRepresentation::Cylinder { radius: 1.0 }, GrinMethod::Lbfgs, 9),
];

fn solved(task: &GrinTask) -> GrinOptimizer {
    let mut runner = GrinOptimizer::new(task).unwrap();
    while !runner.step().unwrap().finished {}
    runner
}

/// Points all over the ball that no search has looked at.
fn anywhere() -> impl Iterator<Item = Vec3<f64>> {
    let side = |i: u32, step: f64| 2.0 * (0.37 + f64::from(i) * step).fract() - 1.0;
    let point = move |i| Vec3::new(side(i, 0.8191725), side(i, 0.6710436), side(i, 0.5497005));
    (0..20_000).map(point).filter(|p| p.dot(*p) < 1.0)
}

#[test]
fn grin_every_kind_of_field_respects_index_limits() {
    for (field, method, nodes) in FIELDS {
        let task = greedy(field, method, nodes);
        let (first, runner) = (GrinOptimizer::new(&task).unwrap(), solved(&task));
        let best = runner.best();
        let indices: Vec<f64> = anywhere().map(|p| best.index_field().sample(p).index).collect();
        let low = indices.iter().copied().fold(f64::INFINITY, f64::min);
        let high = indices.iter().copied().fold(0.0, f64::max);
        println!("{field:?}: index {low:.9} to {high:.9}");
        assert!(low >= 1.05 - 1e-9 && high <= 1.12 + 1e-9, "{field:?}: {low} {high}");
        // It goes to its limit, so that the limit has something to do.
        assert!(high > 1.118, "{field:?}: {high}");
        let kept = task.limit_checks(&task.extremes(best));
        let names: Vec<&str> = kept.iter().map(|kept| kept.name).collect();
        assert_eq!(names, ["lowest index", "highest index"]);
        assert!(kept.iter().all(LimitCheck::is_satisfied), "{field:?}: {kept:?}");
        assert!((kept[1].value - high).abs() < 2e-3 && kept[1].limit == 1.12, "{kept:?}");
        let [before, after] = [&first, &runner].map(|r| r.score(r.best()).unwrap().loss);
        assert!(after < before, "{field:?}: {before} {after}");
        // What is printed and built keeps them at every voxel.
        let values = task.volume(best, 17).unwrap().values;
        assert!(values.iter().all(|index| (1.05..=1.12).contains(index)), "{field:?}");
    }
}

#[test]
fn grin_a_slope_limit_preserves_index_limits() {
    for (field, method, nodes) in [FIELDS[0], FIELDS[3]] {
        let mut task = greedy(field, method, nodes);
        task.limits.slope = Some(0.06);
        let kept = task.limit_checks(&task.extremes(solved(&task).best()));
        assert!(
            kept.len() == 3 && kept.iter().all(LimitCheck::is_satisfied),
            "{field:?}: {kept:?}"
        );
        assert!(kept[2].name == "slope" && kept[2].margin == 0.06 - kept[2].value, "{kept:?}");
    }
}

#[test]
fn grin_a_violated_limit_is_reported_with_its_position() {
    let task = greedy(FieldRepresentation::Sphere { radius: 1.0 }, GrinMethod::LeastSquares, 9);
    let found = solved(&task);
    // The same field by the eye of a maker who can make less.
    let poor =
        GrinTask { limits: ManufacturingLimits { high: 1.1, ..task.limits }, ..task.clone() };
    let kept = poor.limit_checks(&poor.extremes(found.best()));
    let over = kept[1].value - 1.1;
    assert!(!kept[1].is_satisfied() && over > 0.01 && kept[1].margin == -over, "{kept:?}");
    let there = found.best().index_field().sample(kept[1].at).index;
    assert!((there - kept[1].value).abs() < 1e-12 && kept[0].is_satisfied());
}

#[test]
fn grin_a_start_beyond_the_limits_is_refused_and_one_within_rounding_is_not() {
    let path = std::env::temp_dir().join(format!("aplanat-{}-start.npz", std::process::id()));
    let refused = |middle: f64| {
        let grid = RegularGrid::cube(5, 1.0).unwrap();
        let value = |n: usize| if n == grid.node_count() / 2 { middle } else { 1.1 };
        let values = (0..grid.node_count()).map(value).collect();
        write_volume(&path, &Volume { grid, values }).unwrap();
        let mut task = greedy(FieldRepresentation::Trilinear { half: 1.0 }, GrinMethod::Lbfgs, 5);
        task.start = InitialField::Volume(path.clone().into());
        task.read_files().map_err(|error| error.to_string())
    };
    let error = refused(1.13).unwrap_err();
    let words = ["start", "start.npz", "[0.0, 0.0, 0.0]", "1.13", "1.05 to 1.12", "limits"];
    assert!(words.iter().all(|word| error.contains(word)), "{error}");
    assert_eq!(refused(f64::from(1.12_f32)), Ok(()));
    std::fs::remove_file(path).unwrap();
}
