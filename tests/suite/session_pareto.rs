//! The Pareto sweep of a session: paused, stopped, compared, previewed, accepted, exported.

use super::merit::bundled;
use aplanat::lens::Lens;
use aplanat::optimize::pareto::ParetoSettings;
use aplanat::session::{
    Command, ParetoRun, RunKind, RunStatus, Session, SessionEvent, SessionView, Severity,
};
use std::sync::Arc;
use std::time::Duration;

fn session(lens: Lens) -> Session {
    Session::new(lens, || {}).unwrap()
}

fn double_gauss() -> Lens {
    bundled("double_gauss_rudolph_50")
}

/// A sweep that ends soon, or not by itself.
fn start(steps: usize, compare: bool) -> Command {
    Command::StartPareto {
        settings: ParetoSettings { points: 2, steps, ..ParetoSettings::weighted_sum() },
        compare,
    }
}

const SOON: usize = 4;
const NEVER: usize = 10_000_000;

/// Waits until something has happened in the background.
pub(crate) fn wait(
    session: &mut Session,
    what: &str,
    happened: impl Fn(&SessionView, &[SessionEvent]) -> bool,
) {
    let mut events = Vec::new();
    for _ in 0..30_000 {
        events.extend(session.poll());
        if happened(&session.view(), &events) {
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what} never happened");
}

fn stands(session: &mut Session, standing: RunStatus) {
    wait(session, "the standing", |_, events| {
        events.contains(&SessionEvent::Run(RunKind::Pareto, standing))
    });
}

fn run(session: &Session) -> Arc<ParetoRun> {
    session.view().pareto.run.snapshot.unwrap()
}

#[test]
fn a_sweep_pauses_resumes_and_ends_without_changing_the_design() {
    let mut session = session(double_gauss());
    session.apply(start(NEVER, false));
    assert_eq!(session.view().pareto.run.status, RunStatus::Starting);
    wait(&mut session, "a front", |view, _| {
        view.pareto.run.snapshot.as_ref().is_some_and(|run| run.main.front.points().len() > 2)
    });
    session.apply(Command::PausePareto);
    stands(&mut session, RunStatus::Paused);
    let held = run(&session);
    assert!(held.main.seconds > 0.0 && held.main.hypervolume > 0.0);
    assert!(held.fraction_done() > 0.0 && held.fraction_done() < 1.0);
    std::thread::sleep(Duration::from_millis(150));
    session.poll();
    assert_eq!(run(&session).main.done, held.main.done, "it is held");
    session.apply(Command::ResumePareto);
    wait(&mut session, "more steps", |view, _| {
        view.pareto.run.snapshot.as_ref().is_some_and(|run| run.main.done > held.main.done)
    });
    session.apply(Command::StopPareto);
    stands(&mut session, RunStatus::Stopped);
    assert!(run(&session).main.front.points().len() > 2, "what was found stays");
    assert!(!session.is_dirty());
    // The handle of a sweep that runs ends its thread.
    session.apply(start(NEVER, false));
    drop(session);
}

#[test]
fn a_front_lens_is_previewed_and_accepted_as_one_undo_step() {
    let mut session = session(double_gauss());
    session.apply(start(SOON, false));
    stands(&mut session, RunStatus::Finished);
    let run = run(&session);
    let designs = run.main.front.points();
    let best = &designs[0];
    assert!(best.spot < run.start.spot);
    let version = session.view().version;
    session.apply(Command::Preview(Some(Box::new(best.lens.clone()))));
    wait(&mut session, "its numbers", |view, _| {
        view.preview_results.as_ref().is_some_and(|results| *results.lens == best.lens)
    });
    let view = session.view();
    assert_eq!((view.version, view.dirty, view.undo), (version, false, None), "only looked at");
    session.apply(Command::Preview(None));
    assert!(session.view().preview_results.is_none() && session.view().preview_lens.is_none());

    session.apply(Command::Preview(Some(Box::new(best.lens.clone()))));
    session.apply(Command::AcceptPreview);
    let view = session.view();
    assert_eq!(view.undo.as_deref(), Some("accept a lens of the Pareto front"));
    assert!(view.preview_lens.is_none());
    assert_eq!(view.lens.surfaces, best.lens.surfaces);
    assert_eq!(view.lens.variables, double_gauss().variables, "the design's own variables");
    wait(&mut session, "where the design stands now", |view, _| {
        let here = view.design_score.as_ref();
        let here = here.filter(|here| Arc::ptr_eq(&here.lens, &view.lens));
        here.is_some_and(|here| {
            let found = here.score.as_ref().unwrap();
            (found.spot - best.spot).abs() < 1e-3 * best.spot
        })
    });
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), double_gauss());
    session.apply(Command::AcceptPreview);
    assert_eq!(session.view().messages.last().unwrap().severity, Severity::Warning);
}

#[test]
fn a_biased_sweep_follows_and_earlier_sweeps_remain() {
    let mut session = session(double_gauss());
    session.apply(start(SOON, true));
    stands(&mut session, RunStatus::Finished);
    let first = run(&session);
    let biased = first.biased.as_ref().unwrap();
    assert_eq!((first.fraction_done(), biased.done), (1.0, biased.total));
    assert!(biased.hypervolume > 0.0 && biased.hypervolume != first.main.hypervolume);
    session.apply(start(SOON, false));
    stands(&mut session, RunStatus::Finished);
    let fronts = session.view().pareto;
    assert_eq!(
        fronts.earlier.iter().filter_map(|run| Some(run.id?.number)).collect::<Vec<_>>(),
        [1]
    );
    assert_eq!(fronts.run.snapshot.unwrap().main.front, first.main.front, "the same again");

    let folder = std::env::temp_dir().join(format!("aplanat-session-{}", std::process::id()));
    session.apply(Command::ExportPareto(folder.clone()));
    wait(&mut session, "the files", |_, events| {
        events.contains(&SessionEvent::Saved(folder.clone()))
    });
    let table = std::fs::read_to_string(folder.join("front.csv")).unwrap();
    assert_eq!(table.lines().count(), 2 + first.main.front.points().len());
    std::fs::remove_dir_all(&folder).unwrap();

    session.apply(Command::ClearPareto);
    let fronts = session.view().pareto;
    assert!(fronts.run.snapshot.is_none() && fronts.earlier.is_empty());
    assert!(session.view().design_score.is_none());
    session.apply(Command::ExportPareto(folder.clone()));
    wait(&mut session, "a refusal", |view, _| {
        view.messages.last().is_some_and(|said| said.text == "there is no front to export yet")
    });
    assert!(!folder.exists());
}

#[test]
fn a_sweep_that_cannot_start_gives_a_reason() {
    let mut session = session(double_gauss());
    let settings = ParetoSettings { points: 0, ..ParetoSettings::default() };
    session.apply(Command::StartPareto { settings, compare: false });
    stands(&mut session, RunStatus::Failed);
    let view = session.view();
    let why = "the number of points is 0; expected 1 to 1000";
    assert_eq!(view.pareto.run.error.as_deref(), Some(why));
    assert!(view.pareto.run.snapshot.is_none());
    assert_eq!(view.messages.last().unwrap().severity, Severity::Error);
    session.apply(start(SOON, false));
    assert!(session.view().pareto.run.error.is_none());
    stands(&mut session, RunStatus::Finished);
    session.apply(Command::New(Box::new(aplanat::lens::blank())));
    assert!(session.view().pareto.run.snapshot.is_none(), "another lens has no front yet");
}
