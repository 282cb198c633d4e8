//! Collects the rows of a map file into the cells of its grid, batch by batch. Memory depends on
//! the number of cells, not of rows.
//!
//! A cell of one point has that point's values. A cell of several points has the worst value of
//! each column: the greatest, or the least where less is worse. It counts its reliable, unreliable
//! and failed points.

use std::collections::BTreeMap;

use super::error::{PlotError, Result};
use super::grid::Grid;
use super::read::{ColumnFacts, FigureFile, FigureRow, is_ratio};
use super::table::{ColumnValues, FigureColumn, FigureTable, NO_WORD, SEVERAL_WORDS, Words};
use sweep_parameter::Worse;

/// The least, the least positive and the greatest finite value of a column over all rows of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValueRange([f64; 3]);

impl ValueRange {
    /// The range of no values.
    const EMPTY: Self = Self([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY]);

    fn add(&mut self, value: f64) {
        let [low, least_positive, high] = &mut self.0;
        if value.is_finite() {
            (*low, *high) = (low.min(value), high.max(value));
            if value > 0.0 {
                *least_positive = least_positive.min(value);
            }
        }
    }

    /// Yields values with the same extremes as all values, and as all positive ones.
    pub(crate) fn values(self) -> impl Iterator<Item = f64> {
        self.0.into_iter().filter(|value| value.is_finite())
    }
}

/// The number of a cell's points of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PointCounts {
    pub(crate) points: u32,
    /// Points whose verdict is reliable.
    pub(crate) reliable_points: u32,
    /// Points whose verdict is unreliable.
    pub(crate) unreliable_points: u32,
    /// Points whose status is not `ok`.
    pub(crate) failed_points: u32,
    /// Points whose motion is chaotic.
    pub(crate) sensitive_points: u32,
}

/// The sides of a limit on which the points of each cell lie.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CellSides {
    /// Whether a cell has points on both sides of the limit.
    pub(crate) is_divided: Vec<bool>,
    /// Whether a cell has points that did not fail and yet have no value.
    pub(crate) has_undefined: Vec<bool>,
    /// The mean of each cell's values; the geometric mean of ratios.
    pub(crate) mean_values: Vec<f64>,
}

/// A map file collected into cells.
#[derive(Debug)]
pub(crate) struct CellMap {
    /// The table with a row for each cell, in grid order.
    pub(crate) table: FigureTable,
    pub(crate) grid: Grid,
    /// The number of points of each kind in each cell.
    pub(crate) point_counts: Vec<PointCounts>,
    /// The range of each column over all rows, and the sides of the column's limit in each cell. A
    /// column without a limit has no sides, and no column has sides if each cell is one point.
    pub(crate) ranges_and_sides: BTreeMap<String, (ValueRange, Option<CellSides>)>,
    /// The number of rows of the file by status.
    pub(crate) rows_by_status: BTreeMap<String, usize>,
}

/// The status of a row whose file has none.
const UNKNOWN_STATUS: &str = "unknown";
/// The status of a point with a result.
pub(crate) const OK_STATUS: &str = "ok";

impl CellMap {
    /// Reads the named columns of a map file into the cells of a grid.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`]; [`PlotError::NotAGrid`] for two rows at one
    /// point.
    pub(crate) fn read(source: FigureFile, grid: Grid, columns: &[String]) -> Result<Self> {
        let column_names = grid.axes.iter().map(|axis| axis.swept_axis.name.as_str());
        let column_names = column_names.chain(["status", "reliable", "sensitive", "ratio_max"]);
        let shown_facts: Vec<&ColumnFacts> =
            source.columns.iter().filter(|column| columns.contains(&column.name)).collect();
        let column_names: Vec<&str> =
            column_names.chain(shown_facts.iter().map(|facts| facts.name.as_str())).collect();
        let mut collector = CellCollector::new(&source, &grid, &shown_facts);
        source.each_row(&column_names, |row| collector.add(row))?;
        let CellCollector { columns, point_counts, rows_by_status, .. } = collector;
        let mut ranges_and_sides = BTreeMap::new();
        let mut figure_columns = Vec::with_capacity(columns.len());
        for CellColumn { facts, mut values, value_range, sides, .. } in columns {
            if let ColumnValues::Words(words) = &mut values {
                words.sort();
            }
            ranges_and_sides
                .insert(facts.name.clone(), (value_range, sides.map(SideCollector::finish)));
            figure_columns.push(FigureColumn { facts: facts.clone(), values });
        }
        let table = FigureTable {
            rows: grid.cell_count(),
            columns: figure_columns,
            source,
            bucket_rows: None,
        };
        Ok(Self { table, grid, point_counts, ranges_and_sides, rows_by_status })
    }

    /// Returns the cell at index `x` of the first axis, `y` of the second and `further_indices` of
    /// the others, if the file has a point in it.
    pub(crate) fn cell(&self, x: usize, y: usize, further_indices: &[usize]) -> Option<usize> {
        Some(self.grid.cell(x, y, further_indices)).filter(|&cell| self.has_points(cell))
    }

