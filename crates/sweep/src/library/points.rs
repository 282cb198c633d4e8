//! Points in memory: tables whose columns are parameters and whose rows are points.

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, Float64Array, RecordBatch};
use arrow_schema::Schema;

use crate::config::{Diagnostics, check_columns, not_numbers_mistake};
use crate::plan::Plan;
use sweep_engine::config::list::is_index_column;
use sweep_files::cells;

/// A table of points, column by column.
#[derive(Clone, Debug)]
pub struct PointTable {
    names: Vec<String>,
    columns: Vec<Float64Array>,
    row_count: usize,
}

impl PointTable {
    /// Creates a table from record batches of a schema.
    ///
    /// # Errors
    /// Returns [`Diagnostics`] for a column that has no numbers.
    pub fn new(schema: &Schema, batches: &[RecordBatch]) -> Result<Self, Diagnostics> {
        // Filtered or sorted data frames have an index column, which is ignored.
        let is_data_column = |k: &usize| !is_index_column(schema.field(*k).name());
        let data_column_indices: Vec<usize> =
            (0..schema.fields().len()).filter(is_data_column).collect();
        let names: Vec<String> =
            data_column_indices.iter().map(|k| schema.field(*k).name().clone()).collect();
        let mut columns = Vec::with_capacity(names.len());
        for (position, k) in data_column_indices.into_iter().enumerate() {
            let field = schema.field(k);
            let not_numbers_error =
                || not_numbers_mistake(&names, position, &field.data_type().to_string());
            if !cells::is_number(field.data_type()) {
                return Err(not_numbers_error());
            }
            // A single batch without nulls is shared, not copied, because tables may fill the
            // memory.
            if let [batch] = batches
                && let Some(column) = batch.column(k).as_primitive_opt::<Float64Type>()
                && column.null_count() == 0
            {
                columns.push(column.clone());
                continue;
            }
            let batch_columns = batches.iter().map(|batch| cells::numbers(batch.column(k)));
            let column_parts =
                batch_columns.collect::<Result<Vec<_>, _>>().map_err(|_| not_numbers_error())?;
            columns.push(column_parts.concat().into());
        }
        Ok(Self { names, columns, row_count: batches.iter().map(RecordBatch::num_rows).sum() })
    }

    /// Creates a table from named columns of equal length.
    ///
    /// # Errors
    /// Returns [`Diagnostics`] for a column of another length than the first.
    pub fn from_columns(columns: Vec<(String, Vec<f64>)>) -> Result<Self, Diagnostics> {
        let row_count = columns.first().map_or(0, |(_, values)| values.len());
        let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
        if let Some(k) = columns.iter().position(|(_, values)| values.len() != row_count) {
            return Err(crate::config::wrong_length_mistake(
                &names,
                k,
                columns[k].1.len(),
                row_count,
            ));
        }
        let columns = columns.into_iter().map(|(_, values)| values.into()).collect();
        Ok(Self { names, columns, row_count })
    }

    /// Returns the number of points.
    pub fn rows(&self) -> usize {
        self.row_count
    }

    /// Returns the columns with their names; a missing value is NaN.
    pub(super) fn into_columns(self) -> Vec<(String, Vec<f64>)> {
        let values_or_nan = |column: &Float64Array| -> Vec<f64> {
            column.iter().map(|value| value.unwrap_or(f64::NAN)).collect()
        };
        self.names.iter().cloned().zip(self.columns.iter().map(values_or_nan)).collect()
    }

    /// Assigns the columns to the axes of a plan.
    ///
    /// # Errors
    /// Returns a mistake for every column that is missing, unknown or no axis of the plan, and for
    /// every value outside of its axis.
    pub(super) fn assign_to_axes<'a>(
        &'a self,
        plan: &'a Plan,
    ) -> Result<PointsOnAxes<'a>, Diagnostics> {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let columns = check_columns(plan, &names, |column| self.columns[column].iter())?;
        Ok(PointsOnAxes { table: self, plan, column_by_axis: columns })
    }
}

/// The points of a table as points of a plan.
pub(super) struct PointsOnAxes<'a> {
    table: &'a PointTable,
    plan: &'a Plan,
    /// The column of each axis; `None` for an axis with one value that the table omits.
    column_by_axis: Vec<Option<usize>>,
}

impl PointsOnAxes<'_> {
    /// Returns the values of the axes at a point.
    pub(super) fn axis_values(&self, point: u64) -> Vec<f64> {
        // The index of a row always fits into `usize`.
        let row = usize::try_from(point).unwrap_or(usize::MAX);
        let axis_value = |(axis, column): (&crate::plan::Axis, &Option<usize>)| match column {
            Some(column) => self.table.columns[*column].value(row),
            None => axis.values.value(0),
        };
        self.plan.axes.iter().zip(&self.column_by_axis).map(axis_value).collect()
    }

    /// Returns the hexadecimal BLAKE3 hash of the values, row by row.
    pub(super) fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for row in 0..self.table.row_count as u64 {
            for value in self.axis_values(row) {
                hasher.update(&value.to_bits().to_le_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Int64Array};

    use super::*;

    #[test]
    fn the_index_of_a_data_frame_is_no_column() {
        let mass_array: ArrayRef = Arc::new(Float64Array::from(vec![0.3, 0.5]));
        let index_array: ArrayRef = Arc::new(Int64Array::from(vec![7, 2]));
        let columns = [("unbalance_mass_kg", mass_array), ("__index_level_0__", index_array)];
        let batch = RecordBatch::try_from_iter(columns).expect("it is whole");
        let table = PointTable::new(&batch.schema(), &[batch]).expect("it holds numbers");
        assert_eq!(table.names, ["unbalance_mass_kg"]);
        assert_eq!(table.rows(), 2);
    }
}
