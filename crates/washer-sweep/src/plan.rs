//! The class `Plan`: a grid that was read and checked, with methods that evaluate it.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyString};
use sweep::{
    BoundaryOptions, PlanEvaluator, TraceExtras, TraceOptions, WasherGridInput, format_count,
};

use crate::computation::{ComputationOptions, supervise, supervise_abandonable};
use crate::mappings::{self, to_assignments};
use crate::result::PyResultTable;
use crate::{columns, errors, finish};

/// The name of a plan without a file and without a name.
const DEFAULT_PLAN_NAME: &str = "plan";

/// A validated plan.
#[pyclass(name = "Plan", module = "washer_sweep", frozen)]
pub(crate) struct PyPlan {
    pub(crate) input: WasherGridInput,
    pub(crate) evaluator: PlanEvaluator,
    source: PlanSource,
}

/// The source of a plan, from which another process can read it again.
#[derive(Clone)]
struct PlanSource {
    /// The text of a grid file, or the absolute path of one.
    text: String,
    is_file: bool,
    constants: Vec<String>,
}

impl PlanSource {
    fn to_input(&self) -> WasherGridInput {
        match self.is_file {
            true => WasherGridInput::file(self.text.clone().into(), self.constants.clone()),
            false => {
                WasherGridInput::text(DEFAULT_PLAN_NAME, self.text.clone(), self.constants.clone())
            }
        }
    }
}

impl PyPlan {
    fn load(py: Python<'_>, input: WasherGridInput, source: PlanSource) -> PyResult<Self> {
        let plan = py.detach(|| input.load()).map_err(|error| errors::plan_error(py, &error))?;
        Ok(Self { input, evaluator: PlanEvaluator::new(plan), source })
    }
}

#[pymethods]
impl PyPlan {
    /// Creates a plan from a mapping with the keys of a grid file.
    #[new]
    #[pyo3(signature = (grid, *, set=None))]
    fn new(grid: &Bound<'_, PyMapping>, set: Option<&Bound<'_, PyMapping>>) -> PyResult<Self> {
        let py = grid.py();
        let text = mappings::to_grid_text(grid)?;
        let constants = to_assignments(set)?;
        let source = PlanSource { text, is_file: false, constants };
        Self::load(py, source.to_input(), source)
    }

    /// Reads a plan from a grid file, or from the text of one.
    ///
    /// A string with a line break or `=` is a text. `set` overrides constants by their names, in
    /// the unit with which each name ends, such as `unbalance_mass_kg`. Raises `PlanError` with all
    /// mistakes.
    #[staticmethod]
    #[pyo3(signature = (source, *, set=None))]
    fn from_toml(source: &Bound<'_, PyAny>, set: Option<&Bound<'_, PyMapping>>) -> PyResult<Self> {
        let py = source.py();
        let constants = to_assignments(set)?;
        // The text of a grid file has a line break or an assignment, and a path has neither.
        let text = source.cast::<PyString>().ok().map(|text| text.to_string());
        let text = text.filter(|text| text.contains('\n') || text.contains('='));
        let (input, source) = match text {
            Some(text) => {
                let source = PlanSource { text, is_file: false, constants };
                (source.to_input(), source)
            }
            None => {
                let path: PathBuf = source.extract()?;
                // The path is made absolute because another process may work in another folder.
                let absolute_path = std::path::absolute(&path).unwrap_or_else(|_| path.clone());
                let text = absolute_path.to_string_lossy().into_owned();
                let source = PlanSource { text, is_file: true, constants: constants.clone() };
                (WasherGridInput::file(path, constants), source)
            }
        };
        Self::load(py, input, source)
    }

    /// Creates a plan that another process has pickled.
    #[staticmethod]
    fn _unpickled(
        py: Python<'_>,
        text: String,
        is_file: bool,
        constants: Vec<String>,
    ) -> PyResult<Self> {
        let source = PlanSource { text, is_file, constants };
        Self::load(py, source.to_input(), source)
    }

