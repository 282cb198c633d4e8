//! The cells of a map: one for each grid point, or one for a block of points if there are more than
//! a figure can show.

use super::axis::AxisScale;
use super::label;
use super::swept::{MAX_AXIS_VALUES, SweptAxis};

/// A swept parameter with the cells along it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(crate) struct GridAxis {
    /// The parameter with its values.
    #[serde(flatten)]
    pub(crate) swept_axis: SweptAxis,
    /// The rising value of each cell; the middle of a block.
    pub(crate) values: Vec<f64>,
    /// The borders of the cells, one more than there are cells: halfway between neighbours.
    pub(crate) borders: Vec<f64>,
    /// The first and the last value of each block; `None` if each cell has one value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) spans: Option<Vec<[f64; 2]>>,
    /// The rule that maps a value to its cell.
    #[serde(skip)]
    lookup: CellLookup,
}

#[derive(Clone, Debug, PartialEq)]
enum CellLookup {
    /// Blocks of this many neighbouring values; the last may have fewer.
    Blocks(usize),
    /// A cell for each picked value, and none for other values.
    Picked,
    /// The cell between whose borders a value lies: an axis that is known by its range alone.
    Borders,
}

impl GridAxis {
    /// Returns an axis whose cells are blocks of `size` neighbouring values.
    fn with_blocks(axis: &SweptAxis, size: usize) -> Self {
        let coordinates = axis.coordinates(&axis.values);
        let last_index = coordinates.len() - 1;
        let block_starts = (0..coordinates.len()).step_by(size);
        let block_ends: Vec<_> =
            block_starts.map(|start| [start, (start + size - 1).min(last_index)]).collect();
        let middle_coordinate =
            |[from, to]: [usize; 2]| (coordinates[from] + coordinates[to]) / 2.0;
        let (first_half, last_half) = if last_index == 0 {
            // A single value gets a cell with a width, so that it is visible.
            let half_step = if axis.is_log || coordinates[0] == 0.0 {
                0.5
            } else {
                0.05 * coordinates[0].abs()
            };
            (half_step, half_step)
        } else {
            (
                middle_coordinate([0, 1]) - coordinates[0],
                coordinates[last_index] - middle_coordinate([last_index - 1, last_index]),
            )
        };
        let mut borders = vec![coordinates[0] - first_half];
        borders
            .extend(block_ends.windows(2).map(|pair| middle_coordinate([pair[0][1], pair[1][0]])));
        borders.push(coordinates[last_index] + last_half);
        let borders = borders.into_iter().map(|border| axis.from_coordinate(border)).collect();
        let lookup = CellLookup::Blocks(size);
        if size == 1 {
            return Self { lookup, ..Self::new(axis, axis.values.clone(), borders) };
        }
        let block_values = block_ends
            .iter()
            .map(|block| axis.from_coordinate(middle_coordinate(*block)))
            .collect();
        let spans = block_ends.iter().map(|block| block.map(|end| axis.values[end])).collect();
        Self { spans: Some(spans), lookup, ..Self::new(axis, block_values, borders) }
    }

    /// Returns an axis that is known by its range alone, in `count` equal cells.
    fn with_equal_cells(axis: &SweptAxis, count: usize) -> Self {
        let coordinates = axis.coordinates(&axis.values);
        let border_coordinate =
            |k: usize| coordinates[0] + (coordinates[1] - coordinates[0]) * k as f64 / count as f64;
        let borders: Vec<f64> =
            (0..=count).map(|k| axis.from_coordinate(border_coordinate(k))).collect();
        let cell_values = (0..count)
            .map(|k| axis.from_coordinate((border_coordinate(k) + border_coordinate(k + 1)) / 2.0))
            .collect();
        let spans = borders.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        Self { spans: Some(spans), ..Self::new(axis, cell_values, borders) }
    }

    /// Returns an axis with cells for some picked values.
    fn with_picks(axis: &SweptAxis, picks: &[usize]) -> Self {
        let picked_values: Vec<f64> = picks.iter().map(|&pick| axis.values[pick]).collect();
        let axis_of_picks = SweptAxis { values: picked_values, ..axis.clone() };
        Self { lookup: CellLookup::Picked, ..Self::with_blocks(&axis_of_picks, 1) }
    }

    fn new(axis: &SweptAxis, values: Vec<f64>, borders: Vec<f64>) -> Self {
        Self { swept_axis: axis.clone(), values, borders, spans: None, lookup: CellLookup::Borders }
    }

    /// Returns the scale from the first border to the last.
    pub(crate) fn scale(&self) -> AxisScale {
        AxisScale {
            is_log: self.swept_axis.is_log,
            from: self.borders[0],
            to: self.borders[self.borders.len() - 1],
        }
    }

    pub(crate) fn label(&self) -> String {
        label::with_unit(&self.swept_axis.words, &self.swept_axis.unit)
    }

