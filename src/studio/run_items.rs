//! Requests to the runs and to what panels show, for the command palette: what a panel offers by
//! buttons is found by words, too.

use super::actions::UiAction;
use super::menu_items::MenuItem;
use crate::effects::{Effect, EffectOverride};
use crate::grin_design;
use crate::lens::{Lens, Object, ParameterKind};
use crate::optimize::DescentMethod;
use crate::optimize::pareto::ParetoSettings;
use crate::paraxial::FirstOrderLock;
use crate::session::{
    Command, GrinCommand, RunStatus, RunView, SessionView, SpecifiedDesignCommand,
    StructureSearchCommand,
};
use crate::studio::panels::{PanelKind, add_variables_edit, term_edits};

/// The title of the request that starts an optimization.
const OPTIMIZE: &str = "Optimize";

/// A request with its title; `None` while it makes no sense.
type Request = (&'static str, Option<Command>);

/// The commands of the optimization, the front, the search, the field and the candidate, which waits for
/// its dialog if it is the preview of one.
pub(super) fn commands(view: &SessionView, has_preview: bool) -> Vec<MenuItem> {
    let groups = [
        ("Optimizer", optimizer(view)),
        ("Front", front(view)),
        ("Search", search(view)),
        ("Gradient index", field(view)),
        ("Specification", specified_design(view)),
        ("Candidate", candidate(view, has_preview)),
        ("Variables", variables(&view.lens)),
    ];
    let obstacle = optimize_obstacle(view);
    let items = |(menu, requests): (&'static str, Vec<Request>)| {
        requests.into_iter().map(move |(title, command)| {
            let item = MenuItem::maybe(menu, title, command.map(Into::into));
            MenuItem { why_not: if title == OPTIMIZE { obstacle } else { "" }, ..item }
        })
    };
    let tasks = grin_design::BUILTIN_TASKS.iter().map(|task| {
        let open = GrinCommand::OpenBuiltin(task.name.to_owned());
        MenuItem::new("Gradient index", format!("Open the task {}", task.name), open)
    });
    let terms = term_edits(view)
        .into_iter()
        .map(|(title, edit)| MenuItem::new("Merit function", format!("Add a term: {title}"), edit));
    groups.into_iter().flat_map(items).chain([watch(view)]).chain(tasks).chain(terms).collect()
}

/// The item that gives a search the window.
fn watch(view: &SessionView) -> MenuItem {
    let search = &view.structure_search;
    let chain = search.previewed_chain.unwrap_or(0);
    let watch = search.run.snapshot.as_ref().map(|_| UiAction::WatchSearch(chain));
    MenuItem::maybe("Search", "Watch the search in the whole window", watch)
}

/// The reason why no optimization can begin; empty if one can.
fn optimize_obstacle(view: &SessionView) -> &'static str {
    if view.optimization.is_active() {
        "An optimization is running: stop it first."
    } else if view.lens.variables.is_empty() {
        "No number of the lens is variable: vary all curvatures, or press Ctrl+Shift+V on a number of the \
         table."
    } else if view.goal.is_none() {
        "The lens has no merit function yet."
    } else {
        ""
    }
}

/// The reason why an item makes no sense now, in words.
pub(super) fn disabled_reason(item: &MenuItem) -> String {
    if !item.why_not.is_empty() {
        return item.why_not.to_owned();
    }
    let run = match item.menu {
        "Element" => {
            return "Select a surface of an element first, in the table or in the drawing.".into();
        }
        "Edit" if item.title.starts_with("Redo") => return "There is nothing to redo.".into(),
        "Edit" => return "There is nothing to undo.".into(),
        "File" => return "There is no front: start one in the panel Pareto front.".into(),
        "Candidate" => return "There is no candidate: a run or the history shows one.".into(),
        "Optimizer" => "optimization",
        "Front" => "front",
        "Search" => "search",
        "Gradient index" => "design of a field",
        "Specification" => "design from a specification",
        _ => return "Not possible now.".into(),
    };
    match item.title.split(' ').next() {
        Some("Start") => format!("A {run} is running: stop it first."),
        Some("Pause") => format!("No {run} is running, or it is paused already."),
        Some("Stop") => format!("No {run} is running."),
        Some("Resume" | "Take") => format!("No {run} is paused."),
        Some("Design") => "No field is open, or its design is running.".to_owned(),
        Some("Close") => "No field is open.".to_owned(),
        _ => format!("There is no result of a {run}: start one first."),
    }
}

