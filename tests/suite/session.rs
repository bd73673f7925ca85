//! A session: its design stays valid under any commands, and its background threads behave.

use aplanat::analysis::wavefront;
use aplanat::effects::{Effect, EffectOverride};
use aplanat::experiments::{self, Effort, Experiment};
use aplanat::files;
use aplanat::lens::{
    Aperture, ApertureShape, Edit, ElementEdit, FieldKind, FieldPoint, Fields, Lens, Medium,
    Object, Parameter, ParameterKind, Pickup, Quantity, Row, SurfaceAperture, ToleranceSheet,
    Variable, ZoomNumber, ZoomPosition, add_variables,
};
use aplanat::merit::{Goal, LimitTreatment, MeritError, PupilEdge, Term, TermValue, WeightedTerm};
use aplanat::optimize::{DescentMethod, OptimizationProgress, Optimizer};
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::session::{
    AnalysisSettings, Command, ExperimentStatus, OptimizerFactory, PanelSetting, RunStatus,
    Session, SessionEvent, SessionView, Severity, analyze,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// A lens of the library.
fn lens(name: &str) -> Lens {
    let bundled = files::bundled_lenses().iter().find(|lens| lens.name == name).unwrap();
    files::json::read(bundled.text, name).unwrap()
}

fn double_gauss() -> Lens {
    lens("double_gauss_rudolph_50")
}

/// Bends the first surface a little with every step, and gets better with each.
#[derive(Debug)]
struct Toy {
    lens: Lens,
    step: usize,
    last: usize,
    breaks: usize,
    steps: Arc<AtomicUsize>,
}

impl Optimizer for Toy {
    fn step(&mut self) -> OptimizationProgress {
        assert_ne!(self.step, self.breaks, "the toy breaks");
        self.step += 1;
        self.steps.fetch_add(1, Ordering::SeqCst);
        self.lens.surfaces[0].curvature *= 1.0 + 1e-6;
        let merit = 1.0 / self.step as f64;
        let finished = self.step == self.last;
        OptimizationProgress {
            step: self.step,
            evaluations: self.step,
            merit,
            best: merit,
            accepted: 1.0,
            refused: None,
            finished,
            end: None,
        }
    }

    fn verify_best(&mut self) {}

    fn best(&self) -> &Lens {
        &self.lens
    }

    fn current(&self) -> &Lens {
        &self.lens
    }

    fn terms(&self) -> Result<Vec<TermValue>, MeritError> {
        Ok(Vec::new())
    }
}

/// A toy that ends after its `last` step, and breaks if it is the name of the lens that says so.
fn toy(last: usize, steps: &Arc<AtomicUsize>) -> Box<OptimizerFactory> {
    let steps = Arc::clone(steps);
    Box::new(move |task| {
        let lens = &task.lens;
        if lens.surfaces[0].curvature == 0.0 {
            return Err("the toy needs a curved surface".to_owned());
        }
        let breaks = if lens.name == "breaks" { 7 } else { usize::MAX };
        let (lens, steps) = (Lens::clone(lens), Arc::clone(&steps));
        Ok(Box::new(Toy { lens, step: 0, last, breaks, steps }))
    })
}

fn session(lens: Lens) -> Session {
    Session::with_optimizer(lens, toy(1_000_000, &Arc::default()), || {}).unwrap()
}

const OPTIMIZE: Command = Command::Optimize {
    method: DescentMethod::Adam,
    goal: Goal {
        terms: Vec::new(),
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::Constraints,
        pupil: PupilEdge::Moving,
    },
    glasses: None,
};

/// A merit function of the spots alone.
fn spot_goal() -> Goal {
    let terms = vec![WeightedTerm::new(Term::Spot, 2.5)];
    Goal {
        terms,
        zoom_ratios: Vec::new(),
        pupil: PupilEdge::Frozen,
        limits: LimitTreatment::Constraints,
    }
}

/// The looks at something in the background, two milliseconds apart: other tests may take the processors.
const LOOKS: usize = 60_000;

/// Waits until something has happened in the background.
fn wait(
    session: &mut Session,
    what: &str,
    happened: impl Fn(&SessionView, &[SessionEvent]) -> bool,
) {
    let mut events = Vec::new();
    for _ in 0..LOOKS {
        events.extend(session.poll());
        if happened(&session.view(), &events) {
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what} never happened");
}

fn step_of(view: &SessionView) -> usize {
    let progress = view.optimization.snapshot.as_ref().and_then(|search| search.progress.as_ref());
    progress.map_or(0, |progress| progress.step)
}

const CURVATURE: Parameter = Parameter::new(0, Quantity::Curvature);
const GAP: Parameter = Parameter::new(1, Quantity::Thickness);

/// One edit of every kind, each of which changes the lens.
fn every_edit(lens: &Lens) -> Vec<Edit> {
    let last = lens.surfaces.len() - 1;
    let stop = lens.stop().unwrap();
    let angles = vec![FieldPoint { x: 0.0, y: 3.0, weight: 2.0 }];
    let position = ZoomPosition {
        name: "near".into(),
        numbers: vec![ZoomNumber::thickness(1, 0.7)],
        ..ZoomPosition::default()
    };
    let thickness = lens.surfaces[last].thickness;
    let row = Row { curvature: 0.01, thickness, ..Row::default() };
    vec![
        Edit::Set { parameter: GAP, value: 0.2 },
        Edit::SetSemiDiameter { surface: 0, value: None },
        Edit::SetAsphere { surface: 0, terms: vec![1e-7, 2e-10] },
        Edit::SetMedium { surface: 0, medium: Medium::Model { nd: 1.6, vd: 50.0 } },
        Edit::SetObjectMedium(Medium::Index(1.33)),
        Edit::SetStop(usize::from(stop == 0)),
        Edit::SetHyperhemisphere { surface: 0, hyper: true },
        Edit::SetComment { surface: 0, text: "front".into() },
        Edit::SetRow { surface: last, row: Row { stop: last == stop, ..row.clone() } },
        Edit::InsertRow { at: 1, row: row.clone() },
        Edit::RemoveRow(1),
        Edit::ReverseRows { first: 0, last: 1 },
        Edit::Scale(2.0),
        Edit::SetName("Other".into()),
        Edit::SetSource("elsewhere".into()),
        Edit::SetNotes("a note".into()),
        Edit::SetObject(Object::Finite(1000.0)),
        Edit::SetAperture(Aperture::EntrancePupilDiameter(1.25)),
        Edit::SetFields(Fields { kind: FieldKind::Angle, values: angles }),
        Edit::SetWavelengths(vec![aplanat::lens::Wavelength {
            um: 0.55,
            weight: 1.0,
            primary: true,
        }]),
        Edit::SetImageSolve(Some(0.1)),
        Edit::AddVariable(Variable { parameter: CURVATURE, min: None, max: None }),
        Edit::RemoveVariable(CURVATURE),
        Edit::SetPickup(Pickup { parameter: GAP, source: CURVATURE, scale: 1.0, offset: 3.0 }),
        Edit::RemovePickup(GAP),
        Edit::InsertZoom { at: 0, position: position.clone() },
        Edit::SetZoom { at: 0, position: ZoomPosition { name: "far".into(), ..position } },
        Edit::RemoveZoom(0),
        Edit::SetVariables(vec![Variable { parameter: CURVATURE, min: None, max: None }]),
        Edit::Replace(Box::new(aplanat::lens::blank())),
        Edit::SetMerit(Some(spot_goal())),
        Edit::Element(ElementEdit::Bend { surface: 0, by: 0.01 }),
        Edit::Sequence {
            title: "two remarks".into(),
            edits: [0, 1].map(|surface| Edit::SetComment { surface, text: "remark".into() }).into(),
        },
        Edit::SetObstruction { surface: 0, value: Some(1.5) },
        Edit::SetTolerances(Some(ToleranceSheet {
            errors: Vec::new(),
            focus_travel: Some(0.2),
            ..ToleranceSheet::default()
        })),
        Edit::SetApertures {
            surface: 0,
            apertures: vec![SurfaceAperture::inside(ApertureShape::Circle { radius: 3.0 })],
        },
    ]
}

/// The number of an edit's kind; the compiler asks for every new one.
fn kind(edit: &Edit) -> usize {
    match edit {
        Edit::Set { .. } => 0,
        Edit::SetSemiDiameter { .. } => 1,
        Edit::SetAsphere { .. } => 2,
        Edit::SetMedium { .. } => 3,
        Edit::SetObjectMedium(_) => 4,
        Edit::SetStop(_) => 5,
        Edit::SetHyperhemisphere { .. } => 6,
        Edit::SetComment { .. } => 7,
        Edit::SetRow { .. } => 8,
        Edit::InsertRow { .. } => 9,
        Edit::RemoveRow(_) => 10,
        Edit::ReverseRows { .. } => 11,
        Edit::Scale(_) => 12,
        Edit::SetName(_) => 13,
        Edit::SetSource(_) => 14,
        Edit::SetNotes(_) => 15,
        Edit::SetObject(_) => 16,
        Edit::SetAperture(_) => 17,
        Edit::SetFields(_) => 18,
        Edit::SetWavelengths(_) => 19,
        Edit::SetImageSolve(_) => 20,
        Edit::AddVariable(_) => 21,
        Edit::RemoveVariable(_) => 22,
        Edit::SetPickup(_) => 23,
        Edit::RemovePickup(_) => 24,
        Edit::InsertZoom { .. } => 25,
        Edit::SetZoom { .. } => 26,
        Edit::RemoveZoom(_) => 27,
        Edit::SetVariables(_) => 28,
        Edit::Replace(_) => 29,
        Edit::SetMerit(_) => 30,
        Edit::Element(_) => 31,
        Edit::Sequence { .. } => 32,
        Edit::SetObstruction { .. } => 33,
        Edit::SetTolerances(_) => 34,
        Edit::SetApertures { .. } => 35,
    }
}

/// True for the message that an edit was not carried out; a note tells what it has changed besides.
fn is_refusal(event: &SessionEvent) -> bool {
    matches!(event, SessionEvent::Message(message) if message.severity != Severity::Note)
}

#[test]
fn every_kind_of_edit_is_undone_and_redone_exactly() {
    let mut session = session(double_gauss());
    let edits = every_edit(session.lens());
    assert_eq!(edits.iter().map(kind).collect::<Vec<_>>(), (0..36).collect::<Vec<_>>());
    let mut lenses = vec![Arc::clone(session.lens())];
    for edit in edits {
        let events = session.apply(edit.clone().into());
        let refused = events.last().is_some_and(is_refusal);
        assert!(!refused && session.lens() != lenses.last().unwrap(), "{edit:?}: {events:?}");
        let text = serde_json::to_string(&Command::from(edit.clone())).unwrap();
        assert_eq!(serde_json::from_str::<Command>(&text).unwrap(), Command::Edit(edit), "{text}");
        lenses.push(Arc::clone(session.lens()));
        session.apply(Command::CommitEdit);
    }
    for before in lenses.iter().rev().skip(1) {
        session.apply(Command::Undo);
        assert_eq!(session.lens(), before);
    }
    assert!(session.view().undo.is_none() && !session.is_dirty());
    for after in &lenses[1..] {
        session.apply(Command::Redo);
        assert_eq!(session.lens(), after);
    }
    assert!(session.view().redo.is_none() && session.is_dirty());
}

#[test]
fn a_radius_of_zero_or_infinity_is_a_plane() {
    for (radius, value) in [(16.0, 0.0625), (-4.0, -0.25), (0.0, 0.0), (f64::INFINITY, 0.0)] {
        assert_eq!(Edit::set_radius(0, radius), Edit::Set { parameter: CURVATURE, value });
    }
}

#[test]
fn consecutive_edits_of_one_cell_are_one_step() {
    let mut session = session(double_gauss());
    let before = session.lens().surfaces[1].thickness;
    let set = |value: f64| Command::Edit(Edit::Set { parameter: GAP, value });
    for factor in [1.0, 10.0, 10.5] {
        session.apply(set(before * factor));
    }
    assert_eq!(session.lens().surfaces[1].thickness, before * 10.5);
    session.apply(Command::CommitEdit);
    session.apply(set(before * 11.0));
    session.apply(Command::Undo);
    assert_eq!(session.lens().surfaces[1].thickness, before * 10.5);
    session.apply(Command::Undo);
    assert_eq!(session.lens().surfaces[1].thickness, before);
    assert!(session.view().undo.is_none());
}

#[test]
fn refused_edits_keep_the_design_and_give_a_reason() {
    let cases = [
        (Edit::Set { parameter: GAP, value: f64::NAN }, "thickness after surface 2 is NaN"),
        (
            Edit::Set { parameter: Parameter::new(99, Quantity::Conic), value: 0.0 },
            "no surface 100",
        ),
        (Edit::SetSemiDiameter { surface: 0, value: Some(-1.0) }, "expected zero or more"),
        (Edit::SetMedium { surface: 0, medium: Medium::Glass("N-BK77".into()) }, "unknown glass"),
        (Edit::RemoveRow(usize::MAX), "there is no surface"),
        (Edit::ReverseRows { first: 2, last: 1 }, "expected the first one in front"),
        (Edit::SetWavelengths(Vec::new()), "no wavelengths"),
        (Edit::RemoveZoom(0), "the lens has 0"),
        (Edit::Scale(0.0), "the scale is 0"),
        (Edit::SetAperture(Aperture::FNumber(0.0)), "f-number is 0"),
    ];
    let mut session = session(double_gauss());
    let before = session.view();
    for (edit, words) in cases {
        let events = session.apply(edit.into());
        let [SessionEvent::Message(message)] = events.as_slice() else { panic!("{events:?}") };
        assert!(message.text.contains(words), "{} has no `{words}`", message.text);
        assert_eq!(message.severity, Severity::Warning);
    }
    let stop = session.lens().stop().unwrap();
    session.apply(Edit::RemoveRow(stop).into());
    assert!(session.view().messages.last().unwrap().text.contains("is the stop"));
    assert_eq!((session.lens(), session.view().version), (&before.lens, before.version));
}

/// A zoom lens with variables and pickups on both sides of its rows 3 to 5.
fn wired() -> Lens {
    let mut lens = lens("zoom_nikkor_28_80");
    let number = Parameter::new;
    lens.variables = vec![
        Variable { parameter: number(2, Quantity::Curvature), min: None, max: Some(0.5) },
        Variable {
            parameter: Parameter::at_zoom(7, Quantity::Thickness, 1),
            min: Some(1.0),
            max: None,
        },
    ];
    lens.pickups = vec![Pickup {
        parameter: number(16, Quantity::SemiDiameter),
        source: number(15, Quantity::SemiDiameter),
        scale: 1.0,
        offset: 0.0,
    }];
    lens
}

#[test]
fn references_to_rows_follow_insertions_and_deletions() {
    let mut session = session(wired());
    let before = Arc::clone(session.lens());
    session.apply(Edit::InsertRow { at: 3, row: Row::default() }.into());
    let lens = Arc::clone(session.lens());
    assert_eq!(lens.variables[0].parameter.surface, 2);
    assert_eq!(lens.variables[1].parameter.surface, 8);
    assert_eq!((lens.pickups[0].parameter.surface, lens.pickups[0].source.surface), (17, 16));
    assert_eq!(lens.zoom[2].numbers.iter().map(|g| g.surface).collect::<Vec<_>>(), [8, 17]);
    session.apply(Edit::RemoveRow(3).into());
    assert_eq!(*session.lens(), before);
    session.apply(Edit::RemoveRow(2).into());
    assert_eq!(session.lens().variables.len(), 1);
    session.apply(Edit::RemoveRow(6).into());
    assert_eq!(session.lens().variables.len(), 0, "its gap is gone at every zoom position");
    assert_eq!(session.lens().zoom[0].numbers.len(), 1);
}

#[test]
fn a_row_that_changes_nothing_changes_no_focal_length_wherever_it_is_put() {
    let mut base = double_gauss();
    base.image_solve = Some(0.0);
    let um = base.wavelengths[base.primary()].um;
    let efl = |lens: &Lens| {
        let system = lens.resolve(0, um).unwrap();
        let length: f64 = system.surfaces.iter().map(|s| s.thickness).sum();
        let beam = aplanat::paraxial::Beam::for_lens(lens, 0);
        (aplanat::paraxial::first_order(&system, &beam).unwrap().efl.unwrap(), length)
    };
    let (f, length) = efl(&base);
    for at in 0..=base.surfaces.len() {
        let medium = if at == 0 { Medium::Air } else { base.surfaces[at - 1].medium.clone() };
        let row = Row { medium, ..Row::default() };
        let lens = aplanat::lens::apply_edit(&base, &Edit::InsertRow { at, row }).unwrap();
        let (other, other_length) = efl(&lens);
        assert!((other - f).abs() < 1e-12 * f, "row {at}: {other}");
        assert!((other_length - length).abs() < 1e-9, "row {at}: {other_length}");
    }
}

#[test]
fn flipping_a_group_twice_restores_it() {
    let mut lens = wired();
    let asphere = Parameter::new(4, Quantity::Asphere(1));
    lens.surfaces[4].asphere = vec![1e-6, -2e-9];
    lens.variables.push(Variable { parameter: asphere, min: Some(-1e-8), max: Some(0.0) });
    lens.pickups.push(Pickup {
        parameter: Parameter::new(5, Quantity::Curvature),
        source: asphere,
        scale: 3.0,
        offset: 0.02,
    });
    let lens = lens.with_pickups().unwrap();
    for (first, last) in [(0, 16), (2, 5), (4, 4), (4, 7), (6, 9)] {
        let flip = Edit::ReverseRows { first, last };
        let turned = aplanat::lens::apply_edit(&lens, &flip).unwrap();
        assert_ne!(turned, lens);
        assert_eq!(aplanat::lens::apply_edit(&turned, &flip).unwrap(), lens, "{first} to {last}");
    }
    let turned =
        aplanat::lens::apply_edit(&lens, &Edit::ReverseRows { first: 4, last: 5 }).unwrap();
    let (bound, law) = (turned.variables[2], turned.pickups[1]);
    assert_eq!((bound.parameter.surface, bound.min, bound.max), (5, Some(0.0), Some(1e-8)));
    assert_eq!((law.parameter.surface, law.scale, law.offset), (4, 3.0, -0.02));
}

#[test]
fn scaling_a_lens_scales_the_focal_length_and_is_reversible() {
    for bundled in files::bundled_lenses() {
        let lens = lens(bundled.name);
        let um = lens.wavelengths[lens.primary()].um;
        let power = |lens: &Lens| {
            let beam = aplanat::paraxial::Beam::for_lens(lens, 0);
            aplanat::paraxial::first_order(&lens.resolve(0, um).unwrap(), &beam).unwrap().power
        };
        let twice = aplanat::lens::apply_edit(&lens, &Edit::Scale(2.0)).unwrap();
        assert!((2.0 * power(&twice) - power(&lens)).abs() < 1e-12, "{}", bundled.name);
        let back = aplanat::lens::apply_edit(&twice, &Edit::Scale(0.5)).unwrap();
        assert_eq!(back, lens, "{}", bundled.name);
    }
}

#[test]
fn removing_a_solve_keeps_the_image_plane() {
    let mut lens = wired();
    lens.image_solve = Some(0.25);
    let um = lens.wavelengths[lens.primary()].um;
    let fixed = aplanat::lens::apply_edit(&lens, &Edit::SetImageSolve(None)).unwrap();
    for zoom in 0..3 {
        assert_eq!(fixed.resolve(zoom, um).unwrap(), lens.resolve(zoom, um).unwrap());
    }
    let last = Parameter::new(16, Quantity::Thickness);
    let edit = Edit::Set { parameter: last, value: 30.0 };
    assert!(aplanat::lens::apply_edit(&lens, &edit).is_err(), "a solved gap is not typed");
}

#[test]
fn a_search_runs_on_a_copy_and_its_result_is_one_undo_step() {
    let mut session = session(double_gauss());
    let before = Arc::clone(session.lens());
    session.apply(OPTIMIZE);
    wait(&mut session, "a step", |view, _| step_of(view) > 0);
    session.apply(Command::Stop);
    wait(&mut session, "the stop", |view, _| !view.optimization.is_active());
    assert_eq!(*session.lens(), before, "the search has its own copy");
    let best = Arc::clone(&session.view().optimization.snapshot.unwrap().best);
    session.apply(Command::AcceptResult);
    assert_eq!(*session.lens(), best);
    assert!(session.view().optimization.snapshot.is_none());
    session.apply(Command::Undo);
    assert_eq!(*session.lens(), before);
    assert!(session.view().undo.is_none());
}

#[test]
fn a_background_optimization_improves_the_double_gauss() {
    let lens = double_gauss();
    let goal = Goal::default_for(&lens).unwrap();
    let mut session = Session::new(lens, || {}).unwrap();
    session.apply(Command::Optimize {
        method: DescentMethod::DampedLeastSquares,
        goal,
        glasses: None,
    });
    wait(&mut session, "ten steps", |view, _| {
        let over = !view.optimization.is_active();
        step_of(view) >= 10 || over
    });
    let search = session.view().optimization.snapshot.unwrap();
    let (first, last) = (search.history[0], search.history[search.history.len() - 1]);
    assert!(last.best < first.best, "{first:?} {last:?}");
    assert!(!search.best_terms.is_empty());
    session.apply(Command::AcceptResult);
    assert_eq!(*session.lens(), session.view().lens);
    assert!(session.view().undo.is_some());
}

#[test]
fn glasses_are_exchanged_after_an_optimization_and_taken_with_its_result() {
    let mut lens = files::open("lenses/achromat_ac254_100.json").unwrap().lens;
    lens.variables.clear();
    lens.surfaces[1].medium = Medium::Glass("SCHOTT N-SF66".to_owned());
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    let goal = Goal::default_for(&lens).unwrap();
    let mut session = Session::new(lens.clone(), || {}).unwrap();
    let exchange = |words: &str| Command::Optimize {
        method: DescentMethod::TrustRegion,
        goal: goal.clone(),
        glasses: Some(words.to_owned()),
    };
    session.apply(exchange("schott vd=20..40"));
    wait(&mut session, "the end", |view, _| step_of(view) > 0 && !view.optimization.is_active());
    let run = session.view().optimization.snapshot.unwrap();
    let media =
        |lens: &Lens| lens.surfaces.iter().map(|row| row.medium.clone()).collect::<Vec<_>>();
    assert_ne!(media(&run.best), media(&lens));
    // The curve is that of one set of glasses: the values of the variables are all that it has.
    assert!(run.curve.points.iter().all(|point| point.merit > run.history.last().unwrap().best));
    // A remark that was written meanwhile stays, and so do the new glasses.
    session.apply(Command::Edit(Edit::SetNotes("kept".to_owned())));
    session.apply(Command::AcceptResult);
    let taken = session.view().lens;
    assert_eq!((media(&taken), taken.notes.as_str()), (media(&run.best), "kept"));

    for words in ["nd=x", "no such glass"] {
        let events = session.apply(exchange(words));
        assert!(matches!(events.last(), Some(SessionEvent::Message(_))), "{words}: {events:?}");
        assert!(!session.view().optimization.is_active());
    }
}

#[test]
fn a_discarded_optimization_leaves_the_design_unchanged() {
    let mut session = session(double_gauss());
    let before = session.view();
    session.apply(OPTIMIZE);
    wait(&mut session, "a step", |view, _| step_of(view) > 0);
    session.apply(Command::DiscardResult);
    let after = session.view();
    assert!(after.optimization.snapshot.is_none());
    assert_eq!((after.version, &after.lens), (before.version, &before.lens));
    let events = session.apply(Command::AcceptResult);
    assert!(
        matches!(events.last(), Some(SessionEvent::Message(_))),
        "there is nothing to take: {events:?}"
    );
}

#[test]
fn a_result_taken_after_an_edit_keeps_the_edit() {
    let mut start = double_gauss();
    start.variables = vec![Variable { parameter: CURVATURE, min: None, max: None }];
    let mut session = session(start);
    session.apply(OPTIMIZE);
    wait(&mut session, "a step", |view, _| step_of(view) > 0);
    session.apply(Command::Pause);
    session.apply(Edit::Set { parameter: GAP, value: 0.5 }.into());
    wait(&mut session, "the pause", |view, _| view.optimization.status == RunStatus::Paused);
    let best = Arc::clone(&session.view().optimization.snapshot.unwrap().best);
    session.apply(Command::AcceptResult);
    assert_eq!(session.lens().surfaces[0].curvature, best.surfaces[0].curvature);
    assert_eq!(session.lens().surfaces[1].thickness, 0.5);
}

#[test]
fn a_paused_run_advances_by_single_steps() {
    let steps = Arc::new(AtomicUsize::new(0));
    let mut session = Session::with_optimizer(double_gauss(), toy(600, &steps), || {}).unwrap();
    session.apply(OPTIMIZE);
    session.apply(Command::Pause);
    wait(&mut session, "the pause", |view, _| view.optimization.status == RunStatus::Paused);
    let held = steps.load(Ordering::SeqCst);
    std::thread::sleep(Duration::from_millis(60));
    assert_eq!(steps.load(Ordering::SeqCst), held, "nothing moves while the search is held");
    for more in 1..=3 {
        session.apply(Command::Step);
        wait(&mut session, "one step", |view, _| step_of(view) == held + more);
        assert_eq!(steps.load(Ordering::SeqCst), held + more);
    }
    session.apply(Command::Resume);
    wait(&mut session, "the end", |view, _| view.optimization.status == RunStatus::Finished);
    let search = session.view().optimization.snapshot.unwrap();
    // Every step, and the start before the first one.
    assert_eq!(search.history.len(), 601);
}

#[test]
fn a_failed_search_is_reported_and_the_next_one_works() {
    let mut session = session(Lens { name: "breaks".into(), ..double_gauss() });
    session.apply(OPTIMIZE);
    wait(&mut session, "the failure", |view, _| {
        view.messages.iter().any(|m| m.text.contains("the toy breaks"))
    });
    session.apply(Command::Undo);
    session.apply(Edit::SetName("works".into()).into());
    session.apply(OPTIMIZE);
    wait(&mut session, "another step", |view, _| step_of(view) > 0);
    session.apply(Edit::Set { parameter: CURVATURE, value: 0.0 }.into());
    session.apply(OPTIMIZE);
    wait(&mut session, "the refusal", |view, _| {
        view.messages.iter().any(|m| m.text.contains("needs a curved surface"))
    });
    assert!(session.view().optimization.snapshot.is_none());
}

#[test]
fn threads_end_when_the_session_is_dropped() {
    let alive = Arc::new(());
    let steps = Arc::new(AtomicUsize::new(0));
    let held = Arc::clone(&alive);
    let wake = move || assert!(Arc::strong_count(&held) > 0);
    let mut session =
        Session::with_optimizer(double_gauss(), toy(usize::MAX, &steps), wake).unwrap();
    session.apply(OPTIMIZE);
    wait(&mut session, "a step", |view, _| step_of(view) > 0);
    drop(session);
    assert_eq!(Arc::strong_count(&alive), 1, "no thread holds the way to wake the window");
    let last = steps.load(Ordering::SeqCst);
    std::thread::sleep(Duration::from_millis(30));
    assert_eq!(steps.load(Ordering::SeqCst), last);
}

/// An experiment of the list that runs quickly with little effort.
fn quick() -> &'static Experiment {
    let by_time = |a: &&Experiment, b: &&Experiment| a.seconds.total_cmp(&b.seconds);
    experiments::ALL.iter().min_by(by_time).unwrap()
}

fn begin(study: &Experiment) -> Command {
    Command::StartExperiment { id: study.id.to_owned(), effort: Effort::Small }
}

fn stage(view: &SessionView) -> Option<&ExperimentStatus> {
    view.experiment.as_deref().map(|trial| &trial.status)
}

#[test]
fn an_experiment_runs_in_the_background_and_can_be_saved() {
    let mut session = session(double_gauss());
    assert!(session.view().experiment.is_none());
    session.apply(begin(quick()));
    assert!(matches!(stage(&session.view()), Some(ExperimentStatus::Running { .. })), "at once");
    wait(&mut session, "the outcome", |view, _| {
        matches!(stage(view), Some(ExperimentStatus::Done(_)))
    });
    let view = session.view();
    let Some(ExperimentStatus::Done(report)) = stage(&view) else { unreachable!() };
    assert!(report.holds && report.ms > 0.0 && !report.outcome.claims.is_empty());
    let folder = std::env::temp_dir().join(format!("aplanat-experiment-{}", std::process::id()));
    session.apply(Command::SaveExperiment(folder.join("deep")));
    let written = std::fs::read_dir(folder.join("deep")).unwrap().count();
    std::fs::remove_dir_all(&folder).unwrap();
    let outcome = &report.outcome;
    let expected = outcome.tables.len() + outcome.pictures.len() + outcome.lenses.len() + 1;
    assert_eq!(written, expected);
    assert_eq!(session.view().messages.last().unwrap().severity, Severity::Note);
    session.apply(Command::DismissExperiment);
    assert!(session.view().experiment.is_none());
    session.apply(Command::SaveExperiment(folder));
    assert_eq!(session.view().messages.last().unwrap().severity, Severity::Warning);
}

#[test]
fn an_experiment_is_cancelled_or_replaced_between_two_steps() {
    let mut session = session(double_gauss());
    session.apply(begin(quick()));
    session.apply(Command::CancelExperiment);
    wait(&mut session, "the end", |view, _| {
        !matches!(stage(view), Some(ExperimentStatus::Running { .. }))
    });
    assert!(matches!(stage(&session.view()), Some(ExperimentStatus::Stopped)));
    for study in experiments::ALL {
        session.apply(Command::StartExperiment { id: study.id.to_owned(), effort: Effort::Full });
    }
    session.apply(begin(quick()));
    wait(&mut session, "the last one", |view, _| {
        matches!(stage(view), Some(ExperimentStatus::Done(_)))
    });
    let trial = session.view().experiment.unwrap();
    assert_eq!(
        (trial.experiment.id, trial.number),
        (quick().id, experiments::ALL.len() as u64 + 2)
    );
    let unknown = Command::StartExperiment { id: "0.0".into(), effort: Effort::Small };
    session.apply(unknown);
    assert_eq!(session.view().messages.last().unwrap().text, "there is no experiment `0.0`");
}

#[test]
fn a_beam_limited_by_the_stop_is_as_wide_as_before_in_one_step() {
    let mut lens = double_gauss();
    lens.aperture = Aperture::FNumber(5.6);
    let mut session = session(lens);
    let entrance = |session: &Session| {
        let model = RayModel::from_lens(session.lens(), 0).unwrap();
        model.first_order.f_number.unwrap()
    };
    let before = entrance(&session);
    session.apply(Command::LimitByStop);
    assert!(matches!(session.lens().aperture, Aperture::StopSemiDiameter(_)));
    assert!((entrance(&session) / before - 1.0).abs() < 1e-12);
    session.apply(Command::Undo);
    assert_eq!(session.lens().aperture, Aperture::FNumber(5.6));
}

#[test]
fn sensitivities_are_computed_with_the_pupils() {
    let settings = AnalysisSettings { pupils: true, ..AnalysisSettings::default() };
    let numbers = analyze(&double_gauss(), &settings).unwrap();
    let pupils = numbers.pupils.unwrap().value;
    assert_eq!(pupils.sensitivities.value.len(), pupils.fields.len());
    let all = pupils.mean_sensitivities.unwrap();
    let felt: Vec<usize> =
        (0..all.surfaces.len()).filter(|i| all.surfaces[*i].is_significant()).collect();
    assert_eq!(felt, [0, 5, 10], "front, stop and rear");
    assert!(felt.iter().all(|i| all.surfaces[*i].area.value > 0.0), "glass lets light through");
}

#[test]
fn pupils_are_compared_with_the_one_on_the_axis() {
    let settings = AnalysisSettings { pupils: true, ..AnalysisSettings::default() };
    let pupils = |lens: &Lens| analyze(lens, &settings).unwrap().pupils.unwrap().value;
    let mut lens = lens("tessar_50_f28");
    let fields = &lens.fields.values;
    let axis = fields.iter().position(|field| field.x == 0.0 && field.y == 0.0).unwrap();
    let found = pupils(&lens);
    let areas: Vec<f64> =
        found.fields.iter().map(|field| field.value.extent.unwrap().area.value).collect();
    let before = found.axis.unwrap().value;
    assert_eq!(before, areas[axis]);
    assert!(areas.iter().any(|area| *area < 0.9 * before), "{areas:?}");
    // A lens without a field on the axis has a pupil there as well.
    let last = lens.fields.values.len() - 1;
    lens.fields.values = vec![lens.fields.values[last]];
    let without = pupils(&lens).axis.unwrap();
    let off = (without.value - before).abs();
    assert!(off <= without.error.max(1e-6 * before), "{without:?} {before}");
}

#[test]
fn a_slow_window_delays_no_run_and_wakes_rarely() {
    let steps = Arc::new(AtomicUsize::new(0));
    let woken = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&woken);
    let wake = move || {
        count.fetch_add(1, Ordering::SeqCst);
    };
    let mut session = Session::with_optimizer(double_gauss(), toy(500_000, &steps), wake).unwrap();
    session.apply(OPTIMIZE);
    std::thread::sleep(Duration::from_millis(300));
    let (taken, looks) = (steps.load(Ordering::SeqCst), woken.load(Ordering::SeqCst));
    assert!(taken >= 100, "nobody looked, and yet there were {taken} steps");
    assert!(looks <= 20, "{looks} looks in 0.3 s");
}

