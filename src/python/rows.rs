//! Rays with a ray a row, as NumPy has them, for a tracer that wants columns.
//!
//! Whole copies of the arrays would take longer than the rays. Each task turns a few rays into columns
//! that stay in the cache of its core, and turns their landings back into rows where they belong.

use super::error::wrong_input;
use crate::lens::SystemError;
use crate::trace::{AdjointSeed, Fate, Landings, Rays, SystemGradient, TraceSink as _, Tracer};
use numpy::ndarray::{ArrayView1, ArrayView2, ArrayViewMut1, Axis, Slice};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods as _};
use pyo3::PyResult;
use rayon::prelude::*;

/// Rays of a task: many beside the change of a thread, and few enough that rows and columns stay in the
/// first two levels of the cache.
const CHUNK: usize = 512;

/// The fates in the order of their codes.
pub(super) const FATES: [&str; 6] =
    ["imaged", "missed", "clipped", "total_reflection", "turned", "trapped"];

/// The code of a fate: its place in [`FATES`].
fn fate_code(fate: Fate) -> u8 {
    match fate {
        Fate::Imaged => 0,
        Fate::Missed(_) => 1,
        Fate::Clipped(_) => 2,
        Fate::TotalReflection(_) => 3,
        Fate::Turned(_) => 4,
        Fate::Trapped(_) => 5,
    }
}

/// Rays in two arrays of any layout with a ray a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayRows<'a> {
    points: ArrayView2<'a, f64>,
    directions: ArrayView2<'a, f64>,
}

impl<'a> RayRows<'a> {
    /// The rays of two arrays of the same number of rows, with three numbers each.
    pub(super) fn new(
        points: &'a PyReadonlyArray2<'_, f64>,
        directions: &'a PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let shapes = [points.shape(), directions.shape()];
        if shapes[0] != shapes[1] || shapes[0][1] != 3 {
            return Err(wrong_input(format!(
                "found arrays of shapes {:?} and {:?}; expected two of shape (rays, 3)",
                shapes[0], shapes[1]
            )));
        }
        Ok(Self { points: points.as_array(), directions: directions.as_array() })
    }

    /// The number of rays.
    pub(super) fn len(&self) -> usize {
        self.points.nrows()
    }

    /// The rays of a task as columns.
    fn load(&self, from: usize, rays: &mut Rays<f64>) {
        let rows = Slice::from(from..self.len().min(from + CHUNK));
        let Rays { x, y, z, l, m, n } = rays;
        load_columns(self.points.slice_axis(Axis(0), rows), [x, y, z]);
        load_columns(self.directions.slice_axis(Axis(0), rows), [l, m, n]);
    }

    /// All rays as columns.
    pub(super) fn to_columns(self) -> Rays<f64> {
        let mut rays = Rays::default();
        let Rays { x, y, z, l, m, n } = &mut rays;
        load_columns(self.points, [x, y, z]);
        load_columns(self.directions, [l, m, n]);
        rays
    }
}

fn load_columns(rows: ArrayView2<'_, f64>, columns: [&mut Vec<f64>; 3]) {
    let [x, y, z] = columns.map(|column| {
        column.resize(rows.nrows(), 0.0);
        column.as_mut_slice()
    });
    let Some(rows) = rows.as_slice() else {
        for (i, column) in [x, y, z].into_iter().enumerate() {
            ArrayViewMut1::from(column).assign(&rows.column(i));
        }
        return;
    };
    for (((row, x), y), z) in rows.chunks_exact(3).zip(x).zip(y).zip(z) {
        (*x, *y, *z) = (row[0], row[1], row[2]);
    }
}

/// Refuses rays that are not finite or whose directions have another length than 1. The first of them
/// has the number `from`.
fn check_rays(rays: &Rays<f64>, from: usize) -> Result<(), SystemError> {
    if are_sound(rays) {
        return Ok(());
    }
    (0..rays.len()).try_for_each(|i| rays.get(i).check(from + i))
}

/// True if rays are certainly sound. A loop over columns that has no branch: the exact check of each ray
/// takes a third of the time of its trace.
fn are_sound(rays: &Rays<f64>) -> bool {
    let start = |column: &[f64]| column.iter().fold(true, |sound, v| sound & (v.abs() < 1e99));
    let directions = rays.l.iter().zip(&rays.m).zip(&rays.n);
    let unit = directions
        .fold(true, |sound, ((l, m), n)| sound & ((l * l + m * m + n * n - 1.0).abs() < 1e-9));
    unit & [&rays.x, &rays.y, &rays.z].into_iter().all(|column| start(column))
}

