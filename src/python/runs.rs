//! Long runs whose loop the caller owns: local optimization, the front, a search, a GRIN design.

use super::error::{failed_work, wrong_input};
use super::lens::PyLens;
use super::merit::{check_tolerance, read_goal, with_variables};
use crate::files::json;
use crate::grin_design::{GrinOptimizer, GrinTask, find_builtin, read_task};
use crate::lens::{Lens, Variable};
use crate::optimize::pareto::{ParetoSettings, ParetoSweep};
use crate::optimize::{DescentMethod, Optimizer, start};
use crate::search::SearchRunOn;
use crate::search::lens_landscape::{LensLandscape, SearchPlan};
use numpy::ndarray::{Array3, ShapeBuilder as _};
use numpy::{IntoPyArray, PyArray3};
use pyo3::prelude::*;
use serde::de::DeserializeOwned;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// The index at the nodes of a grid, the lowest corner of the grid, and its spacing, in mm.
type GridField<'py> = (Bound<'py, PyArray3<f64>>, [f64; 3], [f64; 3]);

/// Settings from JSON; the default ones without it.
fn read_settings<T: DeserializeOwned + Default>(text: Option<&str>, what: &str) -> PyResult<T> {
    text.map_or_else(|| Ok(T::default()), |text| json::read_json(text, what).map_err(wrong_input))
}

/// A local optimizer.
#[pyclass(name = "Optimizer", module = "aplanat._aplanat")]
#[derive(Debug)]
pub(super) struct PyOptimizer {
    optimizer: Box<dyn Optimizer>,
    /// The variables that the lens itself has.
    variables: Vec<Variable>,
}

#[pymethods]
impl PyOptimizer {
    /// An optimizer of the named numbers of a lens, or of its own variables; `method` is
    /// `trust_region`, `damped_least_squares` or `adam`.
    #[new]
    fn new(
        py: Python<'_>,
        lens: &PyLens,
        goal: Option<&str>,
        names: Option<Vec<String>>,
        method: &str,
        tolerance: f64,
    ) -> PyResult<Self> {
        let variables = lens.lens.variables.clone();
        let lens = match names {
            Some(names) => with_variables(&lens.lens, &names)?,
            None => lens.lens.clone(),
        };
        check_tolerance(tolerance)?;
        let goal = read_goal(goal, &lens)?;
        let method = json!(method).to_string();
        let method: DescentMethod = json::read_json(&method, "the method").map_err(wrong_input)?;
        let started = py.detach(|| start(method, &lens, &goal, tolerance));
        Ok(Self { optimizer: started.map_err(wrong_input)?, variables })
    }

    /// Takes a step; returns its progress as JSON.
    fn step(&mut self, py: Python<'_>) -> String {
        let progress = py.detach(|| self.optimizer.step());
        json::pretty(&progress)
    }

    /// The best lens so far.
    fn best(&self) -> PyLens {
        let variables = self.variables.clone();
        PyLens { lens: Lens { variables, ..self.optimizer.best().clone() } }
    }

    /// Evaluates the best lens with rays that are found anew.
    fn verify_best(&mut self, py: Python<'_>) {
        py.detach(|| self.optimizer.verify_best());
    }

    /// The terms of the best lens, the limits that hold it and those that contradict each other, as JSON.
    fn report(&self, py: Python<'_>) -> PyResult<String> {
        let terms = py.detach(|| self.optimizer.terms()).map_err(failed_work)?;
        Ok(json::pretty(&json!({
            "terms": terms,
            "limits": self.optimizer.binding_limits(),
            "conflict": self.optimizer.conflict(),
        })))
    }
}

/// A sweep of weights between sharpness and light.
#[pyclass(name = "ParetoSweep", module = "aplanat._aplanat")]
#[derive(Debug)]
pub(super) struct PyParetoSweep {
    sweep: ParetoSweep,
}

#[pymethods]
impl PyParetoSweep {
    /// A sweep with settings as JSON.
    #[new]
    fn new(py: Python<'_>, lens: &PyLens, settings: Option<&str>) -> PyResult<Self> {
        let settings: ParetoSettings = read_settings(settings, "the settings")?;
        let sweep = py.detach(|| ParetoSweep::new(&lens.lens, &settings));
        Ok(Self { sweep: sweep.map_err(wrong_input)? })
    }

    /// Advances every chain by up to 25 steps; returns the progress as JSON.
    fn step(&mut self, py: Python<'_>) -> String {
        let progress = py.detach(|| self.sweep.step());
        json::pretty(&json!({
            "done": progress.done,
            "total": progress.total,
            "joined": progress.joined,
            "refused": progress.refused,
            "finished": progress.finished,
            "hypervolume": self.sweep.hypervolume(),
        }))
    }

    /// The front so far: the numbers of its points as JSON, and their lenses.
    fn front(&self) -> (String, Vec<PyLens>) {
        let points = self.sweep.front().points();
        let lenses = points.iter().map(|point| PyLens { lens: point.lens.clone() }).collect();
        (json::pretty(&points), lenses)
    }
}

/// A search over the structure of a lens.
#[pyclass(name = "Search", module = "aplanat._aplanat")]
#[derive(Debug)]
pub(super) struct PySearch {
    landscape: LensLandscape,
    run: SearchRunOn<LensLandscape>,
    original: Lens,
}

