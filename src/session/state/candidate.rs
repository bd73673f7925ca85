//! The candidate: a lens of a run or a panel that the window shows in place of the design.

use super::runs::without_fixed_variables;
use super::{PreviewSource, Session};
use crate::lens::Lens;
use crate::session::MeritReport;
use crate::session::history::VersionOrigin;
use crate::session::journal::JournalEntry;
use crate::session::view::{CandidateSource, CandidateView, KeptLens, Severity};
use std::sync::Arc;

/// The maximum number of candidates that are kept beside the design.
const MAX_KEPT: usize = 50;

impl Session {
    /// The lens that could be shown in place of the design, with its source.
    pub(super) fn offered(&self) -> Option<(PreviewSource, Arc<Lens>)> {
        if let Some(lens) = &self.preview_lens {
            return Some((PreviewSource::Panel, Arc::clone(lens)));
        }
        if let Some((id, lens)) = self.structure_search.previewed() {
            return Some((PreviewSource::Run(id), lens));
        }
        let run = self.optimization.view();
        Some((PreviewSource::Run(run.id?), Arc::clone(run.displayed_lens()?)))
    }

    /// The merit of the candidate that is shown, maybe of one step before.
    pub(super) fn candidate_merit(&self) -> Option<Arc<MeritReport>> {
        self.candidate().filter(|candidate| candidate.shown)?;
        let latest = self.preview_merit.latest()?;
        let is_new = self.outdated_merit.as_ref().is_none_or(|old| !Arc::ptr_eq(old, &latest));
        is_new.then_some(latest)
    }

    /// The lens that is shown in place of the design, with its source.
    pub(super) fn previewed(&self) -> Option<(PreviewSource, Arc<Lens>)> {
        self.offered().filter(|_| self.shows_candidate)
    }

    /// Shows a lens of a panel in place of the design, or the design.
    pub(super) fn preview(&mut self, lens: Option<Box<Lens>>) {
        self.shows_candidate = true;
        self.preview_title = lens.as_deref().map_or_else(String::new, |lens| self.origin(lens));
        self.preview_lens = lens.map(|lens| Arc::new(*lens));
    }

    /// The origin of a lens that a panel shows.
    fn origin(&self, lens: &Lens) -> String {
        if *lens == *self.lens {
            return "the design itself".to_owned();
        }
        if let Some(kept) = self.kept.iter().find(|kept| *kept.lens == *lens) {
            return kept.title.clone();
        }
        if let Some(version) = self.history.nodes().iter().find(|node| *node.lens == *lens) {
            let name = version.name.as_deref().unwrap_or(&version.title);
            return format!("the version \"{name}\"");
        }
        match self.number_in_search(lens) {
            Some(number) => format!("lens {number} of the search"),
            None if self.pareto.has_found(lens) => "a lens of the Pareto front".to_owned(),
            None if self.is_worst_made(lens) => "the worst of the lenses as made".to_owned(),
            None if self.specified_design.has_found(lens) => {
                "a lens from a specification".to_owned()
            }
            None => "a changed lens".to_owned(),
        }
    }

    /// True for the lens with the largest spot of those with random errors of making.
    fn is_worst_made(&self, lens: &Lens) -> bool {
        let results = self.analysis.latest();
        let made = results.as_ref().and_then(|own| own.analyses.as_ref().ok()?.as_built.as_ref());
        let made = made.and_then(|made| made.value.as_ref().ok());
        let worst = made.and_then(|made| made.worst.as_ref()?.as_ref().ok());
        worst.is_some_and(|worst| worst.lens == *lens)
    }

    /// The number of a lens in the structure search; `None` if the search has not found it.
    pub(super) fn number_in_search(&self, lens: &Lens) -> Option<u64> {
        let search = self.structure_search.view().run.snapshot?;
        let retained = search.reservoir.iter().chain([&search.best, &search.start]);
        let mut retained = retained.map(|found| (found.number, &found.lens));
        let earlier = search.lineage.iter().map(|node| (node.number, &node.point));
        retained
            .find(|found| **found.1 == *lens)
            .or_else(|| earlier.into_iter().find(|found| **found.1 == *lens))
            .map(|found| found.0)
    }

