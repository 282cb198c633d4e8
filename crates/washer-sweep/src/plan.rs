//! `Plan`: a grid that was read and checked, and all that can be asked of it.

use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};
use sweep::{
    BoundaryOptions, Effort, Error, Evaluated, Evaluator, GridInput, ProgressMode, RanToFile,
    TraceOptions,
};

use crate::result::PyResultTable;
use crate::work::{abandonable, attended};
use crate::{columns, errors};

/// Name of a plan that comes from no file, where it gives none.
const UNNAMED: &str = "plan";

/// A validated plan.
#[pyclass(name = "Plan", module = "washer_sweep", frozen)]
pub(crate) struct PyPlan {
    input: GridInput,
    evaluator: Evaluator,
}

impl PyPlan {
    fn load(py: Python<'_>, input: GridInput) -> PyResult<Self> {
        let plan = py.detach(|| input.load()).map_err(|wrong| errors::plan_error(py, &wrong))?;
        Ok(Self { input, evaluator: Evaluator::new(plan) })
    }
}

#[pymethods]
impl PyPlan {
    /// A plan with the keys of a grid file.
    #[new]
    #[pyo3(signature = (grid, *, set=None))]
    fn new(grid: &Bound<'_, PyDict>, set: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let py = grid.py();
        let text = toml(grid)?;
        Self::load(py, GridInput::text(UNNAMED, text, assignments(set)?))
    }

    /// A plan from a grid file, or from the text of one.
    #[staticmethod]
    #[pyo3(signature = (source, *, set=None))]
    fn from_toml(source: &Bound<'_, PyAny>, set: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let py = source.py();
        let sets = assignments(set)?;
        // A path has no line of its own with an assignment or a table.
        let text = source.cast::<PyString>().ok().map(|text| text.to_string());
        let text = text.filter(|text| text.contains('\n') || text.contains('='));
        let input = match text {
            Some(text) => GridInput::text(UNNAMED, text, sets),
            None => GridInput::file(source.extract()?, sets),
        };
        Self::load(py, input)
    }

    /// Rows of designs in, rows of results out.
    #[pyo3(signature = (table, *, threads=None, progress=false))]
    fn evaluate(
        &self,
        table: &Bound<'_, PyAny>,
        threads: Option<usize>,
        progress: bool,
    ) -> PyResult<PyResultTable> {
        let py = table.py();
        let points = columns::points(table)?;
        let evaluated = attended(py, |interrupt| {
            let effort = Effort { threads, progress: mode(progress), interrupt };
            self.evaluator.evaluate(&points, effort)
        })?;
        whole(py, evaluated)
    }

    /// Every point of the grid.
    #[pyo3(signature = (out=None, *, threads=None, progress=true, fresh=false))]
    fn run(
        &self,
        py: Python<'_>,
        out: Option<PathBuf>,
        threads: Option<usize>,
        progress: bool,
        fresh: bool,
    ) -> PyResult<PyResultTable> {
        let Some(out) = out else {
            let evaluated = attended(py, |interrupt| {
                let effort = Effort { threads, progress: mode(progress), interrupt };
                self.evaluator.run(effort)
            })?;
            return whole(py, evaluated);
        };
        let tell = |text: &str| {
            if progress {
                sweep::tell(text);
            }
        };
        let ran = attended(py, |interrupt| {
            let effort = Effort { threads, progress: mode(progress), interrupt };
            sweep::run_to_file(self.evaluator.plan(), &out, fresh, &tell, effort)
        })?;
        let ran = ran.or_raise(py, |ran| match ran {
            Err(error) => errors::error(py, &error),
            Ok(RanToFile::Whole(table)) => {
                let text = format!("interrupted when {} was done", out.display());
                holding(py, text, Some(PyResultTable::new(table)))
            }
            Ok(RanToFile::Interrupted { kept, points }) => {
                let text = format!(
                    "interrupted with {kept} of {points} points kept beside {}; the same call \
                     goes on",
                    out.display()
                );
                holding(py, text, None)
            }
        })?;
        match ran.map_err(|error| errors::error(py, &error))? {
            RanToFile::Whole(table) => Ok(PyResultTable::new(table)),
            RanToFile::Interrupted { kept, points } => Err(PyValueError::new_err(format!(
                "stopped with {kept} of {points} points, though nothing interrupted it"
            ))),
        }
    }

