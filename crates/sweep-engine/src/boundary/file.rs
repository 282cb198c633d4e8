//! The boundary file: one row per place where the side changes, or per row of the first axis that
//! has none.

use serde_json::{Value, json};
use sweep_parameter::unit_suffix;

use super::{BoundaryRow, BoundaryTask, Edge, TracedBoundary, TracedQuantity};
use crate::{Job, Model, Table};
use sweep_files::{FileKind, key};

/// A row of the file.
struct EdgeRow<'a> {
    curve: usize,
    row: &'a BoundaryRow,
    /// The number from 1; 0 where there is none in range.
    number: usize,
    edge: &'a Edge,
}

/// Returns a name with a word before its unit's suffix: `damping_low_n_s_per_m` for
/// `damping_n_s_per_m` and `low`.
fn insert_word(name: &str, unit: &str, word: &str) -> String {
    let suffix = unit_suffix(unit).unwrap_or_default();
    let stem = name.strip_suffix(suffix).unwrap_or(name);
    format!("{stem}_{word}{}", &name[stem.len()..])
}

impl<M: Model> BoundaryTask<M> {
    /// Returns the job of the store: the plan, with what is asked beside the grid.
    pub fn job(&self) -> Job<'_> {
        let mut job = Job::new(&self.plan);
        job.layout.kind = FileKind::Boundary;
        job.plan["boundary"] = self.settings();
        job
    }

    fn settings(&self) -> Value {
        json!({
            "quantity": self.quantity.name,
            "limit": self.quantity.limit,
            "tolerance": self.search.tolerance,
            "lattice": self.search.lattice,
        })
    }

    /// Returns the table of the traced curves.
    pub fn table(&self, traced: &TracedBoundary) -> Table {
        let mut about = self.settings();
        about["worse"] = self.quantity.worse.name().into();
        about["points"] = traced.trials.into();
        about["rounds"] = traced.rounds.into();
        let mut table = Table::new(M::ABOUT.build);
        self.add_columns(&mut table, traced);
        let job = self.job();
        table.metadata(key::PLAN, &job.plan);
        table.text(key::PLAN_HASH, job.hash().to_hex().to_string());
        table.metadata(key::BOUNDARY, &about);
        table
    }

    fn add_columns(&self, table: &mut Table, traced: &TracedBoundary) {
        let TracedQuantity { name: quantity, unit, .. } = &self.quantity;
        let mut lines = Vec::new();
        for (curve, rows) in traced.curves.iter().enumerate() {
            for row in rows {
                for (k, edge) in row.edges.iter().enumerate() {
                    let number = if edge.bracket.is_some() { k + 1 } else { 0 };
                    lines.push(EdgeRow { curve, row, number, edge });
                }
            }
        }
        self.add_axes(table, &lines);
        table.words(
            "kind",
            "crossing, jump (the quantity leaps over its limit), undefined (it is not defined on \
             one side), or why there is none in range: reliable, unreliable or undefined wherever \
             it was evaluated",
            lines.iter().map(|line| line.edge.kind.name()),
        );
        table.counts(
            "crossing",
            "number of this change of side at this value of the first axis, from 1 upwards along \
             the second; 0 where none is in range",
            lines.iter().map(|line| line.number as u64),
        );
        let changes = lines
            .iter()
            .map(|line| line.row.edges.iter().filter(|edge| edge.bracket.is_some()).count() as u64);
        table.counts("crossings", "how many changes of side there are", changes);
        for (end, word, side) in [(0, "low", "lower"), (1, "high", "upper")] {
            let name = format!("quantity_{word}");
            let description =
                format!("{quantity} at the bracket's {side} end; null where not defined");
            let value = |line: &EdgeRow<'_>| Some(self.quantity.value(line.edge.distances[end]?));
            table.numbers(&name, unit, &description, lines.iter().map(value));
        }
        let trials = lines.iter().map(|line| line.row.trials as u64);
        table.counts("points", "points evaluated at this value of the first axis", trials);
    }

    /// Adds both axes, the bracket, and the axes beyond the second.
    fn add_axes(&self, table: &mut Table, lines: &[EdgeRow<'_>]) {
        let [first, second, further @ ..] = self.plan.axes.as_slice() else { return };
        let name = &*second.parameter.name;
        let unit = second.parameter.unit;
        table.parameter(&first.parameter, lines.iter().map(|line| Some(line.row.first)));
        let what = second.parameter.description;
        let TracedQuantity { name: quantity, limit, .. } = &self.quantity;
        let description =
            format!("{what}, where {quantity} = {limit}; null unless it is a crossing");
        table.numbers(name, unit, &description, lines.iter().map(|line| line.edge.at));
        for (end, word, side) in [(0, "low", "lower"), (1, "high", "upper")] {
            let description = format!(
                "{side} end of the bracket in which the side changes; null where none is in range"
            );
            let value = |line: &EdgeRow<'_>| Some(line.edge.bracket?[end]);
            table.numbers(
                &insert_word(name, unit, word),
                unit,
                &description,
                lines.iter().map(value),
            );
        }
        for (k, axis) in further.iter().enumerate() {
            let values = lines
                .iter()
                .map(|line| self.plan.axis_values(line.curve as u64).get(2 + k).copied());
            table.parameter(&axis.parameter, values);
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
