//! Paraxial projection (Teh, *Computational Lens Design*, section 4.5): after a mutation the numbers
//! of the rest of the lens move as little as possible so that it focuses as it did before.
//!
//! What is kept is (4.22) in full: height and slope of the marginal ray at the image, at every zoom
//! position; only the slope where the last gap is solved for the focus. Numbers are measured in steps
//! of `0.3/f` for curvatures and `0.01 f` for distances, else only curvatures would move; `f` is
//! rounded to a power of two, so that the steps do not change with the lens.
//!
//! Two maps lead to such a lens, and each is the inverse of the other: one goes to the nearest, along
//! the normals of the constraint where it arrives; one goes along the normals of the constraint of
//! the lens from which it starts. That is what makes a mutation and the one that undoes it a
//! reversible pair. By how much they stretch volumes follows from (4.30), with its factors put right.

#[cfg(test)]
mod checks;
mod density;
mod model;
mod solve;

use super::SearchRules;
use super::element::glass_gaps;
use crate::lens::{Lens, LensError, Parameter, ParameterKind, Quantity, add_variables};
pub(super) use model::scale;
use model::{MarginalRayModel, ProjectionCoordinate};
use serde::Serialize;
use solve::{CoordinateBounds, ProjectionSolution};
use std::fmt::{self, Display};

/// What a projection did.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Projection {
    /// How many Newton steps it took.
    pub steps: usize,
    /// By how much the marginal ray at the image still differs: its height relative to that at the
    /// first surface, its slope relative to what it was.
    pub error: f64,
    /// The largest change of a curvature, in 1/mm.
    pub curvature: f64,
    /// The largest change of a distance, in mm.
    pub distance: f64,
}

impl Display for Projection {
    /// What it took, in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, curvature, distance, .. } = self;
        let ending = if *steps == 1 { "" } else { "s" };
        write!(f, "kept in focus in {steps} step{ending}, ")?;
        write!(f, "curvatures by {curvature:.1e}/mm, gaps by {distance:.1e} mm at most")
    }
}

/// Why a lens cannot be made to focus as another one does.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// Nothing to keep.
    #[error("the lens is afocal at zoom position {0}: it has no focal length to keep")]
    Afocal(usize),
    /// No number that may move has an effect of its own on every kept one.
    #[error("the numbers that may move cannot keep focal length and focus apart")]
    Singular,
    /// Numbers would have to leave what is allowed.
    #[error("numbers would have to pass their bounds ({0} of {1} have reached them)")]
    Bounds(usize, usize),
    /// Not near enough after as many steps as there may be.
    #[error("it needs more than {0} steps")]
    Steps(usize),
    /// A lens that cannot be resolved.
    #[error(transparent)]
    Lens(#[from] LensError),
}

/// Which way leads to a lens with the same focus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProjectionMap {
    /// To the nearest one.
    Nearest,
    /// Along the normals of the lens before the mutation.
    AlongNormals,
}

/// Where the numbers of a row come from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct RowOrigin {
    /// The row of the lens before the mutation whose curvature it has, and the sign with which;
    /// none for one that the mutation made and that is kept.
    pub(super) curvature: Option<(usize, f64)>,
    /// The row whose gap it has.
    pub(super) gap: Option<usize>,
}

/// A projected lens.
#[derive(Debug)]
pub(super) struct ProjectedLens {
    pub(super) lens: Lens,
    pub(super) report: Projection,
    /// The logarithm of the determinant of the map; none where the way back does not lead back.
    pub(super) log_determinant: Option<f64>,
}

/// Moves the numbers of `mutated` that were in `before` until it focuses as `before` does. The map
/// that is asked for is tried first; where bounds stop it, the other numbers move on without those
/// at their bounds, and there is no way back.
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

/// A lens before and after a mutation, as functions of the numbers that both have, counted from
/// what they are right after the mutation and in their own steps.
struct ProjectionPair {
    coordinates: Vec<ProjectionCoordinate>,
    old: MarginalRayModel,
    new: MarginalRayModel,
    target: Vec<f64>,
    /// What the rules allow.
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

    /// The nearest lens; where another one was asked for, it is not exact.
    fn nearest(&self, map: ProjectionMap) -> Result<ProjectionSolution, ProjectionError> {
        let found = solve::nearest(&self.new, &self.zero(), &self.target, &self.bounds())?;
        Ok(ProjectionSolution { exact: found.exact && map == ProjectionMap::Nearest, ..found })
    }

    fn along_normals(&self) -> Result<ProjectionSolution, ProjectionError> {
        let normals = self.old.jacobian(&self.zero());
        solve::along_normals(&self.new, &normals, &self.zero(), &self.target, &self.bounds())
    }

    /// How far the numbers may move; one that is outside of the rules may not go farther.
    fn bounds(&self) -> CoordinateBounds {
        self.limits.widen_to_include(&self.zero())
    }

    /// The way back starts where the way there ended, with the other map and the lenses exchanged.
    fn is_reversible(&self, map: ProjectionMap, there: &ProjectionSolution) -> bool {
        let bounds = self.limits.widen_to_include(&there.at);
        let target = self.new.values(&there.at);
        let back = match map {
            ProjectionMap::AlongNormals => solve::nearest(&self.old, &there.at, &target, &bounds),
            ProjectionMap::Nearest => {
                let normals = self.new.jacobian(&there.at);
                solve::along_normals(&self.old, &normals, &there.at, &target, &bounds)
            }
        };
        back.is_ok_and(|back| back.exact && back.at.iter().all(|z| z.abs() < 1e-6))
    }

    fn log_determinant(&self, map: ProjectionMap, there: &ProjectionSolution) -> Option<f64> {
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

    fn lens(&self, mutated: &Lens, solution: &ProjectionSolution) -> Lens {
        let mut lens = mutated.clone();
        for (coordinate, z) in self.coordinates.iter().zip(&solution.at) {
            if *z != 0.0 {
                let value = coordinate.value + coordinate.step * z;
                lens.set(coordinate.new, clamp_to_variable(mutated, coordinate.new, value));
            }
        }
        // A lens that has a model has pickups that can be followed.
        if lens.pickups.is_empty() { lens } else { lens.with_pickups().unwrap_or(lens) }
    }

    fn report(&self, solution: &ProjectionSolution) -> Projection {
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

/// A value that rounding may have brought out of the bounds of its variable.
fn clamp_to_variable(lens: &Lens, parameter: Parameter, value: f64) -> f64 {
    let Some(variable) = lens.variable(parameter) else { return value };
    let value = variable.min.map_or(value, |min| value.max(min));
    variable.max.map_or(value, |max| value.min(max))
}

/// Every curvature and distance of a lens that does not follow another number.
fn free_parameters(lens: &Lens) -> Vec<Parameter> {
    let mut freed = lens.clone();
    freed.variables.clear();
    add_variables(&mut freed, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    freed.variables.iter().map(|variable| variable.parameter).collect()
}

/// The numbers that both lenses have and the rules allow to move.
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
        let old = Parameter::new(row, new.quantity);
        let value = mutated.get(new).unwrap_or(0.0);
        if known.contains(&old) && rules.may_change(new.surface, rows) {
            found.push(ProjectionCoordinate { old, new, sign, value, step });
        }
    }
    found
}

/// What the rules and the variables of the lens allow each number, in its own steps.
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
    if super::element::is_backwards(lens, surface) { (-high, -low) } else { (low, high) }
}