#[test]
fn the_numbers_of_the_newest_design_arrive() {
    let mut session = session(double_gauss());
    for thickness in 1..50 {
        session.apply(Edit::Set { parameter: GAP, value: 0.01 * f64::from(thickness) }.into());
    }
    wait(&mut session, "the numbers", |view, _| view.is_current());
    let results = session.results().unwrap();
    assert_eq!(results.lens.surfaces[1].thickness, 0.49);
    let numbers = results.analyses.as_ref().unwrap();
    assert!((numbers.first_order().efl.unwrap() - 49.4).abs() < 1.0);
    let rms: Vec<f64> =
        numbers.spots.value.iter().map(|spot| spot.as_ref().unwrap().rms.value).collect();
    assert!(rms.len() == 3 && rms.iter().all(|rms| *rms > 0.0), "{rms:?}");
}

#[test]
fn an_effect_that_is_switched_off_is_not_computed() {
    let mut session = session(double_gauss());
    session.apply(Command::SetEffect(Effect::Dispersion, EffectOverride::Off));
    session.apply(Command::SetEffect(Effect::Clipping, EffectOverride::Off));
    wait(&mut session, "the numbers", |view, _| view.is_current());
    let results = session.results().unwrap();
    let numbers = results.analyses.as_ref().unwrap();
    assert_eq!((numbers.ray_model.value.channels.len(), numbers.spot_points.value.len()), (1, 3));
    assert_eq!(numbers.layout.value.fates.clipped, 0);
    assert!(!session.view().dirty && session.view().undo.is_none(), "the design is what it was");
    session.apply(Command::SetEffect(Effect::Clipping, EffectOverride::Auto));
    session.apply(Command::SetEffect(Effect::Dispersion, EffectOverride::Auto));
    wait(&mut session, "the numbers", |view, _| view.is_current());
    let results = session.results().unwrap();
    let numbers = results.analyses.as_ref().unwrap();
    assert!(numbers.ray_model.value.channels.len() == 3 && numbers.layout.value.fates.clipped > 0);
}

