//! The cells of a map: one for each grid point, or for a block of them where a figure could not
//! show so many.

use super::axis::Scale;
use super::label;
use super::swept::{MOST_VALUES, SweptAxis};

/// A swept parameter as the map shows it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(crate) struct GridAxis {
    /// The parameter with its values.
    #[serde(flatten)]
    pub(crate) swept: SweptAxis,
    /// Rising: the value of each place, of a block the middle.
    pub(crate) values: Vec<f64>,
    /// The borders of the cells around the values, one more than those: halfway between neighbours.
    pub(crate) borders: Vec<f64>,
    /// First and last value of each block; none where each value has a place of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) spans: Option<Vec<[f64; 2]>>,
    /// How a value finds its place.
    #[serde(skip)]
    places: Places,
}

#[derive(Clone, Debug, PartialEq)]
enum Places {
    /// This many neighbouring values share a place, fewer the last one.
    Blocks(usize),
    /// The values have a place, and no others.
    Picked,
    /// The borders place a value, where an axis is known by its range alone.
    Borders,
}

impl GridAxis {
    /// An axis whose neighbouring values share a place, `size` of them each.
    fn in_blocks(axis: &SweptAxis, size: usize) -> Self {
        let even = axis.evened(&axis.values);
        let last = even.len() - 1;
        let starts = (0..even.len()).step_by(size);
        let blocks: Vec<_> = starts.map(|start| [start, (start + size - 1).min(last)]).collect();
        let middle = |[from, to]: [usize; 2]| (even[from] + even[to]) / 2.0;
        let (first_half, last_half) = if last == 0 {
            // A lone value gets a cell of its own size, so that there is something to see.
            let half = if axis.log || even[0] == 0.0 { 0.5 } else { 0.05 * even[0].abs() };
            (half, half)
        } else {
            (middle([0, 1]) - even[0], even[last] - middle([last - 1, last]))
        };
        let mut borders = vec![even[0] - first_half];
        borders.extend(blocks.windows(2).map(|pair| middle([pair[0][1], pair[1][0]])));
        borders.push(even[last] + last_half);
        let borders = borders.into_iter().map(|border| axis.un_even(border)).collect();
        let places = Places::Blocks(size);
        if size == 1 {
            return Self { places, ..Self::new(axis, axis.values.clone(), borders) };
        }
        let values = blocks.iter().map(|block| axis.un_even(middle(*block))).collect();
        let spans = blocks.iter().map(|block| block.map(|end| axis.values[end])).collect();
        Self { spans: Some(spans), places, ..Self::new(axis, values, borders) }
    }

    /// An axis known by its range alone, in `count` equal parts.
    fn in_parts(axis: &SweptAxis, count: usize) -> Self {
        let even = axis.evened(&axis.values);
        let border = |k: usize| even[0] + (even[1] - even[0]) * k as f64 / count as f64;
        let borders: Vec<f64> = (0..=count).map(|k| axis.un_even(border(k))).collect();
        let values = (0..count).map(|k| axis.un_even((border(k) + border(k + 1)) / 2.0)).collect();
        let spans = borders.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        Self { spans: Some(spans), ..Self::new(axis, values, borders) }
    }

    /// An axis of which some values are shown.
    fn picked(axis: &SweptAxis, picks: &[usize]) -> Self {
        let values: Vec<f64> = picks.iter().map(|&pick| axis.values[pick]).collect();
        let shown = SweptAxis { values, ..axis.clone() };
        Self { places: Places::Picked, ..Self::in_blocks(&shown, 1) }
    }

    fn new(axis: &SweptAxis, values: Vec<f64>, borders: Vec<f64>) -> Self {
        Self { swept: axis.clone(), values, borders, spans: None, places: Places::Borders }
    }

    /// From the first border to the last.
    pub(crate) fn scale(&self) -> Scale {
        Scale {
            log: self.swept.log,
            from: self.borders[0],
            to: self.borders[self.borders.len() - 1],
        }
    }

    /// Words and unit.
    pub(crate) fn label(&self) -> String {
        label::with_unit(&self.swept.words, &self.swept.unit)
    }

    /// The values in the units in which the axis is even.
    pub(crate) fn even(&self) -> Vec<f64> {
        self.swept.evened(&self.values)
    }

