//! First-order quantities that a drag holds, as functions of the numbers of a lens.

use crate::lens::{Lens, LensError, Object, Parameter, SurfaceNumber};
use crate::paraxial::{ParametricLens, ParametricRay};
use crate::solve::ConstraintFunction;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A first-order quantity that stays what it is while a lens is dragged, at every zoom position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstOrderLock {
    /// The focal length.
    FocalLength,
    /// The distance from the last vertex to the paraxial image.
    BackFocus,
    /// The distance of the image plane from the paraxial image.
    Focus,
    /// The length from the first vertex to the image plane.
    Track,
    /// The magnification of a finite object.
    Magnification,
}

impl FirstOrderLock {
    /// All locks.
    pub const ALL: [Self; 5] =
        [Self::FocalLength, Self::BackFocus, Self::Focus, Self::Track, Self::Magnification];
}

impl fmt::Display for FirstOrderLock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FocalLength => "focal length",
            Self::BackFocus => "back focus",
            Self::Focus => "focus",
            Self::Track => "track",
            Self::Magnification => "magnification",
        })
    }
}

/// The reason why a lens has no such quantity to hold.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LockError {
    /// The lens is afocal.
    #[error("the lens has no focal length{}", at_zoom_text(*.0))]
    Afocal(Option<usize>),
    /// The paraxial image is at infinity.
    #[error("the image is at infinity{}", at_zoom_text(*.0))]
    ImageAtInfinity(Option<usize>),
    /// The object is at infinity.
    #[error("the object is at infinity, so that there is no magnification")]
    ObjectAtInfinity,
    /// The lens cannot be resolved.
    #[error(transparent)]
    Lens(#[from] LensError),
}

fn at_zoom_text(zoom: Option<usize>) -> String {
    zoom.map_or_else(String::new, |zoom| format!(" at zoom position {}", SurfaceNumber::new(zoom)))
}

/// The power times the track below which a lens counts as afocal.
const AFOCAL: f64 = 1e-7;

/// A held quantity at one zoom position: a number of a paraxial ray, or a length.
#[derive(Debug, Clone, Copy)]
enum Constraint {
    /// The optical slope at the image of the ray that is parallel to the axis in front of the lens,
    /// which is the negative power.
    Power,
    /// The optical slope at the image of the ray from the axial object point.
    ObjectSlope,
    /// The height of that ray at this distance from the last vertex.
    HeightBehindVertex(f64),
    /// The height of that ray at this distance in front of the image plane.
    HeightBeforeImage(f64),
    /// The sum of the gaps along the light. With a solved last gap that is the distance of the
    /// paraxial image, plus this offset.
    Track {
        /// The displacement of the image plane from the paraxial image, if the last gap is solved.
        solved: Option<f64>,
    },
}

/// The held quantities of a lens as functions of coordinates.
#[derive(Debug, Clone)]
pub(super) struct LockConstraints {
    lens: ParametricLens,
    object: Object,
    /// A length of the order of the focal length.
    scale: f64,
    /// The direction of the light in each gap.
    directions: Vec<f64>,
    constraints: Vec<(usize, Constraint)>,
}

/// A length of the order of the focal length, at most ten times the length of the lens.
pub(super) fn length_scale(lens: &Lens) -> Result<f64, LockError> {
    let model = ParametricLens::new(lens, &[])?;
    let (curvatures, gaps) = model.curvatures_and_gaps::<f64>(&[]);
    let track = lens.total_track();
    let power = |(zoom, gaps): (usize, &Vec<f64>)| {
        model.ray(zoom, (1.0, 0.0), &curvatures[zoom], gaps).image_slope().abs()
    };
    let strongest = gaps.iter().enumerate().map(power).fold(0.0, f64::max);
    let size = if track > 0.0 { track } else { 1.0 };
    Ok((1.0 / strongest).min(10.0 * size))
}

