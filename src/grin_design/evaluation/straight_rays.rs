//! Reconstruction of a field from measured rays by straight-ray tomography, for comparison with
//! curved rays.
//!
//! To first order in the contrast of the index a ray is deflected by `∫ ∇η ds` along the straight
//! chord from its entry, and displaced by the same integral weighted with the remaining distance.
//! Both are linear in the field, so its parameters follow from linear least squares. The chord has
//! as many steps as the ray tracer would take, so that at weak contrast both evaluate the same
//! integrals. After the idea of Atcheson et al. (ACM TOG 27, 2008), who solve for the three
//! components of `∇η` one by one and integrate them: [`StraightRays::reconstruct_by_gradients`].

use super::outcome::is_valid;
use super::targets::{RayTarget, measure_targets};
use super::views::{ViewRays, plan_views, view_rays};
use crate::grin::field::{RegularGrid, Trilinear};
use crate::grin::{GrinTracer, IndexField};
use crate::grin_design::GrinTaskError;
use crate::grin_design::field::GrinField;
use crate::grin_design::task::checks::invalid;
use crate::grin_design::task::geometry::length;
use crate::grin_design::task::source::RaySet;
use crate::grin_design::task::{GrinTask, InitialField};
use crate::math::Vec3;
use crate::solve::{ParameterBounds, cgls};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// The number of parts into which the rays are split; their sums are added in order.
const PARTS: usize = 16;
/// Points of the surface at which the index is prescribed.
const SURFACE: usize = 2000;
/// Steps that integrate a gradient, as a multiple of the nodes along a side.
const INTEGRATION: usize = 4;

/// A tracer through a field without contrast.
type StraightTracer<'a> = GrinTracer<'a, f64, dyn IndexField<f64> + 'a>;

/// The straight path of a ray, and the measured difference of the real one.
#[derive(Debug, Clone, Copy)]
struct StraightRay {
    from: Vec3<f64>,
    /// A unit vector.
    direction: Vec3<f64>,
    length: f64,
    /// The number of sample points along the path.
    steps: usize,
    /// Factors from the integral of the gradient to the change of `v`, and from its moment to the
    /// change of `x`.
    gains: [f64; 2],
    /// The measured deflection and displacement of the ray.
    measured: [Vec3<f64>; 2],
}

/// The measurements of a task with the straight paths of their rays.
#[derive(Debug, Clone)]
pub struct StraightRays {
    rays: Vec<StraightRay>,
    task: GrinTask,
    /// The index outside.
    ambient: f64,
    /// The points at which the task prescribes the index, and the square root of the weight of
    /// each.
    edge: (Vec<Vec3<f64>>, f64),
}

impl StraightRay {
    fn new(
        field: &dyn IndexField<f64>,
        view: &ViewRays,
        tracer: &StraightTracer<'_>,
        ray: usize,
    ) -> Option<Self> {
        let target: RayTarget = *view.targets.get(ray)?;
        let (states, exit) = tracer.trace_path(&view.rays[ray]);
        let entry = states.first()?;
        let (chord, speed) = (exit.x - entry.x, length(entry.v));
        let whole = length(chord);
        if !(whole > 0.0 && is_valid(&exit)) {
            return None;
        }
        let index = field.sample(entry.x).index;
        let (turn, weight) = (index / speed, target.direction.sqrt());
        Some(Self {
            from: entry.x,
            direction: chord * (1.0 / whole),
            length: whole,
            steps: states.len().max(1),
            gains: [turn * weight, turn / speed],
            measured: [(target.v - exit.v) * weight, target.x - exit.x],
        })
    }

    /// Each sample point with the remaining distance behind it and its share of the length.
    fn sample_points(&self) -> impl Iterator<Item = (Vec3<f64>, f64, f64)> {
        let share = self.length / self.steps as f64;
        let at = move |i: usize| share * (i as f64 + 0.5);
        let Self { from, direction, length, steps, .. } = *self;
        (0..steps).map(move |i| (from + direction * at(i), length - at(i), share))
    }

    /// The component transverse to the path: along it light is not deflected, and a displacement
    /// slides on the boundary.
    fn transverse(&self, v: Vec3<f64>) -> Vec3<f64> {
        v - self.direction * self.direction.dot(v)
    }

