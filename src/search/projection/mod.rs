//! Paraxial projection (Teh, *Computational Lens Design*, section 4.5): after a mutation the
//! parameters of the rest of the lens move as little as possible so that it focuses as it did
//! before.
//!
//! The constraints are (4.22) in full: height and slope of the marginal ray at the image at every
//! zoom position; only the slope if the last gap is solved for focus. Parameters are measured in
//! steps of `0.3/f` for curvatures and `0.01 f` for distances, since otherwise only curvatures
//! would move; `f` is rounded to a power of two, so that the steps do not change with the lens.
//!
//! Two maps lead to such a lens, and each is the inverse of the other: one goes to the nearest
//! lens, along the normals of the constraint at its end; one goes along the normals of the
//! constraint at its start. That makes a mutation and its reverse a reversible pair. The change of
//! volume follows from (4.30), with its factors corrected.

mod density;
mod model;
#[cfg(test)]
mod tests;

use super::SearchRules;
use super::element::glass_gaps;
use crate::lens::{Lens, LensError, Parameter, Quantity};
use crate::math::format_short;
use crate::paraxial::free_parameters;
use crate::solve::{
    ConstrainedPoint, ConstraintError, ConstraintFunction as _, CoordinateBounds, nearest_point,
    point_along_normals,
};
pub(super) use model::scale;
use model::{MarginalRayModel, ProjectionCoordinate};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};

/// The outcome of a projection.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Projection {
    /// The number of Newton steps.
    pub steps: usize,
    /// The remaining error of the marginal ray at the image: of its height relative to that at the
    /// first surface, and of its slope relative to the original one.
    pub error: f64,
    /// The largest change of a curvature, in 1/mm.
    pub curvature: f64,
    /// The largest change of a distance, in mm.
    pub distance: f64,
}

impl Display for Projection {
    /// Writes the steps and the largest changes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, curvature, distance, .. } = self;
        let ending = if *steps == 1 { "" } else { "s" };
        write!(f, "projected in {steps} step{ending}: curvatures changed by at most ")?;
        let [curvature, distance] = [curvature, distance].map(|size| two_digits(*size));
        write!(f, "{curvature}/mm, gaps by at most {distance} mm")
    }
}

/// A number with two significant digits, without an exponent where it can be read without.
fn two_digits(value: f64) -> String {
    format_short(format!("{value:.1e}").parse().unwrap_or(value))
}

/// The reasons that a projection fails.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// The lens is afocal at this zoom position.
    #[error("the lens is afocal at zoom position {0}: it has no focal length to preserve")]
    Afocal(usize),
    /// The variable parameters cannot satisfy all constraints independently.
    #[error("the variable parameters cannot preserve focal length and focus independently")]
    Singular,
    /// Parameters would have to leave their bounds: how many have reached them, and of how many.
    #[error("parameters would have to leave their bounds ({0} of {1} have reached them)")]
    Bounds(usize, usize),
    /// No convergence within this number of steps.
    #[error("no convergence within {0} steps")]
    Steps(usize),
    /// The lens cannot be resolved.
    #[error(transparent)]
    Lens(#[from] LensError),
}

impl From<ConstraintError> for ProjectionError {
    fn from(error: ConstraintError) -> Self {
        match error {
            ConstraintError::Singular => Self::Singular,
            ConstraintError::Bounds { held, count } => Self::Bounds(held.len(), count),
            ConstraintError::Steps(steps) => Self::Steps(steps),
        }
    }
}

/// The map to a lens with the same focus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProjectionMap {
    /// To the nearest lens.
    Nearest,
    /// Along the constraint normals of the lens before the mutation.
    AlongNormals,
}

/// The origin of the parameters of a row.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct RowOrigin {
    /// The row of the lens before the mutation that its curvature comes from, and the sign; `None`
    /// for a curvature that the mutation has set.
    pub(super) curvature: Option<(usize, f64)>,
    /// The row that its gap comes from.
    pub(super) gap: Option<usize>,
}

/// A projected lens.
#[derive(Debug)]
pub(super) struct ProjectedLens {
    pub(super) lens: Lens,
    pub(super) report: Projection,
    /// The logarithm of the determinant of the map; `None` if the reverse does not lead back.
    pub(super) log_determinant: Option<f64>,
}

