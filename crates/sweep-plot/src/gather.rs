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
use super::table::{FigureColumn, FigureTable, NONE, SEVERAL, Values, Words};
use sweep_parameter::Worse;

/// The least, the least positive and the greatest finite value of a column over all rows of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValueRange([f64; 3]);

impl ValueRange {
    /// The range of no values.
    const NONE: Self = Self([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY]);

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
pub(crate) struct Counts {
    pub(crate) points: u32,
    /// Points whose verdict is reliable.
    pub(crate) reliable: u32,
    /// Points whose verdict is unreliable.
    pub(crate) unreliable: u32,
    /// Points whose status is not `ok`.
    pub(crate) failed: u32,
    /// Points whose motion is chaotic.
    pub(crate) sensitive: u32,
}

/// The sides of a limit on which the points of each cell lie.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    /// Whether a cell has points on both sides of the limit.
    pub(crate) both: Vec<bool>,
    /// Whether a cell has points that did not fail and yet have no value.
    pub(crate) undefined: Vec<bool>,
    /// The mean of each cell's values; the geometric mean of ratios.
    pub(crate) mean: Vec<f64>,
}

/// A map file collected into cells.
#[derive(Debug)]
pub(crate) struct CellMap {
    /// The table with a row for each cell, in grid order.
    pub(crate) table: FigureTable,
    pub(crate) grid: Grid,
    /// The number of points of each kind in each cell.
    pub(crate) counts: Vec<Counts>,
    /// The range of each column over all rows, and the sides of its limit in each cell; no sides
    /// without a limit, or if each cell is one point.
    pub(crate) seen: BTreeMap<String, (ValueRange, Option<Sides>)>,
    /// The number of rows of the file by status.
    pub(crate) statuses: BTreeMap<String, usize>,
}

/// The status of a row whose file has none.
const UNKNOWN: &str = "unknown";
/// The status of a point with a result.
pub(crate) const OK: &str = "ok";

impl CellMap {
    /// Reads the named columns of a map file into the cells of a grid.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`]; [`PlotError::NotAGrid`] for two rows at one
    /// point.
    pub(crate) fn read(source: FigureFile, grid: Grid, columns: &[String]) -> Result<Self> {
        let names = grid.axes.iter().map(|axis| axis.swept.name.as_str());
        let names = names.chain(["status", "reliable", "sensitive", "ratio_max"]);
        let shown: Vec<&ColumnFacts> =
            source.columns.iter().filter(|column| columns.contains(&column.name)).collect();
        let names: Vec<&str> = names.chain(shown.iter().map(|facts| facts.name.as_str())).collect();
        let mut collector = CellCollector::new(&source, &grid, &shown);
        source.each_row(&names, |row| collector.add(row))?;
        let CellCollector { columns, counts, statuses, .. } = collector;
        let mut seen = BTreeMap::new();
        let mut kept = Vec::with_capacity(columns.len());
        for CellColumn { facts, mut values, extent, dividing, .. } in columns {
            if let Values::Words(words) = &mut values {
                words.sort();
            }
            seen.insert(facts.name.clone(), (extent, dividing.map(SideCollector::sides)));
            kept.push(FigureColumn { facts: facts.clone(), values });
        }
        let table = FigureTable { rows: grid.cells(), columns: kept, source, bucket_rows: None };
        Ok(Self { table, grid, counts, seen, statuses })
    }

    /// Returns the cell at index `x` of the first axis, `y` of the second and `rest` of the others,
    /// if the file has a point in it.
    pub(crate) fn cell(&self, x: usize, y: usize, rest: &[usize]) -> Option<usize> {
        Some(self.grid.cell(x, y, rest)).filter(|&cell| self.filled(cell))
    }

    /// Returns whether the file has a point in the cell.
    pub(crate) fn filled(&self, cell: usize) -> bool {
        self.counts[cell].points > 0
    }

