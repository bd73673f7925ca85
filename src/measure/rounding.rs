//! Rounding errors: the same rays in a number type and in twice the precision.

use super::double_gauss::bundle;
use crate::lens::{System, SystemError};
use crate::math::{DoubleDouble, Real};
use crate::trace::{Ray, Tracer};
use serde::Serialize;

/// The rounding errors of the rays that reach the image, against twice the precision.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Rounding {
    /// The RMS error of the image points, in mm.
    pub point_rms_mm: f64,
    /// The largest error of an image point, in mm.
    pub point_max_mm: f64,
    /// The RMS error of the optical path lengths, in mm.
    pub path_rms_mm: f64,
    /// The number of rays with a different fate; rounding may put a ray on the other side of a rim.
    pub other_fates: usize,
    /// The number of rays compared.
    pub rays: usize,
}

/// Measures the rounding error of the number type `R` for a bundle through the benchmark lens.
pub fn measure_rounding<R: Real>(
    system: &System<f64>,
    rays: usize,
) -> Result<Rounding, SystemError> {
    let fast = Tracer::new(&system.cast::<R>())?;
    let exact = Tracer::new(&system.cast::<DoubleDouble>())?;
    let bundle = bundle(rays);
    let mut sum = Rounding { rays, ..Rounding::default() };
    let mut compared = 0;
    for i in 0..rays {
        let rounded: Ray<R> = bundle.get(i).cast();
        let got = fast.trace(rounded);
        // Both start from the same rounded ray, which leaves the error of the tracing alone.
        let same = Ray { point: rounded.point.value(), direction: rounded.direction.value() };
        let want = exact.trace(same.cast());
        if got.fate != want.fate {
            sum.other_fates += 1;
        } else if got.fate.is_imaged() {
            let (p, q) = (got.ray.point, want.ray.point);
            let distance = rounding_error(p.x, q.x).hypot(rounding_error(p.y, q.y));
            sum.point_rms_mm += distance * distance;
            sum.point_max_mm = sum.point_max_mm.max(distance);
            sum.path_rms_mm += rounding_error(got.opl, want.opl).powi(2);
            compared += 1;
        }
    }
    let mean = |square: f64| (square / f64::from(compared.max(1))).sqrt();
    Ok(Rounding { point_rms_mm: mean(sum.point_rms_mm), path_rms_mm: mean(sum.path_rms_mm), ..sum })
}

/// The difference of two numbers, without first rounding the exact one.
fn rounding_error<R: Real>(got: R, exact: DoubleDouble) -> f64 {
    (DoubleDouble::from_f64(got.value()) - exact).value()
}
