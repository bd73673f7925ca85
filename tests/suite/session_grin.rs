//! The gradient-index field of a session: opened, shown, designed, paused, stopped, written; the same
//! field as without a window, and wrong files refused.

use super::session_pareto::wait;
use aplanat::files::{Volume, read_volume, write_volume};
use aplanat::grin::field::RegularGrid;
use aplanat::grin_design::{
    self, GrinField, GrinOptimizer, GrinTask, RefinementLevel, SlicePlane, SpatialAxis,
};
use aplanat::lens::blank;
use aplanat::math::Vec3;
use aplanat::session::{
    Command, GrinCommand, GrinRun, GrinView, RunStatus, Session, SessionEvent, Severity, Slice,
    SliceQuantity, SliceSettings,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn session() -> Session {
    Session::new(blank(), || {}).unwrap()
}

/// A folder of a test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("aplanat-{name}-{}", std::process::id()));
    std::fs::remove_dir_all(&folder).unwrap_or_default();
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A built-in task with few steps at a coarse resolution.
fn coarse(name: &str, levels: &[RefinementLevel]) -> GrinTask {
    let task = grin_design::find_builtin(name).unwrap().task().unwrap();
    GrinTask { levels: levels.to_vec(), ..task }
}

fn write_task(path: &Path, task: &GrinTask) {
    std::fs::write(path, serde_json::to_string(task).unwrap()).unwrap();
}

fn form(session: &mut Session, wish: GrinCommand) {
    session.apply(Command::Grin(wish));
}

fn forming(session: &Session) -> GrinView {
    session.view().grin
}

fn run(session: &Session) -> Arc<GrinRun> {
    forming(session).run.snapshot.unwrap()
}

/// Waits until what is open stands so, whatever it stood like before.
fn stands(session: &mut Session, standing: RunStatus) {
    wait(session, "the standing", |view, _| {
        let GrinView { run, opening, .. } = &view.grin;
        run.status == standing && !opening
    });
}

fn open(session: &mut Session, path: &Path) {
    form(session, GrinCommand::OpenFile(path.to_owned()));
    wait(session, "the opening", |view, _| !view.grin.opening);
}

/// Waits for a slice of the field as it is, looked at as it is asked for.
fn slice(session: &mut Session) -> Slice {
    wait(session, "a slice", |view, _| {
        let forming = &view.grin;
        let run = forming.run.snapshot.as_ref().unwrap();
        forming.slice.as_ref().and_then(|slice| slice.as_ref().as_ref().ok()).is_some_and(|slice| {
            Arc::ptr_eq(&slice.field, &run.field) && slice.settings == forming.slice_settings
        })
    });
    forming(session).slice.unwrap().as_ref().as_ref().unwrap().clone()
}

/// Files that the session refuses to open.
fn refused(session: &mut Session, path: &Path) -> String {
    open(session, path);
    let said = session.view().messages.last().cloned().unwrap();
    assert_eq!(said.severity, Severity::Error, "{}", said.text);
    assert_eq!(forming(session).run.error, Some(said.text.clone()));
    said.text
}

#[test]
fn a_background_design_is_bit_identical_to_a_headless_one() {
    let folder = folder("forming");
    let path = folder.join("task.json");
    let task = coarse(
        "luneburg",
        &[RefinementLevel { nodes: 3, steps: 12 }, RefinementLevel { nodes: 5, steps: 100_000 }],
    );
    write_task(&path, &task);
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    open(&mut session, &path);
    assert!(run(&session).is_ready());
    form(&mut session, GrinCommand::Start);
    wait(&mut session, "steps", |view, _| {
        view.grin.run.snapshot.as_ref().is_some_and(|run| {
            run.progress.as_ref().is_some_and(|progress| progress.step > 15 && progress.level == 1)
        })
    });
    form(&mut session, GrinCommand::Pause);
    stands(&mut session, RunStatus::Paused);
    let held = run(&session);
    slice(&mut session);
    std::thread::sleep(std::time::Duration::from_millis(60));
    session.poll();
    assert_eq!(run(&session).progress, held.progress, "it is held");
    form(&mut session, GrinCommand::Resume);
    stands(&mut session, RunStatus::Running);
    form(&mut session, GrinCommand::Stop);
    stands(&mut session, RunStatus::Stopped);

    let stopped = run(&session);
    let steps = stopped.progress.as_ref().unwrap().step;
    let mut headless = GrinOptimizer::new(&task).unwrap();
    for _ in 0..steps {
        headless.step().unwrap();
    }
    headless.finish().unwrap();
    assert_eq!(*stopped.field, *headless.best(), "after {steps} steps");
    assert_eq!(stopped.rays, headless.rays_traced());
    assert!(stopped.history.len() > 10 && stopped.seconds > 0.0);

    for name in ["field.npz", "field.json"] {
        let file = folder.join(name);
        form(&mut session, GrinCommand::Save { path: file.clone(), nodes: 65 });
        wait(&mut session, "the file", |_, events| {
            events.contains(&SessionEvent::Saved(file.clone()))
        });
        assert_eq!(read_volume(&file).unwrap(), headless.best().volume(task.space, 65).unwrap());
    }
    form(&mut session, GrinCommand::Save { path: folder.join("field.txt"), nodes: 65 });
    wait(&mut session, "a refusal", |view, _| {
        view.messages.last().is_some_and(|said| said.text.contains("ends in .npz or .json"))
    });

    form(&mut session, GrinCommand::Start);
    stands(&mut session, RunStatus::Running);
    assert!(run(&session).progress.as_ref().is_none_or(|progress| progress.step < steps), "anew");
    form(&mut session, GrinCommand::Close);
    assert!(forming(&session).run.snapshot.is_none() && forming(&session).slice.is_none());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn nothing_is_computed_before_a_document_is_open_and_shown() {
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    form(&mut session, GrinCommand::Start);
    assert_eq!(
        session.view().messages.last().unwrap().text,
        "there is no task to work on; open one first"
    );
    form(&mut session, GrinCommand::Save { path: "field.npz".into(), nodes: 65 });
    wait(&mut session, "a refusal", |view, _| {
        view.messages.last().is_some_and(|said| said.text.starts_with("there is no field to save"))
    });
    let GrinView { run, slice, analysis: sighting, .. } = forming(&session);
    assert!(run.snapshot.is_none() && slice.is_none() && sighting.is_none());

    form(&mut session, GrinCommand::SetActive(false));
    form(&mut session, GrinCommand::OpenBuiltin("luneburg-radial".into()));
    stands(&mut session, RunStatus::Paused);
    std::thread::sleep(std::time::Duration::from_millis(50));
    session.poll();
    let GrinView { slice, analysis: sighting, .. } = forming(&session);
    assert!(slice.is_none() && sighting.is_none(), "nobody looks");
    form(&mut session, GrinCommand::SetActive(true));
    super::session_grin::slice(&mut session);
}

#[test]
fn slices_turn_and_show_every_quantity_with_rays_and_the_exact_field() {
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    form(&mut session, GrinCommand::OpenBuiltin("luneburg-radial".into()));
    stands(&mut session, RunStatus::Paused);
    let first = slice(&mut session);
    assert_eq!(first.settings.plane, SlicePlane { axis: SpatialAxis::Y, depth: 0.0 });
    let [low, high] = first.range;
    assert!(low == high && (low - 1.0).abs() < 1e-12 && first.contours.is_empty(), "even");
    assert_eq!((first.size, first.axes()), ([240, 240], [SpatialAxis::Z, SpatialAxis::X]));
    let [rays] = &first.paths[..] else { panic!("one view") };
    assert_eq!(rays.paths.len(), first.settings.rays);
    assert!(rays.distance < 0.3 && rays.paths.iter().all(|way| way.points.len() > 2));
    assert_eq!((first.profile.along, first.profile.reference.len()), ("r", 201));
    assert!(first.difference.unwrap().relative > 0.1);

    form(&mut session, GrinCommand::Start);
    stands(&mut session, RunStatus::Finished);
    let found = slice(&mut session);
    let difference = found.difference.unwrap();
    assert!(difference.relative < 1e-4 && difference.without_offset <= difference.relative);
    assert!((found.range[1] - 2.0_f64.sqrt()).abs() < 1e-3, "{:?}", found.range);
    assert!(found.contours.len() >= 4 && found.spacing > 0.0);
    for plane in [(SpatialAxis::X, 0.3), (SpatialAxis::Z, -0.2), (SpatialAxis::Y, 7.0)] {
        for quantity in SliceQuantity::ALL {
            let plane = SlicePlane { axis: plane.0, depth: plane.1 };
            form(&mut session, GrinCommand::SetSlice(SliceSettings { plane, quantity, rays: 3 }));
            let seen = slice(&mut session);
            assert_eq!(seen.settings.plane.depth, plane.depth.min(1.0), "held within the ball");
            let numbers = seen.values.iter().filter(|value| value.is_finite());
            assert_eq!(numbers.count() > 0, plane.depth < 1.0);
            let error = quantity == SliceQuantity::Error;
            assert!(!error || seen.range[1] < 2e-3 && seen.range[0] == -seen.range[1]);
        }
    }
    wait(&mut session, "all light", |view, _| {
        let sighting = view.grin.analysis.as_deref().and_then(|seen| seen.as_ref().ok());
        let run = view.grin.run.snapshot.as_ref().unwrap();
        sighting.is_some_and(|seen| {
            let view = &seen.views.value[0];
            assert!(view.error.unwrap() < 1e-6 && view.image.is_none());
            Arc::ptr_eq(&seen.field, &run.field) && view.result.spot < 1e-3
        })
    });
}

#[test]
fn display_images_are_shown_beside_their_targets() {
    let folder = folder("display");
    let path = folder.join("task.json");
    let mut task = coarse("display", &[RefinementLevel { nodes: 4, steps: 2 }]);
    for view in &mut task.views {
        if let grin_design::LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 32;
        }
    }
    write_task(&path, &task);
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    open(&mut session, &path);
    assert_eq!(forming(&session).slice_settings.plane.axis, SpatialAxis::Z, "both beams lie in it");
    wait(&mut session, "images", |view, _| view.grin.analysis.is_some());
    let sighting = forming(&session).analysis.unwrap();
    let seen = sighting.as_ref().as_ref().unwrap();
    let runner = GrinOptimizer::new(&task).unwrap();
    let judged = runner.score(runner.current()).unwrap();
    assert_eq!(seen.views.value.len(), judged.views.len());
    for (seen, judged) in seen.views.value.iter().zip(&judged.views) {
        let image = seen.image.as_ref().unwrap();
        assert_eq!((image.target.len(), image.formed.len()), (64 * 64, 64 * 64));
        assert_eq!((seen.result.psnr, seen.result.loss), (judged.psnr, judged.loss));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        assert!((mean(&image.target) - 1.0).abs() < 1e-12);
        assert!((mean(&image.formed) - 1.0).abs() < 0.02, "nearly all light arrives");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn rays_that_do_not_count_are_drawn_and_counted_with_their_reason() {
    let folder = folder("excluded");
    let path = folder.join("task.json");
    let mut task = coarse("display", &[RefinementLevel { nodes: 4, steps: 2 }]);
    for view in &mut task.views {
        if let grin_design::LightSource::Beam { rays, half, .. } = &mut view.source {
            (*rays, *half) = (32, 1.5);
        }
    }
    write_task(&path, &task);
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    open(&mut session, &path);
    for ways in slice(&mut session).paths {
        let (lost, there): (Vec<_>, Vec<_>) =
            ways.paths.iter().partition(|way| way.excluded().is_some());
        assert!(lost.len() >= 2 && there.len() >= 4, "{} and {}", lost.len(), there.len());
        assert!(lost.iter().all(|way| way.excluded() == Some("never_entered")));
        assert!(ways.paths.iter().all(|way| way.points.len() >= 2));
    }
    wait(&mut session, "all light", |view, _| view.grin.analysis.is_some());
    let sighting = forming(&session).analysis.unwrap();
    for seen in &sighting.as_ref().as_ref().unwrap().views.value {
        let excluded: Vec<_> = seen.result.counts.excluded().collect();
        let [("never_entered", count)] = excluded[..] else { panic!("{excluded:?}") };
        assert_eq!(seen.result.counts.valid() + count, 32 * 32);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// A volume of so many nodes along each axis.
fn volume(counts: [usize; 3], value: impl Fn(usize) -> f64) -> Volume {
    let grid = RegularGrid::new(counts, Vec3::default(), Vec3::new(0.5, 0.5, 0.5)).unwrap();
    Volume { grid, values: (0..grid.node_count()).map(value).collect() }
}

#[test]
fn a_volume_is_shown_and_written_in_the_other_format() {
    let folder = folder("volume");
    let path = folder.join("volume.npz");
    let known = volume([3, 4, 5], |n| 1.0 + 0.01 * n as f64);
    write_volume(&path, &known).unwrap();
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    open(&mut session, &path);
    let seen = run(&session);
    assert_eq!(seen.document.name, "volume.npz");
    assert_eq!(forming(&session).run.status, RunStatus::Stopped);
    let seen = slice(&mut session);
    assert!(seen.paths.is_empty() && seen.difference.is_none() && seen.profile.start.is_empty());
    assert!((seen.range[0] - 1.0).abs() < 1e-12 && (seen.range[1] - 1.59).abs() < 1e-12);
    let GrinField::Trilinear(field) = &*seen.field else { panic!("a grid") };
    assert_eq!(field.grid().counts(), [3, 4, 5]);
    form(&mut session, GrinCommand::Start);
    assert_eq!(session.view().messages.last().unwrap().text, "a volume has no task to work on");
    let file = folder.join("copy.json");
    form(&mut session, GrinCommand::Save { path: file.clone(), nodes: 65 });
    wait(&mut session, "the file", |_, events| events.contains(&SessionEvent::Saved(file.clone())));
    assert_eq!(read_volume(&file).unwrap(), known);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_slice_begins_at_the_origin_or_in_the_middle() {
    let folder = folder("middle");
    let path = folder.join("volume.npz");
    let low = Vec3::new(1.0, -0.5, -3.0);
    // From 1 to 2, from -0.5 to 1 and from -3 to -1.
    let grid = RegularGrid::new([3, 4, 5], low, Vec3::new(0.5, 0.5, 0.5)).unwrap();
    write_volume(&path, &Volume { grid, values: vec![1.5; grid.node_count()] }).unwrap();
    let mut session = session();
    form(&mut session, GrinCommand::SetActive(true));
    open(&mut session, &path);
    let document = Arc::clone(&run(&session).document);
    let middle = |axis| document.middle(axis);
    assert_eq!([SpatialAxis::X, SpatialAxis::Y, SpatialAxis::Z].map(middle), [1.5, 0.0, -2.0]);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn invalid_grin_files_are_refused_and_the_open_document_stays() {
    let folder = folder("refused");
    let mut session = session();
    form(&mut session, GrinCommand::OpenBuiltin("fibre".into()));
    stands(&mut session, RunStatus::Paused);
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let task = grin_design::find_builtin("fibre").unwrap().text;
    let cases = [
        (file("lens.json", r#"{"aplanat": 1}"#), "found a lens; expected a task"),
        (file("text.txt", "no field"), "found neither; expected a task"),
        (file("empty.npz", ""), "found neither"),
        (file("broken.npz", "PK no archive"), "the arrays index, low and spacing"),
        (file("wrong.json", &task.replacen("tolerance", "tolerence", 1)), "tolerence"),
        (file("none.json", &task.replacen("\"nodes\": 6", "\"nodes\": 1", 1)), "4 to 513"),
        (folder.join("absent.json"), "cannot be read"),
    ];
    for (path, why) in cases {
        let said = refused(&mut session, &path);
        let named = said.contains(&path.display().to_string());
        assert!(named && said.contains(why), "{said}");
    }

    let path = folder.join("volume.npz");
    write_volume(&path, &volume([0, 0, 0], |_| 1.0)).unwrap();
    assert!(refused(&mut session, &path).contains("0 values for [0, 0, 0] nodes"));
    write_volume(&path, &volume([1, 1, 1], |_| 1.0)).unwrap();
    assert!(refused(&mut session, &path).contains("1 nodes along x, expected at least 2"));
    let hole = |n: usize| if n == 5 { f64::NAN } else { 1.0 };
    write_volume(&path, &volume([2, 2, 2], hole)).unwrap();
    assert!(refused(&mut session, &path).contains("one finite value for each node"));
    assert_eq!(
        run(&session).document.name,
        grin_design::find_builtin("fibre").unwrap().task().unwrap().name
    );
    std::fs::remove_dir_all(folder).unwrap();
}

/// A field that a killed program has left in the folder is opened at the next start, once, and told.
#[test]
fn the_field_of_an_interrupted_design_is_opened_again() {
    let folder = folder("grin-interrupted");
    let mut killed = session();
    form(&mut killed, GrinCommand::OpenBuiltin("luneburg-radial".into()));
    wait(&mut killed, "the task", |view, _| view.grin.run.snapshot.is_some());
    let left = folder.join("field-4000000000.npz");
    form(&mut killed, GrinCommand::Save { path: left.clone(), nodes: 9 });
    wait(&mut killed, "the file", |_, events| events.contains(&SessionEvent::Saved(left.clone())));
    let mut next = session();
    next.set_field_folder(&folder);
    let told = next.view().messages.last().unwrap().text.clone();
    assert!(told.starts_with("recovered the field of an interrupted design"), "{told}");
    wait(&mut next, "the field", |view, _| view.grin.run.snapshot.is_some());
    assert!(run(&next).document.name.starts_with("interrupted"));
    let mut later = session();
    later.set_field_folder(&folder);
    assert!(later.view().messages.is_empty(), "it is found once");
    std::fs::remove_dir_all(folder).unwrap();
}
