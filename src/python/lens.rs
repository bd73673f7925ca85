//! A lens: from and to every file format, with every number by its name.

use super::error::{failed_work, wrong_input};
use super::names::{parameter_name, parse_parameter};
use crate::files::{self, json};
use crate::lens::Lens;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A lens: its surfaces, glasses, stop, fields and wavelengths.
#[pyclass(name = "Lens", module = "aplanat._aplanat", from_py_object, eq)]
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PyLens {
    pub(super) lens: Lens,
}

#[pymethods]
impl PyLens {
    /// Reads a lens from a file of any format that the program reads.
    #[staticmethod]
    fn open(path: PathBuf) -> PyResult<Self> {
        files::open(path).map(|opened| Self { lens: opened.lens }).map_err(wrong_input)
    }

    /// The lens that is bundled under a name.
    #[staticmethod]
    fn bundled(name: &str) -> PyResult<Self> {
        let found = files::bundled_lenses().iter().find(|lens| lens.name == name);
        let bundled = found.ok_or_else(|| {
            wrong_input(format!("found `{name}`; expected one of {}", bundled_names().join(", ")))
        })?;
        Self::from_json(bundled.text)
    }

    /// Reads a lens from the text of a lens file.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        json::read(text, "the lens").map(|lens| Self { lens }).map_err(wrong_input)
    }

    /// The text of the lens file.
    fn to_json(&self) -> String {
        json::write(&self.lens)
    }

    /// Writes the lens in the format of the extension; returns the report as JSON.
    fn save(&self, path: PathBuf) -> PyResult<String> {
        let report = files::save(&self.lens, path).map_err(failed_work)?;
        Ok(json::pretty(&report))
    }

    /// The names of all its numbers.
    fn names(&self) -> Vec<String> {
        self.lens.parameters().into_iter().map(parameter_name).collect()
    }

    /// The number of a name.
    fn get(&self, name: &str) -> PyResult<f64> {
        let found = self.lens.get(parse_parameter(name)?);
        found.ok_or_else(|| wrong_input(format!("the lens has no number `{name}`")))
    }

    /// Sets the number of a name. The lens is as before if it would be invalid with it.
    fn set(&mut self, name: &str, value: f64) -> PyResult<()> {
        let mut changed = self.lens.clone();
        if !changed.set(parse_parameter(name)?, value) {
            return Err(wrong_input(format!("the lens has no number `{name}`")));
        }
        changed.check().map_err(wrong_input)?;
        self.lens = changed;
        Ok(())
    }

    /// The number of its surfaces.
    fn surface_count(&self) -> usize {
        self.lens.surfaces.len()
    }

    /// A copy.
    fn copy(&self) -> Self {
        self.clone()
    }

    fn __repr__(&self) -> String {
        format!("<Lens {:?}, {} surfaces>", self.lens.name, self.lens.surfaces.len())
    }
}

/// The names of the bundled lenses.
#[pyfunction]
pub(super) fn bundled_names() -> Vec<&'static str> {
    files::bundled_lenses().iter().map(|lens| lens.name).collect()
}
