//! The axes of a map file, found in its rows.

use std::collections::BTreeSet;

use super::axis::is_log_spaced;
use super::error::{PlotError, Result};
use super::label;
use super::read::{ColumnFacts, FigureFile};

/// Maximum number of different values of an axis that are kept; an axis with more is known by its
/// range alone. Basis: 2 MB for each axis. Doubling it doubles that memory.
pub const MAX_VALUES: usize = 1 << 18;

/// A swept parameter with its values.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SweptAxis {
    pub name: String,
    /// The name in words.
    pub words: String,
    pub unit: String,
    /// Whether the axis is shown by its logarithm.
    pub log: bool,
    /// The values in rising order; the least and the greatest alone for an axis of more than
    /// [`MAX_VALUES`].
    #[serde(skip)]
    pub values: Vec<f64>,
    /// Whether all values are kept.
    #[serde(skip)]
    pub complete: bool,
}

impl SweptAxis {
    /// Returns whether two values are the same to nine digits, which text keeps.
    pub fn is_near(known: f64, value: f64) -> bool {
        (known - value).abs() <= 1e-9 * value.abs().max(known.abs())
    }

    /// Returns the coordinates of values along the axis: logarithms on a logarithmic axis.
    pub fn coordinates(&self, values: &[f64]) -> Vec<f64> {
        values.iter().map(|value| if self.log { value.ln() } else { *value }).collect()
    }

    /// Returns the value at a coordinate along the axis.
    pub fn from_coordinate(&self, even: f64) -> f64 {
        if self.log { even.exp() } else { even }
    }

    /// Returns a value of the axis with its name and unit: "Damping 140 N s/m".
    pub fn format_value(&self, value: f64) -> String {
        label::with_value(&self.words, value, &self.unit)
    }
}

/// An axis while its values are collected.
#[derive(Default)]
struct AxisCollector {
    seen: BTreeSet<u64>,
    last: Option<f64>,
    range: Option<[f64; 2]>,
    /// Whether there are more values than are kept.
    overflows: bool,
}

impl AxisCollector {
    fn add(&mut self, value: f64) {
        // Rows in grid order repeat the values of most axes.
        if self.last.replace(value) == Some(value) {
            return;
        }
        let [low, high] = self.range.unwrap_or([value; 2]);
        self.range = Some([low.min(value), high.max(value)]);
        // Adding 0 gives both zeros the same bits.
        let bits = (value + 0.0).to_bits();
        if self.seen.len() < MAX_VALUES {
            self.seen.insert(bits);
        } else if !self.seen.contains(&bits) {
            self.overflows = true;
        }
    }

    fn axis(self, column: &ColumnFacts) -> SweptAxis {
        let mut values: Vec<f64> = self.seen.into_iter().map(f64::from_bits).collect();
        values.sort_by(f64::total_cmp);
        // The first values decide on the spacing of an axis with more than are kept.
        let log = is_log_spaced(&values) && self.range.is_some_and(|[low, _]| low > 0.0);
        if self.overflows {
            values = self.range.map_or_else(Vec::new, Vec::from);
        }
        SweptAxis {
            name: column.name.clone(),
            words: label::words(&column.name),
            unit: column.unit.clone(),
            log,
            values,
            complete: !self.overflows,
        }
    }
}

/// Returns the columns of a file's axes in file order: those of numbers between the point's index
/// and the results, or the speeds of each point.
pub fn columns(source: &FigureFile) -> Vec<&ColumnFacts> {
    let is_amplitude = |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
    let is_result = |name: &str| is_amplitude(name) || source.kind.columns.contains(&name);
    let before = source.columns.iter().take_while(|column| !is_result(&column.name));
    before.filter(|column| column.is_number() && column.name != "point").collect()
}

/// Returns whether the rows of a map file are a whole grid over two axes or more, or a curve over
/// one.
///
/// # Errors
/// Returns the errors of [`axes`], except for rows that do not lie on a grid, which give `false`.
pub fn is_whole(source: &FigureFile) -> Result<bool> {
    let axes = match axes(source) {
        Ok(axes) => axes,
        Err(PlotError::NotAGrid { .. }) => return Ok(false),
        Err(error) => return Err(error),
    };
    let varying: Vec<&SweptAxis> = axes.iter().filter(|axis| axis.values.len() > 1).collect();
    let mut sizes = axes.iter().map(|axis| axis.values.len());
    let size = sizes.try_fold(1_usize, usize::checked_mul);
    Ok(varying.len() < 2 || size == Some(source.rows) && axes.iter().all(|axis| axis.complete))
}

/// Finds the axes of a map file, in file order.
///
/// # Errors
/// Returns the errors of [`FigureFile::each_row`]; [`PlotError::Undrawable`] without rows or axes;
/// [`PlotError::NotAGrid`] for an axis value that is not a number, or rows that do not lie on a
/// grid.
pub fn axes(source: &FigureFile) -> Result<Vec<SweptAxis>> {
    if source.rows == 0 {
        return Err(source.nothing_to_draw("the map has no rows"));
    }
    let no_grid = |reason: String| PlotError::NotAGrid { path: source.path.clone(), reason };
    let columns = columns(source);
    if columns.is_empty() {
        return Err(source.nothing_to_draw("the map has no axis"));
    }
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let mut gathered: Vec<AxisCollector> = names.iter().map(|_| AxisCollector::default()).collect();
    source.each_row(&names, |row| {
        for (column, (name, gathered)) in names.iter().zip(&mut gathered).enumerate() {
            let value = row.number(column);
            if !value.is_finite() {
                return Err(no_grid(format!("axis `{name}` has a row without a value")));
            }
            gathered.add(value);
        }
        // The check is repeated at each row, because the values of scattered rows would fill the
        // memory.
        let mut known = gathered.iter().map(|axis| axis.seen.len());
        let size = known.try_fold(1_usize, usize::checked_mul);
        if size.is_none_or(|size| size > source.rows.saturating_add(MAX_MISSING)) {
            return Err(no_grid("its rows are scattered over the axes' values".to_owned()));
        }
        Ok(())
    })?;
    // The metadata may claim rows that the file does not have.
    if gathered.iter().any(|axis| axis.seen.is_empty()) {
        return Err(source.nothing_to_draw("the map has no rows"));
    }
    Ok(columns.iter().zip(gathered).map(|(column, gathered)| gathered.axis(column)).collect())
}

/// Maximum number of grid points without a row; with more, the rows are not a grid. Basis: a run
/// that was stopped early is still a grid.
const MAX_MISSING: usize = 1_000_000;
