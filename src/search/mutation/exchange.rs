//! Exchanges a catalogue glass for one with a similar index and Abbe number.

use super::distributions::{choose, random_projection_map, usable_glasses};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::glass::{self, Glass};
use crate::lens::{Lens, Medium, Parameter, Quantity};
use crate::optimize::hold_powers;
use crate::paraxial::free_parameters;
use crate::search::element::{ElementKind, elements};
use crate::search::{Random, SearchRules};
use rand::RngExt as _;

/// The standard deviation of the change of index.
const INDEX_DEVIATION: f64 = 0.02;

/// The standard deviation of the change of the Abbe number.
const ABBE_DEVIATION: f64 = 3.0;

/// The rows with an exchangeable catalogue glass behind them.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, Refusal> {
    sites_of(lens, rules, |medium| matches!(medium, Medium::Glass(_)))
}

/// The rows with a medium behind them that `is_it` selects and that may be exchanged.
fn sites_of(
    lens: &Lens,
    rules: &SearchRules,
    is_it: fn(&Medium) -> bool,
) -> Result<Vec<usize>, Refusal> {
    let rows = lens.surfaces.len();
    let elements = elements(lens).into_iter().filter(|e| matches!(e.kind, ElementKind::Glass(_)));
    let free: Vec<usize> = elements
        .flat_map(|e| e.first..e.last)
        .filter(|row| rules.may_change(*row, rows) && rules.may_change(row + 1, rows))
        .collect();
    let of = |is_it: fn(&Medium) -> bool| {
        free.iter().copied().filter(move |row| is_it(&lens.surfaces[*row].medium))
    };
    let found: Vec<usize> = of(is_it).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let is_grin = of(|medium| matches!(medium, Medium::Grin(_))).next().is_some();
    Err(if is_grin { Refusal::OnlyGradients } else { Refusal::NoExchangeableGlass })
}

/// The relative probability of exchanging one glass for the other.
fn glass_similarity(a: &Glass, b: &Glass) -> f64 {
    let (index, abbe) = ((a.nd - b.nd) / INDEX_DEVIATION, (a.vd - b.vd) / ABBE_DEVIATION);
    (-0.5 * (index * index + abbe * abbe)).exp()
}

fn is_same(a: &Glass, b: &Glass) -> bool {
    std::ptr::eq(a, b)
}

/// Exchanges a glass.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let row = choose(&sites, random).copied().ok_or(Refusal::NoExchangeableGlass)?;
    let Medium::Glass(name) = &context.lens.surfaces[row].medium else {
        return Err(Refusal::NoExchangeableGlass);
    };
    let old = glass::find(name).ok_or(Refusal::NoExchangeableGlass)?;
    let all = usable_glasses(&context.lens, context.rules);
    let choice: Vec<_> =
        all.into_iter().filter(|glass| !is_cemented_to(&context.lens, row, glass)).collect();
    let weight =
        |from: &Glass, to: &Glass| if is_same(from, to) { 0.0 } else { glass_similarity(from, to) };
    let sum = |from: &Glass| choice.iter().map(|to| weight(from, to)).sum::<f64>();
    let mut left = random.random::<f64>() * sum(old);
    let chosen = choice.iter().find(|to| {
        left -= weight(old, to);
        left < 0.0
    });
    let new = *chosen.ok_or(Refusal::NoSimilarGlass)?;
    let mut draft = context.start_draft(sites.len());
    draft.lens.surfaces[row].medium = Medium::Glass(new.full_name());
    draft.new_glass = vec![row];
    draft.map = random_projection_map(random);
    let known = choice.iter().any(|glass| is_same(glass, old));
    // The similarity is symmetric, its normalization is not.
    let log = sum(old).ln() - sum(new).ln();
    draft.reverse = known.then_some(ReverseMove::new(MutationKind::ExchangeGlass, log));
    draft.change = StructureChange::ExchangeGlass {
        surface: row.into(),
        from: name.clone(),
        to: new.full_name(),
    };
    Ok(draft)
}

/// Exchanges a glass, or a model of one, for any other of the catalogue, twins counted once, while its
/// surfaces keep their powers; it has no reverse.
pub(super) fn draw_any(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let lens = &context.lens;
    let is_glass = |medium: &Medium| matches!(medium, Medium::Glass(_) | Medium::Model { .. });
    let sites = sites_of(lens, context.rules, is_glass)?;
    let row = choose(&sites, random).copied().ok_or(Refusal::NoExchangeableGlass)?;
    let (from, old) = match &lens.surfaces[row].medium {
        Medium::Glass(name) => (name.clone(), glass::find(name)),
        Medium::Model { nd, vd } => (format!("nd {nd}, vd {vd}"), None),
        _ => return Err(Refusal::NoExchangeableGlass),
    };
    let mut choice = glass::distinct(usable_glasses(lens, context.rules));
    let is_old = |glass: &Glass| old.is_some_and(|old| glass.is_twin_of(old));
    choice.retain(|glass| !is_old(glass) && !is_cemented_to(lens, row, glass));
    let new = choose(&choice, random).copied().ok_or(Refusal::NoOtherGlass)?;
    let mut draft = context.start_draft(sites.len());
    draft.lens.surfaces[row].medium = Medium::Glass(new.full_name());
    // A glass of the catalogue has no index that varies.
    draft.drop_parameters(row, |quantity| quantity == Quantity::Index);
    let free = free_parameters(lens);
    let range = |surface| bending_range(lens, context.rules, &free, surface);
    hold_powers(&mut draft.lens, lens, row, range).ok_or(Refusal::InvalidLens)?;
    draft.new_glass = vec![row];
    draft.change =
        StructureChange::ExchangeGlass { surface: row.into(), from, to: new.full_name() };
    Ok(draft)
}

/// The curvatures that a surface may have; `None` if it may not be bent.
fn bending_range(
    lens: &Lens,
    rules: &SearchRules,
    free: &[Parameter],
    surface: usize,
) -> Option<[f64; 2]> {
    let curvature = Parameter::new(surface, Quantity::Curvature);
    if !free.contains(&curvature) || !rules.may_change(surface, lens.surfaces.len()) {
        return None;
    }
    let variable = lens.variable(curvature);
    let low = variable.and_then(|variable| variable.min).unwrap_or(f64::NEG_INFINITY);
    let high = variable.and_then(|variable| variable.max).unwrap_or(f64::INFINITY);
    Some([low, high])
}

/// True if the same glass is cemented to this piece: the interface would have no effect.
fn is_cemented_to(lens: &Lens, row: usize, glass: &Glass) -> bool {
    let beside = [row.checked_sub(1), Some(row + 1)];
    beside.into_iter().flatten().any(|near| match &lens.surfaces[near].medium {
        Medium::Glass(name) => glass::find(name).is_some_and(|found| is_same(found, glass)),
        _ => false,
    })
}
