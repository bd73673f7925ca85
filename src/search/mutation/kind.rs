//! The kinds of mutation and their relative frequencies.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A kind of mutation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MutationKind {
    /// Adds a singlet in an air gap.
    AddSinglet,
    /// Removes a singlet.
    RemoveSinglet,
    /// Cements two neighbouring elements.
    Glue,
    /// Splits a cemented interface into an air gap.
    Split,
    /// Removes an outer piece of a cemented group.
    DropLayer,
    /// Changes all curvatures of an element by the same amount.
    Bend,
    /// Reverses an element.
    Flip,
    /// Exchanges a glass for a similar one of the catalogue.
    ExchangeGlass,
    /// Moves the stop.
    MoveStop,
    /// Lets a surface become aspheric, or an aspheric one have a higher power.
    AddAsphere,
    /// Makes an aspheric surface spherical.
    RemoveAsphere,
    /// Displaces all variables at random: a perturbation of an iterated local search.
    Displacement,
    /// Draws a random lens.
    Global,
}

impl MutationKind {
    /// All kinds that change a lens, in display order.
    pub const MUTATIONS: [Self; 11] = [
        Self::AddSinglet,
        Self::RemoveSinglet,
        Self::Glue,
        Self::Split,
        Self::DropLayer,
        Self::Bend,
        Self::Flip,
        Self::ExchangeGlass,
        Self::MoveStop,
        Self::AddAsphere,
        Self::RemoveAsphere,
    ];

    /// All kinds by which an iterated local search perturbs a lens.
    pub const PERTURBATIONS: [Self; Self::MUTATIONS.len() + 1] = {
        let mut all = [Self::Displacement; Self::MUTATIONS.len() + 1];
        let (mutations, _) = all.split_at_mut(Self::MUTATIONS.len());
        mutations.copy_from_slice(&Self::MUTATIONS);
        all
    };

    /// True for the kinds that change which surfaces are aspheric.
    pub fn is_about_aspheres(self) -> bool {
        matches!(self, Self::AddAsphere | Self::RemoveAsphere)
    }

    /// The display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::AddSinglet => "add singlet",
            Self::RemoveSinglet => "remove singlet",
            Self::Glue => "glue",
            Self::Split => "split",
            Self::DropLayer => "drop layer",
            Self::Bend => "bend",
            Self::Flip => "flip",
            Self::ExchangeGlass => "exchange glass",
            Self::MoveStop => "move stop",
            Self::AddAsphere => "add asphere",
            Self::RemoveAsphere => "remove asphere",
            Self::Displacement => "displacement",
            Self::Global => "global draw",
        }
    }
}

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
