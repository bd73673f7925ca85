//! Programs that are killed at random moments of edits, saves, optimizations, fronts and searches:
//! what was on the disk is there again, and no file is broken.

use super::merit::bundled;
use super::session_journal::{Folder, journaled, rename, reopened};
use super::session_pareto::wait;
use aplanat::files;
use aplanat::lens::{ParameterKind, add_variables};
use aplanat::merit::Goal;
use aplanat::optimize::DescentMethod;
use aplanat::optimize::pareto::ParetoSettings;
use aplanat::session::{
    Command, GrinCommand, RunKind, RunStatus, Session, SessionEvent, Severity,
    StructureSearchCommand, StructureSearchRequest,
};
use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// The variables of the environment that make [`works_until_killed`] work: its folder, and the run
/// that goes on beside the edits.
const FOLDER: &str = "APLANAT_KILL_FOLDER";
const RUN: &str = "APLANAT_KILL_RUN";
/// The age from which everything has to be there, even if the program did not wait for the disk.
const OLD: Duration = Duration::from_secs(2);

/// What goes on beside the edits and saves.
const RUNS: [&str; 5] = ["nothing", "optimization", "front", "search", "field"];

/// The program that is killed: edits and saves a lens for ever, beside a run, and tells what it has
/// done.
#[test]
#[ignore = "the program that other tests kill"]
fn works_until_killed() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let run = std::env::var(RUN).unwrap_or_default();
    let mut lens = bundled("achromat_ac254_100");
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    let mut session = journaled(lens, &folder.join("journals"));
    session.set_save_folder(folder.join("searches"));
    session.set_field_folder(folder.join("fields"));
    start(&mut session, &run);
    let mut out = std::io::stdout().lock();
    for number in 1_u64.. {
        session.poll();
        rename(&mut session, &number.to_string());
        if number % 7 == 0 {
            session.apply(Command::Save(Some(folder.join("lens.json"))));
        }
        writeln!(out, "edit {number}").unwrap();
        if number % 20 == 0 {
            session.sync_journal();
            writeln!(out, "on the disk {number}").unwrap();
            if has_recorded(&session, &folder) {
                writeln!(out, "found").unwrap();
            }
        }
        out.flush().unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn start(session: &mut Session, run: &str) {
    match run {
        "optimization" => {
            let goal = Goal::default_for(session.lens()).unwrap();
            session.apply(Command::Optimize { method: DescentMethod::Adam, goal, glasses: None });
        }
        "front" => {
            let few = ParetoSettings::weighted_sum();
            let settings = ParetoSettings { points: 2, steps: 1_000_000, ..few };
            session.apply(Command::StartPareto { settings, compare: false });
        }
        "search" => {
            let request = StructureSearchRequest { minutes: Some(10.0), ..Default::default() };
            let start = StructureSearchCommand::Start(Box::new(request));
            session.apply(Command::StructureSearch(start));
        }
        "field" => {
            let open = GrinCommand::OpenBuiltin("luneburg-radial".to_owned());
            session.apply(Command::Grin(open));
            wait(session, "the task", |view, _| view.grin.run.snapshot.is_some());
            session.apply(Command::Grin(GrinCommand::Start));
        }
        _ => {}
    }
}

/// True if the journal has lenses of a run, or the search has a file.
fn has_recorded(session: &Session, folder: &Path) -> bool {
    let search = session.view().structure_search.run.snapshot;
    let saved = search.is_some_and(|run| run.checkpoint.moves.is_some());
    let journals = fs::read_dir(folder.join("journals")).into_iter().flatten().flatten();
    let mut journals =
        journals.filter(|file| file.path().extension().is_some_and(|e| e == "journal"));
    let fields = fs::read_dir(folder.join("fields")).into_iter().flatten().flatten();
    let mut fields = fields.filter(|file| file.path().extension().is_some_and(|e| e == "npz"));
    saved
        || fields.next().is_some()
        || journals.any(|file| {
            let text = fs::read(file.path()).unwrap();
            text.windows(7).any(|part| part == b"{\"run\":")
        })
}

fn start_program(folder: &Path, run: &str) -> Child {
    std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "session_kills::works_until_killed", "--ignored", "--nocapture"])
        .env(FOLDER, folder)
        .env(RUN, run)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// What a killed program has to leave.
