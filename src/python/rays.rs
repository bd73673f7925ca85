//! Rays from and to NumPy arrays, and the derivatives of their landings.

use super::error::wrong_input;
use super::lens::PyLens;
use super::names::{parameter_name, parse_parameter};
use crate::lens::{Lens, Parameter, System};
use crate::merit::VariableSystem;
use crate::trace::{AdjointSeed, Fate, Landings, Rays, TraceSink as _, Tracer};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// The fates in the order of their codes.
pub(super) const FATES: [&str; 6] =
    ["imaged", "missed", "clipped", "total_reflection", "turned", "trapped"];

/// Some columns of numbers: x, y, z, L, M, N, optical path; then the code of the fate, an index of
/// `FATES`, and the surface at which a ray ends.
type TracedColumns<'py> =
    ([Bound<'py, PyArray1<f64>>; 7], Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<u32>>);

/// Traces rays through a lens on all cores.
///
/// `points` and `directions` have a ray a row, in mm and as direction cosines, in the frame of the
/// first vertex. The landings are in the frame of the last surface.
#[pyfunction]
pub(super) fn trace_rays<'py>(
    py: Python<'py>,
    lens: &PyLens,
    points: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
    um: Option<f64>,
    zoom: usize,
) -> PyResult<TracedColumns<'py>> {
    let rays = read_rays(&points, &directions)?;
    check_rays(&rays)?;
    let system = resolve(&lens.lens, um, zoom)?;
    let landings = py.detach(|| traced(&system, &rays))?;
    let ends: Vec<Fate> = (0..rays.len()).map(|i| landings.fate(i)).collect();
    let last = system.surfaces.len() as u32 - 1;
    let surface = |fate: &Fate| fate.surface().map_or(last, |surface| surface as u32);
    let code = |fate: &Fate| FATES.iter().position(|name| *name == fate.name()).unwrap_or(0) as u8;
    let codes: Vec<u8> = ends.iter().map(code).collect();
    let surfaces: Vec<u32> = ends.iter().map(surface).collect();
    let Landings { x, y, z, l, m, n, opl, .. } = landings;
    let columns = [x, y, z, l, m, n, opl].map(|column| column.into_pyarray(py));
    Ok((columns, codes.into_pyarray(py), surfaces.into_pyarray(py)))
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
    let rays = read_rays(&points, &directions)?;
    check_rays(&rays)?;
    let seeds = read_rays(&by_point, &by_direction)?;
    let by_path = by_path.as_array().to_vec();
    if seeds.len() != rays.len() || by_path.len() != rays.len() {
        return Err(wrong_input("expected as many derivatives as rays"));
    }
    let parameters: Vec<Parameter> =
        names.iter().map(|name| parse_parameter(name)).collect::<PyResult<_>>()?;
    check_has(&lens.lens, &parameters)?;
    let um = um.unwrap_or_else(|| primary_um(&lens.lens));
    check_zoom(&lens.lens, zoom)?;
    let seed = |i: usize| {
        let ray = seeds.get(i);
        AdjointSeed { point: ray.point, direction: ray.direction, opl: by_path[i] }
    };
    let numbers = py.detach(|| {
        let varied = VariableSystem::new(&lens.lens, zoom, um, &parameters).map_err(wrong_input)?;
        let tracer = Tracer::new(varied.system()).map_err(wrong_input)?;
        Ok::<_, PyErr>(varied.by_parameters(&tracer.gradient_parallel(&rays, seed)))
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
fn resolve(lens: &Lens, um: Option<f64>, zoom: usize) -> PyResult<System<f64>> {
    check_zoom(lens, zoom)?;
    lens.resolve(zoom, um.unwrap_or_else(|| primary_um(lens))).map_err(wrong_input)
}

fn traced(system: &System<f64>, rays: &Rays<f64>) -> PyResult<Landings<f64>> {
    let tracer = Tracer::new(system).map_err(wrong_input)?;
    let mut landings = Landings::default();
    tracer.trace_batch_parallel(rays, &mut landings);
    Ok(landings)
}

/// Rays of two arrays with a ray a row.
fn read_rays(
    points: &PyReadonlyArray2<'_, f64>,
    directions: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Rays<f64>> {
    let shapes = [points.shape(), directions.shape()];
    if shapes[0] != shapes[1] || shapes[0][1] != 3 {
        return Err(wrong_input(format!(
            "found arrays of shapes {:?} and {:?}; expected two of shape (rays, 3)",
            shapes[0], shapes[1]
        )));
    }
    let (points, directions) = (points.as_array(), directions.as_array());
    let column = |of: &numpy::ndarray::ArrayView2<'_, f64>, i: usize| of.column(i).to_vec();
    let [x, y, z] = [0, 1, 2].map(|i| column(&points, i));
    let [l, m, n] = [0, 1, 2].map(|i| column(&directions, i));
    Ok(Rays { x, y, z, l, m, n })
}

/// Refuses rays that are not finite or whose directions have another length than 1.
fn check_rays(rays: &Rays<f64>) -> PyResult<()> {
    (0..rays.len()).try_for_each(|i| rays.get(i).check(i)).map_err(wrong_input)
}
