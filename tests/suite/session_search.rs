//! The structure search of a session: paused, controlled, saved, resumed, accepted, stopped.

use super::merit::bundled;
use super::session_pareto::wait;
use aplanat::lens::{Aperture, Lens};
use aplanat::merit::{Goal, Merit, Term, WeightedTerm};
use aplanat::search::{
    MutationKind, SearchMethod, SearchRules, SearchSettings, SteerCommand, Temperature,
};
use aplanat::session::{
    Command, EndReason, RunKind, RunStatus, Session, SessionEvent, SessionView, Severity,
    StructureSearchCommand, StructureSearchRequest, StructureSearchSnapshot,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

fn session(lens: Lens) -> Session {
    Session::new(lens, || {}).unwrap()
}

fn double_gauss() -> Lens {
    bundled("double_gauss_rudolph_50")
}

/// A search by RESTORE with two chains with short moves that ends after some of them, or not by itself.
fn quest(moves: Option<u64>) -> StructureSearchRequest {
    let mut quest = StructureSearchRequest::default();
    let (settings, method) = (quest.plan.settings, SearchMethod::Restore);
    quest.plan.settings =
        SearchSettings { method, chains: 2, moves, gradients: None, remembered: 8, ..settings };
    quest.plan.local.steps = 2;
    quest.minutes = Some(10.0);
    quest
}

fn explore(session: &mut Session, wish: StructureSearchCommand) -> Vec<SessionEvent> {
    session.apply(Command::StructureSearch(wish))
}

fn start(session: &mut Session, moves: Option<u64>) {
    explore(session, StructureSearchCommand::Start(Box::new(quest(moves))));
}

fn stands(session: &mut Session, standing: RunStatus) {
    wait(session, "the standing", |_, events| {
        events.contains(&SessionEvent::Run(RunKind::StructureSearch, standing))
    });
}

fn run(session: &Session) -> Arc<StructureSearchSnapshot> {
    session.view().structure_search.run.snapshot.unwrap()
}

fn moves(view: &SessionView) -> u64 {
    view.structure_search.run.snapshot.as_ref().map_or(0, |run| run.statistics.moves)
}

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("aplanat-search-{name}-{}", std::process::id()))
}

#[test]
fn a_search_runs_pauses_and_ends_without_changing_the_design() {
    let mut session = session(double_gauss());
    start(&mut session, None);
    assert_eq!(session.view().structure_search.run.status, RunStatus::Starting);
    wait(&mut session, "some moves", |view, _| moves(view) > 6);
    explore(&mut session, StructureSearchCommand::Pause);
    assert_eq!(session.view().structure_search.run.status, RunStatus::Pausing);
    stands(&mut session, RunStatus::Paused);
    let held = run(&session);
    assert!(held.seconds > 0.0 && held.gradients > 0 && held.best.merit < held.start.merit);
    let moment = held.history.moments.last().unwrap();
    assert_eq!((moment.round, moment.chains.len()), (held.statistics.rounds, 2));
    assert_eq!(moment.best, held.best.merit);
    std::thread::sleep(Duration::from_millis(150));
    session.poll();
    assert_eq!(run(&session).statistics.moves, held.statistics.moves, "it is held");
    explore(&mut session, StructureSearchCommand::Resume);
    wait(&mut session, "more moves", |view, _| moves(view) > held.statistics.moves);
    explore(&mut session, StructureSearchCommand::Stop);
    stands(&mut session, RunStatus::Stopped);
    assert!(run(&session).best.merit <= held.best.merit, "what was found stays");
    assert!(!session.is_dirty());
    explore(&mut session, StructureSearchCommand::Clear);
    assert!(session.view().structure_search.run.snapshot.is_none());
    // The handle of a search that runs ends its thread.
    start(&mut session, None);
    drop(session);
}