    /// Returns the status of a cell's points; `None` if they differ.
    pub(crate) fn status(&self, cell: usize) -> Option<&str> {
        let words = self.table.column("status").and_then(FigureColumn::words)?;
        match words.codes.get(cell) {
            Some(&SEVERAL) => None,
            _ => Some(words.get(cell).unwrap_or(UNKNOWN)),
        }
    }

    /// Returns the number of failed rows of the file.
    pub(crate) fn failed(&self) -> usize {
        self.statuses.iter().filter(|(status, _)| *status != OK).map(|(_, rows)| rows).sum()
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
            _ if column.worse == Some(Worse::Less) => Self::Least,
            _ => Self::Greatest,
        }
    }
}

/// A column while its rows are collected into cells.
struct CellColumn<'a> {
    facts: &'a ColumnFacts,
    rule: CellReduction,
    values: Values,
    extent: ValueRange,
    dividing: Option<SideCollector>,
}

/// The sides of a limit while rows are collected.
struct SideCollector {
    /// The limit in the column's own unit.
    level: f64,
    /// Whether the mean is taken of logarithms.
    log: bool,
    /// Whether a cell has points below the limit, and at or above it.
    sides: Vec<[bool; 2]>,
    undefined: Vec<bool>,
    /// The sum and the count of the values or their logarithms.
    sums: Vec<(f64, u32)>,
}

impl SideCollector {
    fn new(level: f64, log: bool, cells: usize) -> Self {
        let sides = vec![[false; 2]; cells];
        let undefined = vec![false; cells];
        Self { level, log, sides, undefined, sums: vec![(0.0, 0); cells] }
    }

    fn add(&mut self, cell: usize, value: f64, failed: bool) {
        let even = if self.log { value.ln() } else { value };
        if even.is_finite() {
            self.sides[cell][usize::from(value >= self.level)] = true;
            let (sum, count) = self.sums[cell];
            self.sums[cell] = (sum + even, count + 1);
        } else if !failed {
            self.undefined[cell] = true;
        }
    }

    fn sides(self) -> Sides {
        let mean = |(sum, count): (f64, u32)| {
            let mean = sum / f64::from(count);
            if self.log { mean.exp() } else { mean }
        };
        Sides {
            both: self.sides.into_iter().map(|sides| sides == [true; 2]).collect(),
            undefined: self.undefined,
            mean: self.sums.into_iter().map(mean).collect(),
        }
    }
}

/// All columns while rows are collected into cells.
struct CellCollector<'a> {
    source: &'a FigureFile,
    grid: &'a Grid,
    columns: Vec<CellColumn<'a>>,
    counts: Vec<Counts>,
    /// The first row of each cell.
    first: Vec<usize>,
    /// The greatest ratio of each cell so far.
    greatest: Vec<f64>,
    /// The number of rows by status.
    statuses: BTreeMap<String, usize>,
    /// The last value of each axis and its index: rows in grid order repeat values.
    last: Vec<(f64, Option<usize>)>,
    /// The limit of the ratio, if the file has no verdicts.
    limit: Option<f64>,
}

