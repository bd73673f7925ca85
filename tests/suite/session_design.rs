//! The design from a specification of a session: it runs, is stopped, resumed, dismissed, and its lenses
//! keep what is asked for.

use super::merit::bundled;
use super::session_pareto::wait;
use aplanat::search::design::{DesignMerit, DesignSettings, LensSpecification};
use aplanat::session::{
    RunStatus, Session, SpecificationRequest, SpecifiedDesign, SpecifiedDesignCommand,
};
use std::path::PathBuf;
use std::sync::Arc;

fn session() -> Session {
    Session::new(bundled("achromat_ac254_100"), || {}).unwrap()
}

/// A small design that ends after this time.
fn request(minutes: f64) -> Box<SpecificationRequest> {
    let specification = LensSpecification {
        focal_length_mm: Some(50.0),
        f_number: Some(8.0),
        half_field_deg: Some(2.0),
        max_elements: Some(1),
        ..LensSpecification::default()
    };
    let settings = DesignSettings { starts: [1, 1], ..DesignSettings::with_seed(3) };
    Box::new(SpecificationRequest { specification, settings, minutes })
}

/// The time after which the first round is the last one, in minutes.
const SOON: f64 = 1e-6;

fn apply(session: &mut Session, command: SpecifiedDesignCommand) {
    session.apply(command.into());
}

fn until(session: &mut Session, status: RunStatus) -> Arc<SpecifiedDesign> {
    wait(session, "the status of the design", |view, _| view.specified_design.run.status == status);
    session.view().specified_design.run.snapshot.unwrap()
}

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let name = format!("aplanat-designs-{name}-{}", std::process::id());
        Self(std::env::temp_dir().join(name))
    }

    fn files(&self) -> usize {
        let files = std::fs::read_dir(&self.0).map(|files| files.flatten().collect::<Vec<_>>());
        let is_design = |name: &str| name.ends_with(".design.json");
        let files = files.unwrap_or_default();
        files.iter().filter(|file| is_design(&file.file_name().to_string_lossy())).count()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap_or_default();
    }
}

/// The lenses are judged by their own rays, as the specification asks.
#[test]
fn a_design_ends_with_lenses_that_keep_its_limits() {
    let mut session = session();
    let before = Arc::clone(session.lens());
    apply(&mut session, SpecifiedDesignCommand::Start(request(SOON)));
    let design = until(&mut session, RunStatus::Finished);
    assert!(
        design.filled.iter().any(|value| value.key == "max_track_mm"),
        "what is filled is told"
    );
    let best = &design.lenses[0];
    assert_eq!(best.designed.merit, DesignMerit::Best);
    assert!(best.designed.judgement.is_valid(), "{:?}", best.designed.judgement.failures());
    assert!((best.designed.judgement.focal_length / 50.0 - 1.0).abs() < 0.01);
    assert_eq!(best.designed.judgement.elements, 1);
    assert_eq!(*session.lens(), before, "the design that is open stays as it is");
}

#[test]
fn a_design_that_is_stopped_goes_on_from_its_file() {
    let folder = Folder::new("stopped");
    let mut first = session();
    first.set_design_folder(&folder.0);
    assert_eq!(first.view().specified_design.unfinished, None);
    apply(&mut first, SpecifiedDesignCommand::Start(request(60.0)));
    wait(&mut first, "a lens", |view, _| {
        let run = view.specified_design.run.snapshot.as_ref();
        run.is_some_and(|design| design.best_lens.is_some())
    });
    apply(&mut first, SpecifiedDesignCommand::Stop);
    let stopped = until(&mut first, RunStatus::Stopped);
    assert!(!stopped.lenses.is_empty(), "the best lens so far is finished");
    assert!(first.view().specified_design.unfinished.is_some());
    drop(first);

    let mut second = session();
    second.set_design_folder(&folder.0);
    apply(&mut second, SpecifiedDesignCommand::ResumeUnfinished);
    let resumed = until(&mut second, RunStatus::Running);
    assert_eq!(resumed.request, stopped.request);
    assert!(resumed.candidates > 0 && resumed.seconds > 0.0, "its rounds are not done again");
    apply(&mut second, SpecifiedDesignCommand::Pause);
    let paused = until(&mut second, RunStatus::Paused);
    apply(&mut second, SpecifiedDesignCommand::Clear);
    assert!(paused.gradients >= resumed.gradients);
    assert!(second.view().specified_design.run.id.is_none());
    assert_eq!(folder.files(), 0, "a design that is dismissed leaves no file");
}

#[test]
fn what_no_lens_can_do_is_refused_by_name() {
    let mut session = session();
    let mut asked = request(SOON);
    asked.specification.f_number = Some(0.4);
    apply(&mut session, SpecifiedDesignCommand::Start(asked));
    wait(&mut session, "the refusal", |view, _| {
        let error = view.specified_design.run.error.as_ref();
        error.is_some_and(|why| why.contains("no lens can do that: f/0.4"))
    });
    apply(&mut session, SpecifiedDesignCommand::ResumeUnfinished);
    let messages = session.view().messages;
    assert!(messages.iter().any(|message| message.text.contains("no design to resume")));
}
