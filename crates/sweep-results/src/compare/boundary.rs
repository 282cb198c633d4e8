//! The shift of a boundary between two files.

use std::collections::BTreeMap;

use serde::Serialize;

use super::SharedRow;
use crate::error::ResultsError;
use sweep_files::ResultTable;

/// A crossing of the limit along the second axis, in both files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoundaryCrossing {
    /// The values of the other axes.
    #[serde(rename = "place")]
    pub key_values: Vec<f64>,
    /// The index of the crossing among those along the second axis, from 1.
    pub number: usize,
    /// The estimated position in either file, within its bracket.
    #[serde(rename = "at")]
    pub positions: [f64; 2],
    /// The bracket in either file.
    #[serde(rename = "bracket")]
    pub brackets: [[f64; 2]; 2],
}

impl BoundaryCrossing {
    /// Returns the least and the greatest shift that the brackets allow.
    pub fn shift_range(&self) -> [f64; 2] {
        let [[first_low, first_high], [second_low, second_high]] = self.brackets;
        if self.positions[0] == self.positions[1] && self.brackets[0] == self.brackets[1] {
            return [0.0; 2];
        }
        [second_low - first_high, second_high - first_low]
    }

    /// Returns the distance of the brackets: 0 where they overlap.
    pub fn certain_shift(&self) -> f64 {
        let [least, greatest] = self.shift_range();
        least.max(-greatest).max(0.0)
    }
}

/// The shift of a boundary along the second axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoundaryShift {
    /// The name of the second axis.
    pub axis: String,
    /// The unit of the second axis.
    pub unit: String,
    /// The names of the axes of [`BoundaryCrossing::key_values`].
    pub keys: Vec<String>,
    /// The crossings that are in both files, in order.
    pub crossings: Vec<BoundaryCrossing>,
    /// The lines along the second axis on which the two files have different numbers of crossings:
    /// the values of the other axes, and the two numbers.
    pub unmatched_lines: Vec<(Vec<f64>, [usize; 2])>,
}

impl BoundaryShift {
    /// Returns the crossing with the greatest certain shift; if several have it, that with the
    /// greatest estimated shift.
    pub fn most_shifted(&self) -> Option<&BoundaryCrossing> {
        let estimated_shift =
            |crossing: &BoundaryCrossing| (crossing.positions[1] - crossing.positions[0]).abs();
        self.crossings.iter().max_by(|a, b| {
            a.certain_shift()
                .total_cmp(&b.certain_shift())
                .then(estimated_shift(a).total_cmp(&estimated_shift(b)))
        })
    }

    /// Returns the mean of the least shifts and the mean of the greatest shifts that the brackets
    /// allow.
    pub fn mean_shift_range(&self) -> Option<[f64; 2]> {
        if self.crossings.is_empty() {
            return None;
        }
        let count = self.crossings.len() as f64;
        let sum_at_end = |end: usize| {
            self.crossings.iter().map(|crossing| crossing.shift_range()[end]).sum::<f64>()
        };
        Some([sum_at_end(0) / count, sum_at_end(1) / count])
    }

    /// Counts the crossings that shifted farther than their brackets explain.
    pub fn count_certain_shifts(&self) -> usize {
        self.crossings.iter().filter(|crossing| crossing.certain_shift() > 0.0).count()
    }
}

/// A crossing in one file.
struct BracketedCrossing {
    position: f64,
    bracket: [f64; 2],
}

/// The crossings of both files along one line of the second axis.
#[derive(Default)]
struct LineCrossings {
    key_values: Vec<f64>,
    /// The crossings of the first and of the second file.
    crossings_by_file: [Vec<BracketedCrossing>; 2],
}

/// The crossings of each line, sorted by the values of the other axes.
type CrossingsByLine = BTreeMap<Vec<u64>, LineCrossings>;

/// Pairs the crossings of the two files line by line.
fn pair_crossings(
    first_table: &ResultTable,
    axis_name: &str,
    keys: Vec<String>,
    crossings_by_line: CrossingsByLine,
) -> BoundaryShift {
    let mut crossings = Vec::new();
    let mut unmatched_lines = Vec::new();
    for LineCrossings { key_values, crossings_by_file: [first_crossings, second_crossings] } in
        crossings_by_line.into_values()
    {
        if first_crossings.len() != second_crossings.len() {
            unmatched_lines.push((key_values, [first_crossings.len(), second_crossings.len()]));
            continue;
        }
        for (index, (first, second)) in
            first_crossings.into_iter().zip(second_crossings).enumerate()
        {
            crossings.push(BoundaryCrossing {
                key_values: key_values.clone(),
                number: index + 1,
                positions: [first.position, second.position],
                brackets: [first.bracket, second.bracket],
            });
        }
    }
    let unit =
        first_table.column(axis_name).map(|column| column.unit().to_owned()).unwrap_or_default();
    BoundaryShift { axis: axis_name.to_owned(), unit, keys, crossings, unmatched_lines }
}