impl<'a> CellCollector<'a> {
    fn new(source: &'a FigureFile, grid: &'a Grid, columns: &[&'a ColumnFacts]) -> Self {
        let cells = grid.cells();
        let columns = columns.iter().map(|&facts| CellColumn {
            rule: CellReduction::for_column(facts),
            values: match facts.is_number() {
                true => Values::Numbers(vec![f64::NAN; cells]),
                false => Values::Words(Words::none(cells)),
            },
            extent: ValueRange::NONE,
            // A cell of one point needs no sides: its value is its mean.
            dividing: { source.limit(facts) }
                .filter(|_| grid.merged())
                .map(|level| SideCollector::new(level, is_ratio(facts), cells)),
            facts,
        });
        Self {
            source,
            grid,
            columns: columns.collect(),
            counts: vec![Counts::default(); cells],
            first: vec![0; cells],
            greatest: vec![f64::NAN; cells],
            statuses: BTreeMap::new(),
            last: vec![(f64::NAN, None); grid.axes.len()],
            limit: source.column("reliable").is_none().then(|| source.ratio_limit()),
        }
    }

    /// Adds a row: the values of the axes, the status of the point, and the columns.
    fn add(&mut self, row: FigureRow<'_>) -> Result<()> {
        let mut cell = Some(0);
        for (column, (axis, last)) in self.grid.axes.iter().zip(&mut self.last).enumerate() {
            let value = row.number(column);
            if value != last.0 {
                *last = (value, axis.place(value));
            }
            cell = cell.zip(last.1).map(|(cell, place)| cell * axis.values.len() + place);
        }
        let own = self.last.len();
        let status = row.word(own);
        let named = status.unwrap_or(UNKNOWN);
        match self.statuses.get_mut(named) {
            Some(rows) => *rows += 1,
            None => drop(self.statuses.insert(named.to_owned(), 1)),
        }
        let failed = status != Some(OK);
        let is_worst = cell.map(|cell| self.count(cell, row, failed)).transpose()?;
        for (column, gathered) in (own + 4..).zip(&mut self.columns) {
            gathered.add((row, column), cell.zip(is_worst), failed);
        }
        Ok(())
    }

    /// Counts the kind of a row's point. Returns whether its ratio is the greatest of its cell so
    /// far.
    fn count(&mut self, cell: usize, row: FigureRow<'_>, failed: bool) -> Result<bool> {
        let own = self.last.len();
        let counts = &mut self.counts[cell];
        let is_full = |points| counts.points as usize >= points;
        if counts.points == 0 {
            self.first[cell] = row.index();
        } else if self.grid.points(cell).is_some_and(is_full) {
            return Err(self.repeated_point(cell, row.index()));
        }
        let [verdict, sensitive] = [1, 2].map(|k| row.word(own + k));
        let ratio = row.number(own + 3);
        let verdict = match self.limit {
            None => verdict.map(|word| word == "true"),
            Some(limit) => (!ratio.is_nan()).then_some(ratio < limit),
        };
        counts.points += 1;
        counts.failed += u32::from(failed);
        counts.sensitive += u32::from(sensitive == Some("true"));
        counts.reliable += u32::from(verdict == Some(true));
        counts.unreliable += u32::from(verdict == Some(false));
        let known = &mut self.greatest[cell];
        let is_worst = ratio > *known || (known.is_nan() && !ratio.is_nan());
        if is_worst {
            *known = ratio;
        }
        Ok(is_worst)
    }

    fn repeated_point(&self, cell: usize, row: usize) -> PlotError {
        let first = self.first[cell];
        let reason = match self.grid.points(cell) {
            Some(1) => format!("rows {first} and {row} are the same point"),
            _ => format!("some rows between {first} and {row} are the same point"),
        };
        PlotError::NotAGrid { path: self.source.path.clone(), reason }
    }
}

impl CellColumn<'_> {
    /// Adds a row's value of the column, to a cell if the row lies in one. The `bool` beside the
    /// cell says whether the row has the greatest ratio of the cell so far.
    fn add(
        &mut self,
        (row, column): (FigureRow<'_>, usize),
        cell: Option<(usize, bool)>,
        failed: bool,
    ) {
        match &mut self.values {
            Values::Numbers(kept) => {
                let value = row.number(column);
                self.extent.add(value);
                let Some((cell, is_worst)) = cell else { return };
                let known = kept[cell];
                let takes = match self.rule {
                    CellReduction::Least => value < known,
                    CellReduction::AtGreatestRatio => is_worst,
                    CellReduction::Greatest | CellReduction::Common => value > known,
                };
                if takes || known.is_nan() {
                    kept[cell] = value;
                }
                if let Some(dividing) = &mut self.dividing {
                    dividing.add(cell, value, failed);
                }
            }
            Values::Words(words) => {
                let Some((cell, is_worst)) = cell else { return };
                let code = words.code(row.word(column));
                let known = &mut words.codes[cell];
                if *known == NONE || (self.rule == CellReduction::AtGreatestRatio && is_worst) {
                    *known = code;
                } else if self.rule == CellReduction::Common && code != NONE && code != *known {
                    *known = SEVERAL;
                }
            }
        }
    }
}
