//! Exchanges a catalogue glass for one with a similar index and Abbe number.

use super::bend::random_projection_map;
use super::distributions::{choose, usable_glasses};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use crate::lens::glass::{self, Glass};
use crate::lens::{Lens, Medium};
use crate::search::element::{ElementKind, elements};
use crate::search::{Random, SearchRules};
use rand::RngExt as _;

/// The standard deviation of the change of index.
const INDEX_DEVIATION: f64 = 0.02;

/// The standard deviation of the change of the Abbe number.
const ABBE_DEVIATION: f64 = 3.0;

/// The rows with an exchangeable catalogue glass behind them.
pub(super) fn places(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, String> {
    let rows = lens.surfaces.len();
    let elements = elements(lens).into_iter().filter(|e| matches!(e.kind, ElementKind::Glass(_)));
    let free: Vec<usize> = elements
        .flat_map(|e| e.first..e.last)
        .filter(|row| rules.may_change(*row, rows) && rules.may_change(row + 1, rows))
        .collect();
    let of = |is_it: fn(&Medium) -> bool| {
        free.iter().copied().filter(move |row| is_it(&lens.surfaces[*row].medium))
    };
    let found: Vec<usize> = of(|medium| matches!(medium, Medium::Glass(_))).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let none = "no glass of the catalogue that may be exchanged";
    let graded = of(|medium| matches!(medium, Medium::Grin(_))).next();
    Err(graded.map_or(none.to_owned(), |row| {
        format!(
            "{none}: the medium behind surface {row} is a gradient, which has no neighbour there"
        )
    }))
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
    scene: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let row = choose(&places, random).copied().ok_or("no place")?;
    let Medium::Glass(name) = &scene.lens.surfaces[row].medium else {
        return Err("no glass of the catalogue".to_owned());
    };
    let old = glass::find(name).ok_or("an unknown glass")?;
    let all = usable_glasses(&scene.lens, scene.rules);
    let choice: Vec<_> =
        all.into_iter().filter(|glass| !is_cemented_to(&scene.lens, row, glass)).collect();
    let weight =
        |from: &Glass, to: &Glass| if is_same(from, to) { 0.0 } else { glass_similarity(from, to) };
    let sum = |from: &Glass| choice.iter().map(|to| weight(from, to)).sum::<f64>();
    let mut left = random.random::<f64>() * sum(old);
    let chosen = choice.iter().find(|to| {
        left -= weight(old, to);
        left < 0.0
    });
    let new = *chosen.ok_or_else(|| format!("no other glass of the rules is near {name}"))?;
    let mut draft = scene.start_draft(places.len());
    draft.lens.surfaces[row].medium = Medium::Glass(new.full_name());
    draft.fresh = vec![row];
    draft.map = random_projection_map(random);
    let known = choice.iter().any(|glass| is_same(glass, old));
    // The similarity is symmetric, its normalization is not.
    let log = sum(old).ln() - sum(new).ln();
    draft.back = known.then_some(ReverseMove::new(MutationKind::ExchangeGlass, log));
    draft.what = format!("exchanged {name} behind surface {row} for {}", new.full_name());
    Ok(draft)
}

/// True if the same glass is cemented to this piece: the interface would have no effect.
fn is_cemented_to(lens: &Lens, row: usize, glass: &Glass) -> bool {
    let beside = [row.checked_sub(1), Some(row + 1)];
    beside.into_iter().flatten().any(|near| match &lens.surfaces[near].medium {
        Medium::Glass(name) => glass::find(name).is_some_and(|found| is_same(found, glass)),
        _ => false,
    })
}
