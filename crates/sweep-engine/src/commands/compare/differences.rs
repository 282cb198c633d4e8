//! The file of the differences between two results, which `sweep plot` draws.

use std::path::PathBuf;

use serde_json::json;

use super::CompareArgs;
use crate::{Build, Table};
use sweep_files::key;
use sweep_parameter::Worse;
use sweep_results::{Comparison, ResultTable, SharedRow};

/// Returns the table of differences, with one row for each row that both results have.
pub(super) fn differences_table(
    args: &CompareArgs,
    comparison: &Comparison,
    tables: &[ResultTable; 2],
    build: Build,
) -> Table {
    let mut table = Table::new(build);
    let shared_rows = || comparison.shared_rows.iter();
    table.add_counts("point", "row of A, from 0", shared_rows().map(|row| row.rows[0]));
    for (k, (file_name, unit)) in comparison.keys.iter().zip(&comparison.key_units).enumerate() {
        let description = tables[0]
            .column(file_name)
            .map_or("", |column| column.metadata.description.as_str())
            .to_owned();
        let unit = if unit.is_empty() { "1" } else { unit };
        table.add_numbers(file_name, unit, &description, shared_rows().map(|row| Some(row.key[k])));
    }
    let description = "greatest ratio of B over that of A; null where either has none";
    table.add_numbers(
        "ratio_change",
        "1",
        description,
        shared_rows().map(SharedRow::ratio_quotient),
    );
    table.set_worse(Worse::Greater);
    let description =
        "least gap of the nonlinear model in B less that in A; null where either has none";
    table.add_numbers(
        "gap_change_m",
        "m",
        description,
        shared_rows().map(SharedRow::gap_difference_m),
    );
    table.set_worse(Worse::Less);
    for (side, [suffix, file]) in [["a", "A"], ["b", "B"]].into_iter().enumerate() {
        let file_name = format!("ratio_max_{suffix}");
        let description = format!("greatest ratio of {file}");
        table.add_numbers(&file_name, "1", &description, shared_rows().map(|row| row.ratios[side]));
    }
    let description = "none, lost (reliable in A alone), gained (reliable in B alone), defined (a \
                       verdict in one file alone)";
    table.add_words("flip", description, shared_rows().map(|row| row.flip.name()));
    let sensitive_words = shared_rows().map(|row| if row.is_sensitive { "true" } else { "false" });
    table.add_words("sensitive", "true where either file calls the row chaotic", sensitive_words);
    let status_words =
        shared_rows().map(|row| if row.ratio_quotient().is_some() { "ok" } else { "no_ratio" });
    table.add_words("status", "ok, or no_ratio where either file has none", status_words);
    let file_name =
        |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plan_hashes =
        tables.each_ref().map(|table| table.file().value(key::PLAN_HASH).map(str::to_owned));
    table.add_metadata(
        key::DIFFERENCES,
        &json!({
            // Figures show the name under their title.
            "name": format!("{} compared with {}", file_name(&args.second), file_name(&args.first)),
            "first": file_name(&args.first),
            "second": file_name(&args.second),
            "plan_hash": plan_hashes,
            "plan": comparison.plan,
        }),
    );
    table
}
