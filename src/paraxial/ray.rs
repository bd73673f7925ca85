//! Paraxial rays: refraction `n'u' = nu − y (n' − n) c` and transfer `y⁺ = y + t u'` (Welford 1986,
//! equations 3.11 and 3.12), or the matrix of a GRIN medium ([`ParaxialGrin`]), whose indices are those
//! on the axis at its two surfaces.

use crate::lens::{ParaxialGrin, System};
use crate::math::Real;

/// The heights of a paraxial ray at every surface, and its slopes behind every surface.
#[derive(Debug, Clone, PartialEq)]
pub struct ParaxialRay<R> {
    /// The slope in front of the first surface, `dy/dz`.
    pub start_slope: R,
    /// The distance from the axis at each surface, in mm.
    pub heights: Vec<R>,
    /// The slope `dy/dz` behind each surface.
    pub slopes: Vec<R>,
}

/// The index of every gap, starting with object space; negative behind an odd number of mirrors.
pub fn signed_indices<R: Real>(system: &System<R>) -> Vec<R> {
    let mut sense = R::ONE;
    let mut indices = Vec::with_capacity(system.surfaces.len() + 1);
    indices.push(system.index_before);
    for surface in &system.surfaces {
        if surface.mirror {
            sense = -sense;
        }
        indices.push(sense * surface.index);
    }
    indices
}

/// The first-order optics of the GRIN media in the gaps; empty for a lens without any.
pub(super) fn paraxial_grins<R: Real>(system: &System<R>) -> Vec<Option<ParaxialGrin<R>>> {
    if !system.has_grin() {
        return Vec::new();
    }
    let indices = signed_indices(system);
    let gaps = system.surfaces.iter().zip(&indices[1..]);
    gaps.map(|(surface, n)| {
        surface.grin_profile().map(|field| ParaxialGrin::directed(&field, surface.thickness, *n))
    })
    .collect()
}

/// The paraxial ray that meets the vertex plane of the first surface at `height` with `slope`.
pub fn paraxial_ray<R: Real>(system: &System<R>, height: R, slope: R) -> ParaxialRay<R> {
    let indices = signed_indices(system);
    let gaps = paraxial_grins(system);
    let mut before = indices[0];
    let count = system.surfaces.len();
    let (mut heights, mut slopes) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let (mut y, mut nu) = (height, indices[0] * slope);
    for (i, surface) in system.surfaces.iter().enumerate() {
        heights.push(y);
        nu -= y * (indices[i + 1] - before) * surface.curvature();
        if surface.ideal.is_some() {
            nu -= y * surface.added_power();
        }
        let u = nu / indices[i + 1];
        slopes.push(u);
        if let Some(Some(gap)) = gaps.get(i) {
            (y, nu) = gap.transfer(y, nu);
            before = gap.index_behind;
        } else {
            y += surface.thickness * u;
            before = indices[i + 1];
        }
    }
    ParaxialRay { start_slope: slope, heights, slopes }
}

impl<R: Real> ParaxialRay<R> {
    /// The slope in front of a surface.
    pub fn slope_before(&self, surface: usize) -> R {
        if surface == 0 { self.start_slope } else { self.slopes[surface - 1] }
    }

    /// The position at which the ray behind a surface crosses the axis, in mm from the vertex of that
    /// surface; `None` if the ray is parallel to the axis.
    pub fn crossing(&self, surface: usize) -> Option<R> {
        let (y, u) = (self.heights[surface], self.slopes[surface]);
        (u.value() != 0.0).then(|| -(y / u))
    }
}