    /// The deflection and displacement of the ray by a field of weak contrast.
    fn deflection(&self, field: &dyn IndexField<f64>) -> [Vec3<f64>; 2] {
        let mut sums = [Vec3::default(); 2];
        for (p, left, share) in self.sample_points() {
            let pull = field.sample(p).gradient * share;
            sums[0] = sums[0] + pull * self.gains[0];
            sums[1] = sums[1] + pull * (self.gains[1] * left);
        }
        sums.map(|sum| self.transverse(sum))
    }

    /// The transpose of [`Self::deflection`].
    fn deflection_adjoint(
        &self,
        field: &dyn IndexField<f64>,
        seeds: [Vec3<f64>; 2],
        gradient: &mut [f64],
    ) {
        let [turn, shift] = seeds.map(|seed| self.transverse(seed));
        for (p, left, share) in self.sample_points() {
            let pull = turn * (self.gains[0] * share) + shift * (self.gains[1] * left * share);
            field.accumulate(p, 0.0, pull, gradient);
        }
    }

    /// The deflection of the ray by a volume of one component of the gradient.
    fn turning(&self, part: &Trilinear<f64>) -> f64 {
        let turns = self.sample_points().map(|(p, _, share)| share * part.sample(p).index);
        self.gains[0] * turns.sum::<f64>()
    }

    /// The transpose of [`Self::turning`].
    fn turning_adjoint(&self, part: &Trilinear<f64>, seed: f64, gradient: &mut [f64]) {
        for (p, _, share) in self.sample_points() {
            part.accumulate(p, self.gains[0] * share * seed, Vec3::default(), gradient);
        }
    }
}

impl StraightRays {
    /// The straight rays of a task whose views all have the goal `like`.
    ///
    /// # Errors
    /// A task that is invalid, or a file that has not been read.
    pub fn new(task: &GrinTask) -> Result<Self, GrinTaskError> {
        task.check()?;
        let ambient = match (task.edge, &task.start) {
            (Some(edge), _) => edge.index,
            (None, InitialField::Uniform(index)) => *index,
            (None, InitialField::Volume(_)) => 1.0,
        };
        let nodes = task.levels.iter().map(|level| level.nodes).max().unwrap_or(2);
        let uniform = GrinField::from_function(task.field, nodes, |_| ambient)?;
        let setups = plan_views(task, uniform.index_field(), RaySet::Scoring)?;
        let views = view_rays(task, &measure_targets(task)?, &setups, RaySet::Scoring)?;
        let mut rays: Vec<StraightRay> = Vec::new();
        for view in &views {
            let tracer = GrinTracer::new(uniform.index_field(), view.setup.clone())?;
            rays.extend(
                (0..view.rays.len())
                    .filter_map(|ray| StraightRay::new(uniform.index_field(), view, &tracer, ray)),
            );
        }
        if rays.is_empty() {
            return Err(invalid("views", "none with the goal `like`", "light that was measured"));
        }
        let weight = task.edge.map_or(0.0, |edge| edge.weight);
        let places = if weight > 0.0 { task.space.surface_points(SURFACE) } else { Vec::new() };
        // The weight is relative to the mean over the rays, here to their sum.
        let root_weight = (weight * rays.len() as f64 / SURFACE as f64).sqrt();
        Ok(Self { rays, task: task.clone(), ambient, edge: (places, root_weight) })
    }

    /// The number of rays.
    pub fn count(&self) -> usize {
        self.rays.len()
    }