impl LockConstraints {
    /// The quantities of `locks` as functions of coordinates, each a list of parameters with their
    /// changes.
    pub(super) fn new(
        lens: &Lens,
        locks: &[FirstOrderLock],
        coordinates: &[Vec<(Parameter, f64)>],
    ) -> Result<Self, LockError> {
        let mut held = Self {
            lens: ParametricLens::new(lens, coordinates)?,
            object: lens.object,
            scale: length_scale(lens)?,
            directions: (0..lens.surfaces.len()).map(|i| lens.light_direction(i)).collect(),
            constraints: Vec::new(),
        };
        let start = vec![0.0; coordinates.len()];
        for zoom in 0..lens.zoom_positions() {
            for lock in locks {
                if let Some(constraint) = held.constraint(lens, *lock, zoom, &start)? {
                    held.constraints.push((zoom, constraint));
                }
            }
        }
        Ok(held)
    }

    /// The constraint of a lock at a zoom position; `None` if the lens itself keeps it.
    fn constraint(
        &self,
        lens: &Lens,
        lock: FirstOrderLock,
        zoom: usize,
        start: &[f64],
    ) -> Result<Option<Constraint>, LockError> {
        let named = (lens.zoom_positions() > 1).then_some(zoom);
        let (curvatures, gaps) = self.lens.curvatures_and_gaps(start);
        let (curvatures, gaps) = (&curvatures[zoom], &gaps[zoom]);
        let track: f64 = gaps.iter().map(|gap| gap.abs()).sum();
        let ray = |start| self.lens.ray(zoom, start, curvatures, gaps);
        let weak = |slope: f64| !(slope.abs() * track.max(1e-3) > AFOCAL);
        let image = || {
            let ray = ray(self.object_ray(zoom));
            if weak(ray.image_slope()) {
                return Err(LockError::ImageAtInfinity(named));
            }
            Ok(-(ray.image_height() * self.lens.image_index(zoom) / ray.image_slope()))
        };
        let last = gaps.last().copied().unwrap_or(0.0);
        Ok(Some(match lock {
            FirstOrderLock::FocalLength if weak(ray((1.0, 0.0)).image_slope()) => {
                return Err(LockError::Afocal(named));
            }
            FirstOrderLock::FocalLength => Constraint::Power,
            FirstOrderLock::Magnification if lens.object == Object::Infinity => {
                return Err(LockError::ObjectAtInfinity);
            }
            FirstOrderLock::Magnification => {
                image()?;
                Constraint::ObjectSlope
            }
            FirstOrderLock::BackFocus => Constraint::HeightBehindVertex(last + image()?),
            FirstOrderLock::Focus if lens.image_solve.is_some() => return Ok(None),
            FirstOrderLock::Focus => Constraint::HeightBeforeImage(-image()?),
            FirstOrderLock::Track => {
                if lens.image_solve.is_some() {
                    image()?;
                }
                Constraint::Track { solved: lens.image_solve }
            }
        }))
    }

    /// Height and optical slope at the first vertex of the ray from the axial object point.
    fn object_ray(&self, zoom: usize) -> (f64, f64) {
        match self.object {
            Object::Infinity => (1.0, 0.0),
            Object::Finite(distance) => {
                (1f64.copysign(distance), self.lens.object_index(zoom) / distance.abs())
            }
        }
    }

    /// Holds the quantities of another lens, in the unit of that one.
    pub(super) fn take_quantities_of(&mut self, other: Self) {
        (self.constraints, self.scale) = (other.constraints, other.scale);
    }

    /// The number of held quantities.
    pub(super) fn count(&self) -> usize {
        self.constraints.len()
    }

    fn trace(
        &self,
        zoom: usize,
        constraint: Constraint,
        curvatures: &[f64],
        gaps: &[f64],
    ) -> ParametricRay<f64> {
        let start = match constraint {
            Constraint::Power => (1.0, 0.0),
            _ => self.object_ray(zoom),
        };
        self.lens.ray(zoom, start, curvatures, gaps)
    }

    /// The length along the light, without the last gap if that is solved, in mm.
    fn track(&self, gaps: &[f64]) -> f64 {
        gaps.iter().zip(&self.directions).map(|(gap, direction)| gap * direction).sum()
    }

