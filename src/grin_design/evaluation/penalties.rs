//! Penalty terms on the field itself: its index at the boundary, a limit of its gradient, and for
//! splines the range of the index; each vanishes where the limit is satisfied.

use crate::grin::IndexField;
use crate::grin_design::task::geometry::length;
use crate::grin_design::task::{
    BoundaryCondition, FieldRepresentation, GrinTask, ManufacturingLimits,
};
use crate::math::Vec3;

/// Fewest and most points along a side of the bounding box at which the gradient is penalised;
/// otherwise one per voxel.
const LATTICE: [usize; 2] = [24, 64];
/// Points of a radius at which an index is penalised, and the weight of the penalty.
const RADIAL_POINTS: usize = 100;
const STIFFNESS: f64 = 10.0;
/// Points of the surface at which the index is prescribed.
const SURFACE: usize = 2000;

/// Penalty terms on the field itself: its index at the boundary, and limits of its gradient and
/// index.
#[derive(Debug, Clone)]
pub(in crate::grin_design) struct FieldPenalties {
    edge: Option<(BoundaryCondition, Vec<Vec3<f64>>)>,
    slope: Option<(f64, f64, Vec<Vec3<f64>>)>,
    /// The smallest and the largest index of a spline, which its coefficients alone do not
    /// guarantee.
    range: Option<([f64; 2], f64, Vec<Vec3<f64>>)>,
}

impl FieldPenalties {
    pub(in crate::grin_design) fn new(task: &GrinTask) -> Self {
        let ManufacturingLimits { slope, .. } = task.limits;
        let radius = task.field.size();
        let along = |x: f64| Vec3::new(x, 0.0, 0.0);
        let is_radial = task.field.is_radial();
        let surface =
            || if is_radial { vec![along(radius)] } else { task.space.surface_points(SURFACE) };
        let size = task.space.diameter();
        let finest = task.levels.iter().map(|level| level.nodes - 1).max().unwrap_or(0);
        let lattice =
            if slope.is_some() { finest.clamp(LATTICE[0], LATTICE[1]) } else { LATTICE[0] };
        let inside = || {
            if is_radial {
                (0..=RADIAL_POINTS)
                    .map(|i| along(radius * i as f64 / RADIAL_POINTS as f64))
                    .collect()
            } else {
                [task.space.lattice(lattice), surface()].concat()
            }
        };
        let is_spline = !matches!(task.field, FieldRepresentation::Trilinear { .. });
        Self {
            range: is_spline.then(|| ([task.limits.low, task.limits.high], size, inside())),
            edge: task.edge.filter(|edge| edge.weight > 0.0).map(|edge| (edge, surface())),
            slope: slope.map(|slope| (slope, size * size, inside())),
        }
    }

    /// Visits every nonzero residual: its position, its value, and its derivatives with respect to
    /// the index and to its gradient.
    fn visit_residuals(
        &self,
        field: &dyn IndexField<f64>,
        mut visit: impl FnMut(Vec3<f64>, f64, f64, Vec3<f64>),
    ) {
        if let Some((edge, places)) = &self.edge {
            let scale = (edge.weight / places.len() as f64).sqrt();
            for p in places {
                let off = field.sample(*p).index - edge.index;
                visit(*p, scale * off, scale, Vec3::default());
            }
        }
        if let Some(([low, high], size, places)) = &self.range {
            let scale = STIFFNESS * size / (places.len() as f64).sqrt();
            for p in places {
                let index = field.sample(*p).index;
                let over = (index - high).max(0.0) - (low - index).max(0.0);
                if over != 0.0 {
                    visit(*p, scale * over, scale, Vec3::default());
                }
            }
        }
        if let Some((limit, square, places)) = &self.slope {
            let scale = STIFFNESS * square / (places.len() as f64).sqrt();
            for p in places {
                let gradient = field.sample(*p).gradient;
                let over = length(gradient) - limit;
                if over > 0.0 {
                    let outwards = gradient * (scale / (over + limit));
                    visit(*p, scale * over, 0.0, outwards);
                }
            }
        }
    }

    /// The sum of squares; its gradient is added.
    pub(super) fn add_gradient(&self, field: &dyn IndexField<f64>, gradient: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        self.visit_residuals(field, |p, residual, by_index, by_slope| {
            sum += residual * residual;
            field.accumulate(p, 2.0 * residual * by_index, by_slope * (2.0 * residual), gradient);
        });
        sum
    }

    pub(super) fn residual_rows(&self, field: &dyn IndexField<f64>) -> Vec<(f64, Vec<f64>)> {
        let mut rows = Vec::new();
        self.visit_residuals(field, |p, residual, by_index, by_slope| {
            let mut row = vec![0.0; field.parameters().len()];
            field.accumulate(p, by_index, by_slope, &mut row);
            rows.push((residual, row));
        });
        rows
    }

    /// The sum of squares.
    pub(in crate::grin_design) fn value(&self, field: &dyn IndexField<f64>) -> f64 {
        let mut sum = 0.0;
        self.visit_residuals(field, |_, residual, _, _| sum += residual * residual);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin_design::GrinField;

    #[test]
    fn penalties_are_mean_squares_of_what_is_beyond_the_limits() {
        // n = 1.6 + 0.03 x, whose gradient is 0.03.
        let kind = FieldRepresentation::Tricubic { half: 2.0 };
        let field = GrinField::from_function(kind, 9, |p| 1.6 + 0.03 * p.x).unwrap();
        let places: Vec<Vec3<f64>> =
            (0..5).map(|i| Vec3::new(0.2 * f64::from(i) - 0.4, 0.1, -0.3)).collect();
        let condition = BoundaryCondition { index: 1.5, fixed: false, weight: 7.0 };
        let none = FieldPenalties { edge: None, slope: None, range: None };
        let value = |penalties: &FieldPenalties| penalties.value(field.index_field());
        let mean = |off: &dyn Fn(f64) -> f64| {
            places.iter().map(|p| off(1.6 + 0.03 * p.x).powi(2)).sum::<f64>() / 5.0
        };
        let edge = FieldPenalties { edge: Some((condition, places.clone())), ..none.clone() };
        let exact = 7.0 * mean(&|index| index - 1.5);
        assert!((value(&edge) / exact - 1.0).abs() < 1e-9, "{} {exact}", value(&edge));
        // The size of the domain is in mm, so that the sum is in mm², as the misses of rays.
        let size = 3.0;
        let stiff = (STIFFNESS * size).powi(2);
        for (limits, off) in [
            ([1.0, 1.55], (|index| index - 1.55) as fn(f64) -> f64),
            ([1.65, 2.0], |index| 1.65 - index),
            ([1.5, 1.7], |_| 0.0),
        ] {
            let range =
                FieldPenalties { range: Some((limits, size, places.clone())), ..none.clone() };
            let exact = stiff * mean(&off);
            assert!((value(&range) - exact).abs() <= 1e-9 * exact, "{limits:?}: {exact}");
        }
        let slope = FieldPenalties { slope: Some((0.02, size, places.clone())), ..none };
        let exact = (STIFFNESS * size * 0.01).powi(2);
        assert!((value(&slope) / exact - 1.0).abs() < 1e-6, "{} {exact}", value(&slope));
    }
}
