//! Paraxial rays of a lens as functions of its parameters, by a y-nu trace: forwards for their
//! values, backwards for their derivatives by all parameters at once.
//!
//! Backwards, `∂/∂d = ȳ nu/n'` and `∂/∂c = −n̄u y (n' − n)`. Through a gradient the ray goes by the
//! matrix of its [`ParaxialGrin`], backwards by the transpose, and a longer gap lets both numbers grow as the
//! equations say: `∂/∂d = ȳ nu/n + n̄u (c/n) y` at its end, and `n̄u y c dn/dz` where a gradient along
//! the axis meets the next surface with another index.

use super::signed_indices;
use crate::lens::{
    Lens, LensError, Parameter, ParameterKind, ParaxialGrin, Quantity, RotationalProfile, Surface,
    add_variables,
};
use crate::math::Real;

/// The effect of a coordinate on a number at a zoom position.
#[derive(Debug, Clone, Copy)]
struct CoordinateEffect {
    on: AffectedNumber,
    zoom: usize,
    row: usize,
    factor: f64,
}

/// The kind of a number that a coordinate changes.
#[derive(Debug, Clone, Copy)]
enum AffectedNumber {
    Curvature,
    Gap,
}

/// The media and gaps of a lens at one zoom position.
#[derive(Debug, Clone)]
struct ParametricPosition {
    indices: Vec<f64>,
    gradients: Vec<Option<RotationalProfile<f64>>>,
    curvatures: Vec<f64>,
    gaps: Vec<f64>,
}

/// A lens at all its zoom positions as a function of coordinates, each of which moves some
/// curvatures and gaps.
#[derive(Debug, Clone)]
pub struct ParametricLens {
    positions: Vec<ParametricPosition>,
    effects: Vec<Vec<CoordinateEffect>>,
}

/// A paraxial ray at each surface, with the image behind.
#[derive(Debug, Clone)]
pub struct ParametricRay<R> {
    heights: Vec<R>,
    /// Optical slopes behind each surface.
    slopes: Vec<R>,
    /// Optical slopes in front of the next surface, and the index there.
    ends: Vec<(R, R)>,
    /// The gradient-index medium of a gap, if it is filled with one.
    slabs: Vec<Option<ParaxialGrin<R>>>,
}

impl<R: Real> ParametricRay<R> {
    /// The height at the image plane, in mm.
    pub fn image_height(&self) -> R {
        self.heights.last().copied().unwrap_or(R::ZERO)
    }

    /// The optical slope `n'u'` behind the last surface before the image.
    pub fn image_slope(&self) -> R {
        self.slopes.last().copied().unwrap_or(R::ZERO)
    }
}

impl ParametricLens {
    /// A lens as a function of coordinates, of which each is a list of parameters with their changes
    /// per unit of the coordinate. What is picked up from these parameters moves with them.
    ///
    /// # Errors
    /// A lens that cannot be resolved.
    pub fn new(lens: &Lens, coordinates: &[Vec<(Parameter, f64)>]) -> Result<Self, LensError> {
        let effects = |parts: &Vec<(Parameter, f64)>| {
            parts.iter().flat_map(|(parameter, by)| effects_of(lens, *parameter, *by)).collect()
        };
        Ok(Self { positions: positions(lens)?, effects: coordinates.iter().map(effects).collect() })
    }

    /// The number of zoom positions.
    pub fn zoom_positions(&self) -> usize {
        self.positions.len()
    }

    /// The index in front of the first surface at a zoom position.
    pub fn object_index(&self, zoom: usize) -> f64 {
        self.positions[zoom].indices[0]
    }

    /// The index behind the last surface at a zoom position, negative behind an odd number of
    /// mirrors.
    pub fn image_index(&self, zoom: usize) -> f64 {
        self.positions[zoom].indices.last().copied().unwrap_or(1.0)
    }