/// Moves the parameters of `mutated` that it shares with `before` until it focuses as `before`
/// does. The requested map is tried first; if bounds stop it, the parameters at their bounds are
/// fixed, the others move on, and the mutation is not reversible.
pub(super) fn project(
    before: &Lens,
    mutated: &Lens,
    origins: &[RowOrigin],
    rules: &SearchRules,
    map: ProjectionMap,
    reversible: bool,
) -> Result<ProjectedLens, ProjectionError> {
    let pair = ProjectionPair::new(before, mutated, origins, rules)?;
    let mapped = if map == ProjectionMap::AlongNormals && reversible {
        pair.along_normals().ok()
    } else {
        None
    };
    let solution = mapped.map_or_else(|| pair.nearest(map), Ok)?;
    let exact = reversible && solution.exact;
    let log_determinant = if exact { pair.log_determinant(map, &solution) } else { None };
    Ok(ProjectedLens {
        lens: pair.lens(mutated, &solution),
        report: pair.report(&solution),
        log_determinant,
    })
}

/// A lens before and after a mutation, as functions of their shared parameters, measured from their
/// values right after the mutation in their own steps.
struct ProjectionPair {
    coordinates: Vec<ProjectionCoordinate>,
    old: MarginalRayModel,
    new: MarginalRayModel,
    target: Vec<f64>,
    /// The ranges that the rules permit.
    limits: CoordinateBounds,
}

impl ProjectionPair {
    fn new(
        before: &Lens,
        mutated: &Lens,
        origins: &[RowOrigin],
        rules: &SearchRules,
    ) -> Result<Self, ProjectionError> {
        let scale = scale(before)?.log2().round().exp2();
        let coordinates = coordinates(before, mutated, origins, rules, scale);
        let old = MarginalRayModel::new(before, before, &coordinates, scale, |c| (c.old, c.sign))?;
        let new = MarginalRayModel::new(mutated, before, &coordinates, scale, |c| (c.new, 1.0))?;
        let target = old.values(&vec![0.0; coordinates.len()]);
        let limits = limits(mutated, &coordinates, rules);
        Ok(Self { coordinates, old, new, target, limits })
    }

    fn zero(&self) -> Vec<f64> {
        vec![0.0; self.coordinates.len()]
    }

    /// The nearest lens; not exact if another map was requested.
    fn nearest(&self, map: ProjectionMap) -> Result<ConstrainedPoint, ProjectionError> {
        let found = nearest_point(&self.new, &self.zero(), &self.target, &self.bounds())?;
        Ok(ConstrainedPoint { exact: found.exact && map == ProjectionMap::Nearest, ..found })
    }

    fn along_normals(&self) -> Result<ConstrainedPoint, ProjectionError> {
        let normals = self.old.jacobian(&self.zero());
        let bounds = self.bounds();
        Ok(point_along_normals(&self.new, &normals, &self.zero(), &self.target, &bounds)?)
    }

    /// The bounds; a parameter outside the rules may not move farther out.
    fn bounds(&self) -> CoordinateBounds {
        self.limits.widen_to_include(&self.zero())
    }

    /// True if the reverse leads back: from the end of the forward map, with the other map and the
    /// lenses exchanged.
    fn is_reversible(&self, map: ProjectionMap, there: &ConstrainedPoint) -> bool {
        let bounds = self.limits.widen_to_include(&there.at);
        let target = self.new.values(&there.at);
        let back = match map {
            ProjectionMap::AlongNormals => nearest_point(&self.old, &there.at, &target, &bounds),
            ProjectionMap::Nearest => {
                let normals = self.new.jacobian(&there.at);
                point_along_normals(&self.old, &normals, &there.at, &target, &bounds)
            }
        };
        back.is_ok_and(|back| back.exact && back.at.iter().all(|z| z.abs() < 1e-6))
    }

    fn log_determinant(&self, map: ProjectionMap, there: &ConstrainedPoint) -> Option<f64> {
        if !self.is_reversible(map, there) {
            return None;
        }
        let zero = self.zero();
        let (old, new) = (self.old.jacobian(&zero), self.new.jacobian(&there.at));
        match map {
            ProjectionMap::Nearest => {
                density::log_determinant(&old, &self.new, &there.at, &there.multipliers)
            }
            ProjectionMap::AlongNormals => {
                let multipliers = -&there.multipliers;
                density::log_determinant(&new, &self.old, &zero, &multipliers).map(|log| -log)
            }
        }
    }

