//! The background runs of a session: starting them, their events, and accepting their lenses.

use super::{Session, SessionEvent};
use crate::files::GlassQuery;
use crate::lens::glass::{self, Glass};
use crate::lens::{Edit, Lens, apply_edit};
use crate::merit::Goal;
use crate::optimize::DescentMethod;
use crate::optimize::pareto::ParetoSettings;
use crate::session::grin_design::{GrinCommand, GrinExport};
use crate::session::history::VersionOrigin;
use crate::session::optimization::{OptimizationRequest, OptimizationSnapshot};
use crate::session::pareto::ParetoExport;
use crate::session::run::{RunEvent, RunKind, RunStatus};
use crate::session::specified_design::{DesignNotSaved, SpecifiedDesignCommand};
use crate::session::structure_search::{StructureSearchCommand, StructureSearchReport};
use crate::session::view::Severity;
use std::path::PathBuf;
use std::sync::Arc;

impl Session {
    /// Saves structure searches without a chosen file in a folder from now on, and offers to resume
    /// the unfinished search in it.
    pub fn set_save_folder(&mut self, folder: impl Into<PathBuf>) {
        self.structure_search.set_save_folder(folder.into());
    }

    /// Keeps gradient-index fields in a folder while they are designed from now on, and opens the one
    /// that a program has left there when it was killed.
    pub fn set_field_folder(&mut self, folder: impl Into<PathBuf>) {
        if let Some(file) = self.grin.set_backup_folder(folder.into()) {
            let file = file.display();
            let text = format!("recovered the field of an interrupted design: {file}");
            self.post(Severity::Note, text);
        }
    }

    /// Saves designs from specifications in a folder from now on, and offers to resume the unfinished
    /// one in it.
    pub fn set_design_folder(&mut self, folder: impl Into<PathBuf>) {
        self.specified_design.set_save_folder(folder.into());
    }

    /// Takes the events of all runs.
    pub(super) fn receive_run_events(&mut self) {
        for event in self.optimization.drain_events() {
            match self.receive(RunKind::Optimization, event) {
                None => {}
                Some(report) => match report {},
            }
        }
        for event in self.pareto.drain_events() {
            if let Some(export) = self.receive(RunKind::Pareto, event) {
                self.post_pareto_export(export);
            }
        }
        for event in self.structure_search.drain_events() {
            if let Some(report) = self.receive(RunKind::StructureSearch, event) {
                self.post_search_report(report);
            }
        }
        for event in self.grin.drain_events() {
            if let Some(export) = self.receive(RunKind::GrinDesign, event) {
                self.post_grin_export(export);
            }
        }
        for event in self.specified_design.drain_events() {
            if let Some(DesignNotSaved(why)) = self.receive(RunKind::SpecifiedDesign, event) {
                self.post(Severity::Error, why);
            }
        }
    }

    /// Takes an event of a run and returns the message of its engine, if it is one.
    fn receive<R>(&mut self, kind: RunKind, event: RunEvent<R>) -> Option<R> {
        let status = match event {
            RunEvent::Report(report) => return Some(report),
            RunEvent::Status(status) => status,
            RunEvent::Failed(why) => {
                self.post(Severity::Error, why);
                RunStatus::Failed
            }
        };
        self.events.push(SessionEvent::Run(kind, status));
        None
    }

    pub(super) fn optimize(&mut self, method: DescentMethod, goal: Goal, words: Option<String>) {
        let glasses = match words.map(|words| find_glasses(&words)).transpose() {
            Ok(glasses) => glasses,
            Err(why) => return self.post(Severity::Error, why),
        };
        (self.preview_lens, self.shows_candidate) = (None, true);
        let (lens, tolerance) = (Arc::clone(&self.lens), self.settings.tolerance);
        let request = OptimizationRequest { method, lens, goal, tolerance, glasses };
        self.optimization.start(request);
    }

    /// Makes the best lens of the optimization the design.
    pub(super) fn accept_result(&mut self) {
        let Some(run) = self.optimization.snapshot() else {
            return self.post(Severity::Warning, "there is no optimization result to accept");
        };
        let merged = merge_result(&run, &self.lens);
        if merged.is_ok() {
            self.discard_result();
        }
        let curve = Some(Arc::clone(&run.curve)).filter(|curve| curve.points.len() > 1);
        let origin = VersionOrigin { curve, ..VersionOrigin::new("accept the optimized lens") };
        self.accept(merged, origin);
    }

