//! The library for Python: lenses, rays, merit functions and long runs, behind the feature `python`.
//!
//! This is the compiled half, `aplanat._aplanat`: numbers come and go as NumPy arrays, everything
//! else as the JSON of the file formats and of the command line. The half that is written in Python,
//! in `aplanat/` beside this file, gives them their names, and reads that JSON. Long work runs
//! without the interpreter's lock; the caller owns the loop of every run.
//!
//! Python counts surfaces from 0, as JSON does.
#![expect(clippy::needless_pass_by_value, reason = "arguments from Python are owned")]

mod command;
mod error;
mod lens;
mod merit;
mod names;
mod rays;
mod rows;
mod runs;
mod timing;

use pyo3::pymodule;

/// The module that Python imports.
#[pymodule]
#[pyo3(name = "_aplanat")]
mod extension {
    #[pymodule_export]
    use super::command::{run_command, stop_commands};
    #[pymodule_export]
    use super::error::{InputError, WorkError};
    #[pymodule_export]
    use super::lens::{PyLens, bundled_names};
    #[pymodule_export]
    use super::merit::PyMerit;
    #[pymodule_export]
    use super::rays::{ray_gradient, trace_rays};
    #[pymodule_export]
    use super::runs::{PyGrinRun, PyOptimizer, PyParetoSweep, PySearch};
    #[pymodule_export]
    use super::timing::{time_gradient, time_ray_gradient, time_trace};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn add_constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // A catalogue that cannot be read is said by the command `glass`, and is no reason to end.
        drop(crate::files::load_own_glasses());
        module.add("FATES", super::rows::FATES)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
