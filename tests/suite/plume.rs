//! Plumes reconstructed from the deflection of light: a custom volume, straight rays beside curved
//! rays, slope limits, and hard cases.

use crate::grin::length;
use aplanat::files::{Volume, write_volume};
use aplanat::grin::field::{Plume, RegularGrid};
use aplanat::grin::{
    EndCondition, GrinFate, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField as _,
    Integrator, LastStep, LaunchMode,
};
use aplanat::grin_design::{
    self, BoundaryCondition, Domain, FieldRepresentation, GrinField, GrinMethod, GrinOptimizer,
    GrinTask, InitialField, LightGoal, LightSource, ManufacturingLimits, ReferenceField,
    RefinementLevel, SourceDirections, StraightRays, TracingSettings,
};
use aplanat::math::{Real, Vec3};
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// The task of the weakest plume with few rays and a coarse grid.
fn small() -> GrinTask {
    let mut task = grin_design::find_builtin("plume").unwrap().task().unwrap();
    task.levels =
        vec![RefinementLevel { nodes: 5, steps: 8 }, RefinementLevel { nodes: 9, steps: 15 }];
    task.views[0].source =
        LightSource::Parallel { directions: SourceDirections::Around(8), radius: 0.95, rays: 150 };
    task
}

fn solved(task: &GrinTask) -> GrinOptimizer {
    task.read_files().unwrap();
    let mut runner = GrinOptimizer::new(task).unwrap();
    while !runner.step().unwrap().finished {}
    runner
}

/// A folder of this test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("aplanat-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The truth and the goal of a task.
fn with_truth(task: &GrinTask, exact: ReferenceField) -> GrinTask {
    let mut task = task.clone();
    task.views[0].goal = LightGoal::Like { field: exact.clone(), direction: 1.0 };
    task.exact = Some(exact);
    task
}

/// Writes raw numbers with a header; the name of the header.
fn raw(folder: &Path, numbers: &str, map: &str, bytes: &[u8]) -> PathBuf {
    let nodes = 64;
    let header = format!(
        r#"{{"aplanat_volume": 1, "counts": [{nodes}, {nodes}, {nodes}], "low": [-1, -1, -1],
            "spacing": [{h}, {h}, {h}], "numbers": "{numbers}", {map} "data": "{numbers}.raw"}}"#,
        h = 2.0 / 63.0,
    );
    std::fs::write(folder.join(format!("{numbers}.raw")), bytes).unwrap();
    let path = folder.join(format!("{numbers}.json"));
    std::fs::write(&path, header).unwrap();
    path
}

/// The density of the plume, 0 to 1, at the nodes of 64³.
fn densities() -> Vec<f64> {
    let plume = Plume::<f64>::new(0.0, 1.0, 1.0);
    let grid = RegularGrid::cube(64, 1.0).unwrap();
    (0..grid.node_count()).map(|n| plume.sample(grid.node(n)).index.clamp(0.0, 1.0)).collect()
}