    /// Returns the coordinates of the cells along the axis: logarithms on a logarithmic axis.
    pub(crate) fn coordinates(&self) -> Vec<f64> {
        self.swept_axis.coordinates(&self.values)
    }

    /// Returns the index of the cell of one of the axis' values; `None` if it is not shown.
    pub(crate) fn cell_index(&self, value: f64) -> Option<usize> {
        let axis_values = &self.swept_axis.values;
        let value_index = axis_values.partition_point(|known| *known < value);
        match self.lookup {
            CellLookup::Blocks(size) => Some(value_index.min(axis_values.len() - 1) / size),
            CellLookup::Picked => axis_values
                .get(value_index)
                .is_some_and(|known| *known == value)
                .then_some(value_index),
            CellLookup::Borders => {
                let value_index = self.borders.partition_point(|&border| border <= value);
                Some(value_index.clamp(1, self.values.len()) - 1)
            }
        }
    }

    /// Returns the index of the cell of a value that was rounded when it was written as text.
    pub(crate) fn cell_index_near(&self, value: f64) -> Option<usize> {
        if self.lookup == CellLookup::Borders {
            return self.cell_index(value);
        }
        let value_on_axis = self
            .swept_axis
            .values
            .iter()
            .find(|&&value_on_axis| SweptAxis::is_same_value(value_on_axis, value))?;
        self.cell_index(*value_on_axis)
    }

    /// Returns the number of the axis' values in a cell; `None` if it is not known.
    fn value_count(&self, cell: usize) -> Option<usize> {
        match self.lookup {
            CellLookup::Blocks(size) => Some(size.min(self.swept_axis.values.len() - cell * size)),
            CellLookup::Picked => Some(1),
            CellLookup::Borders => None,
        }
    }
}

/// The cells of a map on the grid of its axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    /// The axes in file order; the first varies slowest.
    pub(crate) axes: Vec<GridAxis>,
    /// The maximum number of values of the first two axes in a cell; `None` for an axis that is
    /// known by its range alone.
    pub(crate) block_sizes: [Option<usize>; 2],
}

impl Grid {
    /// Returns a grid of about `max_cells` cells at most. Cells of the first two axes are blocks if
    /// there are more points; every axis after them has its picked values.
    pub(crate) fn new(axes: &[SweptAxis], picks: &[Vec<usize>], max_cells: usize) -> Self {
        let cut_count: usize = picks.iter().map(Vec::len).product();
        let value_count =
            |axis: &SweptAxis| if axis.is_complete { axis.values.len() } else { MAX_AXIS_VALUES };
        let counts = [0, 1].map(|k| axes.get(k).map_or(1, value_count));
        let cell_counts = cells_along_axes(counts, max_cells / cut_count.max(1));
        let mut block_sizes = [Some(1); 2];
        let mut grid_axes: Vec<GridAxis> = Vec::with_capacity(axes.len());
        for (k, axis) in axes.iter().take(2).enumerate() {
            block_sizes[k] = axis.is_complete.then(|| counts[k].div_ceil(cell_counts[k]));
            grid_axes.push(match block_sizes[k] {
                Some(size) => GridAxis::with_blocks(axis, size),
                None => GridAxis::with_equal_cells(axis, cell_counts[k]),
            });
        }
        let cut_axes = axes.iter().skip(2).zip(picks);
        grid_axes.extend(cut_axes.map(|(axis, picks)| GridAxis::with_picks(axis, picks)));
        Self { axes: grid_axes, block_sizes }
    }

    /// Returns whether a cell can hold more than one point.
    pub(crate) fn merges_points(&self) -> bool {
        self.block_sizes != [Some(1); 2]
    }