    /// Returns whether the file has a point in the cell.
    pub(crate) fn has_points(&self, cell: usize) -> bool {
        self.point_counts[cell].points > 0
    }

    /// Returns the status of a cell's points; `None` if they differ.
    pub(crate) fn common_status(&self, cell: usize) -> Option<&str> {
        let status_words = self.table.column("status").and_then(FigureColumn::words)?;
        match status_words.codes.get(cell) {
            Some(&SEVERAL_WORDS) => None,
            _ => Some(status_words.get(cell).unwrap_or(UNKNOWN_STATUS)),
        }
    }

    /// Returns the number of failed rows of the file.
    pub(crate) fn count_failed(&self) -> usize {
        self.rows_by_status
            .iter()
            .filter(|(status, _)| *status != OK_STATUS)
            .map(|(_, rows)| rows)
            .sum()
    }
}

/// The rule that reduces the values of a cell's points to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellReduction {
    Greatest,
    Least,
    /// The value of the point with the greatest ratio.
    AtGreatestRatio,
    /// The word that all points have.
    Common,
}

impl CellReduction {
    fn for_column(column: &ColumnFacts) -> Self {
        match column.name.as_str() {
            "point" | "ratio_max_channel" => Self::AtGreatestRatio,
            _ if !column.is_number() => Self::Common,
            _ if column.metadata.worse == Some(Worse::Less) => Self::Least,
            _ => Self::Greatest,
        }
    }
}

/// A column while its rows are collected into cells.
struct CellColumn<'a> {
    facts: &'a ColumnFacts,
    reduction: CellReduction,
    values: ColumnValues,
    value_range: ValueRange,
    sides: Option<SideCollector>,
}

/// The sides of a limit while rows are collected.
struct SideCollector {
    /// The limit in the column's own unit.
    limit: f64,
    /// Whether the mean is taken of logarithms.
    is_log: bool,
    /// Whether a cell has points below the limit, and at or above it.
    sides_reached: Vec<[bool; 2]>,
    has_undefined: Vec<bool>,
    /// The sum and the count of the values or their logarithms.
    sums: Vec<(f64, u32)>,
}

impl SideCollector {
    fn new(limit: f64, is_log: bool, cells: usize) -> Self {
        let sides_reached = vec![[false; 2]; cells];
        let has_undefined = vec![false; cells];
        Self { limit, is_log, sides_reached, has_undefined, sums: vec![(0.0, 0); cells] }
    }

    fn add(&mut self, cell: usize, value: f64, has_failed: bool) {
        let coordinate = if self.is_log { value.ln() } else { value };
        if coordinate.is_finite() {
            self.sides_reached[cell][usize::from(value >= self.limit)] = true;
            let (sum, count) = self.sums[cell];
            self.sums[cell] = (sum + coordinate, count + 1);
        } else if !has_failed {
            self.has_undefined[cell] = true;
        }
    }

    fn finish(self) -> CellSides {
        let to_mean = |(sum, count): (f64, u32)| {
            let mean = sum / f64::from(count);
            if self.is_log { mean.exp() } else { mean }
        };
        CellSides {
            is_divided: self.sides_reached.into_iter().map(|sides| sides == [true; 2]).collect(),
            has_undefined: self.has_undefined,
            mean_values: self.sums.into_iter().map(to_mean).collect(),
        }
    }
}

/// All columns while rows are collected into cells.
struct CellCollector<'a> {
    source: &'a FigureFile,
    grid: &'a Grid,
    columns: Vec<CellColumn<'a>>,
    point_counts: Vec<PointCounts>,
    /// The first row of each cell.
    first_rows: Vec<usize>,
    /// The greatest ratio of each cell so far.
    greatest_ratios: Vec<f64>,
    /// The number of rows by status.
    rows_by_status: BTreeMap<String, usize>,
    /// The last value of each axis and its index: rows in grid order repeat values.
    last_values: Vec<(f64, Option<usize>)>,
    /// The limit of the ratio, if the file has no verdicts.
    ratio_limit: Option<f64>,
}

