//! How far a boundary moved.

use std::collections::BTreeMap;

use serde::Serialize;

use super::SharedRow;
use crate::error::{Result, ResultsError};
use sweep_files::ResultTable;

/// One change of side along the second axis, in both files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Crossing {
    /// Values of the other axes.
    pub place: Vec<f64>,
    /// Its number along the second axis, from 1.
    pub number: usize,
    /// Where it is in either file: between the ends of a bracket.
    pub at: [f64; 2],
    /// The bracket of either file.
    pub bracket: [[f64; 2]; 2],
}

impl Crossing {
    /// How far it may have moved, by its brackets: the least and the greatest.
    pub fn by(&self) -> [f64; 2] {
        let [[first_low, first_high], [second_low, second_high]] = self.bracket;
        if self.at[0] == self.at[1] && self.bracket[0] == self.bracket[1] {
            return [0.0; 2];
        }
        [second_low - first_high, second_high - first_low]
    }

    /// How far it moved at least: the distance of the brackets, 0 where they overlap.
    pub fn at_least(&self) -> f64 {
        let [least, greatest] = self.by();
        least.max(-greatest).max(0.0)
    }
}

/// How a boundary moved along the second axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moved {
    /// Name of the second axis.
    pub axis: String,
    /// Its unit.
    pub unit: String,
    /// Names of the axes of [`Crossing::place`].
    pub keys: Vec<String>,
    /// Crossings that are in both files, in order.
    pub crossings: Vec<Crossing>,
    /// Lines along the second axis with other numbers of crossings: the place, and the numbers.
    pub unlike: Vec<(Vec<f64>, [usize; 2])>,
}

impl Moved {
    /// The crossing that moved farthest, for certain or else perhaps.
    pub fn farthest(&self) -> Option<&Crossing> {
        let perhaps = |crossing: &Crossing| (crossing.at[1] - crossing.at[0]).abs();
        self.crossings.iter().max_by(|a, b| {
            a.at_least().total_cmp(&b.at_least()).then(perhaps(a).total_cmp(&perhaps(b)))
        })
    }

    /// How far crossings moved in the mean, with sign: the least and the greatest by their
    /// brackets; `None` without any.
    pub fn mean(&self) -> Option<[f64; 2]> {
        let count = self.crossings.len() as f64;
        let mean = |end| self.crossings.iter().map(|one| one.by()[end]).sum::<f64>() / count;
        (!self.crossings.is_empty()).then(|| [0, 1].map(mean))
    }

    /// Crossings that moved farther than their brackets explain.
    pub fn certain(&self) -> usize {
        self.crossings.iter().filter(|crossing| crossing.at_least() > 0.0).count()
    }
}

/// Where a file crosses its limit along one line: the place and the bracket.
type Found = (f64, [f64; 2]);
/// The crossings of both files by line.
type Lines = BTreeMap<Vec<u64>, (Vec<f64>, [Vec<Found>; 2])>;

fn moved(first: &ResultTable, axis: &str, keys: Vec<String>, lines: Lines) -> Moved {
    let (mut crossings, mut unlike) = (Vec::new(), Vec::new());
    for (place, [first, second]) in lines.into_values() {
        if first.len() != second.len() {
            unlike.push((place, [first.len(), second.len()]));
            continue;
        }
        for (k, (first, second)) in first.into_iter().zip(second).enumerate() {
            crossings.push(Crossing {
                place: place.clone(),
                number: k + 1,
                at: [first.0, second.0],
                bracket: [first.1, second.1],
            });
        }
    }
    let unit = first.column(axis).map(|column| column.unit.clone()).unwrap_or_default();
    Moved { axis: axis.to_owned(), unit, keys, crossings, unlike }
}

/// Numbers in order, as a key.
fn ordered(place: &[f64]) -> Vec<u64> {
    let key = |value: &f64| {
        let bits = (value + 0.0).to_bits();
        // Negative numbers before positive ones, by size.
        if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
    };
    place.iter().map(key).collect()
}

/// From two boundary files.
pub(super) fn of_boundaries(first: &ResultTable, second: &ResultTable) -> Result<Option<Moved>> {
    let (names, others) = (first.axes(), second.axes());
    let [_, axis, ..] = names[..] else { return Ok(None) };
    let keys: Vec<&str> =
        names.iter().copied().filter(|name| *name != axis && others.contains(name)).collect();
    let mut lines = Lines::new();
    for (side, table) in [first, second].into_iter().enumerate() {
        let bracket = ["_low", "_high"].map(|word| {
            let stem = table.columns.iter().find(|column| {
                column.name.contains(word) && column.name.replacen(word, "", 1) == axis
            });
            stem.map(|column| column.name.as_str()).unwrap_or_default()
        });
        let mut read = keys.clone();
        read.extend([axis, bracket[0], bracket[1]]);
        table.file().each_row(&read, |row| {
            let number = |place: usize| row.cell(place).number();
            let place: Option<Vec<f64>> = (0..keys.len()).map(number).collect();
            let Some(place) = place else { return Ok(()) };
            let line = lines.entry(ordered(&place)).or_insert_with(|| (place, Default::default()));
            let count = keys.len();
            if let (Some(low), Some(high)) = (number(count + 1), number(count + 2)) {
                let at = number(count).unwrap_or(f64::midpoint(low, high));
                line.1[side].push((at, [low, high]));
            }
            Ok::<(), ResultsError>(())
        })?;
    }
    let keys = keys.into_iter().map(str::to_owned).collect();
    Ok(Some(moved(first, axis, keys, lines)))
}

/// From the verdicts of two maps: between neighbours along the second axis whose verdicts differ.
pub(super) fn of_maps(first: &ResultTable, keys: &[String], shared: &[SharedRow]) -> Option<Moved> {
    let limit = first.plan.as_ref()?["reliability"]["ratio_limit"].as_f64()?;
    // The points of a design have no neighbours along an axis.
    if keys.len() < 2 || first.plan.as_ref()?.get("design").is_some() {
        return None;
    }
    let mut others = keys.to_vec();
    let axis = others.remove(1);
    let mut rows: BTreeMap<Vec<u64>, (Vec<f64>, Vec<&SharedRow>)> = BTreeMap::new();
    for row in shared {
        let mut place = row.place.clone();
        place.remove(1);
        rows.entry(ordered(&place)).or_insert_with(|| (place, Vec::new())).1.push(row);
    }
    let mut lines = Lines::new();
    for (key, (place, mut line)) in rows {
        line.sort_by(|a, b| a.place[1].total_cmp(&b.place[1]));
        let crossings = [0, 1].map(|side| {
            line.windows(2)
                .filter_map(|pair| {
                    let [below, above] = [pair[0], pair[1]];
                    let [low, high] = [below.ratio[side]?, above.ratio[side]?];
                    let bracket = [below.place[1], above.place[1]];
                    let part = (limit / low).ln() / (high / low).ln();
                    let at = bracket[0] + part * (bracket[1] - bracket[0]);
                    ((low < limit) != (high < limit)).then_some((at, bracket))
                })
                .collect()
        });
        lines.insert(key, (place, crossings));
    }
    Some(moved(first, &axis, others, lines))
}