    /// The place that one of the axis' values belongs to; none if it is not shown.
    pub(crate) fn place(&self, value: f64) -> Option<usize> {
        let values = &self.swept.values;
        let place = values.partition_point(|known| *known < value);
        match self.places {
            Places::Blocks(size) => Some(place.min(values.len() - 1) / size),
            Places::Picked => {
                values.get(place).is_some_and(|known| *known == value).then_some(place)
            }
            Places::Borders => {
                let place = self.borders.partition_point(|&border| border <= value);
                Some(place.clamp(1, self.values.len()) - 1)
            }
        }
    }

    /// The place of the axis' value that a number is, but for what writing it as text may have
    /// lost.
    pub(crate) fn place_near(&self, value: f64) -> Option<usize> {
        if self.places == Places::Borders {
            return self.place(value);
        }
        let known = self.swept.values.iter().find(|&&known| SweptAxis::near(known, value))?;
        self.place(*known)
    }

    /// How many of the axis' values share a place; none where that is not known.
    fn shared(&self, place: usize) -> Option<usize> {
        match self.places {
            Places::Blocks(size) => Some(size.min(self.swept.values.len() - place * size)),
            Places::Picked => Some(1),
            Places::Borders => None,
        }
    }
}

/// The cells of a map, on the grid of its axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    /// In file order; the first varies slowest.
    pub(crate) axes: Vec<GridAxis>,
    /// Most values of the first two axes in a cell; none where an axis is known by its range alone.
    pub(crate) block: [Option<usize>; 2],
}

impl Grid {
    /// At most about `most` cells: those of the first two axes, merged into blocks where there are
    /// more, for each of the values picked of every axis after them.
    pub(crate) fn new(axes: &[SweptAxis], picks: &[Vec<usize>], most: usize) -> Self {
        let cuts: usize = picks.iter().map(Vec::len).product();
        let wanted = |axis: &SweptAxis| if axis.complete { axis.values.len() } else { MOST_VALUES };
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

    /// Whether a cell can hold more than one point.
    pub(crate) fn merged(&self) -> bool {
        self.block != [Some(1); 2]
    }

    /// How many cells there are.
    pub(crate) fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Index of a cell in grid order, from its place on each axis.
    pub(crate) fn index(&self, at: impl IntoIterator<Item = usize>) -> usize {
        self.axes.iter().zip(at).fold(0, |index, (axis, place)| index * axis.values.len() + place)
    }

    /// Index of the cell at `x` on the first axis, `y` on the second, and `rest` on those after.
    pub(crate) fn cell(&self, x: usize, y: usize, rest: &[usize]) -> usize {
        self.index([x, y].into_iter().chain(rest.iter().copied()))
    }

    /// How many grid points a cell has; none where that is not known.
    pub(crate) fn points(&self, cell: usize) -> Option<usize> {
        let mut rest = cell;
        self.axes.iter().rev().try_fold(1, |points: usize, axis| {
            let place = rest % axis.values.len();
            rest /= axis.values.len();
            points.checked_mul(axis.shared(place)?)
        })
    }

    /// What a cell holds, in words, where it can be more than one point.
    pub(crate) fn note(&self) -> Option<String> {
        let said = match self.block {
            [Some(1), Some(1)] => return None,
            [Some(x), Some(1)] => format!("{x} points"),
            [Some(1), Some(y)] => format!("{y} points"),
            [Some(x), Some(y)] => format!("{x} by {y} points"),
            _ => "many points".to_owned(),
        };
        Some(format!("a cell holds {said} and shows the worst"))
    }
}

/// How many places each of two axes gets so that there are at most `most` cells: as even a share as
/// their counts allow.
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
    fn cells_meet_halfway_and_the_outer_ones_are_whole() {
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
    fn blocks_hold_their_values_and_no_others() {
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
    fn an_axis_known_by_its_range_is_cut_into_equal_parts() {
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
    fn picked_values_alone_have_a_place() {
        let picked = GridAxis::picked(&axis(&[1.0, 2.0, 3.0, 4.0], false), &[0, 3]);
        assert_eq!(
            [1.0, 2.0, 3.0, 4.0].map(|value| picked.place(value)),
            [Some(0), None, None, Some(1)]
        );
    }

    #[test]
    fn cells_stay_within_what_is_asked_for() {
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
