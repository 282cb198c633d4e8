//! `sweep show FILE` prints the contents of a Parquet file of this program.

use crate::dwell;
use crate::stability::tongues;
use sweep_engine::Error;
use sweep_engine::commands::show::ModelSummary;
use sweep_files::{FileKind, ParquetFile};
use washer_row::Metric;

/// The additions of this model to the engine's `sweep show`.
pub(super) const MODEL_SUMMARY: ModelSummary<'static> =
    ModelSummary { lines: &summary_lines, is_metric_column };

/// Returns the lines of the summary of a file about held speeds, each with its name.
fn summary_lines(file: &ParquetFile) -> Result<Vec<(&'static str, String)>, Error> {
    Ok(match file.kind() {
        Some(FileKind::Stability) => tongues::summarise(file)?.lines(),
        Some(FileKind::Dwell) => dwell::summary::summary_lines(file)?,
        _ => Vec::new(),
    })
}

/// Returns whether a column belongs to a metric.
fn is_metric_column(column: &str) -> bool {
    // The name of a column of one stop or foot has a number after the first word.
    let words_without_numbers = column.split('_').filter(|word| word.parse::<u32>().is_err());
    let name = words_without_numbers.collect::<Vec<_>>().join("_");
    Metric::ALL.iter().any(|metric| name.starts_with(metric.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_metrics_are_told_from_others() {
        let metric_columns = ["cabinet_force_linear_n", "static_sag_m", "stop_2_force_nonlinear_n"];
        for name in
            [metric_columns.as_slice(), &["foot_load_linear_n", "growth_mode_1_name"]].concat()
        {
            assert!(is_metric_column(name), "{name}");
        }
        for name in ["ratio_max", "stop_2_clearance_m", "min_gap_linear_m", "status"] {
            assert!(!is_metric_column(name), "{name}");
        }
    }
}
