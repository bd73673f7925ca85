//! How often each kind of mutation is tried.

use super::MutationKind;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How often each kind of mutation is tried, relatively; a kind that is not listed has 1, and 0
/// forbids it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct MutationWeights(BTreeMap<MutationKind, f64>);

impl MutationWeights {
    /// The weight of a kind.
    pub fn of(&self, kind: MutationKind) -> f64 {
        self.0.get(&kind).copied().unwrap_or(1.0)
    }

    /// Gives a kind another weight; false, and nothing done, where it is negative or not finite.
    pub fn set(&mut self, kind: MutationKind, weight: f64) -> bool {
        let sound = weight >= 0.0 && weight.is_finite();
        if sound {
            self.0.insert(kind, weight);
        }
        sound
    }
}