    /// Time histories of both models at one point.
    #[pyo3(signature = (at=None, *, every=0.01, states=false, forces=false, start=None))]
    fn trace(
        &self,
        py: Python<'_>,
        at: Option<&Bound<'_, PyDict>>,
        every: f64,
        states: bool,
        forces: bool,
        start: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyResultTable> {
        let (at, start) = (assignments(at)?, assignments(start)?);
        let options = TraceOptions { every_s: every, states, forces, start };
        let input = self.input.clone();
        let traced = abandonable(py, move || sweep::trace_point(&input, &at, &options))?;
        let (table, failures) = traced.map_err(|error| errors::error(py, &error))?;
        for failure in failures {
            py.import("warnings")?.call_method1("warn", (failure,))?;
        }
        Ok(PyResultTable::new(table))
    }

    /// The curve on which a quantity is at its limit.
    #[pyo3(signature = (
        quantity="ratio_max", *, tolerance=None, lattice=6, out=None, threads=None, progress=true,
        fresh=false
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn boundary(
        &self,
        py: Python<'_>,
        quantity: &str,
        tolerance: Option<f64>,
        lattice: u16,
        out: Option<PathBuf>,
        threads: Option<usize>,
        progress: bool,
        fresh: bool,
    ) -> PyResult<PyResultTable> {
        let output = out.as_deref();
        let options = BoundaryOptions { quantity, tolerance, lattice, output, fresh };
        let found = attended(py, |interrupt| {
            let effort = Effort { threads, progress: mode(progress), interrupt };
            sweep::find_boundary(self.evaluator.plan(), options, effort)
        })?;
        let interrupted = || {
            let text = match output {
                Some(out) => format!(
                    "interrupted; what was found is kept beside {}, and the same call goes on",
                    out.display()
                ),
                None => "interrupted; with `out` the search would have kept what it found".into(),
            };
            holding(py, text, None)
        };
        let found = found.or_raise(py, |_| interrupted())?;
        let found = found.map_err(|error| errors::error(py, &error))?;
        found.map(PyResultTable::new).ok_or_else(interrupted)
    }

    /// Name of the plan.
    #[getter]
    fn name(&self) -> &str {
        &self.evaluator.plan().name
    }

    /// Names of the axes with the least and the greatest value of each.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let axes = PyDict::new(py);
        for axis in &self.evaluator.plan().axes {
            let [least, greatest] = axis.values.extremes().map(|k| axis.values.value(k));
            axes.set_item(axis.parameter.name(), (least, greatest))?;
        }
        Ok(axes)
    }

    /// How many points its grid or design has.
    fn __len__(&self) -> PyResult<usize> {
        Ok(usize::try_from(self.evaluator.plan().points())?)
    }

    /// Every default and constant in place, with the keys of a grid file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.evaluator.plan().to_json().to_string();
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        let plan = self.evaluator.plan();
        let axes: Vec<&str> = plan.axes.iter().map(|axis| axis.parameter.name()).collect();
        let axes = if axes.is_empty() { "no axes".to_owned() } else { axes.join(", ") };
        format!("<washer_sweep.Plan {}: {} points over {axes}>", plan.name, plan.points())
    }
}

/// Natural frequencies over spin speed.
#[pyfunction]
#[pyo3(signature = (plan=None, *, speeds_rpm=None, at=None))]
pub(crate) fn modes(
    py: Python<'_>,
    plan: Option<&Bound<'_, PyPlan>>,
    speeds_rpm: Option<Vec<f64>>,
    at: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyResultTable> {
    let at = assignments(at)?;
    if plan.is_none() && !at.is_empty() {
        return Err(PyTypeError::new_err("`at` needs a plan"));
    }
    let speeds = speeds_rpm.unwrap_or_else(|| (0..=120_u32).map(|k| 10.0 * f64::from(k)).collect());
    let input = plan.map(|plan| plan.get().input.clone());
    let found = abandonable(py, move || sweep::find_modes(input.as_ref(), &at, &speeds))?;
    found.map(PyResultTable::new).map_err(|error| errors::error(py, &error))
}

/// Every number that can be set or swept.
#[pyfunction]
#[pyo3(signature = (plan=None))]
pub(crate) fn parameters<'py>(
    py: Python<'py>,
    plan: Option<&Bound<'py, PyPlan>>,
) -> PyResult<Bound<'py, PyAny>> {
    let text = sweep::list_parameters(plan.map(|plan| plan.get().evaluator.plan()));
    py.import("json")?.call_method1("loads", (text,))
}

const fn mode(progress: bool) -> ProgressMode {
    if progress { ProgressMode::Auto } else { ProgressMode::None }
}

