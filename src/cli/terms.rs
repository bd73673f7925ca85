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
}

impl TermEstimate {
    fn new(term: &TermValue) -> Self {
        Self { value: term.value, error: term.error, rays: term.rays }
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
