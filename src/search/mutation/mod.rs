//! Changes of the structure of a lens, one file each, and the list of them.
//!
//! A mutation draws a place uniformly and new numbers at random, then the rest of the lens is
//! projected so that it focuses as before, and at last it is repaired. Where another mutation leads
//! back, the two are a reversible pair in the sense of Green ("Reversible jump Markov chain Monte
//! Carlo", Biometrika 82, 1995): the numbers of an element that comes or goes are drawn or
//! forgotten, all others are mapped one to one, and semi-diameters count as following from them.

mod add;
mod bend;
mod chance;
mod draft;
mod drop_layer;
mod exchange;
mod flip;
mod glue;
mod remove;
mod split;
mod stop;

use super::projection::{ProjectionError, project, scale};
use super::repair::repair;
use super::{MutatedPoint, Projection, Random, SearchRules};
use crate::lens::Lens;
use draft::{MutationContext, MutationDraft, ReverseMove, SingletProposal, SpacingChoice};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

/// A kind of mutation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MutationKind {
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

impl MutationKind {
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
pub struct MutationError {
    /// Which mutation.
    pub kind: MutationKind,
    /// Why not.
    pub why: String,
}

impl MutationError {
    /// A mutation that does not apply, and why.
    pub fn new(kind: MutationKind, why: impl Into<String>) -> Self {
        Self { kind, why: why.into() }
    }
}

/// A lens after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct MutatedLens {
    /// The lens.
    pub lens: Lens,
    /// What was done.
    pub kind: MutationKind,
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

impl From<MutatedLens> for MutatedPoint<Lens> {
    fn from(mutant: MutatedLens) -> Self {
        let MutatedLens { lens, kind, what, projection, log_ratio, .. } = mutant;
        let what = match projection {
            Some(projection) => format!("{what}; {projection}"),
            None => what,
        };
        Self { point: lens, kind, what, log_ratio }
    }
}

/// A mutation whose kind is drawn by its weight in the rules, at an element drawn uniformly.
///
/// # Errors
/// Why the kind that was drawn does not apply; a sampler that needs the densities right counts that
/// as a move that was rejected.
pub fn propose(
    lens: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutatedLens, MutationError> {
    let sum: f64 = MutationKind::MUTATIONS.iter().map(|kind| rules.weight(*kind).max(0.0)).sum();
    let mut left = random.random::<f64>() * sum;
    for kind in MutationKind::MUTATIONS {
        left -= rules.weight(kind).max(0.0);
        if left < 0.0 {
            return mutate(kind, lens, rules, random);
        }
    }
    Err(MutationError::new(MutationKind::MUTATIONS[0], "every kind of mutation has weight 0"))
}

/// A mutation of a kind at an element drawn uniformly.
///
/// # Errors
/// Why it does not apply to this lens, or led to what is none.
pub fn mutate(
    kind: MutationKind,
    lens: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutatedLens, MutationError> {
    let refuse = |why: String| MutationError { kind, why };
    let mutation = MUTATIONS.iter().find(|mutation| mutation.kind == kind);
    let Some(mutation) = mutation else { return Err(refuse("is no change of a lens".into())) };
    lens.check().map_err(|error| refuse(error.to_string()))?;
    let resolved = lens.with_pickups().map_err(|error| refuse(error.to_string()))?;
    let size = match scale(&resolved) {
        Ok(size) => size,
        Err(ProjectionError::Afocal(_)) if !rules.projection => half_track(&resolved),
        Err(why) => return Err(refuse(why.to_string())),
    };
    let scene = MutationContext::new(resolved, rules, size);
    let draft = (mutation.draw)(&scene, random).map_err(refuse)?;
    complete(&scene, kind, draft).map_err(refuse)
}

/// What a kind of mutation does.
struct MutationOperator {
    kind: MutationKind,
    /// In how many places of a lens it could be made.
    places: fn(&Lens, &SearchRules) -> Result<usize, String>,
    draw: fn(&MutationContext<'_>, &mut Random) -> Result<MutationDraft, String>,
}

macro_rules! mutations {
    ($($kind:ident: $module:ident,)*) => {
        [$(MutationOperator {
            kind: MutationKind::$kind,
            places: |lens, rules| $module::places(lens, rules).map(|places| places.len()),
            draw: $module::draw,
        },)*]
    };
}

/// Every mutation, in the order of [`MutationKind::MUTATIONS`].
const MUTATIONS: [MutationOperator; 9] = mutations! {
    AddSinglet: add,
    RemoveSinglet: remove,
    Glue: glue,
    Split: split,
    DropLayer: drop_layer,
    Bend: bend,
    Flip: flip,
    ExchangeGlass: exchange,
    MoveStop: stop,
};

/// Half the length of a lens: what stands in for the focal length of an afocal one.
fn half_track(lens: &Lens) -> f64 {
    let track: f64 = lens.surfaces.iter().map(|row| row.thickness.abs()).sum();
    (0.5 * track).max(1.0)
}

/// Projects and repairs a draft.
fn complete(
    scene: &MutationContext<'_>,
    kind: MutationKind,
    draft: MutationDraft,
) -> Result<MutatedLens, String> {
    let MutationDraft { lens, origins, what, fresh, rimless, map, places, back } = draft;
    let (mut lens, projection, stretch) = if scene.rules.projection {
        let found = project(&scene.lens, &lens, &origins, scene.rules, map, back.is_some());
        let found = found.map_err(|why| format!("{what}, but {why}"))?;
        (found.lens, Some(found.report), found.log_determinant)
    } else {
        (lens, None, Some(0.0))
    };
    repair(&scene.lens, &mut lens, &rimless, scene.rules)
        .map_err(|why| format!("{what}, but {why}"))?;
    let log_ratio = back.zip(stretch).and_then(|(back, stretch)| {
        log_ratio(scene.rules, &lens, kind, places, back).map(|log| log + stretch)
    });
    Ok(MutatedLens { lens, kind, what, fresh, projection, log_ratio })
}

/// The logarithm of the density of the way back over that of the way there, without the projection.
fn log_ratio(
    rules: &SearchRules,
    lens: &Lens,
    kind: MutationKind,
    places: usize,
    back: ReverseMove,
) -> Option<f64> {
    let mutation = MUTATIONS.iter().find(|mutation| mutation.kind == back.kind)?;
    let places_back = (mutation.places)(lens, rules).ok()?;
    let choice = match back.spacing {
        None => 1.0,
        Some(room) => choice_probability(room, lens, rules)?,
    };
    let drawn = match back.singlet {
        None => 0.0,
        Some(SingletProposal { singlet, neighbour, scale }) => {
            singlet.log_density(lens, neighbour, rules, scale)?
        }
    };
    let kinds = rules.weight(back.kind) / rules.weight(kind);
    let log = kinds.ln()
        + (places as f64 / places_back as f64).ln()
        + choice.ln()
        + drawn
        + back.log_density_ratio;
    log.is_finite().then_some(log)
}

/// How likely the way back would make the same choice of keeping the rest of the lens in its place;
/// none where it could not.
fn choice_probability(room: SpacingChoice, lens: &Lens, rules: &SearchRules) -> Option<f64> {
    let keeps = add::keep_probability(lens, Some(room.gap), rules, room.length);
    let chance = if room.keeps_rest { keeps } else { 1.0 - keeps };
    (chance > 0.0).then_some(chance)
}