#[test]
fn the_same_seed_gives_the_same_result_and_full_lineages() {
    let [first, second] = [(), ()].map(|()| {
        let mut session = session(double_gauss());
        start(&mut session, Some(60));
        stands(&mut session, RunStatus::Finished);
        run(&session)
    });
    assert_eq!(first.end_reason, Some(EndReason::Sampler(aplanat::search::RunEnd::Moves)));
    assert_eq!(first.fraction_done(), Some(1.0));
    assert_eq!(first.best.merit, second.best.merit);
    assert_eq!(first.best.lens, second.best.lens);
    assert_eq!(first.statistics, second.statistics);
    assert_eq!(first.history.marks, second.history.marks);
    let merits: Vec<f64> = first.reservoir.iter().map(|found| found.merit).collect();
    assert!(merits.is_sorted() && !merits.is_empty(), "{merits:?}");
    for found in &first.reservoir {
        let judged = found.score.as_ref().unwrap().score.as_ref().unwrap();
        assert!(judged.spot > 0.0 && judged.light > 0.0 && found.elements >= 2);
        let line: Vec<u64> = first.ancestry(found.number).map(|node| node.number).collect();
        assert!(line.first() == Some(&found.number) && line.is_sorted_by(|a, b| a > b), "{line:?}");
        assert_eq!(first.lens_by_number(found.number).unwrap(), &found.lens);
    }
}

#[test]
fn the_user_steers_a_search_between_rounds() {
    let mut session = session(double_gauss());
    start(&mut session, None);
    wait(&mut session, "some moves", |view, _| moves(view) > 2);
    let cold = run(&session).temperature;
    explore(&mut session, StructureSearchCommand::Control(SteerCommand::Pin(0)));
    explore(&mut session, StructureSearchCommand::Control(SteerCommand::Reheat));
    explore(
        &mut session,
        StructureSearchCommand::Control(SteerCommand::Weight(MutationKind::AddSinglet, 0.0)),
    );
    wait(&mut session, "the weight", |view, _| {
        let run = view.structure_search.run.snapshot.as_ref().unwrap();
        run.weights.of(MutationKind::AddSinglet) == 0.0
    });
    let steered = run(&session);
    assert_eq!(steered.pinned, Some(0));
    assert_eq!(steered.temperature.value(), 2.0 * cold.value());
    explore(&mut session, StructureSearchCommand::Control(SteerCommand::Unpin));
    explore(
        &mut session,
        StructureSearchCommand::Control(SteerCommand::Temperature(Temperature::new(0.5).unwrap())),
    );
    wait(&mut session, "the temperature", |view, _| {
        let run = view.structure_search.run.snapshot.as_ref().unwrap();
        run.temperature.value() == 0.5 && run.pinned.is_none()
    });
    explore(&mut session, StructureSearchCommand::Control(SteerCommand::Pin(1_000_000)));
    wait(&mut session, "a refusal", |view, _| {
        let refused = "generation 1000000 is not stored";
        view.messages.last().is_some_and(|said| said.text.starts_with(refused))
    });
    assert_eq!(session.view().structure_search.run.status, RunStatus::Running);
}

#[test]
fn the_layout_follows_a_chain() {
    let mut session = session(double_gauss());
    start(&mut session, None);
    explore(&mut session, StructureSearchCommand::Preview(Some(0)));
    wait(&mut session, "numbers of the chain's lens", |view, _| {
        let shown = view.preview_results.as_ref();
        shown.is_some_and(|results| results.lens.surfaces != double_gauss().surfaces)
    });
    assert!(!session.is_dirty());
    explore(&mut session, StructureSearchCommand::Preview(None));
    assert!(session.view().preview_results.is_none());
}

#[test]
fn a_found_lens_is_accepted_as_one_undo_step() {
    let mut session = session(double_gauss());
    start(&mut session, Some(20));
    stands(&mut session, RunStatus::Finished);
    let best = Arc::clone(&run(&session).reservoir[0]);
    explore(&mut session, StructureSearchCommand::Accept(best.number));
    let view = session.view();
    let title = format!("accept lens {} of the search", best.number);
    assert_eq!(view.undo.as_deref(), Some(title.as_str()));
    assert_eq!(view.lens.surfaces, best.lens.surfaces);
    let is_held = |v: &aplanat::lens::Variable| v.min.is_some() && v.min == v.max;
    assert!(!view.lens.variables.iter().any(is_held), "what was held is no variable");
    wait(&mut session, "the design beside it", |view, _| {
        let here = view.design_score.as_ref();
        here.is_some_and(|here| Arc::ptr_eq(&here.lens, &view.lens))
    });
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), double_gauss());
    explore(&mut session, StructureSearchCommand::Accept(1_000_000));
    assert_eq!(session.view().messages.last().unwrap().severity, Severity::Warning);
}

