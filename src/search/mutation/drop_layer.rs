//! A cemented group loses its first or last piece; the air takes its place.

use super::chance::pick;
use super::draft::{Draft, Scene, hangs, is_gap, is_of_medium, is_solved, sense};
use crate::lens::Lens;
use crate::search::element::{Element, Make, elements, pieces};
use crate::search::{Random, Rules};

/// A group and whether its first or its last piece goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layer {
    group: Element,
    front: bool,
}

impl Layer {
    /// The surface that goes.
    fn outer(self) -> usize {
        if self.front { self.group.first } else { self.group.last }
    }

    /// The row whose gap takes the place of the glass; none in front of the lens.
    fn gap(self) -> Option<usize> {
        if self.front { self.group.first.checked_sub(1) } else { Some(self.group.last) }
    }
}

/// Which layers may go.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<Layer>, String> {
    let least = rules.elements[0];
    if pieces(lens) < least + 1 {
        return Err(format!("the lens has {} elements, the rules ask for {least}", pieces(lens)));
    }
    let groups = elements(lens).into_iter().filter(|e| matches!(e.make, Make::Glass(2..)));
    let layers = groups.flat_map(|group| [true, false].map(|front| Layer { group, front }));
    let found: Vec<_> = layers.filter(|layer| may_go(lens, *layer, rules)).collect();
    if found.is_empty() {
        return Err("no cemented group whose outer piece may go".to_owned());
    }
    Ok(found)
}

fn may_go(lens: &Lens, layer: Layer, rules: &Rules) -> bool {
    let rows = lens.surfaces.len();
    let Element { first, last, .. } = layer.group;
    let inner = if layer.front { first + 1 } else { last - 1 };
    let free = [layer.outer(), inner].iter().all(|row| rules.allow(*row, rows));
    let near = layer.gap().is_none_or(|gap| rules.allow(gap, rows) && !hangs(lens, gap, is_gap));
    let glass = if layer.front { first } else { last - 1 };
    let of_glass = |q| is_gap(q) || is_of_medium(q);
    let followed = hangs(lens, layer.outer(), |_| true) || hangs(lens, glass, of_glass);
    free && near && !followed
}

/// Drops a layer.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let layer = pick(&places, random).copied().ok_or("no place")?;
    let mut draft = scene.draft(places.len());
    let outer = layer.outer();
    let place = if layer.front { "front" } else { "rear" };
    draft.what = format!("dropped the {place} piece of the group at surface {}", layer.group.first);
    let glass = if layer.front { outer } else { outer - 1 };
    let length = scene.lens.surfaces[glass].thickness * sense(&scene.lens, glass);
    if let Some(gap) = layer.gap().filter(|gap| !is_solved(&scene.lens, *gap)) {
        draft.lengthen(gap, length);
    }
    strip(&mut draft, layer);
    Ok(draft)
}

fn strip(draft: &mut Draft, layer: Layer) {
    let outer = layer.outer();
    let inner = if layer.front { outer + 1 } else { outer - 1 };
    let gone = draft.lens.surfaces[outer].clone();
    if !layer.front {
        draft.forget(inner, is_of_medium);
        draft.move_gap(outer, inner);
        draft.lens.surfaces[inner].medium = gone.medium;
    }
    if gone.stop {
        let rim = &mut draft.lens.surfaces[inner];
        (rim.stop, rim.semi_diameter) = (true, gone.semi_diameter);
    }
    draft.remove(outer);
    draft.settle(&[]);
}
