//! The Python package `washer_sweep`, as far as it is not Python: `python/washer_sweep` says what
//! is public, and its stubs say what each thing takes.
//!
//! The engine is called without the interpreter's lock, on threads that end with the call, so that
//! other threads of Python go on and a fork afterwards finds nothing half done.

mod arrow;
mod columns;
mod ended;
mod errors;
mod functions;
mod mappings;
mod plan;
mod result;
mod work;

use pyo3::pymodule;

/// What `washer_sweep` is made of.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::functions::{explain, modes, parameters, stability};
    #[pymodule_export]
    use super::plan::PyPlan;
    #[pymodule_export]
    use super::result::{PyResultTable, read};
    #[pymodule_export]
    const NUMERICS_VERSION: u32 = sweep::NUMERICS_VERSION;
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "its name in Python")]
    const __version__: &str = sweep::VERSION;
}
