//! Elements of a lens: singlets, cemented groups and mirrors.

use crate::lens::{Lens, Medium};

/// The kind of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// A number of pieces of glass with air on both sides; cemented if more than one.
    Glass(usize),
    /// Pieces of glass in contact with the object or the image, like immersion oil or the cover
    /// glass of a detector; mutations leave them unchanged.
    Open(usize),
    /// A mirror, with the pieces of glass in contact with it; mutations leave it unchanged.
    Mirror(usize),
}

/// Consecutive surfaces with only glass between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Element {
    /// Its kind.
    pub kind: ElementKind,
    /// Its first surface, a row index from 0.
    pub first: usize,
    /// Its last surface.
    pub last: usize,
}

impl Element {
    /// The number of its pieces of glass.
    pub fn pieces(&self) -> usize {
        match self.kind {
            ElementKind::Glass(pieces)
            | ElementKind::Open(pieces)
            | ElementKind::Mirror(pieces) => pieces,
        }
    }

    /// True if it is a single piece of glass in air.
    pub fn is_singlet(&self) -> bool {
        self.kind == ElementKind::Glass(1)
    }
}

/// For each gap, beginning with the object space, true if it is filled with glass; a mirror keeps
/// the medium in front of it. An index below 1.05 counts as air.
pub(super) fn glass_gaps(lens: &Lens) -> Vec<bool> {
    let is_glass = |medium: &Medium, before: bool| match medium {
        Medium::Air => false,
        Medium::Mirror => before,
        Medium::Index(n) => *n >= 1.05,
        Medium::Glass(_) | Medium::Model { .. } | Medium::Grin(_) => true,
    };
    let mut gaps = vec![is_glass(&lens.object_medium, false)];
    for (i, row) in lens.surfaces.iter().enumerate() {
        gaps.push(is_glass(&row.medium, gaps[i]));
    }
    gaps
}

/// The elements of a lens in the order of its rows; a stop in air is not an element.
pub fn elements(lens: &Lens) -> Vec<Element> {
    let gaps = glass_gaps(lens);
    let rows = lens.surfaces.len();
    let mut found = Vec::new();
    let mut first = 0;
    for last in 0..rows {
        if gaps[last + 1] && last + 1 < rows {
            continue;
        }
        let pieces = gaps[first..=last + 1].iter().filter(|glass| **glass).count();
        let mirror = lens.surfaces[first..=last].iter().any(|row| row.medium == Medium::Mirror);
        let open = gaps[first] || gaps[last + 1];
        let make = match (mirror, open) {
            (true, _) => ElementKind::Mirror(pieces),
            (false, true) => ElementKind::Open(pieces),
            (false, false) => ElementKind::Glass(pieces),
        };
        if mirror || pieces > 0 {
            found.push(Element { kind: make, first, last });
        }
        first = last + 1;
    }
    found
}

/// The number of pieces of glass of a lens.
pub fn piece_count(lens: &Lens) -> usize {
    elements(lens).iter().map(Element::pieces).sum()
}

/// The topology, the pattern of glass and air: the number of pieces of each element, `stop` at its
/// position, `m` for a mirror, as in `1|2|stop|2|1`. Curvatures and the choice of glass do not
/// matter.
pub fn topology(lens: &Lens) -> String {
    let stop = lens.stop();
    let mut parts: Vec<String> = Vec::new();
    let mut passed = stop.is_none();
    for element in elements(lens) {
        let is_before = stop.is_some_and(|stop| stop < element.last || stop == element.first);
        if is_before && !passed {
            parts.push("stop".to_owned());
            passed = true;
        }
        parts.push(match element.kind {
            ElementKind::Glass(pieces) => pieces.to_string(),
            ElementKind::Open(pieces) => format!("o{pieces}"),
            ElementKind::Mirror(0) => "m".to_owned(),
            ElementKind::Mirror(pieces) => format!("m{pieces}"),
        });
    }
    if !passed {
        parts.push("stop".to_owned());
    }
    parts.join("|")
}