#[test]
fn grin_a_custom_volume_is_recovered_in_any_precision() {
    let folder = folder("own-volume");
    let q = densities();
    let map = |scale: f64| format!(r#""offset": 1.0003, "scale": {scale},"#);
    let u8s: Vec<u8> = q.iter().map(|q| (255.0 * q).round() as u8).collect();
    let u16s: Vec<u8> =
        q.iter().flat_map(|q| ((65535.0 * q).round() as u16).to_le_bytes()).collect();
    let f32s: Vec<u8> = q.iter().flat_map(|q| (*q as f32).to_le_bytes()).collect();
    let f64s: Vec<u8> = q.iter().flat_map(|q| q.to_le_bytes()).collect();
    let cases = [
        ("u8", map(-0.0003 / 255.0), u8s, 0.25),
        ("u16", map(-0.0003 / 65535.0), u16s, 0.25),
        ("f32", map(-0.0003), f32s, 0.25),
        ("f64", map(-0.0003), f64s, 0.25),
    ];
    for (numbers, map, bytes, limit) in cases {
        let path = raw(&folder, numbers, &map, &bytes);
        let mut task = with_truth(&small(), ReferenceField::Volume(path.clone().into()));
        task.field = FieldRepresentation::Trilinear { half: 1.0 };
        task.edge = Some(BoundaryCondition { index: 1.0003, fixed: true, weight: 0.0 });
        let text = serde_json::to_string(&task).unwrap();
        let task = grin_design::read_task(&text, "a task").unwrap();
        let runner = solved(&task);
        let found = task.difference(runner.best()).unwrap().unwrap();
        println!("own volume, {numbers}: {found:?}");
        assert!(found.relative_to_contrast < limit, "{numbers}: {found:?}");
        let judged = runner.score(runner.best()).unwrap();
        assert_eq!(judged.views[0].counts.excluded().count(), 0);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn grin_an_invalid_volume_is_refused_with_a_reason() {
    let folder = folder("wrong-volume");
    let refused = |path: PathBuf| {
        let task = with_truth(&small(), ReferenceField::Volume(path.into()));
        task.read_files().unwrap_err().to_string()
    };
    let says = |found: String, words: &[&str]| {
        words.iter().for_each(|word| assert!(found.contains(word), "`{found}`: no `{word}`"));
    };
    let few = raw(&folder, "u8", "", &[1; 1000]);
    says(refused(few), &["u8.raw", "1000 values for [64, 64, 64] nodes"]);
    let empty = raw(&folder, "u8", "", &[]);
    says(refused(empty), &["u8.raw", "0 values for [64, 64, 64] nodes"]);
    let odd = raw(&folder, "f32", "", &[0; 1001]);
    says(refused(odd), &["f32.raw", "1001 bytes", "4 bytes"]);
    let mut values = vec![1.0; 64 * 64 * 64];
    values[64 * 64 + 3] = f64::NAN;
    let bytes = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    says(refused(raw(&folder, "f64", "", &bytes(&values))), &["f64.raw", "NaN at node [3, 0, 1]"]);
    values[64 * 64 + 3] = 0.99;
    let low = refused(raw(&folder, "f64", "", &bytes(&values)));
    says(low, &["node [3, 0, 1]", "0.99", "1 or more", "offset + scale"]);
    let plain = raw(&folder, "u8", "", &vec![0; 64 * 64 * 64]);
    says(refused(plain), &["node [0, 0, 0] has the index 0"]);
    let text = std::fs::read_to_string(raw(&folder, "f64", "", &bytes(&vec![1.0; 64 * 64 * 64])));
    let short = folder.join("short.json");
    std::fs::write(&short, text.unwrap().replace("\"low\": [-1, -1, -1]", "\"low\": [-1, 0, -1]"))
        .unwrap();
    says(refused(short), &["exact", "short.json", "from 0 to 2 mm along y", "[-1.0, 1.0]"]);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn grin_a_uniform_volume_is_recovered_at_once() {
    let folder = folder("empty-volume");
    let path = folder.join("air.npz");
    let grid = RegularGrid::cube(2, 1.0).unwrap();
    write_volume(&path, &Volume { grid, values: vec![1.0003; 8] }).unwrap();
    let task = with_truth(&small(), ReferenceField::Volume(path.into()));
    let runner = solved(&task);
    let found = task.difference(runner.best()).unwrap().unwrap();
    println!("no contrast: {found:?} after {} steps", runner.steps());
    assert!(found.relative < 1e-12 && !found.relative_to_contrast.is_nan(), "{found:?}");
    assert!(runner.score(runner.best()).unwrap().loss < 1e-20);
    let chords = StraightRays::new(&task).unwrap();
    let even = chords.reconstruct(9, 5, |_| ControlFlow::Continue(())).unwrap();
    assert!(task.difference(&even).unwrap().unwrap().relative < 1e-12);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn grin_a_plume_of_one_voxel_does_not_increase_the_loss() {
    let mut task = small();
    task.field = FieldRepresentation::Trilinear { half: 1.0 };
    task.edge = None;
    task.levels = vec![RefinementLevel { nodes: 2, steps: 5 }];
    let before = GrinOptimizer::new(&task).unwrap();
    let before = before.score(before.best()).unwrap().loss;
    let runner = solved(&task);
    let after = runner.score(runner.best()).unwrap().loss;
    assert!(after.is_finite() && after <= before, "{before} {after}");
    let lines = StraightRays::new(&task).unwrap().reconstruct_by_gradients(2, 5).unwrap();
    assert!(lines.index_field().parameters().iter().all(|index| *index == 1.0003));
}

#[test]
fn grin_straight_lines_are_the_same_on_one_thread_and_on_two() {
    let task = small();
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let chords = StraightRays::new(&task).unwrap();
            assert_eq!(chords.count(), 1200);
            let mut errors = Vec::new();
            let visit = |medium: &GrinField| {
                errors.push(task.difference(medium).unwrap().unwrap().relative_to_contrast);
                ControlFlow::Continue(())
            };
            let field = chords.reconstruct(9, 8, visit).unwrap();
            (field, chords.reconstruct_by_gradients(9, 8).unwrap(), errors)
        })
    };
    let (one, two) = (on(1), on(2));
    println!("straight lines: {:.3?}", one.2);
    assert_eq!(one, two);
    // On so coarse a grid the later steps fit what straight lines cannot explain.
    let best = one.2.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(one.2.len() == 8 && best < 0.3 && one.2[7] < one.2[0], "{:?}", one.2);
    let stopped =
        StraightRays::new(&task).unwrap().reconstruct(9, 8, |_| ControlFlow::Break(())).unwrap();
    assert_eq!(task.difference(&stopped).unwrap().unwrap().relative_to_contrast, one.2[0]);
}

/// A plume much denser than the air around, a thousand times stronger than the strongest task.
fn wild() -> ReferenceField {
    ReferenceField::Plume { ambient: 1.0, contrast: 300.0, half: 1.0 }
}

#[test]
fn grin_a_chaotic_plume_is_reported_and_stays_finite() {
    let folder = folder("wild");
    let path = folder.join("wild.npz");
    let exact = wild().field::<f64>().unwrap();
    let grid = RegularGrid::cube(33, 1.0).unwrap();
    let values = (0..grid.node_count()).map(|n| exact.sample(grid.node(n)).index).collect();
    write_volume(&path, &Volume { grid, values }).unwrap();
    let mut task =
        with_truth(&small(), ReferenceField::Plume { ambient: 1.0, contrast: 0.3, half: 1.0 });
    task.launch = LaunchMode::AsGiven;
    task.field = FieldRepresentation::Trilinear { half: 1.0 };
    task.start = InitialField::Volume(path.into());
    task.edge = None;
    task.limits = ManufacturingLimits { low: 1.0, high: 301.0, slope: None, change: 1.0 };
    task.levels = vec![RefinementLevel { nodes: 33, steps: 2 }];
    task.read_files().unwrap();
    let mut runner = GrinOptimizer::new(&task).unwrap();
    let judged = runner.score(runner.best()).unwrap();
    let counts = judged.views[0].counts;
    println!("wild: {:?}", counts.excluded().collect::<Vec<_>>());
    assert!(counts.fates.count_of(GrinFate::Chaotic) > 0 && judged.loss.is_finite());
    let told: usize = counts.excluded().map(|(_, count)| count).sum();
    assert_eq!(told + counts.valid(), 1200);
    assert!(judged.views[0].retrace_error.is_finite());
    while !runner.step().unwrap().finished {}
    assert!(runner.best().index_field().parameters().iter().all(|index| index.is_finite()));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn grin_rays_lost_by_a_measurement_are_excluded_and_counted() {
    let mut task = with_truth(&small(), wild());
    task.views[0].source =
        LightSource::Parallel { directions: SourceDirections::Around(4), radius: 0.95, rays: 30 };
    let task = GrinTask {
        launch: LaunchMode::AsGiven,
        start: InitialField::Uniform(1.0),
        edge: None,
        ..task
    };
    let task = GrinTask { limits: ManufacturingLimits { high: 301.0, ..task.limits }, ..task };
    let measured = task.measurements().unwrap().remove(0);
    println!("measured: {:?}", measured.counts.excluded().collect::<Vec<_>>());
    let lost = measured.counts.total() - measured.counts.valid();
    assert!(lost > 0 && lost < 120 && measured.deflection.is_finite());
    let runner = GrinOptimizer::new(&task).unwrap();
    let judged = runner.score(runner.best()).unwrap();
    let counts = judged.views[0].counts;
    assert_eq!((counts.unmeasured, counts.total(), counts.valid()), (lost, 120, 120 - lost));
    assert!(counts.excluded().any(|(reason, n)| reason == "unmeasured" && n == lost));
    assert!(judged.loss.is_finite());
}

#[test]
fn grin_trapped_rays_are_reported() {
    // Every ray of a fish-eye without a boundary is a circle, here within the cube.
    let folder = folder("fish-eye");
    let path = folder.join("fish-eye.npz");
    let grid = RegularGrid::cube(65, 4.0).unwrap();
    let index = |p: Vec3<f64>| 8.0 / (1.0 + p.dot(p));
    let values = (0..grid.node_count()).map(|n| index(grid.node(n)).max(1.0)).collect();
    write_volume(&path, &Volume { grid, values }).unwrap();
    let mut task = small();
    task.field = FieldRepresentation::Tricubic { half: 4.0 };
    task.space = Domain::Cube { half: 4.0 };
    task.launch = LaunchMode::Scaled;
    task.start = InitialField::Volume(path.into());
    task.edge = None;
    task.exact = None;
    task.tracing = Some(TracingSettings { integrator: Integrator::LeapfrogDkd, per_voxel: 20.0 });
    task.limits = ManufacturingLimits { low: 1.0, high: 9.0, slope: None, change: 0.05 };
    task.levels = vec![RefinementLevel { nodes: 65, steps: 1 }];
    task.method = GrinMethod::Lbfgs;
    // Across the radius at 0.6 and at 1.8 mm: the far ends of their circles are at 1.7 and 0.56 mm.
    task.views[0].source = LightSource::Fan { height: 2.4, z: 0.0, rays: 2 };
    task.views[0].goal = LightGoal::Point([4.0, 0.0, 0.0]);
    task.read_files().unwrap();
    let runner = GrinOptimizer::new(&task).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    let judged = runner.score(runner.best()).unwrap();
    let counts = judged.views[0].counts;
    println!("fish-eye: {:?}", counts.excluded().collect::<Vec<_>>());
    assert!(counts.excluded().any(|(reason, count)| reason == "trapped" && count == 2));
    // A ray that does not count has a constant price: the square of the diagonal.
    let loss = judged.views[0].loss;
    assert!((loss - 192.0).abs() < 1e-9 && judged.loss.is_finite(), "{loss}");
}

#[test]
fn grin_a_plume_below_vacuum_is_refused() {
    let thin = ReferenceField::Plume { ambient: 1.0, contrast: -0.1, half: 1.0 };
    let error = GrinOptimizer::new(&with_truth(&small(), thin)).unwrap_err().to_string();
    assert!(error.contains("0.9") && error.contains("1 or more"), "{error}");
    let error = GrinOptimizer::new(&GrinTask {
        limits: ManufacturingLimits { low: 0.9, ..small().limits },
        ..small()
    });
    assert!(error.unwrap_err().to_string().contains("limits, low"));
}

/// The exits of rays from the plume, in one number type.
fn exits<R: Real>() -> Vec<Vec3<f64>> {
    let exact = ReferenceField::Plume { ambient: 1.3, contrast: -0.3, half: 1.0 };
    let field = exact.field::<R>().unwrap();
    let region = GrinRegion::cube(R::ONE);
    let end = EndCondition::Boundary { region, last: LastStep::Fractional, limit: 10_000 };
    let setup = GrinSetup {
        integrator: Integrator::BlanesMoan,
        step: R::from_f64(0.03),
        launch: LaunchMode::Scaled,
        end,
        screen: None,
    };
    let tracer = GrinTracer::new(&*field, setup).unwrap();
    let ray = |i: u32| GrinRay {
        x: Vec3::new(-2.0, 0.07 * f64::from(i) - 0.7, 0.05 * f64::from(i) - 0.5),
        v: Vec3::new(1.0, 0.0, 0.0),
    };
    let exits = (0..20).map(|i| tracer.trace(&ray(i).cast()));
    exits
        .map(|exit| {
            assert_eq!(exit.fate, GrinFate::Left);
            exit.x.value()
        })
        .collect()
}

#[test]
fn grin_the_plume_bends_light_alike_in_single_and_double_precision() {
    let pairs = exits::<f32>().into_iter().zip(exits::<f64>());
    let worst = pairs.map(|(a, b)| length(a - b)).fold(0.0, f64::max);
    println!("single precision: {worst:.1e} mm");
    assert!(worst < 1e-5, "{worst}");
}

/// The steepest slope of a field by brute force, on a lattice that knows nothing of its cells.
fn steepest(medium: &GrinField, space: Domain) -> f64 {
    let at = |i: usize| 2.0 * (i as f64 + 0.5) / 61.0 - 1.0;
    let place = |n: usize| Vec3::new(at(n % 61), at(n / 61 % 61), at(n / 61 / 61));
    let inside = (0..61 * 61 * 61).map(place).filter(|p| space.region().level(*p) < 0.0);
    inside.map(|p| length(medium.index_field().sample(p).gradient)).fold(0.0, f64::max)
}

#[test]
fn grin_the_slope_limit_holds_everywhere() {
    let free = small();
    let radial = |mut task: GrinTask| {
        task.field = FieldRepresentation::Sphere { radius: 1.0 };
        task.space = Domain::Ball { radius: 1.0 };
        task.levels = vec![RefinementLevel { nodes: 6, steps: 15 }];
        task
    };
    let trilinear = |mut task: GrinTask| {
        task.field = FieldRepresentation::Trilinear { half: 1.0 };
        task.edge = Some(BoundaryCondition { index: 1.0003, fixed: true, weight: 0.0 });
        task
    };
    for task in [free.clone(), trilinear(free.clone()), radial(free)] {
        let runner = solved(&task);
        let (slope, loss) =
            (task.extremes(runner.best()).slope, runner.score(runner.best()).unwrap().loss);
        let limit = 0.7 * slope;
        let limited = ManufacturingLimits { slope: Some(limit), ..task.limits };
        let task = GrinTask { limits: limited, ..task };
        let start = GrinOptimizer::new(&task).unwrap();
        let start = start.score(start.best()).unwrap().loss;
        let runner = solved(&task);
        let after = runner.score(runner.best()).unwrap().loss;
        let extremes = task.extremes(runner.best());
        println!(
            "{:?}: slope {slope:.3e}, allowed {limit:.3e}, {:.3e} ({:.3e} by brute force); \
             loss {loss:.1e} free, {after:.1e} limited, {start:.1e} at first",
            task.field,
            extremes.slope,
            steepest(runner.best(), task.space),
        );
        assert!(extremes.slope <= limit * (1.0 + 1e-6), "{extremes:?}");
        assert!(steepest(runner.best(), task.space) <= limit * (1.0 + 2e-3));
        assert!(extremes.slope > 0.7 * limit, "flatter than it need be: {extremes:?}");
        // A ball cannot do much about a plume: what counts is what is left of the gain.
        let kept = (start - after) / (start - loss);
        assert!(extremes.low >= 1.0 && kept > 0.75, "{extremes:?} {kept}");
    }
}

#[test]
fn grin_light_comes_from_all_around_the_axis() {
    let task = small();
    let (_, rays) = task.scoring_rays(&task.views[0]);
    let mut angles: Vec<f64> = rays.iter().map(|ray| ray.v.y.atan2(ray.v.x).to_degrees()).collect();
    assert!(rays.iter().all(|ray| ray.v.z == 0.0 && (length(ray.v) - 1.0).abs() < 1e-15));
    angles.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let even = |(i, angle): (usize, &f64)| (angle - 22.5 * (i as f64 + 0.5)).abs() < 1e-9;
    assert!(angles.len() == 8 && angles.iter().enumerate().all(even), "{angles:?}");
}