    /// Returns the number of cells.
    pub(crate) fn cell_count(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Returns the index of a cell in grid order, from its index on each axis.
    pub(crate) fn flat_index(&self, cell_of_axes: impl IntoIterator<Item = usize>) -> usize {
        self.axes
            .iter()
            .zip(cell_of_axes)
            .fold(0, |index, (axis, cell)| index * axis.values.len() + cell)
    }

    /// Returns the index of the cell at `x` of the first axis, `y` of the second and
    /// `further_indices` of the others.
    pub(crate) fn cell(&self, x: usize, y: usize, further_indices: &[usize]) -> usize {
        self.flat_index([x, y].into_iter().chain(further_indices.iter().copied()))
    }

    /// Returns the number of grid points of a cell; `None` if it is not known.
    pub(crate) fn point_count(&self, cell: usize) -> Option<usize> {
        let mut remaining_index = cell;
        self.axes.iter().rev().try_fold(1, |points: usize, axis| {
            let cell = remaining_index % axis.values.len();
            remaining_index /= axis.values.len();
            points.checked_mul(axis.value_count(cell)?)
        })
    }

    /// Returns the subtitle's note on cells of several points; `None` if each cell is one point.
    pub(crate) fn merge_note(&self) -> Option<String> {
        let phrase = match self.block_sizes {
            [Some(1), Some(1)] => return None,
            [Some(columns), Some(1)] => format!("{columns} points"),
            [Some(1), Some(rows)] => format!("{rows} points"),
            [Some(columns), Some(rows)] => format!("{columns} by {rows} points"),
            _ => "many points".to_owned(),
        };
        Some(format!("a cell holds {phrase} and shows the worst"))
    }
}

/// Returns the number of cells along two axes for at most `max_cells` cells in all, shared as
/// equally as the counts allow.
fn cells_along_axes(counts: [usize; 2], max_cells: usize) -> [usize; 2] {
    let [x, y] = counts;
    let max_cells = max_cells.max(1);
    if x.checked_mul(y).is_some_and(|cells| cells <= max_cells) {
        return counts;
    }
    let even_count = max_cells.isqrt();
    match (x <= even_count, y <= even_count) {
        (true, _) => [x, max_cells / x],
        (_, true) => [max_cells / y, y],
        _ => [even_count, even_count],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn test_axis(values: &[f64], is_log: bool) -> SweptAxis {
        SweptAxis {
            name: String::new(),
            words: String::new(),
            unit: String::new(),
            values: values.to_vec(),
            is_log,
            is_complete: true,
        }
    }

    #[test]
    fn borders_lie_halfway_between_values() {
        let borders = |values: &[f64], log_borders| {
            GridAxis::with_blocks(&test_axis(values, log_borders), 1).borders
        };
        assert_eq!(borders(&[1.0, 2.0, 4.0], false), [0.5, 1.5, 3.0, 5.0]);
        assert_eq!(borders(&[10.0], false), [9.5, 10.5]);
        let log_borders = borders(&[1.0, 100.0], true);
        assert!(
            (log_borders[0] - 0.1).abs() < 1e-12
                && (log_borders[1] - 10.0).abs() < 1e-9
                && (log_borders[2] - 1000.0).abs() < 1e-6
        );
    }

    #[test]
    fn each_value_lies_in_its_block() {
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let axis_of_blocks = GridAxis::with_blocks(&test_axis(&values, false), 4);
        assert_eq!(axis_of_blocks.values, [1.5, 5.5, 8.5]);
        assert_eq!(axis_of_blocks.borders, [-0.5, 3.5, 7.5, 9.5]);
        assert_eq!(axis_of_blocks.spans, Some(vec![[0.0, 3.0], [4.0, 7.0], [8.0, 9.0]]));
        let found_cells: Vec<Option<usize>> =
            values.iter().map(|value| axis_of_blocks.cell_index(*value)).collect();
        let expected_cells = [0, 0, 0, 0, 1, 1, 1, 1, 2, 2].map(Some);
        assert_eq!(found_cells, expected_cells);
        assert_eq!(
            [0, 1, 2].map(|cell| axis_of_blocks.value_count(cell)),
            [Some(4), Some(4), Some(2)]
        );
    }

    #[test]
    fn an_axis_known_by_its_range_has_equal_cells() {
        let axis_with_range = SweptAxis { is_complete: false, ..test_axis(&[0.0, 8.0], false) };
        let axis_by_range = GridAxis::with_equal_cells(&axis_with_range, 4);
        assert_eq!(axis_by_range.borders, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(
            [0.0, 1.9, 2.0, 7.9, 8.0].map(|value| axis_by_range.cell_index(value)),
            [0, 0, 1, 3, 3].map(Some)
        );
        assert_eq!(axis_by_range.value_count(0), None);
    }

    #[test]
    fn only_picked_values_have_a_cell() {
        let axis_of_picks = GridAxis::with_picks(&test_axis(&[1.0, 2.0, 3.0, 4.0], false), &[0, 3]);
        assert_eq!(
            [1.0, 2.0, 3.0, 4.0].map(|value| axis_of_picks.cell_index(value)),
            [Some(0), None, None, Some(1)]
        );
    }

    #[test]
    fn the_number_of_cells_stays_within_the_limit() {
        for counts in
            [[1000, 1000], [4000, 2500], [10_000_000, 1], [3, 1_000_000], [39, 33], [1, 1]]
        {
            for max_cells in [1, 7, 100, 35_000, 131_072] {
                let [x, y] = cells_along_axes(counts, max_cells);
                assert!(x * y <= max_cells.max(1), "{counts:?} in {max_cells}: {x} by {y}");
                assert!(
                    x >= 1 && y >= 1 && x <= counts[0] && y <= counts[1],
                    "{counts:?} in {max_cells}: {x} by {y}"
                );
            }
        }
        assert_eq!(cells_along_axes([39, 33], 1287), [39, 33]);
        assert_eq!(cells_along_axes([3, 1_000_000], 131_072), [3, 43_690]);
    }
}
