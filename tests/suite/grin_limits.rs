//! What a maker can make: whatever the field is made of, what is found keeps every limit, and every
//! limit is told with the value that stands against it.

use aplanat::files::{Volume, write_volume};
use aplanat::grin::field::Grid;
use aplanat::grin::{Integrator, Launch};
use aplanat::grin_task::{
    Directions, FieldKind, Goal, Kept, Level, MakerLimits, Method, Runner, Source, Space, Start,
    Task, Tracing, View,
};
use aplanat::math::Vec3;

/// A lens that wants more than it may have: parallel light shall meet within a ball.
fn greedy(field: FieldKind, method: Method, nodes: usize) -> Task {
    let source = Source::Parallel {
        directions: Directions::Given(vec![[0.0, 0.0, 1.0]]),
        radius: 0.8,
        rays: 40,
    };
    let goal = Goal::Point([0.0, 0.0, 1.0]);
    let view = View { name: "focus".into(), source, goal, weight: 1.0, space: None };
    Task {
        aplanat_grin: 1,
        name: "a lens at its limits".into(),
        notes: String::new(),
        field,
        space: Space::Ball { radius: 1.0 },
        launch: Launch::AsGiven,
        views: vec![view],
        start: Start::Uniform(1.1),
        tolerance: 0.01,
        tracing: Some(Tracing { integrator: Integrator::LeapfrogDkd, per_voxel: 1.0 }),
        limits: MakerLimits { low: 1.05, high: 1.12, slope: None, change: 0.05 },
        edge: None,
        method,
        levels: vec![Level { nodes, steps: 8 }],
        exact: None,
    }
}

const FIELDS: [(FieldKind, Method, usize); 5] = [
    (FieldKind::Trilinear { half: 1.0 }, Method::Lbfgs, 7),
    (FieldKind::Tricubic { half: 1.0 }, Method::Lbfgs, 6),
    (FieldKind::Tricubic { half: 1.0 }, Method::Adam { rate: 0.02, fall: 1.0 }, 6),
    (FieldKind::Sphere { radius: 1.0 }, Method::LeastSquares, 9),
    (FieldKind::Cylinder { radius: 1.0 }, Method::Lbfgs, 9),
];

fn solved(task: &Task) -> Runner {
    let mut runner = Runner::new(task).unwrap();
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
fn grin_limits_of_the_index_are_kept_by_every_kind_of_field() {
    for (field, method, nodes) in FIELDS {
        let task = greedy(field, method, nodes);
        let (first, runner) = (Runner::new(&task).unwrap(), solved(&task));
        let best = runner.best();
        let indices: Vec<f64> = anywhere().map(|p| best.field().sample(p).index).collect();
        let low = indices.iter().copied().fold(f64::INFINITY, f64::min);
        let high = indices.iter().copied().fold(0.0, f64::max);
        println!("{field:?}: index {low:.9} to {high:.9}");
        assert!(low >= 1.05 - 1e-9 && high <= 1.12 + 1e-9, "{field:?}: {low} {high}");
        // It goes to its limit, so that the limit has something to do.
        assert!(high > 1.118, "{field:?}: {high}");
        let kept = task.kept(&task.extremes(best));
        let names: Vec<&str> = kept.iter().map(|kept| kept.name).collect();
        assert_eq!(names, ["lowest index", "highest index"]);
        assert!(kept.iter().all(Kept::is_kept), "{field:?}: {kept:?}");
        assert!((kept[1].value - high).abs() < 2e-3 && kept[1].limit == 1.12, "{kept:?}");
        let [before, after] = [&first, &runner].map(|r| r.judge(r.best()).unwrap().loss);
        assert!(after < before, "{field:?}: {before} {after}");
        // What is printed and built keeps them at every voxel.
        let values = task.volume(best, 17).unwrap().values;
        assert!(values.iter().all(|index| (1.05..=1.12).contains(index)), "{field:?}");
    }
}

#[test]
fn grin_a_limit_of_the_slope_leaves_those_of_the_index_kept() {
    for (field, method, nodes) in [FIELDS[0], FIELDS[3]] {
        let mut task = greedy(field, method, nodes);
        task.limits.slope = Some(0.06);
        let kept = task.kept(&task.extremes(solved(&task).best()));
        assert!(kept.len() == 3 && kept.iter().all(Kept::is_kept), "{field:?}: {kept:?}");
        assert!(kept[2].name == "slope" && kept[2].margin == 0.06 - kept[2].value, "{kept:?}");
    }
}

#[test]
fn grin_a_broken_limit_is_told_with_its_place() {
    let task = greedy(FieldKind::Sphere { radius: 1.0 }, Method::LeastSquares, 9);
    let found = solved(&task);
    // The same field by the eye of a maker who can make less.
    let poor = Task { limits: MakerLimits { high: 1.1, ..task.limits }, ..task.clone() };
    let kept = poor.kept(&poor.extremes(found.best()));
    let over = kept[1].value - 1.1;
    assert!(!kept[1].is_kept() && over > 0.01 && kept[1].margin == -over, "{kept:?}");
    let there = found.best().field().sample(kept[1].at).index;
    assert!((there - kept[1].value).abs() < 1e-12 && kept[0].is_kept());
}

#[test]
fn grin_a_start_beyond_the_limits_is_refused_and_one_within_rounding_is_not() {
    let path = std::env::temp_dir().join(format!("aplanat-{}-start.npz", std::process::id()));
    let refused = |middle: f64| {
        let grid = Grid::cube(5, 1.0).unwrap();
        let value = |n: usize| if n == grid.nodes() / 2 { middle } else { 1.1 };
        let values = (0..grid.nodes()).map(value).collect();
        write_volume(&path, &Volume { grid, values }).unwrap();
        let mut task = greedy(FieldKind::Trilinear { half: 1.0 }, Method::Lbfgs, 5);
        task.start = Start::Volume(path.clone());
        Runner::new(&task).map(|_| ()).map_err(|error| error.to_string())
    };
    let error = refused(1.13).unwrap_err();
    let words = ["start", "start.npz", "[0.0, 0.0, 0.0]", "1.13", "1.05 to 1.12", "limits"];
    assert!(words.iter().all(|word| error.contains(word)), "{error}");
    assert_eq!(refused(f64::from(1.12_f32)), Ok(()));
    std::fs::remove_file(path).unwrap();
}