#[pymethods]
impl PySearch {
    /// A search by a plan as JSON; it goes on from a checkpoint if there is one.
    #[new]
    fn new(
        py: Python<'_>,
        lens: &PyLens,
        plan: Option<&str>,
        checkpoint: Option<PathBuf>,
    ) -> PyResult<Self> {
        let plan: SearchPlan = read_settings(plan, "the plan")?;
        let original = lens.lens.clone();
        py.detach(|| {
            let Some(path) = checkpoint else {
                let (landscape, run) = plan.begin(&original).map_err(wrong_input)?;
                return Ok(Self { landscape, run, original });
            };
            let landscape = plan.landscape(&original).map_err(wrong_input)?;
            let run = plan.resume(&landscape, &path).map_err(wrong_input)?;
            Ok(Self { landscape, run, original })
        })
    }

    /// Advances every chain by a turn; returns the progress as JSON.
    fn round(&mut self, py: Python<'_>) -> String {
        let events = py.detach(|| self.run.round(&self.landscape)).len();
        let (best, end) = (self.run.best(), self.run.end_reason());
        json::pretty(&json!({
            "events": events,
            "best": best.loss,
            "generation": best.number,
            "statistics": self.run.statistics(),
            "ended": end,
        }))
    }

    /// The best lens so far.
    fn best(&self) -> PyLens {
        self.lens(&self.run.best().point)
    }

    /// The losses and the lenses found so far, the best first.
    fn found(&self) -> (Vec<f64>, Vec<PyLens>) {
        let found = self.run.found_points();
        found.iter().map(|found| (found.entry.loss, self.lens(&found.entry.point))).unzip()
    }

    /// The lenses of the reservoir as the search has them, for other runs of it.
    fn reservoir(&self) -> (Vec<f64>, Vec<PyLens>) {
        let lens = |point: &Lens| PyLens { lens: point.clone() };
        let entries = self.run.reservoir().entries().iter();
        entries.map(|entry| (entry.loss, lens(&entry.point))).unzip()
    }

    /// Admits lenses that other runs of this search have found, and judges them anew; returns for each
    /// if it was accepted.
    fn admit(&mut self, py: Python<'_>, lenses: Vec<PyLens>) -> Vec<bool> {
        py.detach(|| {
            let lenses = lenses.into_iter().map(|lens| Arc::new(lens.lens));
            lenses.map(|lens| self.run.admit(&self.landscape, lens).is_accepted()).collect()
        })
    }

    /// Saves the run.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.run.save(&self.landscape, &path)).map_err(failed_work)
    }
}

impl PySearch {
    /// A lens of the search with the name and the wavelengths of that which it began with.
    fn lens(&self, point: &Lens) -> PyLens {
        let Lens { name, wavelengths, .. } = self.original.clone();
        PyLens { lens: Lens { name, wavelengths, ..point.clone() } }
    }
}

/// The optimization of a field of refractive index.
#[pyclass(name = "GrinRun", module = "aplanat._aplanat")]
#[derive(Debug)]
pub(super) struct PyGrinRun {
    optimizer: GrinOptimizer,
}

#[pymethods]
impl PyGrinRun {
    /// The run of a task: the name of a built-in one, or the JSON of a task.
    #[new]
    fn new(py: Python<'_>, task: &str) -> PyResult<Self> {
        let task: GrinTask = match find_builtin(task) {
            Some(builtin) => builtin.task(),
            None => read_task(task, "the task"),
        }
        .map_err(wrong_input)?;
        let begun = py.detach(|| {
            task.check()?;
            task.read_files()?;
            GrinOptimizer::new(&task)
        });
        Ok(Self { optimizer: begun.map_err(wrong_input)? })
    }

    /// Takes a step; returns its progress as JSON.
    fn step(&mut self, py: Python<'_>) -> PyResult<String> {
        let progress = py.detach(|| self.optimizer.step()).map_err(failed_work)?;
        Ok(json::pretty(&json!({
            "step": progress.step,
            "max_steps": progress.max_steps,
            "nodes": progress.nodes,
            "loss": progress.loss,
            "best": progress.best,
            "finished": progress.finished,
        })))
    }

    /// Scores the field when a run is ended early.
    fn finish(&mut self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| self.optimizer.finish()).map_err(failed_work)
    }

    /// The best field: the index at the nodes of a grid, its lowest corner and its spacing in mm.
    fn field<'py>(&self, py: Python<'py>, nodes: usize) -> PyResult<GridField<'py>> {
        if !(2..=513).contains(&nodes) {
            return Err(wrong_input(format!("nodes: found {nodes}; expected 2 to 513")));
        }
        let task = self.optimizer.task();
        let volume = task.volume(self.optimizer.best(), nodes).map_err(failed_work)?;
        let (counts, low, spacing) =
            (volume.grid.counts(), volume.grid.low(), volume.grid.spacing());
        let values = Array3::from_shape_vec(counts.f(), volume.values).map_err(failed_work)?;
        Ok((values.into_pyarray(py), [low.x, low.y, low.z], [spacing.x, spacing.y, spacing.z]))
    }
}
