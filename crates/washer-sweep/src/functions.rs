//! The functions of the package.

use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyMapping};
use sweep::{AttractorSearch, CommandReport, FitOptions};

use crate::columns::{read_numbers, read_points};
use crate::computation::{ComputationOptions, supervise, supervise_abandonable};
use crate::errors;
use crate::finish;
use crate::mappings::to_assignments;
use crate::plan::PyPlan;
use crate::result::PyResultTable;

/// Computes natural frequencies, damping and resonances over spin speeds, by default 0 to 1200
/// rpm.
///
/// `speeds_rpm` are m speeds in rpm; the result has a row for each speed and mode. The machine is
/// the plan's, with the values in `at`, each in the unit with which its name ends; other axes are
/// ignored. Without a plan it is the built-in machine.
#[pyfunction]
#[pyo3(signature = (plan=None, *, speeds_rpm=None, at=None))]
pub(crate) fn modes(
    py: Python<'_>,
    plan: Option<&Bound<'_, PyPlan>>,
    speeds_rpm: Option<&Bound<'_, PyAny>>,
    at: Option<&Bound<'_, PyMapping>>,
) -> PyResult<PyResultTable> {
    let point_assignments = to_assignments(at)?;
    let speeds_rpm = speeds_rpm.map(read_numbers).transpose()?;
    if plan.is_none() && !point_assignments.is_empty() {
        return Err(PyTypeError::new_err("`at` needs a plan"));
    }
    let speeds = speeds_rpm.unwrap_or_else(|| (0..=120_u32).map(|k| 10.0 * f64::from(k)).collect());
    let input = plan.map(|plan| plan.get().input.clone());
    let table = supervise_abandonable(py, None, move |execution| {
        sweep::find_modes(input.as_ref(), &point_assignments, &speeds, execution.interrupt)
    })?;
    Ok(PyResultTable::new(table))
}

/// Finds the periodic response of both models at each point of the plan's grid and each held
/// speed, and the growth of disturbances about it.
///
/// `speeds_rpm` are m speeds in rpm. The result has m rows for each point, or more where a speed
/// has several responses, in the order of points, then of speeds. `threads` is the number of
/// threads, by default one for each core.
///
/// With `out` it also writes a Parquet file, byte for byte as `sweep stability` does, and the same
/// call continues after an interruption.
#[pyfunction]
#[pyo3(signature = (plan, speeds_rpm, out=None, *, threads=None, progress=true, fresh=false))]
pub(crate) fn stability(
    plan: &Bound<'_, PyPlan>,
    speeds_rpm: &Bound<'_, PyAny>,
    out: Option<PathBuf>,
    threads: Option<usize>,
    progress: bool,
    fresh: bool,
) -> PyResult<PyResultTable> {
    analyse_held_speeds(
        plan,
        speeds_rpm,
        None,
        (out, fresh),
        ComputationOptions { threads, progress },
    )
}

/// Finds the attractors of each point of the plan's grid at each held speed, a row for each.
///
/// `speeds_rpm` are m speeds in rpm. `starts` is the number of starts at a speed; some are kicks of
/// up to `kick` rad/s. With `carry` the start is the motion at the next lower (`up`) or higher
/// (`down`) speed. `threshold` searches for the smallest kick after which the motion does not
/// return. `longest` is the greatest duration of a trajectory in s. `sections` adds that many
/// states at successive turns, a row each. With `out` it also writes a Parquet file, byte for byte
/// as `sweep dwell` does.
#[pyfunction]
#[pyo3(signature = (plan, speeds_rpm, out=None, *, starts=12, kick=6.0, carry=None, threshold=false,
                    longest=600.0, sections=0, threads=None, progress=true, fresh=false))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn dwell(
    plan: &Bound<'_, PyPlan>,
    speeds_rpm: &Bound<'_, PyAny>,
    out: Option<PathBuf>,
    starts: u64,
    kick: f64,
    carry: Option<&str>,
    threshold: bool,
    longest: f64,
    sections: u64,
    threads: Option<usize>,
    progress: bool,
    fresh: bool,
) -> PyResult<PyResultTable> {
    let carry = carry.map(str::parse).transpose();
    let carry = carry.map_err(|wrong: String| PyValueError::new_err(format!("carry: {wrong}")))?;
    let search = AttractorSearch { starts, kick, carry, threshold, sections, longest };
    analyse_held_speeds(
        plan,
        speeds_rpm,
        Some(search),
        (out, fresh),
        ComputationOptions { threads, progress },
    )
}

/// Returns the results at held speeds: attractors if there is a `search`, else periodic responses
/// with the growth of disturbances.
fn analyse_held_speeds(
    plan: &Bound<'_, PyPlan>,
    speeds_rpm: &Bound<'_, PyAny>,
    search: Option<AttractorSearch>,
    output: (Option<PathBuf>, bool),
    options: ComputationOptions,
) -> PyResult<PyResultTable> {
    let py = plan.py();
    let speeds_rpm = &read_numbers(speeds_rpm)?;
    let task = sweep::held_speeds_task(plan.get().evaluator.plan(), speeds_rpm, search);
    finish::rows_or_file(py, task, output, options)
}

