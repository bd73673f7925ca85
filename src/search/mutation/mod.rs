//! Changes of the structure of a lens, one file each, and the list of them.

use super::{Mutated, Projection, Random, Rules};
use crate::lens::Lens;
use rand::RngExt as _;
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

impl Refusal {
    /// A mutation that does not apply, and why.
    pub fn new(kind: Kind, why: impl Into<String>) -> Self {
        Self { kind, why: why.into() }
    }
}

/// A lens after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct Mutant {
    /// The lens.
    pub lens: Lens,
    /// What was done.
    pub kind: Kind,
    /// What was done, where, in words.
    pub what: String,
    /// The rows behind which there is new glass.
    pub fresh: Vec<usize>,
    /// How the lens was made paraxially equivalent to the one before; none where the rules do not
    /// ask for it.
    pub projection: Option<Projection>,
    /// The logarithm of the density of proposing the way back over that of the way there, times the
    /// determinant of the map; none where there is no way back.
    pub log_ratio: Option<f64>,
}

impl From<Mutant> for Mutated<Lens> {
    fn from(mutant: Mutant) -> Self {
        let Mutant { lens, kind, what, log_ratio, .. } = mutant;
        Self { point: lens, kind, what, log_ratio }
    }
}

/// A mutation whose kind is drawn by its weight in the rules, at an element drawn uniformly.
///
/// # Errors
/// Why the kind that was drawn does not apply; a sampler that needs the densities right counts that
/// as a move that was rejected.
pub fn propose(lens: &Lens, rules: &Rules, random: &mut Random) -> Result<Mutant, Refusal> {
    let sum: f64 = Kind::MUTATIONS.iter().map(|kind| rules.weight(*kind).max(0.0)).sum();
    let mut left = random.random::<f64>() * sum;
    for kind in Kind::MUTATIONS {
        left -= rules.weight(kind).max(0.0);
        if left < 0.0 {
            return mutate(kind, lens, rules, random);
        }
    }
    Err(Refusal::new(Kind::MUTATIONS[0], "every kind of mutation has weight 0"))
}

/// A mutation of a kind at an element drawn uniformly.
///
/// # Errors
/// Why it does not apply to this lens, or led to what is none.
pub fn mutate(
    kind: Kind,
    lens: &Lens,
    rules: &Rules,
    random: &mut Random,
) -> Result<Mutant, Refusal> {
    let _ = (lens, rules, random);
    Err(Refusal::new(kind, "is not made yet"))
}
