//! Reads the cells of a column, of any type of numbers or text: other programs may have rewritten
//! our files.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, Time64MicrosecondType,
    Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, BooleanArray, StringArray, TypedDictionaryArray};
use arrow_schema::{ArrowError, DataType, TimeUnit};

fn unreadable_column_error(array: &dyn Array, expected_type: &str) -> ArrowError {
    ArrowError::SchemaError(format!(
        "expected a column of {expected_type}, found {}",
        array.data_type()
    ))
}

/// Reads numbers of any width, one per row.
///
/// # Errors
/// [`ArrowError::SchemaError`] if the column does not hold integers or floats.
pub fn numbers(array: &dyn Array) -> Result<Vec<Option<f64>>, ArrowError> {
    macro_rules! widened {
        ($type:ty) => {
            // Integers above 2^53 lose digits, as in any program that plots them.
            array.as_primitive::<$type>().iter().map(|cell| cell.map(|cell| cell as f64)).collect()
        };
    }
    Ok(match array.data_type() {
        DataType::Float64 => array.as_primitive::<Float64Type>().iter().collect(),
        DataType::Float32 => widened!(Float32Type),
        DataType::UInt64 => widened!(UInt64Type),
        DataType::UInt32 => widened!(UInt32Type),
        DataType::UInt16 => widened!(UInt16Type),
        DataType::UInt8 => widened!(UInt8Type),
        DataType::Int64 => widened!(Int64Type),
        DataType::Int32 => widened!(Int32Type),
        DataType::Int16 => widened!(Int16Type),
        DataType::Int8 => widened!(Int8Type),
        _ => return Err(unreadable_column_error(array, "numbers")),
    })
}

/// Whether [`numbers`] can read a column of this type.
pub fn is_number(data_type: &DataType) -> bool {
    data_type.is_integer() || matches!(data_type, DataType::Float64 | DataType::Float32)
}

/// Reads instants as seconds since 1970, or times of day as seconds since midnight, one per row.
///
/// # Errors
/// [`ArrowError::SchemaError`] if the column has another type.
pub fn clock_seconds(array: &dyn Array) -> Result<Vec<Option<f64>>, ArrowError> {
    macro_rules! in_seconds {
        ($type:ty, $units:literal) => {
            // Whole seconds come first, because instants in ns have more digits than a number.
            array
                .as_primitive::<$type>()
                .iter()
                .map(|instant| {
                    let instant = instant?;
                    let fraction = instant.rem_euclid($units) as f64 / $units as f64;
                    Some(instant.div_euclid($units) as f64 + fraction)
                })
                .collect()
        };
    }
    Ok(match array.data_type() {
        DataType::Timestamp(TimeUnit::Millisecond, _) => {
            in_seconds!(TimestampMillisecondType, 1_000)
        }
        DataType::Timestamp(TimeUnit::Microsecond, _) => {
            in_seconds!(TimestampMicrosecondType, 1_000_000)
        }
        DataType::Timestamp(TimeUnit::Nanosecond, _) => {
            in_seconds!(TimestampNanosecondType, 1_000_000_000)
        }
        DataType::Time64(TimeUnit::Microsecond) => in_seconds!(Time64MicrosecondType, 1_000_000),
        DataType::Time64(TimeUnit::Nanosecond) => in_seconds!(Time64NanosecondType, 1_000_000_000),
        _ => return Err(unreadable_column_error(array, "instants or times of day")),
    })
}

/// Whether [`clock_seconds`] can read a column of this type, which is one of
/// [`batches::schema_with_clocks`](crate::batches::schema_with_clocks).
pub fn is_clock(data_type: &DataType) -> bool {
    matches!(data_type, DataType::Timestamp(..) | DataType::Time64(_))
}

/// Reads truth values, one per row.
///
/// # Errors
/// [`ArrowError::SchemaError`] if the column has another type.
pub fn flags(array: &dyn Array) -> Result<&BooleanArray, ArrowError> {
    array.as_boolean_opt().ok_or_else(|| unreadable_column_error(array, "true and false"))
}

/// Reads words, one per row. The dictionary has each distinct word once.
///
/// # Errors
/// [`ArrowError::SchemaError`] if the column has another type.
pub fn words(
    array: &dyn Array,
) -> Result<TypedDictionaryArray<'_, Int32Type, StringArray>, ArrowError> {
    let dictionary = array.as_dictionary_opt::<Int32Type>();
    let text_dictionary = dictionary.and_then(|dictionary| dictionary.downcast_dict());
    text_dictionary.ok_or_else(|| unreadable_column_error(array, "words"))
}

/// Whether [`words`] can read a column of this type.
pub fn is_text(data_type: &DataType) -> bool {
    *data_type == DataType::Dictionary(DataType::Int32.into(), DataType::Utf8.into())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float32Array, Int8Array, UInt8Array, UInt64Array};

    use super::*;

    #[test]
    fn numbers_of_every_width_are_read_and_nulls_stay_nulls() {
        let arrays: [ArrayRef; 4] = [
            Arc::new(UInt64Array::from(vec![Some(3), None])),
            Arc::new(Int8Array::from(vec![Some(3), None])),
            Arc::new(UInt8Array::from(vec![Some(3), None])),
            Arc::new(Float32Array::from(vec![Some(3.0), None])),
        ];
        for array in arrays {
            assert!(is_number(array.data_type()));
            assert_eq!(numbers(&array).unwrap(), [Some(3.0), None], "{}", array.data_type());
        }
    }

    #[test]
    fn the_error_for_a_column_of_another_type_names_both_types() {
        let names: ArrayRef = Arc::new(StringArray::from(vec!["ok"]));
        let error = numbers(&names).unwrap_err().to_string();
        assert!(error.contains("numbers") && error.contains("Utf8"), "{error}");
        assert!(flags(&names).is_err() && words(&names).is_err());
        assert!(!is_number(names.data_type()));
    }
}
