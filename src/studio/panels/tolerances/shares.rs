//! The shares of errors in the growth of the spot, added up by element and by kind.

use std::collections::BTreeMap;

use egui::{Grid, RichText, Sense, Ui, vec2};

use super::text::{kind_name, place};
use crate::lens::{Lens, Perturbation, PerturbationKind, Tolerance};
use crate::session::AsBuiltLens;

/// The width and the height of the bar of a share.
const BAR: [f32; 2] = [60.0, 10.0];
/// The groups that are shown; the others are one.
const SHOWN: usize = 8;

/// Errors that belong together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ShareGroup {
    pub(super) name: String,
    /// Their shares at the fixed image plane and refocused.
    pub(super) shares: [f64; 2],
}

/// The part of a lens that an error belongs to: an element, a gap of air, a surface or a group.
pub(super) fn part_of(lens: &Lens, Perturbation { kind, first, last }: Perturbation) -> String {
    let element = lens.element_around(first);
    let holds = |end: usize| element.is_some_and(|(from, to)| (from..=to).contains(&end));
    // A gap behind the last surface of an element is air.
    let end = if kind.is_of_gap() { first + 1 } else { last };
    match element {
        Some(element) if holds(end) => format!("Element {}", place(element)),
        _ if kind.is_of_gap() => format!("Gap behind {}", place((first, first))),
        _ if first == last => format!("Surface {}", place((first, last))),
        _ => format!("Group {}", place((first, last))),
    }
}

/// The shares of errors by a name, the largest refocused one first.
fn groups(made: &AsBuiltLens, name: impl Fn(&Tolerance) -> String) -> Vec<ShareGroup> {
    let mut found: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for (own, shares) in made.sheet.errors.iter().zip(&made.shares) {
        let sum = found.entry(name(own)).or_default();
        sum.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share);
    }
    let mut groups: Vec<ShareGroup> =
        found.into_iter().map(|(name, shares)| ShareGroup { name, shares }).collect();
    groups.sort_by(|a, b| b.shares[1].total_cmp(&a.shares[1]));
    if groups.len() > SHOWN + 1 {
        let rest = groups.split_off(SHOWN);
        let sum = |i: usize| rest.iter().map(|group| group.shares[i]).sum::<f64>();
        let name = format!("{} more", rest.len());
        groups.push(ShareGroup { name, shares: [sum(0), sum(1)] });
    }
    groups
}

/// The shares by element, gap and group.
pub(super) fn by_element(made: &AsBuiltLens, lens: &Lens) -> Vec<ShareGroup> {
    groups(made, |own| part_of(lens, own.error))
}

/// The shares by kind, both directions together.
pub(super) fn by_kind(made: &AsBuiltLens) -> Vec<ShareGroup> {
    let kind = |own: &Tolerance| -> PerturbationKind { own.error.kind };
    groups(made, |own| kind_name(kind(own)).to_owned())
}

/// Shows both as bars.
pub(super) fn show(ui: &mut Ui, made: &AsBuiltLens, lens: &Lens) {
    for (title, groups) in [("By element", by_element(made, lens)), ("By kind", by_kind(made))] {
        Grid::new(title).num_columns(3).striped(true).show(ui, |ui| {
            ui.weak(title);
            ui.weak("Fixed");
            ui.weak("Refocused");
            ui.end_row();
            for group in groups {
                ui.label(RichText::new(&group.name).small());
                for share in group.shares {
                    share_bar(ui, share);
                }
                ui.end_row();
            }
        });
        ui.add_space(4.0);
    }
}

pub(super) fn share_bar(ui: &mut Ui, share: f64) {
    ui.horizontal(|ui| {
        let (place, _) = ui.allocate_exact_size(vec2(BAR[0], BAR[1]), Sense::hover());
        let mut bar = place;
        bar.set_width(BAR[0] * share.clamp(0.0, 1.0) as f32);
        ui.painter().rect_filled(place, 2.0, ui.visuals().extreme_bg_color);
        ui.painter().rect_filled(bar, 2.0, ui.visuals().selection.bg_fill);
        ui.label(RichText::new(format!("{:.1} %", 100.0 * share)).small());
    });
}
