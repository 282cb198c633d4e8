//! Time histories beside a map: which trace file belongs to which point, and a form small enough for a page.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::embed;
use crate::files::{FileError, regular};
use crate::plot::error::PlotError;
use crate::plot::grid::Grid;
use crate::plot::label;
use crate::plot::read::{Kind, Table};

/// Stretches of time that a history is cut into; of each, the least and the greatest value are kept.
const BUCKETS: usize = 500;

/// The trace files of a folder, by the place of their point in the grid:
///
/// ```text
/// { "<place>": { "time_s": floats, "series": { "<column>": { "data": 16 bit integers, "unit": size of their unit,
///                                                            "shown": "mm", "factor": 1000 } } } }
/// ```
///
/// A file belongs to the point that its metadata names (`at`: axis to value), or else to the one whose index (column `point`)
/// ends its name, as in `point-123.parquet`. Histories are cut into 500 stretches with two values each, the least and the
/// greatest in the order in which they occur, at the stretch's first and middle instant.
///
/// # Errors
/// [`PlotError::File`] for the folder; as [`Table::open`] for its files; [`PlotError::Unfit`] for a
/// file that is no trace or belongs to no point of the grid, and for a folder without any.
pub(crate) fn read(folder: &Path, map: &Table, grid: &Grid) -> Result<Value, PlotError> {
    let names = regular::names(folder).map_err(FileError::io("list", folder))?;
    let mut files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "parquet"));
    if files.is_empty() {
        return Err(PlotError::Unfit(format!(
            "`--traces {}`: no trace files (.parquet) in it",
            folder.display()
        )));
    }
    let mut histories = Map::new();
    for file in files {
        let table = Table::open(&file)?;
        let unfit = |what: &str| PlotError::Unfit(format!("`--traces`: {}: {what}", file.display()));
        if table.kind != Kind::Trace {
            return Err(unfit("not a trace file"));
        }
        let point = point(&table, map, grid).ok_or_else(|| {
            unfit("it belongs to no point of this map: neither its metadata (`at`) nor its name (point-<index>) says one")
        })?;
        histories.insert(point.to_string(), history(&table)?);
    }
    Ok(Value::Object(histories))
}

/// Place of a trace's point in the map's grid.
fn point(table: &Table, map: &Table, grid: &Grid) -> Option<usize> {
    if let Some(at) = table.find("at").and_then(Value::as_object) {
        let places: Option<Vec<usize>> = grid
            .axes
            .iter()
            .map(|axis| {
                let value = at.get(&axis.name)?.as_f64()?;
                let near = |known: &f64| (known - value).abs() <= 1e-9 * value.abs().max(known.abs());
                axis.values.iter().position(near)
            })
            .collect();
        if let Some(places) = places {
            return Some(grid.index(&places));
        }
    }
    let stem = table.path.file_stem()?.to_str()?;
    let digits = stem.rsplit(|letter: char| !letter.is_ascii_digit()).next()?;
    let wanted: u32 = digits.parse().ok()?;
    let row = map.numbers("point").ok()?.iter().position(|point| *point == f64::from(wanted))?;
    grid.rows().iter().position(|known| *known == Some(row))
}

fn history(table: &Table) -> Result<Value, PlotError> {
    let time = table.numbers("time_s")?;
    let stretches = stretches(time);
    let mut times = Vec::with_capacity(2 * stretches.len());
    for stretch in &stretches {
        times.extend([time[stretch.start], time[(stretch.start + stretch.end) / 2]]);
    }
    let mut series = Map::new();
    for column in &table.columns {
        let Some(numbers) = column.numbers() else { continue };
        if column.name == "time_s" {
            continue;
        }
        let mut kept = Vec::with_capacity(2 * stretches.len());
        for stretch in &stretches {
            kept.extend(least_and_greatest(&numbers[stretch.clone()]));
        }
        let (unit, factor) = label::shown(&column.unit);
        let (data, size) = embed::quantised(&kept);
        series.insert(
            column.name.clone(),
            json!({ "data": data, "unit": size, "shown": unit, "factor": factor }),
        );
    }
    Ok(json!({ "time_s": embed::floats(times.into_iter()), "series": series }))
}

/// Rows of each stretch; one with a single row where there are few.
fn stretches(time: &[f64]) -> Vec<std::ops::Range<usize>> {
    let count = BUCKETS.min(time.len());
    (0..count).map(|k| k * time.len() / count..(k + 1) * time.len() / count).collect()
}

/// In the order in which they occur; NaN if nothing in the stretch is finite.
fn least_and_greatest(values: &[f64]) -> [f64; 2] {
    let mut found: Option<(usize, usize)> = None;
    for (k, value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let (least, greatest) = found.unwrap_or((k, k));
        found = Some((
            if *value < values[least] { k } else { least },
            if *value > values[greatest] { k } else { greatest },
        ));
    }
    found
        .map_or([f64::NAN; 2], |(least, greatest)| [values[least.min(greatest)], values[least.max(greatest)]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_keep_their_order() {
        assert_eq!(least_and_greatest(&[0.0, 3.0, -2.0, 1.0]), [3.0, -2.0]);
        assert_eq!(least_and_greatest(&[f64::NAN, 5.0]), [5.0, 5.0]);
        assert!(least_and_greatest(&[f64::NAN]).iter().all(|value| value.is_nan()));
    }

    #[test]
    fn stretches_cover_every_row_once() {
        for rows in [1, 3, 499, 500, 501, 12_345] {
            let covered: Vec<usize> = stretches(&vec![0.0; rows]).into_iter().flatten().collect();
            assert_eq!(covered, (0..rows).collect::<Vec<_>>());
        }
    }
}