    fn lens(&self, mutated: &Lens, solution: &ConstrainedPoint) -> Lens {
        let mut lens = mutated.clone();
        for (coordinate, z) in self.coordinates.iter().zip(&solution.at) {
            if *z != 0.0 {
                let value = coordinate.value + coordinate.step * z;
                lens.set(coordinate.new, clamp_to_variable(mutated, coordinate.new, value));
            }
        }
        // The pickups of a lens with a model can be resolved.
        if lens.pickups.is_empty() { lens } else { lens.with_pickups().unwrap_or(lens) }
    }

    fn report(&self, solution: &ConstrainedPoint) -> Projection {
        let (mut curvature, mut distance) = (0.0f64, 0.0f64);
        for (coordinate, z) in self.coordinates.iter().zip(&solution.at) {
            let of_kind = match coordinate.new.quantity {
                Quantity::Curvature => &mut curvature,
                _ => &mut distance,
            };
            *of_kind = of_kind.max((coordinate.step * z).abs());
        }
        Projection { steps: solution.steps, error: solution.error, curvature, distance }
    }
}

/// Clamps a value, which rounding may have moved out of the bounds of its variable.
fn clamp_to_variable(lens: &Lens, parameter: Parameter, value: f64) -> f64 {
    let Some(variable) = lens.variable(parameter) else { return value };
    let value = variable.min.map_or(value, |min| value.max(min));
    variable.max.map_or(value, |max| value.min(max))
}

/// The parameters that both lenses share and the rules permit to move.
fn coordinates(
    before: &Lens,
    mutated: &Lens,
    origins: &[RowOrigin],
    rules: &SearchRules,
    scale: f64,
) -> Vec<ProjectionCoordinate> {
    let known = free_parameters(before);
    let rows = mutated.surfaces.len();
    let mut found = Vec::new();
    for new in free_parameters(mutated) {
        let origin = origins[new.surface];
        let (from, step) = match new.quantity {
            Quantity::Curvature => (origin.curvature, 0.3 / scale),
            _ => (origin.gap.map(|row| (row, 1.0)), 0.01 * scale),
        };
        let Some((row, sign)) = from else { continue };
        let old = Parameter { surface: row, ..new };
        let value = mutated.get(new).unwrap_or(0.0);
        if known.contains(&old) && rules.may_change(new.surface, rows) {
            found.push(ProjectionCoordinate { old, new, sign, value, step });
        }
    }
    found
}

/// The ranges that the rules and the variables of the lens permit, in the steps of the parameters.
fn limits(
    lens: &Lens,
    coordinates: &[ProjectionCoordinate],
    rules: &SearchRules,
) -> CoordinateBounds {
    let glass = glass_gaps(lens);
    let range = |c: &ProjectionCoordinate| {
        let (mut low, mut high) = match c.new.quantity {
            Quantity::Curvature => curvature_range(lens, c.new.surface, rules),
            _ => distance_range(lens, c.new.surface, glass[c.new.surface + 1], rules),
        };
        if let Some(variable) = lens.variable(c.new) {
            low = variable.min.map_or(low, |min| low.max(min));
            high = variable.max.map_or(high, |max| high.min(max));
        }
        [(low - c.value) / c.step, (high - c.value) / c.step]
    };
    CoordinateBounds::new(coordinates.iter().map(range).collect())
}

fn curvature_range(lens: &Lens, surface: usize, rules: &SearchRules) -> (f64, f64) {
    let rim = lens.surfaces[surface].semi_diameter.unwrap_or(0.0);
    let most = if rim > 0.0 { rules.steepness / rim } else { f64::INFINITY };
    (-most, most)
}

fn distance_range(lens: &Lens, surface: usize, glass: bool, rules: &SearchRules) -> (f64, f64) {
    let last = surface + 1 == lens.surfaces.len();
    let (low, high) = match (last, glass) {
        (true, _) => (rules.back_focus.unwrap_or(0.0), f64::INFINITY),
        (false, true) => (rules.glass_center[0], rules.glass_center[1]),
        (false, false) => (rules.air_center[0], rules.air_center[1]),
    };
    if lens.light_direction(surface) < 0.0 { (-high, -low) } else { (low, high) }
}
