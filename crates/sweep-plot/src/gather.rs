//! A map file's rows gathered into the cells of its grid, batch by batch. Memory depends on the
//! number of cells, not of rows.
//!
//! A cell of one point has that point's values. A cell of several has the worst of them, column by
//! column: the greatest, or the least of what is the worse the less it is. It counts its reliable,
//! unreliable and failed points.

use std::collections::BTreeMap;

use super::error::{PlotError, Result};
use super::grid::Grid;
use super::read::{ColumnFacts, Row, Source, is_ratio};
use super::table::{Column, NONE, SEVERAL, Table, Values, Words};
use sweep_parameter::Worse;

/// Least, least positive and greatest finite value of a column over all rows of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent([f64; 3]);

impl Extent {
    const NONE: Self = Self([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY]);

    fn take(&mut self, value: f64) {
        let [low, least_positive, high] = &mut self.0;
        if value.is_finite() {
            (*low, *high) = (low.min(value), high.max(value));
            if value > 0.0 {
                *least_positive = least_positive.min(value);
            }
        }
    }

    /// Values with the same extremes as all, and as all that are positive.
    pub(crate) fn values(self) -> impl Iterator<Item = f64> {
        self.0.into_iter().filter(|value| value.is_finite())
    }
}

/// How many of a cell's points are what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// All of them.
    pub(crate) points: u32,
    /// Whose ratio is below the limit.
    pub(crate) reliable: u32,
    /// Whose ratio is at the limit or above.
    pub(crate) unreliable: u32,
    /// Whose status is not `ok`.
    pub(crate) failed: u32,
    /// Whose motion is chaotic.
    pub(crate) sensitive: u32,
}

/// Where a cell's points lie about a level.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    /// Cells with points on both sides of the level.
    pub(crate) both: Vec<bool>,
    /// Cells with points that did not fail and yet have no value.
    pub(crate) undefined: Vec<bool>,
    /// The mean of each cell's values, by the logarithm where distances are.
    pub(crate) mean: Vec<f64>,
}

/// A map file in cells.
#[derive(Debug)]
pub(crate) struct Map {
    /// One row per cell in grid order.
    pub(crate) table: Table,
    /// Where the cells are.
    pub(crate) grid: Grid,
    /// How many points of each cell are what.
    pub(crate) counts: Vec<Counts>,
    /// Of each column the range of its numbers, and the sides of its limit on which the points of a
    /// cell lie; none without a limit, or where each cell is one point.
    pub(crate) seen: BTreeMap<String, (Extent, Option<Sides>)>,
    /// Rows of the whole file by their status.
    pub(crate) statuses: BTreeMap<String, usize>,
}

/// Status of a row whose file does not say.
const UNKNOWN: &str = "unknown";
/// Status of a point with a result.
pub(crate) const OK: &str = "ok";

impl Map {
    /// Reads the named columns of a map file into the cells of a grid.
    ///
    /// # Errors
    /// As [`Source::each_row`]; [`PlotError::NotAGrid`] for two rows at one point.
    pub(crate) fn read(source: Source, grid: Grid, columns: &[String]) -> Result<Self> {
        let names = grid.axes.iter().map(|axis| axis.swept.name.as_str());
        let names = names.chain(["status", "reliable", "sensitive", "ratio_max"]);
        let own: Vec<&ColumnFacts> =
            source.columns.iter().filter(|column| columns.contains(&column.name)).collect();
        let names: Vec<&str> = names.chain(own.iter().map(|facts| facts.name.as_str())).collect();
        let mut gather = Gather::new(&source, &grid, &own);
        source.each_row(&names, |row| gather.take(row))?;
        let Gather { columns, counts, statuses, .. } = gather;
        let (mut seen, mut kept) = (BTreeMap::new(), Vec::with_capacity(columns.len()));
        for Gathered { facts, mut values, extent, dividing, .. } in columns {
            if let Values::Words(words) = &mut values {
                words.sort();
            }
            seen.insert(facts.name.clone(), (extent, dividing.map(Dividing::sides)));
            kept.push(Column { facts: facts.clone(), values });
        }
        let table = Table { rows: grid.cells(), columns: kept, source, stretch: None };
        Ok(Self { table, grid, counts, seen, statuses })
    }

    /// The cell at `x` on the first axis, `y` on the second, and `rest` on those after, if the file
    /// has a point in it.
    pub(crate) fn cell(&self, x: usize, y: usize, rest: &[usize]) -> Option<usize> {
        Some(self.grid.cell(x, y, rest)).filter(|&cell| self.filled(cell))
    }

    /// Whether the file has a point in the cell.
    pub(crate) fn filled(&self, cell: usize) -> bool {
        self.counts[cell].points > 0
    }

    /// The status of each cell: none where its points differ in it.
    pub(crate) fn status(&self, cell: usize) -> Option<&str> {
        let words = self.table.column("status").and_then(Column::words)?;
        match words.codes.get(cell) {
            Some(&SEVERAL) => None,
            _ => Some(words.get(cell).unwrap_or(UNKNOWN)),
        }
    }

    /// How many rows of the file failed.
    pub(crate) fn failed(&self) -> usize {
        self.statuses.iter().filter(|(status, _)| *status != OK).map(|(_, rows)| rows).sum()
    }
}

