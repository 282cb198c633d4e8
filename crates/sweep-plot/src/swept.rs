//! The axes of a map file, found in its rows.

use std::collections::BTreeSet;

use super::axis::is_log_spaced;
use super::error::{PlotError, Result};
use super::label;
use super::read::{ColumnFacts, FigureFile};

/// Maximum number of different values of an axis that are kept; an axis with more is known by its
/// range alone. Basis: 2 MB for each axis. Doubling it doubles that memory.
pub const MAX_AXIS_VALUES: usize = 1 << 18;

/// A swept parameter with its values.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SweptAxis {
    pub name: String,
    /// The name in words.
    pub words: String,
    pub unit: String,
    /// Whether the axis is shown by its logarithm.
    #[serde(rename = "log")]
    pub is_log: bool,
    /// The values in rising order; the least and the greatest alone for an axis of more than
    /// [`MAX_AXIS_VALUES`].
    #[serde(skip)]
    pub values: Vec<f64>,
    /// Whether all values are kept.
    #[serde(skip)]
    pub is_complete: bool,
}

impl SweptAxis {
    /// Returns whether two values are the same to nine digits, which text keeps.
    pub fn is_same_value(first: f64, second: f64) -> bool {
        (first - second).abs() <= 1e-9 * second.abs().max(first.abs())
    }

    /// Returns the coordinates of values along the axis: logarithms on a logarithmic axis.
    pub fn coordinates(&self, values: &[f64]) -> Vec<f64> {
        values.iter().map(|value| if self.is_log { value.ln() } else { *value }).collect()
    }

    /// Returns the value at a coordinate along the axis.
    pub fn from_coordinate(&self, coordinate: f64) -> f64 {
        if self.is_log { coordinate.exp() } else { coordinate }
    }

    /// Returns a value of the axis with its name and unit: "Damping 140 N s/m".
    pub fn format_value(&self, value: f64) -> String {
        label::with_value(&self.words, value, &self.unit)
    }
}

/// An axis while its values are collected.
#[derive(Default)]
struct AxisCollector {
    seen_bits: BTreeSet<u64>,
    last_value: Option<f64>,
    value_range: Option<[f64; 2]>,
    /// Whether there are more values than are kept.
    has_overflowed: bool,
}

impl AxisCollector {
    fn add(&mut self, value: f64) {
        // Rows in grid order repeat the values of most axes.
        if self.last_value.replace(value) == Some(value) {
            return;
        }
        let [low, high] = self.value_range.unwrap_or([value; 2]);
        self.value_range = Some([low.min(value), high.max(value)]);
        // Adding 0 gives both zeros the same bits.
        let value_bits = (value + 0.0).to_bits();
        if self.seen_bits.len() < MAX_AXIS_VALUES {
            self.seen_bits.insert(value_bits);
        } else if !self.seen_bits.contains(&value_bits) {
            self.has_overflowed = true;
        }
    }

    fn finish(self, column: &ColumnFacts) -> SweptAxis {
        let mut values: Vec<f64> = self.seen_bits.into_iter().map(f64::from_bits).collect();
        values.sort_by(f64::total_cmp);
        // The first values decide on the spacing of an axis with more than are kept.
        let is_log = is_log_spaced(&values) && self.value_range.is_some_and(|[low, _]| low > 0.0);
        if self.has_overflowed {
            values = self.value_range.map_or_else(Vec::new, Vec::from);
        }
        SweptAxis {
            name: column.name.clone(),
            words: label::name_in_words(&column.name),
            unit: column.unit().to_owned(),
            is_log,
            values,
            is_complete: !self.has_overflowed,
        }
    }
}

/// Returns the columns of a file's axes in file order: those of numbers between the point's index
/// and the results, or the speeds of each point.
pub fn axis_columns(source: &FigureFile) -> Vec<&ColumnFacts> {
    let is_amplitude = |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
    let is_result = |name: &str| is_amplitude(name) || source.kind.required_columns.contains(&name);
    let columns_before_results =
        source.columns.iter().take_while(|column| !is_result(&column.name));
    columns_before_results.filter(|column| column.is_number() && column.name != "point").collect()
}

/// Returns whether the rows of a map file are a whole grid over two axes or more, or a curve over
/// one.
///
/// # Errors
/// Returns the errors of [`read_axes`], except for rows that do not lie on a grid, which give
/// `false`.
pub fn is_whole_grid(source: &FigureFile) -> Result<bool> {
    let axes = match read_axes(source) {
        Ok(axes) => axes,
        Err(PlotError::NotAGrid { .. }) => return Ok(false),
        Err(error) => return Err(error),
    };
    let varying_axes: Vec<&SweptAxis> = axes.iter().filter(|axis| axis.values.len() > 1).collect();
    let mut lengths = axes.iter().map(|axis| axis.values.len());
    let point_count = lengths.try_fold(1_usize, usize::checked_mul);
    Ok(varying_axes.len() < 2
        || point_count == Some(source.rows) && axes.iter().all(|axis| axis.is_complete))
}

/// Finds the axes of a map file, in file order.
///
/// # Errors
/// Returns the errors of [`FigureFile::each_row`]; [`PlotError::Undrawable`] without rows or axes;
/// [`PlotError::NotAGrid`] for an axis value that is not a number, or rows that do not lie on a
/// grid.
pub fn read_axes(source: &FigureFile) -> Result<Vec<SweptAxis>> {
    if source.rows == 0 {
        return Err(source.nothing_to_draw_error("the map has no rows"));
    }
    let not_a_grid_error =
        |reason: String| PlotError::NotAGrid { path: source.path.clone(), reason };
    let axis_columns_found = axis_columns(source);
    if axis_columns_found.is_empty() {
        return Err(source.nothing_to_draw_error("the map has no axis"));
    }
    let column_names: Vec<&str> =
        axis_columns_found.iter().map(|column| column.name.as_str()).collect();
    let mut collectors: Vec<AxisCollector> =
        column_names.iter().map(|_| AxisCollector::default()).collect();
    source.each_row(&column_names, |row| {
        for (column, (name, collectors)) in column_names.iter().zip(&mut collectors).enumerate() {
            let value = row.number(column);
            if !value.is_finite() {
                return Err(not_a_grid_error(format!("axis `{name}` has a row without a value")));
            }
            collectors.add(value);
        }
        // The check is repeated at each row, because the values of scattered rows would fill the
        // memory.
        let mut value_counts = collectors.iter().map(|axis| axis.seen_bits.len());
        let point_count = value_counts.try_fold(1_usize, usize::checked_mul);
        if point_count
            .is_none_or(|point_count| point_count > source.rows.saturating_add(MAX_MISSING_POINTS))
        {
            return Err(not_a_grid_error(
                "its rows are scattered over the axes' values".to_owned(),
            ));
        }
        Ok(())
    })?;
    // The metadata may claim rows that the file does not have.
    if collectors.iter().any(|axis| axis.seen_bits.is_empty()) {
        return Err(source.nothing_to_draw_error("the map has no rows"));
    }
    Ok(axis_columns_found
        .iter()
        .zip(collectors)
        .map(|(column, collectors)| collectors.finish(column))
        .collect())
}

/// Maximum number of grid points without a row; with more, the rows are not a grid. Basis: a run
/// that was stopped early is still a grid.
const MAX_MISSING_POINTS: usize = 1_000_000;
