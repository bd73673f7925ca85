//! How well a field knows by how much its light moves with the start of a ray.
//!
//! The gradient of a trilinear field jumps between voxels, and its exact transpose does not see the
//! jumps: its derivative by the start stays wrong on any grid. Luneburg's lens shows it best, where
//! parallel rays end in one point and the derivative is zero.

use super::grin::{BenchmarkField, GrinBenchmarkError, GrinBenchmarkScene};
use crate::grin::field::{HessianDiagonal, RegularGrid, Trilinear};
use crate::grin::{GrinTracer, IndexField, Integrator, RayAdjoint};
use crate::math::Vec3;
use serde::Serialize;

/// The derivative by the start of where rays leave one field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinStarts {
    /// How the field is made up.
    pub field: &'static str,
    /// How large the derivative of `w · x` by the start is, root mean square, with `|w| = 1`.
    pub size: f64,
    /// How far it is from that of the exact field, root mean square.
    pub error: f64,
    /// The same for the worst ray.
    pub worst: f64,
    /// Rays that arrive in both.
    pub rays: usize,
}

/// How often a ray asks the field.
const KICKS: f64 = 448.0;
/// The direction in which the end of a ray is looked at.
const END_DIRECTION: Vec3<f64> = Vec3 { x: 0.48, y: 0.64, z: -0.6 };

impl GrinBenchmarkScene<'_> {
    /// The derivatives of the exact field, of smooth grids and of trilinear ones.
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

    /// The derivative of each ray that arrives.
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