    fn value(
        &self,
        (zoom, constraint): (usize, Constraint),
        (curvatures, gaps): &(Vec<Vec<f64>>, Vec<Vec<f64>>),
    ) -> f64 {
        let gaps = gaps_until(constraint, &gaps[zoom]);
        let ray = || self.trace(zoom, constraint, &curvatures[zoom], &gaps);
        match constraint {
            Constraint::Power | Constraint::ObjectSlope => ray().image_slope() * self.scale,
            Constraint::HeightBehindVertex(_) | Constraint::HeightBeforeImage(_) => {
                ray().image_height()
            }
            Constraint::Track { solved: None } => self.track(&gaps) / self.scale,
            Constraint::Track { solved: Some(offset) } => {
                let ray = ray();
                let image = -(ray.image_height() * self.lens.image_index(zoom) / ray.image_slope());
                let direction = self.directions.last().copied().unwrap_or(1.0);
                (self.track(&gaps) + direction * (image + offset)) / self.scale
            }
        }
    }

    /// The derivatives of a held quantity by every curvature and gap.
    fn derivatives(
        &self,
        (zoom, constraint): (usize, Constraint),
        (curvatures, gaps): &(Vec<Vec<f64>>, Vec<Vec<f64>>),
    ) -> (Vec<f64>, Vec<f64>) {
        let curvatures = &curvatures[zoom];
        let gaps = gaps_until(constraint, &gaps[zoom]);
        let along = || self.directions.iter().map(|direction| direction / self.scale);
        if let Constraint::Track { solved: None } = constraint {
            return (vec![0.0; gaps.len()], along().collect());
        }
        let ray = self.trace(zoom, constraint, curvatures, &gaps);
        let last = gaps.len() - 1;
        let seed = match constraint {
            Constraint::Power | Constraint::ObjectSlope => (0.0, self.scale),
            Constraint::HeightBehindVertex(_) | Constraint::HeightBeforeImage(_) => (1.0, 0.0),
            Constraint::Track { .. } => {
                let factor = self.directions[last] * self.lens.image_index(zoom) / self.scale;
                let slope = ray.image_slope();
                (-factor / slope, factor * ray.image_height() / (slope * slope))
            }
        };
        let (by_curvature, mut by_gap) = self.lens.adjoint(zoom, &ray, curvatures, &gaps, seed);
        match constraint {
            Constraint::HeightBehindVertex(_) => by_gap[last] = 0.0,
            Constraint::Track { .. } => {
                by_gap.iter_mut().zip(along()).for_each(|(by, along)| *by += along);
                by_gap[last] = 0.0;
            }
            _ => {}
        }
        (by_curvature, by_gap)
    }
}

impl ConstraintFunction for LockConstraints {
    fn values(&self, at: &[f64]) -> Vec<f64> {
        let numbers = self.lens.curvatures_and_gaps(at);
        self.constraints.iter().map(|constraint| self.value(*constraint, &numbers)).collect()
    }

    fn jacobian(&self, at: &[f64]) -> DMatrix<f64> {
        let numbers = self.lens.curvatures_and_gaps(at);
        let mut jacobian = DMatrix::zeros(self.count(), at.len());
        for (row, constraint) in self.constraints.iter().enumerate() {
            let (by_curvature, by_gap) = self.derivatives(*constraint, &numbers);
            let by = self.lens.by_coordinates(constraint.0, &by_curvature, &by_gap);
            by.enumerate().for_each(|(column, by)| jacobian[(row, column)] = by);
        }
        jacobian
    }
}

/// The gaps as a constraint sees them: the last one may end elsewhere than at the image.
fn gaps_until(constraint: Constraint, gaps: &[f64]) -> Vec<f64> {
    let mut gaps = gaps.to_vec();
    if let Some(last) = gaps.last_mut() {
        match constraint {
            Constraint::HeightBehindVertex(distance) => *last = distance,
            Constraint::HeightBeforeImage(distance) => *last -= distance,
            Constraint::Track { solved: Some(_) } => *last = 0.0,
            Constraint::Power | Constraint::ObjectSlope | Constraint::Track { solved: None } => {}
        }
    }
    gaps
}
