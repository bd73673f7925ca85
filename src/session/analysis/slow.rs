//! Analyses that take longer than all else: they follow the others, one after another, and a new request
//! interrupts them.

use super::{Analyses, AnalysisOutput, AnalysisResults, AnalysisSettings};
use crate::lens::Lens;
use crate::session::clock::{Timed, time};
use std::sync::Arc;

/// The computation of numbers of a lens that was analysed; `None` if it was interrupted.
type Compute<T> = fn(&AnalysisResults, &Analyses, &(dyn Fn() -> bool + Sync)) -> Option<T>;

/// An analysis that takes long. What is known of a lens is not computed again because another panel is
/// opened.
pub(super) struct SlowAnalysis<T> {
    /// True if a panel shows it.
    pub(super) is_asked: fn(&AnalysisSettings) -> bool,
    pub(super) compute: Compute<T>,
    /// Its place among the numbers of a lens.
    pub(super) slot: fn(&mut Analyses) -> &mut Option<Arc<Timed<T>>>,
    pub(super) known: Option<KnownNumbers<T>>,
}

/// Numbers of a lens, with the settings on which they depend.
pub(super) struct KnownNumbers<T> {
    lens: Arc<Lens>,
    settings: AnalysisSettings,
    numbers: Arc<Timed<T>>,
}

impl<T> KnownNumbers<T> {
    /// True if these are the numbers that results need.
    fn serve(&self, results: &AnalysisResults) -> bool {
        let (own, other) = (&self.settings, &results.settings);
        Arc::ptr_eq(&self.lens, &results.lens)
            && own.zoom == other.zoom
            && own.tolerance == other.tolerance
            && own.overrides == other.overrides
            && own.coating == other.coating
            && own.contrast_frequency == other.contrast_frequency
            && own.wavefront_light == other.wavefront_light
    }
}

impl<T> SlowAnalysis<T> {
    /// Publishes the results once more with these numbers if a panel shows them, unless another request
    /// interrupts that.
    pub(super) fn publish(
        &mut self,
        mut results: AnalysisResults,
        output: &AnalysisOutput,
    ) -> AnalysisResults {
        if !(self.is_asked)(&results.settings) {
            return results;
        }
        self.known = self.known.take().filter(|known| known.serve(&results));
        if self.known.is_none() && !output.is_interrupted() {
            self.known = self.numbers(&results, output);
        }
        if let (Ok(analyses), Some(known)) = (&mut results.analyses, &self.known) {
            *(self.slot)(analyses) = Some(Arc::clone(&known.numbers));
            output.publish(results.clone());
        }
        results
    }

    fn numbers(
        &self,
        results: &AnalysisResults,
        output: &AnalysisOutput,
    ) -> Option<KnownNumbers<T>> {
        let analyses = results.analyses.as_ref().ok()?;
        let interrupted = output.interruption();
        let timed = time(|| (self.compute)(results, analyses, &interrupted));
        let numbers = Arc::new(Timed { value: timed.value?, ms: timed.ms });
        let (lens, settings) = (Arc::clone(&results.lens), results.settings.clone());
        Some(KnownNumbers { lens, settings, numbers })
    }
}
