//! Removes the first or last piece of a cemented group; air takes its place.

use super::distributions::choose;
use super::draft::{MutationContext, MutationDraft};
use super::queries::{has_pickup, has_solve, is_gap, is_of_medium};
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::Lens;
use crate::search::element::{Element, ElementKind, elements, piece_count};
use crate::search::{Random, SearchRules};

/// A cemented group and the end from which a piece is removed.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroupEnd {
    group: Element,
    front: bool,
}

impl GroupEnd {
    /// The surface that is removed.
    fn outer(self) -> usize {
        if self.front { self.group.first } else { self.group.last }
    }

    /// The row whose gap takes the place of the glass; `None` in front of the lens.
    fn gap(self) -> Option<usize> {
        if self.front { self.group.first.checked_sub(1) } else { Some(self.group.last) }
    }
}

/// The pieces that may be removed.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<GroupEnd>, Refusal> {
    let least = rules.elements[0];
    if piece_count(lens) < least + 1 {
        return Err(Refusal::TooFewElements);
    }
    let groups = elements(lens).into_iter().filter(|e| matches!(e.kind, ElementKind::Glass(2..)));
    let layers = groups.flat_map(|group| [true, false].map(|front| GroupEnd { group, front }));
    let found: Vec<_> = layers.filter(|layer| may_go(lens, *layer, rules)).collect();
    if found.is_empty() {
        return Err(Refusal::NoCementedGroup);
    }
    Ok(found)
}

fn may_go(lens: &Lens, layer: GroupEnd, rules: &SearchRules) -> bool {
    let rows = lens.surfaces.len();
    let Element { first, last, .. } = layer.group;
    let inner = if layer.front { first + 1 } else { last - 1 };
    let free = [layer.outer(), inner].iter().all(|row| rules.may_change(*row, rows));
    let near =
        layer.gap().is_none_or(|gap| rules.may_change(gap, rows) && !has_pickup(lens, gap, is_gap));
    let glass = if layer.front { first } else { last - 1 };
    let of_glass = |q| is_gap(q) || is_of_medium(q);
    let followed = has_pickup(lens, layer.outer(), |_| true) || has_pickup(lens, glass, of_glass);
    free && near && !followed
}

/// Removes a piece.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let layer = choose(&sites, random).copied().ok_or(Refusal::NoCementedGroup)?;
    let mut draft = context.start_draft(sites.len());
    let outer = layer.outer();
    draft.change =
        StructureChange::DropLayer { first: layer.group.first.into(), front: layer.front };
    let glass = if layer.front { outer } else { outer - 1 };
    let length = context.lens.surfaces[glass].thickness * context.lens.light_direction(glass);
    if let Some(gap) = layer.gap().filter(|gap| !has_solve(&context.lens, *gap)) {
        draft.lengthen(gap, length);
    }
    remove_piece(&mut draft, layer);
    Ok(draft)
}

fn remove_piece(draft: &mut MutationDraft, layer: GroupEnd) {
    let outer = layer.outer();
    let inner = if layer.front { outer + 1 } else { outer - 1 };
    let removed = draft.lens.surfaces[outer].clone();
    if !layer.front {
        draft.drop_parameters(inner, is_of_medium);
        draft.move_gap(outer, inner);
        draft.lens.surfaces[inner].medium = removed.medium;
    }
    if removed.stop {
        let rim = &mut draft.lens.surfaces[inner];
        (rim.stop, rim.semi_diameter) = (true, removed.semi_diameter);
    }
    draft.remove(outer);
    draft.inherit_variables(&[]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Medium, blank};

    /// Two pieces that are cemented: either may go if one is enough, none if there must be two.
    #[test]
    fn a_piece_may_go_while_the_least_number_remains() {
        let mut lens = blank();
        let mut second = lens.surfaces[0].clone();
        (second.stop, second.medium) = (false, Medium::Index(1.62));
        lens.surfaces.insert(1, second);
        let rules = |least: usize| SearchRules { elements: [least, 8], ..SearchRules::default() };
        assert_eq!(sites(&lens, &rules(1)).unwrap().len(), 2);
        assert!(matches!(sites(&lens, &rules(2)), Err(Refusal::TooFewElements)));
    }
}