    /// The field with this many nodes that explains the measurement best by straight rays, within
    /// the limits of the task, after `steps` steps of conjugate gradients; `visit` receives the
    /// field after each of them and may stop.
    ///
    /// # Errors
    /// Too few nodes.
    pub fn reconstruct(
        &self,
        nodes: usize,
        steps: usize,
        mut visit: impl FnMut(&GrinField) -> ControlFlow<()>,
    ) -> Result<GrinField, GrinTaskError> {
        let shape = GrinField::from_function(self.task.field, nodes, |_| 0.0)?;
        let ranges = shape.parameter_ranges(self.task.space, self.task.limits, self.task.edge);
        let limits = ParameterBounds { ranges, max_change: f64::INFINITY };
        let (places, root_weight) = &self.edge;
        let mut right: Vec<f64> = self.rows(|ray| ray.measured.map(|m| ray.transverse(m)));
        right.resize(right.len() + places.len(), 0.0);
        let forward = |u: &[f64]| {
            let field = with_parameters(&shape, u);
            let mut rows = self.rows(|ray| ray.deflection(field.index_field()));
            rows.extend(places.iter().map(|p| root_weight * field.index_field().sample(*p).index));
            rows
        };
        let back = |rows: &[f64]| {
            let mut sum =
                self.transpose(shape.index_field().parameters().len(), rows, |ray, seeds, sum| {
                    ray.deflection_adjoint(shape.index_field(), seeds, sum);
                });
            for (p, row) in places.iter().zip(&rows[6 * self.rays.len()..]) {
                shape.index_field().accumulate(*p, root_weight * row, Vec3::default(), &mut sum);
            }
            let held = limits.ranges.iter().map(|[low, high]| low >= high);
            sum.iter_mut().zip(held).filter(|(_, held)| *held).for_each(|(g, _)| *g = 0.0);
            sum
        };
        let field = |u: &[f64]| {
            let mut field = with_parameters(&shape, u);
            field.parameters_mut().iter_mut().for_each(|value| *value += self.ambient);
            limits.project(field.parameters_mut());
            field
        };
        let unknowns = shape.index_field().parameters().len();
        let found = cgls(unknowns, &right, steps, forward, back, |u| visit(&field(u)));
        Ok(field(&found))
    }

    /// The same by way of three volumes for the components of `∇η`, each found from the deflections
    /// alone, which are then integrated with the index outside as the boundary value; on a
    /// trilinear grid.
    ///
    /// # Errors
    /// Too few nodes.
    pub fn reconstruct_by_gradients(
        &self,
        nodes: usize,
        steps: usize,
    ) -> Result<GrinField, GrinTaskError> {
        let half = self.task.field.size();
        let grid = RegularGrid::cube(nodes, half)?;
        let shape = Trilinear::new(grid, vec![0.0; grid.node_count()])?;
        let part = |axis: usize| -> Result<Trilinear<f64>, GrinTaskError> {
            let right: Vec<f64> =
                self.rays.iter().map(|c| component(c.measured[0], axis)).collect();
            let forward = |u: &[f64]| -> Vec<f64> {
                let volume = with_values(&shape, u);
                self.rays.par_iter().map(|ray| ray.turning(&volume)).collect()
            };
            let back = |rows: &[f64]| {
                let add = |ray: &StraightRay, n: usize, sum: &mut [f64]| {
                    ray.turning_adjoint(&shape, rows[n], sum);
                };
                self.accumulate(grid.node_count(), add)
            };
            let go_on = |_: &[f64]| ControlFlow::Continue(());
            Ok(with_values(&shape, &cgls(grid.node_count(), &right, steps, forward, back, go_on)))
        };
        let parts = [part(0)?, part(1)?, part(2)?];
        let mut values = integrate_gradient(&shape, &parts, INTEGRATION * nodes);
        values.iter_mut().for_each(|value| *value += self.ambient);
        Ok(GrinField::Trilinear(Trilinear::new(grid, values)?))
    }

    /// Six numbers per ray.
    fn rows(&self, of: impl Fn(&StraightRay) -> [Vec3<f64>; 2] + Sync) -> Vec<f64> {
        let rows = |ray: &StraightRay| {
            let [a, b] = of(ray);
            [a.x, a.y, a.z, b.x, b.y, b.z]
        };
        self.rays.par_iter().flat_map_iter(rows).collect()
    }

    /// The transpose of [`Self::rows`].
    fn transpose(
        &self,
        unknowns: usize,
        rows: &[f64],
        add: impl Fn(&StraightRay, [Vec3<f64>; 2], &mut [f64]) + Sync,
    ) -> Vec<f64> {
        self.accumulate(unknowns, |ray, n, sum| {
            let [a, b, c, d, e, f] = std::array::from_fn(|i| rows[6 * n + i]);
            add(ray, [Vec3::new(a, b, c), Vec3::new(d, e, f)], sum);
        })
    }