#[test]
fn a_search_left_unfinished_resumes_unchanged() {
    let folder = folder("left");
    let mut whole = session(double_gauss());
    start(&mut whole, Some(60));
    stands(&mut whole, RunStatus::Finished);

    let mut first = session(double_gauss());
    first.set_save_folder(&folder);
    assert_eq!(first.view().structure_search.unfinished, None);
    start(&mut first, Some(60));
    wait(&mut first, "some moves", |view, _| moves(view) > 10);
    drop(first);

    let mut second = session(double_gauss());
    second.set_save_folder(&folder);
    let left = second.view().structure_search.unfinished.unwrap();
    assert!(left.starts_with(&folder), "{}", left.display());
    explore(&mut second, StructureSearchCommand::ResumeFrom(left.clone()));
    assert_eq!(second.view().structure_search.unfinished, None);
    stands(&mut second, RunStatus::Finished);
    let (whole, found) = (run(&whole), run(&second));
    assert_eq!(found.best.lens, whole.best.lens);
    assert_eq!(found.statistics, whole.statistics);
    assert_eq!(found.history, whole.history, "the curve behind it is there too");
    assert_eq!((found.gradients, found.request.minutes), (whole.gradients, Some(10.0)));
    assert_eq!(found.checkpoint.moves, Some(60));
    assert_eq!(found.checkpoint.path.as_ref(), Some(&left));

    let third = &mut session(double_gauss());
    third.set_save_folder(&folder);
    explore(third, StructureSearchCommand::DismissUnfinished);
    assert!(!left.exists() && third.view().structure_search.unfinished.is_none());
    drop(second);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// The search of another process is shown as it goes on, without writing its file; it goes on here once that
/// process has left it.
#[test]
fn a_search_of_another_process_is_followed_and_then_resumed() {
    let folder = folder("followed");
    let path = folder.join("run.search.json");
    let mut worker = session(double_gauss());
    explore(&mut worker, StructureSearchCommand::SaveTo(path.clone()));
    start(&mut worker, None);
    wait(&mut worker, "a move", |view, _| moves(view) > 0);

    let mut watcher = session(double_gauss());
    explore(&mut watcher, StructureSearchCommand::Follow(path.clone()));
    wait(&mut watcher, "what was saved", |view, _| moves(view) > 0);
    let seen = moves(&watcher.view());
    wait(&mut watcher, "what is saved since", |view, _| moves(view) > seen + 2);
    assert!(run(&watcher).checkpoint.is_followed && !run(&watcher).lineage.is_empty());
    let reheat = StructureSearchCommand::Control(SteerCommand::Reheat);
    explore(&mut watcher, reheat);
    wait(&mut watcher, "a refusal", |view, _| {
        view.messages
            .last()
            .is_some_and(|said| said.text.starts_with("this search is followed, not run here"))
    });
    explore(&mut watcher, StructureSearchCommand::ResumeFrom(path.clone()));
    stands(&mut watcher, RunStatus::Failed);

    explore(&mut worker, StructureSearchCommand::Stop);
    stands(&mut worker, RunStatus::Stopped);
    let last = moves(&worker.view());
    drop(worker);
    let bytes = std::fs::read(&path).unwrap();
    explore(&mut watcher, StructureSearchCommand::Follow(path.clone()));
    wait(&mut watcher, "the end of it", |view, _| moves(view) == last);
    explore(&mut watcher, StructureSearchCommand::Stop);
    stands(&mut watcher, RunStatus::Stopped);
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "who follows does not write");
    explore(&mut watcher, StructureSearchCommand::ResumeFrom(path.clone()));
    wait(&mut watcher, "moves of its own", |view, _| moves(view) > last);
    assert!(!run(&watcher).checkpoint.is_followed);
    drop(watcher);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_dismissed_search_with_light_per_field_can_be_resumed() {
    let folder = folder("forgotten");
    let mut first = session(double_gauss());
    first.set_save_folder(&folder);
    let mut asked = quest(Some(8));
    asked.plan.light = vec![0.9, 0.8, 0.7];
    explore(&mut first, StructureSearchCommand::Start(Box::new(asked)));
    wait(&mut first, "a move", |view, _| moves(view) > 0);
    drop(first);

    let mut second = session(double_gauss());
    second.set_save_folder(&folder);
    explore(&mut second, StructureSearchCommand::DismissUnfinished);
    let forgotten = folder.join("forgotten.json");
    explore(&mut second, StructureSearchCommand::ResumeFrom(forgotten.clone()));
    stands(&mut second, RunStatus::Finished);
    assert_eq!(moves(&second.view()), 8);
    let place = run(&second).checkpoint.path.clone().unwrap();
    assert!(place != forgotten && place.exists() && !forgotten.exists(), "{}", place.display());
    drop(second);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_user_chooses_where_a_search_is_saved() {
    let folder = folder("place");
    let mut session = session(double_gauss());
    let [before, behind] = ["a.json", "b.json"].map(|name| folder.join(name));
    explore(&mut session, StructureSearchCommand::SaveTo(before.clone()));
    assert_eq!(session.view().structure_search.save_path.as_ref(), Some(&before));
    start(&mut session, None);
    explore(&mut session, StructureSearchCommand::Pause);
    stands(&mut session, RunStatus::Paused);
    assert!(before.exists());
    explore(&mut session, StructureSearchCommand::SaveTo(behind.clone()));
    wait(&mut session, "the other file", |_, _| behind.exists());
    explore(&mut session, StructureSearchCommand::SaveTo(before.join("under a file")));
    wait(&mut session, "a refusal", |view, _| {
        view.messages.last().is_some_and(|said| said.text.starts_with("the search is not saved"))
    });
    assert_eq!(
        session.view().structure_search.run.status,
        RunStatus::Paused,
        "the search is not lost"
    );
    drop(session);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_search_that_cannot_start_gives_a_reason() {
    let mut session = session(double_gauss());
    let mut wrong = quest(None);
    wrong.plan.settings.chains = 0;
    explore(&mut session, StructureSearchCommand::Start(Box::new(wrong)));
    stands(&mut session, RunStatus::Failed);
    let view = session.view();
    let why = "setting chains: found 0; expected 1 or more";
    assert_eq!(view.structure_search.run.error.as_deref(), Some(why));
    assert!(view.structure_search.run.snapshot.is_none());
    assert_eq!(view.messages.last().unwrap().severity, Severity::Error);

    let mut impossible = quest(None);
    impossible.plan.rules.track = Some(10.0);
    explore(&mut session, StructureSearchCommand::Start(Box::new(impossible)));
    stands(&mut session, RunStatus::Failed);
    let failed = session.view().structure_search.run.error.unwrap();
    assert!(
        failed.starts_with("no lens can satisfy these constraints: a track of at most 10 mm"),
        "{failed}"
    );

    let file = folder("foreign");
    std::fs::write(&file, "{\"aplanat\": 1}").unwrap();
    explore(&mut session, StructureSearchCommand::ResumeFrom(file.clone()));
    stands(&mut session, RunStatus::Failed);
    let failed = session.view().structure_search.run.error.unwrap();
    assert!(failed.contains("no checkpoint of a search over lenses"), "{failed}");
    // The reason is that of a search of this design, and not of the next one.
    session.apply(Command::New(Box::new(double_gauss())));
    assert_eq!(session.view().structure_search.run.error, None);
    std::fs::remove_file(&file).unwrap();

    start(&mut session, Some(4));
    assert!(session.view().structure_search.run.error.is_none());
    stands(&mut session, RunStatus::Finished);
}

/// Has the start of a search finished and exported.
fn export(rules: impl Fn(&mut SearchRules), path: &Path) -> Session {
    let mut session = session(double_gauss());
    let mut asked = quest(Some(2));
    rules(&mut asked.plan.rules);
    explore(&mut session, StructureSearchCommand::Start(Box::new(asked)));
    stands(&mut session, RunStatus::Finished);
    explore(&mut session, StructureSearchCommand::Export { number: 0, path: path.to_owned() });
    assert_eq!(session.view().structure_search.exporting, [0]);
    wait(&mut session, "the end of it", |view, _| view.structure_search.exporting.is_empty());
    session
}

#[test]
fn a_lens_is_exported_only_when_every_limit_holds() {
    let folder = folder("export");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("made.json");
    let session = export(|_| {}, &path);
    let said = session.view().messages.last().unwrap().clone();
    assert_eq!(said.severity, Severity::Note, "{}", said.text);
    assert!(said.text.starts_with("lens 0 finalized and exported to "), "{}", said.text);
    let made = aplanat::files::open(&path).unwrap().lens;
    assert!(made.surfaces.len() == double_gauss().surfaces.len() && made.variables.is_empty());
    assert!(!session.is_dirty());
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn an_impossible_lens_is_refused_with_the_limit() {
    let path = folder("refused.json");
    let session = export(|rules| rules.track = Some(40.0), &path);
    let said = session.view().messages.last().unwrap().clone();
    assert_eq!(said.severity, Severity::Error);
    let first = "nothing is written: the lens cannot be manufactured within its constraints\n";
    assert!(said.text.starts_with(first) && said.text.contains("total track"), "{}", said.text);
    assert!(!path.exists());
}

/// The search asks for what the merit function of the design asks for, under the tighter ones of its
/// limits and those of the search.
#[test]
fn a_search_has_the_merit_function_of_the_design() {
    let mut session = session(double_gauss());
    let track = 1.05 * session.lens().total_track();
    let mut own = Goal::default_for(session.lens()).unwrap();
    let is_track = |weighted: &WeightedTerm| matches!(weighted.term, Term::TotalTrack(_));
    own.terms.iter_mut().filter(|w| is_track(w)).for_each(|w| w.term = Term::TotalTrack(track));
    session.apply(aplanat::lens::Edit::SetMerit(Some(own.clone())).into());
    start(&mut session, Some(2));
    stands(&mut session, RunStatus::Finished);
    let found = run(&session);
    let asked = found.request.plan.goal.clone().unwrap();
    for term in own.terms.iter().filter(|weighted| !weighted.term.is_limit() || is_track(weighted))
    {
        assert!(asked.terms.contains(term), "{term:?}");
    }
    let merit = Merit::new(session.lens(), &asked, 1e-3).unwrap();
    let value = merit.value(&merit.values(session.lens())).unwrap();
    assert!((found.start.merit / value - 1.0).abs() < 0.2, "{} {value}", found.start.merit);
    let thinnest = |goal: &Goal| {
        goal.terms.iter().find_map(|weighted| match weighted.term {
            Term::GlassCenter { min, .. } => Some(min),
            _ => None,
        })
    };
    assert!(thinnest(&own) < thinnest(&asked), "{asked:?}");
    assert_eq!(thinnest(&asked), Some(SearchRules::default().glass_center[0]));
    // A limit that is set for the search alone counts if it is tighter.
    let mut shorter = quest(Some(2));
    shorter.plan.rules.track = Some(0.9 * track);
    explore(&mut session, StructureSearchCommand::Start(Box::new(shorter)));
    stands(&mut session, RunStatus::Finished);
    let asked = run(&session).request.plan.goal.clone().unwrap();
    let limit = WeightedTerm::new(Term::TotalTrack(0.9 * track), 1.0);
    assert!(asked.terms.contains(&limit), "{asked:?}");
}

/// The stop that a search varies does not replace the aperture of the design without a word, and rims
/// that nobody has fixed are not fixed by it.
#[test]
fn a_found_lens_has_the_kind_of_aperture_of_the_design() {
    let mut lens = bundled("cooke_triplet_100_f27");
    let f_number = Aperture::FNumber(4.0);
    lens.aperture = f_number;
    lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
    let mut session = session(lens);
    start(&mut session, Some(6));
    stands(&mut session, RunStatus::Finished);
    let best = Arc::clone(&run(&session).reservoir[0]);
    assert!(matches!(best.lens.aperture, Aperture::StopSemiDiameter(_)));
    explore(&mut session, StructureSearchCommand::Accept(best.number));
    let text = session.view().messages.last().unwrap().text.clone();
    let lens = session.lens();
    if lens.aperture == f_number {
        assert!(text.contains("f/4 as before"), "{text}");
        let stop = lens.stop().unwrap();
        assert_eq!(lens.surfaces[stop].semi_diameter, None, "nobody has fixed it");
    } else {
        assert!(text.contains("would be darker"), "{text}");
    }
}
