//! The terms of a merit function before and after a run.

use super::output::{ShortNumber, TextTable};
use crate::merit::TermValue;
use serde::Serialize;

/// A term before and after a run.
#[derive(Serialize)]
pub(super) struct TermComparison {
    pub(super) term: &'static str,
    weight: f64,
    before: TermEstimate,
    after: TermEstimate,
}

#[derive(Serialize)]
struct TermEstimate {
    value: f64,
    error: f64,
    rays: usize,
    reached: bool,
}

impl TermEstimate {
    fn new(term: &TermValue) -> Self {
        let TermValue { value, error, rays, reached, .. } = *term;
        Self { value, error, rays, reached }
    }
}

impl TermComparison {
    /// The terms of a merit function at two lenses.
    pub(super) fn compare(before: &[TermValue], after: &[TermValue]) -> Vec<Self> {
        let term = |(before, after): (&TermValue, &TermValue)| Self {
            term: before.term,
            weight: before.weight,
            before: TermEstimate::new(before),
            after: TermEstimate::new(after),
        };
        before.iter().zip(after).map(term).collect()
    }

    /// A note on the terms that the rays do not sample to the tolerance; `None` without such terms.
    pub(super) fn note(terms: &[Self]) -> Option<String> {
        let coarse = terms.iter().filter(|term| !(term.before.reached && term.after.reached));
        let names: Vec<&str> = coarse.map(|term| term.term).collect();
        let text = || {
            format!(
                "note: the tolerance is not reached, the errors are as shown: {}",
                names.join(", ")
            )
        };
        (!names.is_empty()).then(text)
    }

    /// A table with a row for each term.
    pub(super) fn table(terms: &[Self]) -> TextTable {
        let mut table =
            TextTable::new(&["term", "weight", "before", "error", "after", "error", "rays"]);
        for Self { term, weight, before, after } in terms {
            let numbers = [*weight, before.value].map(|v| ShortNumber(v).to_string());
            let start = std::iter::once((*term).to_owned()).chain(numbers);
            let error = |value: &TermEstimate| format!("{:.1e}", value.error);
            let rest = [error(before), ShortNumber(after.value).to_string(), error(after)];
            table.row(start.chain(rest).chain([after.rays.to_string()]));
        }
        table
    }
}
