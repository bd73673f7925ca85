//! Results field by field, with lines that say how far a long run is.

use super::{AnalysisRun, SelectedField};
use crate::cli::progress::ProgressNotes;

impl AnalysisRun {
    /// The result at each field. A run of many seconds tells on standard error how many fields are done.
    pub(super) fn at_each_field<T>(&self, mut at: impl FnMut(&SelectedField) -> T) -> Vec<T> {
        let mut notes = ProgressNotes::new();
        let count = self.fields.len();
        let one = |(i, field): (usize, &SelectedField)| {
            let found = at(field);
            if i + 1 < count {
                notes.tell(|| format!("{} of {count} fields", i + 1));
            }
            found
        };
        self.fields.iter().enumerate().map(one).collect()
    }
}
