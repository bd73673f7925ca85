//! Glass rows seen as elements: singlets, cemented groups, mirrors, and what stands between them.

use crate::lens::{Lens, Medium};

/// What an element is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// This many pieces of glass, cemented where there are several, with air on both sides.
    Glass(usize),
    /// Pieces of glass that touch the object or the image, like the oil of a microscope or the cover
    /// of a detector: mutations leave them alone.
    Open(usize),
    /// A mirror, with the glass that it is seen through: mutations leave it alone.
    Mirror(usize),
}

/// Surfaces with nothing but glass between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Element {
    /// What it is made of.
    pub kind: ElementKind,
    /// Its first surface, counted from 0.
    pub first: usize,
    /// Its last surface.
    pub last: usize,
}

impl Element {
    /// How many pieces of glass it has.
    pub fn pieces(&self) -> usize {
        match self.kind {
            ElementKind::Glass(pieces)
            | ElementKind::Open(pieces)
            | ElementKind::Mirror(pieces) => pieces,
        }
    }

    /// Whether it is a single piece of glass in air.
    pub fn is_singlet(&self) -> bool {
        self.kind == ElementKind::Glass(1)
    }

    /// Whether a surface belongs to it.
    pub fn contains(&self, surface: usize) -> bool {
        (self.first..=self.last).contains(&surface)
    }
}

/// Which gaps are glass, the space in front of the first surface first; behind a mirror stands what
/// stood before it. An index of less than 1.05 is a kind of air.
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

/// Whether light runs towards −z in the gap behind a surface.
pub(super) fn is_backwards(lens: &Lens, surface: usize) -> bool {
    let mirrors = lens.surfaces[..=surface].iter().filter(|row| row.medium == Medium::Mirror);
    mirrors.count() % 2 == 1
}

/// The elements of a lens in the order of its rows; a stop in air is none.
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

/// How many pieces of glass a lens has.
pub fn piece_count(lens: &Lens) -> usize {
    elements(lens).iter().map(Element::pieces).sum()
}

/// The pattern of glass and air: the pieces of each element, `stop` where it stands, `m` for a
/// mirror, as `1|2|stop|2|1`. Signs and sizes of curvatures do not count, nor does which glass it is.
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