    pub(super) fn discard_result(&mut self) {
        self.optimization.clear();
        self.end_journaled_run(RunKind::Optimization);
    }

    pub(super) fn start_pareto(&mut self, settings: ParetoSettings, compare: bool) {
        self.pareto.start(&self.lens, settings, compare);
    }

    pub(super) fn clear_pareto(&mut self) {
        self.pareto.clear();
        self.end_journaled_run(RunKind::Pareto);
    }

    /// Makes the lens of a step of an optimization the design: after the version from which the
    /// optimization started if it was accepted.
    pub(super) fn rewind(&mut self, version: Option<u64>, step: usize) {
        let found = match version {
            Some(id) => self.history.node(id).and_then(|node| {
                Some((Arc::clone(node.curve.as_ref()?), Arc::clone(&node.lens), node.parent))
            }),
            None => self
                .optimization
                .snapshot()
                .map(|run| (Arc::clone(&run.curve), Arc::clone(&run.request.lens), None)),
        };
        let point = found.as_ref().and_then(|(curve, ..)| curve.nearest(step));
        let (Some((curve, lens, parent)), Some(point)) = (&found, point) else {
            return self.post(Severity::Warning, "there is no optimization to go back in");
        };
        let lens = curve.lens_at(point, lens);
        let checked = lens.check().map(|()| lens).map_err(|why| why.to_string());
        if let Some(parent) = parent {
            self.history.go_to(*parent);
        }
        self.accept(checked, VersionOrigin::new(format!("optimization, step {}", point.step)));
        // The lens that was asked for is shown, and not the result that still waits to be accepted.
        self.shows_candidate = false;
    }

    /// Makes the lens that is shown in place of the design the design. It keeps the variables of the
    /// design if it can: a sweep of the Pareto front has more of them.
    pub(super) fn accept_preview(&mut self) {
        let Some(shown) = self.preview_lens.take() else {
            return self.post(Severity::Warning, "there is no preview to accept");
        };
        let origin = VersionOrigin::new(format!("accept {}", self.preview_title));
        let own = self.with_own_variables(&shown);
        if self.number_in_search(&shown).is_some() {
            self.accept_of_search(own, origin);
        } else {
            self.accept(own, origin);
        }
    }

    pub(super) fn export_pareto(&mut self, folder: PathBuf) {
        if let Err(why) = self.pareto.export(folder) {
            self.post(Severity::Warning, why);
        }
    }

    fn post_pareto_export(&mut self, export: ParetoExport) {
        match export {
            ParetoExport::Written { folder, files, stale } => {
                let remain = match stale {
                    0 => String::new(),
                    _ => format!("; {stale} files of an earlier front remain there"),
                };
                let place = folder.display();
                let text = format!("{files} files of the front written to {place}{remain}");
                self.post(Severity::Note, text);
                self.events.push(SessionEvent::Saved(folder));
            }
            ParetoExport::Failed(why) => self.post(Severity::Error, why),
        }
    }

    pub(super) fn structure_search_command(&mut self, command: StructureSearchCommand) {
        if let StructureSearchCommand::Accept(number) = command {
            return self.accept_found(number);
        }
        let starts = matches!(
            command,
            StructureSearchCommand::Start(_)
                | StructureSearchCommand::StartShown(_)
                | StructureSearchCommand::ResumeFrom(_)
                | StructureSearchCommand::Follow(_)
        );
        if starts {
            self.preview_lens = None;
        }
        let mut command = command;
        if let StructureSearchCommand::Start(request)
        | StructureSearchCommand::StartShown(request) = &mut command
        {
            self.give_goal(request);
        }
        if let Err(why) = self.structure_search.handle(command, &self.lens) {
            self.post(Severity::Warning, why);
        }
    }

