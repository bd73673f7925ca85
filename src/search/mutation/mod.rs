//! Mutations: changes of the structure of a lens, one per file, and the list of them.
//!
//! A mutation draws a site uniformly and new parameters at random; then the rest of the lens is
//! projected so that it focuses as before, and finally the lens is repaired. If another mutation
//! leads back, the two are a reversible pair in the sense of Green ("Reversible jump Markov chain
//! Monte Carlo", Biometrika 82, 1995): the parameters of an element that is added or removed are
//! drawn or dropped, all others are mapped one to one, and semi-diameters are treated as dependent.

mod add;
mod bend;
mod distributions;
mod draft;
mod drop_layer;
mod exchange;
mod flip;
mod glue;
mod kind;
mod remove;
mod repair;
mod split;
mod stop;
mod weights;

pub use kind::MutationKind;
pub use weights::MutationWeights;

use super::projection::{ProjectionError, project, scale};
use super::{MutatedPoint, Projection, Random, SearchRules};
use crate::lens::Lens;
use draft::{MutationContext, MutationDraft, ReverseMove, SingletProposal, SpacingChoice};
use rand::RngExt as _;
use repair::repair;

/// A mutation that does not apply to a lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{kind}: {why}", kind = .kind.name())]
pub struct MutationError {
    /// The kind of mutation.
    pub kind: MutationKind,
    /// The reason.
    pub why: String,
}

impl MutationError {
    /// A mutation that does not apply, with the reason.
    pub fn new(kind: MutationKind, why: impl Into<String>) -> Self {
        Self { kind, why: why.into() }
    }
}

/// A lens after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct MutatedLens {
    /// The lens.
    pub lens: Lens,
    /// The kind of mutation.
    pub kind: MutationKind,
    /// The description of the mutation.
    pub what: String,
    /// The rows with new glass behind them.
    pub fresh: Vec<usize>,
    /// The projection to a paraxially equivalent lens; `None` if the rules do not ask for it.
    pub projection: Option<Projection>,
    /// The logarithm of the ratio of the proposal densities, reverse over forward, times the
    /// determinant of the map; `None` if the mutation is not reversible.
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

/// Makes a mutation of a kind drawn by the weights of the rules, at a uniformly random site.
///
/// # Errors
/// The kind that was drawn does not apply; an exact sampler counts this as a rejected move.
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

/// Makes a mutation of a kind at a uniformly random site.
///
/// # Errors
/// The mutation does not apply to this lens, or does not lead to a valid lens.
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

/// The implementation of a kind of mutation.
struct MutationOperator {
    kind: MutationKind,
    /// Counts the sites of a lens where it could be made.
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

/// All mutations, in the order of [`MutationKind::MUTATIONS`].
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

/// Half the track of a lens, the scale of an afocal one.
fn half_track(lens: &Lens) -> f64 {
    (0.5 * lens.total_track()).max(1.0)
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

/// The logarithm of the ratio of the proposal densities, reverse over forward, without the
/// projection.
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

/// The probability that the reverse mutation makes the same choice of spacing; `None` if it cannot.
fn choice_probability(room: SpacingChoice, lens: &Lens, rules: &SearchRules) -> Option<f64> {
    let keeps = add::keep_probability(lens, Some(room.gap), rules, room.length);
    let chance = if room.keeps_rest { keeps } else { 1.0 - keeps };
    (chance > 0.0).then_some(chance)
}
