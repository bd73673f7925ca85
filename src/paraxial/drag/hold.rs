//! Holding what is locked by the least change of the free numbers.

use super::limit::parameter_range;
use super::lock::{LockConstraints, length_scale};
use super::{
    DragError, DragSettings, DragStop, FirstOrderLock, FreeNumbers, LEAST_CHANGE, MovedNumber,
};
use crate::lens::{Lens, Medium, Parameter, Quantity};
use crate::paraxial::free_parameters;
use crate::solve::{ConstraintError, ConstraintFunction, CoordinateBounds, nearest_point_from};
use nalgebra::{DMatrix, DVector};

/// A number that may change, measured from its value before in its own steps.
#[derive(Debug, Clone, Copy)]
struct FreeNumber {
    parameter: Parameter,
    value: f64,
    step: f64,
}

/// The locked quantities of a lens, and the numbers that hold them.
#[derive(Debug, Clone)]
pub(super) struct HeldLens {
    locks: Vec<FirstOrderLock>,
    free: Vec<FreeNumber>,
    /// The held quantities as functions of the value of the handle and the free numbers; `None` if
    /// nothing has to be held.
    constraints: Option<LockConstraints>,
    target: Vec<f64>,
    bounds: CoordinateBounds,
}

/// Constraints at one value of the handle, as functions of the free numbers.
struct AtHandle<'a> {
    constraints: &'a LockConstraints,
    handle: f64,
}

impl AtHandle<'_> {
    fn coordinates(&self, at: &[f64]) -> Vec<f64> {
        [self.handle].into_iter().chain(at.iter().copied()).collect()
    }
}

impl ConstraintFunction for AtHandle<'_> {
    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.constraints.values(&self.coordinates(at))
    }

    fn jacobian(&self, at: &[f64]) -> DMatrix<f64> {
        self.constraints.jacobian(&self.coordinates(at)).remove_column(0)
    }
}

impl HeldLens {
    pub(super) fn new(
        lens: &Lens,
        motion: &[(Parameter, f64)],
        settings: &DragSettings,
    ) -> Result<Self, DragError> {
        let moves =
            |(parameter, _): &(Parameter, f64)| parameter.quantity != Quantity::SemiDiameter;
        let locks = if motion.iter().any(moves) { settings.locks.clone() } else { Vec::new() };
        Self::locked(lens, motion, locks, settings.free)
    }

    /// A lens that is to have the locked quantities of another one.
    pub(super) fn like(
        before: &Lens,
        after: &Lens,
        settings: &DragSettings,
    ) -> Result<Self, DragError> {
        let mut held = Self::locked(after, &[], settings.locks.clone(), settings.free)?;
        if let (Some(constraints), [first, ..]) = (&mut held.constraints, &held.locks[..]) {
            let original = LockConstraints::new(before, &held.locks, &[]);
            let original = original.map_err(|why| DragError::Lock(*first, why))?;
            held.target = original.values(&[]);
            constraints.take_quantities_of(original);
        }
        Ok(held)
    }

    fn locked(
        lens: &Lens,
        motion: &[(Parameter, f64)],
        locks: Vec<FirstOrderLock>,
        which: FreeNumbers,
    ) -> Result<Self, DragError> {
        let free = match locks[..] {
            [] => Vec::new(),
            [first, ..] => {
                let scale = length_scale(lens).map_err(|why| DragError::Lock(first, why))?;
                free_numbers(lens, motion, which, scale)
            }
        };
        let mut coordinates = vec![motion.to_vec()];
        coordinates.extend(free.iter().map(|number| vec![(number.parameter, number.step)]));
        for lock in &locks {
            // Each by itself, so that the one that does not exist is named.
            LockConstraints::new(lens, &[*lock], &[]).map_err(|why| DragError::Lock(*lock, why))?;
        }
        let all = |why| DragError::Lock(locks[0], why);
        let constraints = match locks[..] {
            [] => None,
            _ => Some(LockConstraints::new(lens, &locks, &coordinates).map_err(all)?),
        };
        let start = vec![0.0; coordinates.len()];
        let target = constraints.as_ref().map_or_else(Vec::new, |held| held.values(&start));
        let range = |number: &FreeNumber| {
            let [low, high] = parameter_range(lens, number.parameter);
            [low.0, high.0].map(|end| (end - number.value) / number.step)
        };
        let bounds = CoordinateBounds::new(free.iter().map(range).collect());
        let bounds = bounds.widen_to_include(&start[1..]);
        Ok(Self { locks, free, constraints, target, bounds })
    }

