//! The kinds of mutation.

use serde::{Deserialize, Serialize};

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
    /// Draws a random lens.
    Global,
}

impl MutationKind {
    /// All kinds that change a lens, in display order.
    pub const MUTATIONS: [Self; 9] = [
        Self::AddSinglet,
        Self::RemoveSinglet,
        Self::Glue,
        Self::Split,
        Self::DropLayer,
        Self::Bend,
        Self::Flip,
        Self::ExchangeGlass,
        Self::MoveStop,
    ];

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
            Self::Global => "global draw",
        }
    }
}