#[test]
fn effect_costs_are_measured_when_idle() {
    let mut session = session(double_gauss());
    wait(&mut session, "the measured plan", |view, _| {
        let numbers = view.results.as_ref().and_then(|results| results.analyses.as_ref().ok());
        numbers.is_some_and(|n| n.plan.value.decisions.iter().all(|d| d.cost.is_some()))
    });
    let results = session.results().unwrap();
    let plan = &results.analyses.as_ref().unwrap().plan.value;
    for decision in &plan.decisions {
        println!("{}: {:.2} ms", decision.effect.name(), decision.cost.unwrap().saved_ms);
    }
    let saved_ms = |effect| plan.decision(effect).unwrap().cost.unwrap().saved_ms;
    assert!(saved_ms(Effect::Dispersion) > 0.0 && saved_ms(Effect::Clipping) != 0.0);
    assert_eq!(saved_ms(Effect::Asphere), 0.0, "what is off costs nothing");
    assert!(session.view().is_current());
}

#[test]
fn every_library_lens_is_analysed_in_time() {
    for bundled in files::bundled_lenses() {
        let lens = lens(bundled.name);
        let settings =
            AnalysisSettings { fans: true, field_curves: true, ..AnalysisSettings::default() };
        let numbers = analyze(&lens, &settings).unwrap();
        println!(
            "{:32} plan {:.2}, ray model {:.2}, layout {:.2}, dots {:.2}, spots {:.2}, \
             fans {:.2}, field curves {:.2}",
            bundled.name,
            numbers.plan.ms,
            numbers.ray_model.ms,
            numbers.layout.ms,
            numbers.spot_points.ms,
            numbers.spots.ms,
            numbers.fans.as_ref().unwrap().ms,
            numbers.field_curves.as_ref().unwrap().ms
        );
        assert!(numbers.first_order().efl.is_some());
        assert_eq!(numbers.spots.value.len(), lens.fields_at(0).values.len());
        assert!(numbers.layout.value.rays.len() > 10, "{}", bundled.name);
    }
}