/// Searches for the candidates of a study file with the least objectives within its constraints.
///
/// `set` overrides constants of the study's grid, in the unit with which each name ends. The result
/// has a row for each candidate, in the order in which they were evaluated. With `out` it also
/// writes a Parquet file, byte for byte as `sweep optimise` does, and the same call continues after
/// an interruption.
#[pyfunction]
#[pyo3(signature = (study, out=None, *, set=None, threads=None, progress=true, fresh=false))]
pub(crate) fn optimise(
    py: Python<'_>,
    study: PathBuf,
    out: Option<PathBuf>,
    set: Option<&Bound<'_, PyMapping>>,
    threads: Option<usize>,
    progress: bool,
    fresh: bool,
) -> PyResult<PyResultTable> {
    let assignments_of_set = to_assignments(set)?;
    let result = supervise(py, ComputationOptions { threads, progress }, |execution| {
        sweep::optimise_study(&study, &assignments_of_set, out.as_deref(), fresh, execution)
    })?;
    finish::table_or_raise(py, result, || errors::interrupted_without_result_error(py))
}

/// Explains why the linear model fails at one point: the unstable speeds that the run passes,
/// the modes that grow there, and changes of the machine that make these speeds stable.
///
/// `at` gives a value to each axis, and to any other parameter, in the unit with which its name
/// ends. `speeds_rpm` are equally spaced speeds in rpm to examine; by default each rpm from half of
/// the slowest mode's frequency to the greatest speed of the run.
#[pyfunction]
#[pyo3(signature = (plan, at=None, *, speeds_rpm=None, threads=None))]
pub(crate) fn explain<'py>(
    plan: &Bound<'py, PyPlan>,
    at: Option<&Bound<'py, PyMapping>>,
    speeds_rpm: Option<&Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = plan.py();
    let speeds_rpm = speeds_rpm.map(read_numbers).transpose()?;
    let point_assignments = to_assignments(at)?;
    let input = plan.get().input.clone();
    let explanation_result = supervise_abandonable(py, threads, move |execution| {
        sweep::explain_point(&input, &point_assignments, speeds_rpm.as_deref(), execution)
    })?;
    to_explanation(py, explanation_result)
}

/// Fits numbers of the plan's machine to one or several measured run-ups.
///
/// A table has n rows, one for each instant: the column `time_s`, optionally `speed_rpm`, and
/// channels with their units, such as `tub_front_y_m_per_s2`, with NaN where there is no sample.
/// `free` are the names of the numbers to fit, or `name=from:to`; `own` are further ones that have
/// a value for each table. `at` has the constants of each table. `known` are tolerances of fixed
/// numbers, such as `tub_mass_kg=2%`; all others have those of their kind, or with `none` are
/// exact. `draws` is the number of rows for the probability of the verdict, `bootstrap` the number
/// of repeated fits. The keys of the result are those of `sweep fit --json`.
#[pyfunction]
#[pyo3(signature = (
    plan, table, free, *, own=Vec::new(), at=None, linear=false, shift=true, starts=1, bootstrap=0,
    known=Vec::new(), draws=64, threads=None
))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn fit<'py>(
    plan: &Bound<'py, PyPlan>,
    table: &Bound<'py, PyAny>,
    free: Vec<String>,
    own: Vec<String>,
    at: Option<&Bound<'py, PyAny>>,
    linear: bool,
    shift: bool,
    starts: u32,
    bootstrap: u32,
    known: Vec<String>,
    draws: u32,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = plan.py();
    let to_list = |value: &Bound<'py, PyAny>| -> PyResult<Vec<Bound<'py, PyAny>>> {
        if value.is_instance_of::<PyList>() { value.extract() } else { Ok(vec![value.clone()]) }
    };
    let tables = to_list(table)?;
    let at = at.map_or_else(|| Ok(Vec::new()), to_list)?;
    if at.len() > tables.len() {
        return Err(PyTypeError::new_err("`at` has more entries than there are tables"));
    }
    let constants_of_table = |k: usize| match at.get(k) {
        Some(at) => to_assignments(Some(at.cast::<PyMapping>()?)),
        None => Ok(Vec::new()),
    };
    let tables = tables
        .iter()
        .enumerate()
        .map(|(k, table)| Ok((read_points(table)?, constants_of_table(k)?)));
    let tables = tables.collect::<PyResult<Vec<_>>>()?;
    let model = if linear { "linear" } else { "nonlinear" }.to_owned();
    let no_shift = !shift;
    let options = FitOptions { free, own, model, no_shift, starts, bootstrap, known, draws };
    let input = plan.get().input.clone();
    let fit_result = supervise_abandonable(py, threads, move |execution| {
        sweep::fit_tables(&input, tables, &options, execution)
    })?;
    to_explanation(py, fit_result)
}

/// Creates the package's `Explanation` from data and text.
fn to_explanation(py: Python<'_>, report: CommandReport) -> PyResult<Bound<'_, PyAny>> {
    let json_data = py.import("json")?.call_method1("loads", (report.data.to_string(),))?;
    py.import("washer_sweep._explanation")?.getattr("Explanation")?.call1((json_data, report.text))
}

/// Lists all numbers that can be set or swept, with their values in the plan or the built-in
/// machine.
#[pyfunction]
#[pyo3(signature = (plan=None))]
pub(crate) fn parameters<'py>(
    py: Python<'py>,
    plan: Option<&Bound<'py, PyPlan>>,
) -> PyResult<Bound<'py, PyAny>> {
    let text = sweep::list_parameters(plan.map(|plan| plan.get().evaluator.plan()));
    py.import("json")?.call_method1("loads", (text,))
}
