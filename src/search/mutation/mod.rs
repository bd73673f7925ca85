//! Mutations: changes of the structure of a lens, one per file, and the list of them.
//!
//! A mutation draws a site uniformly and new parameters at random; then the rest of the lens is
//! projected so that it focuses as before, and finally the lens is repaired. If another mutation
//! leads back, the two are a reversible pair in the sense of Green ("Reversible jump Markov chain
//! Monte Carlo", Biometrika 82, 1995): the parameters of an element that is added or removed are
//! drawn or dropped, all others are mapped one to one, and semi-diameters are treated as dependent.

mod add;
mod add_asphere;
mod bend;
mod distributions;
mod draft;
mod drop_layer;
mod exchange;
mod flip;
mod glue;
mod kind;
mod null_meniscus;
mod queries;
mod record;
mod refusal;
mod remove;
mod remove_asphere;
mod repair;
mod singlet;
mod spacing;
mod split;
mod stop;

pub(super) use add_asphere::{
    aspheric_rows, marked as with_aspheric_number, sites as asphere_sites,
};
pub use kind::{MutationKind, MutationWeights};
pub(super) use null_meniscus::NullMeniscus;
pub(super) use record::read_record;
pub use record::{MutationRecord, StructureChange};
pub(super) use refusal::read_counts;
pub use refusal::{MutationError, Refusal};

use super::projection::{ProjectionError, project, scale};
use super::{MutatedPoint, Projection, Random, SearchRules};
use crate::lens::Lens;
use draft::{MutationContext, MutationDraft, ReverseMove};
use rand::RngExt as _;
use repair::repair;
use singlet::SingletProposal;
use std::sync::Arc;

/// A lens after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct MutatedLens {
    /// The lens.
    pub lens: Lens,
    /// The kind of mutation.
    pub kind: MutationKind,
    /// The change.
    pub change: StructureChange,
    /// The rows with new glass behind them.
    pub new_glass: Vec<usize>,
    /// The projection to a paraxially equivalent lens; `None` if the rules do not ask for it.
    pub projection: Option<Projection>,
    /// The logarithm of the ratio of the proposal densities, reverse over forward, times the
    /// determinant of the map; `None` if the mutation is not reversible.
    pub log_ratio: Option<f64>,
}