/// The rows, or those that were computed before Ctrl-C.
fn whole(
    py: Python<'_>,
    evaluated: crate::work::Attended<Result<Evaluated, Error>>,
) -> PyResult<PyResultTable> {
    let evaluated = evaluated.or_raise(py, |evaluated| match evaluated {
        Err(error) => errors::error(py, &error),
        Ok(evaluated) => {
            let rows = evaluated.table.rows();
            let text = format!("interrupted; `result` of this exception holds {rows} rows");
            holding(py, text, Some(PyResultTable::new(evaluated.table)))
        }
    })?;
    let evaluated = evaluated.map_err(|error| errors::error(py, &error))?;
    Ok(PyResultTable::new(evaluated.table))
}

/// An interruption that holds what was computed.
fn holding(py: Python<'_>, text: String, result: Option<PyResultTable>) -> PyErr {
    match result.map(|result| Py::new(py, result)).transpose() {
        Ok(result) => {
            let result = result.map_or_else(|| py.None(), Py::into_any);
            errors::interrupted(py, text, result)
        }
        Err(error) => error,
    }
}

/// `NAME=VALUE` of each entry; numbers in the shortest form that reads back to the same bits.
fn assignments(values: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<String>> {
    let one = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name: String = name.extract()?;
        let value: f64 = value.extract().map_err(|_| {
            let found = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
            PyTypeError::new_err(format!("`{name}`: expected a number, got `{found}`"))
        })?;
        Ok(format!("{name}={value:?}"))
    };
    values.map_or_else(|| Ok(Vec::new()), |values| values.iter().map(one).collect())
}

/// A dictionary as the text of a grid file.
fn toml(grid: &Bound<'_, PyDict>) -> PyResult<String> {
    let mut text = String::new();
    let mut tables = String::new();
    for (key, value) in grid.iter() {
        let name: String = key.extract()?;
        let key = quoted(&name);
        if let Ok(table) = value.cast::<PyDict>() {
            tables.push_str(&format!("\n[{key}]\n{}", pairs(table)?));
        } else if let Some(listed) = tables_of(&value) {
            for table in listed {
                tables.push_str(&format!("\n[[{key}]]\n{}", pairs(&table)?));
            }
        } else {
            text.push_str(&format!("{key} = {}\n", toml_value(&name, &value)?));
        }
    }
    Ok(text + &tables)
}

/// The dictionaries of a list that holds nothing else, and at least one.
fn tables_of<'py>(value: &Bound<'py, PyAny>) -> Option<Vec<Bound<'py, PyDict>>> {
    let list = value.cast::<PyList>().ok()?;
    let tables: Option<Vec<_>> =
        list.iter().map(|entry| entry.cast_into::<PyDict>().ok()).collect();
    tables.filter(|tables| !tables.is_empty())
}

fn pairs(table: &Bound<'_, PyDict>) -> PyResult<String> {
    let mut text = String::new();
    for (key, value) in table.iter() {
        let key: String = key.extract()?;
        text.push_str(&format!("{} = {}\n", quoted(&key), toml_value(&key, &value)?));
    }
    Ok(text)
}

/// A value in one line.
fn toml_value(key: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(string(&text.to_string()));
    }
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(flag.to_string());
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let entries = table.iter().map(|(name, value)| {
            let name: String = name.extract()?;
            Ok(format!("{} = {}", quoted(&name), toml_value(&name, &value)?))
        });
        return Ok(format!("{{ {} }}", entries.collect::<PyResult<Vec<_>>>()?.join(", ")));
    }
    // Before numbers: an array of NumPy's with one value passes for a number.
    if let Ok(entries) = value.try_iter() {
        let entries = entries.map(|entry| toml_value(key, &entry?));
        return Ok(format!("[{}]", entries.collect::<PyResult<Vec<_>>>()?.join(", ")));
    }
    if let Ok(number) = value.extract::<i64>() {
        return Ok(number.to_string());
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(string(&path.display().to_string()));
    }
    let found = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
    Err(PyTypeError::new_err(format!("`{key}`: a grid holds no `{found}`")))
}

/// As TOML writes numbers: `nan` and `inf` too, which are then refused at their place.
fn float(number: f64) -> String {
    match number {
        number if number.is_nan() => "nan".to_owned(),
        number if number.is_infinite() => {
            if number > 0.0 {
                "inf".to_owned()
            } else {
                "-inf".to_owned()
            }
        }
        number => format!("{number:?}"),
    }
}

fn quoted(key: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !key.is_empty() && key.chars().all(is_bare) { key.to_owned() } else { string(key) }
}

/// A string of TOML, whose escapes are those of JSON.
fn string(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
