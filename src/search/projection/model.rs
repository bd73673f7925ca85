//! The marginal ray of a lens as a function of its parameters, by a y-nu trace: forwards for its
//! value, backwards for its derivatives by all parameters at once.
//!
//! Backwards, `∂/∂d = ȳ nu/n'` and `∂/∂c = −n̄u y (n' − n)`. Through a gradient the ray goes by the
//! matrix of its [`ParaxialGrin`], backwards by the transpose, and a longer gap lets both numbers grow as the
//! equations say: `∂/∂d = ȳ nu/n + n̄u (c/n) y` at its end, and `n̄u y c dn/dz` where a gradient along
//! the axis meets the next surface with another index.

use super::ProjectionError;
use crate::lens::{Lens, LensError, Object, Parameter, ParaxialGrin, Quantity, RotationalProfile};
use crate::math::Real;
use crate::paraxial::signed_indices;
use nalgebra::DMatrix;

/// A parameter that the lenses before and after a mutation share.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProjectionCoordinate {
    pub(super) old: Parameter,
    pub(super) new: Parameter,
    /// The sign of the new value relative to the old one: −1 for a reversed surface.
    pub(super) sign: f64,
    /// Its value right after the mutation.
    pub(super) value: f64,
    /// The step in which it is measured.
    pub(super) step: f64,
}

/// The effect of a coordinate on a curvature or a gap.
#[derive(Debug, Clone, Copy)]
enum CoordinateEffect {
    Curvature { row: usize, factor: f64 },
    Gap { zoom: usize, row: usize, factor: f64 },
}

/// A lens at one zoom position and the start of its marginal ray.
#[derive(Debug, Clone)]
struct ZoomModel {
    indices: Vec<f64>,
    gradients: Vec<Option<RotationalProfile<f64>>>,
    gaps: Vec<f64>,
    height: f64,
    slope: f64,
}

/// Height and slope of the marginal ray at the image, as functions of coordinates.
#[derive(Debug, Clone)]
pub(super) struct MarginalRayModel {
    positions: Vec<ZoomModel>,
    curvatures: Vec<f64>,
    effects: Vec<Vec<CoordinateEffect>>,
    /// True if the last gap is solved for focus, so that the height at the image is not a
    /// constraint.
    solved: bool,
    /// The factor on slopes.
    scale: f64,
}

/// The paraxial ray at each surface, with the image behind.
struct MarginalRayTrace<R> {
    heights: Vec<R>,
    /// Optical slopes behind each surface.
    slopes: Vec<R>,
    /// Optical slopes in front of the next surface, and the index there.
    ends: Vec<(R, R)>,
    /// The gradient-index medium of a gap, if it is filled with one.
    slabs: Vec<Option<ParaxialGrin<R>>>,
}

fn zoom_models(lens: &Lens, reference: &Lens) -> Result<Vec<ZoomModel>, LensError> {
    let um = lens.wavelengths[lens.primary()].um;
    let position = |zoom: usize| {
        let system = lens.resolve(zoom, um)?;
        let rows = lens.surfaces.len();
        let mut indices = signed_indices(&system);
        indices.truncate(rows + 1);
        let gaps = system.surfaces[..rows].iter().map(|surface| surface.thickness).collect();
        let gradients = (0..rows).map(|row| system.grin_profile(row)).collect();
        let (height, slope) = match (lens.object, reference.object) {
            (Object::Finite(here), Object::Finite(there)) => {
                (here / there.abs(), indices[0] / there.abs())
            }
            _ => (1.0, 0.0),
        };
        Ok(ZoomModel { indices, gradients, gaps, height, slope })
    };
    (0..lens.zoom_positions()).map(position).collect()
}