impl<'a> CellCollector<'a> {
    fn new(source: &'a FigureFile, grid: &'a Grid, columns: &[&'a ColumnFacts]) -> Self {
        let cell_count = grid.cell_count();
        let columns = columns.iter().map(|&facts| CellColumn {
            reduction: CellReduction::for_column(facts),
            values: match facts.is_number() {
                true => ColumnValues::Numbers(vec![f64::NAN; cell_count]),
                false => ColumnValues::Words(Words::without_words(cell_count)),
            },
            value_range: ValueRange::EMPTY,
            // A cell of one point needs no sides: its value is its mean.
            sides: { source.column_limit(facts) }
                .filter(|_| grid.merges_points())
                .map(|level| SideCollector::new(level, is_ratio(facts), cell_count)),
            facts,
        });
        Self {
            source,
            grid,
            columns: columns.collect(),
            point_counts: vec![PointCounts::default(); cell_count],
            first_rows: vec![0; cell_count],
            greatest_ratios: vec![f64::NAN; cell_count],
            rows_by_status: BTreeMap::new(),
            last_values: vec![(f64::NAN, None); grid.axes.len()],
            ratio_limit: source.column("reliable").is_none().then(|| source.ratio_limit()),
        }
    }

    /// Adds a row: the values of the axes, the status of the point, and the columns.
    fn add(&mut self, row: FigureRow<'_>) -> Result<()> {
        let mut cell = Some(0);
        for (column, (axis, last_value)) in
            self.grid.axes.iter().zip(&mut self.last_values).enumerate()
        {
            let value = row.number(column);
            if value != last_value.0 {
                *last_value = (value, axis.cell_index(value));
            }
            cell = cell.zip(last_value.1).map(|(cell, index)| cell * axis.values.len() + index);
        }
        let axis_count = self.last_values.len();
        let row_status = row.word(axis_count);
        let status_name = row_status.unwrap_or(UNKNOWN_STATUS);
        match self.rows_by_status.get_mut(status_name) {
            Some(rows) => *rows += 1,
            None => drop(self.rows_by_status.insert(status_name.to_owned(), 1)),
        }
        let has_failed = row_status != Some(OK_STATUS);
        let is_worst = cell.map(|cell| self.count_point(cell, row, has_failed)).transpose()?;
        for (column, collector) in (axis_count + 4..).zip(&mut self.columns) {
            collector.add((row, column), cell.zip(is_worst), has_failed);
        }
        Ok(())
    }

    /// Counts the kind of a row's point. Returns whether its ratio is the greatest of its cell so
    /// far.
    fn count_point(&mut self, cell: usize, row: FigureRow<'_>, has_failed: bool) -> Result<bool> {
        let axis_count = self.last_values.len();
        let point_counts = &mut self.point_counts[cell];
        let holds_all = |points| point_counts.points as usize >= points;
        if point_counts.points == 0 {
            self.first_rows[cell] = row.index();
        } else if self.grid.point_count(cell).is_some_and(holds_all) {
            return Err(self.repeated_point_error(cell, row.index()));
        }
        let [is_reliable, sensitive] = [1, 2].map(|k| row.word(axis_count + k));
        let ratio = row.number(axis_count + 3);
        let is_reliable = match self.ratio_limit {
            None => is_reliable.map(|word| word == "true"),
            Some(limit) => (!ratio.is_nan()).then_some(ratio < limit),
        };
        point_counts.points += 1;
        point_counts.failed_points += u32::from(has_failed);
        point_counts.sensitive_points += u32::from(sensitive == Some("true"));
        point_counts.reliable_points += u32::from(is_reliable == Some(true));
        point_counts.unreliable_points += u32::from(is_reliable == Some(false));
        let greatest_ratio = &mut self.greatest_ratios[cell];
        let is_worst = ratio > *greatest_ratio || (greatest_ratio.is_nan() && !ratio.is_nan());
        if is_worst {
            *greatest_ratio = ratio;
        }
        Ok(is_worst)
    }

    fn repeated_point_error(&self, cell: usize, row: usize) -> PlotError {
        let first_row = self.first_rows[cell];
        let reason = match self.grid.point_count(cell) {
            Some(1) => format!("rows {first_row} and {row} are the same point"),
            _ => format!("some rows between {first_row} and {row} are the same point"),
        };
        PlotError::NotAGrid { path: self.source.path.clone(), reason }
    }
}

impl CellColumn<'_> {
    /// Adds a row's value of the column to the range, and to a cell if the row lies in one. The
    /// `bool` in `cell` says whether the row has the greatest ratio of the cell so far.
    fn add(
        &mut self,
        (row, column): (FigureRow<'_>, usize),
        cell: Option<(usize, bool)>,
        has_failed: bool,
    ) {
        match &mut self.values {
            ColumnValues::Numbers(numbers) => {
                let value = row.number(column);
                self.value_range.add(value);
                let Some((cell, is_worst)) = cell else { return };
                let shown_value = numbers[cell];
                let is_replaced = match self.reduction {
                    CellReduction::Least => value < shown_value,
                    CellReduction::AtGreatestRatio => is_worst,
                    CellReduction::Greatest | CellReduction::Common => value > shown_value,
                };
                if is_replaced || shown_value.is_nan() {
                    numbers[cell] = value;
                }
                if let Some(sides) = &mut self.sides {
                    sides.add(cell, value, has_failed);
                }
            }
            ColumnValues::Words(words) => {
                let Some((cell, is_worst)) = cell else { return };
                let code = words.code_for(row.word(column));
                let shown_value = &mut words.codes[cell];
                if *shown_value == NO_WORD
                    || (self.reduction == CellReduction::AtGreatestRatio && is_worst)
                {
                    *shown_value = code;
                } else if self.reduction == CellReduction::Common
                    && code != NO_WORD
                    && code != *shown_value
                {
                    *shown_value = SEVERAL_WORDS;
                }
            }
        }
    }
}