    /// Sums over all rays; the result does not depend on the number of threads.
    fn accumulate(
        &self,
        unknowns: usize,
        add: impl Fn(&StraightRay, usize, &mut [f64]) + Sync,
    ) -> Vec<f64> {
        let size = self.rays.len().div_ceil(PARTS).max(1);
        let part = |(first, rays): (usize, &[StraightRay])| {
            let mut sum = vec![0.0; unknowns];
            rays.iter().enumerate().for_each(|(i, c)| add(c, first * size + i, &mut sum));
            sum
        };
        let parts: Vec<Vec<f64>> = self.rays.par_chunks(size).enumerate().map(part).collect();
        let mut sum = vec![0.0; unknowns];
        for part in parts {
            sum.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
        }
        sum
    }
}

fn with_parameters(shape: &GrinField, parameters: &[f64]) -> GrinField {
    let mut field = shape.clone();
    field.parameters_mut().copy_from_slice(parameters);
    field
}

fn with_values(shape: &Trilinear<f64>, values: &[f64]) -> Trilinear<f64> {
    let mut filled = shape.clone();
    filled.parameters_mut().copy_from_slice(values);
    filled
}

fn component(v: Vec3<f64>, axis: usize) -> f64 {
    [v.x, v.y, v.z][axis]
}

/// The values that vanish at the boundary and whose gradient is nearest to these volumes at the
/// centres of the voxels: Poisson's equation.
fn integrate_gradient(
    shape: &Trilinear<f64>,
    parts: &[Trilinear<f64>; 3],
    steps: usize,
) -> Vec<f64> {
    let grid = shape.grid();
    let cells = grid.counts().map(|count| count - 1);
    let h = grid.spacing();
    let middle = |n: usize| {
        let at = |i: usize| i as f64 + 0.5;
        let [nx, ny, _] = cells;
        grid.low() + Vec3::new(h.x * at(n % nx), h.y * at(n / nx % ny), h.z * at(n / nx / ny))
    };
    let all = cells.iter().product::<usize>();
    let right = |n: usize| parts.each_ref().map(|part| part.sample(middle(n)).index);
    let right: Vec<f64> = (0..all).into_par_iter().flat_map_iter(right).collect();
    let forward = |u: &[f64]| {
        let volume = with_values(shape, u);
        let slope = |n: usize| {
            let Vec3 { x, y, z } = volume.sample(middle(n)).gradient;
            [x, y, z]
        };
        (0..all).into_par_iter().flat_map_iter(slope).collect()
    };
    let counts = grid.counts();
    let is_rim = |n: usize| {
        let place = [n % counts[0], n / counts[0] % counts[1], n / counts[0] / counts[1]];
        place.iter().zip(counts).any(|(i, count)| *i == 0 || i + 1 == count)
    };
    let back = |rows: &[f64]| {
        let mut sum = vec![0.0; grid.node_count()];
        for n in 0..all {
            let pull = Vec3::new(rows[3 * n], rows[3 * n + 1], rows[3 * n + 2]);
            shape.accumulate(middle(n), 0.0, pull, &mut sum);
        }
        sum.iter_mut().enumerate().filter(|(n, _)| is_rim(*n)).for_each(|(_, g)| *g = 0.0);
        sum
    };
    cgls(grid.node_count(), &right, steps, forward, back, |_| ControlFlow::Continue(()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_follow_from_their_gradient() {
        // (1 - x²) (1 - y²) (1 - z²), which vanishes at the faces of the cube.
        let f = |x: f64| 1.0 - x * x;
        let grid = RegularGrid::cube(9, 1.0).unwrap();
        let volume = |of: &dyn Fn(Vec3<f64>) -> f64| Trilinear::from_function(grid, of).unwrap();
        let parts = [
            volume(&|p| -2.0 * p.x * f(p.y) * f(p.z)),
            volume(&|p| -2.0 * p.y * f(p.z) * f(p.x)),
            volume(&|p| -2.0 * p.z * f(p.x) * f(p.y)),
        ];
        let found = integrate_gradient(&volume(&|_| 0.0), &parts, 60);
        for (n, found) in found.into_iter().enumerate() {
            let p = grid.node(n);
            let exact = f(p.x) * f(p.y) * f(p.z);
            assert!((found - exact).abs() < 0.05, "{p:?}: {found} {exact}");
        }
    }
}