    /// Curvatures and gaps, both by zoom position.
    pub fn curvatures_and_gaps<R: Real>(&self, at: &[R]) -> (Vec<Vec<R>>, Vec<Vec<R>>) {
        let lifted = |numbers: &[f64]| numbers.iter().map(|v| R::from_f64(*v)).collect::<Vec<R>>();
        let mut curvatures: Vec<_> = self.positions.iter().map(|p| lifted(&p.curvatures)).collect();
        let mut gaps: Vec<_> = self.positions.iter().map(|p| lifted(&p.gaps)).collect();
        for (reaches, z) in self.effects.iter().zip(at) {
            for CoordinateEffect { on, zoom, row, factor } in reaches {
                let numbers = match on {
                    AffectedNumber::Curvature => &mut curvatures,
                    AffectedNumber::Gap => &mut gaps,
                };
                numbers[*zoom][*row] += *z * R::from_f64(*factor);
            }
        }
        (curvatures, gaps)
    }

    /// The ray with a height at the first vertex and an optical slope in front of it.
    pub fn ray<R: Real>(
        &self,
        zoom: usize,
        (height, slope): (R, R),
        curvatures: &[R],
        gaps: &[R],
    ) -> ParametricRay<R> {
        let position = &self.positions[zoom];
        let (mut heights, mut slopes) =
            (Vec::with_capacity(gaps.len() + 1), Vec::with_capacity(gaps.len()));
        let (mut ends, mut slabs) = (Vec::with_capacity(gaps.len()), Vec::new());
        let (mut y, mut nu) = (height, slope);
        let mut before = R::from_f64(position.indices[0]);
        for (i, (c, d)) in curvatures.iter().zip(gaps).enumerate() {
            heights.push(y);
            let behind = R::from_f64(position.indices[i + 1]);
            nu -= y * *c * (behind - before);
            slopes.push(nu);
            let slab = position.slab(i, *d);
            if let Some(slab) = &slab {
                (y, nu) = slab.transfer(y, nu);
                before = slab.index_behind;
            } else {
                y += *d * nu / behind;
                before = behind;
            }
            ends.push((nu, before));
            slabs.push(slab);
        }
        heights.push(y);
        ParametricRay { heights, slopes, ends, slabs }
    }

    /// The derivatives of `seed · (height, slope)` at the image by every curvature and gap.
    pub fn adjoint<R: Real>(
        &self,
        zoom: usize,
        ray: &ParametricRay<R>,
        curvatures: &[R],
        gaps: &[R],
        (mut height, mut slope): (R, R),
    ) -> (Vec<R>, Vec<R>) {
        let position = &self.positions[zoom];
        let mut by_curvature = vec![R::ZERO; gaps.len()];
        let mut by_gap = vec![R::ZERO; gaps.len()];
        // By the index in front of the surface behind the gap.
        let mut by_index = R::ZERO;
        for i in (0..gaps.len()).rev() {
            let behind = R::from_f64(position.indices[i + 1]);
            if let Some(slab) = &ray.slabs[i] {
                let (y, nu) = slab.thickness_derivative(ray.heights[i + 1], ray.ends[i].0);
                by_gap[i] = height * y + slope * nu + by_index * slab.index_slope;
                (height, slope) = slab.transfer_transposed(height, slope);
            } else {
                let reduced = height / behind;
                by_gap[i] = reduced * ray.slopes[i];
                slope += reduced * gaps[i];
            }
            let before = match i.checked_sub(1) {
                Some(gap) => ray.ends[gap].1,
                None => R::from_f64(position.indices[0]),
            };
            let bent = slope * (behind - before);
            by_curvature[i] = -(bent * ray.heights[i]);
            by_index = slope * ray.heights[i] * curvatures[i];
            height -= bent * curvatures[i];
        }
        (by_curvature, by_gap)
    }

    /// The derivatives by every coordinate at a zoom position, from those by curvatures and gaps.
    pub fn by_coordinates<R: Real>(
        &self,
        at_zoom: usize,
        by_curvature: &[R],
        by_gap: &[R],
    ) -> impl Iterator<Item = R> {
        self.effects.iter().map(move |effects| sum_effects(effects, at_zoom, by_curvature, by_gap))
    }
}

