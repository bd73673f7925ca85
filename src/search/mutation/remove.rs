//! Removes a singlet: its glass becomes air, or the rest of the lens moves forward.

use super::distributions::{bernoulli, choose, usable_glasses};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::{has_pickup, has_solve, is_gap, is_plain, is_zoomed};
use super::record::StructureChange;
use super::refusal::Refusal;
use super::singlet::{Neighbour, SingletParameters, SingletProposal};
use super::spacing::{KEEP_PROBABILITY, SpacingChoice, has_choice};
use crate::lens::glass;
use crate::lens::{Lens, Medium, Object};
use crate::search::element::{Element, elements, piece_count};
use crate::search::{Random, SearchRules};

/// The singlets that may be removed.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<Element>, Refusal> {
    let least = rules.elements[0];
    if piece_count(lens) < least + 1 {
        return Err(Refusal::TooFewElements);
    }
    let found: Vec<_> = elements(lens).into_iter().filter(|e| may_go(lens, e, rules)).collect();
    if found.is_empty() {
        return Err(Refusal::NoSinglet);
    }
    Ok(found)
}

fn may_go(lens: &Lens, element: &Element, rules: &SearchRules) -> bool {
    let rows = lens.surfaces.len();
    let Element { first, last, .. } = *element;
    let around = first.saturating_sub(1)..=(last + 1).min(rows - 1);
    let free = around.clone().all(|row| rules.may_change(row, rows));
    let followed = (first..=last).any(|row| has_pickup(lens, row, |_| true))
        || first > 0 && has_pickup(lens, first - 1, is_gap);
    let stop = (first..=last).any(|row| lens.surfaces[row].stop);
    element.is_singlet() && rows > 2 && free && !followed && !stop
}

/// The way in which a singlet is removed.
#[derive(Debug, Clone, Copy)]
struct RemovalChoice {
    /// True to remove it with the air in front of it, false with the air behind it.
    front: bool,
    /// True if the rest of the lens keeps its place.
    keeps_rest: bool,
}

/// The logarithm of the probability of one way of removing the singlet at row `first`.
pub(super) fn log_chance(lens: &Lens, first: usize, keeps_rest: bool) -> f64 {
    let sides = sides(lens, first);
    let choice = match remaining_gap(lens, first) {
        Some(gap) if has_choice(lens, gap) => {
            if keeps_rest {
                KEEP_PROBABILITY
            } else {
                1.0 - KEEP_PROBABILITY
            }
        }
        _ => 1.0,
    };
    choice.ln() - (sides.len() as f64).ln()
}

/// The gap that remains when the singlet is removed; `None` for the first element.
fn remaining_gap(lens: &Lens, first: usize) -> Option<usize> {
    let last = first + 1;
    let behind = last + 1 == lens.surfaces.len();
    first.checked_sub(1).map(|before| if behind { last } else { before })
}

/// The sides from which air may be removed with it: true for the front.
fn sides(lens: &Lens, first: usize) -> Vec<bool> {
    let last = first + 1 + 1 == lens.surfaces.len();
    let mut found = Vec::with_capacity(2);
    if first > 0 {
        found.push(true);
    }
    if !last {
        found.push(false);
    }
    found
}

/// Removes a singlet.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let element = choose(&sites, random).copied().ok_or(Refusal::NoSinglet)?;
    let first = element.first;
    let front = choose(&sides(&context.lens, first), random).copied().ok_or(Refusal::NoSinglet)?;
    let choice =
        remaining_gap(&context.lens, first).is_some_and(|gap| has_choice(&context.lens, gap));
    let removal =
        RemovalChoice { front, keeps_rest: choice && bernoulli(KEEP_PROBABILITY, random) };
    let mut draft = context.start_draft(sites.len());
    remove_singlet(&mut draft, first, removal);
    draft.change = StructureChange::RemoveSinglet { first: first.into() };
    draft.reverse = reverse_move(context, &draft.lens, first, removal);
    Ok(draft)
}

fn remove_singlet(draft: &mut MutationDraft, first: usize, removal: RemovalChoice) {
    let last = first + 1;
    let length = draft.lens.surfaces[first].thickness * draft.lens.light_direction(first);
    if first == 0 {
        let removed_length = length + draft.lens.surfaces[last].thickness;
        if let Object::Finite(distance) = &mut draft.lens.object {
            *distance += removed_length;
        }
    } else {
        let gap = first - 1;
        let dropped = draft.lens.surfaces[if removal.front { gap } else { last }].thickness;
        let both = is_zoomed(&draft.lens, gap) && is_zoomed(&draft.lens, last);
        if removal.keeps_rest
            && (both || is_zoomed(&draft.lens, if removal.front { gap } else { last }))
        {
            // The removed gap has several lengths, which are added position by position.
            draft.add_gap(gap, last);
        } else {
            if removal.front {
                draft.move_gap(last, gap);
            }
            if removal.keeps_rest {
                draft.lengthen(gap, dropped * draft.lens.light_direction(gap));
            }
        }
        if removal.keeps_rest {
            draft.lengthen(gap, length);
        }
    }
    draft.remove(last);
    draft.remove(first);
    draft.inherit_variables(&[]);
}

/// The reverse: adding the same singlet at the same place.
fn reverse_move(
    context: &MutationContext<'_>,
    small: &Lens,
    first: usize,
    removal: RemovalChoice,
) -> Option<ReverseMove> {
    let (lens, rules, last) = (&context.lens, context.rules, first + 1);
    let glasses = usable_glasses(lens, rules);
    let Medium::Glass(name) = &lens.surfaces[first].medium else { return None };
    let known = glass::find(name)?;
    let made = glasses.iter().any(|glass| std::ptr::eq(*glass, known));
    let beside = if removal.front { first.checked_sub(1)? } else { last };
    let moves = [first, beside].iter().any(|row| is_zoomed(lens, *row)) || has_solve(lens, beside);
    let plain = is_plain(&lens.surfaces[first]) && is_plain(&lens.surfaces[last]);
    let finite = first == 0 && lens.object != Object::Infinity;
    if !made || moves || !plain || finite {
        return None;
    }
    let length = |row: usize| lens.surfaces[row].thickness * lens.light_direction(row);
    let singlet = SingletParameters {
        curvatures: [first, last].map(|row| lens.surfaces[row].curvature),
        thickness: length(first),
        air: length(beside),
    };
    let scale = context.scale_after(small)?;
    let gap = first.checked_sub(1).filter(|gap| has_choice(small, *gap));
    let log = -(glasses.len() as f64).ln() - log_chance(lens, first, removal.keeps_rest);
    let row = if removal.front { beside } else { first };
    let neighbour = Neighbour { row, behind: removal.front };
    let spacing = gap.map(|gap| SpacingChoice {
        gap,
        length: singlet.length(),
        keeps_rest: removal.keeps_rest,
    });
    let singlet = Some(SingletProposal { singlet, neighbour, scale });
    Some(ReverseMove { kind: MutationKind::AddSinglet, log_density_ratio: log, spacing, singlet })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Row, blank};

    /// A lens keeps a surface: its only singlet may go if something else stays.
    #[test]
    fn the_last_two_surfaces_stay() {
        let mut lens = blank();
        lens.surfaces[0].stop = false;
        let rules = SearchRules { elements: [0, 8], ..SearchRules::default() };
        assert!(matches!(sites(&lens, &rules), Err(Refusal::NoSinglet)));
        let stop = Row { thickness: 10.0, stop: true, ..Row::default() };
        lens.surfaces.insert(0, stop);
        assert_eq!(sites(&lens, &rules).unwrap().len(), 1);
    }
}
