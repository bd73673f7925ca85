//! Changes of the structure of a lens, one file each, and the list of them.

use serde::{Deserialize, Serialize};

/// A kind of mutation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A new element in an air gap.
    AddSinglet,
    /// An element less.
    RemoveSinglet,
    /// Two neighbours become one cemented group.
    Glue,
    /// A cemented interface becomes an air gap.
    Split,
    /// A cemented group loses its outer layer.
    DropLayer,
    /// Both curvatures of an element change by as much.
    Bend,
    /// An element is turned around.
    Flip,
    /// An element is made of a neighbouring glass of the catalogue.
    ExchangeGlass,
    /// The stop goes to another gap.
    MoveStop,
    /// A lens drawn from anywhere.
    Global,
}

impl Kind {
    /// Every kind that changes a lens, in the order in which they are shown.
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

    /// What it is called in menus and reports.
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

/// Why a mutation does not apply to a lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{kind}: {why}", kind = .kind.name())]
pub struct Refusal {
    /// Which mutation.
    pub kind: Kind,
    /// Why not.
    pub why: String,
}
