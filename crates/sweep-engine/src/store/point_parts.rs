//! The parts of a run. Each has the rows of a chunk, or of some of its points if the process was
//! interrupted.
//!
//! A part has the columns of the result, then the columns that only a resumed run needs, and, if it
//! differs from the point, the number by which the engine identifies a row.

use std::ops::Range;

use arrow_array::RecordBatch;
use serde_json::{Value, json};

use super::part::{Part, PartDamage, PartError, PartSchema};
use super::read::{NameCounts, count_name};
use super::schema::{CellType, POINT_COLUMN};
use super::{
    DeclaredColumn, Folder, Job, Layout, PointRows, RowCells, StoreError, chunk_points, part_name,
};

/// The name of the column of the numbers by which the engine identifies rows.
const ROW_INDEX_COLUMN: &str = "row_index";

/// The maximum number of rows of a point. Basis: `sweep dwell` can return 256 states of each of 32
/// motions. Doubling it doubles the memory that a part may take.
const MAX_ROWS_PER_POINT: usize = 32 * 256;

/// The schema of a run's parts, and the division of its points into chunks.
#[derive(Clone, Debug)]
pub(super) struct PointParts {
    part_schema: PartSchema,
    layout: Layout,
    /// The position of each of the model's columns in a part.
    column_positions: Vec<usize>,
    points: u64,
    chunk_points: u64,
}

impl PointParts {
    /// Returns the schema and the chunks of a job.
    pub(super) fn new(job: &Job<'_>) -> Self {
        let layout = job.layout.clone();
        let is_in_parts_only = |column: &&DeclaredColumn| column.cell_type == CellType::Kept;
        let mut columns: Vec<DeclaredColumn> = layout.all_columns().cloned().collect();
        let mut next_result_position = 1 + layout.axes.len();
        let mut next_part_position = columns.len();
        let mut column_positions = Vec::with_capacity(layout.columns.len());
        for column in &layout.columns {
            let next_position = if is_in_parts_only(&column) {
                &mut next_part_position
            } else {
                &mut next_result_position
            };
            column_positions.push(*next_position);
            *next_position += 1;
        }
        columns.extend(layout.columns.iter().filter(is_in_parts_only).cloned());
        if layout.tasks_per_point > 1 {
            let description = "number that an unfinished run knows the row by";
            columns.push(DeclaredColumn::new(ROW_INDEX_COLUMN, "1", description, CellType::Count));
        }
        let part_schema = PartSchema::new(job, columns);
        let chunk_points = chunk_points(job.points);
        Self { part_schema, layout, column_positions, points: job.points, chunk_points }
    }

    /// Returns the number of chunks of the whole run.
    pub(super) const fn chunk_count(&self) -> u64 {
        self.points.div_ceil(self.chunk_points)
    }

    /// Returns the points of a chunk.
    pub(super) fn chunk_range(&self, chunk: u64) -> Range<u64> {
        let first_point = chunk.saturating_mul(self.chunk_points).min(self.points);
        first_point..first_point.saturating_add(self.chunk_points).min(self.points)
    }

    /// Returns the chunk that a point is in.
    pub(super) const fn chunk_of(&self, point: u64) -> u64 {
        point / self.chunk_points
    }

    /// Returns the entry in a part's metadata that gives its chunk.
    fn part_entry(&self, chunk: u64) -> String {
        let Range { start, end } = self.chunk_range(chunk);
        json!({ "index": chunk, "from": start, "to": end }).to_string()
    }

    /// Encodes rows of a chunk, in the order of their points.
    ///
    /// # Errors
    /// [`StoreError::Engine`] if the rows are not of this chunk.
    pub(super) fn encode(
        &self,
        job: &Job<'_>,
        chunk: u64,
        point_rows_list: &[PointRows],
    ) -> Result<Vec<u8>, StoreError> {
        let points = self.chunk_range(chunk);
        let engine_error = |reason: String| StoreError::Engine {
            first: points.start,
            last: points.end.saturating_sub(1),
            reason,
        };
        if !are_ordered(&points, point_rows_list.iter().map(|outcome| outcome.point)) {
            return Err(engine_error(format!(
                "{} outcomes that are not of its points",
                point_rows_list.len()
            )));
        }
        let columns = &self.layout.columns;
        let mut rows = Vec::with_capacity(point_rows_list.len());
        for PointRows { point, rows: point_rows } in point_rows_list {
            if point_rows.is_empty() || point_rows.len() > MAX_ROWS_PER_POINT {
                let count = point_rows.len();
                return Err(engine_error(format!(
                    "point {point}: {count} rows of {MAX_ROWS_PER_POINT}"
                )));
            }
            let axis_values: Vec<f64> = (job.axis_values)(*point);
            for cells in point_rows {
                let is_valid_row = cells.len() == columns.len()
                    && columns.iter().zip(cells).all(|(column, cell)| column.accepts_cell(*cell));
                if !is_valid_row {
                    return Err(engine_error(format!("point {point}: a row that does not fit")));
                }
                rows.push(self.part_row(*point, &axis_values, cells));
            }
        }
        let bytes = self.part_schema.encode(&self.part_entry(chunk), &rows);
        bytes.map_err(|error| engine_error(error.to_string()))
    }

