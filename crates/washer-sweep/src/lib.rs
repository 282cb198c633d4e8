//! The Rust part of the Python package `washer_sweep`. `python/washer_sweep` defines the public
//! names, and its stubs their types.
//!
//! The engine runs without the interpreter's lock, on threads that end with the call, so that other
//! Python threads run meanwhile and a later fork is safe.

mod arrow;
mod columns;
mod computation;
mod errors;
mod finish;
mod functions;
mod mappings;
mod plan;
mod result;

use pyo3::pymodule;

/// The module from which `washer_sweep` imports its names.
#[pymodule]
mod _native {
    use lane_ode::Simd;
    use pyo3::exceptions::PyImportError;
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::functions::{dwell, explain, fit, modes, optimise, parameters, stability};
    #[pymodule_export]
    use super::plan::PyPlan;
    #[pymodule_export]
    use super::result::{PyResultTable, read};
    /// The version of the numerics. Builds with the same version compute the same bits.
    #[pymodule_export]
    const NUMERICS_VERSION: u32 = sweep::NUMERICS_VERSION;
    /// The version of the package.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "its name in Python")]
    const __version__: &str = sweep::VERSION;

    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        Simd::check_processor().map_err(|error| PyImportError::new_err(error.to_string()))
    }
}
