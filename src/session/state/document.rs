//! The document of a session: edits, undo, and its files.

use super::{Session, SessionEvent};
use crate::files::{self, ConversionOutcome, ImportedFile};
use crate::lens::{Aperture, Edit, ElementEdit, Lens, StartingLens, apply_edit};
use crate::math::format_short;
use crate::picture::{BitDepth, ToneCurve, encode_png};
use crate::pupil::{RayModel, limited_by_stop};
use crate::report::{
    FigureKind, FurtherColumns, PaperKind, ReportSettings, drawing_bytes, has_extension,
    report_bytes, solids_file, tolerance_sheet, tolerance_table,
};
use crate::session::ScenePicture;
use crate::session::figures::analysis_figure;
use crate::session::history::{DesignHistory, VersionOrigin};
use crate::session::journal::JournalEntry;
use crate::session::proposal::MeritProposal;
use crate::session::view::Severity;
use crate::tolerance::FocusTreatment;
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl Session {
    pub(super) fn edit(&mut self, edit: &Edit) {
        match apply_edit(&self.lens, edit) {
            Ok(lens) if lens == *self.lens => {}
            Ok(lens) => {
                let is_other = matches!(edit, Edit::Scale(_) | Edit::Replace(_));
                let proposal = is_other.then(|| MeritProposal::of(&lens));
                let cell = edit.cell();
                let origin = VersionOrigin { cell, proposal, ..VersionOrigin::new(edit.title()) };
                let (lens, told) = self.after_element_edit(edit, lens);
                self.add_version(Arc::new(lens), origin);
                if let Some((severity, told)) = told {
                    self.post(severity, told);
                }
            }
            Err(why) => self.post(Severity::Warning, why.to_string()),
        }
    }

    pub(super) fn limit_by_stop(&mut self) {
        let limited = limited_by_stop(&self.lens).map_err(|why| why.to_string());
        let limited = limited.and_then(|lens| {
            let replace = Edit::Replace(Box::new(lens));
            apply_edit(&self.lens, &replace).map_err(|why| why.to_string())
        });
        self.accept(limited, VersionOrigin::new("limit the beam by the stop"));
    }

    pub(super) fn scale_to_focal_length(&mut self, focal_length: f64) {
        let factor = files::focal_length_factor(&self.lens, self.settings.zoom, focal_length);
        let factor = factor.map_err(|why| why.to_string());
        let scaled = factor.and_then(|factor| {
            apply_edit(&self.lens, &Edit::Scale(factor)).map_err(|why| why.to_string())
        });
        let title = format!("scale to the focal length {focal_length} mm");
        let proposal = scaled.as_ref().ok().map(MeritProposal::of);
        self.accept(scaled, VersionOrigin { proposal, ..VersionOrigin::new(title) });
    }

    pub(super) fn insert_lens(&mut self, path: &Path, at: usize) {
        let inserted = files::open(path).map_err(|why| why.to_string()).and_then(|opened| {
            let insert = ElementEdit::Insert { at, rows: opened.lens.surfaces };
            let edit = Edit::Element(insert);
            apply_edit(&self.lens, &edit).map_err(|why| why.to_string())
        });
        let file = path.file_name().unwrap_or(path.as_os_str());
        self.accept(inserted, VersionOrigin::new(format!("insert {}", file.display())));
    }

    /// Makes a lens the design, as one undo step, or posts the reason why there is none.
    pub(super) fn accept(&mut self, lens: Result<Lens, String>, origin: VersionOrigin) {
        match lens {
            Ok(lens) => self.add_version(Arc::new(lens), origin),
            Err(why) => self.post(Severity::Warning, why),
        }
    }

    fn add_version(&mut self, lens: Arc<Lens>, origin: VersionOrigin) {
        let given = origin.proposal.clone();
        let mut proposal = given.unwrap_or_else(|| self.proposal.followed(&self.lens, &lens));
        let focused = proposal.asked.as_ref().and_then(|asked| with_asked_focus(&lens, asked));
        let told = focused.as_ref().map(focus_text);
        if focused.is_some() {
            proposal = Arc::new(proposal.fulfilled());
        }
        let lens = focused.map_or(lens, Arc::new);
        let origin = VersionOrigin { proposal: Some(proposal), ..origin };
        let node = self.history.push(Arc::clone(&lens), origin);
        self.record(JournalEntry::Node(node));
        self.record_present();
        self.set_design(lens);
        if let Some(told) = told {
            self.post(Severity::Note, told);
        }
    }

    pub(super) fn undo(&mut self) {
        let lens = self.history.undo();
        self.visit(lens);
    }

    pub(super) fn redo(&mut self) {
        let lens = self.history.redo();
        self.visit(lens);
    }

    pub(super) fn go_to(&mut self, id: u64) {
        let lens = self.history.go_to(id);
        if lens.is_none() {
            self.post(Severity::Warning, format!("there is no version {id} of the design"));
        }
        self.visit(lens);
    }

    /// Shows a version that the history went to.
    fn visit(&mut self, lens: Option<Arc<Lens>>) {
        let Some(lens) = lens else { return };
        self.history.commit();
        self.record_present();
        self.set_design(lens);
    }

    pub(super) fn name_version(&mut self, id: u64, name: &str) {
        let name = name.trim().to_owned();
        let given = Some(name.clone()).filter(|name| !name.is_empty());
        if self.history.change(id, |node| node.name = given) {
            self.record(JournalEntry::Name { node: id, name });
        }
    }

    /// Makes another lens the design.
    pub(super) fn set_design(&mut self, lens: Arc<Lens>) {
        // While a handle is dragged, the lens is no version yet.
        self.proposal = self.proposal_of_history();
        self.settings.zoom = self.settings.zoom.min(lens.zoom_positions() - 1);
        self.lens = lens;
        self.preview_lens = None;
        self.invalidate();
    }

    /// Begins a lens that has no file yet.
    pub(super) fn begin(&mut self, starting: &StartingLens) {
        match starting.lens() {
            Ok(lens) => {
                let proposal = MeritProposal::of_new(&lens, starting);
                self.replace_by_version(lens, None, VersionOrigin::first("new lens", proposal));
            }
            Err(why) => self.post(Severity::Warning, why.to_string()),
        }
    }

    /// Replaces the design by another one with an undo history of its own.
    pub(super) fn replace_design(&mut self, lens: Lens, path: Option<PathBuf>) {
        let origin = VersionOrigin::first("opened", MeritProposal::of(&lens));
        self.replace_by_version(lens, path, origin);
    }

    fn replace_by_version(&mut self, lens: Lens, path: Option<PathBuf>, origin: VersionOrigin) {
        if let Err(why) = lens.check() {
            return self.post(Severity::Error, why.to_string());
        }
        self.optimization.clear();
        self.pareto.clear();
        self.structure_search.forget_failed_start();
        let lens = Arc::new(lens);
        self.history = DesignHistory::new(Arc::clone(&lens), origin);
        self.saved = Arc::clone(&lens);
        self.path = path;
        self.imported = None;
        self.begin_journal();
        self.settings.zoom = 0;
        self.settings.pupil_wavelength = None;
        self.settings.wavefront_light = None;
        self.selected = None;
        self.document += 1;
        self.set_design(lens);
    }

    pub(super) fn open(&mut self, path: &Path) {
        match files::open_with(path, self.import_settings) {
            Ok(opened) => {
                // A foreign file is not overwritten under its own name without asking.
                let own = (opened.format == files::LensFormat::Native).then(|| path.to_owned());
                let imported = opened.imported_from(path);
                self.replace_design(opened.lens, own);
                self.resume_journal();
                self.set_imported(imported);
                self.events.push(SessionEvent::Opened(path.to_owned()));
            }
            Err(why) => self.post(Severity::Error, why.to_string()),
        }
    }

    /// Keeps the report on the file of another program, and says whether something of it is lost.
    fn set_imported(&mut self, imported: Option<ImportedFile>) {
        self.imported = imported.map(Arc::new);
        let Some(imported) = self.imported.clone() else { return };
        let lost = imported.report.count(ConversionOutcome::Dropped);
        let severity = if lost == 0 { Severity::Note } else { Severity::Warning };
        let counts = imported.report.counts();
        self.post(severity, format!("imported {}: {counts}", imported.path.display()));
    }

    /// Writes the report on the file of another program as text.
    pub(super) fn save_import_report(&mut self, path: &Path) {
        let Some(imported) = &self.imported else {
            return self.post(Severity::Warning, "the lens comes from no file of another program");
        };
        match files::write_atomic(path, imported.to_string().as_bytes()) {
            Ok(()) => self.post(Severity::Note, format!("saved as {}", path.display())),
            Err(why) => self.post(Severity::Error, why.to_string()),
        }
    }

    pub(super) fn save(&mut self, path: Option<PathBuf>) {
        let Some(path) = path.or_else(|| self.path.clone()) else {
            let text = "the lens has no file yet; choose where to save it";
            return self.post(Severity::Warning, text);
        };
        match files::save(&self.lens_for(&path), &path) {
            Ok(saved) if saved.format == files::LensFormat::Native => {
                self.saved = Arc::clone(&self.lens);
                self.path = Some(path.clone());
                let node = self.history.present();
                self.record(JournalEntry::Saved { node, path: path.clone() });
                self.message_is_recent = false;
                self.events.push(SessionEvent::Saved(path));
            }
            // A foreign file may hold less than the lens, which stays unsaved.
            Ok(saved) => self.post_export(&path, saved),
            Err(why) => self.post(Severity::Error, why.to_string()),
        }
    }

    /// The design as it is written to a file. Foreign formats have no place for a merit function.
    fn lens_for(&self, path: &Path) -> Arc<Lens> {
        if has_extension(path, "json") { self.lens_with_merit() } else { Arc::clone(&self.lens) }
    }

    pub(super) fn export(&mut self, path: &Path) {
        match files::save(&self.lens_for(path), path) {
            Ok(saved) => self.post_export(path, saved),
            Err(why) => self.post(Severity::Error, why.to_string()),
        }
    }

    /// Writes a report, the layout or the solids of the lens.
    pub(super) fn export_paper(&mut self, kind: PaperKind, path: &Path) {
        match self.write_paper(kind, path) {
            Ok(()) => self.post(Severity::Note, format!("saved as {}", path.display())),
            Err(why) => self.post(Severity::Error, format!("{}: {why}", path.display())),
        }
    }

    /// Writes what an analysis shows of the lens that the panels show.
    fn write_figure(&self, kind: FigureKind, path: &Path) -> Result<(), String> {
        let results = self.preview_results().or_else(|| self.results());
        let results = results.ok_or("nothing is computed yet")?;
        let figure = analysis_figure(kind, &results)?;
        let bytes = figure.bytes(&results.lens.name, path).map_err(|why| why.to_string())?;
        files::write_atomic(path, &bytes).map_err(|why| why.to_string())
    }

    /// Adds a glass catalogue for good.
    pub(super) fn add_glasses(&mut self, path: &Path) {
        match files::add_catalogue(path) {
            Ok((catalogue, saved)) => {
                let (count, refused) = (catalogue.glasses.len(), catalogue.refused.len());
                let saved: Vec<String> = saved.iter().map(|p| p.display().to_string()).collect();
                let saved = saved.join(", ");
                let glasses = if count == 1 { "glass" } else { "glasses" };
                let text = format!("{count} {glasses} added, {refused} refused; kept as {saved}");
                self.post(Severity::Note, text);
            }
            Err(why) => self.post(Severity::Error, why.to_string()),
        }
    }

    /// The tolerances that the panel shows, as a table or as charts.
    fn tolerance_bytes(&self, kind: PaperKind) -> Result<Vec<u8>, String> {
        let results = self.results();
        let analyses = results.as_ref().and_then(|results| results.analyses.as_ref().ok());
        let made = analyses.and_then(|analyses| analyses.as_built.clone());
        let made = made.ok_or("no tolerances are computed yet; open the panel Tolerances")?;
        let made = made.value.as_ref().map_err(Clone::clone)?;
        let (sheet, analysis) = (&made.sheet, &made.analysis);
        if kind == PaperKind::ToleranceTable {
            let (further, order) = (FurtherColumns::default(), FocusTreatment::Refocused);
            let table =
                tolerance_table(sheet, analysis, &further, order).map_err(|why| why.to_string())?;
            return Ok(table.into_bytes());
        }
        let charts = tolerance_sheet(&self.lens.name, sheet, analysis);
        let canvas = charts.map_err(|why| why.to_string())?.canvas();
        canvas.png().map_err(|why| why.to_string())
    }

    fn write_paper(&self, kind: PaperKind, path: &Path) -> Result<(), String> {
        let allowed = kind.extensions();
        if !allowed.iter().any(|extension| has_extension(path, extension)) {
            return Err(format!("expected a name that ends with .{}", allowed.join(" or .")));
        }
        let zoom = self.settings.zoom;
        let settings = ReportSettings { tolerance: self.settings.tolerance };
        let bytes = match kind {
            PaperKind::Report => report_bytes(&self.lens, settings, path).map(|(bytes, _)| bytes),
            PaperKind::Layout => {
                drawing_bytes(&self.lens, zoom, None, path).map(|(bytes, _)| bytes)
            }
            PaperKind::Solids => {
                solids_file(&self.lens, zoom, None).map(|file| file.text.into_bytes())
            }
            PaperKind::Figure(kind) => return self.write_figure(kind, path),
            PaperKind::ToleranceTable | PaperKind::ToleranceCharts => {
                let bytes = self.tolerance_bytes(kind)?;
                return files::write_atomic(path, &bytes).map_err(|why| why.to_string());
            }
        };
        let bytes = bytes.map_err(|why| why.to_string())?;
        files::write_atomic(path, &bytes).map_err(|why| why.to_string())
    }

    /// Saves the newest picture of the scene, with 16 bits for a colour of a pixel.
    pub(super) fn save_picture(&mut self, path: &Path) {
        match self.write_picture(path) {
            Ok(()) => self.post(Severity::Note, format!("saved as {}", path.display())),
            Err(why) => self.post(Severity::Error, why),
        }
    }

    fn write_picture(&self, path: &Path) -> Result<(), String> {
        let results = self.results();
        let analyses = results.as_ref().and_then(|results| results.analyses.as_ref().ok());
        let shown = analyses.and_then(|analyses| analyses.picture.clone());
        let shown = shown.ok_or("there is no picture yet; open the panel Picture")?;
        let ScenePicture { picture, scene, error, left_out, .. } =
            shown.value.as_ref().map_err(Clone::clone)?;
        let error = error.map_or("not measured".to_owned(), |error| format!("{:.4}", error.value));
        let texts = [
            ("Software", "Aplanat".to_owned()),
            ("Scene", scene.name()),
            ("Error", format!("{error} of mid grey (rms)")),
            ("Left out", left_out.join("; ")),
        ];
        let bytes = encode_png(picture, BitDepth::Sixteen, ToneCurve::Srgb, &texts)
            .map_err(|why| why.to_string())?;
        files::write_atomic(path, &bytes).map_err(|why| why.to_string())
    }

    /// Posts what a foreign file contains and what it could not represent.
    fn post_export(&mut self, path: &Path, saved: files::SaveReport) {
        let head = Some(format!("exported to {}", path.display()));
        let proof = saved.proof.map(|p| p.to_string());
        let parts = [head, proof, saved.report.map(|r| r.to_string())];
        self.post(Severity::Note, parts.into_iter().flatten().collect::<Vec<_>>().join("\n"));
        self.events.push(SessionEvent::Saved(path.to_owned()));
    }
}

/// The lens with the aperture and the fields that were asked for before it had a focus; `None` if it
/// has no real focus yet, or nothing of it changes.
fn with_asked_focus(lens: &Arc<Lens>, asked: &StartingLens) -> Option<Lens> {
    let focused = asked.with_asked_focus(lens);
    if focused == **lens || focused.check().is_err() {
        return None;
    }
    let model = RayModel::from_lens(&focused, 0).ok()?;
    model.first_order.efl.is_some_and(|focal_length| focal_length > 0.0).then_some(focused)
}

/// The line that tells that a lens has the aperture and the fields that were asked for.
fn focus_text(lens: &Lens) -> String {
    let beam = match lens.aperture {
        Aperture::FNumber(number) => format!("aperture f/{}", format_short(number)),
        _ => "image height".to_owned(),
    };
    format!("the lens has a focus now, and with it the {beam} that was asked for")
}
