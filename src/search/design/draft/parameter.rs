//! The numbers of a draft that a descent changes.

use super::LensDraft;
use crate::lens::{ASPHERE_TERMS, Lens, Medium};
use crate::search::design::LensRequirements;
use crate::trace::SurfaceParameter;

/// The variables of a descent besides curvatures, gaps and the pupil.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::search::design) struct Freedom {
    /// True to vary the index and the Abbe number of glasses.
    pub(in crate::search::design) glasses: bool,
    /// The number of surfaces that may be aspheric.
    pub(in crate::search::design) aspheric_surfaces: usize,
    /// The number of even powers of an asphere from r⁴ on, at most [`USED_TERMS`].
    pub(in crate::search::design) terms: usize,
    /// True to move the pupil.
    pub(in crate::search::design) pupil: bool,
}

/// A number of a draft that a descent changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::search::design) enum DraftParameter {
    /// A number of a row.
    Surface(usize, SurfaceParameter),
    /// The Abbe number of the glass behind a row; its index is [`SurfaceParameter::Index`].
    Abbe(usize),
    /// The distance of the entrance pupil behind the first vertex.
    Pupil,
}

/// The even powers of an asphere that a design uses, r⁴ to r¹⁰.
pub(in crate::search::design) const USED_TERMS: usize = 4;
/// The largest curvature, times the focal length.
const STEEPEST: f64 = 6.0;
/// The ranges of the index and of the Abbe number of glasses.
const GLASS_RANGE: [[f64; 2]; 2] = [[1.44, 1.95], [20.0, 95.0]];

impl DraftParameter {
    /// The parameters of a draft.
    pub(super) fn all(draft: &LensDraft, freedom: Freedom) -> Vec<Self> {
        let mut all = Vec::new();
        let rows = &draft.lens.surfaces;
        let figured = figured_rows(&draft.lens, freedom.aspheric_surfaces);
        for (i, row) in rows.iter().enumerate() {
            let mut add = |parameter| all.push(Self::Surface(i, parameter));
            add(SurfaceParameter::Curvature);
            add(SurfaceParameter::Thickness);
            if figured.contains(&i) {
                add(SurfaceParameter::Conic);
                (0..freedom.terms).for_each(|term| add(SurfaceParameter::AsphereTerm(term)));
            }
            if freedom.glasses && matches!(row.medium, Medium::Model { .. }) {
                all.push(Self::Surface(i, SurfaceParameter::Index));
                all.push(Self::Abbe(i));
            }
        }
        if freedom.pupil {
            all.push(Self::Pupil);
        }
        all
    }

    /// The value in a draft.
    pub(super) fn get(self, draft: &LensDraft) -> f64 {
        let Self::Surface(row, parameter) = self else {
            return match self {
                Self::Abbe(row) => model(&draft.lens, row).1,
                _ => draft.pupil,
            };
        };
        let surface = &draft.lens.surfaces[row];
        match parameter {
            SurfaceParameter::Curvature => surface.curvature,
            SurfaceParameter::Thickness => surface.thickness,
            SurfaceParameter::Conic => surface.conic,
            SurfaceParameter::AsphereTerm(term) => {
                surface.asphere.get(term).copied().unwrap_or(0.0)
            }
            SurfaceParameter::Index => model(&draft.lens, row).0,
            SurfaceParameter::SemiDiameter
            | SurfaceParameter::GrinTerm(_)
            | SurfaceParameter::Freeform(_)
            | SurfaceParameter::Aperture(_) => 0.0,
        }
    }

    /// Changes the value in a draft.
    pub(super) fn set(self, draft: &mut LensDraft, value: f64) {
        let (row, parameter) = match self {
            Self::Pupil => {
                draft.pupil = value;
                return;
            }
            Self::Abbe(row) => {
                let (nd, _) = model(&draft.lens, row);
                draft.lens.surfaces[row].medium = Medium::Model { nd, vd: value };
                return;
            }
            Self::Surface(row, parameter) => (row, parameter),
        };
        let vd = model(&draft.lens, row).1;
        let surface = &mut draft.lens.surfaces[row];
        match parameter {
            SurfaceParameter::Curvature => surface.curvature = value,
            SurfaceParameter::Thickness => surface.thickness = value,
            SurfaceParameter::Conic => surface.conic = value,
            SurfaceParameter::AsphereTerm(term) => {
                surface.asphere.resize(surface.asphere.len().max(term + 1), 0.0);
                surface.asphere[term] = value;
            }
            SurfaceParameter::Index => surface.medium = Medium::Model { nd: value, vd },
            SurfaceParameter::SemiDiameter
            | SurfaceParameter::GrinTerm(_)
            | SurfaceParameter::Freeform(_)
            | SurfaceParameter::Aperture(_) => {}
        }
    }

    /// The range of the values.
    pub(super) fn range(self, draft: &LensDraft, asked: &LensRequirements) -> [f64; 2] {
        let rows = &draft.lens.surfaces;
        let [index, abbe] = asked.glasses.plastics.unwrap_or(GLASS_RANGE);
        match self {
            Self::Surface(_, SurfaceParameter::Curvature) => {
                [-STEEPEST / asked.focal_length, STEEPEST / asked.focal_length]
            }
            Self::Surface(row, SurfaceParameter::Thickness) => {
                let least = match rows[row].medium {
                    Medium::Air if row + 1 == rows.len() => 0.5 * asked.back_focus,
                    Medium::Air => asked.air_center,
                    _ => asked.glass_center,
                };
                [least, asked.track]
            }
            Self::Surface(_, SurfaceParameter::Index) => index,
            Self::Surface(_, SurfaceParameter::Conic) => [-30.0, 10.0],
            Self::Abbe(_) => abbe,
            Self::Surface(..) => [f64::NEG_INFINITY, f64::INFINITY],
            Self::Pupil => [-asked.track, 2.0 * asked.track],
        }
    }
}

/// The index and the Abbe number of the glass behind a row.
pub(super) fn model(lens: &Lens, row: usize) -> (f64, f64) {
    match lens.surfaces[row].medium {
        Medium::Model { nd, vd } => (nd, vd),
        _ => (1.0, 0.0),
    }
}

/// The rows that may be aspheric: those that are, then others in order.
fn figured_rows(lens: &Lens, count: usize) -> Vec<usize> {
    let is_figured = |i: &usize| {
        let row = &lens.surfaces[*i];
        row.conic != 0.0 || row.asphere.iter().take(ASPHERE_TERMS).any(|a| *a != 0.0)
    };
    let mut rows: Vec<usize> = (0..lens.surfaces.len()).filter(is_figured).collect();
    let plain: Vec<usize> = (0..lens.surfaces.len()).filter(|i| !is_figured(i)).collect();
    // A surface behind the middle bends the outer beams apart from the inner ones.
    let middle = lens.surfaces.len() / 2;
    let mut plain: Vec<usize> = plain;
    plain.sort_by_key(|i| i.abs_diff(middle + 1));
    rows.extend(plain);
    rows.truncate(count);
    rows
}