    /// The candidate, whether it is shown or the design is.
    pub(super) fn candidate(&self) -> Option<CandidateView> {
        let (source, title) = if self.preview_lens.is_some() {
            (CandidateSource::Chosen, self.preview_title.clone())
        } else if self.structure_search.previewed_run().is_some() {
            (CandidateSource::Search, "the present lens of the search".to_owned())
        } else {
            self.optimization.view().displayed_lens()?;
            (CandidateSource::Optimization, "the optimized lens".to_owned())
        };
        Some(CandidateView { source, title, shown: self.shows_candidate })
    }

    /// Makes the candidate the design, as one undo step.
    pub(super) fn accept_candidate(&mut self) {
        match self.candidate().map(|candidate| (candidate.source, candidate.title)) {
            None => self.post(Severity::Warning, "there is no candidate to accept"),
            Some((CandidateSource::Optimization, _)) => self.accept_result(),
            Some((CandidateSource::Chosen, _)) => self.accept_preview(),
            Some((CandidateSource::Search, title)) => {
                let Some((_, lens)) = self.structure_search.previewed() else {
                    let text = "the search has no lens at this moment; try again";
                    return self.post(Severity::Warning, text);
                };
                self.structure_search.end_preview();
                let own = self.with_own_variables(&lens);
                self.accept_of_search(own, VersionOrigin::new(format!("accept {title}")));
            }
        }
        self.shows_candidate = true;
    }

    /// A candidate with the variables of the design if it has the same surfaces: a run may have more
    /// of them, and a lens of a search others.
    pub(super) fn with_own_variables(&self, lens: &Lens) -> Result<Lens, String> {
        let same_rows = lens.surfaces.len() == self.lens.surfaces.len();
        let own = Lens { variables: self.lens.variables.clone(), ..lens.clone() };
        let fits = same_rows && own.check().is_ok();
        let lens = if fits { own } else { without_fixed_variables(lens) };
        lens.check().map(|()| lens).map_err(|why| why.to_string())
    }

    /// Dismisses the candidate: an optimization ends, a search or a front goes on.
    pub(super) fn discard_candidate(&mut self) {
        match self.candidate().map(|candidate| candidate.source) {
            None => {}
            Some(CandidateSource::Optimization) => self.optimization.clear(),
            Some(CandidateSource::Chosen) => self.preview_lens = None,
            Some(CandidateSource::Search) => self.structure_search.end_preview(),
        }
        self.shows_candidate = true;
    }

    /// Keeps the candidate beside the design, which stays as it is, and as a branch of the history.
    pub(super) fn keep_candidate(&mut self) {
        let Some((_, lens)) = self.offered() else {
            return self.post(Severity::Warning, "there is no candidate to keep");
        };
        let title = self.candidate().map(|candidate| candidate.title).unwrap_or_default();
        let kept = Arc::make_mut(&mut self.kept);
        if kept.iter().any(|other| *other.lens == *lens) {
            return self.post(Severity::Note, format!("{title} is kept already"));
        }
        let title = format!("kept lens {}: {title}", kept.len() + 1);
        if kept.len() >= MAX_KEPT {
            kept.remove(0);
        }
        kept.push(KeptLens { title: title.clone(), lens: Arc::clone(&lens) });
        self.branch(&lens, title.clone());
        self.post(Severity::Note, format!("{title}; the design is unchanged"));
    }

    /// Adds a lens to the history as a version after the present one, which stays present.
    fn branch(&mut self, lens: &Arc<Lens>, title: String) {
        let own = self.with_own_variables(lens).map_or_else(|_| Arc::clone(lens), Arc::new);
        let proposal = Some(self.proposal.followed(&self.lens, &own));
        let origin = VersionOrigin { proposal, ..VersionOrigin::new(title) };
        let node = self.history.branch(self.history.present(), own, origin);
        self.record(JournalEntry::Node(node));
    }
}
