//! The state of a design from a specification that panels read.

use super::SpecificationRequest;
use crate::lens::Lens;
use crate::search::design::{
    DesignRun, DesignStage, DesignedLens, FilledValue, LensRequirements, SpecificationError,
};
use std::path::PathBuf;
use std::sync::Arc;

/// The state of a design from a specification.
#[derive(Debug, Clone)]
pub struct SpecifiedDesign {
    /// The specification.
    pub request: Arc<SpecificationRequest>,
    /// The same with everything that was not stated.
    pub requirements: Arc<LensRequirements>,
    /// The values that were not stated.
    pub filled: Arc<Vec<FilledValue>>,
    /// The stage of the present round.
    pub stage: DesignStage,
    /// True while the lenses at the end get their rims, limits and focus.
    pub is_finishing: bool,
    /// The number of evaluations with derivatives so far.
    pub gradients: u64,
    /// The number of lenses that are kept.
    pub candidates: usize,
    /// The root of the best merit in mm: spots, and squared violations of limits; infinite before
    /// there is a lens.
    pub best: f64,
    /// The best lens so far, with rims; `None` before there is one through which light gets.
    pub best_lens: Option<Arc<Lens>>,
    /// The time of the rounds without pauses, in seconds.
    pub seconds: f64,
    /// The lenses at the end: the best one first, each quality once; empty before.
    pub lenses: Arc<Vec<OfferedLens>>,
    /// The file from which the design can be resumed once it has ended.
    pub resumable: Option<PathBuf>,
}

/// A lens at the end of a design.
#[derive(Debug, Clone)]
pub struct OfferedLens {
    /// The lens with its quality, judgement and costs.
    pub designed: DesignedLens,
    /// The same lens, shared.
    pub lens: Arc<Lens>,
}

impl SpecifiedDesign {
    /// The state before the first round, or after the rounds of a file.
    pub(super) fn new(
        request: SpecificationRequest,
        run: &DesignRun,
        seconds: f64,
    ) -> Result<Self, SpecificationError> {
        let (requirements, filled) = LensRequirements::complete(&request.specification)?;
        let mut state = Self {
            request: Arc::new(request),
            requirements: Arc::new(requirements),
            filled: Arc::new(filled),
            stage: run.stage(),
            is_finishing: false,
            gradients: 0,
            candidates: 0,
            best: f64::INFINITY,
            best_lens: None,
            seconds,
            lenses: Arc::default(),
            resumable: None,
        };
        state.update(run);
        Ok(state)
    }

    /// Takes over the state of a run.
    pub(super) fn update(&mut self, run: &DesignRun) {
        self.stage = run.stage();
        self.gradients = run.gradients();
        self.candidates = run.pool_size();
        if run.best() != self.best {
            self.best = run.best();
            self.best_lens = run.best_lens().map(Arc::new);
        }
    }

    /// Takes over the lenses at the end.
    pub(super) fn offer(&mut self, found: Vec<DesignedLens>) {
        let offered = found
            .into_iter()
            .map(|designed| OfferedLens { lens: Arc::new(designed.lens.clone()), designed });
        self.lenses = Arc::new(offered.collect());
    }

    /// The share of the time that is used, at most about 1.
    pub fn share_used(&self) -> f64 {
        self.seconds / (60.0 * self.request.minutes)
    }
}
