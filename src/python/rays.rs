//! Rays from and to NumPy arrays, and the derivatives of their landings.

use super::error::wrong_input;
use super::lens::PyLens;
use super::names::{parameter_name, parse_parameter};
use super::rows::{RayEnds, RayRows, differentiate_rows, trace_rows};
use crate::lens::{Lens, Parameter, System};
use crate::merit::VariableSystem;
use crate::trace::Tracer;
use numpy::{
    IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1,
    PyReadwriteArray2, PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;
use std::ops::RangeInclusive;

/// The arrays of the ends of rays: points and directions with a ray a row, optical paths, the codes of
/// the fates, which are indices of `FATES`, and the surfaces at which the rays end.
type EndArrays<'py> = (
    PyReadwriteArray2<'py, f64>,
    PyReadwriteArray2<'py, f64>,
    PyReadwriteArray1<'py, f64>,
    PyReadwriteArray1<'py, u8>,
    PyReadwriteArray1<'py, u32>,
);

/// The wavelengths of light that lenses image, in µm; others are in another unit.
const WAVELENGTHS: RangeInclusive<f64> = 0.05..=50.0;

/// Traces rays through a lens on all cores, into the arrays `ends`.
///
/// `points` and `directions` have a ray a row, in mm and as direction cosines, in the frame of the
/// first vertex; they are read where they lie. The landings are in the frame of the last surface.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is an array or a word of the caller")]
pub(super) fn trace_rays<'py>(
    py: Python<'py>,
    lens: &PyLens,
    points: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
    um: Option<f64>,
    zoom: usize,
    mut ends: EndArrays<'py>,
) -> PyResult<()> {
    let rays = RayRows::new(&points, &directions)?;
    let system = resolve(&lens.lens, um, zoom)?;
    let tracer = Tracer::new(&system).map_err(wrong_input)?;
    let ends = borrow_ends(&mut ends, rays.len())?;
    py.detach(|| trace_rows(&tracer, rays, ends)).map_err(wrong_input)
}

/// The numbers of arrays for the ends of so many rays.
fn borrow_ends<'a>(arrays: &'a mut EndArrays<'_>, count: usize) -> PyResult<RayEnds<'a>> {
    let (points, directions, opl, fates, surfaces) = arrays;
    let lengths = [opl.len(), fates.len(), surfaces.len()];
    let shapes = [points.shape(), directions.shape()];
    if shapes != [&[count, 3]; 2] || lengths != [count; 3] {
        return Err(wrong_input(format!("expected arrays for the ends of {count} rays")));
    }
    Ok(RayEnds {
        points: points.as_slice_mut().map_err(wrong_input)?,
        directions: directions.as_slice_mut().map_err(wrong_input)?,
        opl: opl.as_slice_mut().map_err(wrong_input)?,
        fates: fates.as_slice_mut().map_err(wrong_input)?,
        surfaces: surfaces.as_slice_mut().map_err(wrong_input)?,
    })
}

/// The derivative of a sum over rays by the named numbers of a lens, from its derivatives by the
/// landings: `by_point` and `by_direction` have a ray a row, `by_path` a number for each ray. Lost
/// rays do not contribute.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "each is an array or a word of the caller")]
pub(super) fn ray_gradient<'py>(
    py: Python<'py>,
    lens: &PyLens,
    points: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
    um: Option<f64>,
    zoom: usize,
    names: Vec<String>,
    by_point: PyReadonlyArray2<'py, f64>,
    by_direction: PyReadonlyArray2<'py, f64>,
    by_path: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rays = RayRows::new(&points, &directions)?;
    let seeds = RayRows::new(&by_point, &by_direction)?;
    let by_path = by_path.as_array();
    if seeds.len() != rays.len() || by_path.len() != rays.len() {
        return Err(wrong_input("expected as many derivatives as rays"));
    }
    let parameters: Vec<Parameter> =
        names.iter().map(|name| parse_parameter(name)).collect::<PyResult<_>>()?;
    check_has(&lens.lens, &parameters)?;
    let um = um.unwrap_or_else(|| primary_um(&lens.lens));
    check_zoom(&lens.lens, zoom)?;
    let numbers = py.detach(|| {
        let varied = VariableSystem::new(&lens.lens, zoom, um, &parameters).map_err(wrong_input)?;
        let tracer = Tracer::new(varied.system()).map_err(wrong_input)?;
        let gradient = differentiate_rows(&tracer, rays, seeds, by_path).map_err(wrong_input)?;
        Ok::<_, PyErr>(varied.by_parameters(&gradient))
    })?;
    Ok(numbers.into_pyarray(py))
}

/// Refuses a number that a lens does not have.
pub(super) fn check_has(lens: &Lens, parameters: &[Parameter]) -> PyResult<()> {
    match parameters.iter().find(|parameter| lens.get(**parameter).is_none()) {
        Some(missing) => {
            let name = parameter_name(*missing);
            Err(wrong_input(format!("the lens has no number `{name}`")))
        }
        None => Ok(()),
    }
}

fn primary_um(lens: &Lens) -> f64 {
    lens.wavelengths[lens.primary()].um
}

fn check_zoom(lens: &Lens, zoom: usize) -> PyResult<()> {
    let count = lens.zoom_positions();
    if zoom < count {
        return Ok(());
    }
    let last = count - 1;
    Err(wrong_input(format!("found zoom position {zoom}; expected 0 to {last}")))
}

/// A system at a wavelength, the primary one if there is none.
pub(super) fn resolve(lens: &Lens, um: Option<f64>, zoom: usize) -> PyResult<System<f64>> {
    check_zoom(lens, zoom)?;
    if let Some(um) = um.filter(|um| !WAVELENGTHS.contains(um)) {
        let text = format!("found the wavelength {um} um; expected one from 0.05 to 50 um");
        return Err(wrong_input(text));
    }
    lens.resolve(zoom, um.unwrap_or_else(|| primary_um(lens))).map_err(wrong_input)
}
