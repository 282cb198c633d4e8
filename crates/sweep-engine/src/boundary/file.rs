//! The boundary file: a row for each crossing of the limit, and a row for each value of the first
//! axis without a crossing.

use serde_json::{Value, json};
use sweep_parameter::unit_suffix;

use super::{BoundaryRow, BoundaryTask, SideChange, TracedBoundary, TracedQuantity};
use crate::{Job, Model, Table};
use sweep_files::{FileKind, key};

/// A row of the file.
struct SideChangeRow<'a> {
    curve_index: usize,
    row: &'a BoundaryRow,
    /// The number of the change of side on its line, from 1; 0 if there is none in range.
    change_number: usize,
    side_change: &'a SideChange,
}

/// Returns a name with a word before its unit's suffix: `damping_low_n_s_per_m` for
/// `damping_n_s_per_m` and `low`.
fn insert_word(name: &str, unit: &str, word: &str) -> String {
    let suffix = unit_suffix(unit).unwrap_or_default();
    let stem = name.strip_suffix(suffix).unwrap_or(name);
    format!("{stem}_{word}{}", &name[stem.len()..])
}

impl<M: Model> BoundaryTask<M> {
    /// Returns the job of the store, whose plan has the settings of the search too.
    pub fn job(&self) -> Job<'_> {
        let mut job = Job::new(&self.plan);
        job.layout.kind = FileKind::Boundary;
        job.plan["boundary"] = self.settings_json();
        job
    }

    fn settings_json(&self) -> Value {
        json!({
            "quantity": self.quantity.name,
            "limit": self.quantity.limit,
            "tolerance": self.range.tolerance,
            "lattice": self.range.lattice_cells,
        })
    }

    /// Returns the table of the traced curves.
    pub fn table(&self, traced_boundary: &TracedBoundary) -> Table {
        let mut search_metadata = self.settings_json();
        search_metadata["worse"] = self.quantity.worse.name().into();
        search_metadata["points"] = traced_boundary.trial_count.into();
        search_metadata["rounds"] = traced_boundary.batch_count.into();
        let mut table = Table::new(M::ABOUT.build);
        self.add_columns(&mut table, traced_boundary);
        let job = self.job();
        table.add_metadata(key::PLAN, &job.plan);
        table.add_text(key::PLAN_HASH, job.hash().to_hex().to_string());
        table.add_metadata(key::BOUNDARY, &search_metadata);
        table
    }

    fn add_columns(&self, table: &mut Table, traced_boundary: &TracedBoundary) {
        let TracedQuantity { name: quantity, unit, .. } = &self.quantity;
        let mut change_rows = Vec::new();
        for (curve, rows) in traced_boundary.rows_by_curve.iter().enumerate() {
            for row in rows {
                for (k, side_change) in row.side_changes.iter().enumerate() {
                    let number = if side_change.bracket.is_some() { k + 1 } else { 0 };
                    change_rows.push(SideChangeRow {
                        curve_index: curve,
                        row,
                        change_number: number,
                        side_change,
                    });
                }
            }
        }
        self.add_axes(table, &change_rows);
        table.add_words(
            "kind",
            "crossing, jump (the quantity leaps over its limit), undefined (it is not defined on \
             one side), or why there is none in range: reliable, unreliable or undefined wherever \
             it was evaluated",
            change_rows.iter().map(|change_row| change_row.side_change.kind.name()),
        );
        table.add_counts(
            "crossing",
            "number of this change of side at this value of the first axis, from 1 upwards along \
             the second; 0 where none is in range",
            change_rows.iter().map(|change_row| change_row.change_number as u64),
        );
        let change_counts = change_rows.iter().map(|change_row| {
            change_row
                .row
                .side_changes
                .iter()
                .filter(|side_change| side_change.bracket.is_some())
                .count() as u64
        });
        table.add_counts("crossings", "how many changes of side there are", change_counts);
        for (side_index, word, side_word) in [(0, "low", "lower"), (1, "high", "upper")] {
            let name = format!("quantity_{word}");
            let description =
                format!("{quantity} at the bracket's {side_word} end; null where not defined");
            let value = |change_row: &SideChangeRow<'_>| {
                Some(self.quantity.value(change_row.side_change.distances[side_index]?))
            };
            table.add_numbers(&name, unit, &description, change_rows.iter().map(value));
        }
        let trial_counts = change_rows.iter().map(|change_row| change_row.row.trial_count as u64);
        table.add_counts(
            "points",
            "points evaluated at this value of the first axis",
            trial_counts,
        );
    }

    /// Adds both axes, the bracket, and the axes beyond the second.
    fn add_axes(&self, table: &mut Table, change_rows: &[SideChangeRow<'_>]) {
        let [first, second, other_axes @ ..] = self.plan.axes.as_slice() else { return };
        let name = &*second.parameter.name;
        let unit = second.parameter.unit;
        table.add_parameter(
            &first.parameter,
            change_rows.iter().map(|change_row| Some(change_row.row.first_value)),
        );
        let second_description = second.parameter.description;
        let TracedQuantity { name: quantity, limit, .. } = &self.quantity;
        let description = format!(
            "{second_description}, where {quantity} = {limit}; null unless it is a crossing"
        );
        table.add_numbers(
            name,
            unit,
            &description,
            change_rows.iter().map(|change_row| change_row.side_change.position),
        );
        for (side_index, word, side_word) in [(0, "low", "lower"), (1, "high", "upper")] {
            let description = format!(
                "{side_word} end of the bracket in which the side changes; null where none is in \
                 range"
            );
            let value =
                |change_row: &SideChangeRow<'_>| Some(change_row.side_change.bracket?[side_index]);
            table.add_numbers(
                &insert_word(name, unit, word),
                unit,
                &description,
                change_rows.iter().map(value),
            );
        }
        for (k, axis) in other_axes.iter().enumerate() {
            let values = change_rows.iter().map(|change_row| {
                self.plan.axis_values(change_row.curve_index as u64).get(2 + k).copied()
            });
            table.add_parameter(&axis.parameter, values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_stands_before_the_unit() {
        assert_eq!(insert_word("damping_n_s_per_m", "N s/m", "low"), "damping_low_n_s_per_m");
        assert_eq!(insert_word("front_x_m", "m", "high"), "front_x_high_m");
        assert_eq!(insert_word("plain", "1", "low"), "plain_low");
    }
}
