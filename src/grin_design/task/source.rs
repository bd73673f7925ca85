//! The rays of a source. No random numbers are involved: the same step has the same rays on every
//! run.

use super::geometry::{
    GOLDEN_ANGLE, half_circle, orthogonal_axes, radians, sphere_points, sphere_sequence,
    square_sequence, unit,
};
use super::{Domain, LightSource, SourceDirections};
use crate::grin::GrinRay;
use crate::math::Vec3;

/// Scoring directions of a source with new directions in every step.
const SCORING_DIRECTIONS: usize = 24;

/// The set of rays that is requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::grin_design) enum RaySet {
    /// The rays of a step.
    Step(usize),
    /// The rays by which fields are compared: always the same.
    Scoring,
}

/// A ray and the point of the unit sphere opposite to its source.
#[derive(Debug, Clone, Copy)]
pub(in crate::grin_design) struct SourceRay {
    pub(in crate::grin_design) ray: GrinRay<f64>,
    pub(in crate::grin_design) antipode: Vec3<f64>,
}

/// A square of parallel light of even density, which begins in a plane before the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SquareBeam {
    /// The unit direction of the light.
    pub direction: Vec3<f64>,
    /// The unit vectors along the sides of the square, perpendicular to the direction: to the right
    /// and upwards for an eye that looks against the light.
    pub axes: [Vec3<f64>; 2],
    /// Half the side, in mm.
    pub half: f64,
    /// The distance of the plane before the origin, in mm.
    pub back: f64,
}

impl SquareBeam {
    /// A square about the line through the origin in a direction of any length but 0; half the side
    /// and the distance of the plane in mm.
    pub fn new(direction: Vec3<f64>, half: f64, back: f64) -> Self {
        let direction = unit(direction);
        Self { direction, axes: orthogonal_axes(direction), half, back }
    }

    /// The ray that begins at a place of the square, which counts from 0 to 1 to the right and
    /// upwards.
    pub fn ray(&self, place: [f64; 2]) -> GrinRay<f64> {
        let [u, v] = self.axes;
        let [right, up] = place.map(|share| self.half * (2.0 * share - 1.0));
        GrinRay { x: u * right + v * up - self.direction * self.back, v: self.direction }
    }
}

impl SourceDirections {
    /// Unit vectors.
    fn unit_vectors(&self, set: RaySet) -> Vec<Vec3<f64>> {
        match (self, set) {
            (Self::Given(list), _) => {
                list.iter().map(|[x, y, z]| unit(Vec3::new(*x, *y, *z))).collect()
            }
            (Self::Even(count), _) => sphere_points(*count),
            (Self::Around(count), _) => half_circle(*count),
            (Self::Fresh(_), RaySet::Scoring) => sphere_points(SCORING_DIRECTIONS),
            (Self::Fresh(count), RaySet::Step(step)) => {
                (0..*count).map(|i| sphere_sequence(step * count + i)).collect()
            }
        }
    }

    /// The number of directions in a step.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Given(list) => list.len(),
            Self::Even(count) | Self::Around(count) | Self::Fresh(count) => *count,
        }
    }
}

impl LightSource {
    /// Its directions, if it has several.
    pub(super) fn directions(&self) -> Option<&SourceDirections> {
        match self {
            Self::Parallel { directions, .. } | Self::Points { directions, .. } => Some(directions),
            Self::Fan { .. } | Self::Beam { .. } => None,
        }
    }

    /// The unit direction of a beam.
    pub(in crate::grin_design) fn axis(&self) -> Option<Vec3<f64>> {
        let Self::Beam { direction: [x, y, z], .. } = self else { return None };
        Some(unit(Vec3::new(*x, *y, *z)))
    }

    /// The square of a beam that lights a domain; `None` for other sources.
    pub fn beam(&self, space: Domain) -> Option<SquareBeam> {
        let Self::Beam { direction: [x, y, z], half, .. } = self else { return None };
        Some(SquareBeam::new(Vec3::new(*x, *y, *z), *half, space.diameter()))
    }

