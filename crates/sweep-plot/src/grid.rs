//! The cells of a map: one for each grid point, or one for a block of points if there are more than
//! a figure can show.

use super::axis::AxisScale;
use super::label;
use super::swept::{MAX_VALUES, SweptAxis};

/// A swept parameter with the cells along it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(crate) struct GridAxis {
    /// The parameter with its values.
    #[serde(flatten)]
    pub(crate) swept: SweptAxis,
    /// The rising value of each cell; the middle of a block.
    pub(crate) values: Vec<f64>,
    /// The borders of the cells, one more than there are cells: halfway between neighbours.
    pub(crate) borders: Vec<f64>,
    /// The first and the last value of each block; `None` if each cell has one value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) spans: Option<Vec<[f64; 2]>>,
    /// The rule that maps a value to its cell.
    #[serde(skip)]
    places: CellLookup,
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
    fn in_blocks(axis: &SweptAxis, size: usize) -> Self {
        let coordinates = axis.coordinates(&axis.values);
        let last = coordinates.len() - 1;
        let starts = (0..coordinates.len()).step_by(size);
        let blocks: Vec<_> = starts.map(|start| [start, (start + size - 1).min(last)]).collect();
        let middle = |[from, to]: [usize; 2]| (coordinates[from] + coordinates[to]) / 2.0;
        let (first_half, last_half) = if last == 0 {
            // A single value gets a cell with a width, so that it is visible.
            let half =
                if axis.log || coordinates[0] == 0.0 { 0.5 } else { 0.05 * coordinates[0].abs() };
            (half, half)
        } else {
            (middle([0, 1]) - coordinates[0], coordinates[last] - middle([last - 1, last]))
        };
        let mut borders = vec![coordinates[0] - first_half];
        borders.extend(blocks.windows(2).map(|pair| middle([pair[0][1], pair[1][0]])));
        borders.push(coordinates[last] + last_half);
        let borders = borders.into_iter().map(|border| axis.from_coordinate(border)).collect();
        let places = CellLookup::Blocks(size);
        if size == 1 {
            return Self { places, ..Self::new(axis, axis.values.clone(), borders) };
        }
        let values = blocks.iter().map(|block| axis.from_coordinate(middle(*block))).collect();
        let spans = blocks.iter().map(|block| block.map(|end| axis.values[end])).collect();
        Self { spans: Some(spans), places, ..Self::new(axis, values, borders) }
    }

    /// Returns an axis that is known by its range alone, in `count` equal cells.
    fn in_parts(axis: &SweptAxis, count: usize) -> Self {
        let coordinates = axis.coordinates(&axis.values);
        let border =
            |k: usize| coordinates[0] + (coordinates[1] - coordinates[0]) * k as f64 / count as f64;
        let borders: Vec<f64> = (0..=count).map(|k| axis.from_coordinate(border(k))).collect();
        let values =
            (0..count).map(|k| axis.from_coordinate((border(k) + border(k + 1)) / 2.0)).collect();
        let spans = borders.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        Self { spans: Some(spans), ..Self::new(axis, values, borders) }
    }

    /// Returns an axis with cells for some picked values.
    fn picked(axis: &SweptAxis, picks: &[usize]) -> Self {
        let values: Vec<f64> = picks.iter().map(|&pick| axis.values[pick]).collect();
        let shown = SweptAxis { values, ..axis.clone() };
        Self { places: CellLookup::Picked, ..Self::in_blocks(&shown, 1) }
    }

    fn new(axis: &SweptAxis, values: Vec<f64>, borders: Vec<f64>) -> Self {
        Self { swept: axis.clone(), values, borders, spans: None, places: CellLookup::Borders }
    }

    /// Returns the scale from the first border to the last.
    pub(crate) fn scale(&self) -> AxisScale {
        AxisScale {
            log: self.swept.log,
            from: self.borders[0],
            to: self.borders[self.borders.len() - 1],
        }
    }

    pub(crate) fn label(&self) -> String {
        label::with_unit(&self.swept.words, &self.swept.unit)
    }

    /// Returns the coordinates of the cells along the axis: logarithms on a logarithmic axis.
    pub(crate) fn coordinates(&self) -> Vec<f64> {
        self.swept.coordinates(&self.values)
    }

    /// Returns the index of the cell of one of the axis' values; `None` if it is not shown.
    pub(crate) fn place(&self, value: f64) -> Option<usize> {
        let values = &self.swept.values;
        let place = values.partition_point(|known| *known < value);
        match self.places {
            CellLookup::Blocks(size) => Some(place.min(values.len() - 1) / size),
            CellLookup::Picked => {
                values.get(place).is_some_and(|known| *known == value).then_some(place)
            }
            CellLookup::Borders => {
                let place = self.borders.partition_point(|&border| border <= value);
                Some(place.clamp(1, self.values.len()) - 1)
            }
        }
    }

    /// Returns the index of the cell of a value that was rounded when it was written as text.
    pub(crate) fn place_near(&self, value: f64) -> Option<usize> {
        if self.places == CellLookup::Borders {
            return self.place(value);
        }
        let known = self.swept.values.iter().find(|&&known| SweptAxis::is_near(known, value))?;
        self.place(*known)
    }

    /// Returns the number of the axis' values in a cell; `None` if it is not known.
    fn shared(&self, place: usize) -> Option<usize> {
        match self.places {
            CellLookup::Blocks(size) => Some(size.min(self.swept.values.len() - place * size)),
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
    pub(crate) block: [Option<usize>; 2],
}

impl Grid {
    /// Returns a grid of about `most` cells at most. Cells of the first two axes are blocks if
    /// there are more points; every axis after them has its picked values.
    pub(crate) fn new(axes: &[SweptAxis], picks: &[Vec<usize>], most: usize) -> Self {
        let cuts: usize = picks.iter().map(Vec::len).product();
        let wanted = |axis: &SweptAxis| if axis.complete { axis.values.len() } else { MAX_VALUES };
        let counts = [0, 1].map(|k| axes.get(k).map_or(1, wanted));
        let shown = sides(counts, most / cuts.max(1));
        let mut block = [Some(1); 2];
        let mut grid: Vec<GridAxis> = Vec::with_capacity(axes.len());
        for (k, axis) in axes.iter().take(2).enumerate() {
            block[k] = axis.complete.then(|| counts[k].div_ceil(shown[k]));
            grid.push(match block[k] {
                Some(size) => GridAxis::in_blocks(axis, size),
                None => GridAxis::in_parts(axis, shown[k]),
            });
        }
        let cut = axes.iter().skip(2).zip(picks);
        grid.extend(cut.map(|(axis, picks)| GridAxis::picked(axis, picks)));
        Self { axes: grid, block }
    }

    /// Returns whether a cell can hold more than one point.
    pub(crate) fn merged(&self) -> bool {
        self.block != [Some(1); 2]
    }

    /// Returns the number of cells.
    pub(crate) fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Returns the index of a cell in grid order, from its index on each axis.
    pub(crate) fn index(&self, at: impl IntoIterator<Item = usize>) -> usize {
        self.axes.iter().zip(at).fold(0, |index, (axis, place)| index * axis.values.len() + place)
    }

    /// Returns the index of the cell at `x` of the first axis, `y` of the second and `rest` of the
    /// others.
    pub(crate) fn cell(&self, x: usize, y: usize, rest: &[usize]) -> usize {
        self.index([x, y].into_iter().chain(rest.iter().copied()))
    }

    /// Returns the number of grid points of a cell; `None` if it is not known.
    pub(crate) fn points(&self, cell: usize) -> Option<usize> {
        let mut rest = cell;
        self.axes.iter().rev().try_fold(1, |points: usize, axis| {
            let place = rest % axis.values.len();
            rest /= axis.values.len();
            points.checked_mul(axis.shared(place)?)
        })
    }

    /// Returns the subtitle's note on cells of several points; `None` if each cell is one point.
    pub(crate) fn note(&self) -> Option<String> {
        let phrase = match self.block {
            [Some(1), Some(1)] => return None,
            [Some(x), Some(1)] => format!("{x} points"),
            [Some(1), Some(y)] => format!("{y} points"),
            [Some(x), Some(y)] => format!("{x} by {y} points"),
            _ => "many points".to_owned(),
        };
        Some(format!("a cell holds {phrase} and shows the worst"))
    }
}

/// Returns the number of cells along two axes for at most `most` cells in all, shared as equally as
/// the counts allow.
fn sides(counts: [usize; 2], most: usize) -> [usize; 2] {
    let [x, y] = counts;
    let most = most.max(1);
    if x.checked_mul(y).is_some_and(|cells| cells <= most) {
        return counts;
    }
    let side = most.isqrt();
    match (x <= side, y <= side) {
        (true, _) => [x, most / x],
        (_, true) => [most / y, y],
        _ => [side, side],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: &[f64], log: bool) -> SweptAxis {
        SweptAxis {
            name: String::new(),
            words: String::new(),
            unit: String::new(),
            values: values.to_vec(),
            log,
            complete: true,
        }
    }

    #[test]
    fn borders_lie_halfway_between_values() {
        let borders = |values: &[f64], log| GridAxis::in_blocks(&axis(values, log), 1).borders;
        assert_eq!(borders(&[1.0, 2.0, 4.0], false), [0.5, 1.5, 3.0, 5.0]);
        assert_eq!(borders(&[10.0], false), [9.5, 10.5]);
        let log = borders(&[1.0, 100.0], true);
        assert!(
            (log[0] - 0.1).abs() < 1e-12
                && (log[1] - 10.0).abs() < 1e-9
                && (log[2] - 1000.0).abs() < 1e-6
        );
    }

    #[test]
    fn each_value_lies_in_its_block() {
        let values: Vec<f64> = (0..10).map(f64::from).collect();
        let blocks = GridAxis::in_blocks(&axis(&values, false), 4);
        assert_eq!(blocks.values, [1.5, 5.5, 8.5]);
        assert_eq!(blocks.borders, [-0.5, 3.5, 7.5, 9.5]);
        assert_eq!(blocks.spans, Some(vec![[0.0, 3.0], [4.0, 7.0], [8.0, 9.0]]));
        let places: Vec<Option<usize>> = values.iter().map(|value| blocks.place(*value)).collect();
        let expected = [0, 0, 0, 0, 1, 1, 1, 1, 2, 2].map(Some);
        assert_eq!(places, expected);
        assert_eq!([0, 1, 2].map(|place| blocks.shared(place)), [Some(4), Some(4), Some(2)]);
    }

    #[test]
    fn an_axis_known_by_its_range_has_equal_cells() {
        let range = SweptAxis { complete: false, ..axis(&[0.0, 8.0], false) };
        let parts = GridAxis::in_parts(&range, 4);
        assert_eq!(parts.borders, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(
            [0.0, 1.9, 2.0, 7.9, 8.0].map(|value| parts.place(value)),
            [0, 0, 1, 3, 3].map(Some)
        );
        assert_eq!(parts.shared(0), None);
    }

    #[test]
    fn only_picked_values_have_a_cell() {
        let picked = GridAxis::picked(&axis(&[1.0, 2.0, 3.0, 4.0], false), &[0, 3]);
        assert_eq!(
            [1.0, 2.0, 3.0, 4.0].map(|value| picked.place(value)),
            [Some(0), None, None, Some(1)]
        );
    }

    #[test]
    fn the_number_of_cells_stays_within_the_limit() {
        for counts in
            [[1000, 1000], [4000, 2500], [10_000_000, 1], [3, 1_000_000], [39, 33], [1, 1]]
        {
            for most in [1, 7, 100, 35_000, 131_072] {
                let [x, y] = sides(counts, most);
                assert!(x * y <= most.max(1), "{counts:?} in {most}: {x} by {y}");
                assert!(
                    x >= 1 && y >= 1 && x <= counts[0] && y <= counts[1],
                    "{counts:?} in {most}: {x} by {y}"
                );
            }
        }
        assert_eq!(sides([39, 33], 1287), [39, 33]);
        assert_eq!(sides([3, 1_000_000], 131_072), [3, 43_690]);
    }
}
