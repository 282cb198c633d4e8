//! The class `Result`: a table of rows that libraries read by Arrow's C stream.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::ArrayRef;
use arrow_array::cast::AsArray as _;
use arrow_array::types::UInt64Type;
use arrow_schema::{DataType, Field};
use pyo3::exceptions::{PyKeyError, PyOSError};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyCapsule, PyDict, PyList};
use sweep::{MemoryTable, format_count};
use sweep_files::{FileKind, cells};

use crate::arrow;
use crate::errors;

/// A result in memory.
#[pyclass(name = "Result", module = "washer_sweep", frozen)]
pub(crate) struct PyResultTable(Arc<MemoryTable>);

impl PyResultTable {
    pub(crate) fn new(table: MemoryTable) -> Self {
        Self(Arc::new(table))
    }

    fn field(&self, name: &str) -> PyResult<&Field> {
        self.0.schema().field_with_name(name).map_err(|_| {
            let valid_names: Vec<&str> =
                self.0.schema().fields().iter().map(|field| field.name().as_str()).collect();
            PyKeyError::new_err(format!("no column `{name}`; there are {}", valid_names.join(", ")))
        })
    }

    /// Whether the rows are points of a table that do not form a full grid, so that a map of them
    /// would be mostly empty.
    fn is_scattered(&self) -> bool {
        let plan = self.0.plan();
        if self.0.kind() != FileKind::Map || plan["design"].is_null() {
            return false;
        }
        let axes = plan["axis"].as_array().map_or(&[][..], Vec::as_slice);
        let distinct_counts =
            axes.iter().filter_map(|axis| axis["parameter"].as_str()).map(|name| {
                let column_chunks =
                    self.0.batches().iter().filter_map(|batch| batch.column_by_name(name));
                let values =
                    column_chunks.flat_map(|chunk| cells::numbers(chunk).unwrap_or_default());
                values.map(|value| value.map(f64::to_bits)).collect::<HashSet<_>>().len()
            });
        distinct_counts.product::<usize>() != self.0.rows()
    }

    /// Returns an entry of the metadata of every column.
    fn column_metadata<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let metadata_by_column = PyDict::new(py);
        for field in self.0.schema().fields() {
            metadata_by_column.set_item(field.name(), field.metadata().get(key))?;
        }
        Ok(metadata_by_column)
    }
}

#[pymethods]
impl PyResultTable {
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The protocol allows a producer to ignore the requested schema.
        drop(requested_schema);
        arrow::to_stream_capsule(py, self.0.schema(), self.0.batches())
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        arrow::to_schema_capsule(py, self.0.schema())
    }

    fn __len__(&self) -> usize {
        self.0.rows()
    }

    fn __contains__(&self, name: &str) -> bool {
        self.field(name).is_ok()
    }

    /// Returns a column as a NumPy array.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let field = self.field(name)?;
        let column_chunks: Vec<&ArrayRef> =
            self.0.batches().iter().filter_map(|batch| batch.column_by_name(name)).collect();
        let numpy = py.import("numpy")?;
        let (bytes, kind) = match field.data_type() {
            DataType::UInt64 => {
                let counts = column_chunks
                    .iter()
                    .flat_map(|chunk| chunk.as_primitive::<UInt64Type>().values());
                (counts.flat_map(|count| count.to_ne_bytes()).collect::<Vec<u8>>(), "uint64")
            }
            number if cells::is_number(number) => {
                let values = column_chunks
                    .iter()
                    .flat_map(|chunk| cells::numbers(chunk).unwrap_or_default());
                (
                    values.flat_map(|value| value.unwrap_or(f64::NAN).to_ne_bytes()).collect(),
                    "float64",
                )
            }
            _ => {
                let values = PyList::empty(py);
                for chunk in column_chunks {
                    append_cells(&values, chunk)?;
                }
                let options = PyDict::new(py);
                options.set_item("dtype", "object")?;
                return numpy.call_method("array", (values,), Some(&options));
            }
        };
        numpy.call_method1("frombuffer", (PyByteArray::new(py, &bytes), kind))
    }

    /// Returns the names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.0.schema().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// Returns the unit of each column.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.column_metadata(py, "unit")
    }

    /// Returns the description of each column.
    #[getter]
    fn descriptions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.column_metadata(py, "description")
    }

    /// Returns the kind of the result, such as `"map"`, `"boundary"`, `"trace"` or `"modes"`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind().short_name()
    }

    /// Returns the plan of the result, with the keys of a grid file.
    #[getter]
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.0.plan().to_string(),))
    }

    /// Writes the result as `.parquet`, or a figure of it as `.svg`, `.pdf`, `.png` or `.html`.
    ///
    /// Parquet files have the bytes that the command writes. An existing file is overwritten only
    /// if it has the same kind.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let is_parquet = ending.eq_ignore_ascii_case("parquet");
        py.detach(|| match is_parquet {
            true => self.0.save(&path),
            false => self.0.draw(&path),
        })
        .map_err(|error| errors::to_exception(py, &error))
    }

    /// Draws the figure of `sweep plot` as SVG; `None` for points that do not form a grid, which
    /// have no figure.
    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<Option<String>> {
        if self.is_scattered() {
            return Ok(None);
        }
        let svg = py.detach(|| {
            let folder = tempfile::tempdir()?;
            let path = folder.path().join("figure.svg");
            match self.0.draw(&path) {
                Ok(()) => std::fs::read_to_string(&path).map(Some),
                Err(_) => Ok(None),
            }
        });
        svg.map_err(|error| PyOSError::new_err(format!("cannot draw: {error}")))
    }

    /// Returns the function and the arguments by which pickle creates the result again: from the
    /// bytes of its file.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = in_temporary_file(|path| {
            self.0.save(path).map_err(|error| errors::to_exception(py, &error))?;
            Ok(std::fs::read(path)?)
        })?;
        let constructor = py.get_type::<Self>().getattr("_unpickled")?;
        Ok((constructor, (PyBytes::new(py, &bytes),)))
    }

    /// Creates a result that another process has pickled.
    #[staticmethod]
    fn _unpickled(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        in_temporary_file(|path| {
            std::fs::write(path, bytes)?;
            read(py, path.to_path_buf())
        })
    }

    fn __repr__(&self) -> String {
        let name = self.0.plan()["name"].as_str().unwrap_or("unnamed");
        let kind_name = self.0.kind().short_name();
        let rows = format_count(self.0.rows(), "row");
        let columns = format_count(self.0.schema().fields().len(), "column");
        format!("<washer_sweep.Result: {kind_name} of {name}, {rows}, {columns}>")
    }
}

/// Calls a function with the path of a result file that is deleted afterwards.
fn in_temporary_file<T>(use_file: impl FnOnce(&Path) -> PyResult<T>) -> PyResult<T> {
    let folder = tempfile::tempdir()?;
    use_file(&folder.path().join("result.parquet"))
}

/// Appends flags or words to a list; a null becomes `None`.
fn append_cells(values: &Bound<'_, PyList>, chunk: &ArrayRef) -> PyResult<()> {
    if let Ok(flags) = cells::flags(chunk) {
        return flags.iter().try_for_each(|flag| values.append(flag));
    }
    cells::words(chunk).into_iter().flatten().try_for_each(|word| values.append(word))
}

/// Reads a result file of any kind, and checks its digest.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: PathBuf) -> PyResult<PyResultTable> {
    let table = py.detach(|| MemoryTable::read(&path));
    table.map(PyResultTable::new).map_err(|error| errors::to_exception(py, &error))
}