impl From<MutatedLens> for MutatedPoint<Arc<Lens>> {
    fn from(mutant: MutatedLens) -> Self {
        let MutatedLens { lens, kind, change, projection, log_ratio, .. } = mutant;
        Self {
            point: Arc::new(lens),
            kind,
            record: MutationRecord { change, projection },
            log_ratio,
            gradients: 0,
        }
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
    mutate(draw_kind(&MutationKind::MUTATIONS, rules, random)?, lens, rules, random)
}

/// As [`propose`], for a search that takes the better lens and needs no way back: glasses are drawn
/// from the whole catalogue, and new singlets are thin menisci that change the rays as little as the
/// limits permit. No mutation is reversible.
///
/// # Errors
/// As those of [`propose`].
pub fn perturb(
    lens: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutatedLens, MutationError> {
    perturb_as(draw_kind(&MutationKind::MUTATIONS, rules, random)?, lens, rules, random)
}

/// As [`perturb`], by a mutation of this kind.
///
/// # Errors
/// As those of [`propose`].
pub(super) fn perturb_as(
    kind: MutationKind,
    lens: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutatedLens, MutationError> {
    let draw = match kind {
        MutationKind::AddSinglet => add::draw_meniscus,
        MutationKind::ExchangeGlass => exchange::draw_any,
        _ => operator(kind)?.draw,
    };
    let mutated = apply(kind, draw, lens, rules, random)?;
    Ok(MutatedLens { log_ratio: None, ..mutated })
}

/// Draws one of these kinds by the weights of the rules.
pub(super) fn draw_kind(
    kinds: &[MutationKind],
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutationKind, MutationError> {
    let weight = |kind: &MutationKind| rules.weight(*kind).max(0.0);
    let sum: f64 = kinds.iter().map(weight).sum();
    let mut left = random.random::<f64>() * sum;
    let drawn = kinds.iter().copied().find(|kind| {
        left -= weight(kind);
        left < 0.0
    });
    drawn.ok_or(MutationError::new(MutationKind::MUTATIONS[0], Refusal::AllExcluded))
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
    apply(kind, operator(kind)?.draw, lens, rules, random)
}

/// The implementation of a kind.
fn operator(kind: MutationKind) -> Result<&'static MutationOperator, MutationError> {
    let mutation = MUTATIONS.iter().find(|mutation| mutation.kind == kind);
    mutation.ok_or(MutationError::new(kind, Refusal::NotAMutation))
}

/// Draws a mutation of a lens and completes it.
fn apply(
    kind: MutationKind,
    draw: MutationDraw,
    lens: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Result<MutatedLens, MutationError> {
    let refuse = |refusal| MutationError { kind, refusal };
    let context = context_of(kind, lens, rules)?;
    let draft = draw(&context, random).map_err(refuse)?;
    complete(&context, kind, draft).map_err(refuse)
}

/// The input of a mutation of a lens.
fn context_of<'a>(
    kind: MutationKind,
    lens: &Lens,
    rules: &'a SearchRules,
) -> Result<MutationContext<'a>, MutationError> {
    let refuse = |refusal| MutationError { kind, refusal };
    lens.check().map_err(|error| refuse(error.into()))?;
    let resolved = lens.with_pickups().map_err(|error| refuse(error.into()))?;
    let size = match scale(&resolved) {
        Ok(size) => size,
        Err(ProjectionError::Afocal(_)) if !rules.projection => half_track(&resolved),
        Err(error) => return Err(refuse(Refusal::from(&error))),
    };
    Ok(MutationContext::new(resolved, rules, size))
}

/// The implementation of a kind of mutation.
struct MutationOperator {
    kind: MutationKind,
    /// Counts the sites of a lens where it could be made.
    count_sites: fn(&Lens, &SearchRules) -> Result<usize, Refusal>,
    draw: MutationDraw,
}

/// Draws a mutation.
type MutationDraw = fn(&MutationContext<'_>, &mut Random) -> Result<MutationDraft, Refusal>;

macro_rules! mutations {
    ($($kind:ident: $module:ident,)*) => {
        [$(MutationOperator {
            kind: MutationKind::$kind,
            count_sites: |lens, rules| $module::sites(lens, rules).map(|sites| sites.len()),
            draw: $module::draw,
        },)*]
    };
}

/// All mutations, in the order of [`MutationKind::MUTATIONS`].
const MUTATIONS: [MutationOperator; 11] = mutations! {
    AddSinglet: add,
    RemoveSinglet: remove,
    Glue: glue,
    Split: split,
    DropLayer: drop_layer,
    Bend: bend,
    Flip: flip,
    ExchangeGlass: exchange,
    MoveStop: stop,
    AddAsphere: add_asphere,
    RemoveAsphere: remove_asphere,
};

/// Half the track of a lens, the scale of an afocal one.
fn half_track(lens: &Lens) -> f64 {
    (0.5 * lens.total_track()).max(1.0)
}

/// Projects and repairs a draft.
fn complete(
    context: &MutationContext<'_>,
    kind: MutationKind,
    draft: MutationDraft,
) -> Result<MutatedLens, Refusal> {
    let MutationDraft { lens, origins, change, new_glass, rimless, map, sites, reverse } = draft;
    let (mut lens, projection, stretch) = if context.rules.projection {
        let found = project(&context.lens, &lens, &origins, context.rules, map, reverse.is_some());
        let found = found.map_err(|error| Refusal::from(&error))?;
        (found.lens, Some(found.report), found.log_determinant)
    } else {
        (lens, None, Some(0.0))
    };
    repair(&context.lens, &mut lens, &rimless, context.rules)?;
    let log_ratio = reverse.zip(stretch).and_then(|(reverse, stretch)| {
        log_ratio(context.rules, &lens, kind, sites, reverse).map(|log| log + stretch)
    });
    Ok(MutatedLens { lens, kind, change, new_glass, projection, log_ratio })
}

/// The logarithm of the ratio of the proposal densities, reverse over forward, without the
/// projection.
fn log_ratio(
    rules: &SearchRules,
    lens: &Lens,
    kind: MutationKind,
    sites: usize,
    reverse: ReverseMove,
) -> Option<f64> {
    let mutation = MUTATIONS.iter().find(|mutation| mutation.kind == reverse.kind)?;
    let reverse_sites = (mutation.count_sites)(lens, rules).ok()?;
    let choice = match reverse.spacing {
        None => 1.0,
        Some(spacing) => spacing.probability(lens, rules)?,
    };
    let drawn = match reverse.singlet {
        None => 0.0,
        Some(SingletProposal { singlet, neighbour, scale }) => {
            singlet.log_density(lens, neighbour, rules, scale)?
        }
    };
    let kinds = rules.weight(reverse.kind) / rules.weight(kind);
    let log = kinds.ln()
        + (sites as f64 / reverse_sites as f64).ln()
        + choice.ln()
        + drawn
        + reverse.log_density_ratio;
    log.is_finite().then_some(log)
}
