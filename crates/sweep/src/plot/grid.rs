//! The points of a map file on their grid.

use super::axis::evenly_by_log;
use super::error::PlotError;
use super::label;
use super::read::{Table, Values};

/// One swept parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GridAxis {
    /// Name of the parameter.
    pub(crate) name: String,
    /// Its name in words.
    pub(crate) words: String,
    /// Unit of the values.
    pub(crate) unit: String,
    /// Rising.
    pub(crate) values: Vec<f64>,
    /// Better shown by the logarithm.
    pub(crate) log: bool,
}

impl GridAxis {
    /// Words and unit.
    pub(crate) fn label(&self) -> String {
        label::with_unit(&self.words, &self.unit)
    }

    /// A value of the axis, with its name and unit: "Damping 140 N s/m".
    pub(crate) fn said(&self, index: usize) -> String {
        let value = label::significant(self.values[index], 4);
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("{} {value}{unit}", self.words)
    }

    /// The values in the units in which the axis is even.
    pub(crate) fn even(&self) -> Vec<f64> {
        self.values.iter().map(|value| if self.log { value.ln() } else { *value }).collect()
    }

    /// The borders of the cells around the values, one more than those: halfway between neighbours.
    pub(crate) fn borders(&self) -> Vec<f64> {
        let even = self.even();
        let last = even.len() - 1;
        let between = |k: usize| (even[k] + even[k + 1]) / 2.0;
        let mut borders: Vec<f64> = (0..last).map(between).collect();
        let (first_half, last_half) = if last == 0 {
            // A lone value gets a cell of its own size, so that there is something to see.
            let half = if self.log || even[0] == 0.0 { 0.5 } else { 0.05 * even[0].abs() };
            (half, half)
        } else {
            (borders[0] - even[0], even[last] - borders[last - 1])
        };
        borders.insert(0, even[0] - first_half);
        borders.push(even[last] + last_half);
        borders.into_iter().map(|border| if self.log { border.exp() } else { border }).collect()
    }
}

/// A map file's axes, and the row of each grid point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    /// In file order; the first varies slowest.
    pub(crate) axes: Vec<GridAxis>,
    /// Row of each grid point; `None` where the file has none.
    rows: Vec<Option<usize>>,
}

/// Past this many grid points without a row, the rows are no grid.
const MOST_MISSING: usize = 1_000_000;

impl Grid {
    /// Puts the rows of a map file on their grid.
    ///
    /// # Errors
    /// [`PlotError::Empty`] without rows or axes; [`PlotError::NotAGrid`] for an axis value that is no number, two rows
    /// at one point, or rows that do not lie on a grid.
    pub(crate) fn of(table: &Table) -> Result<Self, PlotError> {
        let empty = |reason| PlotError::Empty { path: table.path.clone(), reason };
        if table.rows == 0 {
            return Err(empty("the map has no rows"));
        }
        let no_grid = |reason: String| PlotError::NotAGrid { path: table.path.clone(), reason };
        let mut axes = Vec::new();
        let mut places: Vec<Vec<usize>> = Vec::new();
        let of_model = |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
        // The axes stand between the point's index and the results.
        for column in table.columns.iter().take_while(|column| !of_model(&column.name)) {
            let Values::Number(numbers) = &column.values else { continue };
            if column.name == "point" {
                continue;
            }
            if numbers.iter().any(|value| !value.is_finite()) {
                return Err(no_grid(format!("axis `{}` has a row without a value", column.name)));
            }
            let mut values = numbers.clone();
            values.sort_by(f64::total_cmp);
            values.dedup();
            places.push(numbers.iter().map(|value| values.partition_point(|known| known < value)).collect());
            axes.push(GridAxis {
                name: column.name.clone(),
                words: label::words(&column.name),
                unit: column.unit.clone(),
                log: evenly_by_log(&values),
                values,
            });
        }
        if axes.is_empty() {
            return Err(empty("the map has no axis"));
        }
        let size = axes.iter().try_fold(1_usize, |size, axis| size.checked_mul(axis.values.len()));
        let size = size
            .filter(|size| *size <= table.rows.saturating_add(MOST_MISSING))
            .ok_or_else(|| no_grid("its rows are scattered over the axes' values".to_owned()))?;
        let mut grid = Self { axes, rows: vec![None; size] };
        for row in 0..table.rows {
            let at: Vec<usize> = places.iter().map(|place| place[row]).collect();
            let index = grid.index(&at);
            if let Some(earlier) = grid.rows[index].replace(row) {
                return Err(no_grid(format!("rows {earlier} and {row} are the same point")));
            }
        }
        Ok(grid)
    }

    /// Index of a grid point in grid order, from its place on each axis.
    pub(crate) fn index(&self, at: &[usize]) -> usize {
        self.axes.iter().zip(at).fold(0, |index, (axis, &place)| index * axis.values.len() + place)
    }

    /// Row of the grid point at `x` on the first axis, `y` on the second, and `rest` on those after.
    pub(crate) fn row(&self, x: usize, y: usize, rest: &[usize]) -> Option<usize> {
        let mut at = vec![x];
        if self.axes.len() > 1 {
            at.push(y);
        }
        at.extend_from_slice(rest);
        self.rows[self.index(&at)]
    }

    /// Row of each grid point in grid order.
    pub(crate) fn rows(&self) -> &[Option<usize>] {
        &self.rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: &[f64], log: bool) -> GridAxis {
        GridAxis {
            name: String::new(),
            words: String::new(),
            unit: String::new(),
            values: values.to_vec(),
            log,
        }
    }

    #[test]
    fn cells_meet_halfway_and_the_outer_ones_are_whole() {
        assert_eq!(axis(&[1.0, 2.0, 4.0], false).borders(), [0.5, 1.5, 3.0, 5.0]);
        assert_eq!(axis(&[10.0], false).borders(), [9.5, 10.5]);
        let log = axis(&[1.0, 100.0], true).borders();
        assert!(
            (log[0] - 0.1).abs() < 1e-12 && (log[1] - 10.0).abs() < 1e-9 && (log[2] - 1000.0).abs() < 1e-6
        );
    }
}