/// Returns integers that sort in the same order as the numbers.
fn sort_key(values: &[f64]) -> Vec<u64> {
    let order_bits = |value: &f64| {
        let bits = (value + 0.0).to_bits();
        // The bits of negative numbers sort in reverse order.
        if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
    };
    values.iter().map(order_bits).collect()
}

/// Compares two boundary files.
pub(super) fn compare_boundaries(
    first_table: &ResultTable,
    second_table: &ResultTable,
) -> Result<Option<BoundaryShift>, ResultsError> {
    let axis_names = first_table.axes();
    let axis_names_in_second = second_table.axes();
    let [_, axis, ..] = axis_names[..] else { return Ok(None) };
    let keys: Vec<&str> = axis_names
        .iter()
        .copied()
        .filter(|name| *name != axis && axis_names_in_second.contains(name))
        .collect();
    let mut crossings_by_line = CrossingsByLine::new();
    for (file, table) in [first_table, second_table].into_iter().enumerate() {
        let bracket_columns = ["_low", "_high"].map(|suffix| {
            let column = table.columns.iter().find(|column| {
                column.name.contains(suffix) && column.name.replacen(suffix, "", 1) == axis
            });
            column.map(|column| column.name.as_str()).unwrap_or_default()
        });
        let mut column_names = keys.clone();
        column_names.extend([axis, bracket_columns[0], bracket_columns[1]]);
        table.file().each_row(&column_names, |row| {
            let read_number = |column: usize| row.cell(column).number();
            let key_values: Option<Vec<f64>> = (0..keys.len()).map(read_number).collect();
            let Some(key_values) = key_values else { return Ok(()) };
            let line_crossings = crossings_by_line
                .entry(sort_key(&key_values))
                .or_insert_with(|| LineCrossings { key_values, ..LineCrossings::default() });
            let axis_column = keys.len();
            if let (Some(low), Some(high)) =
                (read_number(axis_column + 1), read_number(axis_column + 2))
            {
                let position = read_number(axis_column).unwrap_or(f64::midpoint(low, high));
                line_crossings.crossings_by_file[file]
                    .push(BracketedCrossing { position, bracket: [low, high] });
            }
            Ok::<(), ResultsError>(())
        })?;
    }
    let keys = keys.into_iter().map(str::to_owned).collect();
    Ok(Some(pair_crossings(first_table, axis, keys, crossings_by_line)))
}

/// Compares the boundaries of two maps: a crossing lies between neighbours along the second axis
/// whose verdicts differ.
pub(super) fn compare_maps(
    first_table: &ResultTable,
    keys: &[String],
    shared_rows: &[SharedRow],
) -> Option<BoundaryShift> {
    let limit = first_table.plan.as_ref()?["reliability"]["ratio_limit"].as_f64()?;
    // The points of a design have no neighbours along an axis.
    if keys.len() < 2 || first_table.plan.as_ref()?.get("design").is_some() {
        return None;
    }
    let mut other_keys = keys.to_vec();
    let axis = other_keys.remove(1);
    let mut rows_by_line: BTreeMap<Vec<u64>, (Vec<f64>, Vec<&SharedRow>)> = BTreeMap::new();
    for row in shared_rows {
        let mut key_values = row.key.clone();
        key_values.remove(1);
        let key_values_and_rows =
            rows_by_line.entry(sort_key(&key_values)).or_insert_with(|| (key_values, Vec::new()));
        key_values_and_rows.1.push(row);
    }
    let mut crossings_by_line = CrossingsByLine::new();
    for (key, (key_values, mut rows)) in rows_by_line {
        rows.sort_by(|a, b| a.key[1].total_cmp(&b.key[1]));
        let crossings_by_file = [0, 1].map(|file| {
            rows.windows(2)
                .filter_map(|pair| find_crossing(pair[0], pair[1], file, limit))
                .collect()
        });
        crossings_by_line.insert(key, LineCrossings { key_values, crossings_by_file });
    }
    Some(pair_crossings(first_table, &axis, other_keys, crossings_by_line))
}

/// Finds the crossing between two neighbours in one file, by a straight line through the logarithms
/// of their ratios.
fn find_crossing(
    lower_row: &SharedRow,
    upper_row: &SharedRow,
    file: usize,
    limit: f64,
) -> Option<BracketedCrossing> {
    let ratio_below = lower_row.ratios[file]?;
    let ratio_above = upper_row.ratios[file]?;
    if (ratio_below < limit) == (ratio_above < limit) {
        return None;
    }
    let bracket = [lower_row, upper_row].map(|row| [&row.key, &row.second_key][file][1]);
    let fraction = (limit / ratio_below).ln() / (ratio_above / ratio_below).ln();
    Some(BracketedCrossing { position: bracket[0] + fraction * (bracket[1] - bracket[0]), bracket })
}