    /// The coordinates of the free numbers in the lens before.
    pub(super) fn origin(&self) -> Vec<f64> {
        vec![0.0; self.free.len()]
    }

    /// The coordinates of the free numbers with the least change that hold what is locked while the
    /// handle is moved by `shift`.
    pub(super) fn solve(&self, shift: f64, guess: &[f64]) -> Result<Vec<f64>, DragStop> {
        let Some(constraints) = &self.constraints else { return Ok(self.origin()) };
        let function = AtHandle { constraints, handle: shift };
        let origin = self.origin();
        match nearest_point_from(&function, &origin, guess, &self.target, &self.bounds) {
            Ok(point) => Ok(point.at),
            Err(cause) => Err(self.stop(cause)),
        }
    }

    fn stop(&self, cause: ConstraintError) -> DragStop {
        let held = match &cause {
            ConstraintError::Bounds { held, .. } => {
                held.iter().map(|i| self.free[*i].parameter).collect()
            }
            _ => Vec::new(),
        };
        DragStop::Locks { locks: self.locks.clone(), cause, held }
    }

    /// Writes the free numbers into a lens.
    pub(super) fn write(&self, lens: &mut Lens, at: &[f64]) {
        for (number, z) in self.free.iter().zip(at).filter(|(_, z)| **z != 0.0) {
            let [low, high] = parameter_range(lens, number.parameter);
            // Rounding may have moved it out of its range.
            let value = (number.value + number.step * z).max(low.0.min(number.value));
            lens.set(number.parameter, value.min(high.0.max(number.value)));
        }
    }

    /// The free numbers that have changed, those that changed most first.
    pub(super) fn moved(&self, lens: &Lens, at: &[f64]) -> Vec<MovedNumber> {
        let mut changed: Vec<(f64, MovedNumber)> = self
            .free
            .iter()
            .zip(at)
            .filter(|(_, z)| z.abs() > LEAST_CHANGE)
            .map(|(FreeNumber { parameter, value, .. }, z)| {
                let after = lens.get(*parameter).unwrap_or(*value);
                (z.abs(), MovedNumber { parameter: *parameter, before: *value, after })
            })
            .collect();
        changed.sort_by(|a, b| b.0.total_cmp(&a.0));
        changed.into_iter().map(|(_, number)| number).collect()
    }

    /// The derivatives of the free numbers by the value of the handle: `−Jᵀ (J Jᵀ)⁻¹ a` with the
    /// derivatives `a` of the held quantities by that value. `None` if they cannot be held.
    pub(super) fn tangent(&self) -> Option<Vec<(Parameter, f64)>> {
        let Some(constraints) = &self.constraints else { return Some(Vec::new()) };
        let all = constraints.jacobian(&vec![0.0; self.free.len() + 1]);
        let by_handle = all.column(0).into_owned();
        let jacobian = all.remove_column(0);
        let normal = &jacobian * jacobian.transpose();
        let multipliers = normal.cholesky()?.solve(&by_handle);
        let change = -(jacobian.transpose() * multipliers);
        let numbers = self.free.iter().zip(change.iter());
        let slopes: Vec<_> = numbers.map(|(n, z)| (n.parameter, n.step * z)).collect();
        slopes.iter().all(|(_, slope)| slope.is_finite()).then_some(slopes)
    }
}

/// The derivatives of the locked quantities by all numbers of a lens.
pub(super) struct TangentSpace {
    /// Numbers with their steps, a column each; a number that is not free has the step 0.
    columns: Vec<(Parameter, f64)>,
    jacobian: DMatrix<f64>,
}