struct Left {
    /// The last edit: it was made long before, or the program waited until it was on the disk.
    edit: u64,
    /// True if its run has left a result.
    found: bool,
}

/// Kills the program after it has worked for a while.
#[expect(clippy::disallowed_methods, reason = "the test measures time")]
fn kill_after(folder: &Path, run: &str, time: Duration) -> Left {
    let mut child = start_program(folder, run);
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let (mut edits, mut left): (Vec<(Instant, u64)>, Left) =
        (Vec::new(), Left { edit: 0, found: false });
    while edits.first().is_none_or(|(begun, _)| begun.elapsed() < time) {
        let line = lines.next().expect("it works until it is killed").unwrap();
        if let Some(number) = line.strip_prefix("on the disk ") {
            left.edit = number.parse().unwrap();
        } else if let Some((_, number)) = line.split_once("edit ") {
            edits.push((Instant::now(), number.parse().unwrap()));
        }
        left.found |= line == "found";
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let old = edits.iter().filter(|(made, _)| made.elapsed() > OLD);
    left.edit = old.map(|(_, number)| *number).fold(left.edit, u64::max);
    left
}

/// The number of the last edit that is there after a kill, and what a run has left.
fn found(folder: &Path, run: &str) -> Left {
    let file = folder.join("lens.json");
    let saved = file.exists().then(|| files::open(&file).expect("no file is broken").lens);
    let (session, text) = reopened(&folder.join("journals"));
    let name = match &text {
        Some(_) => session.lens().name.clone(),
        None => saved.map_or_else(String::new, |lens| lens.name),
    };
    let interrupted = |title: &str| title.contains("interrupted");
    let found = match run {
        "search" => resumes(folder),
        "field" => reopens_field(folder),
        _ => session.view().history.iter().any(|node| interrupted(&node.title)),
    };
    Left { edit: name.parse().unwrap_or(0), found }
}

/// True if an unfinished search is found, and goes on.
fn resumes(folder: &Path) -> bool {
    let mut session = Session::new(bundled("singlet_la1131"), || {}).unwrap();
    session.set_save_folder(folder.join("searches"));
    let Some(path) = session.view().structure_search.unfinished else { return false };
    session.apply(Command::StructureSearch(StructureSearchCommand::ResumeFrom(path)));
    wait(&mut session, "the search", |view, events| {
        let errors = view.messages.iter().filter(|message| message.severity == Severity::Error);
        assert_eq!(errors.count(), 0, "{:?}", view.messages);
        events.contains(&SessionEvent::Run(RunKind::StructureSearch, RunStatus::Running))
    });
    true
}

/// True if the field of an interrupted design is found, and opens.
fn reopens_field(folder: &Path) -> bool {
    let mut session = Session::new(bundled("singlet_la1131"), || {}).unwrap();
    session.set_field_folder(folder.join("fields"));
    if session.view().messages.is_empty() {
        return false;
    }
    wait(&mut session, "the field", |view, _| {
        let errors = view.messages.iter().filter(|message| message.severity == Severity::Error);
        assert_eq!(errors.count(), 0, "{:?}", view.messages);
        view.grin.run.snapshot.is_some()
    });
    true
}

/// Kills programs with these runs at these times at once, each in a folder of its own.
fn kills(times: impl Iterator<Item = (&'static str, Duration)>) {
    let one = |(i, (run, time)): (usize, (&'static str, Duration))| {
        let work = move || {
            let folder = Folder::new(&format!("kill-{i}-{run}"));
            let left = kill_after(&folder.0, run, time);
            let found = found(&folder.0, run);
            let (edit, safe) = (found.edit, left.edit);
            assert!(edit >= safe, "{run}, {time:?}: edit {edit} was found, not {safe}");
            assert!(found.found || !left.found, "{run}, {time:?}: the run has left nothing");
        };
        std::thread::Builder::new().spawn(work).unwrap()
    };
    let all: Vec<_> = times.enumerate().map(one).collect();
    all.into_iter().for_each(|thread| thread.join().unwrap());
}

#[test]
fn a_program_that_is_killed_loses_nothing() {
    let times = [90, 250, 400, 30, 350].map(Duration::from_millis);
    kills(RUNS.into_iter().zip(times));
}
