//! `sweep show FILE`: what a Parquet file of this program holds.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::Value;

use super::examples::Examples;
use super::run::{counts, line};
use crate::exit::{Error, Exit, show};
use crate::identity;
use crate::stability::tongues;
use crate::store::read::{ColumnRange, Extreme, Overview, ResultFile, overview, row, tally};
use sweep_files::{FileKind, ParquetFile};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples =
    &[["sweep show results/first.parquet", "verdicts, extremes, columns with units and ranges"]];

/// Arguments of `sweep show`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A result, trace, modes, stability or boundary file
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Shows a file's content in short: for a result its verdicts and extremes, for any file its
/// columns and their ranges.
///
/// # Errors
/// A file that cannot be read, or is not Parquet.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let opened = ParquetFile::open(&args.file)?;
    let file = overview(&opened)?;
    let mut text = String::new();
    line(&mut text, "file", &args.file.display().to_string());
    match &file.result {
        Some(result) => {
            provenance(&mut text, result);
            if !opened.is_sealed() {
                line(
                    &mut text,
                    "checked",
                    "no: it carries no digest, as files of older builds do not",
                );
            }
            let tally = tally(&opened)?;
            let limit = result.plan["reliability"]["ratio_limit"].as_f64().unwrap_or(f64::NAN);
            let axes: Vec<&str> =
                axes(&result.plan).iter().filter_map(|axis| axis["parameter"].as_str()).collect();
            let places =
                places(&opened, &axes, &[&tally.greatest_ratio, &tally.least_gap_nonlinear_m])?;
            let at = |point| {
                places
                    .iter()
                    .find(|(known, _)| *known == point)
                    .map_or(String::new(), |(_, at)| at.clone())
            };
            text.push_str(&counts(&tally, limit, &at));
        }
        None => {
            line(&mut text, "made by", opened.created_by().unwrap_or("unknown"));
            if FileKind::Stability.has_keys(&|key| opened.value(key).is_some()) {
                for (name, words) in tongues::summary(&opened)?.lines() {
                    line(&mut text, name, &words);
                }
            }
        }
    }
    columns(&mut text, &file);
    show(&text)
}

fn provenance(text: &mut String, result: &ResultFile) {
    let plan = &result.plan;
    line(text, "name", plan["name"].as_str().unwrap_or_default());
    let build = identity::words(&result.version, result.numerics);
    line(text, "made by", &format!("{build}, plan {}", &result.plan_hash));
    for (name, key) in [("spin", "spin"), ("time", "time"), ("method", "integrator")] {
        line(text, name, &brief(&plan[key]));
    }
    if let Some(criterion) = plan["reliability"]["criterion"].as_str() {
        line(text, "criterion", criterion);
    }
    for axis in axes(plan) {
        let values = axis.get("range").or(axis.get("values")).map(brief).unwrap_or_default();
        line(
            text,
            "axis",
            &format!("{}: {values}", axis["parameter"].as_str().unwrap_or_default()),
        );
    }
}

/// A small JSON value on one line, as a person would write it.
fn brief(value: &Value) -> String {
    let list = |parts: Vec<String>| parts.join(", ");
    match value {
        Value::Object(map) => {
            list(map.iter().map(|(key, value)| format!("{key} {}", brief(value))).collect())
        }
        Value::Array(values) => match values.get(..12) {
            Some(first) if values.len() > 12 => {
                format!(
                    "{}, ... ({} values)",
                    list(first.iter().map(brief).collect()),
                    values.len()
                )
            }
            _ => list(values.iter().map(brief).collect()),
        },
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn axes(plan: &Value) -> &[Value] {
    plan["axis"].as_array().map_or(&[], Vec::as_slice)
}

/// Where the extremes lie, in axis values.
fn places(
    file: &ParquetFile,
    axes: &[&str],
    extremes: &[&Option<Extreme>],
) -> Result<Vec<(u64, String)>, Error> {
    let mut places = Vec::new();
    for extreme in extremes.iter().filter_map(|extreme| extreme.as_ref()) {
        let values = row(file, extreme.point, axes)?;
        let at: Vec<String> =
            axes.iter().zip(values).map(|(axis, value)| format!("{axis} {value}")).collect();
        places.push((extreme.point, at.join(", ")));
    }
    Ok(places)
}

/// The columns with their units and ranges.
fn columns(text: &mut String, file: &Overview) {
    line(text, "rows", &file.rows.to_string());
    let width = file.columns.iter().map(|column| column.name.len()).max().unwrap_or(0);
    for column in &file.columns {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "    {:width$}  {}", column.name, range(column));
    }
}

fn range(column: &ColumnRange) -> String {
    let mut parts = Vec::new();
    if let Some((least, greatest)) = column.range {
        let unit = column
            .unit
            .as_deref()
            .filter(|unit| *unit != "1")
            .map(|unit| format!(" {unit}"))
            .unwrap_or_default();
        parts.push(format!("{} to {}{unit}", short(least), short(greatest)));
    }
    parts.extend(column.names.iter().map(|(name, count)| format!("{count} {name}")));
    if column.nulls > 0 {
        parts.push(format!("{} null", column.nulls));
    }
    parts.join(", ")
}

/// Six digits, without an exponent where that reads well.
fn short(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) {
        let text = format!("{value:.6}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{value:.5e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_read_as_a_person_would_write_them() {
        let spin = serde_json::json!({ "profile": "ramp", "peak_rpm": 350.0 });
        assert_eq!(brief(&spin), "peak_rpm 350.0, profile ramp");
        assert_eq!(brief(&serde_json::json!([1, 2.5])), "1, 2.5");
        let long: Vec<u32> = (0..40).collect();
        assert!(brief(&serde_json::json!(long)).ends_with("10, 11, ... (40 values)"));
    }

    #[test]
    fn numbers_are_short() {
        let shown: Vec<String> =
            [0.0, 0.05, 300.0, -1.5e-7, 2e12, 1.0 / 3.0].into_iter().map(short).collect();
        assert_eq!(shown, ["0", "0.05", "300", "-1.50000e-7", "2.00000e12", "0.333333"]);
    }
}