    /// Makes a lens of the structure search the design.
    fn accept_found(&mut self, number: u64) {
        let found = self.structure_search.lens_by_number(number).and_then(|lens| {
            let own = without_fixed_variables(&lens);
            own.check().map(|()| own).map_err(|why| why.to_string())
        });
        if found.is_ok() {
            self.structure_search.end_preview();
        }
        let search = self.structure_search.view().run.snapshot;
        let seed = search.map(|search| search.request.plan.settings.seed);
        let title = format!("accept lens {number} of the search");
        self.accept_of_search(found, VersionOrigin { seed, ..VersionOrigin::new(title) });
    }

    /// Makes a lens of the structure search the design, and says what becomes of its aperture.
    pub(super) fn accept_of_search(&mut self, found: Result<Lens, String>, origin: VersionOrigin) {
        match found.map(|lens| self.with_design_aperture(lens)) {
            Ok((lens, told)) => {
                self.accept(Ok(lens), origin);
                if let Some(told) = told {
                    self.post(Severity::Note, told);
                }
            }
            Err(why) => self.post(Severity::Warning, why),
        }
    }

    fn post_search_report(&mut self, report: StructureSearchReport) {
        match report {
            StructureSearchReport::Rejected(why) => self.post(Severity::Warning, why),
            StructureSearchReport::Exported { number, path, text } => {
                let head = format!("lens {number} finalized and exported to {}", path.display());
                self.post(Severity::Note, format!("{head}\n{text}"));
                self.events.push(SessionEvent::Saved(path));
            }
            StructureSearchReport::NotExported { why, .. }
            | StructureSearchReport::NotSaved(why) => self.post(Severity::Error, why),
        }
    }

    pub(super) fn grin_command(&mut self, command: GrinCommand) {
        if let Err(why) = self.grin.handle(command) {
            self.post(Severity::Warning, why);
        }
    }

    pub(super) fn specified_design_command(&mut self, command: SpecifiedDesignCommand) {
        if let Err(why) = self.specified_design.handle(command) {
            self.post(Severity::Warning, why);
        }
    }

    fn post_grin_export(&mut self, export: GrinExport) {
        match export {
            GrinExport::Written(path, text) => {
                self.post(Severity::Note, text);
                self.events.push(SessionEvent::Saved(path));
            }
            GrinExport::Failed(why) => self.post(Severity::Error, why),
        }
    }
}

/// The best lens of an optimization. If the design was edited meanwhile, the design with the values
/// of the variables of the optimization.
fn merge_result(run: &OptimizationSnapshot, design: &Arc<Lens>) -> Result<Lens, String> {
    let best = &run.best;
    if Arc::ptr_eq(&run.request.lens, design) {
        return Ok(Lens::clone(best));
    }
    let same_rows =
        best.surfaces.len() == design.surfaces.len() && best.zoom.len() == design.zoom.len();
    if !same_rows {
        return Err("the surfaces of the design have changed since the optimization started".into());
    }
    let mut lens = Lens::clone(design);
    lens.merit.get_or_insert_with(|| run.request.goal.clone());
    for variable in &run.request.lens.variables {
        if let Some(value) = best.get(variable.parameter) {
            lens.set(variable.parameter, value);
        }
    }
    let before = &run.request.lens.surfaces;
    for ((row, best), before) in lens.surfaces.iter_mut().zip(&best.surfaces).zip(before) {
        if best.medium != before.medium {
            row.medium = best.medium.clone();
        }
    }
    let lens = apply_edit(&lens, &Edit::SetName(design.name.clone()));
    lens.map_err(|why| format!("the result does not fit the present design: {why}"))
}

/// The glasses that some words find.
fn find_glasses(words: &str) -> Result<Arc<[&'static Glass]>, String> {
    let query = GlassQuery::new(words.split_whitespace()).map_err(|why| why.to_string())?;
    let found: Vec<_> = glass::known().filter(|glass| query.is_met_by(glass)).collect();
    if found.is_empty() { Err(format!("found no glass for `{words}`")) } else { Ok(found.into()) }
}

/// A lens of a structure search without the variables that the search has fixed by equal bounds.
pub(super) fn without_fixed_variables(lens: &Lens) -> Lens {
    let mut own = lens.clone();
    own.variables.retain(|v| v.min.is_none() || v.min != v.max);
    own
}