#[test]
fn what_no_panel_shows_is_not_computed() {
    let numbers = analyze(&double_gauss(), &AnalysisSettings::default()).unwrap();
    assert!(numbers.fans.is_none() && numbers.field_curves.is_none());
    assert!(numbers.pupils.is_none() && numbers.contrasts.is_none() && numbers.picture.is_none());
    assert!(numbers.wavefronts.is_none());
}

#[test]
fn a_grin_design_is_saved_and_opened() {
    let folder = std::env::temp_dir().join(format!("aplanat-session-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("lens.json");
    let mut session = session(double_gauss());
    let events = session.apply(Command::Save(None));
    assert!(matches!(events.last(), Some(SessionEvent::Message(_))), "it has no file yet");
    session.apply(Edit::SetName("Mine".into()).into());
    let events = session.apply(Command::Save(Some(path.clone())));
    assert!(events.contains(&SessionEvent::Saved(path.clone())), "{events:?}");
    assert!(!session.view().dirty);
    session.apply(Edit::SetName("Other".into()).into());
    assert!(session.view().dirty);
    session.apply(Command::Open(path.clone()));
    assert_eq!((session.lens().name.as_str(), session.view().undo.is_some()), ("Mine", false));
    assert_eq!(session.view().path, Some(path));
    let before = Arc::clone(session.lens());
    let events = session.apply(Command::Open(folder.join("missing.json")));
    assert!(
        matches!(&events[0], SessionEvent::Message(m) if m.text.contains("missing.json")),
        "{events:?}"
    );
    assert_eq!(*session.lens(), before);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn the_report_on_a_foreign_file_stays_until_another_lens_is_opened() {
    let folder = std::env::temp_dir().join(format!("aplanat-import-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = std::path::PathBuf::from("tests/files/achromat.zmx");
    let mut session = session(double_gauss());
    assert!(session.view().imported.is_none());
    session.apply(Command::Open(path.clone()));
    let imported = session.view().imported.unwrap();
    assert_eq!(imported.path, path);
    let message = session.view().messages.last().unwrap().text.clone();
    assert!(message.contains(&imported.report.counts()) && message.lines().count() == 1);
    session.apply(Edit::SetName("Mine".into()).into());
    assert!(session.view().imported.is_some(), "an edit is the same document");
    let text = folder.join("import.txt");
    session.apply(Command::SaveImportReport(text.clone()));
    assert_eq!(std::fs::read_to_string(&text).unwrap(), imported.to_string());
    session.apply(Command::SetVignetting(files::VignettingChoice::Factors));
    session.apply(Command::Open(path));
    let vignetting = session.view().imported.unwrap().vignetting;
    assert_eq!(vignetting, Some(files::VignettingChoice::Factors));
    session.apply(Command::New(Box::new(double_gauss())));
    assert!(session.view().imported.is_none());
    session.apply(Command::SaveImportReport(text));
    assert!(session.view().messages.last().unwrap().text.contains("no file of another program"));
    std::fs::remove_dir_all(folder).unwrap();
}

/// Steele, Lea and Flood's generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next() % end as u64).unwrap()
    }

    fn number(&mut self) -> f64 {
        let odd = [0.0, -0.0, f64::NAN, f64::INFINITY, -1.0, 1e300, 1e-300, 5e-324];
        match self.below(4) {
            0 => odd[self.below(odd.len())],
            1 => self.below(20) as f64 - 5.0,
            _ => (self.below(2000) as f64 - 1000.0) * 1e-4,
        }
    }

    fn parameter(&mut self) -> Parameter {
        let quantity = match self.below(7) {
            0 => Quantity::Curvature,
            1 => Quantity::Conic,
            2 => Quantity::Asphere(self.below(9)),
            3 | 4 => Quantity::Thickness,
            5 => Quantity::Index,
            _ => Quantity::SemiDiameter,
        };
        let zoom = (self.below(4) == 0).then(|| self.below(4));
        Parameter { surface: self.below(20), quantity, zoom }
    }

    fn medium(&mut self) -> Medium {
        match self.below(6) {
            0 => Medium::Air,
            1 => Medium::Glass("SCHOTT N-BK7".into()),
            2 => Medium::Glass("nonsense".into()),
            3 => Medium::Model { nd: 1.0 + self.number(), vd: 50.0 * self.number() },
            4 => Medium::Index(self.number()),
            _ => Medium::Mirror,
        }
    }

    fn position(&mut self) -> ZoomPosition {
        let Parameter { surface, quantity, .. } = self.parameter();
        let number = ZoomNumber { surface, quantity, value: self.number() };
        ZoomPosition { numbers: vec![number], ..ZoomPosition::default() }
    }

    fn row(&mut self) -> Row {
        Row {
            curvature: self.number(),
            thickness: self.number(),
            medium: self.medium(),
            stop: self.below(10) == 0,
            ..Row::default()
        }
    }

    fn edit(&mut self) -> Edit {
        let (parameter, value, surface) = (self.parameter(), self.number(), self.below(20));
        let limit = (self.below(3) > 0).then_some(value);
        let angles = vec![FieldPoint { x: self.number(), y: value, weight: 1.0 }; self.below(3)];
        match self.below(26) {
            0 | 1 => Edit::Set { parameter, value },
            2 | 3 => Edit::Set { parameter, value: 2.0 * value },
            4 => Edit::set_radius(surface, 10.0 * value),
            5 => Edit::SetSemiDiameter { surface, value: limit },
            6 => Edit::SetAsphere { surface, terms: vec![value * 1e-5; self.below(9)] },
            7 => Edit::SetMedium { surface, medium: self.medium() },
            8 => Edit::SetStop(surface),
            9 => Edit::SetRow { surface, row: self.row() },
            10 | 11 => Edit::InsertRow { at: surface, row: self.row() },
            12 | 13 => Edit::RemoveRow(surface),
            14 => Edit::ReverseRows { first: surface, last: self.below(20) },
            15 => Edit::Scale(value.abs() + 0.9),
            16 => Edit::SetObject(Object::Finite(100.0 * value)),
            17 => Edit::SetAperture(Aperture::StopSemiDiameter(value)),
            18 => Edit::SetFields(Fields { kind: FieldKind::Angle, values: angles }),
            19 => Edit::SetImageSolve(limit),
            20 => Edit::AddVariable(Variable { parameter, min: limit, max: None }),
            21 => Edit::SetPickup(Pickup {
                parameter,
                source: self.parameter(),
                scale: self.number(),
                offset: value,
            }),
            22 => Edit::InsertZoom { at: self.below(4), position: self.position() },
            23 => Edit::RemoveZoom(self.below(4)),
            24 => Edit::SetZoom { at: self.below(4), position: self.position() },
            _ => Edit::SetObject(Object::Infinity),
        }
    }

    fn command(&mut self) -> Command {
        match self.below(30) {
            0 | 1 => Command::Undo,
            2 => Command::Redo,
            3 => Command::CommitEdit,
            4 => OPTIMIZE,
            5 => Command::Pause,
            6 => Command::Step,
            7 => Command::AcceptResult,
            8 => Command::DiscardResult,
            9 => Command::ShowZoom(self.below(5)),
            10 => Command::SetTolerance(self.number()),
            11 => Command::SetEffect(Effect::Clipping, EffectOverride::Off),
            12 => Command::Show(PanelSetting::Rays(self.below(40))),
            _ => Command::Edit(self.edit()),
        }
    }
}

#[test]
fn a_thousand_random_commands_leave_a_sound_design() {
    let starts = ["double_gauss_rudolph_50", "zoom_nikkor_28_80", "phone_us7558005_1"];
    let (mut accepted, mut refused) = (0, 0);
    for (seed, name) in starts.iter().enumerate() {
        let mut random = Random(seed as u64);
        let mut session = session(lens(name));
        for _ in 0..400 {
            let command = random.command();
            let before = Arc::clone(session.lens());
            let events = session.apply(command.clone());
            session.lens().check().unwrap_or_else(|why| panic!("{command:?}: {why}"));
            let changed = *session.lens() != before;
            accepted += usize::from(changed);
            if matches!(command, Command::Edit(_)) && events.last().is_some_and(is_refusal) {
                refused += 1;
                assert!(!changed, "refused and yet changed: {command:?}");
            }
        }
        wait(&mut session, "the numbers", |view, _| view.is_current());
    }
    println!("{accepted} commands changed the design, {refused} were refused");
    assert!(accepted > 100 && refused > 100);
}

#[test]
fn the_merit_function_is_saved_with_the_lens_and_undone() {
    let folder = std::env::temp_dir().join(format!("aplanat-merit-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut session = session(double_gauss());
    let proposed = session.view().goal.unwrap();
    assert_eq!(*proposed, Goal::default_for(&double_gauss()).unwrap());
    session.apply(Edit::SetMerit(Some(spot_goal())).into());
    assert_eq!(session.view().goal.as_deref(), Some(&spot_goal()));
    for file in ["a.json", "b.json"] {
        session.apply(Command::Save(Some(folder.join(file))));
        assert_eq!(session.view().goal.as_deref(), Some(&spot_goal()), "under another name");
    }
    session.apply(Command::Undo);
    assert_eq!(session.view().goal, Some(proposed));
    session.apply(Command::Redo);
    session.apply(Edit::Scale(2.0).into());
    assert_eq!(session.view().goal.unwrap().terms[0].weight, 2.5, "both in square millimetres");
    session.apply(Command::Open(folder.join("b.json")));
    assert_eq!(session.view().goal.as_deref(), Some(&spot_goal()));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn an_accepted_result_has_the_merit_function_that_it_was_optimized_for() {
    let mut session = session(double_gauss());
    session.apply(Command::Optimize {
        method: DescentMethod::Adam,
        goal: spot_goal(),
        glasses: None,
    });
    wait(&mut session, "a step", |view, _| step_of(view) > 0);
    session.apply(Command::AcceptResult);
    assert_eq!(session.lens().merit, Some(spot_goal()));
}

#[test]
fn targets_follow_a_scaled_lens() {
    let mut lens = double_gauss();
    let terms = [Term::FocalLength(50.0), Term::ThroughputLoss(80.0), Term::Light(1.0)];
    let terms = terms.map(|term| WeightedTerm::new(term, 1.0)).to_vec();
    lens.merit = Some(Goal { terms, ..spot_goal() });
    let scaled = aplanat::lens::apply_edit(&lens, &Edit::Scale(2.0)).unwrap();
    let terms = scaled.merit.unwrap().terms;
    let expected = [(Term::FocalLength(100.0), 1.0), (Term::ThroughputLoss(320.0), 4.0)];
    for (term, (target, weight)) in terms.iter().zip(expected) {
        assert_eq!((term.term, term.weight), (target, weight));
    }
    assert_eq!(terms[2].weight, 4.0);
}

#[test]
fn a_selected_surface_is_shown_while_the_lens_has_it() {
    let mut session = session(double_gauss());
    let last = session.lens().surfaces.len() - 1;
    for (chosen, shown) in [
        (None, None),
        (Some(0), Some(0)),
        (Some(3), Some(3)),
        (Some(last), Some(last)),
        (Some(last + 1), None),
    ] {
        session.apply(Command::Select(chosen));
        assert_eq!(session.view().selected, shown, "{chosen:?}");
    }
}

/// The contrast takes longer than all else: what is known of the lens is not computed again because
/// another panel is opened.
#[test]
fn another_panel_does_not_compute_the_contrast_again() {
    let mut session = session(lens("singlet_la1131"));
    session.apply(Command::SetTolerance(1e-2));
    session.apply(Command::Show(PanelSetting::Contrasts(true)));
    let contrasts = |view: &SessionView| {
        let results = view.results.clone().filter(|results| results.version == view.version)?;
        let analyses = results.analyses.as_ref().unwrap();
        analyses.contrasts.as_ref().map(|contrasts| (contrasts.ms, analyses.fans.is_some()))
    };
    wait(&mut session, "the contrast", |view, _| contrasts(view).is_some());
    let (ms, _) = contrasts(&session.view()).unwrap();
    session.apply(Command::Show(PanelSetting::Fans(true)));
    wait(&mut session, "the contrast beside the fans", |view, _| contrasts(view).is_some());
    assert_eq!(contrasts(&session.view()), Some((ms, true)), "the time of the first computation");
}

/// The wavefronts of the window are those of the analyses: the chief ray has no path difference, the mean
/// square of the map over the clear pupil is that of the quadrature, and circles hold ever more light. The
/// images of a point, which take longer, are made once a page shows them.
#[test]
fn wavefronts_are_computed_while_a_panel_shows_them() {
    let mut session = session(lens("achromat_ac254_100"));
    session.apply(Command::Show(PanelSetting::Wavefronts(true)));
    let found = |view: &SessionView| {
        let results = view.results.clone().filter(|results| results.version == view.version)?;
        results.analyses.as_ref().unwrap().wavefronts.clone()
    };
    wait(&mut session, "the wavefronts", |view, _| found(view).is_some());
    let waves = found(&session.view()).unwrap();
    let images = |view: &SessionView| {
        let results = view.results.clone()?;
        results.analyses.as_ref().unwrap().point_images.clone()
    };
    assert!(images(&session.view()).is_none());
    session.apply(Command::Show(PanelSetting::PointImages(true)));
    wait(&mut session, "the images of a point", |view, _| images(view).is_some());
    let images = images(&session.view()).unwrap();
    assert_eq!(images.value.fields.len(), 3);
    for field in &images.value.fields {
        let image = field.value.as_ref().unwrap();
        assert!(image.intensity.values.iter().all(|v| (-1e-2..1.01).contains(v)));
        let shares: Vec<f64> = image.energy.iter().map(|(_, share)| share.value).collect();
        assert!(shares.is_sorted() && shares[0] > 0.0 && shares[15] < 1.01, "{shares:?}");
    }
    let model = RayModel::from_lens(session.lens(), 0).unwrap();
    assert_eq!((waves.value.fields.len(), waves.value.um), (3, 0.5875618));
    for (field, point) in waves.value.fields.iter().zip(&model.fields) {
        let found = field.value.as_ref().unwrap();
        let exact = wavefront(&model, *point, model.primary, Accuracy::default()).unwrap();
        assert!((found.wavefront.rms.value / exact.rms.value - 1.0).abs() < 1e-2);
        let middle = found.map.values[found.map.values.len() / 2].unwrap();
        assert!(middle.abs() < 1e-6, "{middle}");
        assert_eq!(found.zernike.as_ref().unwrap().coefficients.len(), 15);
    }
    let axis = waves.value.fields[0].value.as_ref().unwrap();
    let lit: Vec<f64> = axis.map.values.iter().flatten().copied().collect();
    let mean = lit.iter().sum::<f64>() / lit.len() as f64;
    let rms = (lit.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / lit.len() as f64).sqrt();
    assert!((rms / axis.wavefront.rms.value - 1.0).abs() < 0.1, "{rms} {:?}", axis.wavefront.rms);
}
