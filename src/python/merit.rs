//! The merit function of a lens as a function of some of its numbers.

use super::error::{failed_work, wrong_input};
use super::lens::PyLens;
use super::names::parse_parameter;
use super::rays::check_has;
use crate::files::json;
use crate::lens::{Lens, Variable};
use crate::merit::{DerivativeLevel, Goal, Merit};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// The merit function of a lens, its numbers in the order of their names; derivatives include the
/// motion of the pupil's edge unless the goal says otherwise.
#[pyclass(name = "Merit", module = "aplanat._aplanat")]
#[derive(Debug)]
pub(super) struct PyMerit {
    pub(super) merit: Merit,
    /// The variables that the lens itself has.
    variables: Vec<Variable>,
}

#[pymethods]
impl PyMerit {
    /// A merit function: `goal` is the JSON of a goal, that of the lens if it is absent; `names` are
    /// those of its variables, those of the lens if they are absent; spot radii are good to the
    /// relative `tolerance`.
    #[new]
    fn new(
        py: Python<'_>,
        lens: &PyLens,
        goal: Option<&str>,
        names: Option<Vec<String>>,
        tolerance: f64,
    ) -> PyResult<Self> {
        let variables = lens.lens.variables.clone();
        let lens = match names {
            Some(names) => with_variables(&lens.lens, &names)?,
            None => lens.lens.clone(),
        };
        check_tolerance(tolerance)?;
        let goal = read_goal(goal, &lens)?;
        let merit = py.detach(|| Merit::new(&lens, &goal, tolerance)).map_err(wrong_input)?;
        Ok(Self { merit, variables })
    }

    /// The values of its variables in a lens.
    fn values<'py>(&self, py: Python<'py>, lens: &PyLens) -> Bound<'py, PyArray1<f64>> {
        self.merit.values(&lens.lens).into_pyarray(py)
    }

    /// The lens at some values of the variables.
    fn lens(&self, values: PyReadonlyArray1<'_, f64>) -> PyResult<PyLens> {
        let values = self.checked(&values)?;
        let variables = self.variables.clone();
        Ok(PyLens { lens: Lens { variables, ..self.merit.lens(&values) } })
    }

    /// The merit.
    fn value(&self, py: Python<'_>, values: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
        let values = self.checked(&values)?;
        py.detach(|| self.merit.value(&values)).map_err(failed_work)
    }

    /// The merit and its derivatives by the variables.
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let values = self.checked(&values)?;
        let sum = py.detach(|| self.merit.evaluate(&values, DerivativeLevel::Gradient));
        let sum = sum.map_err(failed_work)?;
        Ok((sum.value, sum.gradient.as_slice().to_vec().into_pyarray(py)))
    }

    /// Every term with its value, error and rays, as JSON.
    fn terms(&self, py: Python<'_>, values: PyReadonlyArray1<'_, f64>) -> PyResult<String> {
        let values = self.checked(&values)?;
        let terms = py.detach(|| self.merit.terms(&values)).map_err(failed_work)?;
        Ok(json::pretty(&terms))
    }

    /// Finds the rays anew for the lens at some values of the variables.
    fn resample(&mut self, py: Python<'_>, values: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let lens = self.merit.lens(&self.checked(&values)?);
        py.detach(|| self.merit.resample(&lens)).map_err(failed_work)
    }
}

impl PyMerit {
    /// The values of an array that has as many as there are variables.
    pub(super) fn checked(&self, values: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<f64>> {
        let (found, expected) = (values.len(), self.merit.variables().len());
        if found != expected {
            return Err(wrong_input(format!("found {found} values; expected {expected}")));
        }
        Ok(values.as_array().to_vec())
    }
}

/// The lens with these of its numbers as variables.
pub(super) fn with_variables(lens: &Lens, names: &[String]) -> PyResult<Lens> {
    let parameters = names.iter().map(|name| parse_parameter(name));
    let parameters: Vec<_> = parameters.collect::<PyResult<_>>()?;
    check_has(lens, &parameters)?;
    if let Some(twice) = (1..names.len()).find(|i| parameters[..*i].contains(&parameters[*i])) {
        return Err(wrong_input(format!("found {} twice; expected every name once", names[twice])));
    }
    let variable = |parameter| Variable { parameter, min: None, max: None };
    let variables = parameters.into_iter().map(variable).collect();
    let lens = Lens { variables, ..lens.clone() };
    lens.check().map_err(wrong_input)?;
    Ok(lens)
}

/// The goal of a JSON text, or else that of the lens.
pub(super) fn read_goal(goal: Option<&str>, lens: &Lens) -> PyResult<Goal> {
    match goal {
        Some(text) => json::read_json(text, "the goal").map_err(wrong_input),
        None => Goal::of_lens(lens).map_err(wrong_input),
    }
}

/// Refuses a relative tolerance that is none.
pub(super) fn check_tolerance(tolerance: f64) -> PyResult<()> {
    if tolerance > 0.0 && tolerance < 1.0 {
        return Ok(());
    }
    Err(wrong_input(format!(
        "found the tolerance {tolerance}; expected more than 0 and less than 1"
    )))
}