/// A length of the order of the focal length, the same for paraxially equivalent lenses: the focal
/// length, or for a finite object that of a thin lens of the same magnification; the minimum over
/// the zoom positions.
pub(in crate::search) fn scale(lens: &Lens) -> Result<f64, ProjectionError> {
    let model = MarginalRayModel::new(lens, lens, &[], 1.0, |c| (c.new, 1.0))?;
    let mut smallest = f64::INFINITY;
    for (zoom, position) in model.positions.iter().enumerate() {
        let ray = model.ray(zoom, &model.curvatures, &position.gaps);
        let slope = ray.slopes.last().map_or(0.0, |nu| nu.abs());
        let length = match lens.object {
            Object::Infinity => 1.0 / slope,
            Object::Finite(distance) => distance.abs() / (1.0 + slope * distance.abs()),
        };
        let track: f64 = position.gaps.iter().map(|gap| gap.abs()).sum();
        let power = slope * track.max(1e-3);
        if !(power > 1e-7 && length.is_finite() && length > 0.0) {
            return Err(ProjectionError::Afocal(zoom));
        }
        smallest = smallest.min(length);
    }
    Ok(smallest)
}

impl MarginalRayModel {
    /// A lens as a function of coordinates; `which` gives the parameter of a coordinate and its
    /// sign. The marginal ray starts from the object with the slope that reaches 1 mm at the first
    /// vertex of the `reference`.
    pub(super) fn new(
        lens: &Lens,
        reference: &Lens,
        coordinates: &[ProjectionCoordinate],
        scale: f64,
        which: impl Fn(&ProjectionCoordinate) -> (Parameter, f64),
    ) -> Result<Self, LensError> {
        let reach = |coordinate: &ProjectionCoordinate| {
            let (parameter, sign) = which(coordinate);
            effects_of(lens, parameter, sign * coordinate.step)
        };
        Ok(Self {
            positions: zoom_models(lens, reference)?,
            curvatures: lens.surfaces.iter().map(|row| row.curvature).collect(),
            effects: coordinates.iter().map(reach).collect(),
            solved: lens.image_solve.is_some(),
            scale,
        })
    }

    /// The number of constraints.
    pub(super) fn constraints(&self) -> usize {
        self.positions.len() * self.constraints_per_zoom()
    }

    fn constraints_per_zoom(&self) -> usize {
        if self.solved { 1 } else { 2 }
    }

