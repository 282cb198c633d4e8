//! `sweep parameters`: prints the table of parameters, as text or JSON.

use std::path::PathBuf;

use serde_json::{Value, json};
use sweep_parameter::{Parameter as _, Range};

use crate::{Error, Exit, GridInput, Listed, Swept, show};

/// Arguments of `sweep parameters`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Grid file whose values are listed; without it only values that need no grid have one
    #[arg(value_name = "GRID.toml")]
    grid: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Prints every parameter with value, unit, meaning and source.
///
/// # Errors
/// Mistakes in the grid file, or standard output that cannot be written.
pub fn run<M: Swept>(args: &Args) -> Result<Exit, Error> {
    let plan =
        args.grid.clone().map(|grid| GridInput::<M>::file(grid, Vec::new()).load()).transpose()?;
    let rows = M::listed(plan.as_ref());
    show(&if args.json { as_json(&rows) } else { as_text(&rows) })
}

fn as_text<M: Swept>(rows: &[Listed<M>]) -> String {
    let value =
        |row: &Listed<M>| row.value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let width = |length: &dyn Fn(&Listed<M>) -> usize| rows.iter().map(length).max().unwrap_or(0);
    let name_width = width(&|row| row.parameter.name().len());
    let value_width = width(&|row| value(row).len());
    let unit_width = width(&|row| row.parameter.unit().len());
    let line = |row: &Listed<M>| {
        let name = row.parameter.name();
        let value = value(row);
        let unit = row.parameter.unit();
        let meaning = row.parameter.description();
        let source = &row.source;
        format!(
            "{name:name_width$}  {value:>value_width$} {unit:unit_width$}  {meaning} [{source}]\n"
        )
    };
    rows.iter().map(line).collect()
}

/// Formats the table as JSON.
pub fn as_json<M: Swept>(rows: &[Listed<M>]) -> String {
    let row = |row: &Listed<M>| {
        json!({
            "name": row.parameter.name(),
            "value": row.value,
            "unit": row.parameter.unit(),
            "description": row.parameter.description(),
            "range": range(row.parameter.range()),
            "source": row.source,
        })
    };
    format!("{:#}\n", rows.iter().map(row).collect::<Value>())
}

/// Returns the bounds of a range as JSON, `null` for an end that only the common greatest magnitude
/// limits.
fn range(range: Range) -> Value {
    let [least, greatest] = range.bounds();
    json!({ "least": least, "greatest": greatest, "zero_excluded": range.excludes_zero() })
}
