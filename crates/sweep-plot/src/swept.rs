//! The axes of a map file, found in its rows.

use std::collections::BTreeSet;

use super::axis::evenly_by_log;
use super::error::{PlotError, Result};
use super::label;
use super::read::{ColumnFacts, Source};

/// Most different values of an axis that are kept. An axis of more is known by its range alone.
pub const MOST_VALUES: usize = 1 << 18;

/// A swept parameter with all its values.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SweptAxis {
    /// Name of the parameter.
    pub name: String,
    /// Its name in words.
    pub words: String,
    /// Unit of the values.
    pub unit: String,
    /// Better shown by the logarithm.
    pub log: bool,
    /// The values, rising; of an axis of more than [`MOST_VALUES`] the least and the greatest
    /// alone.
    #[serde(skip)]
    pub values: Vec<f64>,
    /// Whether the values are all there.
    #[serde(skip)]
    pub complete: bool,
}

impl SweptAxis {
    /// Whether two values are the same to the digits that text keeps.
    pub fn near(known: f64, value: f64) -> bool {
        (known - value).abs() <= 1e-9 * value.abs().max(known.abs())
    }

    /// Values in the units in which the axis is even.
    pub fn evened(&self, values: &[f64]) -> Vec<f64> {
        values.iter().map(|value| if self.log { value.ln() } else { *value }).collect()
    }

    /// The value that is this one in those units.
    pub fn un_even(&self, even: f64) -> f64 {
        if self.log { even.exp() } else { even }
    }

    /// A value of the axis, with its name and unit: "Damping 140 N s/m".
    pub fn format_value(&self, value: f64) -> String {
        label::valued(&self.words, value, &self.unit)
    }
}

/// One axis while its values are gathered.
#[derive(Default)]
struct Gathered {
    seen: BTreeSet<u64>,
    last: Option<f64>,
    range: Option<[f64; 2]>,
    /// More values than are kept.
    overflows: bool,
}

impl Gathered {
    fn take(&mut self, value: f64) {
        // Rows in grid order repeat most axes' values.
        if self.last.replace(value) == Some(value) {
            return;
        }
        let [low, high] = self.range.unwrap_or([value; 2]);
        self.range = Some([low.min(value), high.max(value)]);
        // Zero has two signs and is one value.
        let bits = (value + 0.0).to_bits();
        if self.seen.len() < MOST_VALUES {
            self.seen.insert(bits);
        } else if !self.seen.contains(&bits) {
            self.overflows = true;
        }
    }

    fn axis(self, column: &ColumnFacts) -> SweptAxis {
        let mut values: Vec<f64> = self.seen.into_iter().map(f64::from_bits).collect();
        values.sort_by(f64::total_cmp);
        // The values that came first tell how an axis of too many is spaced.
        let log = evenly_by_log(&values) && self.range.is_some_and(|[low, _]| low > 0.0);
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

/// The columns that are a file's axes, in file order: those of numbers between the point's index
/// and the results, or the speeds of each point.
pub fn columns(source: &Source) -> Vec<&ColumnFacts> {
    let of_model = |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
    let is_result = |name: &str| of_model(name) || source.kind.columns.contains(&name);
    let before = source.columns.iter().take_while(|column| !is_result(&column.name));
    before.filter(|column| column.is_number() && column.name != "point").collect()
}

/// Whether a map file's rows are a whole grid over two axes or more, or a curve over one.
///
/// # Errors
/// As [`axes`], but for rows that do not lie on a grid.
pub fn is_whole(source: &Source) -> Result<bool> {
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

/// The axes of a map file, in file order.
///
/// # Errors
/// As [`Source::each_row`]; [`PlotError::Undrawable`] without rows or axes;
/// [`PlotError::NotAGrid`] for an axis value that is not a number, or rows that do not lie on a
/// grid.
pub fn axes(source: &Source) -> Result<Vec<SweptAxis>> {
    if source.rows == 0 {
        return Err(source.empty("the map has no rows"));
    }
    let no_grid = |reason: String| PlotError::NotAGrid { path: source.path.clone(), reason };
    let columns = columns(source);
    if columns.is_empty() {
        return Err(source.empty("the map has no axis"));
    }
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let mut gathered: Vec<Gathered> = names.iter().map(|_| Gathered::default()).collect();
    source.each_row(&names, |row| {
        for (column, (name, gathered)) in names.iter().zip(&mut gathered).enumerate() {
            let value = row.number(column);
            if !value.is_finite() {
                return Err(no_grid(format!("axis `{name}` has a row without a value")));
            }
            gathered.take(value);
        }
        // Checked row by row: scattered rows would fill the memory with values.
        let mut known = gathered.iter().map(|axis| axis.seen.len());
        let size = known.try_fold(1_usize, usize::checked_mul);
        if size.is_none_or(|size| size > source.rows.saturating_add(MOST_MISSING)) {
            return Err(no_grid("its rows are scattered over the axes' values".to_owned()));
        }
        Ok(())
    })?;
    // What the file says of its rows need not be so.
    if gathered.iter().any(|axis| axis.seen.is_empty()) {
        return Err(source.empty("the map has no rows"));
    }
    Ok(columns.iter().zip(gathered).map(|(column, gathered)| gathered.axis(column)).collect())
}

/// Most grid points without a row: beyond, the rows are not a grid.
const MOST_MISSING: usize = 1_000_000;