/// The ends of rays with a ray a row.
#[derive(Debug)]
pub(super) struct RayEnds<'a> {
    /// Points, three numbers a ray, in mm.
    pub(super) points: &'a mut [f64],
    /// Directions, three numbers a ray.
    pub(super) directions: &'a mut [f64],
    /// Optical paths, in mm.
    pub(super) opl: &'a mut [f64],
    /// Codes of the fates.
    pub(super) fates: &'a mut [u8],
    /// The surfaces at which the rays end.
    pub(super) surfaces: &'a mut [u32],
}

impl<'a> RayEnds<'a> {
    /// The parts of the tasks, in order.
    fn split(self) -> Vec<Self> {
        let points = self.points.chunks_mut(3 * CHUNK);
        let directions = self.directions.chunks_mut(3 * CHUNK);
        let columns = points.zip(directions).zip(self.opl.chunks_mut(CHUNK));
        let ends = self.fates.chunks_mut(CHUNK).zip(self.surfaces.chunks_mut(CHUNK));
        let part = |(((points, directions), opl), (fates, surfaces))| RayEnds::<'a> {
            points,
            directions,
            opl,
            fates,
            surfaces,
        };
        columns.zip(ends).map(part).collect()
    }

    /// Stores landings; a ray that arrives ends at the surface `last`.
    fn store(&mut self, landings: &Landings<f64>, last: u32) {
        let Landings { x, y, z, l, m, n, opl, .. } = landings;
        store_rows(self.points, [x, y, z]);
        store_rows(self.directions, [l, m, n]);
        self.opl.copy_from_slice(opl);
        if landings.all_arrive() {
            // Most tasks: no look at each ray.
            self.fates.fill(fate_code(Fate::Imaged));
            self.surfaces.fill(last);
            return;
        }
        for (i, (code, surface)) in self.fates.iter_mut().zip(&mut *self.surfaces).enumerate() {
            let fate = landings.fate(i);
            *code = fate_code(fate);
            *surface = fate.surface().map_or(last, |surface| surface as u32);
        }
    }
}

fn store_rows(rows: &mut [f64], [a, b, c]: [&[f64]; 3]) {
    for (((row, a), b), c) in rows.chunks_exact_mut(3).zip(a).zip(b).zip(c) {
        (row[0], row[1], row[2]) = (*a, *b, *c);
    }
}

/// Traces rays on all cores. The error is that of the first ray that is none.
pub(super) fn trace_rows(
    tracer: &Tracer<f64>,
    rays: RayRows<'_>,
    ends: RayEnds<'_>,
) -> Result<(), SystemError> {
    let last = tracer.surfaces() as u32 - 1;
    let trace = |(columns, landings): &mut (Rays<f64>, Landings<f64>), (i, mut part)| {
        let part: &mut RayEnds<'_> = &mut part;
        rays.load(i * CHUNK, columns);
        check_rays(columns, i * CHUNK)?;
        tracer.trace_batch(columns, landings);
        part.store(landings, last);
        Ok(())
    };
    let tasks = ends.split().into_par_iter().enumerate();
    let refused = tasks.map_init(Default::default, trace).find_map_first(Result::err);
    refused.map_or(Ok(()), Err)
}

/// The derivative of a sum over rays by every number of a system, on all cores; `seeds` and `by_path`
/// are the derivatives of the sum by the landings. The bits do not depend on the number of cores.
pub(super) fn differentiate_rows(
    tracer: &Tracer<f64>,
    rays: RayRows<'_>,
    seeds: RayRows<'_>,
    by_path: ArrayView1<'_, f64>,
) -> Result<SystemGradient<f64>, SystemError> {
    let differentiate = |(columns, seed_columns): &mut (Rays<f64>, Rays<f64>), from: usize| {
        rays.load(from, columns);
        seeds.load(from, seed_columns);
        check_rays(columns, from)?;
        let seed = |i: usize| {
            let seed = seed_columns.get(i);
            AdjointSeed { point: seed.point, direction: seed.direction, opl: by_path[from + i] }
        };
        Ok(tracer.gradient(columns, seed))
    };
    let starts: Vec<usize> = (0..rays.len()).step_by(CHUNK).collect();
    let parts: Vec<_> = starts.into_par_iter().map_init(Default::default, differentiate).collect();
    let mut total = SystemGradient::zero(tracer.surfaces());
    for part in parts {
        total.add(&part?, 1.0);
    }
    Ok(total)
}
