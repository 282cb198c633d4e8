//! Time histories beside a map: which trace file belongs to which point, and a form small enough
//! for a page.

use std::path::{Path, PathBuf};

use serde_json::{Map as Object, Value, json};

use super::{chart_json, embed};
use crate::error::{PlotError, Result};
use crate::gather::Map;
use crate::model::Figures;
use crate::read::{Kind, Source};
use crate::table::Table;
use crate::together::{self, At};
use sweep_files::{FileError, regular};

/// Stretches of time that a history is cut into; of each, the least and the greatest value are
/// kept.
const STRETCHES: usize = 500;

/// The charts of a folder's trace files, by the place of their point in the grid, their curves
/// quantised. A file belongs to the point that its metadata names (`at`: axis to value), or else to
/// the one whose index (column `point`) ends its name, as in `point-123.parquet`. Histories are cut
/// into 500 stretches with two values each, the least and the greatest in the order in which they
/// occur, at the stretch's first and middle instant.
///
/// # Errors
/// [`PlotError::File`] for the folder; as [`Table::open`] for its files; [`PlotError::Unfit`] for a
/// file that is not a trace or belongs to no point of the grid, and for a folder without any.
pub(crate) fn read(folder: &Path, map: &Map, model: &dyn Figures) -> Result<Value> {
    let known = map.table.source.known;
    let names = regular::names(folder).map_err(FileError::io("list", folder))?;
    let mut files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "parquet"));
    if files.is_empty() {
        return Err(PlotError::Unfit(format!(
            "`--traces {}`: no trace files (.parquet) in it",
            folder.display()
        )));
    }
    let mut histories = Object::new();
    for file in files {
        let source = Source::open(&file, known)?;
        let unfit =
            |what: &str| PlotError::Unfit(format!("`--traces`: {}: {what}", file.display()));
        if source.kind != Kind::TRACE {
            return Err(unfit("not a trace file"));
        }
        let at = together::at(&source);
        let cell = cell(&source, &at, map).ok_or_else(|| {
            unfit(
                "it belongs to no point of this map: neither its metadata (`at`) nor its name \
                   (point-<index>) says one",
            )
        })?;
        let point = point(&at, cell, map);
        // Where a cell holds several points, which of them a number means is not known.
        let own = if at.is_empty() && map.grid.merged() { &point } else { &at };
        let files = [(&map.table.source, &point), (&source, own)];
        together::agree("--traces", &file, files, &together::of_runs(known))?;
        let chart = model.history(&Table::read_thinned(source, STRETCHES)?)?;
        let chart = chart_json(&chart, |values| json!(embed::quantised(values)));
        histories.insert(cell.to_string(), chart);
    }
    Ok(Value::Object(histories))
}

/// The cell of a trace's point in the map's grid.
fn cell(trace: &Source, at: &At, map: &Map) -> Option<usize> {
    // What says its point is of no other, whatever it is called.
    if !at.is_empty() {
        let value =
            |name: &str| at.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
        let places = map.grid.axes.iter().map(|axis| axis.place_near(value(&axis.swept.name)?));
        let places: Vec<usize> = places.collect::<Option<_>>()?;
        return Some(map.grid.index(places)).filter(|&cell| map.filled(cell));
    }
    let stem = trace.path.file_stem()?.to_str()?;
    let digits = stem.rsplit(|letter: char| !letter.is_ascii_digit()).next()?;
    let wanted: u32 = digits.parse().ok()?;
    map.table.numbers("point").ok()?.iter().position(|point| *point == f64::from(wanted))
}

/// The values of the map's axes at a trace's point.
fn point(at: &At, cell: usize, map: &Map) -> At {
    let mut rest = cell;
    let mut point = At::new();
    for axis in map.grid.axes.iter().rev() {
        let named = at.iter().find(|(name, _)| *name == axis.swept.name);
        let value = named.map_or(axis.values[rest % axis.values.len()], |(_, value)| *value);
        point.push((axis.swept.name.clone(), value));
        rest /= axis.values.len();
    }
    point
}
