//! `sweep parameters`: the parameter table, for reading or for programs.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, show};
use crate::library::parameters::{Listed, as_json, listed};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep parameters", "names, values, units, meaning and where each value is from"],
    ["sweep parameters my.toml", "the same with the values of this grid's machine"],
];

/// Arguments of `sweep parameters`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Grid file whose machine and spin give the values; without it the built-in machine's
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
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.grid.as_deref().map(|grid| config::load(grid, &[])).transpose()?;
    let rows = listed(plan.as_ref());
    show(&if args.json { as_json(&rows) } else { as_text(&rows) })
}

fn as_text(rows: &[Listed]) -> String {
    let value = |row: &Listed| row.value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let width = |length: &dyn Fn(&Listed) -> usize| rows.iter().map(length).max().unwrap_or(0);
    let name_width = width(&|row| row.parameter.name().len());
    let value_width = width(&|row| value(row).len());
    let unit_width = width(&|row| row.parameter.unit().len());
    let mut text = String::new();
    for row in rows {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{:name_width$}  {:>value_width$} {:unit_width$}  {} [{}]",
            row.parameter.name(),
            value(row),
            row.parameter.unit(),
            row.parameter.description(),
            row.source,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_holds_every_parameter() {
        let rows = listed(None);
        let text = as_text(&rows);
        assert_eq!(text.lines().count(), rows.len());
        assert!(text.contains("tub_mass_kg") && text.contains("23.87 kg"), "{text}");
    }
}
