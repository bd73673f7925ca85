//! Relative frequencies of the kinds of mutation.

use super::kind::MutationKind;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Relative frequencies of the kinds of mutation; a kind that is not listed has weight 1, and
/// weight 0 excludes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct MutationWeights(BTreeMap<MutationKind, f64>);

impl MutationWeights {
    /// The weight of a kind.
    pub fn of(&self, kind: MutationKind) -> f64 {
        self.0.get(&kind).copied().unwrap_or(1.0)
    }

    /// Sets the weight of a kind; returns false and changes nothing if it is negative or not
    /// finite.
    pub fn set(&mut self, kind: MutationKind, weight: f64) -> bool {
        let sound = weight >= 0.0 && weight.is_finite();
        if sound {
            self.0.insert(kind, weight);
        }
        sound
    }
}
