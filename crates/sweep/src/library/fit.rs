//! Numbers of a machine from measured run-ups, as data and in words.

use serde_json::json;

use super::{Effort, Explained, PointTable};
use crate::config::GridInput;
use crate::fit::{self, FitOptions, Measured, Work};
use sweep_engine::{Error, threads};

/// Fits numbers of a grid's machine to measurements: tables of `time_s`, perhaps `speed_rpm`, and
/// channels, each with constants of its own (`NAME=VALUE`). `None` if it was interrupted.
///
/// # Errors
/// Mistakes in the grid, the tables or the options; data that cannot tell.
pub fn fit_tables(
    grid: &GridInput,
    tables: Vec<(PointTable, Vec<String>)>,
    options: &FitOptions,
    effort: Effort<'_>,
) -> Result<Option<Explained>, Error> {
    let mut cases = Vec::with_capacity(tables.len());
    for (k, (table, constants)) in tables.into_iter().enumerate() {
        let mut measured = Measured::of_columns(table.into_columns())?;
        if k > 0 {
            measured.name = format!("table {}", k + 1);
        }
        cases.push(fit::case(grid, &constants, measured)?);
    }
    let stop = || effort.interrupt.stopped();
    let work = Work { stop: &stop, seen: &|_| {}, journal: None };
    let found = threads::pool(effort.threads()?)?.install(|| fit::fit(cases, options, &work))?;
    Ok(found.map(|fitted| Explained { found: json!(fitted.report), text: fitted.report.text() }))
}