    /// Returns a row with a cell for each column of a part.
    fn part_row(&self, point: u64, axis_values: &[f64], cells: &RowCells) -> RowCells {
        let mut row: RowCells = vec![None; self.part_schema.column_count()];
        row[0] = Some(point / self.layout.tasks_per_point);
        for (cell, value) in row[1..].iter_mut().zip(axis_values).take(self.layout.axes.len()) {
            *cell = Some(value.to_bits());
        }
        for (position, cell) in self.column_positions.iter().zip(cells) {
            row[*position] = *cell;
        }
        if self.layout.tasks_per_point > 1 {
            row[self.number_column_position()] = Some(point);
        }
        row
    }

    /// Opens the part of a chunk; `None` if there is no file.
    pub(super) fn open(
        &self,
        folder: &Folder,
        chunk: u64,
    ) -> Result<Option<PointPart<'_>>, PartError> {
        let path = folder.file(part_name(chunk));
        let Some(part) = self.part_schema.open(&path, &self.part_entry(chunk))? else {
            return Ok(None);
        };
        let range = self.chunk_range(chunk);
        let max_rows = (range.end - range.start).saturating_mul(MAX_ROWS_PER_POINT as u64);
        if part.row_count() > max_rows {
            return Err(PartDamage::Rows.into());
        }
        let row_numbers = part.read_cells(&[self.number_column_position()])?;
        let mut points: Vec<u64> = row_numbers.into_iter().filter_map(|row| row[0]).collect();
        if self.layout.has_several_rows {
            points.dedup();
        }
        if !are_ordered(&range, points.iter().copied()) {
            return Err(PartDamage::Rows.into());
        }
        Ok(Some(PointPart { parts: self, part, points }))
    }

    /// Returns the position of the column of the numbers by which the engine identifies rows.
    const fn number_column_position(&self) -> usize {
        if self.layout.tasks_per_point > 1 { self.part_schema.column_count() - 1 } else { 0 }
    }
}

/// Returns whether points are within a range, each once and in order.
fn are_ordered(range: &Range<u64>, points: impl Iterator<Item = u64> + Clone) -> bool {
    points.clone().all(|point| range.contains(&point)) && points.is_sorted_by(|a, b| a < b)
}

/// An open part of a run.
#[derive(Debug)]
pub(super) struct PointPart<'a> {
    parts: &'a PointParts,
    part: Part<'a>,
    /// The points whose rows are in the part.
    points: Vec<u64>,
}

impl PointPart<'_> {
    /// Returns the number of points.
    pub(super) const fn point_count(&self) -> u64 {
        self.points.len() as u64
    }

    /// Reads the points with their rows.
    pub(super) fn read_point_rows(&self) -> Result<Vec<PointRows>, PartError> {
        let column_positions =
            [&[self.parts.number_column_position()], &self.parts.column_positions[..]].concat();
        let mut point_rows_list: Vec<PointRows> = Vec::with_capacity(self.points.len());
        for mut row in self.part.read_cells(&column_positions)? {
            let cells = row.split_off(1);
            let point = row[0].unwrap_or_default();
            match point_rows_list.last_mut() {
                Some(last) if last.point == point => last.rows.push(cells),
                _ => point_rows_list.push(PointRows { point, rows: vec![cells] }),
            }
        }
        Ok(point_rows_list)
    }

    /// Counts rows by status.
    pub(super) fn add_status_counts(&self, counts: &mut NameCounts) -> Result<(), PartError> {
        let PointParts { layout, column_positions, .. } = self.parts;
        let Some(status_column) = layout.position("status") else { return Ok(()) };
        let CellType::Name(names) = &layout.columns[status_column].cell_type else { return Ok(()) };
        for row in self.part.read_cells(&[column_positions[status_column]])? {
            let name = row[0].and_then(|name| names.get(name as usize));
            name.into_iter().for_each(|name| count_name(counts, name));
        }
        Ok(())
    }

    /// Reads the rows in the columns of the result.
    pub(super) fn read_result_batches(&self) -> Result<Vec<RecordBatch>, PartError> {
        self.part.read_batches((0..self.parts.layout.all_columns().count()).collect())
    }
}

/// Returns whether the entry in a part's metadata is that of a run, not of a search.
pub(super) fn is_part_of_run(entry: &str) -> bool {
    serde_json::from_str::<Value>(entry).is_ok_and(|entry| entry["from"].is_u64())
}

/// Returns the name of the column that numbers the rows of a part: points, or tasks if a point has
/// several. `has` returns whether the part has a column.
pub(super) fn row_number_column(has: impl Fn(&str) -> bool) -> &'static str {
    if has(ROW_INDEX_COLUMN) { ROW_INDEX_COLUMN } else { POINT_COLUMN }
}
