//! The versions of a design: a tree that undo and redo walk, with merits, names and rewinding.

use super::session_pareto::wait;
use aplanat::lens::{Edit, Parameter, Quantity, Variable, blank};
use aplanat::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::DescentMethod;
use aplanat::session::{Command, HistoryNode, Session};
use std::sync::Arc;

fn session() -> Session {
    Session::new(blank(), || {}).unwrap()
}

fn name(text: &str) -> Command {
    Edit::SetName(text.to_owned()).into()
}

fn versions(session: &Session) -> Arc<Vec<Arc<HistoryNode>>> {
    session.view().history
}

#[test]
fn an_edit_after_an_undo_is_a_branch_and_both_stay() {
    let mut session = session();
    for text in ["a", "b"] {
        session.apply(name(text));
        session.apply(Command::CommitEdit);
    }
    session.apply(Command::Undo);
    session.apply(name("c"));
    let parents: Vec<_> = versions(&session).iter().map(|node| node.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(1)]);
    assert_eq!(session.view().version_id, 3);
    session.apply(Command::GoTo(2));
    assert_eq!(session.lens().name, "b");
    session.apply(Command::Undo);
    session.apply(Command::Redo);
    assert_eq!(session.lens().name, "b", "redo goes where the designer was last");
    session.apply(Command::GoTo(3));
    assert_eq!(session.lens().name, "c");
    session.apply(Command::NameVersion { id: 3, name: " the other way ".into() });
    assert_eq!(versions(&session)[3].name.as_deref(), Some("the other way"));
    session.apply(Command::GoTo(77));
    assert_eq!(
        session.view().messages.last().unwrap().text,
        "there is no version 77 of the design"
    );
    assert_eq!(session.lens().name, "c");
}

#[test]
fn every_version_learns_its_merit_without_being_asked() {
    let mut session = session();
    wait(&mut session, "the merit", |view, _| view.history[0].merit.is_some());
    let index = Parameter::new(0, Quantity::Curvature);
    session.apply(Edit::Set { parameter: index, value: 0.02 }.into());
    wait(&mut session, "the merit of the edit", |view, _| view.history[1].merit.is_some());
    let view = session.view();
    let report = view.merit.unwrap();
    let values = report.values.as_ref().unwrap();
    assert_eq!(values.terms.len(), view.goal.unwrap().terms.len());
    assert_eq!(Some(values.total), view.history[1].merit);
    let shares: f64 = (0..values.terms.len()).filter_map(|term| values.share(term)).sum();
    assert!((shares - 1.0).abs() < 1e-12, "{shares}");
}

/// A session whose optimization of one curvature, 0.02 at the start, has ended.
fn optimized() -> Session {
    let mut session = session();
    let parameter = Parameter::new(0, Quantity::Curvature);
    let variable = Variable { parameter, min: None, max: None };
    session.apply(Edit::Set { parameter, value: 0.02 }.into());
    session.apply(Edit::AddVariable(variable).into());
    let terms = vec![WeightedTerm::new(Term::FocalLength(150.0), 1.0)];
    let goal = Goal {
        terms,
        pupil: PupilEdge::Frozen,
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
    };
    session.apply(Command::Optimize {
        method: DescentMethod::DampedLeastSquares,
        goal,
        glasses: None,
    });
    wait(&mut session, "the end", |view, _| !view.optimization.is_active());
    session
}

/// Whoever clicks a place of the curve sees that lens, and not the result that still waits.
#[test]
fn a_rewound_lens_is_shown_while_the_result_waits() {
    let mut session = optimized();
    assert!(session.view().candidate.is_some_and(|candidate| candidate.shown));
    session.apply(Command::Rewind { version: None, step: 0 });
    assert_eq!(session.lens().surfaces[0].curvature, 0.02);
    assert!(session.view().candidate.is_some_and(|candidate| !candidate.shown));
}

#[test]
fn an_accepted_optimization_keeps_its_course_and_can_be_rewound() {
    let mut session = optimized();
    let start = session.view().version_id;
    session.apply(Command::AcceptResult);
    let accepted = session.view().version_id;
    let node = versions(&session).last().unwrap().clone();
    let curve = node.curve.clone().unwrap();
    assert_eq!((curve.points[0].step, curve.points[0].values.as_slice()), (0, &[0.02][..]));
    assert!(curve.points.len() > 1, "{curve:?}");
    session.apply(Command::Rewind { version: Some(accepted), step: 0 });
    let rewound = versions(&session).last().unwrap().clone();
    assert_eq!((rewound.parent, rewound.lens.surfaces[0].curvature), (Some(start), 0.02));
    session.apply(Command::GoTo(accepted));
    assert_ne!(session.lens().surfaces[0].curvature, 0.02, "the result is still there");
}
