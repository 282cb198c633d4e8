//! Fits of a machine's parameters to measured run-ups, as data and as text.

use lane_ode::Cancel;
use serde_json::json;

use super::{CommandReport, Execution, PointTable};
use crate::config::WasherGridInput;
use crate::fit::{self, FitContext, FitOptions, Measurement};
use sweep_engine::{Error, threads};

/// Fits parameters of a grid's machine to measurements; `None` if it was interrupted. A measurement
/// is a table of `time_s`, channels and possibly `speed_rpm`, with its own constants `NAME=VALUE`.
///
/// # Errors
/// Returns an error for mistakes in the grid, the tables or the options, and for data that do not
/// determine the parameters.
pub fn fit_tables(
    grid: &WasherGridInput,
    tables: Vec<(PointTable, Vec<String>)>,
    options: &FitOptions,
    execution: Execution<'_>,
) -> Result<Option<CommandReport>, Error> {
    if tables.is_empty() {
        return Err(Error::option("table", "[]", "a table or more"));
    }
    options.check()?;
    let columns = grid.load()?.reading_notes.columns;
    let mut cases = Vec::with_capacity(tables.len());
    for (k, (table, constants)) in tables.into_iter().enumerate() {
        let mut measurement = Measurement::from_columns(table.into_columns(), &columns)?;
        if k > 0 {
            measurement.name = format!("table {}", k + 1);
        }
        cases.push(fit::prepare_case(grid, &constants, measurement)?);
    }
    let cancel = Cancel::Flag(execution.interrupt.flag());
    let context = FitContext { cancel, report_evaluations: &|_| {}, output: None, fresh: false };
    let fit_result = threads::build_pool(execution.threads()?)?
        .install(|| fit::fit(cases, options, &context))?;
    Ok(fit_result.map(|fit| CommandReport { data: json!(fit.report), text: fit.report.to_text() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sweep_engine::{Interrupt, ProgressMode};

    #[test]
    fn no_table_and_too_many_draws_are_refused() {
        let interrupt = Interrupt::new();
        let execution =
            || Execution { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let options = FitOptions {
            free: Vec::new(),
            own: Vec::new(),
            model: "linear".to_owned(),
            no_shift: true,
            starts: 1,
            bootstrap: 0,
            known: Vec::new(),
            draws: 0,
        };
        let grid = WasherGridInput::text("fit", String::new(), Vec::new());
        let refusal_message = |options: &FitOptions| {
            fit_tables(&grid, Vec::new(), options, execution()).unwrap_err().to_string()
        };
        assert!(refusal_message(&options).contains("a table or more"));
        let excessive_count = 1_000_000_000;
        for wrong_options in [
            FitOptions { starts: excessive_count, ..options.clone() },
            FitOptions { starts: 0, ..options.clone() },
            FitOptions { bootstrap: excessive_count, ..options.clone() },
            FitOptions { draws: excessive_count, ..options.clone() },
        ] {
            let refused = wrong_options.check().unwrap_err().to_string();
            assert!(refused.contains("a number from"), "{refused}");
        }
        assert!(options.check().is_ok());
    }
}