    /// Returns the function and the arguments by which pickle creates the plan again: from its
    /// text, or from its file, which has to exist with all files that it names.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (String, bool, Vec<String>))> {
        let constructor = py.get_type::<Self>().getattr("_unpickled")?;
        let PlanSource { text, is_file, constants } = self.source.clone();
        Ok((constructor, (text, is_file, constants)))
    }

    /// Evaluates both models at each row of a table. The result's rows are in the same order.
    ///
    /// The table has n rows and a column of n numbers for each axis of the plan, in the unit with
    /// which its name ends; an axis with a single value may be left out. The result has n rows, and
    /// `result.units` has the unit of each of its columns. `threads` is the number of threads, by
    /// default one for each core; `progress` shows the progress. Every value has to lie between the
    /// least and the greatest value of its axis, because the steps of the method are chosen for the
    /// ranges of the axes. A row of the result therefore depends on the plan and on its own values
    /// alone, and has the bits of a run with this point.
    ///
    /// Raises `PlanError` for columns and values that do not fit, before the computation, and
    /// `Interrupted` on Ctrl-C.
    #[pyo3(signature = (table, *, threads=None, progress=false))]
    fn evaluate(
        &self,
        table: &Bound<'_, PyAny>,
        threads: Option<usize>,
        progress: bool,
    ) -> PyResult<PyResultTable> {
        let py = table.py();
        let points = columns::read_points(table)?;
        let evaluation = supervise(py, ComputationOptions { threads, progress }, |execution| {
            self.evaluator.evaluate(&points, execution)
        })?;
        finish::rows_or_raise(py, evaluation)
    }

    /// Evaluates both models at every point of the grid.
    ///
    /// The result has a row for each point, in grid order: the first axis varies slowest. `threads`
    /// is the number of threads, by default one for each core.
    ///
    /// With `out` it also writes a Parquet file, byte for byte as `sweep run` does. An interrupted
    /// run keeps its rows beside the file, and the same call continues it; `fresh` starts over.
    #[pyo3(signature = (out=None, *, threads=None, progress=true, fresh=false))]
    fn run(
        &self,
        py: Python<'_>,
        out: Option<PathBuf>,
        threads: Option<usize>,
        progress: bool,
        fresh: bool,
    ) -> PyResult<PyResultTable> {
        finish::rows_or_file(
            py,
            self.evaluator.task_for_all_points(),
            (out, fresh),
            ComputationOptions { threads, progress },
        )
    }

    /// Computes time histories of both models at one point, every `every` s, or with `turns`
    /// once a turn.
    ///
    /// The result has a row for each instant, with `time_s` in s, displacements in m and angles in
    /// rad. `at` gives a value to each axis, and to any other parameter, in the unit with which its
    /// name ends. With `all` it gives values to some axes only, and every point with these values
    /// has a history, in one table with the columns `point` and the axes. `model` restricts the
    /// table to the `nonlinear` or the `linear` model. `rates` adds rates and accelerations of the
    /// channels, `states` the ten coordinates and their speeds, `forces` the forces of springs,
    /// dampers, stops, bushings and feet, and `angle` the drum's angle. `start` gives the initial
    /// state: deviations q1 to q10 (m, rad) and speeds u1 to u10 (per s). If a model fails, a
    /// warning says so, and its values are null from then on.
    #[pyo3(signature = (
        at=None, *, all=false, model=None, every=0.01, turns=false, rates=false, states=false,
        forces=false, angle=false, start=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn trace(
        &self,
        py: Python<'_>,
        at: Option<&Bound<'_, PyMapping>>,
        all: bool,
        model: Option<String>,
        every: f64,
        turns: bool,
        rates: bool,
        states: bool,
        forces: bool,
        angle: bool,
        start: Option<&Bound<'_, PyMapping>>,
    ) -> PyResult<PyResultTable> {
        let point_assignments = to_assignments(at)?;
        let start_assignments = to_assignments(start)?;
        let every_s = (!turns).then_some(every);
        let extras = TraceExtras { rates, states, forces, angle };
        let options = TraceOptions { every_s, model, all, extras, start: start_assignments };
        let input = self.input.clone();
        let (table, failures) = supervise_abandonable(py, None, move |execution| {
            sweep::trace_point(&input, &point_assignments, &options, execution.interrupt)
        })?;
        for failure in failures {
            py.import("warnings")?.call_method1("warn", (failure,))?;
        }
        Ok(PyResultTable::new(table))
    }

    /// Traces the curve on which a quantity is at its limit, over the first two axes.
    ///
    /// `quantity` is a column of numbers of this plan's rows for which greater or lesser values are
    /// worse, or an expression of columns as in `sweep require`. `limit` is in the column's unit;
    /// by default it is the column's own. `tolerance` is the width of the final brackets, in the
    /// unit of the second axis. `lattice` is the number of cells along each axis that are searched
    /// first. The result has a row for each crossing, and one for each line without any. With `out`
    /// the search writes that file, and the same call continues it after an interruption.
    #[pyo3(signature = (
        quantity="ratio_max", *, limit=None, tolerance=None, lattice=6, out=None, threads=None,
        progress=true, fresh=false
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn boundary(
        &self,
        py: Python<'_>,
        quantity: &str,
        limit: Option<f64>,
        tolerance: Option<f64>,
        lattice: u16,
        out: Option<PathBuf>,
        threads: Option<usize>,
        progress: bool,
        fresh: bool,
    ) -> PyResult<PyResultTable> {
        let output = out.as_deref();
        let quantity = quantity.to_owned();
        let options = BoundaryOptions { quantity, limit, tolerance, lattice };
        let search_result = supervise(py, ComputationOptions { threads, progress }, |execution| {
            sweep::find_boundary(self.evaluator.plan(), &options, output, fresh, execution)
        })?;
        finish::table_or_raise(py, search_result, || {
            let text = match output {
                Some(out) => format!(
                    "interrupted; the results so far are kept beside {}, and the same call \
                     continues the search",
                    out.display()
                ),
                None => "interrupted; with `out` a search keeps its results so far".into(),
            };
            finish::interruption_error(py, text, None)
        })
    }

    /// Returns the name of the plan.
    #[getter]
    fn name(&self) -> &str {
        &self.evaluator.plan().name
    }

    /// Returns the names of the axes with the least and the greatest value of each.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let axes = PyDict::new(py);
        for axis in &self.evaluator.plan().axes {
            axes.set_item(&*axis.parameter.name, <(f64, f64)>::from(axis.values.extremes()))?;
        }
        Ok(axes)
    }

    /// Returns the number of points.
    fn __len__(&self) -> PyResult<usize> {
        Ok(usize::try_from(self.evaluator.plan().points())?)
    }

    /// Returns the plan with the keys of a grid file, with all defaults and constants.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.evaluator.plan().to_json().to_string();
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        let plan = self.evaluator.plan();
        let axes: Vec<&str> = plan.axes.iter().map(|axis| &*axis.parameter.name).collect();
        let axes = if axes.is_empty() { "no axes".to_owned() } else { axes.join(", ") };
        let points_text = format_count(plan.points() as usize, "point");
        format!("<washer_sweep.Plan {}: {points_text} over {axes}>", plan.name)
    }
}
