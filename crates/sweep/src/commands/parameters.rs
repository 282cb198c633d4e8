//! `sweep parameters`: the parameter table, for reading or for programs.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};
use washer_model::{Machine, Parameter, Range, Spin, Target};

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, show};

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

/// A line of the listing.
struct Listed {
    parameter: Parameter,
    /// `None` without a grid for numbers only a grid gives, and where several numbers differ.
    value: Option<f64>,
    source: String,
}

/// Prints every parameter with value, unit, meaning and source.
///
/// # Errors
/// Mistakes in the grid file, or standard output that cannot be written.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let rows = match &args.grid {
        Some(grid) => {
            let plan = config::load(grid, &[])?;
            rows(&plan.machine, &plan.spin, Some(plan.window_s))
        }
        // The spin's parameters exist without a grid, but have no value.
        None => rows(&Machine::paper(), &Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 }, None),
    };
    show(&if args.json { as_json(&rows) } else { as_text(&rows) })
}

/// Every parameter with its value; those of spin and window have one only if a grid gives its
/// window.
fn rows(machine: &Machine, spin: &Spin, window_s: Option<[f64; 2]>) -> Vec<Listed> {
    let built_in = Machine::paper();
    let row = |parameter: Parameter| {
        let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let value = match parameter.target() {
            Target::Window(edge) => window_s.map(|window_s| window_s[edge]),
            _ => parameter.get(machine, spin).filter(|_| window_s.is_some() || !of_grid),
        };
        let as_built_in = parameter.get(&built_in, spin) == value;
        let source = if of_grid || as_built_in {
            parameter.source().to_string()
        } else {
            "given".to_owned()
        };
        Listed { parameter, value, source }
    };
    Parameter::all(machine, spin).into_iter().map(row).collect()
}

fn as_json(rows: &[Listed]) -> String {
    let row = |row: &Listed| {
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

/// Bounds of a range, `null` where there is none but the common greatest magnitude.
fn range(range: Range) -> Value {
    let (least, greatest) = match range {
        Range::Any => (None, None),
        Range::Positive | Range::NonNegative => (Some(0.0), None),
        Range::Negative => (None, Some(0.0)),
        Range::Within(least, greatest) => (Some(least), Some(greatest)),
    };
    let excluded = matches!(range, Range::Positive | Range::Negative);
    json!({ "least": least, "greatest": greatest, "zero_excluded": excluded })
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
    fn text_and_json_hold_every_parameter() {
        let spin = Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 };
        let rows = rows(&Machine::paper(), &spin, Some([0.0, 1.0]));
        let text = as_text(&rows);
        assert_eq!(text.lines().count(), rows.len());
        assert!(text.contains("tub_mass_kg") && text.contains("23.87 kg"), "{text}");
        let json: Value = serde_json::from_str(&as_json(&rows)).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(Parameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn a_value_of_the_users_own_is_not_ascribed_to_the_paper() {
        let mut machine = Machine::paper();
        machine.tub.mass_kg = 20.0;
        let rows = rows(&machine, &Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 }, None);
        let row = |name: &str| rows.iter().find(|row| row.parameter.name() == name).unwrap();
        assert_eq!(row("tub_mass_kg").source, "given");
        assert_eq!(row("shaft_mass_kg").source, "paper, Table 2");
        assert_eq!(row("spin_peak_rpm").value, None);
    }
}
