//! Tables in capsules with Arrow's C stream, the protocol by which Python libraries exchange them
//! (<https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html>). No row is
//! copied: the consumer of a stream shares the buffers of its producer.

// A capsule is a pointer, whose type is known by the capsule's name alone.
#![expect(unsafe_code)]

use std::ffi::CStr;

use arrow_array::ffi::FFI_ArrowSchema;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::{RecordBatch, RecordBatchIterator};
use arrow_schema::{ArrowError, SchemaRef};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

/// The name of capsules with a stream, which the protocol defines.
const STREAM_CAPSULE_NAME: &CStr = c"arrow_array_stream";
/// The name of capsules with a schema, which the protocol defines.
const SCHEMA_CAPSULE_NAME: &CStr = c"arrow_schema";

/// Returns rows as a stream.
pub(crate) fn to_stream_capsule<'py>(
    py: Python<'py>,
    schema: &SchemaRef,
    batches: &[RecordBatch],
) -> PyResult<Bound<'py, PyCapsule>> {
    let batches: Vec<Result<RecordBatch, ArrowError>> = batches.iter().cloned().map(Ok).collect();
    let reader = RecordBatchIterator::new(batches, SchemaRef::clone(schema));
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), STREAM_CAPSULE_NAME)
}

/// Returns a schema without rows.
pub(crate) fn to_schema_capsule<'py>(
    py: Python<'py>,
    schema: &SchemaRef,
) -> PyResult<Bound<'py, PyCapsule>> {
    let schema = FFI_ArrowSchema::try_from(schema.as_ref()).map_err(stream_error)?;
    PyCapsule::new_with_value(py, schema, SCHEMA_CAPSULE_NAME)
}

/// Reads the schema and all rows of a table; `None` if the table does not support the protocol.
pub(crate) fn read_rows(
    table: &Bound<'_, PyAny>,
) -> PyResult<Option<(SchemaRef, Vec<RecordBatch>)>> {
    let Some(method) = table.getattr_opt("__arrow_c_stream__")? else { return Ok(None) };
    let capsule_object = method.call0()?;
    let capsule = capsule_object.cast::<PyCapsule>().map_err(|_| {
        PyTypeError::new_err("`__arrow_c_stream__` of this table returns no capsule")
    })?;
    let pointer =
        capsule.pointer_checked(Some(STREAM_CAPSULE_NAME))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: A capsule of this name holds a stream by the protocol. `from_raw` moves the stream
    // out and leaves a released one, for which the capsule's destructor does nothing.
    let reader =
        unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) }.map_err(stream_error)?;
    let schema = arrow_array::RecordBatchReader::schema(&reader);
    let batches = reader.collect::<Result<Vec<_>, _>>().map_err(stream_error)?;
    Ok(Some((schema, batches)))
}

fn stream_error(error: ArrowError) -> PyErr {
    PyValueError::new_err(format!("this table's Arrow stream is broken: {error}"))
}