impl TangentSpace {
    /// `None` if nothing is locked, or what is locked does not exist.
    pub(super) fn new(lens: &Lens, settings: &DragSettings) -> Option<Self> {
        if settings.locks.is_empty() {
            return None;
        }
        let scale = length_scale(lens).ok()?;
        let free = free_numbers(lens, &[], settings.free, scale);
        let step = |parameter: &Parameter| {
            free.iter().find(|number| number.parameter == *parameter).map_or(0.0, |n| n.step)
        };
        let columns: Vec<_> = free_parameters(lens)
            .into_iter()
            .map(|parameter| (parameter, step(&parameter)))
            .collect();
        let coordinates: Vec<_> =
            columns.iter().map(|(parameter, _)| vec![(*parameter, 1.0)]).collect();
        let constraints = LockConstraints::new(lens, &settings.locks, &coordinates).ok()?;
        Some(Self { jacobian: constraints.jacobian(&vec![0.0; columns.len()]), columns })
    }

    /// The derivatives of the free numbers by the value of a handle; see [`HeldLens::tangent`].
    pub(super) fn held(&self, motion: &[(Parameter, f64)]) -> Option<Vec<(Parameter, f64)>> {
        let by_handle = |parameter: &Parameter| {
            motion.iter().find(|(moved, _)| moved == parameter).map(|(_, by)| *by)
        };
        let shift = self.columns.iter().map(|(parameter, _)| by_handle(parameter).unwrap_or(0.0));
        let missing = &self.jacobian * DVector::from_iterator(self.columns.len(), shift);
        if missing.iter().all(|value| *value == 0.0) {
            return Some(Vec::new());
        }
        let mut free = self.jacobian.clone();
        for (mut column, (parameter, step)) in free.column_iter_mut().zip(&self.columns) {
            column *= if by_handle(parameter).is_some() { 0.0 } else { *step };
        }
        let multipliers = (&free * free.transpose()).cholesky()?.solve(&missing);
        let change = -(free.transpose() * multipliers);
        let numbers = self.columns.iter().zip(change.iter()).filter(|(_, z)| **z != 0.0);
        let slopes: Vec<_> = numbers.map(|((p, step), z)| (*p, step * z)).collect();
        slopes.iter().all(|(_, slope)| slope.is_finite()).then_some(slopes)
    }
}

/// The numbers that may change, without those that the handle moves.
fn free_numbers(
    lens: &Lens,
    motion: &[(Parameter, f64)],
    which: FreeNumbers,
    scale: f64,
) -> Vec<FreeNumber> {
    let is_free = |parameter: &Parameter| {
        let is_moved = motion.iter().any(|(moved, _)| moved == parameter);
        let is_chosen = match which {
            FreeNumbers::All => !is_plate_face(lens, *parameter),
            FreeNumbers::Variables => lens.variable(*parameter).is_some(),
        };
        !is_moved && is_chosen
    };
    let number = |parameter: Parameter| {
        let is_curvature = parameter.quantity == Quantity::Curvature;
        let step = if is_curvature { 0.3 / scale } else { 0.01 * scale };
        FreeNumber { parameter, value: lens.get(parameter).unwrap_or(0.0), step }
    };
    free_parameters(lens).into_iter().filter(is_free).map(number).collect()
}

/// True for the curvature of a face of a plane-parallel plate, such as a window, which stays plane.
fn is_plate_face(lens: &Lens, parameter: Parameter) -> bool {
    let rows = &lens.surfaces;
    let is_plane = |i: usize| rows.get(i).is_some_and(|row| row.curvature == 0.0);
    let is_glass = |i: usize| !matches!(rows[i].medium, Medium::Air | Medium::Mirror);
    let i = parameter.surface;
    let in_front = i.checked_sub(1).is_some_and(|front| is_glass(front) && is_plane(front));
    let behind = is_glass(i) && is_plane(i + 1);
    parameter.quantity == Quantity::Curvature && is_plane(i) && (in_front || behind)
}