/// All curvatures and distances of a lens that are not picked up from another parameter.
pub fn free_parameters(lens: &Lens) -> Vec<Parameter> {
    let mut freed = lens.clone();
    freed.variables.clear();
    add_variables(&mut freed, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    freed.variables.iter().map(|variable| variable.parameter).collect()
}

fn positions(lens: &Lens) -> Result<Vec<ParametricPosition>, LensError> {
    let um = lens.wavelengths[lens.primary()].um;
    let rows = lens.surfaces.len();
    let position = |zoom: usize| {
        let system = lens.resolve(zoom, um)?;
        let mut indices = signed_indices(&system);
        indices.truncate(rows + 1);
        let surfaces = &system.surfaces[..rows];
        let curvatures = surfaces.iter().map(Surface::curvature).collect();
        let gaps = surfaces.iter().map(|surface| surface.thickness).collect();
        let gradients = (0..rows).map(|row| system.grin_profile(row)).collect();
        Ok(ParametricPosition { indices, gradients, curvatures, gaps })
    };
    (0..lens.zoom_positions()).map(position).collect()
}

impl ParametricPosition {
    /// The gradient-index medium in the gap behind a row, if there is one.
    fn slab<R: Real>(&self, row: usize, thickness: R) -> Option<ParaxialGrin<R>> {
        let RotationalProfile { base, coefficients: grade } = self.gradients[row]?;
        let field =
            RotationalProfile { base: R::from_f64(base), coefficients: grade.map(R::from_f64) };
        Some(ParaxialGrin::directed(&field, thickness, R::from_f64(self.indices[row + 1])))
    }
}

/// The derivative along one coordinate at a zoom position.
fn sum_effects<R: Real>(
    reaches: &[CoordinateEffect],
    at_zoom: usize,
    by_curvature: &[R],
    by_gap: &[R],
) -> R {
    let mut sum = R::ZERO;
    for CoordinateEffect { on, row, factor, .. } in reaches.iter().filter(|r| r.zoom == at_zoom) {
        let by_number = match on {
            AffectedNumber::Curvature => by_curvature,
            AffectedNumber::Gap => by_gap,
        };
        sum += by_number[*row] * R::from_f64(*factor);
    }
    sum
}

/// The effects of a parameter: on itself and on the parameters that are picked up from it.
fn effects_of(lens: &Lens, parameter: Parameter, factor: f64) -> Vec<CoordinateEffect> {
    let moving =
        if lens.pickups.is_empty() { vec![(parameter, 1.0)] } else { lens.dependents(parameter) };
    let mut found = Vec::with_capacity(moving.len());
    for (moved, share) in moving {
        let on = match moved.quantity {
            Quantity::Curvature => AffectedNumber::Curvature,
            Quantity::Thickness => AffectedNumber::Gap,
            _ => continue,
        };
        let Parameter { surface: row, quantity, zoom } = moved;
        let is_moved = |at: &usize| match zoom {
            Some(zoom) => *at == zoom,
            None => !lens.is_own_at(*at, row, quantity),
        };
        let zooms = (0..lens.zoom_positions()).filter(is_moved);
        let factor = factor * share;
        found.extend(zooms.map(|zoom| CoordinateEffect { on, zoom, row, factor }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Medium, Row, blank};

    #[test]
    fn the_indices_of_object_and_image_space_are_those_of_their_media() {
        let row = |medium| Row { thickness: 5.0, curvature: 0.01, medium, ..Row::default() };
        let surfaces = vec![row(Medium::Index(1.7)), row(Medium::Index(1.5))];
        let mut lens = Lens { surfaces, ..blank() };
        lens.object_medium = Medium::Index(1.33);
        lens.surfaces[0].stop = true;
        let parametric = ParametricLens::new(&lens, &[]).unwrap();
        assert_eq!([parametric.object_index(0), parametric.image_index(0)], [1.33, 1.5]);
    }
}