    /// The constrained quantities: for every zoom position the slope, and the height unless it is
    /// solved.
    pub(super) fn values(&self, at: &[f64]) -> Vec<f64> {
        let (curvatures, gaps) = self.curvatures_and_gaps(at);
        let mut values = Vec::with_capacity(self.constraints());
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures, gaps);
            let rows = curvatures.len();
            values.push(ray.slopes[rows - 1] * self.scale);
            if !self.solved {
                values.push(ray.heights[rows]);
            }
        }
        values
    }

    /// The derivatives of the constrained quantities by the coordinates, a row for each quantity.
    pub(super) fn jacobian(&self, at: &[f64]) -> DMatrix<f64> {
        let (curvatures, gaps) = self.curvatures_and_gaps(at);
        let mut jacobian = DMatrix::zeros(self.constraints(), at.len());
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures, gaps);
            for constraint in 0..self.constraints_per_zoom() {
                let seed = if constraint == 0 { (0.0, self.scale) } else { (1.0, 0.0) };
                let (by_curvature, by_gap) = self.adjoint(zoom, &ray, &curvatures, gaps, seed);
                let row = zoom * self.constraints_per_zoom() + constraint;
                for (column, reaches) in self.effects.iter().enumerate() {
                    jacobian[(row, column)] = sum_effects(reaches, zoom, &by_curvature, &by_gap);
                }
            }
        }
        jacobian
    }

    /// The gradient of the sum of the constrained quantities times their multipliers, over any
    /// number type.
    pub(super) fn weighted_gradient<R: Real>(&self, at: &[R], multipliers: &[f64]) -> Vec<R> {
        let (curvatures, gaps) = self.curvatures_and_gaps(at);
        let mut gradient = vec![R::ZERO; at.len()];
        for (zoom, gaps) in gaps.iter().enumerate() {
            let ray = self.ray(zoom, &curvatures, gaps);
            let first = zoom * self.constraints_per_zoom();
            let slope = R::from_f64(multipliers[first] * self.scale);
            let height = if self.solved { 0.0 } else { multipliers[first + 1] };
            let seed = (R::from_f64(height), slope);
            let (by_curvature, by_gap) = self.adjoint(zoom, &ray, &curvatures, gaps, seed);
            for (sum, reaches) in gradient.iter_mut().zip(&self.effects) {
                *sum += sum_effects(reaches, zoom, &by_curvature, &by_gap);
            }
        }
        gradient
    }

    /// Curvatures, and gaps by zoom position.
    fn curvatures_and_gaps<R: Real>(&self, at: &[R]) -> (Vec<R>, Vec<Vec<R>>) {
        let lifted = |numbers: &[f64]| numbers.iter().map(|v| R::from_f64(*v)).collect::<Vec<R>>();
        let mut curvatures = lifted(&self.curvatures);
        let mut gaps: Vec<_> = self.positions.iter().map(|p| lifted(&p.gaps)).collect();
        for (reaches, z) in self.effects.iter().zip(at) {
            for reach in reaches {
                match *reach {
                    CoordinateEffect::Curvature { row, factor } => {
                        curvatures[row] += *z * R::from_f64(factor);
                    }
                    CoordinateEffect::Gap { zoom, row, factor } => {
                        gaps[zoom][row] += *z * R::from_f64(factor);
                    }
                }
            }
        }
        (curvatures, gaps)
    }

    fn ray<R: Real>(&self, zoom: usize, curvatures: &[R], gaps: &[R]) -> MarginalRayTrace<R> {
        let position = &self.positions[zoom];
        let (mut heights, mut slopes) =
            (Vec::with_capacity(gaps.len() + 1), Vec::with_capacity(gaps.len()));
        let (mut ends, mut slabs) = (Vec::with_capacity(gaps.len()), Vec::new());
        let (mut y, mut nu) = (R::from_f64(position.height), R::from_f64(position.slope));
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
        MarginalRayTrace { heights, slopes, ends, slabs }
    }

    /// The derivatives of `seed · (height, slope)` at the image by every curvature and gap.
    fn adjoint<R: Real>(
        &self,
        zoom: usize,
        ray: &MarginalRayTrace<R>,
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
}

impl ZoomModel {
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
    for reach in reaches {
        match *reach {
            CoordinateEffect::Curvature { row, factor } => {
                sum += by_curvature[row] * R::from_f64(factor);
            }
            CoordinateEffect::Gap { zoom, row, factor } if zoom == at_zoom => {
                sum += by_gap[row] * R::from_f64(factor);
            }
            CoordinateEffect::Gap { .. } => {}
        }
    }
    sum
}

/// The effects of a parameter: on itself and on the parameters that are picked up from it.
fn effects_of(lens: &Lens, parameter: Parameter, factor: f64) -> Vec<CoordinateEffect> {
    let moving =
        if lens.pickups.is_empty() { vec![(parameter, 1.0)] } else { lens.dependents(parameter) };
    let mut found = Vec::with_capacity(moving.len());
    for (moved, share) in moving {
        let (row, factor) = (moved.surface, factor * share);
        match moved.quantity {
            Quantity::Curvature => found.push(CoordinateEffect::Curvature { row, factor }),
            Quantity::ZoomThickness(zoom) => {
                found.push(CoordinateEffect::Gap { zoom, row, factor });
            }
            Quantity::Thickness => {
                let shared = |zoom: &usize| !has_own(lens, *zoom, row);
                let zooms = (0..lens.zoom_positions()).filter(shared);
                found.extend(zooms.map(|zoom| CoordinateEffect::Gap { zoom, row, factor }));
            }
            _ => {}
        }
    }
    found
}

fn has_own(lens: &Lens, zoom: usize, row: usize) -> bool {
    let position = lens.zoom.get(zoom);
    position.is_some_and(|p| p.thicknesses.iter().any(|gap| gap.surface == row))
}