/// The panel that shows the run that a command starts.
pub(super) fn panel_of_run(command: &Command) -> Option<PanelKind> {
    match command {
        Command::Optimize { .. } => Some(PanelKind::Optimizer),
        Command::StartPareto { .. } => Some(PanelKind::Pareto),
        Command::StructureSearch(
            StructureSearchCommand::StartShown(_) | StructureSearchCommand::ResumeFrom(_),
        ) => Some(PanelKind::Search),
        Command::Grin(GrinCommand::Start | GrinCommand::OpenBuiltin(_)) => Some(PanelKind::Slice),
        Command::SpecifiedDesign(
            SpecifiedDesignCommand::Start(_) | SpecifiedDesignCommand::ResumeUnfinished,
        ) => Some(PanelKind::Specification),
        _ => None,
    }
}

/// A command for a run that waits, or takes steps.
fn for_run<S>(run: &RunView<S>, command: Command) -> Option<Command> {
    run.is_active().then_some(command)
}

fn optimizer(view: &SessionView) -> Vec<Request> {
    let run = &view.optimization;
    let is_paused = run.status == RunStatus::Paused;
    let ready = !run.is_active() && !view.lens.variables.is_empty();
    let goal = view.goal.as_ref().filter(|_| ready);
    let method = DescentMethod::default();
    let start =
        goal.map(|goal| Command::Optimize { method, goal: (**goal).clone(), glasses: None });
    let has_result = run.snapshot.is_some();
    vec![
        (OPTIMIZE, start),
        ("Pause the optimization", for_run(run, Command::Pause).filter(|_| !is_paused)),
        ("Resume the optimization", is_paused.then_some(Command::Resume)),
        ("Take one step of the optimization", is_paused.then_some(Command::Step)),
        ("Stop the optimization", for_run(run, Command::Stop)),
        ("Accept the optimized lens", has_result.then_some(Command::AcceptResult)),
        ("Discard the optimized lens", has_result.then_some(Command::DiscardResult)),
    ]
}

fn front(view: &SessionView) -> Vec<Request> {
    let run = &view.pareto.run;
    let is_paused = run.status == RunStatus::Paused;
    let idle = !run.is_active();
    let start = Command::StartPareto { settings: ParetoSettings::default(), compare: false };
    vec![
        ("Start a Pareto front with default settings", idle.then_some(start)),
        ("Pause the front", for_run(run, Command::PausePareto).filter(|_| !is_paused)),
        ("Resume the front", is_paused.then_some(Command::ResumePareto)),
        ("Stop the front", for_run(run, Command::StopPareto)),
        ("Dismiss the front", run.snapshot.as_ref().map(|_| Command::ClearPareto)),
    ]
}

fn search(view: &SessionView) -> Vec<Request> {
    let run = &view.structure_search.run;
    let is_paused = run.status == RunStatus::Paused;
    let wish = |command| Command::StructureSearch(command);
    let start = wish(StructureSearchCommand::StartShown(Box::default()));
    let unfinished = view.structure_search.unfinished.clone();
    let active = |command| for_run(run, wish(command));
    vec![
        ("Start a search with default settings", (!run.is_active()).then_some(start)),
        (
            "Resume the unfinished search",
            unfinished.map(|path| wish(StructureSearchCommand::ResumeFrom(path))),
        ),
        ("Pause the search", active(StructureSearchCommand::Pause).filter(|_| !is_paused)),
        ("Resume the search", is_paused.then(|| wish(StructureSearchCommand::Resume))),
        ("Stop the search", active(StructureSearchCommand::Stop)),
        (
            "Accept the best lens of the search",
            run.snapshot.as_ref().map(|run| wish(StructureSearchCommand::Accept(run.best.number))),
        ),
        ("Dismiss the search", run.snapshot.as_ref().map(|_| wish(StructureSearchCommand::Clear))),
    ]
}

fn field(view: &SessionView) -> Vec<Request> {
    let run = &view.grin.run;
    let is_paused = run.status == RunStatus::Paused;
    let is_ready = run.snapshot.as_ref().is_some_and(|run| run.is_ready());
    let wish = Command::Grin;
    vec![
        ("Design the field", is_ready.then(|| wish(GrinCommand::Start))),
        (
            "Pause the design of the field",
            for_run(run, wish(GrinCommand::Pause)).filter(|_| !is_paused),
        ),
        (
            "Resume the design of the field",
            (is_paused && !is_ready).then(|| wish(GrinCommand::Resume)),
        ),
        ("Stop the design of the field", for_run(run, wish(GrinCommand::Stop))),
        ("Close the field", run.snapshot.as_ref().map(|_| wish(GrinCommand::Close))),
    ]
}

