//! The time of the library itself, without Python around it, for `aplanat.measure`.

use super::error::{failed_work, wrong_input};
use super::lens::PyLens;
use super::merit::PyMerit;
use super::names::parse_parameter;
use super::rays::resolve;
use super::rows::RayRows;
use crate::lens::Parameter;
use crate::math::Vec3;
use crate::measure::time_ms;
use crate::merit::{DerivativeLevel, VariableSystem};
use crate::trace::{AdjointSeed, Landings, Tracer};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use std::hint::black_box;

/// The milliseconds in which the library traces these rays on all cores: into new columns, and into
/// columns that it has already. The rays are columns before the watch is started.
#[pyfunction]
pub(super) fn time_trace<'py>(
    py: Python<'py>,
    lens: &PyLens,
    points: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
) -> PyResult<(f64, f64)> {
    let rays = RayRows::new(&points, &directions)?;
    py.detach(|| {
        let rays = rays.to_columns();
        let (traced, fresh) = time_ms(|| {
            let tracer = Tracer::new(&resolve(&lens.lens, None, 0)?).map_err(wrong_input)?;
            let mut landings = Landings::default();
            tracer.trace_batch_parallel(&rays, &mut landings);
            Ok::<_, PyErr>((tracer, landings))
        });
        let (tracer, mut landings) = traced?;
        let ((), again) = time_ms(|| tracer.trace_batch_parallel(&rays, &mut landings));
        Ok((fresh, again))
    })
}

/// The milliseconds in which the library computes a merit and its gradient as often as `calls` says.
#[pyfunction]
pub(super) fn time_gradient(
    py: Python<'_>,
    merit: &PyMerit,
    values: PyReadonlyArray1<'_, f64>,
    calls: usize,
) -> PyResult<f64> {
    let values = merit.checked(&values)?;
    let evaluate = || merit.merit.evaluate(&values, DerivativeLevel::Gradient).map(black_box);
    let (done, ms) = py.detach(|| time_ms(|| (0..calls).try_for_each(|_| evaluate().map(drop))));
    done.map(|()| ms).map_err(failed_work)
}

/// The milliseconds in which the library computes the derivative of the sum of the heights of rays by
/// these numbers of a lens, as often as `calls` says. The rays are columns before the watch is started.
#[pyfunction]
pub(super) fn time_ray_gradient<'py>(
    py: Python<'py>,
    lens: &PyLens,
    names: Vec<String>,
    points: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
    calls: usize,
) -> PyResult<f64> {
    let rays = RayRows::new(&points, &directions)?.to_columns();
    let parameters: Vec<Parameter> =
        names.iter().map(|name| parse_parameter(name)).collect::<PyResult<_>>()?;
    let um = lens.lens.wavelengths[lens.lens.primary()].um;
    let seed = AdjointSeed { point: Vec3::new(0.0, 1.0, 0.0), ..AdjointSeed::default() };
    let differentiate = || {
        let varied = VariableSystem::new(&lens.lens, 0, um, &parameters).map_err(wrong_input)?;
        let tracer = Tracer::new(varied.system()).map_err(wrong_input)?;
        black_box(varied.by_parameters(&tracer.gradient_parallel(&rays, |_| seed)));
        Ok(())
    };
    let (done, ms) = py.detach(|| time_ms(|| (0..calls).try_for_each(|_| differentiate())));
    done.map(|()| ms)
}