    /// True if its rays differ from step to step.
    pub(in crate::grin_design) fn is_resampled(&self) -> bool {
        matches!(self.directions(), Some(SourceDirections::Fresh(_)))
            || matches!(self, Self::Beam { fresh: true, .. })
    }

    /// The number of rays in a step.
    pub fn count(&self) -> usize {
        let directions = self.directions().map_or(1, SourceDirections::count);
        match self {
            Self::Parallel { rays, .. } | Self::Points { rays, .. } | Self::Fan { rays, .. } => {
                directions * rays
            }
            Self::Beam { rays, .. } => rays * rays,
        }
    }

    /// The rays.
    pub(in crate::grin_design) fn rays(&self, space: Domain, set: RaySet) -> Vec<SourceRay> {
        match self {
            Self::Parallel { directions, radius, rays } => {
                let all = directions.unit_vectors(set).into_iter().enumerate();
                let back = space.diameter();
                all.flat_map(|(k, d)| disc(k, d, *radius, *rays, back)).collect()
            }
            Self::Points { directions, radius, cone, rays } => {
                let all = directions.unit_vectors(set).into_iter().enumerate();
                all.flat_map(|(k, d)| ray_cone(k, d, *radius, radians(*cone), *rays)).collect()
            }
            Self::Fan { height, z, rays } => {
                let at = |i: usize| Vec3::new(height * (i as f64 + 0.5) / *rays as f64, 0.0, *z);
                let v = Vec3::new(0.0, 0.0, 1.0);
                let source_ray = |x| SourceRay { ray: GrinRay { x, v }, antipode: -x };
                (0..*rays).map(|i| source_ray(at(i))).collect()
            }
            Self::Beam { direction: [x, y, z], half, rays, fresh } => {
                let first = match set {
                    RaySet::Step(step) if *fresh => (step + 1) * rays * rays,
                    RaySet::Step(_) | RaySet::Scoring => 0,
                };
                let beam = SquareBeam::new(Vec3::new(*x, *y, *z), *half, space.diameter());
                square(&beam, *rays, first)
            }
        }
    }
}

/// Uniform parallel rays that begin `back` before the origin: a sunflower pattern, rotated with the
/// number of the direction.
fn disc(
    number: usize,
    d: Vec3<f64>,
    radius: f64,
    rays: usize,
    back: f64,
) -> impl Iterator<Item = SourceRay> {
    let [u, v] = orthogonal_axes(d);
    (0..rays).map(move |i| {
        let r = radius * ((i as f64 + 0.5) / rays as f64).sqrt();
        let (sin, cos) = (GOLDEN_ANGLE * i as f64 + number as f64).sin_cos();
        let x = u * (r * cos) + v * (r * sin) - d * back;
        SourceRay { ray: GrinRay { x, v: d }, antipode: d }
    })
}

/// A uniform cone of rays from a point of a sphere towards its centre.
fn ray_cone(
    number: usize,
    d: Vec3<f64>,
    radius: f64,
    cone: f64,
    rays: usize,
) -> impl Iterator<Item = SourceRay> {
    let [u, v] = orthogonal_axes(d);
    (0..rays).map(move |i| {
        let along = 1.0 - (1.0 - cone.cos()) * (i as f64 + 0.5) / rays as f64;
        let r = (1.0 - along * along).max(0.0).sqrt();
        let (sin, cos) = (GOLDEN_ANGLE * i as f64 + number as f64).sin_cos();
        let direction = d * along + u * (r * cos) + v * (r * sin);
        SourceRay { ray: GrinRay { x: d * -radius, v: direction }, antipode: d }
    })
}

/// A square beam, one ray in each cell of a grid; the positions in the cells follow a sequence from
/// its member `first` on.
fn square(beam: &SquareBeam, side: usize, first: usize) -> Vec<SourceRay> {
    let ray = |n: usize| {
        let (a, b) = square_sequence(first + n);
        let at = |i: usize, jitter: f64| (i as f64 + jitter) / side as f64;
        let ray = beam.ray([at(n % side, a), at(n / side, b)]);
        SourceRay { ray, antipode: beam.direction }
    };
    (0..side * side).map(ray).collect()
}