fn specified_design(view: &SessionView) -> Vec<Request> {
    let run = &view.specified_design.run;
    let is_paused = run.status == RunStatus::Paused;
    let wish = Command::SpecifiedDesign;
    let unfinished = view.specified_design.unfinished.as_ref().filter(|_| !run.is_active());
    let best = run.snapshot.as_ref().and_then(|design| design.lenses.first());
    let pause = wish(SpecifiedDesignCommand::Pause);
    vec![
        ("Pause the design from a specification", for_run(run, pause).filter(|_| !is_paused)),
        (
            "Resume the design from a specification",
            match (is_paused, unfinished) {
                (true, _) => Some(wish(SpecifiedDesignCommand::Resume)),
                (false, Some(_)) => Some(wish(SpecifiedDesignCommand::ResumeUnfinished)),
                (false, None) => None,
            },
        ),
        ("Stop the design from a specification", for_run(run, wish(SpecifiedDesignCommand::Stop))),
        (
            "Open the best lens from the specification",
            best.map(|best| Command::New(Box::new(best.designed.lens.clone()))),
        ),
    ]
}

fn candidate(view: &SessionView, has_preview: bool) -> Vec<Request> {
    let shown = view.candidate.as_ref().map(|candidate| candidate.shown);
    let own = shown.filter(|_| !has_preview);
    vec![
        ("Accept the candidate", own.map(|_| Command::AcceptCandidate)),
        ("Keep the candidate and the design", own.map(|_| Command::KeepCandidate)),
        ("Discard the candidate", own.map(|_| Command::DiscardCandidate)),
        (
            "Switch between the candidate and the design",
            shown.map(|shown| Command::ShowCandidate(!shown)),
        ),
    ]
}

fn variables(lens: &Lens) -> Vec<Request> {
    [
        ("Vary all curvatures", ParameterKind::Curvatures),
        ("Vary all thicknesses", ParameterKind::Thicknesses),
        ("Vary all semi-diameters", ParameterKind::SemiDiameters),
    ]
    .map(|(title, kind)| (title, Some(Command::from(add_variables_edit(lens, &[kind])))))
    .into_iter()
    .chain([("Limit the beam by the stop", Some(Command::LimitByStop))])
    .collect()
}

/// Settings of what panels show and compute: zoom position, what drags hold, effects.
pub(super) fn settings(view: &SessionView) -> Vec<MenuItem> {
    const MENU: &str = "Setting";
    let setting = |title: String, command: Command, on: bool| MenuItem {
        checked: Some(on),
        ..MenuItem::new(MENU, title, command)
    };
    let zooms = view.lens.zoom_positions();
    let zoom = (0..zooms).filter(|_| zooms > 1).map(|zoom| {
        let title = format!("Show zoom position {}", zoom + 1);
        setting(title, Command::ShowZoom(zoom), view.settings.zoom == zoom)
    });
    let is_offered = |lock: &FirstOrderLock| {
        *lock != FirstOrderLock::Magnification || view.lens.object != Object::Infinity
    };
    let locks = FirstOrderLock::ALL.into_iter().filter(is_offered).map(|lock| {
        let mut settings = view.drag.settings.clone();
        let on = settings.locks.contains(&lock);
        if on {
            settings.locks.retain(|other| *other != lock);
        } else {
            settings.locks.push(lock);
            settings.locks.sort();
        }
        setting(format!("Hold the {lock} in drags"), Command::SetDragSettings(settings), on)
    });
    let effects = Effect::ALL.into_iter().flat_map(|effect| {
        [EffectOverride::Auto, EffectOverride::On, EffectOverride::Off].map(|choice| {
            let name = match choice {
                EffectOverride::Auto => "as the lens asks",
                EffectOverride::On => "always",
                EffectOverride::Off => "never",
            };
            let on = view.settings.overrides.get(effect) == choice;
            let title = format!("Effect {}: {name}", effect.name());
            setting(title, Command::SetEffect(effect, choice), on)
        })
    });
    zoom.chain(locks).chain(effects).collect()
}
