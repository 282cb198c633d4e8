//! Arrow's C stream in capsules, as Python's libraries hand tables to each other
//! (<https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html>). No row is
//! copied: who takes a stream holds the buffers of whoever made it.

// A capsule is a pointer; what is behind it is settled by its name alone.
#![expect(unsafe_code)]

use std::ffi::CStr;

use arrow_array::ffi::FFI_ArrowSchema;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::{RecordBatch, RecordBatchIterator};
use arrow_schema::{ArrowError, SchemaRef};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

const STREAM: &CStr = c"arrow_array_stream";
const SCHEMA: &CStr = c"arrow_schema";

/// The rows as a stream.
pub(crate) fn stream<'py>(
    py: Python<'py>,
    schema: &SchemaRef,
    batches: &[RecordBatch],
) -> PyResult<Bound<'py, PyCapsule>> {
    let batches: Vec<Result<RecordBatch, ArrowError>> = batches.iter().cloned().map(Ok).collect();
    let reader = RecordBatchIterator::new(batches, SchemaRef::clone(schema));
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), STREAM)
}

/// The schema alone.
pub(crate) fn schema<'py>(py: Python<'py>, schema: &SchemaRef) -> PyResult<Bound<'py, PyCapsule>> {
    let schema = FFI_ArrowSchema::try_from(schema.as_ref()).map_err(wrong)?;
    PyCapsule::new_with_value(py, schema, SCHEMA)
}

/// Every row of a table that speaks the protocol, with its schema; `None` for one that does not.
pub(crate) fn rows(table: &Bound<'_, PyAny>) -> PyResult<Option<(SchemaRef, Vec<RecordBatch>)>> {
    let Some(speaks) = table.getattr_opt("__arrow_c_stream__")? else { return Ok(None) };
    let capsule = speaks.call0()?;
    let capsule = capsule.cast::<PyCapsule>().map_err(|_| {
        PyTypeError::new_err("`__arrow_c_stream__` of this table returns no capsule")
    })?;
    let pointer = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: A capsule of this name holds a stream by the protocol. `from_raw` moves it out and
    // leaves an empty one, which the capsule's destructor knows.
    let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) }.map_err(wrong)?;
    let schema = arrow_array::RecordBatchReader::schema(&reader);
    let batches = reader.collect::<Result<Vec<_>, _>>().map_err(wrong)?;
    Ok(Some((schema, batches)))
}

fn wrong(error: ArrowError) -> PyErr {
    PyValueError::new_err(format!("this table's Arrow stream is broken: {error}"))
}
