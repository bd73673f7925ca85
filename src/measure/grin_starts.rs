//! Accuracy of the derivative of the exit point by the start point of a ray.
//!
//! The gradient of a trilinear field jumps between voxels, and its exact transpose does not contain
//! the jumps: the derivative by the start is wrong on any grid. The Luneburg lens shows it best:
//! parallel rays end in one point, and the derivative is zero.

use super::grin::{BenchmarkField, GrinBenchmarkError, GrinBenchmarkScene};
use crate::grin::field::{HessianDiagonal, RegularGrid, Trilinear};
use crate::grin::{GrinTracer, IndexField, Integrator, RayAdjoint};
use crate::math::Vec3;
use serde::Serialize;

/// The derivative of the exit point by the start point, for one field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinStarts {
    /// The name of the representation of the field.
    pub field: &'static str,
    /// The RMS derivative of `w · x` by the start point, with `|w| = 1`.
    pub size: f64,
    /// Its RMS deviation from that of the exact field.
    pub error: f64,
    /// Its deviation for the worst ray.
    pub worst: f64,
    /// The number of rays that exit in both fields.
    pub rays: usize,
}

/// The number of field evaluations per ray.
const KICKS: f64 = 448.0;
/// The direction `w` along which the exit point is differentiated.
const END_DIRECTION: Vec3<f64> = Vec3 { x: 0.48, y: 0.64, z: -0.6 };

impl GrinBenchmarkScene<'_> {
    /// Measures the derivatives of the exact field, of tricubic grids and of trilinear ones.
    pub(super) fn starts(&self) -> Result<Vec<GrinStarts>, GrinBenchmarkError> {
        let fine = 16.0 * KICKS;
        let smooth = Integrator::BlanesMoan;
        let exact = self.by_start(&*self.field::<f64>(BenchmarkField::Exact)?, smooth, fine)?;
        let mut rows = Vec::new();
        for made in
            [BenchmarkField::Exact, BenchmarkField::Tricubic(33), BenchmarkField::Tricubic(65)]
        {
            let found = self.by_start(&*self.field::<f64>(made)?, smooth, KICKS)?;
            rows.push(compare(made.name(), &found, &exact));
        }
        let mut field = self.trilinear()?;
        for (diagonal, name) in [
            (HessianDiagonal::Smoothed, "trilinear 65"),
            (HessianDiagonal::Exact, "trilinear 65, exact transpose"),
        ] {
            field.diagonal = diagonal;
            let found = self.by_start(&field, Integrator::LeapfrogDkd, KICKS)?;
            rows.push(compare(name, &found, &exact));
        }
        Ok(rows)
    }

    fn trilinear(&self) -> Result<Trilinear<f64>, GrinBenchmarkError> {
        let exact = self.exact.field::<f64>()?;
        let grid = RegularGrid::cube(65, self.half)?;
        Ok(Trilinear::from_function(grid, |p| exact.sample(p).index)?)
    }

    /// The derivative of each ray that exits.
    fn by_start(
        &self,
        field: &dyn IndexField<f64>,
        integrator: Integrator,
        kicks: f64,
    ) -> Result<Vec<Option<Vec3<f64>>>, GrinBenchmarkError> {
        let tracer = GrinTracer::new(field, self.setup(integrator, kicks))?;
        let mut exits = tracer.trace_batch(&self.rays);
        let seeds = vec![RayAdjoint { x: END_DIRECTION, ..RayAdjoint::default() }; exits.len()];
        let starts = tracer.gradient(&self.rays, &mut exits, &seeds).starts;
        let pairs = exits.iter().zip(starts);
        Ok(pairs.map(|(exit, start)| exit.fate.has_arrived().then_some(start.x)).collect())
    }
}

fn compare(
    field: &'static str,
    found: &[Option<Vec3<f64>>],
    exact: &[Option<Vec3<f64>>],
) -> GrinStarts {
    let pairs: Vec<[Vec3<f64>; 2]> =
        found.iter().zip(exact).filter_map(|(a, b)| Some([(*a)?, *b.as_ref()? - (*a)?])).collect();
    let rms = |n: usize| {
        let squares: f64 = pairs.iter().map(|pair| pair[n].dot(pair[n])).sum();
        (squares / pairs.len() as f64).sqrt()
    };
    let worst = pairs.iter().map(|pair| pair[1].dot(pair[1]).sqrt()).fold(0.0, f64::max);
    GrinStarts { field, size: rms(0), error: rms(1), worst, rays: pairs.len() }
}