/// What becomes of the values of a cell's points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    Greatest,
    Least,
    /// That of the point with the greatest ratio.
    OfGreatestRatio,
    /// The word that all have.
    Common,
}

impl Rule {
    fn of(column: &ColumnFacts) -> Self {
        match column.name.as_str() {
            "point" | "ratio_max_channel" => Self::OfGreatestRatio,
            _ if !column.is_number() => Self::Common,
            _ if column.worse == Some(Worse::Less) => Self::Least,
            _ => Self::Greatest,
        }
    }
}

/// A column on its way into cells.
struct Gathered<'a> {
    facts: &'a ColumnFacts,
    rule: Rule,
    values: Values,
    extent: Extent,
    dividing: Option<Dividing>,
}

/// Cells on their way to [`Sides`].
struct Dividing {
    /// In the column's own unit.
    level: f64,
    /// Whether distances from it are taken by the logarithm.
    log: bool,
    /// Whether a cell has points below the level, and at it or above.
    sides: Vec<[bool; 2]>,
    undefined: Vec<bool>,
    /// Sum and count of the values, or of their logarithms.
    sums: Vec<(f64, u32)>,
}

impl Dividing {
    fn new(level: f64, log: bool, cells: usize) -> Self {
        let (sides, undefined) = (vec![[false; 2]; cells], vec![false; cells]);
        Self { level, log, sides, undefined, sums: vec![(0.0, 0); cells] }
    }

    fn take(&mut self, cell: usize, value: f64, failed: bool) {
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

/// All columns on their way into cells.
struct Gather<'a> {
    source: &'a Source,
    grid: &'a Grid,
    columns: Vec<Gathered<'a>>,
    counts: Vec<Counts>,
    /// First row of each cell.
    first: Vec<usize>,
    /// Greatest ratio of each cell so far.
    greatest: Vec<f64>,
    /// Rows by their status.
    statuses: BTreeMap<String, usize>,
    /// Value and place last found on each axis.
    last: Vec<(f64, Option<usize>)>,
    /// By which a row is judged where the file has no verdicts.
    limit: Option<f64>,
}

impl<'a> Gather<'a> {
    fn new(source: &'a Source, grid: &'a Grid, columns: &[&'a ColumnFacts]) -> Self {
        let cells = grid.cells();
        let columns = columns.iter().map(|&facts| Gathered {
            rule: Rule::of(facts),
            values: match facts.is_number() {
                true => Values::Numbers(vec![f64::NAN; cells]),
                false => Values::Words(Words::none(cells)),
            },
            extent: Extent::NONE,
            // A cell of one point lies on one side, and its value is its mean.
            dividing: { source.limit(facts) }
                .filter(|_| grid.merged())
                .map(|level| Dividing::new(level, is_ratio(facts), cells)),
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

    /// Takes a row: the values of the axes, what became of the point, and the columns.
    fn take(&mut self, row: Row<'_>) -> Result<()> {
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
            gathered.take((row, column), cell.zip(is_worst), failed);
        }
        Ok(())
    }

    /// Counts what a row is; gives whether it has the greatest ratio of its cell so far.
    fn count(&mut self, cell: usize, row: Row<'_>, failed: bool) -> Result<bool> {
        let own = self.last.len();
        let counts = &mut self.counts[cell];
        let is_full = |points| counts.points as usize >= points;
        if counts.points == 0 {
            self.first[cell] = row.index();
        } else if self.grid.points(cell).is_some_and(is_full) {
            return Err(self.twice(cell, row.index()));
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

    fn twice(&self, cell: usize, row: usize) -> PlotError {
        let first = self.first[cell];
        let reason = match self.grid.points(cell) {
            Some(1) => format!("rows {first} and {row} are the same point"),
            _ => format!("some rows between {first} and {row} are the same point"),
        };
        PlotError::NotAGrid { path: self.source.path.clone(), reason }
    }
}

impl Gathered<'_> {
    /// Takes what a row has in a column, into a cell if it is shown; whether the row has the
    /// greatest ratio of the cell so far.
    fn take(&mut self, (row, column): (Row<'_>, usize), cell: Option<(usize, bool)>, failed: bool) {
        match &mut self.values {
            Values::Numbers(kept) => {
                let value = row.number(column);
                self.extent.take(value);
                let Some((cell, is_worst)) = cell else { return };
                let known = kept[cell];
                let takes = match self.rule {
                    Rule::Least => value < known,
                    Rule::OfGreatestRatio => is_worst,
                    Rule::Greatest | Rule::Common => value > known,
                };
                if takes || known.is_nan() {
                    kept[cell] = value;
                }
                if let Some(dividing) = &mut self.dividing {
                    dividing.take(cell, value, failed);
                }
            }
            Values::Words(words) => {
                let Some((cell, is_worst)) = cell else { return };
                let code = words.code(row.word(column));
                let known = &mut words.codes[cell];
                if *known == NONE || (self.rule == Rule::OfGreatestRatio && is_worst) {
                    *known = code;
                } else if self.rule == Rule::Common && code != NONE && code != *known {
                    *known = SEVERAL;
                }
            }
        }
    }
}
